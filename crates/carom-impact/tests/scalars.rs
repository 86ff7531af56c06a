//! The laws with other scalar types: single precision agrees, dual numbers give the derivative.

use crate::common::{Case, any_case, close};
use carom_impact::{
    Brach, ChatterjeeRuina, Energetic, Frictionless, ImpactOutcome, ImpactProblem, Law, Newton, Poisson, Smith,
    Whittaker,
};
use nalgebra::{RealField, SVector, convert};
use num_dual::Dual64;

/// All laws in any scalar.
fn all<T: RealField + Copy>(problem: &ImpactProblem<T, 2>, restitution: T, friction: T) -> [ImpactOutcome<T, 2>; 8] {
    [
        Frictionless { restitution }.resolve(problem),
        Whittaker { restitution, friction }.resolve(problem),
        Newton { restitution, friction }.resolve(problem),
        Poisson { restitution, friction }.resolve(problem),
        Energetic { restitution, friction }.resolve(problem),
        ChatterjeeRuina { restitution, tangential_restitution: T::zero(), friction }.resolve(problem),
        Brach { restitution, impulse_ratio: -friction }.resolve(problem),
        Smith { restitution, friction }.resolve(problem),
    ]
    .map(Result::unwrap)
}

fn in_f64(case: &Case) -> [ImpactOutcome<f64, 2>; 8] {
    all(&case.problem(), case.restitution, case.friction)
}

#[test]
fn single_precision_agrees_with_double() {
    let mut rng = fastrand::Rng::with_seed(5);
    for _ in 0..10_000 {
        let case = any_case(&mut rng, 0.3);
        let problem = ImpactProblem::new(case.delassus.map(|x| x as f32), case.u.map(|x| x as f32)).unwrap();
        let single = all(&problem, case.restitution as f32, case.friction as f32);
        for (double, single) in in_f64(&case).into_iter().zip(single) {
            // Near a jam dv_n/dp = C - μ s B is a small difference with a large rounding error.
            let near_jam = (case.delassus[(1, 1)] - case.friction * case.delassus[(0, 1)].abs()).abs() < 1e-2;
            let within = if near_jam { 1e-2 } else { 1e-4 };
            let off = (double.u_plus - single.u_plus.map(f64::from)).norm() / double.u_plus.norm().max(1.0);
            assert!(off <= within, "{} off {off:e} in {case:?}", double.law);
        }
    }
}

#[test]
fn dual_numbers_give_the_value_and_the_derivative() {
    let mut rng = fastrand::Rng::with_seed(6);
    let (mut checked, mut drawn_cases, mut receding) = (0, 0, 0);
    for _ in 0..2_000 {
        let mut case = any_case(&mut rng, 0.3);
        case.restitution = case.restitution.clamp(0.01, 0.99);
        case.friction = case.friction.clamp(0.01, 3.0);
        // One direction in all inputs: H, u, e, μ.
        let mut drawn = || rng.f64() - 0.5;
        let (da, db, dc, dv_t, dv_n, de, dmu) = (drawn(), drawn(), drawn(), drawn(), drawn(), drawn(), drawn());
        let moved = |x: f64| {
            let mut case = case;
            case.delassus += nalgebra::Matrix2::new(da, db, db, dc) * x;
            case.u += nalgebra::Vector2::new(dv_t, dv_n) * x;
            case.restitution += de * x;
            case.friction += dmu * x;
            case
        };
        if moved(1e-5).u[1] >= 0.0 || moved(-1e-5).u[1] >= 0.0 {
            receding += 1;
            continue;
        }
        let dual = |x: f64, slope: f64| Dual64::new(x, slope);
        let mut h = case.delassus.map(Dual64::from_re);
        (h[(0, 0)].eps, h[(0, 1)].eps, h[(1, 0)].eps, h[(1, 1)].eps) = (da, db, db, dc);
        let u = nalgebra::Vector2::new(dual(case.u[0], dv_t), dual(case.u[1], dv_n));
        let problem = ImpactProblem::new(h, u).unwrap();
        let duals = all(&problem, dual(case.restitution, de), dual(case.friction, dmu));

        let step = 1e-6;
        let (here, ahead, behind) = (in_f64(&case), in_f64(&moved(step)), in_f64(&moved(-step)));
        for (((dual, here), ahead), behind) in duals.iter().zip(&here).zip(&ahead).zip(&behind) {
            drawn_cases += 1;
            // Fused multiply-add in f64 only: the last bits may differ.
            let value = |v: &SVector<Dual64, 2>| v.map(|x| x.re);
            close(here.law, (value(&dual.u_plus) - here.u_plus).norm(), 0.0, 1e-12 * here.u_plus.norm().max(1.0));
            assert!(dual.energy_change.eps.is_finite() && dual.newton.unwrap().eps.is_finite());

            // Skips class boundaries, where one-sided derivatives differ, and large curvatures.
            let (forward, backward) = (ahead.u_plus - here.u_plus, here.u_plus - behind.u_plus);
            if (forward - backward).norm() > 1e-9 {
                continue;
            }
            let difference = (ahead.u_plus - behind.u_plus) / (2.0 * step);
            let slope = dual.u_plus.map(|x| x.eps);
            let off = (slope - difference).norm() / difference.norm().max(1.0);
            assert!(off < 1e-4, "{} {off:e} {slope:?} {difference:?} in {case:?}", here.law);
            checked += 1;
        }
    }
    println!("{checked} of {drawn_cases} compared, {receding} receding");
    assert!(checked > 15_000 && receding < 20, "{checked} of {drawn_cases}, {receding} receding");
}

/// The derivative with respect to e exists at e = 0 too, where the square root of the work has none.
#[test]
fn derivative_at_zero_restitution_is_finite() {
    let h = nalgebra::Matrix2::new(2.5, -1.5, -1.5, 2.5).map(convert::<f64, Dual64>);
    let u = nalgebra::Vector2::new(0.1, -1.0).map(convert::<f64, Dual64>);
    let problem = ImpactProblem::new(h, u).unwrap();
    for hit in all(&problem, Dual64::new(0.0, 1.0), Dual64::from(0.7)) {
        assert!(hit.u_plus[1].eps > 0.5 && hit.u_plus[1].eps < 1.5, "{} {}", hit.law, hit.u_plus[1].eps);
        assert!(hit.normal_work.eps.is_finite() && hit.energetic.unwrap().eps.is_finite());
    }
}
