//! Drives that act during an impact: locked and impedance-weighted joints, compared with smaller robots, with limit cases
//! and with the energy balance.

use carom_chain::urdf::{JointType, LoadOptions};
use carom_chain::{Chain, ChainError};
use carom_impact::{Energetic, Frictionless, Law, Newton, Poisson};
use carom_sim::{ChainImpact, Impacts, JointModel, SimError};
use nalgebra::{DVector, Vector3};

const NORMAL: [f64; 3] = [-0.6, 0.7, 0.2];

fn text(name: &str) -> String {
    carom_testing::files::text(&format!("robots/{name}.urdf"))
}

/// The robot. A floating base gets a mass: a massless one has no inertia of its own.
fn robot(text: &str, floating_base: bool) -> Chain {
    let base = "<link name=\"base\"><inertial><mass value=\"4\"/>\
        <inertia ixx=\"0.1\" ixy=\"0\" ixz=\"0\" iyy=\"0.1\" iyz=\"0\" izz=\"0.1\"/></inertial>";
    let text = if floating_base { text.replace("<link name=\"base\">", base) } else { text.to_owned() };
    let text = text.as_str();
    Chain::from_urdf_str(text, &LoadOptions { floating_base, ..Default::default() }).unwrap()
}

fn random(rng: &mut fastrand::Rng, n: usize) -> Vec<f64> {
    (0..n).map(|_| rng.f64() * 2.0 - 1.0).collect()
}

/// A pose of a floating robot: base turned and moved, joints as given.
fn afloat(joints: &[f64]) -> Vec<f64> {
    [&[0.1, -0.2, 0.3, 0.5, -0.1, 0.7, 0.5][..], joints].concat()
}

fn strike<'a>(chain: &'a Chain, q: &'a [f64], qd: &'a [f64], joints: JointModel<'a>) -> carom_sim::Strike<'a> {
    chain.impact(q, qd).at(chain.frame("tip").unwrap()).normal(NORMAL).joints(joints)
}

#[track_caller]
fn same(what: &str, x: &[f64], y: &[f64], within: f64) {
    let off = (DVector::from_column_slice(x) - DVector::from_column_slice(y)).amax();
    assert!(x.len() == y.len() && off <= within, "{what}: off by {off:e}\n{x:?}\n{y:?}");
}

const LAW: Energetic = Energetic { restitution: 0.4, friction: 0.3 };

/// A joint locked at zero gives the impact of a robot in whose URDF the joint is fixed.
#[test]
fn a_locked_joint_equals_a_fixed_joint() {
    let mut rng = fastrand::Rng::with_seed(1);
    let text = text("arm7");
    let chain = robot(&text, false);
    let names: Vec<String> =
        chain.joints().iter().filter(|j| j.kind == JointType::Revolute).map(|j| j.name.clone()).collect();
    for locked in [&names[1..2], &names[4..7], &names[..3]] {
        let mut fixed = text.clone();
        for name in locked {
            let joint = format!("<joint name=\"{name}\" type=\"revolute\"");
            assert!(fixed.contains(&joint), "{joint}");
            fixed = fixed.replace(&joint, &format!("<joint name=\"{name}\" type=\"fixed\""));
        }
        let smaller = robot(&fixed, false);
        let free: Vec<usize> = (0..names.len()).filter(|&i| !locked.contains(&names[i])).collect();
        let held: Vec<&str> = locked.iter().map(String::as_str).collect();
        for _ in 0..20 {
            let (q_free, qd_free) = (random(&mut rng, free.len()), random(&mut rng, free.len()));
            let (mut q, mut qd) = (vec![0.0; names.len()], vec![0.0; names.len()]);
            for (k, &i) in free.iter().enumerate() {
                (q[i], qd[i]) = (q_free[k], qd_free[k]);
            }
            let hit = strike(&chain, &q, &qd, JointModel::Locked(&held)).resolve(&LAW).unwrap();
            let other = strike(&smaller, &q_free, &qd_free, JointModel::Free).resolve(&LAW).unwrap();
            let size = 1.0 + hit.impulse.norm();
            same("p", hit.impulse.as_slice(), other.impulse.as_slice(), 1e-11 * size);
            let kept: Vec<f64> = free.iter().map(|&i| hit.qd_plus[i]).collect();
            same("qd⁺", &kept, &other.qd_plus, 1e-10 * size);
            assert!((0..names.len()).all(|i| free.contains(&i) || hit.qd_plus[i] == 0.0));
            // Locked joints with zero velocity do no work.
            assert!(
                hit.drive_work == 0.0
                    && (hit.energy_after - other.energy_after).abs() < 1e-11 * (1.0 + hit.energy_after)
            );
        }
    }
}

/// With a floating base and all joints locked, the robot has the inertia of one rigid body, whatever its joint velocities.
#[test]
fn all_joints_locked_with_a_floating_base_is_the_composite_rigid_body() {
    let mut rng = fastrand::Rng::with_seed(2);
    let chain = robot(&text("arm7"), true);
    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
    for _ in 0..50 {
        let (q, qd) = (afloat(&random(&mut rng, 7)), random(&mut rng, 13));
        let composite = chain.workspace().update(&chain, &q).unwrap().locked_delassus(tip).unwrap();
        let contact = strike(&chain, &q, &qd, JointModel::AllLocked).contact().unwrap();
        let h = &contact.inertia().delassus;
        assert!((h - &composite).amax() < 1e-12 * h.amax(), "{h}{composite}");
    }
    // Locking joints increases the effective mass in every direction.
    let (q, qd) = (afloat(&random(&mut rng, 7)), random(&mut rng, 13));
    let mass = |joints| strike(&chain, &q, &qd, joints).contact().unwrap().inertia().effective_mass(&NORMAL).unwrap();
    let (free, some, all) =
        (mass(JointModel::Free), mass(JointModel::Locked(&["elbow_pitch"])), mass(JointModel::AllLocked));
    assert!(free <= some && some < all, "{free} {some} {all}");
}

/// ½ p·(u⁻ + u⁺) + ½ j·(q̇⁻ + q̇⁺) = T⁺ − T⁻, with T from M and all joint velocities; and M Δq̇ = Jᵀp + j.
#[test]
fn work_of_the_drives_closes_the_energy_balance() {
    let mut rng = fastrand::Rng::with_seed(3);
    let (e, mu) = (0.5, 0.4);
    let laws: [&dyn Law<f64, 3>; 4] = [
        &Frictionless { restitution: e },
        &Poisson { restitution: e, friction: mu },
        &Newton { restitution: e, friction: mu },
        &LAW,
    ];
    let (mut gains, mut losses) = (0, 0);
    for floating in [false, true] {
        let chain = robot(&text("arm7"), floating);
        let nv = chain.nv();
        for _ in 0..100 {
            let joints = random(&mut rng, 7);
            let (q, qd) = (if floating { afloat(&joints) } else { joints }, random(&mut rng, nv));
            let stiffness: Vec<f64> = random(&mut rng, nv).iter().map(|x| 1e4 * x.max(0.0)).collect();
            let damping: Vec<f64> = random(&mut rng, nv).iter().map(|x| 30.0 * x.max(0.0)).collect();
            let impedance = JointModel::Impedance { stiffness: &stiffness, damping: &damping, contact_time: 5e-3 };
            for joints in [JointModel::Locked(&["elbow_pitch", "shoulder_pitch"]), impedance] {
                for law in laws {
                    let mut contact = strike(&chain, &q, &qd, joints).contact().unwrap();
                    let hit = contact.resolve(law).unwrap();
                    let work = 0.5 * hit.impulse.dot(&(hit.u_minus + hit.u_plus));
                    let change = hit.energy_after - hit.energy_before;
                    let passed = hit.energy_before + hit.energy_after + hit.drive_work.abs() + work.abs();
                    assert!((work + hit.drive_work - change).abs() < 1e-11 * passed, "{joints:?} {}", law.name());
                    let mut ws = chain.workspace();
                    let mut kin = ws.update(&chain, &q).unwrap();
                    let jump = DVector::from_vec(hit.qd_plus.clone()) - DVector::from_column_slice(&qd);
                    let m = kin.mass_matrix();
                    let given =
                        contact.jacobian().transpose() * hit.impulse + DVector::from_vec(hit.drive_impulse.clone());
                    let pushed = (&m * &jump).amax() + given.amax();
                    // The error of a solve with M is ε times its condition number.
                    let spread = m.clone().symmetric_eigenvalues();
                    let solved = 1e3 * f64::EPSILON * spread.max() / spread.min();
                    let off = (&m * jump - given).amax();
                    assert!(off <= solved * pushed, "{joints:?} {off:e} {solved:e} {pushed:e}");
                    let tip = chain.point(chain.frame("tip").unwrap(), Vector3::zeros());
                    let u = kin.point_velocity(tip, &hit.qd_plus).unwrap();
                    assert!((u - hit.u_plus).norm() < 1e-10 * (1.0 + u.norm()));
                    gains += usize::from(hit.drive_work > 1e-9);
                    losses += usize::from(hit.drive_work < -1e-9);
                }
            }
        }
    }
    assert!(gains > 50 && losses > 50, "the drives do positive work in {gains} cases and negative work in {losses}");
}

/// Stiffness 0 gives the free joints; with stiffness going to 0 or infinity the result converges to free or locked joints
/// with first order.
#[test]
fn impedance_converges_to_free_and_to_locked_joints() {
    let mut rng = fastrand::Rng::with_seed(4);
    let chain = robot(&text("arm7"), true);
    let (q, qd) = (afloat(&random(&mut rng, 7)), random(&mut rng, 13));
    let off = |hit: &ChainImpact, limit: &ChainImpact| {
        (DVector::from_column_slice(&hit.qd_plus) - DVector::from_column_slice(&limit.qd_plus)).amax()
            + (hit.impulse - limit.impulse).amax()
    };
    let law = Frictionless { restitution: 0.5 };
    let with = |stiffness: f64, damping: f64| {
        let spread = |x: f64| [vec![0.0; 6], vec![x; 7]].concat();
        let (stiffness, damping) = (spread(stiffness), spread(damping));
        let joints = JointModel::Impedance { stiffness: &stiffness, damping: &damping, contact_time: 1e-2 };
        strike(&chain, &q, &qd, joints).resolve(&law).unwrap()
    };
    let free = strike(&chain, &q, &qd, JointModel::Free).resolve(&law).unwrap();
    let locked = strike(&chain, &q, &qd, JointModel::AllLocked).resolve(&law).unwrap();
    assert!(off(&free, &locked) > 0.1, "the two limits differ");
    assert!(off(&with(0.0, 0.0), &free) == 0.0);
    for (weak, strong) in [(1e-2, 1e9), (1e-3, 1e10)] {
        let (near_free, near_locked) = (off(&with(weak, 0.0), &free), off(&with(strong, 0.0), &locked));
        let ratio = |nearer: f64, before: f64| (before / nearer - 10.0).abs() < 0.5;
        assert!(ratio(off(&with(0.1 * weak, 0.0), &free), near_free), "{near_free:e}");
        assert!(ratio(off(&with(10.0 * strong, 0.0), &locked), near_locked), "{near_locked:e}");
    }
    // W = Δt (K Δt + D): a damping of K Δt is equivalent to the stiffness K.
    assert!(off(&with(400.0, 0.0), &with(0.0, 4.0)) < 1e-12);
    let rise = [0.0, 1e2, 1e4, 1e6].map(|k| with(k, 0.0).contact.impulse.z);
    assert!(rise.windows(2).all(|pair| pair[0] < pair[1]), "the impulse grows with the stiffness: {rise:?}");
    assert!(rise[3] < locked.contact.impulse.z);
}

#[test]
fn invalid_joint_models_are_refused() {
    let chain = robot(&text("arm7"), false);
    let (q, qd, zeros) = ([0.3; 7], [0.5; 7], [0.0; 7]);
    let refused = |joints: JointModel| strike(&chain, &q, &qd, joints).resolve(&LAW).unwrap_err();
    let locked = refused(JointModel::AllLocked);
    assert!(matches!(&locked, SimError::Locked { link, .. } if link == "tip"), "{locked}");
    let words = locked.to_string();
    assert!(words.starts_with("with its joints locked nothing moves 'tip' along the normal [-0.6"), "{words}");
    assert!(words.contains("let the base float") && words.contains("finite stiffness"), "{words}");
    assert!(matches!(refused(JointModel::Locked(&["elbwo"])), SimError::Chain(ChainError::UnknownJoint { .. })));
    let why = refused(JointModel::Locked(&["probe"])).to_string();
    assert!(why.starts_with("joint 'probe' has no coordinate of its own to lock"), "{why}");
    let impedance = |stiffness, damping, contact_time| JointModel::Impedance { stiffness, damping, contact_time };
    for (joints, words) in [
        (impedance(&zeros[..6], &zeros, 1e-3), "stiffness has 6 numbers, 7 are needed"),
        (impedance(&zeros, &[f64::NAN; 7], 1e-3), "damping[0] is NaN: every number must be finite"),
        (impedance(&[-1.0; 7], &zeros, 1e-3), "a joint's stiffness is -1: it must be 0 or more"),
        (impedance(&zeros, &[-2.0; 7], 1e-3), "a joint's damping is -2: it must be 0 or more"),
        (impedance(&zeros, &zeros, 0.0), "the contact time is 0: it must be finite and above 0 s"),
        (impedance(&zeros, &zeros, f64::INFINITY), "the contact time is inf: it must be finite"),
        (impedance(&[1e300; 7], &zeros, 1e10), "the inertia Δt (K Δt + D) is inf: it must be finite"),
    ] {
        let why = refused(joints).to_string();
        assert!(why.starts_with(words), "{why}");
    }
}

/// The derivative of an impact with drives is not implemented, and the saltation matrix contains it.
#[test]
fn derivatives_and_saltation_matrices_of_held_joints_are_refused() {
    let chain = robot(&text("arm7"), false);
    let (q, mut qd) = ([0.3, -0.4, 0.5, 0.6, -0.2, 0.4, 0.1], [0.5, -1.0, 0.3, 0.2, 0.1, -0.6, 0.4]);
    if strike(&chain, &q, &qd, JointModel::Free).contact().unwrap().problem().u_minus().z > 0.0 {
        qd = qd.map(|x| -x);
    }
    let of = |joints| strike(&chain, &q, &qd, joints);
    of(JointModel::Free).saltation(&LAW, [0.0, 0.0, -9.81]).unwrap();
    let damping = [1.0; 7];
    let impedance = JointModel::Impedance { stiffness: &damping, damping: &damping, contact_time: 0.01 };
    for joints in [JointModel::Locked(&["elbow_pitch"]), impedance] {
        assert_eq!(of(joints).derivative(&LAW).unwrap_err(), SimError::DerivativeOfHeldJoints);
        let found = of(joints).saltation(&LAW, [0.0, 0.0, -9.81]);
        assert_eq!(found.unwrap_err(), SimError::DerivativeOfHeldJoints, "{joints:?}");
    }
}
