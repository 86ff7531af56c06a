//! Base parameters: the inertia of a tree of bodies with as little of it as the motion can tell.
//!
//! What a hinge's turning does not change of the inertia that it carries might as well be part of the body below: the mass,
//! on the axis, and an inertia that is the same about all axes across it. Moved there once, from the last body to the
//! first (to nothing where only the world is below), a body on a hinge has no mass left, nor a third component of the
//! first moment, nor the second diagonal number of the rotational inertia; in the plane its rotational inertia is all
//! that the joint feels of its mass. Kinetic energy and, but for a constant, potential energy are the same functions of
//! q and q̇ as before: so are M, C q̇ + g and the pivots of M. What belongs to one body alone is not: its momentum,
//! its weight, its centre of mass. (Gautier & Khalil, *Direct calculation of minimum set of inertial parameters of
//! serial robots*, IEEE Trans. Robotics and Automation 6 (1990).)

use crate::algebra::{Algebra, Inertia};
use crate::chain::Body;

/// The inertia of each body when what no hinge's turning changes has gone below. Bodies on other joints keep theirs, and
/// take what those above hand down.
pub(crate) fn base_parameters<A: Algebra>(bodies: &[Body<A>]) -> Vec<Inertia<A>> {
    let mut inertia: Vec<Inertia<A>> = bodies.iter().map(|body| body.inertia).collect();
    for (i, body) in bodies.iter().enumerate().rev().filter(|(_, body)| A::turns(body.joint)) {
        let unturned = A::unturned(inertia[i]);
        inertia[i] = Inertia {
            mass: inertia[i].mass - unturned.mass,
            first_moment: inertia[i].first_moment - unturned.first_moment,
            rotational: inertia[i].rotational - unturned.rotational,
        };
        // The same at every angle of the hinge, so the placement at zero serves.
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

    /// Energies are those of the bodies that the file has: true inertias and velocities, body by body.
    fn energies(chain: &Chain, q: &[f64], qd: &[f64]) -> (f64, f64) {
        let mut ws = chain.workspace();
        let mut kin = ws.update(chain, q).unwrap();
        (kin.kinetic_energy(qd).unwrap(), kin.potential_energy(Vector3::new(0.3, -9.81, 2.0)))
    }

    #[test]
    fn hinges_keep_no_mass_and_energies_stay_but_for_a_constant() {
        let tilted = |k: usize| Vector3::new(0.4 * k as f64, 0.3, -0.7);
        let mut whole = uniform_chain(5, 2.0, 3.0).unwrap();
        for (k, body) in whole.bodies.iter_mut().enumerate() {
            body.placement.rotation = nalgebra::Rotation3::new(tilted(k)).into_inner();
            body.placement.translation += tilted(k);
            body.inertia.first_moment += tilted(k) * 0.1;
            body.inertia.rotational.diagonal += Vector3::new(0.8, 0.7, 0.9);
            body.inertia.rotational.beside = tilted(k) * 0.1;
        }
        whole.steps = crate::steps::Step::of(&whole.bodies);
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
        assert!((whole[0].1 - whole[1].1).abs() > 1.0, "gravity does work on the way");
    }
}
