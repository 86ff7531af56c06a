//! Whittaker's law in the plane against its definition, case by case.

use crate::common::{Case, any_case};
use carom_impact::{Flags, Law, Mode, Whittaker};
use nalgebra::{Vector2, vector};

/// Every admissible impulse, in the order stick, slip +1, slip -1, with the margin by which the case is admissible: on
/// the boundary of two cases, rounding decides.
fn admissible(case: &Case<2>) -> Vec<(Mode, Vector2<f64>, f64)> {
    let (h, mu) = (case.delassus, case.friction);
    let gain = -(1.0 + case.restitution) * case.u[1];
    let mut found = Vec::new();
    if let Some(p) = h.lu().solve(&vector![-case.u[0], gain]) {
        found.push((Mode::Stick, p, mu * p[1] - p[0].abs()));
    }
    for sigma in [1.0, -1.0] {
        let p_n = gain / (h[(1, 1)] - sigma * mu * h[(0, 1)]);
        let p = vector![-sigma * mu * p_n, p_n];
        let margin = if p_n > 0.0 { sigma * (case.u + h * p)[0] } else { -1.0 };
        found.push((Mode::Slip, p, margin));
    }
    found
}

#[test]
fn exactly_one_case_is_admissible_and_it_is_the_outcome() {
    let mut rng = fastrand::Rng::with_seed(11);
    let (mut checked, mut modes) = (0, [0; 3]);
    for k in 0..100_000 {
        let mut case = any_case(&mut rng, 0.1);
        if k % 20 == 0 {
            case.u = vector![0.0, -1.0];
        }
        let cases = admissible(&case);
        // Within 1e-9 of a boundary (or without friction, where stick and slip coincide) rounding decides.
        if cases.iter().any(|(_, _, margin)| margin.abs() < 1e-9) {
            continue;
        }
        let admitted: Vec<_> = cases.into_iter().filter(|(_, _, margin)| *margin > 0.0).collect();
        assert_eq!(admitted.len(), 1, "existence and uniqueness: {case:?}");

        let hit = Whittaker { restitution: case.restitution, friction: case.friction };
        let hit = hit.resolve(&case.problem()).unwrap();
        let (mode, p, _) = admitted[0];
        assert_eq!(hit.mode == Mode::Stick, mode == Mode::Stick, "{case:?}");
        assert!((hit.impulse - p).norm() <= 1e-12 * p.norm(), "{case:?} {hit:?} {p:?}");
        assert!(!hit.flags.contains(Flags::NON_UNIQUE));
        modes[match hit.mode {
            Mode::Stick => 0,
            Mode::Slip => 1,
            Mode::ReverseSlip => 2,
            Mode::Open => unreachable!(),
        }] += 1;
        checked += 1;
    }
    assert!(checked > 60_000 && modes.iter().all(|&n| n > 1000), "{checked}, {modes:?}");
}
