//! The loads of runs on the joints.

use carom_chain::urdf::{LoadOptions, read_file};
use carom_chain::{Chain, Coordinates};
use carom_sim::{Event, EventKind, Sampling, Scene, Seen, Simulation, Summary};
use carom_testing::files::path;
use carom_testing::scenes::{changed, shipped, with_robots};
use nalgebra::{Matrix3, Vector3};

/// Name, mass, centre of mass and inertia of a link with mass, in its axes.
type Heavy = (String, f64, Vector3<f64>, Matrix3<f64>);

/// The links of robots with their names in a chain.
fn links(robots: &[(&str, &str)]) -> Vec<Heavy> {
    let of = |(prefix, file): &(&str, &str)| {
        let robot = read_file(path(&format!("robots/{file}")), &LoadOptions::default()).unwrap();
        let heavy = robot.links.into_iter().filter_map(|link| link.inertial.map(|own| (link.name, own)));
        let named = heavy.map(|(name, own)| (format!("{prefix}{name}"), own.mass, own.com, own.inertia_at_com));
        named.collect::<Vec<_>>()
    };
    robots.iter().flat_map(of).collect()
}

/// Time, q, qd and forces of the motors.
type Sample = (f64, Vec<f64>, Vec<f64>, Vec<f64>);

/// What a run has told.
struct Told {
    events: Vec<Event>,
    moments: Vec<Sample>,
    summary: Summary,
    sim: Simulation,
}

fn run(scene: &Scene, every: f64, loads: bool) -> Told {
    let plan = scene.plan().unwrap();
    let (mut events, mut moments) = (Vec::new(), Vec::new());
    let sampling = Sampling { every: Some(every), loads, ..Sampling::default() };
    let summary = plan.stream(scene.duration, sampling, &mut |seen| match seen {
        Seen::Event(event) => events.push(event.clone()),
        Seen::Moment(moment) => moments.push((moment.time, moment.q.clone(), moment.qd.clone(), Vec::new())),
        Seen::Motors(time, forces) => {
            let last = moments.last_mut().unwrap();
            assert_eq!(last.0, time);
            last.3 = forces.to_vec();
        }
        Seen::Contacts(..) | Seen::Segment(_) => {}
    });
    Told { events, moments, summary: summary.unwrap(), sim: plan.simulation }
}

/// Whether a link is the child of a joint, or below it.
fn is_below(chain: &Chain, link: &str, joint: usize) -> bool {
    let mut at = link;
    while let Some((k, above)) = chain.joints().iter().enumerate().find(|(_, other)| other.child == at) {
        if k == joint {
            return true;
        }
        at = &above.parent;
    }
    false
}

/// The impulse through each joint and those at the contacts of the links below it change the momentum of these links.
fn check_balance(sim: &Simulation, event: &Event, links: &[Heavy]) {
    let chain = &sim.chain;
    let loads = &event.loads.as_ref().unwrap().impact;
    let change: Vec<f64> = event.qd_plus.iter().zip(&event.qd_minus).map(|(after, before)| after - before).collect();
    let mut workspace = chain.workspace();
    let kin = workspace.update(chain, &event.q).unwrap();
    assert_eq!(loads.through.len(), chain.joints().iter().filter(|it| it.coordinates != Coordinates::None).count());
    for through in &loads.through {
        let joint = chain.joints().iter().position(|it| it.name == through.joint).unwrap();
        let child = kin.pose(chain.frame(&chain.joints()[joint].child).unwrap());
        let (mut impulse, mut moment) = (child.rotation * through.force, child.rotation * through.moment);
        let mut size = impulse.norm() + moment.norm();
        for one in &event.impulses {
            let touch = &sim.touches[one.touch];
            for (link, push) in [(touch.link(), one.impulse), (touch.other_link(), -one.impulse)] {
                if link.is_some_and(|link| is_below(chain, link, joint)) {
                    impulse += push;
                    moment += (one.point - child.translation).cross(&push);
                    size += push.norm();
                }
            }
        }
        for (name, mass, com, inertia) in links.iter().filter(|link| is_below(chain, &link.0, joint)) {
            let frame = chain.frame(name).unwrap();
            let pose = kin.pose(frame);
            let speed = kin.point_velocity(chain.point(frame, *com), &change).unwrap();
            let spin = kin.angular_velocity(frame, &change).unwrap();
            let world = pose.rotation * inertia * pose.rotation.transpose();
            impulse -= *mass * speed;
            moment -= world * spin + (pose.point(*com) - child.translation).cross(&(*mass * speed));
            size += *mass * speed.norm();
        }
        let error = impulse.norm().max(moment.norm());
        assert!(error < 1e-11 * size.max(1e-3), "{} at {} s: {error} of {size}", through.joint, event.time);
    }
}

/// Impacts on the world and between links, of one contact and of several, in space and in a plane, of one robot and of two.
#[test]
fn impulses_through_joints_balance_the_momentum_of_the_links_below_at_every_impact_of_a_run() {
    let arm_and_ball = [("arm/", "planar2.urdf"), ("ball/", "ball.urdf")];
    for (name, robots, least) in [
        ("strike7", &[("", "arm7.urdf")][..], 1),
        ("planar2", &[("", "planar2.urdf")], 1),
        ("quadruped", &[("", "quadruped.urdf")], 1),
        ("cradle", &[("", "cradle.urdf")], 4),
        ("racket", &[("", "racket.urdf")], 1),
        ("catch", &arm_and_ball, 3),
    ] {
        let scene = shipped(name);
        let told = run(&scene, scene.duration, true);
        let links = links(robots);
        let impacts: Vec<_> = told.events.iter().filter(|event| event.loads.is_some()).collect();
        assert!(impacts.len() >= least, "{name}: {}", impacts.len());
        impacts.iter().for_each(|event| check_balance(&told.sim, event, &links));
        // Every event whose impulses are told is among them, and no other.
        for event in &told.events {
            let struck = matches!(event.kind.name(), "impact" | "several" | "latch" | "limit");
            assert_eq!(event.loads.is_some(), struck, "{name}: {}", event.kind.name());
        }
    }
}

/// A joint that runs into its limit, and a tip that a latch holds: M Δq̇ is the stop's impulse, and Jᵀp of the latch.
#[test]
fn the_impulse_of_a_stop_is_along_the_axis_of_its_joint_and_that_of_a_latch_at_its_contact() {
    let text = "[robot]\nurdf = \"planar2.urdf\"\nq = [0, 2.9]\nqd = [0.1, 2]\n[contact]\nlimit_restitution = 0.5\n[run]\n\
                duration = 0.3\ngravity = [0, 0, 0]";
    let told = run(&with_robots(text).unwrap(), 0.1, true);
    let event = &told.events[0];
    let EventKind::Limit { impulse, .. } = &event.kind else { panic!("{:?}", event.kind) };
    check_balance(&told.sim, event, &links(&[("", "planar2.urdf")]));
    let through = &event.loads.as_ref().unwrap().impact.through;
    // The upper limit pushes back.
    assert!((through[1].moment.z + impulse).abs() < 1e-14 && through[0].moment.z.abs() < 1e-14, "{through:?}");

    let latched = changed("planar2", &[("[contact]", "[contact]\nlatch = true")]);
    let told = run(&latched, 0.1, true);
    let event = told.events.iter().find(|event| event.kind.name() == "latch").unwrap();
    assert_eq!(event.impulses.len(), 1);
    check_balance(&told.sim, event, &links(&[("", "planar2.urdf")]));
    // No drive: the moments about the axes are zero.
    let loads = &event.loads.as_ref().unwrap().impact;
    assert!(loads.through.iter().all(|joint| joint.moment.z.abs() < 1e-14), "{loads:?}");
    let mut workspace = told.sim.chain.workspace();
    let mass = workspace.update(&told.sim.chain, &event.q).unwrap().mass_matrix();
    let change = nalgebra::DVector::from_fn(2, |i, _| event.qd_plus[i] - event.qd_minus[i]);
    let error = (mass * change - nalgebra::DVector::from_column_slice(&loads.joint_impulse)).amax();
    assert!(error < 1e-14, "{error}");
}

/// PD with limits: clamp(kp (q* − q) − kd q̇) at every sample, and before and after every impact; some of them at the limit.
#[test]
fn forces_of_motors_are_those_of_their_control_law_after_its_limits() {
    // Stiffer than the scene, so that the landing needs more than the motors have.
    let (kp, kd) = (600.0, 9.0);
    let scene = changed("quadruped", &[("kp = 150", "kp = 600"), ("kd = 4", "kd = 9")]);
    let targets: toml::Table = scene.text.parse().unwrap();
    let targets = &targets["run"]["target"];
    let told = run(&scene, 0.002, true);
    let chain = &told.sim.chain;
    let start = &scene.q;
    let law = |q: &[f64], qd: &[f64]| -> Vec<f64> {
        let mut forces = vec![0.0; chain.nv()];
        for joint in chain.joints() {
            let Coordinates::Own { q: at, v } = &joint.coordinates else { continue };
            if v.len() == 1 {
                let limit = joint.limits.effort.unwrap_or(f64::INFINITY);
                let target = targets.get(&joint.name).map_or(start[at.start], |it| it.as_float().unwrap());
                forces[v.start] = (kp * (target - q[at.start]) - kd * qd[v.start]).clamp(-limit, limit);
            }
        }
        forces
    };
    let mut limited = 0;
    let mut check = |q: &[f64], qd: &[f64], found: &[f64]| {
        let expected = law(q, qd);
        let off = expected.iter().zip(found).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-9 && found.len() == chain.nv(), "{off}: {found:?}");
        let limit = |joint: &carom_chain::JointInfo| joint.limits.effort;
        let highest = chain.joints().iter().filter_map(limit).fold(f64::INFINITY, f64::min);
        limited += found.iter().filter(|force| force.abs() >= highest).count();
    };
    told.moments.iter().for_each(|(_, q, qd, found)| check(q, qd, found));
    for event in &told.events {
        let Some(loads) = &event.loads else { continue };
        check(&event.q, &event.qd_minus, &loads.motors_minus);
        check(&event.q, &event.qd_plus, &loads.motors_plus);
    }
    assert!(limited > 0, "no force is at its limit");
}

/// ∫ τ·q̇ dt by the trapezoidal rule between the samples and the impacts, whose error is of second order in their distance.
#[test]
fn the_power_of_the_motors_is_the_rate_of_their_work_in_the_energy_balance() {
    let scene = shipped("racket");
    let told = run(&scene, 2e-5, true);
    let power = |qd: &[f64], forces: &[f64]| qd.iter().zip(forces).map(|(v, f)| v * f).sum::<f64>();
    let mut stages: Vec<[f64; 3]> = told.moments.iter().map(|(t, _, qd, f)| [*t, power(qd, f), power(qd, f)]).collect();
    for event in &told.events {
        if let Some(loads) = &event.loads {
            let [before, after] =
                [power(&event.qd_minus, &loads.motors_minus), power(&event.qd_plus, &loads.motors_plus)];
            stages.push([event.time, before, after]);
        }
    }
    stages.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let work: f64 = stages.windows(2).map(|pair| 0.5 * (pair[1][0] - pair[0][0]) * (pair[0][2] + pair[1][1])).sum();
    let drive = told.summary.energy.drive;
    assert!(drive.abs() > 0.01 && (work - drive).abs() < 1e-6 * drive.abs(), "{work} {drive}");
}

/// Runs with loads and without have the same events and ends, bit by bit; those without have no loads.
#[test]
fn loads_change_nothing_in_a_run() {
    for name in ["racket", "quadruped", "four_bar"] {
        let scene = shipped(name);
        let [plain, loaded] = [false, true].map(|loads| run(&scene, 0.01, loads));
        assert_eq!(format!("{:?}", plain.summary), format!("{:?}", loaded.summary), "{name}");
        assert!(plain.events.iter().all(|event| event.loads.is_none()));
        assert!(plain.moments.iter().all(|moment| moment.3.is_empty()));
        let bits = |told: &Told| -> Vec<String> {
            let of = |event: &Event| format!("{:?}", Event { loads: None, ..event.clone() });
            told.events.iter().map(of).chain(told.moments.iter().map(|it| format!("{:?}", (&it.1, &it.2)))).collect()
        };
        assert_eq!(bits(&plain), bits(&loaded), "{name}");
    }
}

/// Around a loop the impulses can be divided in many ways: they are not told, but those that the contact demands are.
#[test]
fn mechanisms_with_loops_have_no_impulses_through_joints() {
    let scene = shipped("four_bar");
    let told = run(&scene, 0.1, true);
    let event = told.events.iter().find_map(|event| event.loads.as_ref()).unwrap();
    assert!(event.impact.through.is_empty());
    assert!(event.impact.joint_impulse.iter().any(|x| *x != 0.0));
}
