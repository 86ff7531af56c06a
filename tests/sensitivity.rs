//! Derivatives of whole runs: against closed forms, and against differences of runs.

use carom::sim::{Parameter, Scene, Sensitivity, Simulation};
use nalgebra::{DMatrix, DVector};

fn scene(name: &str) -> Scene {
    Scene::from_file(format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR"))).unwrap()
}

/// The final state as displacement from `last` and velocity.
fn end(sim: &Simulation, last: &[f64], q: &[f64], qd: &[f64], duration: f64) -> DVector<f64> {
    let run = sim.run(q, qd, duration).unwrap();
    let apart = sim.chain.difference(last, &run.summary.last.q).unwrap();
    DVector::from_iterator(2 * apart.len(), apart.iter().copied().chain(run.summary.last.qd.iter().copied()))
}

/// The derivatives by differences of fourth order of runs at a hundredth of the tolerance.
fn differences(
    sim: &Simulation,
    start: (&[f64], &[f64]),
    duration: f64,
    parameters: &[Parameter],
    h: f64,
) -> DMatrix<f64> {
    let fine = Simulation { tolerance: 1e-13, ..sim.clone() };
    let last = fine.run(start.0, start.1, duration).unwrap().summary.last;
    let nv = sim.chain.nv();
    let mut by = DMatrix::zeros(2 * nv, 2 * nv + parameters.len());
    for j in 0..by.ncols() {
        let at = |times: f64| {
            let delta = times * h;
            let mut unit = vec![0.0; nv];
            let (mut q, mut qd) = (start.0.to_vec(), start.1.to_vec());
            let mut sim = fine.clone();
            if j < nv {
                unit[j] = 1.0;
                q = sim.chain.integrate(&q, &unit, delta).unwrap();
            } else if j < 2 * nv {
                qd[j - nv] += delta;
            } else {
                sim = parameters[j - 2 * nv].apply(&sim, delta);
            }
            end(&sim, &last.q, &q, &qd, duration)
        };
        by.set_column(j, &((at(1.0) - at(-1.0)) * (8.0 / 12.0 / h) - (at(2.0) - at(-2.0)) * (1.0 / 12.0 / h)));
    }
    by
}

fn check(name: &str, sim: &Simulation, start: (&[f64], &[f64]), duration: f64, h: f64, tolerance: f64) -> Sensitivity {
    let parameters = Parameter::all(sim);
    let found = sim.sensitivity(start.0, start.1, duration, &parameters).unwrap();
    println!(
        "{name}: {:?} {:?}",
        found.events.iter().map(|e| (e.time, e.kinds.join("+"))).collect::<Vec<_>>(),
        found.broken
    );
    let own = found.last_by.as_ref().unwrap();
    let other = differences(sim, start, duration, &parameters, h);
    let overall = other.amax();
    let worst = (own - &other).amax() / overall;
    println!("{name}: size {overall:e} worst {worst:e}");
    for j in 0..own.ncols() {
        let (size, apart) = (other.column(j).amax(), (own.column(j) - other.column(j)).amax());
        assert!(
            apart <= tolerance * overall && apart <= 1e-4 * size.max(1e-5 * overall),
            "{name}: {}: {} against {}",
            found.names[j],
            own.column(j),
            other.column(j)
        );
    }
    found
}

#[test]
fn sensitivities_equal_differences_of_runs() {
    for (name, h) in [
        ("bounce", 1e-4),
        ("planar2", 5e-6),
        ("planar3", 5e-6),
        ("kane", 2e-7),
        ("strike7", 1e-5),
        ("ball", 1e-5),
        ("chain10", 1e-4),
    ] {
        let plan = scene(name).plan().unwrap();
        let own = scene(name);
        let clock = std::time::Instant::now();
        plan.run(own.duration).unwrap();
        let run = clock.elapsed();
        let clock = std::time::Instant::now();
        let found = plan.sensitivity(own.duration, &Parameter::all(&plan.simulation)).unwrap();
        println!(
            "{name}: {} columns, {:.1} runs",
            found.names.len(),
            clock.elapsed().as_secs_f64() / run.as_secs_f64()
        );
        if found.broken.is_some() {
            println!("{name} broken {:?}", found.broken);
            continue;
        }
        check(name, &plan.simulation, (&plan.q, &plan.qd), own.duration, h, 1e-6);
    }
}
