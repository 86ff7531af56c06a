//! Fits of coefficients to velocity jumps: recovery of known coefficients, and coverage of the confidence intervals.

mod thrown;
mod trajectories;

use carom_chain::{Chain, uniform_chain};
use carom_impact::{ImpactProblem, LAW_NAMES, law_by_name};
use carom_sim::{Impacts, free_motion_at};
use carom_study::fit::{
    ChainJump, Fit, FitError, FitOptions, Flight, Interval, LawPair, Loss, MeasuredImpact, fit_trajectories,
    fit_velocities, join_flights, launch, lowest_point,
};
use carom_study::{RollOutOptions, Start, Tosses};
use fastrand::Rng;
use nalgebra::{DVector, Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
use thrown::{GRAVITY, close, load, normal, rough, thrown, tossed};

const QUIET: &(dyn Fn(usize, usize) + Sync) = &|_, _| {};
/// Options without a test set.
const ALL: FitOptions = FitOptions {
    law: "energetic",
    loss: Loss::Huber,
    inertia: false,
    max_friction: 1.0,
    train: 1.0,
    seed: 0,
    confidence: 0.95,
};

fn noise<const D: usize>(rng: &mut Rng, sigma: f64) -> SVector<f64, D> {
    SVector::from_fn(|_, _| sigma * normal(rng))
}

/// Eigenvalues of H between 1/4 and 1, slips of all angles.
fn problem<const D: usize>(rng: &mut Rng) -> (SMatrix<f64, D, D>, SVector<f64, D>) {
    let root = SMatrix::<f64, D, D>::from_fn(|_, _| rng.f64() - 0.5);
    let h = root * root.transpose() + SMatrix::identity() * 0.5;
    let mut u = SVector::from_fn(|_, _| 4.0 * (rng.f64() - 0.5));
    u[D - 1] = -0.3 - rng.f64();
    (h, u)
}

fn after<const D: usize>(law: &str, e: f64, mu: f64, h: SMatrix<f64, D, D>, u: SVector<f64, D>) -> SVector<f64, D> {
    let problem = ImpactProblem::new(h, u).unwrap();
    law_by_name::<D>(law, rough(e, mu)).unwrap().resolve(&problem).unwrap().u_plus
}

fn in_plane(law: &str, e: f64, mu: f64, n: usize, sigma: f64, rng: &mut Rng) -> Vec<MeasuredImpact> {
    let mut one = || {
        let (h, u): (Matrix2<f64>, Vector2<f64>) = problem(rng);
        MeasuredImpact::in_plane(h, u, after(law, e, mu, h, u) + noise::<2>(rng, sigma)).unwrap()
    };
    (0..n).map(|_| one()).collect()
}

fn in_space(law: &str, e: f64, mu: f64, n: usize, sigma: f64, rng: &mut Rng) -> Vec<MeasuredImpact> {
    let mut one = || {
        let (h, u): (Matrix3<f64>, Vector3<f64>) = problem(rng);
        MeasuredImpact::in_space(h, u, after(law, e, mu, h, u) + noise::<3>(rng, sigma)).unwrap()
    };
    (0..n).map(|_| one()).collect()
}

#[track_caller]
fn values(fit: &Fit) -> Vec<f64> {
    fit.coefficients.iter().map(|c| c.value).collect()
}

#[test]
fn fits_to_exact_jumps_recover_the_coefficients_of_every_law() {
    let mut rng = Rng::with_seed(1);
    for law in LAW_NAMES {
        let (e, mu) = (0.2 + 0.6 * rng.f64(), 0.1 + 0.3 * rng.f64());
        let plane = in_plane(law, e, mu, 20, 0.0, &mut rng);
        let space = in_space(law, e, mu, 6, 0.0, &mut rng);
        for (loss, impacts) in [(Loss::Huber, &plane), (Loss::Squares, &plane), (Loss::Huber, &space)] {
            let fit = fit_velocities(impacts, None, &FitOptions { law, loss, ..ALL }, QUIET).unwrap();
            let coefficients: Vec<_> = fit.coefficients.iter().map(|c| (c.name, c.value)).collect();
            let truth = [("restitution", e), ("friction", mu)];
            // a law without friction has one coefficient
            let truth = if law == "frictionless" { &truth[..1] } else { &truth };
            assert_eq!(coefficients.len(), truth.len(), "{law}: {coefficients:?}");
            for ((name, value), (own, truth)) in coefficients.into_iter().zip(truth) {
                assert_eq!(name, *own, "{law}");
                close(law, value, *truth, 1e-6);
            }
            let [low, high] = [fit.coefficients[0].low, fit.coefficients[0].high];
            assert!(low <= e + 1e-6 && e - 1e-6 <= high && high - low < 1e-3, "{law}: {low} to {high}");
            assert!(fit.train.mean < 1e-5, "{law}: {}", fit.train.mean);
        }
    }
}

/// Number of intervals, of `trials` fits, that contain the true value of each coefficient. `slip`: greatest slip before the
/// impact, m/s, uniformly distributed; at 0.3 about a quarter of the impacts slip to the end, and sticking impacts do not
/// identify friction. `heavy`: the noise of each impact has Student's distribution with three degrees of freedom (variance
/// 3 σ²).
fn held(n: usize, sigma: f64, slip: f64, heavy: bool, trials: u64) -> [usize; 2] {
    let (e, mu) = (0.55, 0.3);
    let mut held = [0; 2];
    for seed in 0..trials {
        let mut rng = Rng::with_seed(seed + 1000 * n as u64);
        let mut one = || {
            let (h, mut u): (Matrix2<f64>, Vector2<f64>) = problem(&mut rng);
            u.x *= 0.5 * slip;
            let chi: f64 = (0..3).map(|_| normal(&mut rng).powi(2)).sum();
            let sigma = if heavy { sigma * (3.0 / chi).sqrt() } else { sigma };
            MeasuredImpact::in_plane(h, u, after("energetic", e, mu, h, u) + noise::<2>(&mut rng, sigma)).unwrap()
        };
        let impacts: Vec<MeasuredImpact> = (0..n).map(|_| one()).collect();
        let fit = fit_velocities(&impacts, None, &ALL, QUIET).unwrap();
        for (k, truth) in [e, mu].into_iter().enumerate() {
            let c = fit.coefficients[k];
            assert!(c.low <= c.value && c.value <= c.high, "{c:?}");
            held[k] += usize::from(c.low <= truth && truth <= c.high);
        }
    }
    held
}

/// Checks the coverage of 95 % intervals. The number of intervals with the true value is binomial: of 200, 190 ± 3.1. Three
/// standard deviations are allowed in both directions, as intervals must not be too wide either.
#[track_caller]
fn assert_coverage(held: &[[usize; 2]], trials: u64) {
    let trials = trials as f64 * held.len() as f64;
    let (mean, deviation) = (0.95 * trials, (0.95 * 0.05 * trials).sqrt());
    for (k, name) in ["restitution", "friction"].into_iter().enumerate() {
        let found = held.iter().map(|pair| pair[k]).sum::<usize>() as f64;
        let off = (found - mean) / deviation;
        assert!(
            off.abs() <= 3.0,
            "{found} of {trials} intervals of 95 % contain {name}, off by {off} standard deviations: {held:?}"
        );
    }
}

#[test]
fn intervals_of_ten_impacts_have_their_nominal_coverage() {
    assert_coverage(&[held(10, 0.03, 2.0, false, 150)], 150);
}

#[test]
fn intervals_of_thirty_impacts_have_their_nominal_coverage() {
    let sets = [(0.003, false), (0.1, false), (0.03, true)].map(|(sigma, heavy)| held(30, sigma, 2.0, heavy, 60));
    assert_coverage(&sets, 60);
}

#[test]
fn intervals_of_a_hundred_impacts_have_their_nominal_coverage() {
    assert_coverage(&[held(100, 0.03, 2.0, false, 40)], 40);
}

/// Few impacts identify friction, so the degrees of freedom are few.
#[test]
fn intervals_have_their_nominal_coverage_if_most_impacts_stick() {
    let sets = [(10, 0.03, false), (30, 0.03, false), (30, 0.03, true), (30, 0.1, false)];
    assert_coverage(&sets.map(|(n, sigma, heavy)| held(n, sigma, 0.3, heavy, 50)), 50);
}

#[test]
fn intervals_in_space_have_their_nominal_coverage() {
    let (e, mu) = (0.4, 0.25);
    let mut held = [0; 2];
    let options = FitOptions { law: "chatterjee-ruina", loss: Loss::Squares, ..ALL };
    for seed in 0..100 {
        let impacts = in_space("chatterjee-ruina", e, mu, 25, 0.03, &mut Rng::with_seed(1000 + seed));
        let fit = fit_velocities(&impacts, None, &options, QUIET).unwrap();
        for (k, truth) in [e, mu].into_iter().enumerate() {
            held[k] += usize::from(fit.coefficients[k].low <= truth && truth <= fit.coefficients[k].high);
        }
    }
    assert_coverage(&[held], 100);
}

/// One impact slips, the others stick for any friction above 0.02: only their residuals give an estimate of the noise.
#[test]
fn friction_identified_by_one_impact_has_an_interval_from_homogeneous_noise() {
    let mut rng = Rng::with_seed(14);
    let (e, mu, h) = (0.5, 0.3, Matrix2::identity());
    let mut held = 0;
    for _ in 0..40 {
        let mut impacts = Vec::new();
        for k in 0..20 {
            let u = Vector2::new(if k == 0 { 2.0 } else { 0.02 * rng.f64() }, -1.0 - rng.f64());
            let seen = after("energetic", e, mu, h, u) + noise::<2>(&mut rng, 0.02);
            impacts.push(MeasuredImpact::in_plane(h, u, seen).unwrap());
        }
        let fit = fit_velocities(&impacts, None, &ALL, QUIET).unwrap();
        let friction = fit.coefficients[1];
        held += usize::from(friction.low <= mu && mu <= friction.high);
        assert_eq!(friction.interval, Interval::Alike);
        assert!(friction.high - friction.low > 0.01, "{friction:?}");
        assert!(
            fit.notes.iter().any(|note| note.starts_with("only one impact identifies friction")),
            "{:?}",
            fit.notes
        );
    }
    // 38 ± 1.4 or more, as the noise is estimated from the whole residual
    assert!(held >= 34, "{held} of 40");
}

/// H of rank one makes the jump one number, and of impacts whose slip reverses, all alike, it is a function of both coefficients.
#[test]
fn coefficients_that_compensate_each_other_are_told() {
    let mut rng = Rng::with_seed(3);
    let (e, mu) = (0.6, 0.3);
    let h = Matrix2::new(0.25, 0.65, 0.65, 1.69);
    let mut impacts = Vec::new();
    for _ in 0..20 {
        let u = Vector2::new(-0.3, -1.0) * (0.5 + rng.f64());
        let seen = after("energetic", e, mu, h, u) + noise::<2>(&mut rng, 0.01);
        impacts.push(MeasuredImpact::in_plane(h, u, seen).unwrap());
    }
    let fit = fit_velocities(&impacts, None, &ALL, QUIET).unwrap();
    for (name, truth, found) in [("restitution", e, fit.coefficients[0]), ("friction", mu, fit.coefficients[1])] {
        assert!(found.low <= truth && truth <= found.high && found.high - found.low > 0.1, "{found:?}");
        let told = format!("{name} may compensate another coefficient");
        assert!(fit.notes.iter().any(|note| note.starts_with(&told)), "{:?}", fit.notes);
    }
}

/// Above the friction at which all impacts stick the loss is constant, so the interval ends at the bound of the search.
#[test]
fn friction_without_an_upper_bound_in_the_data_has_an_interval_up_to_the_search_bound() {
    let mut rng = Rng::with_seed(15);
    let (e, mu, h) = (0.5, 0.3, Matrix2::identity());
    let mut impacts = Vec::new();
    for k in 0..30 {
        // they stick for μ ≥ |u_t|/((1 + e)|uₙ|) = 0.24 … 0.31, and the noise is as large as the slip that remains
        let u = Vector2::new(0.36 + 0.0035 * f64::from(k), -1.0);
        let seen = after("energetic", e, mu, h, u) + noise::<2>(&mut rng, 0.05);
        impacts.push(MeasuredImpact::in_plane(h, u, seen).unwrap());
    }
    let fit = fit_velocities(&impacts, None, &ALL, QUIET).unwrap();
    let friction = fit.coefficients[1];
    assert!(friction.high == 1.0 && friction.low > 0.15 && friction.low < 0.3, "{friction:?}");
    assert!((fit.coefficients[0].high - fit.coefficients[0].low) < 0.2, "{:?}", fit.coefficients[0]);
}

#[test]
fn hubers_loss_is_robust_against_an_outlier() {
    let (e, mu) = (0.6, 0.2);
    let mut rng = Rng::with_seed(4);
    let mut impacts = in_plane("energetic", e, mu, 30, 0.01, &mut rng);
    let (h, u): (Matrix2<f64>, Vector2<f64>) = problem(&mut rng);
    impacts.push(MeasuredImpact::in_plane(h, u, Vector2::new(0.0, 30.0)).unwrap());
    let off = |loss| {
        let fit = fit_velocities(&impacts, None, &FitOptions { loss, ..ALL }, QUIET).unwrap();
        (fit.coefficients[0].value - e).abs().max((fit.coefficients[1].value - mu).abs())
    };
    let (huber, squares) = (off(Loss::Huber), off(Loss::Squares));
    // standard error of the coefficients with thirty impacts and noise of 0.01 m/s: about 0.003
    assert!(huber < 0.01, "{huber}");
    assert!(squares > 10.0 * huber, "{squares} against {huber}");
}

#[test]
fn least_residual_is_a_lower_bound_for_every_law() {
    let mut rng = Rng::with_seed(5);
    let mut beaten_by_friction = 0;
    for law in LAW_NAMES {
        for _ in 0..40 {
            let (e, mu) = (rng.f64(), rng.f64());
            let laws = LawPair::new(law, rough(e, mu)).unwrap();
            let (h, u): (Matrix3<f64>, Vector3<f64>) = problem(&mut rng);
            let (h2, u2): (Matrix2<f64>, Vector2<f64>) = problem(&mut rng);
            let space = MeasuredImpact::in_space(h, u, noise(&mut rng, 1.0)).unwrap();
            let plane = MeasuredImpact::in_plane(h2, u2, noise(&mut rng, 1.0)).unwrap();
            for impact in [space, plane] {
                let left = impact.residual(&laws).unwrap().norm();
                let (cone, any) = (impact.least_residual(mu), impact.least_residual(f64::INFINITY));
                let rounding = 1e-9 * (1.0 + impact.size());
                assert!(cone <= left + rounding, "{law}: bound {cone} in the cone, residual {left}");
                assert!(any <= cone + rounding, "{law}: bound {any} without a cone, {cone} in it");
                beaten_by_friction += usize::from(cone > any + 0.01);
            }
        }
    }
    assert!(beaten_by_friction > 100, "too few cases in which the cone is active: {beaten_by_friction}");
}

/// The part of a velocity jump that is orthogonal to all impulses at the contact point is the least residual.
#[test]
fn least_residual_is_the_part_of_a_jump_that_no_point_contact_gives() {
    let chain = uniform_chain(5, 1.0, 1.0).unwrap();
    let tip = chain.frames().len() - 1;
    let frame = chain.frame(&chain.frames()[tip].name.clone()).unwrap();
    let (q, qd) = ([0.3, -0.8, 0.5, 0.4, -0.6], [0.2, -0.4, 0.3, -0.5, 0.1]);
    let toward = |n: [f64; 3]| chain.impact(&q, &qd).at(frame).normal(n).contact().unwrap().problem().u_minus()[2];
    let normal = if toward([0.0, 1.0, 0.0]) < 0.0 { [0.0, 1.0, 0.0] } else { [0.0, -1.0, 0.0] };
    let law = law_by_name::<3>("energetic", rough(0.5, 0.3)).unwrap();
    let hit = chain.impact(&q, &qd).at(frame).normal(normal).resolve(law.as_ref()).unwrap();
    let jump = |extra: &DVector<f64>| {
        let qd_plus = hit.qd_plus.iter().zip(extra.iter()).map(|(a, b)| a + b).collect();
        let (q, qd_minus) = (q.to_vec(), qd.to_vec());
        let jump = ChainJump { q, qd_minus, qd_plus, point: frame.into(), normal: normal.into() };
        MeasuredImpact::of_chain(&chain, &jump).unwrap()
    };
    let none = DVector::zeros(5);
    close("jump computed by a law", jump(&none).least_residual(0.3), 0.0, 1e-12);
    // a motion that leaves the tip at rest is orthogonal, in kinetic energy, to the jumps of all impulses at the tip
    let contact = chain.impact(&q, &qd).at(frame).normal(normal).contact().unwrap();
    let plane = contact.jacobian().rows(0, 2).into_owned();
    let some = DVector::from_vec(vec![0.3, -0.2, 0.4, 0.1, -0.3]);
    let kept = &some - plane.clone().pseudo_inverse(1e-12).unwrap() * &plane * &some;
    let mut workspace = chain.workspace();
    let energy = workspace.update(&chain, &q).unwrap().kinetic_energy(kept.as_slice()).unwrap();
    let expected = (2.0 * energy / chain.total_mass()).sqrt();
    assert!(expected > 1e-3, "{expected}");
    close("least residual", jump(&kept).least_residual(f64::INFINITY), expected, 1e-12);
    close(
        "residual of the law",
        jump(&kept).residual(&LawPair::new("energetic", rough(0.5, 0.3)).unwrap()).unwrap().norm(),
        expected,
        1e-12,
    );
}

#[test]
fn a_fit_to_sticking_impacts_notes_that_friction_is_not_identified() {
    let mut rng = Rng::with_seed(6);
    let mut impacts = Vec::new();
    for _ in 0..20 {
        // a small slip, which μ ≥ 0.05 stops
        let u = Vector2::new(0.02 * rng.f64(), -1.0 - rng.f64());
        let h = Matrix2::identity();
        impacts.push(
            MeasuredImpact::in_plane(h, u, after("energetic", 0.5, 0.6, h, u) + noise::<2>(&mut rng, 1e-4)).unwrap(),
        );
    }
    let fit = fit_velocities(&impacts, None, &ALL, QUIET).unwrap();
    let friction = fit.coefficients[1];
    assert_eq!(friction.interval, Interval::Alike);
    // the greatest |u_t|/((1+e)|u_n|) is below 0.02/1.5
    assert!(friction.low < 0.02 && friction.high == 1.0, "{friction:?}");
    assert!(fit.notes.iter().any(|note| note.contains("friction is not identified")), "{:?}", fit.notes);
    assert!((fit.coefficients[0].value - 0.5).abs() < 1e-3);
}

#[test]
fn a_coefficient_at_its_bound_has_a_one_sided_interval() {
    // measured velocities into the surface of 0.02 m/s: restitution 0 is the nearest
    let mut rng = Rng::with_seed(7);
    let mut one = || {
        let (h, u): (Matrix2<f64>, Vector2<f64>) = problem(&mut rng);
        let seen = after("energetic", 0.0, 0.3, h, u) + noise::<2>(&mut rng, 0.03) - Vector2::new(0.0, 0.02);
        MeasuredImpact::in_plane(h, u, seen).unwrap()
    };
    let impacts: Vec<MeasuredImpact> = (0..30).map(|_| one()).collect();
    let fit = fit_velocities(&impacts, None, &ALL, QUIET).unwrap();
    let [e, mu] = fit.coefficients[..] else { panic!("two coefficients") };
    assert_eq!((e.value, e.low, e.interval), (0.0, 0.0, Interval::Profile));
    assert!(e.high < 0.05, "{e:?}");
    assert!(mu.low < 0.3 && 0.3 < mu.high && mu.high - mu.low < 0.1, "{mu:?}");
    assert!(fit.notes.iter().any(|note| note.contains("restitution is at its bound 0")), "{:?}", fit.notes);
}

#[test]
fn training_and_test_sets_are_disjoint() {
    let impacts = in_plane("energetic", 0.5, 0.3, 31, 0.01, &mut Rng::with_seed(8));
    let trained = |seed| {
        let fit = fit_velocities(&impacts, None, &FitOptions { train: 0.6, seed, ..ALL }, QUIET).unwrap();
        assert_eq!((fit.train.count, fit.test.unwrap().count), (19, 12));
        let trained: Vec<i64> = fit.each.iter().filter(|one| one.trained).map(|one| one.number).collect();
        assert_eq!(trained.len(), 19);
        assert!(fit.each.iter().enumerate().all(|(k, one)| one.number == k as i64));
        (trained, values(&fit))
    };
    assert_eq!(trained(1), trained(1), "the same seed gives the same digits");
    assert_ne!(trained(1).0, trained(2).0);
    // the test set does not influence the fit
    let (kept, before) = trained(1);
    let mut spoilt = impacts.clone();
    for k in (0..31).filter(|k| !kept.contains(k)) {
        let (h, u): (Matrix2<f64>, Vector2<f64>) = problem(&mut Rng::with_seed(k as u64));
        spoilt[k as usize] = MeasuredImpact::in_plane(h, u, Vector2::new(9.0, 9.0)).unwrap();
    }
    let fit = fit_velocities(&spoilt, None, &FitOptions { train: 0.6, seed: 1, ..ALL }, QUIET).unwrap();
    assert_eq!(values(&fit), before);
    assert!(fit.test.unwrap().mean > 1.0);
}

#[test]
fn options_out_of_range_are_refused() {
    let impacts = in_plane("energetic", 0.5, 0.3, 6, 0.01, &mut Rng::with_seed(13));
    let refuse = |options: FitOptions| fit_velocities(&impacts, None, &options, QUIET).unwrap_err().to_string();
    let laws = "frictionless, whittaker, newton, poisson, energetic, chatterjee-ruina, brach, smith";
    assert_eq!(refuse(FitOptions { law: "hertz", ..ALL }), format!("no law is named 'hertz': the laws are {laws}"));
    for (options, message) in [
        (FitOptions { train: 0.0, ..ALL }, "training share is 0: it must be above 0 and at most 1"),
        (FitOptions { train: f64::NAN, ..ALL }, "training share is NaN: it must be above 0 and at most 1"),
        (FitOptions { max_friction: -1.0, ..ALL }, "largest friction is -1: it must be above 0 and at most 100"),
        (FitOptions { confidence: 1.0, ..ALL }, "confidence is 1: it must be at least 0.5 and below 1"),
        (
            FitOptions { train: 0.4, ..ALL },
            "2 of 6 impacts are selected to fit 2 coefficients, but at least 3 are needed: record more, or train on a \
             larger share of them",
        ),
        (
            FitOptions { inertia: true, ..ALL },
            "the scale of inertia cannot be fitted to impacts given by a Delassus matrix: give a robot and the \
             configurations q",
        ),
    ] {
        assert_eq!(refuse(options), message);
    }
    let parting = MeasuredImpact::in_plane(Matrix2::identity(), Vector2::new(0.0, 1.0), Vector2::zeros());
    let why = "the contact does not approach: its normal velocity before the impact is 1 m/s and must be negative; leave \
               this measurement out, or check the normal (from the environment to the robot)";
    assert_eq!(parting.unwrap_err().to_string(), why);
    let hole = MeasuredImpact::in_plane(Matrix2::identity(), Vector2::new(0.0, -1.0), Vector2::new(f64::NAN, 0.0));
    assert_eq!(hole.unwrap_err().to_string(), "u_plus contains NaN: every number must be finite");
}
