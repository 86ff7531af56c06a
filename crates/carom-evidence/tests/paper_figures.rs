//! Data of the paper's figures: simulated motion and forces against closed forms, verdicts against their numbers.

use crate::paper::{Elbow, NORMAL, Paper, TANGENT, stand_in, strike};
use carom_impact::Energetic;
use carom_sim::Impacts;
use nalgebra::Vector3;

fn paper() -> Paper {
    Paper::of(&stand_in().unwrap()).unwrap()
}

/// Figs. 4, 6, 7: a simulation over 40 ms. The jump is compared with eqs. (11) and (15), the path with the integral of the
/// velocity.
#[test]
fn the_simulated_jump_agrees_with_eqs_11_and_15() {
    let arm = stand_in().unwrap();
    for (motion, elbow) in paper().motions.iter().zip(Elbow::ALL) {
        let run = strike(&arm, elbow, 45.0, 0.2, 0.35).unwrap();
        let at = motion.states.iter().position(|s| s.time == 0.0).unwrap();
        let (before, after) = (motion.states[at], motion.states[at + 1]);
        assert_eq!(after.time, 0.0, "states before and after the impact");
        assert_eq!((motion.states.len(), motion.samples.len()), (802, 10));
        for (got, want) in [
            (before.tangential, run.tangential().0),
            (after.tangential, run.tangential().1),
            (-before.normal, run.normal().0),
            (-after.normal, run.normal().1),
        ] {
            // the ball of 1 µm at the probe touches 7 µs before its centre, at accelerations of some cm/s²
            assert!((got - want).abs() < 1e-6, "{elbow:?}: {got} against {want}");
        }
        // trapezoidal rule with steps of 50 µs, in which accelerations change little
        let (mut along, mut towards) = (motion.states[0].along, motion.states[0].towards);
        for pair in motion.states.windows(2) {
            let step = pair[1].time - pair[0].time;
            along += step * (pair[0].tangential + pair[1].tangential) / 2.0;
            towards += step * (pair[0].normal + pair[1].normal) / 2.0;
        }
        let last = motion.states.last().unwrap();
        let off = (along - last.along).abs().max((towards - last.towards).abs());
        assert!(off < 1e-9, "{elbow:?}: off by {off} m");
        assert!(motion.states.iter().all(|s| s.towards < 1e-9), "the tip does not penetrate the wall");
        let times: Vec<f64> = motion.samples.iter().map(|s| s.time * 1e3).collect();
        let clock = [-18.0, -14.0, -10.0, -6.0, -2.0, 2.0, 6.0, 10.0, 14.0, 18.0];
        assert!(times.iter().zip(clock).all(|(got, want)| (got - want).abs() < 1e-9), "{times:?}");
    }
}

/// Fig. 5: the impulse of the compliant contact is that of Stronge's law within 2 %. The difference is due to the regularised
/// friction (over 1e-3 m/s of 0.14 m/s) and to the motion of the arm during the 2 ms of contact (0.4 mm of half a metre).
#[test]
fn the_integral_of_the_contact_force_is_stronges_impulse() {
    let arm = stand_in().unwrap();
    let tip = arm.frame("tip").unwrap();
    for (forces, elbow) in paper().forces.iter().zip(Elbow::ALL) {
        let before = strike(&arm, elbow, 45.0, 0.2, 0.35).unwrap().qd_minus;
        let law = Energetic { restitution: 0.35, friction: 0.1 };
        let hit = arm.impact(&elbow.pose(), &before).at(tip).normal(NORMAL).resolve(&law).unwrap();
        let [normal, tangential] = forces.impulse();
        let (rigid_n, rigid_t) = (Vector3::from(NORMAL).dot(&hit.impulse), -Vector3::from(TANGENT).dot(&hit.impulse));
        assert!((normal / rigid_n - 1.0).abs() < 0.02, "{elbow:?}: {normal} against {rigid_n}");
        assert!((tangential - rigid_t).abs() < 0.02 * rigid_n, "{elbow:?}: {tangential} against {rigid_t}");
        assert!(forces.states.iter().all(|s| s[1] >= 0.0 && s[2].abs() <= 0.1 * s[1] * (1.0 + 1e-9)), "cone");
        let ends = [forces.states[0], *forces.states.last().unwrap()];
        assert!(ends.iter().all(|s| s[1] < 1e-3 * forces.peak()), "the force must begin and end at zero: {ends:?}");
    }
}

/// Claims are not confirmed where the mirrored poses of the stand-in give no difference, or where Table I contradicts them.
#[test]
fn verdicts_follow_from_the_numbers() {
    let paper = paper();
    let verdict = |words: &str| {
        let mut found = paper.claims.iter().filter(|claim| claim.statement.contains(words));
        let (Some(claim), None) = (found.next(), found.next()) else { panic!("'{words}' is not one claim") };
        claim.holds
    };
    for (words, holds) in [
        ("with either of Table I's coefficients", true),
        ("the sign of tᵀHn", true),
        ("loss depends on the configuration", false),
        ("impact force depends on the configuration", true),
        ("tangential impulse is small", true),
        ("measured normal velocity after the impact does not depend", false),
        ("up-elbow: eq. (11) with the energetic", false),
        ("down-elbow: eq. (11) with the energetic", false),
        ("Table I is not consistent, up-elbow", true),
        ("Table I is not consistent, down-elbow", true),
    ] {
        assert_eq!(verdict(words), holds, "{words}");
    }
    // the claim about forces, recomputed
    let [up, down] = &paper.forces;
    assert!((up.peak() - down.peak()).abs() / up.peak() > 0.05);
}
