//! Periodic orbits of a ball on a shaken table: closed forms of fold and flip, sections by a period, orbits of twice the period, and iteration
//! as a second route.

use crate::orbits::{Case, close, foot, joint, mass, only, problem};
use carom_study::orbit::{OrbitError, Stability};
use std::f64::consts::{PI, TAU};

/// A ball of restitution e on a table that moves as A sin ωt, one bounce in each period; Γ = A ω²/g.
pub fn shaken(e: f64, from: f64, to: f64, passages: usize) -> Result<Case, OrbitError> {
    shaken_from(e, PI, [from, to], passages)
}

/// The same with the table at this phase at the start.
fn shaken_from(e: f64, at: f64, [from, to]: [f64; 2], passages: usize) -> Result<Case, OrbitError> {
    let set = format!("\"surface[0].motion.amplitude[2]\" = \"{}*gamma\"", 9.81 / (20.0 * PI).powi(2));
    let vary = format!("{{ parameter = \"gamma\", from = {from}, to = {to}, set = {{ {set} }} }}");
    shaken_over(e, (from, at), &format!("section.period = 0.1\norbit.passages = {passages}\nvary = {vary}"))
}

/// The same at 10 Hz and Γ, with the table at this phase at the start, and with these keys of the problem.
fn shaken_over(e: f64, (gamma, at): (f64, f64), keys: &str) -> Result<Case, OrbitError> {
    let (g, omega) = (9.81, 20.0 * PI);
    let period = TAU / omega;
    let amplitude = gamma * g / (omega * omega);
    // The ball leaves with g T/2 where the table rises with (1 − e)/(1 + e) g T/2.
    let phase = (0.5 * g * period * (1.0 - e) / (1.0 + e) / (amplitude * omega)).acos();
    // Time since the last impact; at phase π the table strikes the ball in the second half of a period.
    let since = (at - phase).rem_euclid(TAU) / omega;
    let (z, v) =
        (amplitude * phase.sin() + 0.5 * g * period * since - 0.5 * g * since * since, 0.5 * g * period - g * since);
    let urdf = String::from(r#"<robot name="juggled"><link name="ground"/>"#)
        + &mass("ball", 1.0, 0.0, 0.1).replace("FEET", &foot([0.0; 3]))
        + &joint("z", "prismatic", ["ground", "ball"], "0 0 1")
        + "</robot>";
    let scene = format!(
        r#"
[robot]
urdf = "robot.urdf"
tip = "ball"
q = [{z}]
qd = [{v}]
[[surface]]
name = "table"
shape = {{ halfspace = {{ point = [0, 0, 0], normal = [0, 0, 1] }} }}
motion = {{ amplitude = [0, 0, {amplitude}], frequency = 10, phase = {at} }}
[contact]
law = "newton"
restitution = {e}
[run]
duration = 1
gravity = [0, 0, -{g}]"#
    );
    problem(&urdf, &scene, keys)
}

/// Γ at which the orbit begins in a fold, and at which its period doubles.
pub fn fold_and_flip(e: f64) -> [f64; 2] {
    let fold = PI * (1.0 - e) / (1.0 + e);
    [fold, (2.0 * (1.0 + e * e) / (1.0 + e).powi(2)).hypot(fold)]
}

/// Closed forms: the period doubles at Γ² = (2(1+e²)/(1+e)²)² + (π(1−e)/(1+e))², the orbit begins in a fold at Γ = π(1−e)/(1+e), and its
/// multipliers have the product e².
#[test]
fn a_ball_on_a_shaken_table_has_the_closed_form_fold_and_flip() {
    for e in [0.5_f64, 0.8] {
        let [fold, flip] = fold_and_flip(e);
        let start = 0.6 * fold + 0.4 * flip;
        let up = shaken(e, start, 1.05 * flip, 1).unwrap().branch().unwrap();
        let product: f64 = up.points[0].orbit.multipliers.iter().map(|x| x.norm()).product();
        close("product", product, e * e, 1e-9);
        close("flip", only(&up, "flip"), flip, 1e-8);
        let down = shaken(e, start, 0.5 * fold, 1).unwrap().branch().unwrap();
        close("fold", only(&down, "fold"), fold, 1e-8);
    }
}

/// Over the frequency, which the period of the section follows, the amplitude is the same, and Γ its square: the flip of the closed form above.
#[test]
fn the_period_of_a_section_follows_the_frequency_of_a_table() {
    let (e, gamma) = (0.5_f64, 1.3);
    let [_, flip] = fold_and_flip(e);
    let keys = |set: &str| {
        let set = format!("set = {{ \"surface[0].motion.frequency\" = \"f\", \"section.period\" = \"{set}\" }}");
        format!("section.period = 0.1\nvary = {{ parameter = \"f\", from = 10, to = 11, {set} }}")
    };
    let branch = shaken_over(e, (gamma, PI), &keys("1/f")).unwrap().branch().unwrap();
    let found: Vec<(&str, f64)> = branch.special.iter().map(|it| (it.kind, it.parameter)).collect();
    assert!(matches!(found[..], [("flip", _)]), "{found:?} {}", branch.end);
    close("flip", found[0].1, 10.0 * (flip / gamma).sqrt(), 1e-8);
    // The derivative by the parameter is right: corrections are few. The end of the range is found from farther away.
    let steps: Vec<usize> = branch.points.iter().rev().skip(1).map(|point| point.orbit.iterations).collect();
    assert!(steps.iter().all(|steps| *steps <= 4), "{steps:?}");
    let told = [
        ("f - 10", "section.period\" is 0: it must be positive"),
        ("g", "has the variable 'g'"),
        (
            "1.1/f",
            "table moves with 10 Hz, 1.100000 times in it, and no motion returns. Give a whole number of its periods, as 0.1;",
        ),
    ];
    for (set, told) in told {
        let error = shaken_over(e, (gamma, PI), &keys(set)).err().map(|e| e.to_string()).unwrap_or_default();
        assert!(error.contains(told), "{set}: {error}");
    }
    let same = "section.period = 0.1\nvary = { parameter = \"surface[0].motion.frequency\", from = 10, to = 11 }";
    let error = shaken_over(e, (gamma, PI), same).err().map(|e| e.to_string()).unwrap_or_default();
    let ended = "surface table moves with 11 Hz, 1.100000 times in it, and no motion returns. Give a whole number of its periods, as \
                 0.09090909090909091; where [vary] changes the frequency, give set.\"section.period\" there";
    assert!(error.contains("<problem>: [section] period = 0.1: ") && error.ends_with(ended), "{error}");
}

/// The table strikes at the phase φ with cos φ = π (1 − e)/((1 + e) Γ): where that is its phase at the section, from both sides, the section
/// moves, and the branch goes on as one whose section is elsewhere.
#[test]
fn a_section_by_a_period_moves_away_from_an_impact() {
    let (e, there) = (0.5_f64, 1.2);
    let at = (PI * (1.0 - e) / (1.0 + e) / there).acos();
    for (from, to) in [(1.4, 1.1), (1.1, 1.4)] {
        let branch = shaken_from(e, at, [from, to], 1).unwrap().branch().unwrap();
        assert_eq!(branch.ended, "range", "{}", branch.end);
        let [moved] = branch.special.as_slice() else { panic!("{:?}", branch.special) };
        assert_eq!(moved.kind, "section", "{}", moved.what);
        assert!(moved.what.contains("(impact ball on table"), "{}", moved.what);
        // A thousandth of the period is a phase of 6.3e-3, and dφ/dΓ = 1.49 there.
        close("Γ", moved.parameter, there, 5e-3);
        let last = branch.points.last().unwrap();
        let time = last.orbit.start_time;
        let other = shaken_from(e, at + 20.0 * PI * time, [to, from], 1).unwrap().find().unwrap();
        close("position", last.orbit.start.q[0], other.start.q[0], 1e-10);
        close("velocity", last.orbit.start.qd[0], other.start.qd[0], 1e-9);
        close("multiplier", last.orbit.multipliers[0].re, other.multipliers[0].re, 1e-8);
        assert!(time > 0.0 && branch.points[0].orbit.start_time == 0.0, "{time}");
    }
}

/// Over the frequency Γ = A ω²/g changes, and the moved section moves with the period: Newton's method stays quadratic.
#[test]
fn a_moved_section_follows_the_frequency() {
    let (e, there) = (0.5_f64, 1.2);
    let at = (PI * (1.0 - e) / (1.0 + e) / there).acos();
    let keys = "section.period = 0.1\nvary = { parameter = \"f\", from = 10, to = 13, \
                set = { \"section.period\" = \"1/f\", \"surface[0].motion.frequency\" = \"f\" } }";
    let problem = shaken_over(e, (1.1, at), keys).unwrap();
    let branch = problem.branch().unwrap();
    assert_eq!(branch.ended, "range", "{}", branch.end);
    let [moved, flip] = branch.special.as_slice() else { panic!("{:?}", branch.special) };
    assert_eq!((moved.kind, flip.kind), ("section", "flip"));
    close("Γ of the flip", 1.1 * (flip.parameter / 10.0).powi(2), fold_and_flip(e)[1], 1e-8);
    for point in &branch.points[moved.after..] {
        close("phase of the section", (point.orbit.start_time * point.parameter).fract(), 0.5, 1e-6);
        assert!(point.orbit.iterations <= 4, "{} at {}", point.orbit.iterations, point.parameter);
    }
    // The orbits of twice the period have the section where it is at the flip.
    let (_, doubled) = problem.doubled(&branch).unwrap();
    let first = &doubled.points[1].orbit;
    assert_eq!((doubled.passages, first.events.len()), (2, 2));
    close("phase of the section", (first.start_time * doubled.points[1].parameter).fract(), 0.5, 1e-6);
}

/// A second route: iteration of the map converges to the orbit where it is stable, and leaves it where it is not.
#[test]
fn iteration_converges_to_stable_orbits_and_leaves_unstable_ones() {
    let e = 0.5;
    let [_, flip] = fold_and_flip(e);
    for (gamma, stability) in [(0.9 * flip, Stability::Stable), (1.02 * flip, Stability::Unstable)] {
        let problem = shaken(e, gamma, 2.0 * gamma, 1).unwrap();
        let orbit = problem.find().unwrap();
        assert_eq!(orbit.stability, stability, "{:?}", orbit.multipliers);
        // One step multiplies a change by DP.
        let mut start = orbit.start.clone();
        start.qd[0] += 1e-6;
        let disturbed = problem.cycle(gamma, start).unwrap().next().unwrap().unwrap();
        for k in 0..2 {
            let found = if k == 0 { disturbed.q[0] - orbit.start.q[0] } else { disturbed.qd[0] - orbit.start.qd[0] };
            close("DP", found / 1e-6, orbit.map[(k, 1)], 1e-4 * orbit.map[(1, 1)].abs());
        }
        let mut start = orbit.start.clone();
        start.qd[0] += 1e-4;
        let last = problem.cycle(gamma, start).unwrap().nth(400).unwrap().unwrap();
        let far = (last.qd[0] - orbit.start.qd[0]).abs();
        match stability {
            Stability::Stable => assert!(far < 1e-9, "{far}"),
            _ => assert!(far > 1e-3, "{far}"),
        }
    }
    // Above the flip the orbit of twice the period is stable, and iteration reaches it.
    let problem = shaken(e, 1.02 * flip, 2.0 * flip, 2).unwrap();
    let mut start = problem.find().unwrap().start;
    start.qd[0] += 1e-2;
    let far = problem.cycle(1.02 * flip, start).unwrap().nth(300).unwrap().unwrap();
    let next = problem.cycle(1.02 * flip, far.clone()).unwrap().next().unwrap().unwrap();
    close("twice the period", next.qd[0], far.qd[0], 1e-9);
}

/// Closed form: each impact multiplies the area of phase space by e², so that the multipliers of an orbit of two impacts have the product
/// e⁴. A second route: cycles beside the doubled orbit converge to it where it is stable, and the two states are its two passages.
#[test]
fn at_a_flip_a_branch_of_twice_the_period_begins_to_which_cycles_converge() {
    let e = 0.5_f64;
    let [_, flip] = fold_and_flip(e);
    let to = 1.04 * flip;
    let problem = shaken(e, 0.95 * flip, to, 1).unwrap();
    let branch = problem.branch().unwrap();
    let (again, doubled) = problem.doubled(&branch).unwrap();
    assert_eq!((branch.passages, doubled.passages, doubled.ended), (1, 2, "range"), "{}", doubled.end);
    close("begins at the flip", doubled.points[0].parameter, flip, 1e-8);
    let last = doubled.points.last().unwrap();
    assert_eq!((last.parameter, last.orbit.stability), (to, Stability::Stable));
    for point in &doubled.points {
        let product: f64 = point.orbit.multipliers.iter().map(|x| x.norm()).product();
        close("product", product, e.powi(4), 1e-8);
    }
    let near = |from: f64| {
        let mut start = last.orbit.start.clone();
        start.qd[0] += from;
        problem.cycle(to, start).unwrap().nth(399).unwrap().unwrap()
    };
    let far = near(1e-3);
    close("position", far.q[0], last.orbit.start.q[0], 1e-9);
    close("velocity", far.qd[0], last.orbit.start.qd[0], 1e-9);
    let other = problem.cycle(to, far).unwrap().next().unwrap().unwrap();
    assert!((other.qd[0] - last.orbit.start.qd[0]).abs() > 1e-3, "the two passages differ");
    // The doubled branch has no flip in this range.
    let error = again.doubled(&doubled).err().unwrap().to_string();
    assert!(error.contains("the branch of 2 passages has no flip"), "{error}");
}

/// Over two periods a flip of the map is a multiplier that passes +1 while the branch goes on: where the branch of twice the period
/// crosses it. An elastic ball has the product 1 of its multipliers everywhere: its pairs stay on the unit circle.
#[test]
fn a_flip_is_a_branch_point_over_two_periods_and_elastic_pairs_pass_nothing() {
    for e in [0.5_f64, 0.8] {
        let [fold, flip] = fold_and_flip(e);
        let twice = shaken(e, 0.6 * fold + 0.4 * flip, 1.05 * flip, 2).unwrap().branch().unwrap();
        let kinds: Vec<_> = twice.special.iter().map(|it| it.kind).collect();
        assert_eq!(kinds, ["branch-point"], "{:?}", twice.special);
        // Near it the equations of the orbit are nearly singular: orbits have the square root of the error of the map.
        close("branch point", twice.special[0].parameter, flip, 1e-5);
    }
    let elastic = shaken(1.0, 0.4, 0.99, 1).unwrap().branch().unwrap();
    assert!(elastic.points.len() > 10 && elastic.special.is_empty(), "{:?}", elastic.special);
}

/// Period doubling in a cascade (Feigenbaum 1978): each branch has twice the period of the one before, not an orbit of it run twice, its points
/// are within the range of the parameter, and each begins beyond the one before.
#[test]
fn branches_of_a_cascade_of_doublings_have_their_own_periods_within_the_range() {
    let to = 1.7055;
    let problem = shaken(0.5, 1.5, to, 1).unwrap();
    let (first, all, why) = problem.branches(5).unwrap();
    assert!(all.len() >= 4, "{} branches: {why:?}", all.len());
    let mut begins = first.points[0].parameter;
    for branch in &all {
        assert!(branch.points[0].parameter > begins, "{} after {begins}", branch.points[0].parameter);
        begins = branch.points[0].parameter;
        for point in &branch.points[1..] {
            assert!((1.5..=to).contains(&point.parameter), "{} passages at {}", branch.passages, point.parameter);
            let mut cycle = problem.cycle(point.parameter, point.orbit.start.clone()).unwrap();
            let half = cycle.nth(branch.passages / 2 - 1).unwrap().unwrap();
            let apart = (half.qd[0] - point.orbit.start.qd[0]).abs();
            assert!(apart > 1e-6, "{} passages at {}: {apart:e}", branch.passages, point.parameter);
        }
    }
}
