//! Bands over ranges of the coefficients: exact bands contain every sample, the others are marked as sampled. (The
//! bounds are attained: each is taken from an impact within the ranges.)

use crate::common::{any_case, any_spatial, rough};
use carom_impact::{AnyLaw, CoefficientRanges, Coefficients, ImpactError, ImpactProblem, LAW_NAMES, Law};
use nalgebra::{SVector, vector};

fn outputs<const D: usize>(rng: &mut fastrand::Rng) -> Vec<SVector<f64, D>> {
    (0..4).map(|_| SVector::from_fn(|_, _| 2.0 * rng.f64() - 1.0)).collect()
}

/// Draws impacts from the box, then nearer and nearer to the best: how far they exceed the band, relative to the size
/// of P.
fn beyond<const D: usize>(
    problem: &ImpactProblem<f64, D>,
    law: &AnyLaw,
    ranges: &CoefficientRanges,
    rng: &mut fastrand::Rng,
) -> (f64, bool) {
    let outputs = outputs(rng);
    let band = problem.band(law, ranges, &outputs).unwrap();
    let impulse = |e: f64, mu: f64| {
        let coefficients = Coefficients { restitution: e, friction: mu, ..law.coefficients() };
        law.with(coefficients).resolve(problem).unwrap().impulse
    };
    let ([e_low, e_high], [mu_low, mu_high]) = (ranges.restitution, ranges.friction);
    let size = impulse(e_high, mu_high).norm();
    let mut beyond = 0.0_f64;
    for (c, (low, high)) in outputs.iter().zip(band.low.iter().zip(&band.high)) {
        for sign in [1.0, -1.0] {
            let bound = if sign > 0.0 { *high } else { -low };
            let (mut best, mut place, mut reach) = (f64::NEG_INFINITY, [0.5, 0.5], 1.0);
            for k in 0..240 {
                let mut near = |x: f64| (x + reach * (2.0 * rng.f64() - 1.0)).clamp(0.0, 1.0);
                let [x, y] = [near(place[0]), near(place[1])];
                let value = sign * c.dot(&impulse(e_low + (e_high - e_low) * x, mu_low + (mu_high - mu_low) * y));
                if value > best {
                    (best, place) = (value, [x, y]);
                }
                if k % 8 == 7 {
                    reach *= 0.7;
                }
            }
            beyond = beyond.max((best - bound) / size);
        }
    }
    (beyond, band.exact)
}

fn ranges(rng: &mut fastrand::Rng) -> CoefficientRanges {
    let mut pair = |most: f64| {
        let (a, b) = (most * rng.f64(), most * rng.f64());
        [a.min(b), a.max(b)]
    };
    CoefficientRanges { restitution: pair(1.0), friction: pair(1.2) }
}

#[test]
fn exact_bands_contain_every_sample() {
    let mut rng = fastrand::Rng::with_seed(91);
    let mut exact = std::collections::BTreeMap::new();
    for k in 0..160 {
        let name = ["energetic", "poisson", "newton", "chatterjee-ruina", "frictionless"][k % 5];
        let case = any_case(&mut rng, 0.3);
        let law = AnyLaw::named(name, rough(0.5, 0.5)).unwrap();
        let ranges = ranges(&mut rng);
        let (beyond, is_exact) = beyond(&case.problem(), &law, &ranges, &mut rng);
        // Rounding; that of Stronge's root near e = 0 is a little larger.
        let allowed = if is_exact { 1e-10 } else { 1e-6 };
        assert!(beyond < allowed, "{name} beyond by {beyond:e}: {case:?} {ranges:?}");
        let counts: &mut [usize; 2] = exact.entry(name).or_default();
        counts[usize::from(is_exact)] += 1;
    }
    for (name, [sampled, exact]) in exact {
        assert!(exact > 15, "{name}: {exact} exact, {sampled} sampled");
        assert!(sampled == 0 || ["energetic", "poisson", "newton"].contains(&name), "{name}: {sampled} sampled");
    }
}

#[test]
fn bands_in_space_are_marked_as_sampled() {
    let mut rng = fastrand::Rng::with_seed(92);
    for name in LAW_NAMES {
        let case = any_spatial(&mut rng, 0.3);
        let problem = case.problem();
        let law = AnyLaw::named(name, rough(0.5, 0.5)).unwrap();
        let ranges = CoefficientRanges { restitution: [0.4, 0.6], friction: [0.1, 0.3] };
        let (beyond, exact) = beyond(&problem, &law, &ranges, &mut rng);
        assert_eq!(exact, ["frictionless", "chatterjee-ruina"].contains(&name), "{name}");
        assert!(beyond < if exact { 1e-12 } else { 1e-2 }, "{name} {beyond:e}");
    }
    // The slip of a sphere stays in its plane: an exact band.
    let h = nalgebra::Matrix3::from_diagonal(&vector![3.5, 3.5, 1.0]);
    let ball = ImpactProblem::new(h, vector![0.6, 0.8, -1.0]).unwrap();
    let law = AnyLaw::named("energetic", rough(0.5, 0.5)).unwrap();
    let ranges = CoefficientRanges { restitution: [0.7, 0.9], friction: [0.05, 0.1] };
    let band = ball.band(&law, &ranges, &[vector![0.6, 0.8, 0.0], vector![0.0, 0.0, 1.0]]).unwrap();
    assert!(band.exact);
    // By hand: it slips throughout, P_n = 1 + e and P_t = −μ P_n.
    for (found, expected) in
        [(band.low[0], -0.19), (band.high[0], -0.05 * 1.7), (band.low[1], 1.7), (band.high[1], 1.9)]
    {
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    }
}

#[test]
fn invalid_ranges_are_refused() {
    let problem = ImpactProblem::new(nalgebra::matrix![2.0, 0.5; 0.5, 1.0], vector![1.0, -1.0]).unwrap();
    let law = AnyLaw::named("energetic", rough(0.5, 0.5)).unwrap();
    let band =
        |restitution, friction| problem.band(&law, &CoefficientRanges { restitution, friction }, &[vector![0.0, 1.0]]);
    assert!(band([0.6, 0.5], [0.0, 0.1]).unwrap_err().to_string().contains("range of restitution is 0.6 to 0.5"));
    assert!(band([0.5, 0.6], [0.0, f64::NAN]).unwrap_err().to_string().contains("friction"));
    assert!(matches!(
        band([0.5, 1.2], [0.0, 0.1]),
        Err(ImpactError::Coefficient { what: "restitution", value: 1.2, .. })
    ));
    let point = band([0.5, 0.5], [0.2, 0.2]).unwrap();
    assert!(point.exact && point.low == point.high);
    // No approach: no impulse.
    let parting = ImpactProblem::new(nalgebra::matrix![2.0, 0.5; 0.5, 1.0], vector![1.0, 1.0]).unwrap();
    let ranges = CoefficientRanges { restitution: [0.0, 1.0], friction: [0.0, 1.0] };
    let band = parting.band(&law, &ranges, &[vector![0.0, 1.0]]).unwrap();
    assert!(band.exact && band.low == [0.0] && band.high == [0.0]);
}

/// Friction from 0 on, a contact that slips, stops and slips back: with more friction P_n and P_t grow, so the band is
/// between the frictionless impulse and that of the largest friction.
#[test]
fn band_from_zero_friction_begins_at_the_frictionless_impulse() {
    let problem = ImpactProblem::new(nalgebra::matrix![2.5, -1.5; -1.5, 2.5], vector![0.1, -1.0]).unwrap();
    let law = AnyLaw::named("newton", rough(0.5, 0.1)).unwrap();
    let ranges = CoefficientRanges { restitution: [0.5, 0.5], friction: [0.0, 0.2] };
    let band = problem.band(&law, &ranges, &[vector![1.0, 0.0], vector![0.0, 1.0]]).unwrap();
    // By hand at μ = 0.2: it slips until p1 = 0.1/(1.5 + 0.2·2.5) = 0.05, where v_n = -1 + (2.5 + 0.3)·0.05 = -0.86;
    // then it slips back at dv_n/dp = 2.5 - 0.3 until v_n = 0.5.
    let back = (0.86 + 0.5) / 2.2;
    for (found, expected) in
        [(band.low[0], 0.0), (band.high[0], 0.2 * (back - 0.05)), (band.low[1], 1.5 / 2.5), (band.high[1], 0.05 + back)]
    {
        assert!((found - expected).abs() < 1e-14, "{found} {expected}");
    }
}
