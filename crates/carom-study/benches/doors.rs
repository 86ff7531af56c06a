//! Run time of each way to compute an impact, beside the fused kernel of the same run.
//!
//! `cargo bench -p carom-study --bench doors` prints nanoseconds and, in brackets, multiples of the kernel of the
//! same robot (frictionless impact, M and H included; in the plane for planar robots): the least of 60 batches over 64 random
//! states. The states are the same for every row.

use carom_chain::algebra::Algebra;
use carom_chain::{Chain, Point, uniform_chain};
use carom_impact::{Energetic, Frictionless, ImpactProblem, Law};
use carom_sim::{FrictionlessJump, Impacts, Outcomes, States};
use nalgebra::{Vector2, Vector3};
use std::hint::black_box;
use std::time::Instant;

const STATES: usize = 64;
const BATCHES: usize = 60;
/// Configurations of a batch in columns.
const MANY: usize = 1024;
/// Least duration of a batch, s.
const LONG_ENOUGH: f64 = 2e-4;
const FRICTIONLESS: Frictionless = Frictionless { restitution: 0.5 };
const ENERGETIC: Energetic = Energetic { restitution: 0.5, friction: 0.3 };
const NORMAL: [f64; 3] = [-1.0, 0.0, 0.0];

/// q and q̇.
type State = (Vec<f64>, Vec<f64>);

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
            print!("{:>18}", format!("{} ({:.1})", short(time), time / kernel));
        }
        println!();
    }
}

/// Three digits.
fn short(time: f64) -> String {
    if time < 99.5 { format!("{time:.1}") } else { format!("{time:.0}") }
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
    let strike = |(q, qd): &State, law: &dyn Law<f64, 3>| {
        black_box(chain.impact(q, qd).at(tip).normal(NORMAL).resolve(law).expect("an impact"));
    };
    let mut rows = match chain.to_planar() {
        Ok(flat) => kernels(&flat.chain, flat.point(tip, Vector3::zeros()), Vector2::new(-1.0, 0.0), &states),
        Err(_) => kernels(&chain, chain.point(tip, Vector3::zeros()), NORMAL.into(), &states),
    };
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
    let [q, qd] = columns(&states);
    let (q, qd) = (slices(&q), slices(&qd));
    for (name, law) in [("prepared, columns, Frictionless", laws[0].1), ("prepared, columns, Energetic", laws[1].1)] {
        let mut prepared = chain.impact(&[], &[]).at(tip).normal(NORMAL).prepare().expect("a strike");
        let time = each(&[()], |()| {
            let states = black_box(States { q: &q, qd: &qd });
            let done = prepared.many(states, law, |_, hit| {
                black_box(hit.expect("an impact"));
            });
            done.expect("columns");
        });
        rows.push((name, time / MANY as f64));
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

/// The fused kernel one at a time, and in batch: the jump alone, and with M, J and H written out.
fn kernels<A: Algebra<Scalar = f64>>(
    chain: &Chain<A>,
    point: Point<A>,
    normal: A::Vector,
    states: &[State],
) -> Vec<(&'static str, f64)> {
    let kernel = FrictionlessJump::new(chain, point).expect("a kernel");
    let mut jump = kernel.jump();
    let one = each(states, |(q, qd)| kernel.jump_into(q, qd, normal, 0.5, black_box(&mut jump)).expect("a jump"));
    let mut rows = vec![("fused kernel", one)];
    let n = chain.nv();
    let [q, qd] = columns(states);
    let (q, qd) = (slices(&q), slices(&qd));
    for (name, all) in [("kernel in batch, jump only", false), ("kernel in batch, M, J, H written out", true)] {
        let rows_of = [n, 1, A::LINEAR * A::LINEAR, A::LINEAR * n, n * n];
        let mut out: Vec<Vec<Vec<f64>>> = rows_of
            .iter()
            .enumerate()
            .map(|(i, &count)| vec![vec![0.0; MANY]; if i < 2 || all { count } else { 0 }])
            .collect();
        let mut out: Vec<Vec<&mut [f64]>> =
            out.iter_mut().map(|part| part.iter_mut().map(Vec::as_mut_slice).collect()).collect();
        let time = each(&[()], |()| {
            let [qd_plus, impulse, delassus, jacobian, mass_matrix] = &mut out[..] else { return };
            let mut outcomes = Outcomes { qd_plus, impulse, delassus, jacobian, mass_matrix };
            kernel.many(black_box(States { q: &q, qd: &qd }), normal, 0.5, &mut outcomes).expect("a batch");
        });
        rows.push((name, time / MANY as f64));
    }
    rows
}

/// Columns of q and of q̇ of [`MANY`] configurations.
fn columns(states: &[State]) -> [Vec<Vec<f64>>; 2] {
    let of: [fn(&State) -> &Vec<f64>; 2] = [|state| &state.0, |state| &state.1];
    of.map(|of| {
        let entry = |i: usize, k: usize| of(&states[k % STATES])[i] + 1e-3 * (k / STATES) as f64;
        (0..states[0].1.len()).map(|i| (0..MANY).map(|k| entry(i, k)).collect()).collect()
    })
}

fn slices(columns: &[Vec<f64>]) -> Vec<&[f64]> {
    columns.iter().map(Vec::as_slice).collect()
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
