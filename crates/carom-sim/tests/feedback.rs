//! Feedback along a motion with impacts: its gains against a closed form and against other gains, and the motions that it makes.

use carom_sim::{Drive, Feedback, FeedbackRow, Moment, Plan, Regulator, Sampling, Scene, Seen};
use carom_testing::files::path;
use carom_testing::scenes::with_robots;

/// The usual one, with deviations of the force of this size.
fn regulator(force: f64) -> Regulator {
    Regulator { force, rows: 400, ..Regulator::default() }
}

/// A scene of the repository with constant joint forces.
fn pushed(file: &str, forces: &[f64]) -> Plan {
    let mut scene = Scene::from_file(path(file)).unwrap();
    scene.simulation.drive = Drive::Constant(forces.to_vec());
    scene.plan().unwrap()
}

/// The plan with the feedback.
fn fed(plan: &Plan, feedback: &Feedback) -> Plan {
    let mut own = plan.clone();
    own.simulation.drive = Drive::Feedback(feedback.clone());
    own
}

/// A ball falls on an arm, which constant forces hold against gravity at the start.
fn ball_on_arm() -> Plan {
    let text = r#"
        [[robot]]
        name = "arm"
        urdf = "planar2.urdf"
        rpy = [1.5707963267948966, 0, 0]
        q = [0.8, -0.8]
        [[robot]]
        name = "ball"
        urdf = "ball.urdf"
        floating = true
        position = [0.51, 0, 0.7]
        tip = "ball"
        [contact]
        law = "newton"
        restitution = 0.5
        friction = 0.5
        [run]
        duration = 0.5
        gravity = [0, 0, -9.81]
    "#;
    let mut scene = with_robots(text).unwrap();
    let chain = &scene.simulation.chain;
    let held = chain.workspace().update(chain, &scene.q).unwrap().gravity_force(scene.simulation.gravity);
    scene.simulation.drive = Drive::Constant(held.iter().take(2).copied().chain([0.0; 6]).collect());
    scene.plan().unwrap()
}

/// R. E. Kalman 1960: of a mass m with weights a, b of place and velocity and r of the force the gains far from the end are
/// √(a/r) and √(b/r + 2 m √(a/r)).
#[test]
fn gains_of_a_free_mass_far_from_the_end_are_those_of_the_closed_form() {
    let (plan, usual) = (pushed("studies/aims/bounce_scene.toml", &[0.0]), regulator(10.0));
    let feedback = plan.feedback(0.85, &usual).unwrap();
    let [a, b, r] = [usual.position, usual.velocity, usual.force].map(|x: f64| x.powi(-2));
    let (stiff, damped) = ((a / r).sqrt(), (b / r + 2.0 * (a / r).sqrt()).sqrt());
    let first = &feedback.rows[0].gains;
    // What is left of the end: exp(−2 · 10/s · 0.85 s) = 4e-8.
    assert!((first[(0, 0)] / stiff - 1.0).abs() < 2e-7, "{first} {stiff}");
    assert!((first[(0, 1)] / damped - 1.0).abs() < 2e-7, "{first} {damped}");
}

/// A state, and the forces of the motors.
type Sample = (Moment, Vec<f64>);

/// A motion at even times.
fn samples(plan: &Plan, duration: f64, count: usize) -> Vec<Sample> {
    let (mut all, mut moment) = (Vec::new(), None);
    let sampling = Sampling { every: Some(duration / count as f64), loads: true, ..Sampling::default() };
    plan.stream(duration, sampling, &mut |seen| match seen {
        Seen::Moment(own) => moment = Some(own.clone()),
        Seen::Motors(_, forces) => all.push((moment.clone().unwrap(), forces.to_vec())),
        _ => {}
    })
    .unwrap();
    all
}

/// ∫ of the weighted squares of deviations and of the forces that are added, and the deviation at the end, by trapezoids.
fn cost(plan: &Plan, own: &[Sample], truth: &[Sample], regulator: &Regulator) -> f64 {
    let square = |(x, y): (&Sample, &Sample)| {
        let off = plan.simulation.chain.difference(&x.0.q, &y.0.q).unwrap();
        let sum = |all: &mut dyn Iterator<Item = f64>, unit: f64| all.map(|x| (x / unit).powi(2)).sum::<f64>();
        let state = sum(&mut off.into_iter(), regulator.position)
            + sum(&mut x.0.qd.iter().zip(&y.0.qd).map(|(x, y)| x - y), regulator.velocity);
        [state, sum(&mut x.1.iter().zip(&y.1).map(|(x, y)| x - y), regulator.force)]
    };
    let all: Vec<[f64; 2]> = own.iter().zip(truth).map(square).collect();
    let h = truth[1].0.time - truth[0].0.time;
    let whole: f64 = all.windows(2).map(|pair| h / 2.0 * pair.iter().flatten().sum::<f64>()).sum();
    whole + regulator.end * all[all.len() - 1][0]
}

/// Gains times a factor.
type Change = fn(&mut FeedbackRow, f64);

/// The costs of disturbed motions under these gains, scaled by 1 − ε, 1 and 1 + ε, are on a parabola with its vertex at 1: of all gains, of
/// those before the first impact, and of those of the displacements. The cost is that of simulated motions, without saltation matrices.
#[test]
fn other_gains_cost_more_before_and_after_an_impact() {
    // The last one has a ball beside an arm, which no motor drives: all that gains can do for it is done before the impact.
    let cases = [
        ("studies/aims/bounce_scene.toml", vec![3.0], 1.6, 1.0),
        ("studies/aims/nail_scene.toml", vec![-40.0, 0.0], 0.3, 10.0),
    ];
    let mut plans: Vec<_> =
        cases.map(|(file, forces, duration, force)| (file, pushed(file, &forces), duration, force)).into();
    plans.push(("ball", ball_on_arm(), 0.5, 1.0));
    let linkage = pushed("scenes/four_bar.toml", &[0.0; 3]);
    plans.push(("linkage", linkage, 0.3, 1.0));
    for (file, plan, duration, force) in plans {
        let own = regulator(force);
        let nv = plan.simulation.chain.nv();
        let feedback = plan.feedback(duration, &own).unwrap();
        let truth = samples(&plan, duration, 4000);
        let again = samples(&fed(&plan, &feedback), duration, 4000);
        let off = cost(&plan, &again, &truth, &own);
        // The undisturbed motion follows the reference: cubic polynomials over intervals of a millisecond.
        assert!(off < 1e-9, "{file}: {off:e}");
        let mut rng = fastrand::Rng::with_seed(7);
        let moved: Vec<f64> = (0..2 * nv).map(|_| 1e-5 * (rng.f64() - 0.5)).collect();
        let of = |feedback: Option<&Feedback>| {
            let mut moving = feedback.map_or_else(|| plan.clone(), |it| fed(&plan, it));
            if plan.simulation.loops.is_empty() {
                moving.q = moving.simulation.chain.integrate(&moving.q, &moved[..nv], 1.0).unwrap();
                moving.qd.iter_mut().zip(&moved[nv..]).for_each(|(qd, by)| *qd += by);
            } else {
                // Its one motion, a little later and faster: other states are not closed.
                let (Moment { q, qd, .. }, _) = samples(&plan, 1e-6, 1).pop().unwrap();
                (moving.q, moving.qd) = (q, qd.iter().map(|qd| 1.00001 * qd).collect());
            }
            cost(&plan, &samples(&moving, duration, 4000), &truth, &own)
        };
        let least = of(Some(&feedback));
        let without = of(None);
        assert!(least < 0.4 * without, "{file}: {least:e}, without feedback {without:e}");
        let patterns: [(&str, Change); 3] = [
            ("all", |row, by| row.gains *= by),
            ("before", |row, by| {
                if row.impacts == 0 {
                    row.gains *= by;
                }
            }),
            ("displacements", |row, by| {
                let n = row.gains.nrows();
                row.gains.columns_mut(0, n).scale_mut(by);
            }),
        ];
        for (what, change) in patterns {
            let [less, more] = [0.9, 1.1].map(|by| {
                let mut other = feedback.clone();
                other.rows.iter_mut().for_each(|row| change(row, by));
                of(Some(&other))
            });
            let vertex = 0.1 * (less - more) / (less + more - 2.0 * least) / 2.0;
            // Beside parabolas are cubic terms, of the size of 0.1², and the trapezoids over the time between both impacts.
            assert!(less > least && more > least && vertex.abs() < 0.02, "{file}, {what}: {vertex}");
        }
    }
}
