//! Runs as linear maps, and their transposes: against sensitivities, and against differences of runs.

use carom_sim::{ByOutcome, Parameter, Simulation};
use carom_testing::scenes::changed;

/// Where the derivative does not exist there is no linear run, and the reason and the time are told; wrong numbers of changes are refused.
#[test]
fn a_run_without_a_derivative_has_no_linear_run() {
    let plan = changed("cradle", &[]).plan().unwrap();
    let Err(error) = plan.linear_run(1.0, &[]) else { panic!("a cradle has no derivative") };
    assert!(error.to_string().starts_with("the run has no derivative: at "), "{error}");
    let plan = changed("bounce", &[]).plan().unwrap();
    let run = plan.linear_run(0.1, &[]).unwrap();
    let told = run.vjp(&[1.0], &[]).unwrap_err().to_string();
    assert!(told.contains("number of derivatives by the final state"), "{told}");
    // Derivatives along the motion: one for each point, of the length of a displacement and a velocity.
    let (_, by) = run.integral(|_, _, _| Ok((1.0, vec![0.0; 12]))).unwrap();
    let mut short = by.clone();
    short.along[1].pop();
    let few = ByOutcome { along: by.along[1..].to_vec(), ..by.clone() };
    assert!(run.gradient(&by).is_ok() && run.gradient(&short).is_err() && run.gradient(&few).is_err());
    assert!(run.jvp(&[1.0; 7]).is_err() && run.vjp(&[0.0, 1.0], &[1.0; 9]).is_err());
}

/// Positions, approach speeds, rebound speeds and normal impulses at impacts of one contact and of two, and of a joint at its limit: the
/// gradient of a sum of them, and of an integral over the motion, by the start and by parameters, is its difference of runs.
#[test]
fn gradients_of_states_at_events_of_impulses_and_of_integrals_equal_differences_of_runs() {
    let away = [("q = [0.7854, -1.5708]", "q = [0.8, -1.6]")];
    // Until the ball has turned by less than π, where its displacement from the reference jumps.
    for (file, changes, duration) in [("planar2", &away[..], 0.5), ("racket", &[], 0.5)] {
        let scene = changed(file, changes);
        let plan = scene.plan().unwrap();
        let (sim, nv) = (&plan.simulation, plan.simulation.chain.nv());
        let parameters = Parameter::all(sim);
        let weights: Vec<f64> = (0..2 * nv).map(|k| (1.0 + k as f64).sin()).collect();
        let run = plan.linear_run(duration, &parameters).unwrap();
        let index = run.happened().position(|happened| happened[0].kind.is_impact()).expect(file);
        let reference = run.happened().nth(index).unwrap()[0].clone();
        // What is integrated: squares of displacements and velocities.
        let square = |q: &[f64], qd: &[f64]| -> f64 {
            let moved = sim.chain.difference(&reference.q, q).unwrap();
            moved.iter().chain(qd).zip(&weights).map(|(x, w)| 0.5 * w * x * x).sum()
        };
        // Of the first impact: a linear function of the states before and after it, and its impulse; and an integral over the motion.
        let value = |sim: &Simulation, q: &[f64], qd: &[f64]| {
            let fine = Simulation { tolerance: 1e-12, ..sim.clone() };
            let run = fine.run(q, qd, duration).unwrap();
            let event = run.events.iter().find(|event| event.kind.is_impact()).unwrap().clone();
            let moved = sim.chain.difference(&reference.q, &event.q).unwrap();
            let linear = |qd: &[f64]| -> f64 { moved.iter().chain(qd).zip(&weights).map(|(x, w)| x * w).sum() };
            let velocities = [event.qd_minus.as_slice(), &event.qd_plus];
            let impulse: f64 =
                sim.normal_impulses(event.kind.struck(), &event.q, velocities, event.time).unwrap().iter().sum();
            let direct: f64 = event
                .impulses
                .iter()
                .map(|it| {
                    let moment = carom_sim::Moment { time: event.time, q: event.q.clone(), qd: event.qd_minus.clone() };
                    sim.touching_point(it.touch, &moment).unwrap().map_or(0.0, |[_, n]| n.dot(&it.impulse))
                })
                .sum();
            assert!((impulse - direct).abs() < 1e-9 * direct.abs(), "{file}: {impulse} {direct}");
            let points = run.segments.iter().flat_map(|segment| segment.quadrature());
            let integral = points.map(|(_, weight, x)| weight * square(&x[..q.len()], &x[q.len()..])).sum();
            [linear(&event.qd_minus), linear(&event.qd_plus), integral]
        };
        let (sum, along) = run
            .integral(|_, _, x| {
                let (q, qd) = x.split_at(plan.q.len());
                let (mut slope, h) = (vec![0.0; nv], 1e-4);
                for k in 0..nv {
                    let at = |by: f64| {
                        let mut unit = vec![0.0; nv];
                        unit[k] = by;
                        square(&sim.chain.integrate(q, &unit, 1.0).unwrap(), qd)
                    };
                    slope[k] = (at(h) - at(-h)) / (2.0 * h);
                }
                slope.extend(qd.iter().zip(&weights[nv..]).map(|(x, w)| w * x));
                Ok((square(q, qd), slope))
            })
            .unwrap();
        let other = value(sim, &plan.q, &plan.qd)[2];
        // The quadrature over the steps of the tolerance of the scene.
        assert!((sum - other).abs() < 5e-6 * sum.abs(), "{file}: {sum} {other}");
        for side in [0, 1, 2] {
            let mut by = ByOutcome { last: vec![0.0; 2 * nv], ..ByOutcome::default() };
            match side {
                0 => by.before.push((index, weights.clone())),
                1 => by.after.push((index, weights.clone())),
                _ => by = along.clone(),
            }
            let gradient = run.gradient(&by).unwrap();
            for k in 0..2 * nv + parameters.len() {
                let at = |delta: f64| {
                    let (mut q, mut qd, mut changed) = (plan.q.clone(), plan.qd.clone(), sim.clone());
                    let mut unit = vec![0.0; nv];
                    if k < nv {
                        unit[k] = 1.0;
                        q = sim.chain.integrate(&q, &unit, delta).unwrap();
                    } else if k < 2 * nv {
                        qd[k - nv] += delta;
                    } else {
                        changed = parameters[k - 2 * nv].apply(sim, delta).unwrap();
                    }
                    value(&changed, &q, &qd)[side]
                };
                let h = 1e-4;
                let there = (at(h) - at(-h)) * (8.0 / 12.0 / h) - (at(2.0 * h) - at(-2.0 * h)) * (1.0 / 12.0 / h);
                assert!(
                    (gradient[k] - there).abs() < [1e-6, 1e-6, 1e-5][side] * there.abs().max(1.0),
                    "{file} {}: {} {there}",
                    run.names()[k],
                    gradient[k]
                );
            }
        }
    }
}
