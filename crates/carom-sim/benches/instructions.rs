//! Runs one kernel a hundred times to count its instructions, which are reproducible, unlike times.
//!
//! `.ci/instructions` runs this under callgrind for every kernel and compares the counts with its table. With the argument
//! `time` it prints the shortest of up to 2000 times, measured for up to three seconds:
//! `cargo bench -p carom-sim --bench instructions -- planar2 chain time`.

use carom_chain::algebra::Algebra;
use carom_chain::{Chain, Point, uniform_chain};
use carom_impact::{Energetic, Frictionless, Law};
use carom_sim::{FrictionlessJump, Impacts, Outcomes, Sampling, Scene, Simulation, States, frictionless_jump_into};
use nalgebra::{DMatrix, Vector2, Vector3};
use std::hint::black_box;
use std::time::{Duration, Instant};

const REPEATS: u32 = 100;
/// Longest time for measuring one kernel.
const LONGEST: Duration = Duration::from_secs(3);
/// Configurations of a batch.
const MANY: usize = 1024;

fn main() {
    // `cargo bench` adds an argument of its own.
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let (robot, kernel, time) = match arguments.as_slice() {
        [robot, kernel] => (robot, kernel, false),
        [robot, kernel, time] if time == "time" => (robot, kernel, true),
        _ => panic!("usage: instructions ROBOT KERNEL [time], as in .ci/instructions.txt"),
    };
    let (name, in_space) = match robot.strip_suffix("-in-space") {
        Some(name) => (name, true),
        None => (robot.as_str(), false),
    };
    if kernel == "simulation" {
        return simulation(name, !in_space, time);
    }
    let chain = match name.strip_prefix("chain") {
        Some(links) => uniform_chain(links.parse().expect("number of links"), 1.0, 1.0).unwrap(),
        None => Chain::from_urdf_file(format!("{}/../../robots/{name}.urdf", env!("CARGO_MANIFEST_DIR"))).unwrap(),
    };
    let tip = chain.frame("tip").unwrap();
    match kernel.as_str() {
        "strike-frictionless" => return strike(&chain, &Frictionless { restitution: 0.5 }, time),
        "strike-energetic" => return strike(&chain, &Energetic { restitution: 0.5, friction: 0.3 }, time),
        _ => {}
    }
    match chain.to_planar() {
        Ok(flat) if !in_space => {
            let point = flat.point(tip, Vector3::zeros());
            run(&flat.chain, point, -Vector2::x(), kernel, time);
        }
        _ => run(&chain, chain.point(tip, Vector3::zeros()), -Vector3::x(), kernel, time),
    }
}

/// callgrind counts instructions inside of this function only.
#[inline(never)]
fn measured(work: &mut dyn FnMut()) {
    for _ in 0..REPEATS {
        work();
    }
}

fn report(time: bool, mut work: impl FnMut()) {
    work(); // work that is done once, such as detecting the instruction set, is not counted
    measured(&mut work);
    if time {
        let mut once = || {
            let start = Instant::now();
            measured(&mut work);
            start.elapsed()
        };
        let begin = Instant::now();
        let mut best = once();
        for _ in 1..2000 {
            if begin.elapsed() > LONGEST {
                break;
            }
            best = best.min(once());
        }
        println!("{:.1} ns", best.as_nanos() as f64 / f64::from(REPEATS));
    }
}

/// A prepared strike.
fn strike(chain: &Chain, law: &dyn Law<f64, 3>, time: bool) {
    let tip = chain.frame("tip").unwrap();
    let q: Vec<f64> = (0..chain.nv()).map(|i| 0.3 + 0.1 * (i % 5) as f64).collect();
    let towards = |qd: &[f64]| {
        chain.impact(&q, qd).at(tip).normal([-1.0, 0.0, 0.0]).contact().unwrap().problem().u_minus().z < 0.0
    };
    let sign = if towards(&q) { 1.0 } else { -1.0 };
    let qd: Vec<f64> = q.iter().map(|x| sign * x).collect();
    let mut strike = chain.impact(&q, &qd).at(tip).normal([-1.0, 0.0, 0.0]).prepare().unwrap();
    let mut hit = strike.outcome();
    report(time, || strike.resolve_into(black_box(&q), &qd, law, black_box(&mut hit)).unwrap());
}

/// The whole run of a scene without samples and segments.
fn simulation(name: &str, planar: bool, time: bool) {
    let scene = Scene::from_file(format!("{}/../../scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap();
    let Scene { simulation, q, qd, duration, .. } = scene;
    let sim = Simulation { planar, ..simulation };
    report(time, || {
        sim.stream(black_box(&q), &qd, duration, Sampling::default(), &mut |_| {}).unwrap();
    });
}

fn run<A: Algebra<Scalar = f64>>(chain: &Chain<A>, tip: Point<A>, normal: A::Vector, kernel: &str, time: bool) {
    let n = chain.nv();
    let q: Vec<f64> = (0..n).map(|i| 0.3 + 0.1 * (i % 5) as f64).collect();
    let fused = FrictionlessJump::new(chain, tip).unwrap();
    let mut workspace = chain.workspace();
    let mut out = q.clone();
    match kernel {
        "chain" => {
            let mut jump = fused.jump();
            report(time, || fused.jump_into(black_box(&q), &q, normal, 0.35, &mut jump).unwrap());
        }
        "batch" => {
            let columns = |rows: usize| -> Vec<Vec<f64>> {
                (0..rows).map(|i| (0..MANY).map(|k| 0.3 + 0.1 * (i % 5) as f64 + 1e-3 * k as f64).collect()).collect()
            };
            let states = columns(n);
            let states: Vec<&[f64]> = states.iter().map(Vec::as_slice).collect();
            let (mut qd_plus, mut impulse) = (columns(n), columns(1));
            let mut qd_plus: Vec<&mut [f64]> = qd_plus.iter_mut().map(Vec::as_mut_slice).collect();
            let mut impulse: Vec<&mut [f64]> = impulse.iter_mut().map(Vec::as_mut_slice).collect();
            report(time, || {
                let states = black_box(States { q: &states, qd: &states });
                let mut outcomes = Outcomes { qd_plus: &mut qd_plus, impulse: &mut impulse, ..Default::default() };
                fused.many(states, normal, 0.35, &mut outcomes).unwrap();
            });
        }
        "recursive-jump" => {
            let mut scratch = q.clone();
            report(time, || {
                let mut kin = workspace.update(chain, black_box(&q)).unwrap();
                frictionless_jump_into(&mut kin, tip, normal, 0.35, &q, &mut scratch, &mut out).unwrap();
            });
        }
        "mass-matrix" => {
            let mut m = DMatrix::zeros(n, n);
            report(time, || workspace.update(chain, black_box(&q)).unwrap().mass_matrix_into(&mut m));
        }
        "kinematics" => report(time, || {
            black_box(workspace.update(chain, black_box(&q)).unwrap());
        }),
        "inverse-dynamics" => report(time, || {
            workspace.update(chain, black_box(&q)).unwrap().inverse_dynamics_into(&q, &q, normal, &mut out).unwrap();
        }),
        "forward-dynamics" => report(time, || {
            let mut kin = workspace.update(chain, black_box(&q)).unwrap();
            kin.articulate().unwrap().forward_dynamics_into(&q, &q, normal, &mut out).unwrap();
        }),
        "delassus" => {
            let mut h = DMatrix::zeros(A::LINEAR, A::LINEAR);
            report(time, || {
                let mut kin = workspace.update(chain, black_box(&q)).unwrap();
                kin.articulate().unwrap().delassus_into(tip, &mut h);
            });
        }
        _ => panic!("no kernel '{kernel}'"),
    }
}
