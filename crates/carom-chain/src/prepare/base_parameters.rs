//! Base inertial parameters: the smallest set of inertial parameters that gives the same equations of motion (Gautier &
//! Khalil, *Direct calculation of minimum set of inertial parameters of serial robots*, IEEE Trans. Robotics and
//! Automation 6 (1990)).
//!
//! The part of a body's inertia that is invariant under rotation about its hinge can be assigned to the parent body: the
//! mass, placed on the axis, and a rotational inertia that is equal about all axes perpendicular to the hinge. This is
//! done from the last body to the first; on the world it is dropped. A body on a hinge then has no mass, no third
//! component of the first moment and no second diagonal element of the rotational inertia.
//!
//! Kinetic energy is the same function of q and q̇ as before, and potential energy is the same but for a constant. The same
//! holds for M, C q̇ + g and the pivots of M. It does not hold for quantities of a single body: its momentum, its weight and
//! its centre of mass.

use crate::algebra::{Algebra, Inertia};
use crate::body::Body;

/// The base inertial parameters of each body. Bodies on joints other than hinges keep their inertia and receive that of
/// their children.
pub(crate) fn base_parameters<A: Algebra>(bodies: &[Body<A>]) -> Vec<Inertia<A>> {
    let mut inertia: Vec<Inertia<A>> = bodies.iter().map(|body| body.inertia).collect();
    for (i, body) in bodies.iter().enumerate().rev().filter(|(_, body)| A::turns(body.joint)) {
        let unturned = A::unturned(inertia[i]);
        inertia[i] = Inertia {
            mass: inertia[i].mass - unturned.mass,
            first_moment: inertia[i].first_moment - unturned.first_moment,
            rotational: inertia[i].rotational - unturned.rotational,
        };
        // Invariant under rotation about the hinge: the placement at zero can be used.
        if let Some(below) = body.parent {
            inertia[below] += unturned.placed(&body.placement);
        }
    }
    inertia
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Chain, Spatial, uniform_chain};
    use nalgebra::Vector3;

    /// Kinetic and potential energy, summed over the bodies with the inertias given.
    fn energies(chain: &Chain, q: &[f64], qd: &[f64]) -> (f64, f64) {
        let mut ws = chain.workspace();
        let mut kin = ws.update(chain, q).unwrap();
        (kin.kinetic_energy(qd).unwrap(), kin.potential_energy(Vector3::new(0.3, -9.81, 2.0)))
    }

    #[test]
    fn base_parameters_of_hinges_are_massless_and_keep_energies_up_to_a_constant() {
        let tilted = |k: usize| Vector3::new(0.4 * k as f64, 0.3, -0.7);
        let mut whole = uniform_chain(5, 2.0, 3.0).unwrap();
        for (k, body) in whole.bodies.iter_mut().enumerate() {
            body.placement.rotation = nalgebra::Rotation3::new(tilted(k)).into_inner();
            body.placement.translation += tilted(k);
            body.inertia.first_moment += tilted(k) * 0.1;
            body.inertia.rotational.diagonal += Vector3::new(0.8, 0.7, 0.9);
            body.inertia.rotational.beside = tilted(k) * 0.1;
        }
        let whole = Chain::of(whole.about, whole.bodies, whole.frames, whole.nq, whole.nv);
        let mut less = whole.clone();
        for (body, inertia) in less.bodies.iter_mut().zip(base_parameters(&whole.bodies)) {
            let Inertia::<Spatial<f64>> { mass, first_moment, rotational } = inertia;
            assert_eq!((mass, first_moment.z, rotational.diagonal.y), (0.0, 0.0, 0.0));
            body.inertia = inertia;
        }
        let states = [[0.1, -0.8, 2.0, 0.5, -1.3], [1.1, 0.4, -0.6, 2.5, 0.7], [0.0; 5]];
        let at = |chain: &Chain| states.map(|q| energies(chain, &q, &[0.9, -0.3, 0.5, 1.7, -2.0]));
        let (whole, less) = (at(&whole), at(&less));
        for k in 0..states.len() {
            // Rounding of some hundred operations on numbers of this size.
            assert!((whole[k].0 - less[k].0).abs() < 1e-13 * whole[k].0, "{whole:?} {less:?}");
            let moved = [whole, less].map(|energies| energies[k].1 - energies[0].1);
            assert!((moved[0] - moved[1]).abs() < 1e-12, "{moved:?}");
        }
        assert!((whole[0].1 - whole[1].1).abs() > 1.0, "the potential energies differ by a constant");
    }
}
