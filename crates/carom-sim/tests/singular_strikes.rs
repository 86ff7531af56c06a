//! Points on the axis of a hinge, which it does not move; the census `blows` has points that few joints move.

use crate::census::blows::{robot, vector};
use crate::census::build::{V, direction, within};
use carom_chain::FramePoint;
use carom_impact::{Coefficients, LAW_NAMES, law_by_name};
use carom_sim::{Impacts, JointModel, SimError};
use carom_testing::build::{Part, chain};

type Rng = fastrand::Rng;

/// A hinge does not move the points of its axis, wherever they are along it and wherever its joint is.
#[test]
fn a_blow_on_the_axis_of_a_hinge_is_refused_under_every_law_and_joint_model() {
    let mut rng = Rng::with_seed(7);
    for reach in [1e-3, 1.0, 1e3] {
        for _ in 0..40 {
            let axis = direction(&mut rng);
            let (chain, _) = robot(&mut rng, &[("continuous", axis)]);
            let (q, qd) = ([3.0 * within(&mut rng, -1.0, 1.0)], [1.0]);
            let point = FramePoint::new(chain.frame("l0").unwrap(), axis * (reach * within(&mut rng, -1.0, 1.0)));
            let heavy = JointModel::Impedance { stiffness: &[1e3], damping: &[1.0], contact_time: 1e-3 };
            for (name, joints) in LAW_NAMES.into_iter().flat_map(|name| [(name, JointModel::Free), (name, heavy)]) {
                let law =
                    law_by_name::<3>(name, Coefficients { restitution: 0.5, friction: 0.3, ..Default::default() });
                let strike = chain.impact(&q, &qd).at(point).normal(direction(&mut rng)).joints(joints);
                let refusal = strike.resolve(&*law.unwrap()).map(|hit| hit.impulse);
                assert!(matches!(refusal, Err(SimError::SingularNormal { .. })), "{name} {reach}: {refusal:?}");
            }
        }
    }
}

/// The same along normals in the plane of the motion, in which the chain has no heights that an offset along the axis could be compared with.
#[test]
fn a_blow_on_the_axis_of_a_hinge_in_the_plane_of_its_motion_is_refused() {
    let mut rng = Rng::with_seed(9);
    for _ in 0..200 {
        let axis = direction(&mut rng);
        let (chain, _) = robot(&mut rng, &[("continuous", axis)]);
        let (q, qd) = ([3.0 * within(&mut rng, -1.0, 1.0)], [1.0]);
        let frame = chain.frame("l0").unwrap();
        let mut workspace = chain.workspace();
        let kin = workspace.update(&chain, &q).unwrap();
        let [at, ahead] = [V::zeros(), axis].map(|offset| kin.position(chain.point(frame, offset)));
        let normal = (ahead - at).cross(&direction(&mut rng)).normalize();
        let point = FramePoint::new(frame, axis * (4.0 * within(&mut rng, -1.0, 1.0)));
        let law = law_by_name::<3>("newton", Coefficients { restitution: 0.5, friction: 0.3, ..Default::default() });
        let refusal = chain.impact(&q, &qd).at(point).normal(normal).resolve(&*law.unwrap()).map(|hit| hit.impulse);
        assert!(matches!(refusal, Err(SimError::SingularNormal { .. })), "{refusal:?}");
    }
}

/// The same far from the origin of the joint: offsets of a kilometre cancel, and with them twelve digits of the lever.
#[test]
fn a_lever_that_is_rounding_of_lengths_that_cancel_moves_nothing() {
    let mut rng = Rng::with_seed(8);
    for _ in 0..40 {
        let (axis, other, far) = (direction(&mut rng), direction(&mut rng), vector(&mut rng) * 1e3);
        let link = |name: &str, parent: &str, axis: V| {
            Part::hinge(name, parent, axis.into()).com([0.1, 0.2, 0.3]).weighing(1.0, [0.1; 3])
        };
        // The second joint does not move its own axis; locked, it leaves the first, on whose axis the point is but for rounding.
        let chain = chain(&[link("one", "base", axis), link("two", "one", other).at(far.into())]);
        let point = FramePoint::new(chain.frame("two").unwrap(), axis * 0.3 - far);
        let (q, qd) = ([2.0 * within(&mut rng, -1.0, 1.0), 0.0], [1.0, 0.0]);
        let law = law_by_name::<3>("frictionless", Coefficients::default()).unwrap();
        let strike = chain.impact(&q, &qd).at(point).normal(direction(&mut rng)).joints(JointModel::Locked(&["jtwo"]));
        let refusal = strike.resolve(&*law).map(|hit| hit.impulse);
        assert!(matches!(refusal, Err(SimError::Locked { .. })), "{refusal:?}");
    }
}
