//! The orbits of `studies/atlas`: closed forms, and energy balances that decide which laws can have an orbit.

use crate::orbits::close;
use carom_impact::LAW_NAMES;
use carom_sim::{Sampling, Scene};
use carom_study::orbit::{Problem, Stability};
use carom_testing::files::path;

/// A problem of the atlas with a part of its text replaced.
fn of_atlas(name: &str, part: &str, by: &str) -> Problem {
    let file = path(&format!("studies/atlas/{name}.toml"));
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains(part), "{part}");
    Problem::from_toml(&text.replace(part, by), file.parent().unwrap()).unwrap()
}

/// Closed form (Housner 1963): an impact of a block whose diagonal is inclined by α multiplies its rate by 1 − 3/2 sin²α, and the area
/// of phase space by the square of that. Between impacts a foot that sticks keeps the area, so that the two multipliers of an orbit of
/// two impacts, a complex pair, have this size, whatever the motion of the table.
#[test]
fn a_rocking_block_has_multipliers_of_the_size_of_housners_energy_factor() {
    let factor = (1.0 - 1.5 / 17.0_f64).powi(2); // tan α = 1/4
    for amplitude in [0.02, 0.03, 0.04] {
        let problem = of_atlas("block", "from = 0.03", &format!("from = {amplitude}"));
        let orbit = problem.find().unwrap();
        assert_eq!(orbit.events.iter().filter(|event| event.what.starts_with("several")).count(), 2);
        for multiplier in &orbit.multipliers[..2] {
            assert!(multiplier.im != 0.0, "{multiplier}");
            close("size", multiplier.norm(), factor, 1e-8);
        }
    }
}

/// A theorem: an arm with damped springs, without a drive, loses energy in each motion that is not rest, so that it repeats a motion
/// only if impacts add what damping takes. Whittaker's and Newton's laws do at this contact, the others cannot.
#[test]
fn a_damped_arm_hops_for_ever_only_under_laws_that_gain_energy() {
    for law in LAW_NAMES {
        let problem = of_atlas(
            "hopper",
            "section.contact",
            &format!("with = {{ \"contact.law\" = \"{law}\" }}\nsection.contact"),
        );
        if !["whittaker", "newton"].contains(&law) {
            problem.find().unwrap_err();
            let file = path("studies/atlas/hopper_scene.toml");
            let scene =
                std::fs::read_to_string(&file).unwrap().replace("law = \"whittaker\"", &format!("law = \"{law}\""));
            let plan = Scene::from_toml(&scene, file.parent().unwrap()).unwrap().plan().unwrap();
            let end = plan.stream(60.0, Sampling::default(), &mut |_| {}).unwrap().last;
            let moving = end.qd.iter().fold(0.0_f64, |most, rate| most.max(rate.abs()));
            assert!(moving < 1e-9, "{law}: {moving} rad/s after a minute");
            continue;
        }
        let orbit = problem.find().unwrap();
        assert_eq!(orbit.stability, Stability::Stable);
        // The section is the impact at the end of the period.
        let plan = problem.plan_of(&orbit).unwrap();
        let books = plan.stream(orbit.period * (1.0 + 1e-9), Sampling::default(), &mut |_| {}).unwrap().energy;
        close("impacts add, J", -books.impacts, 0.76, 0.005);
        close("the motors take what impacts add", books.drive, books.impacts, 1e-7);
        // A second route: the scene itself, without Newton's method.
        let start = carom_study::orbit::State { q: vec![0.54, -0.2], qd: vec![2.2, -4.3] };
        let last = problem.cycle(0.3, start).unwrap().nth(60).unwrap().unwrap();
        for (found, expected) in last.qd.iter().zip(&orbit.start.qd) {
            close("rate", *found, *expected, 1e-8);
        }
    }
}

/// A second route to the flip: cycles settle with one passage above it, with two below.
#[test]
fn the_hopping_arm_doubles_its_period_and_begins_in_a_fold() {
    let special = |from: &str, to: &str| of_atlas("hopper", from, to).branch().unwrap().special;
    let [flip] = &special("", "")[..] else { panic!("one special point") };
    assert_eq!(flip.kind, "flip");
    close("flip", flip.parameter, 0.1956023, 1e-6);
    let problem = of_atlas("hopper", "", "");
    for (damping, passages) in [(flip.parameter + 0.005, 1), (flip.parameter - 0.005, 2)] {
        let start = carom_study::orbit::State { q: vec![0.54, -0.2], qd: vec![2.2, -4.3] };
        let rates: Vec<f64> =
            problem.cycle(damping, start).unwrap().skip(900).take(3).map(|it| it.unwrap().qd[0]).collect();
        close("two passages", rates[2], rates[0], 1e-6);
        assert_eq!((rates[1] - rates[0]).abs() < 1e-6, passages == 1, "{rates:?}");
    }
    let [fold] = &special("to = 0.15", "to = 0.6")[..] else { panic!("one special point") };
    assert_eq!(fold.kind, "fold");
    close("fold", fold.parameter, 0.3119799, 1e-6);
}
