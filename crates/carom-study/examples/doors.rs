//! Run time of each way to compute an impact, beside the fused kernel of the same run.
//!
//! `cargo run --release -p carom-study --example doors` prints nanoseconds and, in brackets, multiples of the kernel of the
//! same robot (frictionless impact, M and H included; in the plane for planar robots): the least of 60 batches over 64 random
//! states. The states are the same for every row.

use carom_chain::algebra::Algebra;
use carom_chain::{Chain, Point, uniform_chain};
use carom_impact::{Energetic, Frictionless, ImpactProblem, Law};
use carom_sim::{FrictionlessJump, Impacts};
use nalgebra::{Vector2, Vector3};
use std::hint::black_box;
use std::time::Instant;

const STATES: usize = 64;
const BATCHES: usize = 60;
/// Least duration of a batch, s.
const LONG_ENOUGH: f64 = 2e-4;
const FRICTIONLESS: Frictionless = Frictionless { restitution: 0.5 };
const ENERGETIC: Energetic = Energetic { restitution: 0.5, friction: 0.3 };
const NORMAL: [f64; 3] = [-1.0, 0.0, 0.0];

fn main() {
    let robots = ["planar2", "planar3", "arm7", "humanoid29", "chain100"];
    let columns: Vec<Vec<(&str, f64)>> = robots.iter().map(|robot| rows(robot)).collect();
    print!("{:<44}", "ns (kernels)");
    robots.iter().for_each(|robot| print!("{robot:>18}"));
    println!();
    for (row, (name, _)) in columns[0].iter().enumerate() {
        print!("{name:<44}");
        for column in &columns {
            let (kernel, time) = (column[0].1, column[row].1);
            print!("{:>18}", format!("{time:.0} ({:.1})", time / kernel));
        }
        println!();
    }
}

/// All rows of one robot.
fn rows(robot: &str) -> Vec<(&'static str, f64)> {
    let chain = match robot {
        "chain100" => uniform_chain(100, 1.0, 1.0).expect("a chain"),
        _ => {
            Chain::from_urdf_file(format!("{}/../../robots/{robot}.urdf", env!("CARGO_MANIFEST_DIR"))).expect("a robot")
        }
    };
    let tip = chain.frame("tip").expect("a frame tip");
    let mut rng = fastrand::Rng::with_seed(7);
    let mut draw = || (0..chain.nv()).map(|_| rng.f64() * 4.0 - 2.0).collect::<Vec<f64>>();
    let mut states = Vec::new();
    while states.len() < STATES {
        let (q, mut qd) = (draw(), draw());
        let u = chain.impact(&q, &qd).at(tip).normal(NORMAL).contact().expect("a contact").problem().u_minus().z;
        if u > 0.0 {
            qd.iter_mut().for_each(|x| *x = -*x);
        }
        states.push((q, qd));
    }
    let strike = |(q, qd): &(Vec<f64>, Vec<f64>), law: &dyn Law<f64, 3>| {
        black_box(chain.impact(q, qd).at(tip).normal(NORMAL).resolve(law).expect("an impact"));
    };
    let kernel = match chain.to_planar() {
        Ok(flat) => kernel(&flat.chain, flat.point(tip, Vector3::zeros()), Vector2::new(-1.0, 0.0), &states),
        Err(_) => kernel(&chain, chain.point(tip, Vector3::zeros()), NORMAL.into(), &states),
    };
    let mut rows = vec![("fused kernel", kernel)];
    rows.push(("chain.impact(…).resolve(&Frictionless)", each(&states, |state| strike(state, &FRICTIONLESS))));
    rows.push(("chain.impact(…).resolve(&Energetic)", each(&states, |state| strike(state, &ENERGETIC))));
    let laws: [(&str, &dyn Law<f64, 3>); 2] =
        [("prepared, Frictionless", &FRICTIONLESS), ("prepared, Energetic", &ENERGETIC)];
    for (name, law) in laws {
        let mut prepared = chain.impact(&[], &[]).at(tip).normal(NORMAL).prepare().expect("a strike");
        let mut hit = prepared.outcome();
        let time = each(&states, |(q, qd)| prepared.resolve_into(q, qd, law, black_box(&mut hit)).expect("an impact"));
        rows.push((name, time));
    }
    let problems: Vec<ImpactProblem<f64, 3>> = states
        .iter()
        .map(|(q, qd)| *chain.impact(q, qd).at(tip).normal(NORMAL).contact().expect("a contact").problem())
        .collect();
    rows.push((
        "Energetic.resolve(&problem) alone",
        each(&problems, |problem| {
            black_box(ENERGETIC.resolve(black_box(problem)).expect("an outcome"));
        }),
    ));
    rows.push((
        "derivatives of Energetic alone",
        each(&problems, |problem| {
            black_box(black_box(problem).differentiate(&ENERGETIC).expect("derivatives"));
        }),
    ));
    rows.push((
        "derivatives, Energetic",
        each(&states, |(q, qd)| {
            black_box(chain.impact(q, qd).at(tip).normal(NORMAL).derivative(&ENERGETIC).expect("derivatives"));
        }),
    ));
    rows
}

fn kernel<A: Algebra<Scalar = f64>>(
    chain: &Chain<A>,
    point: Point<A>,
    normal: A::Vector,
    states: &[(Vec<f64>, Vec<f64>)],
) -> f64 {
    let kernel = FrictionlessJump::new(chain, point).expect("a kernel");
    let mut jump = kernel.jump();
    each(states, |(q, qd)| kernel.jump_into(q, qd, normal, 0.5, black_box(&mut jump)).expect("a jump"))
}

/// The least time of one call, ns.
fn each<X>(items: &[X], mut work: impl FnMut(&X)) -> f64 {
    let mut batch = |repeats: u32| {
        let begin = Instant::now();
        for _ in 0..repeats {
            items.iter().for_each(|item| work(black_box(item)));
        }
        begin.elapsed().as_secs_f64()
    };
    let repeats = (LONG_ENOUGH / batch(1)).ceil().clamp(1.0, 1e6) as u32;
    let best = (0..BATCHES).map(|_| batch(repeats)).fold(f64::INFINITY, f64::min);
    best * 1e9 / (f64::from(repeats) * items.len() as f64)
}
