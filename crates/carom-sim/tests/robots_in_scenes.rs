//! Robots with controllers and contacts: a quadruped that stands, a box on a belt, a box that is tipped, an arm that meets a
//! wall on its way.

use carom_chain::Chain;
use carom_sim::{Drive, Load, Profile, Reference, Simulation, Surface, Touch, Tracking, Wrench, WrenchAxes};
use carom_testing::files::{ROOT, robot_with};
use carom_testing::numeric::simpson;
use carom_testing::scenes::{G, half_space, kinds, newton, on_floor, shipped, surface};
use nalgebra::Vector3;

/// Dropped under PD it lands on its feet and stands: the forces of the floor carry its weight, the joints bear what statics asks of
/// their motors, kp (target − q) = g − Jᵀf, the base has no motor, and nothing moves.
#[test]
fn a_quadruped_under_pd_lands_on_its_feet_and_stands() {
    let scene = shipped("quadruped");
    let plan = scene.plan().unwrap();
    let run = plan.run(scene.duration).unwrap();
    let (sim, last) = (&plan.simulation, &run.summary.last);
    let mass = sim.chain.total_mass();
    let contacts = &run.summary.contacts;
    let feet: Vec<&str> = contacts.iter().filter_map(|it| sim.touches[it.touch].link()).collect();
    assert!(feet.len() == 4 && feet.iter().all(|link| link.ends_with("_foot")), "{feet:?}, {:?}", run.summary.mode);
    let weight: Vector3<f64> = contacts.iter().map(|it| it.force).sum();
    // It settles exponentially: damping leaves less than this share of the motion.
    assert!((weight - Vector3::new(0.0, 0.0, mass * G)).norm() < 1e-3 * mass * G, "{weight}");
    assert!(last.qd.iter().all(|v| v.abs() < 1e-3), "{:?}", last.qd);
    // The PD controllers hold the weight with an error: each knee bends by (weight on a leg × lever)/kp, and the trunk sinks by
    // some centimetres.
    assert!((0.24..0.326).contains(&last.q[2]), "{}", last.q[2]);
    assert!(last.q[3..6].iter().all(|x| x.abs() < 0.05), "upright: {:?}", &last.q[3..7]);
    assert!(sim.smallest_gap(&last.q).unwrap() > -1e-8);
    let Drive::Pd(carom_sim::Pd { kp, target, .. }) = &sim.drive else { panic!("{:?}", sim.drive) };
    let carom_sim::Gains::Same(kp) = kp else { panic!("{kp:?}") };
    let mut workspace = sim.chain.workspace();
    let mut kin = workspace.update(&sim.chain, &last.q).unwrap();
    let mut load: Vec<f64> = kin.gravity_force(sim.gravity).as_slice().to_vec();
    for contact in contacts {
        let frame = sim.chain.frame(sim.touches[contact.touch].link().unwrap()).unwrap();
        let offset = kin.pose(frame).inverse().point(contact.point);
        kin.add_point_force(sim.chain.point(frame, offset), -contact.force, &mut load).unwrap();
    }
    for v in 0..18 {
        let motor = if v < 6 { 0.0 } else { kp * (target[v + 1] - last.q[v + 1]) };
        assert!((motor - load[v]).abs() < 0.05, "number {v} of qd: motor {motor}, load {}", load[v]);
    }
    assert!(run.summary.energy.error().abs() < 1e-5, "{:?}", run.summary.energy);
}

/// The four corners slide with unequal loads, but together with μ m g: v/(μ g) until the box is carried.
#[test]
fn a_box_rides_a_conveyor() {
    let scene = shipped("conveyor");
    let plan = scene.plan().unwrap();
    let run = plan.run(scene.duration).unwrap();
    let slip = 0.5 / (0.3 * G);
    let last = &run.summary.last;
    assert!((last.qd[0] - 0.5).abs() < 1e-9, "{last:?}");
    assert!((last.q[0] - 0.5 * (scene.duration - slip / 2.0)).abs() < 1e-7, "{last:?}");
    let stick = run.events.iter().filter(|event| event.kind.name() == "sticking");
    assert!(
        stick.clone().count() > 0 && stick.clone().all(|event| (event.time - slip).abs() < 1e-7),
        "{:?}",
        run.events
    );
}

/// A homogeneous box, 0.12 × 0.08 × 0.05 m, on rough ground under a torque about y.
fn tipped(load: Load) -> Simulation {
    let tipped = on_floor(robot_with("box", true), newton(0.0, 5.0));
    let wrench = Wrench { link: "box".into(), point: Vector3::zeros(), axes: WrenchAxes::World, load };
    Simulation { wrenches: vec![wrench], tolerance: 1e-10, ..tipped }
}

const LYING: [f64; 7] = [0.0, 0.0, 0.025, 0.0, 0.0, 0.0, 1.0];
const MASS: f64 = 0.3;

/// A torque that grows from zero tips the box when it reaches m g w/2, with the edge's corners at rest.
#[test]
fn a_growing_torque_tips_a_box_when_it_reaches_its_weight_times_half_its_width() {
    let needed = MASS * G * 0.06;
    let rows = [[0.0; 6], [0.0, 0.0, 0.0, 0.0, 2.0 * needed, 0.0]];
    let sim = tipped(Load::Table(Profile::new(&[0.1, 0.5], &rows).unwrap()));
    let run = sim.run(&LYING, &[0.0; 6], 0.31).unwrap();
    let lifts: Vec<f64> = run.events.iter().filter(|e| e.kind.name() == "lift-off").map(|e| e.time).collect();
    assert_eq!(lifts.len(), 2, "{:?}", run.events);
    assert!(lifts.iter().all(|time| (time - 0.3).abs() < 1e-9), "{lifts:?}");
}

/// About its edge, with φ the turn and r, β the distance and the elevation of the centre seen from the edge:
/// ½ I ω² = T φ − m g r (sin(β + φ) − sin β), and t = ∫ dφ/ω.
#[test]
fn a_box_tipped_by_a_torque_turns_about_its_edge() {
    let torque = 1.6 * MASS * G * 0.06;
    let sim = tipped(Load::Constant { force: Vector3::zeros(), torque: Vector3::new(0.0, torque, 0.0) });
    let (r, beta) = (0.06_f64.hypot(0.025), 0.025_f64.atan2(0.06));
    let inertia = 0.0004225 + MASS * r * r;
    let energy = |phi: f64| torque * phi - MASS * G * r * ((beta + phi).sin() - beta.sin());
    let omega = |phi: f64| (2.0 * energy(phi) / inertia).sqrt();
    let run = sim.run(&LYING, &[0.0; 6], 0.12).unwrap();
    let last = &run.summary.last;
    let phi = 2.0 * last.q[4].atan2(last.q[6]);
    assert!((0.2..1.2).contains(&phi), "{phi}");
    assert!((last.qd[4] - omega(phi)).abs() < 1e-8, "{} {}", last.qd[4], omega(phi));
    let place = [0.06 - r * (beta + phi).cos(), r * (beta + phi).sin()];
    assert!((last.q[0] - place[0]).abs() < 1e-9 && (last.q[2] - place[1]).abs() < 1e-9, "{last:?}");
    // φ = s² removes the root at the start: dt = 2 s ds/ω(s²).
    let rate = |s: f64| {
        if s == 0.0 {
            // ω² = 2 φ (T − m g r cos β)/I to first order
            return 2.0 / (2.0 * (torque - MASS * G * r * beta.cos()) / inertia).sqrt();
        }
        2.0 * s / omega(s * s)
    };
    let time = simpson(rate, [0.0, phi.sqrt()]);
    assert!((time - 0.12).abs() < 1e-7, "{time}");
}

/// An arm that follows a reference into a wall presses on it, never enters it, and is on its reference again after the wall.
#[test]
fn a_tracking_arm_passes_an_unexpected_wall() {
    let chain = Chain::from_urdf_file(format!("{ROOT}/robots/planar2.urdf")).unwrap();
    let times: Vec<f64> = (0..=30).map(|k| 0.1 * f64::from(k)).collect();
    // The tip moves out and back along x: about 0.60 m at the ends and 0.72 m in the middle.
    let bend = |t: f64| 0.9 - 0.25 * (1.0 - (t * std::f64::consts::TAU / 3.0).cos()) / 2.0;
    let rows: Vec<Vec<f64>> = times.iter().map(|&t| vec![bend(t), -2.0 * bend(t) + 0.05]).collect();
    let reference = Reference::new(times, &rows).unwrap();
    let wall = surface("wall", half_space([0.64, 0.0, 0.0], -Vector3::x()), newton(0.0, 0.1));
    let run = |surfaces: &[Surface]| {
        let touches = Touch::all(&chain, surfaces, 0.0).unwrap().touches;
        let mut sim = Simulation { tolerance: 1e-10, ..Simulation::new(chain.clone(), touches) };
        let (kp, kd) = (300.0.into(), vec![60.0, 20.0].into());
        sim.drive = Drive::Tracking(Tracking { reference: reference.clone(), kp, kd, feed_forward: true });
        let start = |part: usize| [reference.at(0, 0.0)[part], reference.at(1, 0.0)[part]];
        let run = sim.run(&start(0), &start(1), 3.0).unwrap();
        (sim, run)
    };
    let off = |q: &[f64], time: f64| (0..2).map(|k| (q[k] - reference.at(k, time)[0]).abs()).fold(0.0, f64::max);
    let (_, free) = run(&[]);
    assert!(off(&free.summary.last.q, 3.0) < 1e-8, "without the wall the arm stays on its reference");
    let (sim, met) = run(&[wall]);
    let kinds = kinds(&met);
    assert!(kinds.contains(&"impact") && kinds.contains(&"sliding") && kinds.last() == Some(&"lift-off"), "{kinds:?}");
    let (mut deepest, mut furthest) = (f64::INFINITY, 0.0_f64);
    for k in 0..=600 {
        let time = 0.005 * f64::from(k);
        let moment = met.at(&sim.chain, time);
        deepest = deepest.min(sim.smallest_gap(&moment.q).unwrap());
        furthest = furthest.max(off(&moment.q, time));
    }
    assert!(deepest > -1e-9, "{deepest}");
    assert!(furthest > 0.02, "the wall keeps the arm off its reference: {furthest}");
    // The feedback has forgotten the wall: its slowest rate is kp/kd = 5/s, over half a second and more.
    assert!(off(&met.summary.last.q, 3.0) < 0.1 * furthest, "{} {furthest}", off(&met.summary.last.q, 3.0));
    assert!(met.summary.energy.error().abs() < 1e-8, "{:?}", met.summary.energy);
}
