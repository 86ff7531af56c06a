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

/// Numbers and what they should be.
#[track_caller]
fn each(what: &str, pairs: impl IntoIterator<Item = (f64, f64)>, tolerance: f64) {
    for (found, expected) in pairs {
        close(what, found, expected, tolerance);
    }
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

/// External truth: the walker with knees by a program of its own (Lagrange's equations by hand with the stance foot as a hinge, 80-bit
/// numbers, an integrator of order 8), whose impacts are complementary in feet and knees. The stance knee has no latch: the force of the floor
/// passes in front of it. Its multipliers are eigenvalues of a matrix far from normal, which have an error of 2e-8.
#[test]
fn a_walker_with_knees_has_the_orbit_of_its_own_equations() {
    let orbit = of_atlas("kneed", "", "").find().unwrap();
    close("period", orbit.period, 0.577703003961040, 1e-10);
    let [q, qd] = [&orbit.start.q, &orbit.start.qd];
    let states = [
        (q[1], 0.963578072405107),
        (q[2], -0.217188390496004),
        (q[4], 0.337044700738419),
        (qd[0], 1.071693833772834),
        (qd[1], 0.304827260769175),
        (qd[2], 1.112202388642851),
        (qd[4], -0.962724768551528),
        (qd[5], 7.961_587_479_002_11),
    ];
    each("state", states, 2e-11);
    let multipliers = [-0.573893931270, 0.325293476144, -0.047601723848];
    each("multiplier", orbit.multipliers.iter().map(|it| it.re).zip(multipliers), 5e-8);
    assert_eq!(orbit.lasting().len(), 3);
    // One knee strikes in the step, and the other one opens at its end only.
    let times = |what: &str| -> Vec<f64> {
        orbit.events.iter().filter(|event| event.what.starts_with(what)).map(|event| event.time).collect()
    };
    close("knee strike", times("several lower limit of right_knee")[0], 0.347863539302, 1e-10);
    let [opens] = times("lift-off lower limit of left_knee")[..] else { panic!("{:?}", orbit.events) };
    close("the stance knee opens", opens, orbit.period, 1e-10);
}

/// The same program: the gait doubles at this slope. Far beyond it there is another gait at the same slope, to which the branch must not
/// jump where its own gait ends.
#[test]
fn the_branch_of_the_walker_with_knees_doubles_and_does_not_jump() {
    let branch = of_atlas("kneed", "from = 0.05\nto = 0.08", "from = 0.074\nto = 0.076").branch().unwrap();
    let [flip] = &branch.special[..] else { panic!("one special point: {:?}", branch.special) };
    assert_eq!((flip.kind, branch.ended), ("flip", "range"));
    close("flip", flip.parameter, 0.075098002415, 1e-8);
    let file = path("studies/atlas/kneed.toml");
    let text = std::fs::read_to_string(&file).unwrap().replace("from = 0.05\nto = 0.08", "from = 0.192\nto = 0.2");
    // Where the foot strikes alone it slips, and the gait ends with this.
    let with = "with = { \"contact.law\" = \"frictionless\", \"robot.q\" = [0, 0.9073453371306647, -0.3778011416095985, 0, 0.4976574518520144, 0], \
         \"robot.qd\" = [1.220639063502214, 0.5712706969835865, 1.3452860929029415, 0, -5.311508774078992, 25.973372045018376] }\n";
    let branch = Problem::from_toml(&format!("{with}{text}"), file.parent().unwrap()).unwrap().branch().unwrap();
    assert!(branch.ended != "range", "{}", branch.end);
    let last = branch.points.last().unwrap();
    assert!((0.1945..0.19475).contains(&last.parameter), "{} {}", last.parameter, branch.end);
    for pair in branch.points.windows(2) {
        let jump = (pair[1].orbit.start.qd[5] - pair[0].orbit.start.qd[5]).abs();
        assert!(jump < 0.2, "{} {}: {jump}", pair[0].parameter, pair[1].parameter);
    }
}

/// External truth: the three-link biped of Grizzle, Abba & Plestan (2001) by a program of its own (stance foot as a hinge, plastic impact that
/// sticks, feedback of torso and swing leg; DOP853 with 2e-14), on level ground and on slopes.
#[test]
fn a_biped_under_feedback_has_the_orbit_of_its_own_equations() {
    let problem = of_atlas("biped", "", "");
    let orbit = problem.find().unwrap();
    close("period", orbit.period, 0.459205655922, 1e-10);
    let [q, qd] = [&orbit.start.q, &orbit.start.qd];
    let states = [
        (q[2], 0.322296101666),
        (q[3], -0.265641938167),
        (q[4], 0.265641938167),
        (qd[2], 1.035843967062),
        (qd[3], 1.110140658185),
        (qd[4], 0.388525199103),
    ];
    each("state", states, 1e-10);
    let multipliers = [0.586548636, -0.291287107, 0.0136190946, -0.00682347683, 2.48026e-5];
    each("multiplier", orbit.multipliers.iter().map(|it| it.re).zip(multipliers), 2e-8);
    let branch = problem.branch().unwrap();
    assert_eq!((branch.ended, branch.special.len()), ("range", 0));
    let last = &branch.points.last().unwrap().orbit;
    close("period on 4 degrees", last.period, 0.380798375982, 1e-9);
    close("multiplier on 4 degrees", last.multipliers[0].re, 0.499328, 1e-6);
    // A second route: steps.
    let start = carom_study::orbit::State { q: q.clone(), qd: qd.iter().map(|rate| 1.02 * rate).collect() };
    let end = problem.cycle(0.0, start).unwrap().nth(50).unwrap().unwrap();
    each("rate after 50 steps", end.qd.into_iter().zip(qd.iter().copied()), 1e-9);
}

/// External truth: a ball on the racket of an arm, by a program of its own, which has M and the bias of the arm by hand and Newton's law.
#[test]
fn a_juggling_arm_has_the_orbit_of_its_own_equations() {
    let problem = of_atlas("juggler", "section.period", "with = { \"contact.law\" = \"newton\" }\nsection.period");
    let orbit = problem.find().unwrap();
    let states = [0.817981022427, -1.433825362047, 0.615844345480, 0.450000043672, 0.535322668671];
    each("state", orbit.start.q.iter().copied().zip(states), 1e-10);
    let rates = [1.609668544073, 0.423411696033, -2.033080457283, 0.0, 0.140833230294, -6.610750437319];
    each("rate", orbit.start.qd.iter().copied().zip(rates), 1e-9);
    let pairs = [(0.738018585, 0.277579133), (-0.078852634, 0.587494110)];
    for (found, (re, im)) in orbit.multipliers.iter().step_by(2).zip(pairs) {
        close("multiplier", found.re, re, 2e-8);
        close("multiplier", found.im, im, 2e-8);
    }
    assert!(orbit.events.iter().any(|event| (event.time - 0.314356088715).abs() < 1e-9));
}

/// Closed form: the product of the multipliers of a ball on a shaken table is e². At a coefficient of restitution of 1, and at a friction of 0,
/// no differences can be taken beyond the end of the range.
#[test]
fn branches_reach_the_ends_of_admissible_ranges() {
    let text = "scene = \"ball_scene.toml\"\nsection.period = 0.1\nwith = { \"surface[0].motion.amplitude[2]\" = 0.0015 }\n\
                [vary]\nparameter = \"contact.restitution\"\nfrom = 0.7\nto = 1\n";
    let branch = Problem::from_toml(text, path("studies/atlas")).unwrap().branch().unwrap();
    assert_eq!((branch.ended, branch.points.last().unwrap().parameter), ("range", 1.0), "{}", branch.end);
    for point in &branch.points {
        let product: f64 = point.orbit.multipliers.iter().map(|x| x.norm()).product();
        close("product", product, point.parameter.powi(2), 1e-7);
    }
    let file = path("studies/atlas/hammer2.toml");
    let text =
        std::fs::read_to_string(&file).unwrap() + "[vary]\nparameter = \"contact.friction\"\nfrom = 0\nto = 0.02\n";
    let branch = Problem::from_toml(&text, file.parent().unwrap()).unwrap().branch().unwrap();
    assert_eq!((branch.ended, branch.points[0].parameter), ("range", 0.0), "{}", branch.end);
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
        each("rate", last.qd.into_iter().zip(orbit.start.qd), 1e-8);
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
