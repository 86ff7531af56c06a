//! Controllers of joints, springs, forces from outside: closed forms.

use carom_chain::Chain;
use carom_sim::{
    Controller, Drive, Gains, Integrator, Load, Observed, Pd, Profile, Reference, SimError, Simulation, Spring,
    Tracking, Wrench, WrenchAxes,
};
use carom_testing::build::{Part, X, Z, chain, floating_urdf, free, rooted};
use carom_testing::files::robot;
use carom_testing::scenes::{DOWN, G};
use nalgebra::{Matrix3, Rotation3, Vector3};

/// A base that floats, with a hinge and a slider whose bodies have their centres on the joints' axes.
fn floating() -> Chain {
    let base = Part::slider("base", "", Z).weighing(5.0, [0.1, 0.2, 0.3]);
    let turn = Part::new("wheel", "base", "revolute", Z, [0.0; 3]).limits(-100.0, 100.0, 0.05);
    let push = Part::slider("slide", "base", Z).limits(-100.0, 100.0, 3.0);
    let parts = [turn.weighing(1.0, [0.01, 0.01, 0.02]), push.weighing(2.0, [0.01; 3])];
    floating_urdf(&rooted(&base.link(), &parts))
}

fn slider(mass: f64) -> Chain {
    chain(&[Part::slider("cart", "base", X).limits(-1e9, 1e9, 2.0).weighing(mass, [0.01; 3])])
}

fn exact(chain: Chain) -> Simulation {
    Simulation { tolerance: 1e-12, ..Simulation::new(chain, Vec::new()) }
}

const LEVEL: [f64; 9] = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0];

/// Two bodies connected by a spring along their common axis: x̂ = (m₁m₂/(m₁+m₂)), so the slider of a free base swings with
/// ω² = k/m̂ while the base has no motor; the momentum of the whole stays zero, and in free fall gravity changes nothing.
#[test]
fn pd_on_a_floating_robot_drives_its_joints_and_not_its_base() {
    let chain = floating();
    let reduced = 6.0 * 2.0 / 8.0; // base and wheel 6 kg, slide 2 kg
    let (kp, kd) = (150.0, 3.0);
    let mut sim = exact(chain);
    sim.gravity = DOWN;
    let target = [LEVEL[..7].to_vec(), vec![0.0, 0.02]].concat();
    sim.drive = Drive::Pd(Pd { kp: vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, kp].into(), kd: kd.into(), target });
    let end = 0.7;
    let run = sim.run(&LEVEL, &[0.0; 8], end).unwrap();
    // m̂ ẍ + d ẋ + k (x − r) = 0
    let (decay, w2) = (kd / (2.0 * reduced), kp / reduced);
    let w = (w2 - decay * decay).sqrt();
    let x = 0.02 * (1.0 - (-decay * end).exp() * ((w * end).cos() + decay / w * (w * end).sin()));
    let last = &run.summary.last;
    assert!((last.q[8] - x).abs() < 1e-10, "{} {x}", last.q[8]);
    // The centre of mass falls freely: 6 z_base + 2 (z_base + x) = −8 g t²/2.
    let fall = -0.5 * G * end * end - x * 2.0 / 8.0;
    assert!((last.q[2] - fall).abs() < 1e-9, "{} {fall}", last.q[2]);
    assert_eq!(last.q[7], 0.0, "the gain of the wheel is zero");
}

/// On a floating robot gravity compensation acts on joints only: the centre of mass falls with g, and joints whose loads
/// vanish in free fall get the force that would hold them on a fixed base.
#[test]
fn gravity_compensation_does_not_hold_a_floating_base() {
    let mut sim = exact(floating());
    sim.gravity = DOWN;
    sim.drive = Drive::GravityCompensation;
    let end = 0.5;
    let run = sim.run(&LEVEL, &[0.0; 8], end).unwrap();
    let last = &run.summary.last;
    // The motor pushes the slide (2 kg) up with 2 g: relative acceleration 2g/m̂ = 2g·8/12.
    let x = 0.5 * (2.0 * G / 1.5) * end * end;
    assert!((last.q[8] - x).abs() < 1e-9, "{} {x}", last.q[8]);
    let centre = last.q[2] + x * 2.0 / 8.0;
    assert!((centre + 0.5 * G * end * end).abs() < 1e-9, "{centre}");
}

/// Effort limits cut the motor's force: with gain and distance far above the limit a cart accelerates with limit/m; without
/// the limits it swings.
#[test]
fn effort_limits_bound_the_forces_of_motors_only() {
    let mut sim = exact(slider(4.0));
    sim.drive = Drive::Pd(Pd { kp: 1e4.into(), kd: 0.0.into(), target: vec![1.0] });
    sim.effort_limits = true;
    let end = 0.4;
    // 2 N from the motor, and 3 N from outside, which no limit concerns.
    let load = Load::Constant { force: Vector3::new(3.0, 0.0, 0.0), torque: Vector3::zeros() };
    sim.wrenches = vec![Wrench { link: "cart".into(), point: Vector3::zeros(), axes: WrenchAxes::World, load }];
    let run = sim.run(&[0.0], &[0.0], end).unwrap();
    let x = 0.5 * (5.0 / 4.0) * end * end;
    assert!((run.summary.last.q[0] - x).abs() < 1e-12, "{}", run.summary.last.q[0]);
    let free = Simulation { effort_limits: false, wrenches: Vec::new(), ..sim }.run(&[0.0], &[0.0], end).unwrap();
    let swing = 1.0 - (50.0_f64 * end).cos();
    assert!((free.summary.last.q[0] - swing).abs() < 1e-9, "{} {swing}", free.summary.last.q[0]);
}

/// A cart on a spring: x = rest + (x₀ − rest) e^(−δt)(…); its energy is kinetic plus elastic, and without damping it stays.
#[test]
fn a_cart_on_a_spring_swings_and_keeps_kinetic_plus_elastic_energy() {
    let mut sim = exact(slider(2.0));
    let spring = Spring { joint: "jcart".into(), rest: 0.3, stiffness: 50.0, damping: 0.0 };
    sim.springs = vec![spring.clone()];
    let run = sim.run(&[0.0], &[0.0], 1.7).unwrap();
    assert!((run.summary.last.q[0] - 0.3 * (1.0 - 8.5_f64.cos())).abs() < 1e-9);
    let books = run.summary.energy;
    assert!((books.start - 0.5 * 50.0 * 0.09).abs() < 1e-14 && (books.end - books.start).abs() < 1e-10, "{books:?}");
    assert_eq!((books.drive, books.resistance), (0.0, 0.0));
    sim.springs = vec![Spring { damping: 4.0, ..spring.clone() }];
    let damped = sim.run(&[0.0], &[0.0], 1.7).unwrap().summary.energy;
    assert!(damped.resistance < -1.0 && damped.error().abs() < 1e-9, "{damped:?}");
    // Time steps treat stiffness and damping implicitly and converge to the same motion with their step.
    let error = |step: f64| {
        let sim = Simulation { contact_step: step, stepping: true, ..sim.clone() };
        let last = sim.run(&[0.0], &[0.0], 1.7).unwrap().summary.last.q[0];
        let w = 24.0_f64.sqrt();
        (last - 0.3 * (1.0 - (-1.7_f64).exp() * ((1.7 * w).cos() + (1.7 * w).sin() / w))).abs()
    };
    assert!(error(1e-3) < 2e-3 && error(1e-4) < 0.2 * error(1e-3), "{} {}", error(1e-3), error(1e-4));
    for joint in ["slid", ""] {
        sim.springs = vec![Spring { joint: joint.into(), ..spring.clone() }];
        assert!(sim.run(&[0.0], &[0.0], 1.0).is_err());
    }
}

/// A robot that starts on its reference stays on it, with springs, damping and gravity, without any feedback.
#[test]
fn feed_forward_alone_keeps_an_arm_on_its_reference() {
    let chain = robot("planar3");
    let n = chain.nv();
    let times: Vec<f64> = (0..=20).map(|k| 0.05 * f64::from(k)).collect();
    let wave = |t: f64, k: usize| 0.4 * ((2.0 + k as f64) * t + 0.3).sin() - 0.2 * k as f64;
    let rows: Vec<Vec<f64>> = times.iter().map(|&t| (0..n).map(|k| wave(t, k)).collect()).collect();
    let reference = Reference::new(times, &rows).unwrap();
    let at = |time: f64, part: usize| (0..n).map(|k| reference.at(k, time)[part]).collect::<Vec<f64>>();
    let mut sim = exact(chain);
    sim.gravity = Vector3::new(0.0, -G, 0.0);
    let joint = sim.chain.joints().iter().find(|joint| !joint.name.is_empty() && joint.damping >= 0.0).unwrap();
    sim.springs = vec![Spring { joint: joint.name.clone(), rest: 0.5, stiffness: 3.0, damping: 0.2 }];
    let tracking = |feed_forward| {
        let (kp, kd) = (Gains::from(0.0), Gains::from(0.0));
        Drive::Tracking(Tracking { reference: reference.clone(), kp, kd, feed_forward })
    };
    sim.drive = tracking(true);
    let run = sim.run(&at(0.0, 0), &at(0.0, 1), 0.93).unwrap();
    for (found, wanted) in run.summary.last.q.iter().zip(at(0.93, 0)) {
        // The feed-forward is open loop: an error grows with the motion's own instability, below e⁵ here.
        assert!((found - wanted).abs() < 1e-8, "{found} {wanted}");
    }
    sim.drive = tracking(false);
    let off = sim.run(&at(0.0, 0), &at(0.0, 1), 0.93).unwrap();
    assert!((off.summary.last.q[0] - at(0.93, 0)[0]).abs() > 0.1, "without feed-forward the arm falls");
}

/// m ẍ = f(t): the velocity is the integral of the table, also across its jumps, to rounding: a step of the integrator that
/// crossed a jump would be wrong by its size.
#[test]
fn a_force_table_is_integrated_exactly_across_its_jumps() {
    let mut sim = Simulation { max_step: 10.0, ..exact(slider(2.0)) };
    let table = [(0.1, 4.0), (0.3, -2.0), (0.3, 7.0), (0.45, 7.0)];
    let rows: Vec<[f64; 6]> = table.iter().map(|(_, f)| [*f, 9.0, 0.0, 0.0, 0.0, 5.0]).collect();
    let times: Vec<f64> = table.iter().map(|(t, _)| *t).collect();
    let load = Load::Table(Profile::new(&times, &rows).unwrap());
    sim.wrenches = vec![Wrench { link: "cart".into(), point: Vector3::zeros(), axes: WrenchAxes::World, load }];
    for integrator in [Integrator::DormandPrince, Integrator::Radau] {
        let sim = Simulation { integrator, ..sim.clone() };
        let run = sim.run(&[0.0], &[0.0], 1.0).unwrap();
        let v = (0.5 * 0.2 * (4.0 - 2.0) + 0.15 * 7.0) / 2.0;
        assert!((run.summary.last.qd[0] - v).abs() < 1e-14, "{integrator:?}: {} {v}", run.summary.last.qd[0]);
        let energy = run.summary.energy;
        assert!((energy.drive - 0.5 * 2.0 * v * v).abs() < 1e-12 && energy.error().abs() < 1e-12, "{energy:?}");
    }
}

/// A free body under a wrench: Newton's and Euler's equations at the start, m a = f and I ω̇ = t + r × f, for forces in the
/// axes of the world and of the body, at any point.
#[test]
fn a_wrench_on_a_free_body_obeys_newton_and_euler() {
    let inertia = [0.2, 0.3, 0.4];
    let chain = free(3.0, inertia, "");
    let turn = Rotation3::from_euler_angles(0.4, -1.1, 2.0);
    let k = nalgebra::UnitQuaternion::from_rotation_matrix(&turn).coords;
    let q = [0.3, -0.2, 0.7, k[0], k[1], k[2], k[3]];
    let (f, t, r) = (Vector3::new(1.0, -2.0, 0.5), Vector3::new(0.3, 0.1, -0.7), Vector3::new(0.2, 0.5, -0.4));
    for axes in [WrenchAxes::World, WrenchAxes::Body] {
        let load = Load::Constant { force: f, torque: t };
        let mut sim = exact(chain.clone());
        sim.wrenches = vec![Wrench { link: "body".into(), point: r, axes, load }];
        let h = 1e-4;
        let run = sim.run(&q, &[0.0; 6], h).unwrap();
        // In body axes, as qd is.
        let (own_f, own_t) = if axes == WrenchAxes::Body { (f, t) } else { (turn.inverse() * f, turn.inverse() * t) };
        let a = own_f / 3.0;
        let w = Matrix3::from_diagonal(&Vector3::from(inertia)).try_inverse().unwrap() * (own_t + r.cross(&own_f));
        let exact = [a.as_slice(), w.as_slice()].concat();
        for (found, exact) in run.summary.last.qd.iter().zip(exact) {
            // The next term of the series is of relative size h.
            assert!((found / h - exact).abs() < 20.0 * h, "{axes:?}: {} {exact}", found / h);
        }
    }
}

/// A user's controller that is PD gives the run of `Drive::Pd` bit for bit; its errors and infinite forces stop the run.
#[test]
fn a_users_pd_controller_is_pd() {
    struct Pd(f64, f64);
    impl Controller for Pd {
        fn name(&self) -> &str {
            "own"
        }
        fn forces(&self, now: &Observed, forces: &mut [f64]) -> Result<(), SimError> {
            forces[0] = self.0 * (0.2 - now.q[0]) - self.1 * now.qd[0];
            Ok(())
        }
    }
    let mut sim = exact(slider(1.0));
    sim.drive = Drive::user(Pd(30.0, 2.0));
    let own = sim.run(&[0.0], &[1.0], 1.0).unwrap().summary;
    sim.drive = Drive::Pd(carom_sim::Pd { kp: 30.0.into(), kd: 2.0.into(), target: vec![0.2] });
    let built_in = sim.run(&[0.0], &[1.0], 1.0).unwrap().summary;
    assert_eq!(own.last, built_in.last);
    sim.drive = Drive::user(Pd(f64::INFINITY, 0.0));
    let refused = sim.run(&[0.0], &[1.0], 1.0).unwrap_err().to_string();
    assert_eq!(refused, "joint 'jcart' gets the force inf from controller 'own'");
}
