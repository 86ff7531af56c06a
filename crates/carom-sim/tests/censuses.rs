//! Censuses in small; `cargo run --release -p carom-sim --example census -- NAME` runs them in large.

use std::path::Path;

/// The scenes of the first bad answer are written into a folder for its reader.
fn holds(name: &str) {
    let census = crate::census::CENSUSES.iter().find(|census| census.name == name).expect("a census of this name");
    let (text, right, bad) = crate::census::report(census, 0..census.few);
    println!("{text}");
    // A census in which most scenes are refused, or have nothing to be compared with, shows nothing.
    assert!(right >= census.least, "{right} right answers, at least {} are due: {text}", census.least);
    let Some(&seed) = bad.first() else { return };
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("census-{name}-{seed}"));
    for (number, case) in (census.cases)(seed).iter().enumerate() {
        case.write(&folder.join(number.to_string())).expect("a folder for the scenes");
    }
    panic!("{text}\nthe scenes of seed {seed} are in {}; the example runs {} seeds", folder.display(), census.many);
}

#[test]
fn a_floor_that_no_joint_approaches_changes_no_motion() {
    holds("immobile");
}

/// Of points that few joints move: the equations of an impact hold under every law, and what no joint moves is refused.
#[test]
fn a_blow_pays_its_energy_or_is_refused() {
    holds("blows");
}

#[test]
fn energies_of_random_scenes_are_balanced() {
    holds("energy");
}

#[test]
fn a_frame_that_its_loops_lock_is_rigid() {
    holds("locked");
}

#[test]
fn wishes_are_fulfilled_refused_or_warned_of() {
    holds("wishes");
}

#[test]
fn large_ratios_and_many_bodies_end_in_time() {
    holds("extremes");
}

#[test]
fn methods_agree_on_random_scenes() {
    holds("agreement");
}

/// A ball beside another robot slides, comes to rest within microseconds, and slides on in another direction: the place of the floor moves its
/// slip by more than what is left of it.
#[test]
fn derivatives_of_slip_that_stops_and_begins_again_are_differences() {
    let census =
        crate::census::CENSUSES.iter().find(|census| census.name == "gradients").expect("a census of this name");
    let verdict = (census.judge)(7447);
    assert_eq!((verdict.bad, verdict.class.as_str()), (false, "agrees, through impacts"), "{}", verdict.note);
}

#[test]
fn derivatives_of_random_runs_are_differences_or_told_to_be_missing() {
    holds("gradients");
}

#[test]
fn errors_of_random_runs_are_at_most_ten_times_their_estimates() {
    holds("errors");
}

#[test]
fn accuracies_of_random_runs_are_met_or_refused() {
    holds("accuracy");
}
