//! Run time of large batches of impacts in Rust, to compare with those of the Python package.
//!
//! `cargo run --release -p carom-study --example batches` prints nanoseconds for each state, the least of five runs: 10⁶ impacts of
//! planar2 without friction, 10⁵ of arm7 with friction, by prepared strikes that write velocities, impulse and energies, on all
//! cores (`RAYON_NUM_THREADS` limits them). `crates/carom-python/benches/beside.py` does the same from Python.

use carom_chain::Chain;
use carom_impact::{AnyLaw, Energetic, Frictionless};
use carom_sim::Impacts;
use rayon::prelude::*;
use std::time::Instant;

/// States that one core computes at a time.
const CHUNK: usize = 256;
const RUNS: usize = 5;
const NORMAL: [f64; 3] = [-1.0, 0.0, 0.0];

fn main() {
    let frictionless = AnyLaw::from(Frictionless { restitution: 0.5 });
    let energetic = AnyLaw::from(Energetic { restitution: 0.5, friction: 0.3 });
    for (robot, name, law, count) in
        [("planar2", "frictionless", frictionless, 1_000_000), ("arm7", "energetic", energetic, 100_000)]
    {
        let urdf = format!("{}/../../robots/{robot}.urdf", env!("CARGO_MANIFEST_DIR"));
        let chain = Chain::from_urdf_file(urdf).expect("a robot");
        println!("{robot:8} {name:13} {count:8} states {:8.1} ns for each", least(&chain, &law, count));
    }
}

fn least(chain: &Chain, law: &AnyLaw, count: usize) -> f64 {
    let (nv, tip) = (chain.nv(), chain.frame("tip").expect("a frame tip"));
    let mut rng = fastrand::Rng::with_seed(7);
    let mut draw = || (0..count * nv).map(|_| rng.f64() * 4.0 - 2.0).collect::<Vec<f64>>();
    let (q, qd) = (draw(), draw());
    let strike = chain.impact(&[], &[]).at(tip).normal(NORMAL).prepare().expect("a strike");
    let run = |_| {
        let begin = Instant::now();
        // Results are allocated in the time, as a batch in Python does.
        let mut velocities = vec![0.0; count * nv];
        let mut rest = vec![0.0; count * 13];
        let states = q.par_chunks(CHUNK * nv).zip(qd.par_chunks(CHUNK * nv));
        let results = velocities.par_chunks_mut(CHUNK * nv).zip(rest.par_chunks_mut(CHUNK * 13));
        states.zip(results).for_each_init(
            || (strike.clone(), strike.outcome()),
            |(strike, hit), ((q, qd), (velocities, rest))| {
                let states = q.chunks_exact(nv).zip(qd.chunks_exact(nv));
                let results = velocities.chunks_exact_mut(nv).zip(rest.chunks_exact_mut(13));
                for ((q, qd), (after, rest)) in states.zip(results) {
                    chain.check_state(q, qd).expect("a state");
                    strike.resolve_into(q, qd, law, hit).expect("an impact");
                    after.copy_from_slice(&hit.qd_plus);
                    let numbers = hit.impulse.iter().chain(hit.u_minus.iter()).chain(hit.u_plus.iter());
                    let energies =
                        [hit.energy_before, hit.energy_after, hit.contact.normal_work, hit.contact.friction_work];
                    rest.iter_mut().zip(numbers.chain(&energies)).for_each(|(out, x)| *out = *x);
                }
            },
        );
        std::hint::black_box((velocities, rest));
        begin.elapsed().as_secs_f64() * 1e9 / count as f64
    };
    (0..RUNS).map(run).fold(f64::INFINITY, f64::min)
}
