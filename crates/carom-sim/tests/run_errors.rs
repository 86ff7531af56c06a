//! Estimated errors of runs, and tolerances that meet an accuracy.

use carom_sim::{Event, Moment, Plan, RunError, Sampling, Scene, Seen, SimError, Simulation, Summary};
use carom_testing::build::{Part, X, Z, ball, urdf};
use carom_testing::scenes::{changed, scene};
use std::f64::consts::PI;

/// A ball on a spring strikes a wall at the rest length of the spring: between impacts x = eᵏ x₀ |cos ωt|.
fn ball_on_slider() -> String {
    urdf(&[Part::slider("ball", "base", X).weighing(2.0, [1.0; 3]).shaped(&ball(0.1))])
}

/// √(k/m), 1/s, and the restitution.
const OMEGA: f64 = 3.0;
const RESTITUTION: f64 = 0.8;

fn on_spring(run: &str) -> Result<Scene, SimError> {
    let text = format!(
        "[robot]\nurdf = \"ball.urdf\"\nq = [0.5]\n[[surface]]\nname = \"wall\"\nshape = {{ halfspace = {{ point = [-0.1, 0, 0], normal = [1, 0, 0] }} }}\n\
         [[spring]]\njoint = \"jball\"\nstiffness = {}\n[contact]\nlaw = \"newton\"\nrestitution = {RESTITUTION}\nfriction = 0\n\
         [run]\ngravity = [0, 0, 0]\n{run}",
        2.0 * OMEGA * OMEGA
    );
    scene(&[("ball.urdf", &ball_on_slider())], &text)
}

/// A run with its errors.
fn estimated(plan: &Plan, duration: f64, every: Option<f64>) -> (Vec<Event>, Vec<Moment>, Summary, RunError) {
    let (mut events, mut samples) = (Vec::new(), Vec::new());
    let sampling = Sampling { every, ..Sampling::default() };
    let summary = plan.stream(duration, sampling, &mut |seen| match seen {
        Seen::Event(event) => events.push(event.clone()),
        Seen::Moment(moment) => samples.push(moment.clone()),
        _ => {}
    });
    let summary = summary.unwrap();
    let error = plan.error_of((duration, every), (&events, &samples, &summary)).unwrap();
    (events, samples, summary, error)
}

/// The time of the k-th impact, from 0.
fn impact(k: usize) -> f64 {
    (0.5 + k as f64) * PI / OMEGA
}

/// q and q̇ at a time.
fn exact(time: f64) -> [f64; 2] {
    let impacts = (0..).take_while(|&k| impact(k) <= time).count();
    let size = 0.5 * RESTITUTION.powi(impacts as i32);
    let sign = if impacts % 2 == 0 { 1.0 } else { -1.0 };
    [sign * size * (OMEGA * time).cos(), -sign * size * OMEGA * (OMEGA * time).sin()]
}

/// A mass between springs falls on a rough floor, level or steep, and its impacts accumulate: with a small restitution a tighter tolerance leaves the
/// same impacts, and the error of leaving them is in both runs. Against a run at the tightest tolerance.
#[test]
fn errors_of_the_ends_of_accumulations_are_estimated() {
    let robot = urdf(&[Part::slider("x", "base", X).massless(), Part::slider("z", "x", Z).shaped(&ball(0.05))]);
    let cases = [
        (0.03, [50, 50], 0.6, [0.2, 1.0], 0.3, 0.4),
        (0.15, [50, 500], 0.6, [0.5, 3.0], 0.0, 0.7),
        (0.03, [500, 500], 0.3, [0.5, 1.0], 0.3, 0.4),
    ];
    for (restitution, [along, down], friction, [height, speed], steep, duration) in cases {
        let spring = |joint: &str, stiffness: i32| {
            format!("[[spring]]\njoint = \"{joint}\"\nstiffness = {stiffness}\nrest = -0.05\n")
        };
        let at = |run: &str| {
            let text = format!(
                "[robot]\nurdf = \"mass.urdf\"\nq = [0, {height}]\nqd = [{speed}, 0]\n[[surface]]\nname = \"floor\"\n\
                 shape = {{ halfspace = {{ point = [0, 0, 0], normal = [{steep}, 0, 1] }} }}\n{}{}\
                 [contact]\nlaw = \"energetic\"\nrestitution = {restitution}\nfriction = {friction}\n[run]\nduration = {duration}\n{run}",
                spring("jx", along),
                spring("jz", down)
            );
            scene(&[("mass.urdf", &robot)], &text).unwrap()
        };
        let run = |text: &str| at(text).plan().unwrap().run(duration).unwrap().summary.last;
        let exact = run("tolerance = 1e-13\nzeno_time = 1e-7\n");
        let apart = |last: &Moment| {
            let numbers = last.q.iter().zip(&exact.q).chain(last.qd.iter().zip(&exact.qd));
            numbers.map(|(a, b)| (a - b).abs()).collect::<Vec<_>>()
        };
        for tolerance in ["1e-5", "1e-7"] {
            let plan = at(&format!("tolerance = {tolerance}\n")).plan().unwrap();
            let (events, _, summary, error) = estimated(&plan, duration, None);
            assert!(events.iter().any(|event| event.kind.name() == "zeno"), "{restitution} {tolerance}");
            let estimates = error.last.unwrap();
            for (apart, estimate) in apart(&summary.last).iter().zip(estimates.q.iter().chain(&estimates.qd)) {
                assert!(*apart <= 3.0 * estimate, "{restitution} {tolerance}: {apart:e} of {estimate:e}");
            }
        }
        // The times of the ends are less accurate than the motion.
        let met = at("accuracy = 1e-5\n").to_accuracy().unwrap().met.unwrap();
        let worst = apart(&met.summary.last).into_iter().fold(0.0, f64::max);
        assert!(worst <= 1e-5, "{restitution}: {worst:e}");
        let told =
            format!("tolerance = {}\nmax_step = {}\nzeno_time = {}\n", met.tolerance, met.max_step, met.zeno_time);
        assert_eq!(run(&told), met.summary.last);
    }
}

/// Each error is at most ten times its estimate, as the closed form tells, and the largest is a third of its own at least.
#[test]
fn errors_of_a_ball_on_a_spring_are_those_of_its_closed_form() {
    let plan = on_spring("duration = 5\ntolerance = 1e-7\n").unwrap().plan().unwrap();
    let (events, samples, summary, error) = estimated(&plan, 5.0, Some(0.01));
    assert_eq!((events.len(), error.tighter.as_slice(), &error.unknown), (5, &[0.1 * 1e-7][..], &None));
    let (mut true_ones, mut estimates) = (Vec::new(), Vec::new());
    for (k, (event, estimate)) in events.iter().zip(&error.events).enumerate() {
        true_ones.push((event.time - impact(k)).abs());
        estimates.push(estimate.unwrap());
    }
    let ends = samples.iter().chain([&summary.last]).zip(error.samples.iter().chain([&error.last]));
    for (moment, estimate) in ends {
        let [q, qd] = exact(moment.time);
        // At an impact the motion jumps, and an error of its time is none of the state.
        if events.iter().any(|event| (event.time - moment.time).abs() < 1e-6) {
            continue;
        }
        let estimate = estimate.as_ref().unwrap();
        true_ones.extend([(moment.q[0] - q).abs(), (moment.qd[0] - qd).abs()]);
        estimates.extend([estimate.q[0], estimate.qd[0]]);
    }
    for (error, estimate) in true_ones.iter().zip(&estimates) {
        assert!(*error <= 10.0 * estimate, "{error:e} {estimate:e}");
    }
    let largest = |numbers: &[f64]| numbers.iter().fold(0.0, |most: f64, x| most.max(*x));
    assert!(largest(&true_ones) > 3e-11, "{:e}: the test would show nothing", largest(&true_ones));
    assert!(largest(&estimates) < 3.0 * largest(&true_ones), "{:e} {:e}", largest(&true_ones), largest(&estimates));
}

/// A tighter tolerance adds impacts to an accumulation, and the end is compared all the same; at several corners a third run tells
/// how much their order matters.
#[test]
fn accumulations_have_errors_though_their_impacts_are_others() {
    let arm = changed("planar3", &[]).plan().unwrap();
    let boxed = changed("box", &[]).plan().unwrap();
    for (plan, duration, runs) in [(&arm, 0.8, 1), (&boxed, 2.0, 2)] {
        let (events, _, _, error) = estimated(plan, duration, None);
        assert!(events.iter().any(|event| event.kind.name() == "zeno"));
        assert_eq!((error.tighter.len(), error.unknown), (runs, None));
        assert!(error.last.is_some());
    }
}

#[test]
fn time_steps_have_no_estimate_and_tell_why() {
    let scene = on_spring("duration = 1\nmethod = \"steps\"\n").unwrap();
    let (_, samples, _, error) = estimated(&scene.plan().unwrap(), 1.0, Some(0.5));
    let unknown = error.unknown.unwrap();
    assert!(unknown.reason.contains("step_error"), "{unknown:?}");
    assert_eq!((error.last, error.samples), (None, vec![None; samples.len()]));
    let plan = on_spring("duration = 1\ntolerance = 1e-14\n").unwrap().plan().unwrap();
    let summary = plan.stream(1.0, Sampling::default(), &mut |_| {}).unwrap();
    let refused = plan.error_of((1.0, None), (&[], &[], &summary)).unwrap_err().to_string();
    assert!(refused.contains("tolerance is 1e-14") && refused.contains("choose 1e-12 or more"), "{refused}");
}

/// A run that ends by `max_events` ends at another event if a tighter tolerance has more impacts in an accumulation before.
#[test]
fn states_of_different_events_have_no_error() {
    let scene = changed("bounce", &[]);
    let (duration, mut plan) = (5.0, scene.plan().unwrap());
    let (all, ..) = estimated(&plan, duration, None);
    let end = all.iter().position(|event| event.kind.name() == "zeno").unwrap();
    for (events, compared) in [(2, true), (end + 1, false)] {
        plan.simulation.max_events = events;
        let (_, _, _, error) = estimated(&plan, duration, None);
        assert_eq!(error.last.is_some(), compared, "{events} events: {error:?}");
        if !compared {
            assert!(error.unknown.unwrap().reason.contains("ends at another event"));
        }
    }
}

/// The true error is below the accuracy that is asked for, and a run of the scene that is returned is the run that is returned.
#[test]
fn an_accuracy_is_met_by_a_tolerance_of_its_own() {
    let mut before = f64::INFINITY;
    for accuracy in [1e-4, 1e-6, 1e-8, 1e-10] {
        let wish = on_spring(&format!("duration = 5\naccuracy = {accuracy:e}\n")).unwrap();
        let found = wish.to_accuracy().unwrap();
        let met = found.met.unwrap();
        let tolerance = found.scene.simulation.tolerance;
        assert_eq!(tolerance, met.tolerance);
        assert!(tolerance <= before, "{accuracy:e}: {tolerance:e}");
        before = tolerance;
        let (last, [q, qd]) = (&met.summary.last, exact(5.0));
        let states = [last.q[0] - q, last.qd[0] - qd];
        let times = met.events.iter().enumerate().map(|(k, event)| event.time - impact(k));
        let error = states.into_iter().chain(times).fold(0.0, |most: f64, x| most.max(x.abs()));
        assert!(error <= accuracy && met.error <= accuracy, "{accuracy:e}: {error:e}, estimated {:e}", met.error);
        let told = found.plan.kept.iter().find(|decision| decision.what == "accuracy").unwrap();
        assert!(told.why.contains(&format!("{accuracy:e}")), "{told:?}");
        assert!(!found.scene.text.contains("accuracy"), "{}", found.scene.text);
        let again = scene(&[("ball.urdf", &ball_on_slider())], &found.scene.text).unwrap();
        assert_eq!(again.simulation.tolerance, tolerance);
        let (events, _, summary, _) = estimated(&found.scene.plan().unwrap(), 5.0, None);
        assert_eq!((&summary.last.q, &summary.last.qd), (&last.q, &last.qd));
        assert!(events.iter().zip(&met.events).all(|(a, b)| a.time == b.time));
    }
}

/// After accumulations of impacts runs with other tolerances have other events, which tells nothing of the tightest one.
#[test]
fn an_accuracy_that_the_tightest_tolerance_meets_is_not_refused() {
    for name in ["catch", "four_bar"] {
        let scene = changed(name, &[]);
        let text = scene.text.replace("tolerance =", "# tolerance =").replace("[run]", "[run]\naccuracy = 1e-9");
        let found = Scene::from_toml(&text, &scene.folder).unwrap().to_accuracy().unwrap();
        let met = found.met.unwrap();
        assert!(met.error <= 1e-9 && met.tolerance >= 1e-12, "{name}: {met:?}");
        // Another run, tighter than any that may be asked for.
        let simulation = Simulation { tolerance: 1e-13, ..found.plan.simulation.clone() };
        let last = Plan { simulation, ..found.plan }.run(found.scene.duration).unwrap().summary.last;
        let apart = last.q.iter().zip(&met.summary.last.q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(apart <= 1e-9, "{name}: {apart:e}");
    }
}

#[test]
fn an_accuracy_that_is_not_met_is_refused_with_the_reason() {
    let refused = |run: &str| match on_spring(run) {
        Err(why) => why.to_string(),
        Ok(scene) => scene.to_accuracy().unwrap_err().to_string(),
    };
    let cases = [
        ("duration = 5\naccuracy = 1e-16\n", "rounding prevents"),
        ("duration = 5\naccuracy = -1\n", "accuracy = -1: it must be positive and finite"),
        ("duration = 5\naccuracy = 1e-6\ntolerance = 1e-9\n", "give one of tolerance and accuracy"),
        ("duration = 5\naccuracy = 1e-6\nmethod = \"steps\"\n", "time steps begin"),
    ];
    for (run, why) in cases {
        let refused = refused(run);
        assert!(refused.contains(why), "{refused}");
    }
    // What knows no accuracy does not ignore it.
    let scene = on_spring("duration = 5\naccuracy = 1e-6\n").unwrap();
    let refused = scene.plan().unwrap_err().to_string();
    assert!(refused.contains("accuracy = 1e-6") && refused.contains("give tolerance"), "{refused}");
    assert!(on_spring("duration = 5\n").unwrap().to_accuracy().unwrap().met.is_none());
}
