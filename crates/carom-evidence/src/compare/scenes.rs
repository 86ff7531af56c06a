//! The scene of a model on tosses: the robot with the changed parameters above the floor, and the contact rule.

use super::candidates::{Candidate, Effect, Parameter};
use carom_chain::Chain;
use carom_chain::urdf::{Collision, LoadOptions, Robot, Shape};
use carom_impact::{AnyLaw, ImpactError, ImpactOutcome, ImpactProblem, LAW_NAMES, Law};
use carom_sim::{ContactLaw, ContactRule};
use carom_study::tosses::Scene;
use nalgebra::{Matrix3, Translation3, Vector3};

/// The effects that are tried on tosses of a robot, each in addition to those before it.
pub(super) fn effects(robot: &Robot) -> Vec<Effect> {
    let boxes = robot.links.iter().flat_map(|link| &link.collisions).any(|it| matches!(it.shape, Shape::Box { .. }));
    let several = robot.links.iter().filter(|link| link.inertial.is_some()).count() > 1;
    let mut effects = Vec::new();
    effects.extend(boxes.then_some(Effect::Corners));
    effects.extend((!robot.joints.is_empty()).then_some(Effect::Hinge));
    effects.push(if several { Effect::Masses } else { Effect::Inertia });
    effects.extend((!robot.joints.is_empty()).then_some(Effect::Placement));
    effects.extend([Effect::Floor, Effect::Speed, Effect::Errors]);
    effects
}

/// The scene of a model with the parameters `x`. `nominal` is the chain of `robot`, which a model without effects keeps.
pub(super) fn scene(robot: &Robot, nominal: &Chain, model: &Candidate, x: &[f64]) -> Scene {
    let of = |parameter: Parameter| model.value(parameter, x).unwrap_or(parameter.nominal());
    let (floor, errors) = (of(Parameter::Height), of(Parameter::AngleError));
    if model.effects.is_empty() {
        return Scene { chain: nominal.clone(), floor, errors };
    }
    let mut robot = robot.clone();
    let root = robot.root;
    for (k, link) in robot.links.iter_mut().enumerate() {
        if let Some(inertial) = &mut link.inertial {
            let multiples = [0, 1, 2].map(|axis| of(Parameter::SecondMoment(axis)));
            inertial.inertia_at_com = with_second_moments(&inertial.inertia_at_com, multiples);
            if k != root {
                inertial.mass *= of(Parameter::Mass);
                inertial.inertia_at_com *= of(Parameter::Mass);
            }
        }
        let (radius, growth) = (of(Parameter::Radius), of(Parameter::Growth));
        link.collisions = link.collisions.iter().flat_map(|it| rounded(it, radius, growth)).collect();
    }
    for joint in &mut robot.joints {
        for axis in 0..3 {
            joint.origin.translation.vector[axis] += of(Parameter::Offset(axis));
        }
        joint.damping += of(Parameter::Damping);
        joint.friction += of(Parameter::DryFriction);
    }
    let options = LoadOptions { floating_base: true, ..LoadOptions::default() };
    Scene { chain: Chain::from_robot(robot, &options), floor, errors }
}

/// The inertia of a body whose second moments of mass along its axes are these multiples: with S = ∫x xᵀ dm = ½ tr(I) 1 − I and
/// D = diag(√multiple), S becomes D S D. Positive multiples keep S positive semidefinite, so the inertia stays that of some
/// distribution of mass (Wensing, Kim and Slotine, IEEE RA-L 3, 2018, section III).
fn with_second_moments(inertia: &Matrix3<f64>, multiples: [f64; 3]) -> Matrix3<f64> {
    let turned = |matrix: &Matrix3<f64>, share: f64| Matrix3::from_diagonal_element(share * matrix.trace()) - matrix;
    let roots = Matrix3::from_diagonal(&Vector3::from(multiples.map(f64::sqrt)));
    turned(&(roots * turned(inertia, 0.5) * roots), 1.0)
}

/// A box with edges longer by `growth` and corners of this radius; other shapes unchanged. The spheres at the corners touch a
/// plane where the rounded box does.
fn rounded(collision: &Collision, radius: f64, growth: f64) -> Vec<Collision> {
    let Shape::Box { size } = &collision.shape else { return vec![collision.clone()] };
    let size = size.add_scalar(growth).map(|edge| edge.max(LEAST_EDGE));
    let radius = radius.min(0.49 * size.min());
    if radius < LEAST_RADIUS {
        return vec![Collision { shape: Shape::Box { size }, ..collision.clone() }];
    }
    let sphere = |k: usize| {
        let sign = |bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
        let reach = size * 0.5 - Vector3::repeat(radius);
        let corner = Vector3::new(sign(0) * reach.x, sign(1) * reach.y, sign(2) * reach.z);
        let origin = collision.origin * Translation3::from(corner);
        Collision { name: collision.name.clone(), origin, shape: Shape::Sphere { radius } }
    };
    (0..8).map(sphere).collect()
}

/// Shortest edge of a box, and the radius below which a corner is sharp, m.
const LEAST_EDGE: f64 = 1e-3;
const LEAST_RADIUS: f64 = 1e-5;

/// The contact rule of a model with the parameters `x`.
pub(super) fn rule(model: &Candidate, x: &[f64]) -> ContactRule {
    let slow = model.coefficients(x, 0.0);
    let law = if model.effects.contains(&Effect::Speed) {
        let own = AtSpeed { model: model.clone(), x: x.to_vec() };
        ContactLaw::new(own, slow.restitution, slow.friction)
    } else {
        let law = ContactLaw::named(model.law, slow);
        law.unwrap_or_else(|| unreachable!("the candidates have the names of laws: {LAW_NAMES:?}"))
    };
    ContactRule::new(law)
}

/// A law whose restitution depends on the approach speed.
struct AtSpeed {
    model: Candidate,
    x: Vec<f64>,
}

impl Law<f64, 3> for AtSpeed {
    fn name(&self) -> &'static str {
        self.model.law
    }

    fn resolve(&self, problem: &ImpactProblem<f64, 3>) -> Result<ImpactOutcome<f64, 3>, ImpactError> {
        let coefficients = self.model.coefficients(&self.x, problem.approach_speed());
        let law = AnyLaw::<f64>::named(self.model.law, coefficients);
        law.unwrap_or_else(|| unreachable!("the candidates have the names of laws")).resolve(problem)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Isometry3;

    /// The inertia of point masses whose places are stretched along the axes is that of the stretched second moments.
    #[test]
    fn stretched_masses_have_the_inertia_of_stretched_second_moments() {
        let masses = [(0.3, [0.1, 0.02, -0.05]), (0.2, [-0.04, 0.09, 0.03]), (0.5, [-0.044, -0.048, 0.018])];
        let inertia = |stretch: [f64; 3]| {
            let one = |(mass, place): (f64, [f64; 3])| {
                let r = Vector3::from(place).component_mul(&Vector3::from(stretch));
                mass * (Matrix3::from_diagonal_element(r.norm_squared()) - r * r.transpose())
            };
            masses.map(one).iter().sum::<Matrix3<f64>>()
        };
        let stretch = [0.3, 1.4, 1.1];
        let found = with_second_moments(&inertia([1.0; 3]), stretch.map(|s| s * s));
        assert!((found - inertia(stretch)).abs().max() < 1e-15 * found.trace(), "{found}");
        assert!((with_second_moments(&found, [1.0; 3]) - found).abs().max() < 1e-15 * found.trace());
    }

    /// The support function of a box with edges a, rounded by r, is Σ |dᵢ| (aᵢ/2 − r) + r.
    #[test]
    fn rounded_corners_are_inside_the_box_that_they_belong_to() {
        let size = Vector3::new(0.1, 0.06, 0.04);
        let origin = Isometry3::translation(0.01, 0.0, -0.02);
        let sharp = Collision { name: None, origin, shape: Shape::Box { size } };
        let round = rounded(&sharp, 0.005, 0.002);
        for d in [Vector3::x(), -Vector3::z(), Vector3::new(1.0, -2.0, 0.5).normalize()] {
            let support = round.iter().map(|it| {
                let Shape::Sphere { radius } = it.shape else { panic!("{it:?}") };
                (it.origin.translation.vector - origin.translation.vector).dot(&d) + radius
            });
            let expected = d.abs().dot(&((size.add_scalar(0.002)) * 0.5).add_scalar(-0.005)) + 0.005;
            assert!((support.fold(f64::MIN, f64::max) - expected).abs() < 1e-15, "{d}");
        }
        assert_eq!(rounded(&sharp, 0.0, 0.0), [sharp]);
    }
}
