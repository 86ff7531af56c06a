//! A free uniform rod, m = L = 1, at an angle θ from the horizontal, strikes with its lower end: the standard example
//! of jamming. Painlevé's threshold has its minimum 4/3 at tan θ = 2.

use crate::common::{close, resolve};
use carom_impact::{Flags, ImpactOutcome, ImpactProblem, LAW_NAMES, Mode, Phase};
use nalgebra::{Matrix2, Vector2, matrix, vector};

fn rod(degrees: f64) -> Matrix2<f64> {
    let (s, c) = degrees.to_radians().sin_cos();
    matrix![1.0 + 3.0 * s * s, -3.0 * s * c; -3.0 * s * c, 1.0 + 3.0 * c * c]
}

fn strike(law: &str, degrees: f64, u: Vector2<f64>, e: f64, mu: f64) -> ImpactOutcome<f64, 2> {
    resolve(law, rod(degrees), u, [e, mu])
}

#[test]
fn stick_and_jam_thresholds_have_their_published_values() {
    for (degrees, jam, stick) in
        [(30.0, 2.50185, 0.74231), (45.0, 1.66667, 0.6), (60.0, 1.34715, 0.39970), (75.0, 1.60128, 0.19742)]
    {
        let problem = ImpactProblem::new(rod(degrees), vector![0.0, -1.0]).unwrap();
        close("mu_jam", problem.mu_jam().unwrap(), jam, 5e-6);
        close("mu_stick", problem.mu_stick(), stick, 5e-6);
    }
}

#[test]
fn least_friction_that_jams_is_four_thirds_at_slope_two() {
    let jam = |degrees: f64| ImpactProblem::new(rod(degrees), vector![0.0, -1.0]).unwrap().mu_jam().unwrap();
    let steepest = 2.0_f64.atan().to_degrees();
    close("at tan θ = 2", jam(steepest), 4.0 / 3.0, 1e-15);
    for step in [1e-3, 1e-2, 1.0] {
        assert!(jam(steepest - step) > 4.0 / 3.0 && jam(steepest + step) > 4.0 / 3.0);
    }
}

#[test]
fn dropped_vertically_all_coefficients_coincide() {
    for law in ["newton", "poisson", "energetic", "whittaker"] {
        let slips = strike(law, 45.0, vector![0.0, -1.0], 0.5, 0.1);
        close(law, slips.u_plus[0], -0.79787, 5e-6);
        close(law, slips.u_plus[1], 0.5, 1e-15);
        close(law, slips.energy_ratio(), 0.40788, 5e-6);
        assert_eq!(slips.mode, Mode::Slip, "{law}: slip starts from rest and keeps its direction");

        let sticks = strike(law, 45.0, vector![0.0, -1.0], 0.5, 0.6);
        assert_eq!(sticks.u_plus[0], 0.0);
        close(law, sticks.u_plus[1], 0.5, 1e-15);
        close(law, sticks.energy_ratio(), 0.25, 1e-15);
        assert_eq!((sticks.mode, sticks.slip_end), (Mode::Stick, None), "{law}");
    }
}

#[test]
fn in_an_oblique_impact_the_coefficients_differ() {
    for (law, v_n) in [("newton", 0.5), ("poisson", 0.305882), ("energetic", 0.356453)] {
        let hit = strike(law, 45.0, vector![1.0, -1.0], 0.5, 0.6);
        assert_eq!(hit.u_plus[0], 0.0);
        close(law, hit.u_plus[1], v_n, 5e-7);
        assert_eq!((hit.mode, hit.slip_end), (Mode::Stick, Some(Phase::Restitution)));
    }
}

/// Sliding at `v_n = 0` with friction beyond the threshold: no impulse and a finite impulse are both solutions. The
/// outcome is the zero impulse, flagged as not unique.
#[test]
fn impact_without_collision_is_flagged() {
    let jams = Flags::NO_APPROACH | Flags::JAM | Flags::NON_UNIQUE;
    for law in LAW_NAMES {
        let hit = strike(law, 60.0, vector![-1.0, 0.0], 0.5, 1.5);
        assert_eq!(hit.flags, if law == "frictionless" { Flags::NO_APPROACH } else { jams }, "{law}");
        assert_eq!((hit.mode, hit.u_plus), (Mode::Open, hit.u_minus));
        assert_eq!(hit.impulse, Vector2::zeros());

        // Less friction, the other direction, or separation: an ordinary contact that does not approach.
        for (u, mu) in [(vector![-1.0, 0.0], 1.3), (vector![1.0, 0.0], 1.5), (vector![-1.0, 0.1], 1.5)] {
            assert_eq!(strike(law, 60.0, u, 0.5, mu).flags, Flags::NO_APPROACH, "{law}");
        }
    }
}

/// The impact map is discontinuous there: as the approach velocity tends to 0, the impulse does not.
#[test]
fn jamming_impulse_does_not_vanish_with_the_approach() {
    let limit = strike("energetic", 60.0, vector![-1.0, -1e-12], 0.5, 1.5);
    assert_eq!(limit.flags, Flags::JAM | Flags::GRAZING);
    assert!(limit.impulse[1] > 0.3 && limit.u_plus[1] > 0.05, "{limit:?}");
    assert_eq!(limit.mode, Mode::Stick);
}

#[test]
fn grazing_begins_at_a_billionth_of_the_speed() {
    for (v_n, grazes) in [(-1.1e-9, false), (-0.9e-9, true)] {
        let hit = strike("poisson", 45.0, vector![1.0, v_n], 0.5, 0.1);
        assert_eq!(hit.flags.contains(Flags::GRAZING), grazes);
    }
}
