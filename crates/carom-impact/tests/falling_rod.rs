//! A free uniform rod, m = L = 1, at an angle θ from the horizontal, strikes with its lower end: the standard example
//! of jamming. Painlevé's threshold has its minimum 4/3 at tan θ = 2.

use crate::common::{close, resolve};
use carom_impact::{Flags, ImpactProblem};
use nalgebra::{Matrix2, matrix, vector};

fn rod(degrees: f64) -> Matrix2<f64> {
    let (s, c) = degrees.to_radians().sin_cos();
    matrix![1.0 + 3.0 * s * s, -3.0 * s * c; -3.0 * s * c, 1.0 + 3.0 * c * c]
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
fn grazing_begins_at_a_billionth_of_the_speed() {
    for (v_n, grazes) in [(-1.1e-9, false), (-0.9e-9, true)] {
        let hit = resolve("poisson", rod(45.0), vector![1.0, v_n], [0.5, 0.1]);
        assert_eq!(hit.flags.contains(Flags::GRAZING), grazes);
    }
}
