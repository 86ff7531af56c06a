//! Comparisons of all laws on synthetic data: the law that made the data wins, and a fold's coefficients do not know the fold.

#[path = "../../carom-study/tests/fit/thrown.rs"]
pub(super) mod thrown;

use crate::compare::{CompareOptions, Comparison, DataSet, Row, compare, data_sets, toss_cases};
use carom_chain::urdf::LoadOptions;
use carom_impact::{Coefficients, LAW_NAMES, Law, law_by_name};
use carom_sim::Moment;
use carom_study::{Horizon, Toss};
use carom_testing::files::Folder;
use fastrand::Rng;
use nalgebra::Vector3;
use std::fmt::Write;
use thrown::{close, load, normal, rolled, rough, thrown};

/// A folder with a file.
fn data(file: &str, text: &str) -> Folder {
    let folder = Folder::new();
    folder.write(file, text);
    folder
}

/// The only data set of a folder.
fn set(folder: &Folder) -> DataSet {
    let mut sets = data_sets(folder, &LoadOptions::default()).unwrap();
    assert_eq!(sets.len(), 1);
    sets.remove(0)
}

const QUIETLY: &(dyn Fn(usize, usize) + Sync) = &|_, _| {};

/// Rows of a table of planar impacts of the ellipse, computed with a law, with noise of 1 %.
fn ellipse(law: &str, coefficients: Coefficients, count: usize) -> Vec<[f64; 13]> {
    ellipse_at(&|_| law_by_name::<2>(law, coefficients).unwrap(), count)
}

/// The same with a law that depends on the approach speed.
fn ellipse_at(law: &dyn Fn(f64) -> Box<dyn Law<f64, 2> + Send + Sync>, count: usize) -> Vec<[f64; 13]> {
    let (mass, inertia) = (0.0364_f64, 1.3468e-5_f64);
    let mut rng = Rng::with_seed(21);
    let mut rows = Vec::new();
    while rows.len() < count {
        let (d, n) = ([1.0, 0.0, 0.03], [0.0, 1.0, 0.02 * (2.0 * rng.f64() - 1.0)]);
        let before = Vector3::new(2.0 * rng.f64() - 1.0, -1.0 - 2.0 * rng.f64(), 60.0 * (rng.f64() - 0.5));
        let jacobian = nalgebra::Matrix2x3::new(d[0], d[1], d[2], n[0], n[1], n[2]);
        let inverse = nalgebra::Matrix3::from_diagonal(&Vector3::new(1.0 / mass, 1.0 / mass, 1.0 / inertia));
        let problem =
            carom_impact::ImpactProblem::new(jacobian * inverse * jacobian.transpose(), jacobian * before).unwrap();
        if problem.approach_speed() < 0.2 {
            continue;
        }
        let p = law(problem.approach_speed()).resolve(&problem).unwrap().impulse;
        let jump = inverse * jacobian.transpose() * p;
        let after = before + jump.map(|x| x * (1.0 + 0.01 * normal(&mut rng)));
        let [a, b] = [before, after].map(|v| [v.x, v.y, v.z]);
        rows.push([rows.len() as f64, a[0], a[1], a[2], b[0], b[1], b[2], d[0], d[1], d[2], n[0], n[1], n[2]]);
    }
    rows
}

fn table(rows: &[[f64; 13]]) -> String {
    let mut text = "i,pre_vx,pre_vy,pre_w,post_vx,post_vy,post_w,d_x,d_y,d_th,n_x,n_y,n_th\n".to_owned();
    for row in rows {
        let _ = writeln!(text, "{}", row.map(|x| x.to_string()).join(","));
    }
    text
}

/// The row of a law with these effects.
fn row<'a>(all: &'a Comparison, law: &str, effects: &[&str]) -> &'a Row {
    all.rows.iter().find(|row| row.law == law && row.effects == effects).unwrap()
}

fn compared(rows: &[[f64; 13]], options: &CompareOptions) -> Comparison {
    let folder = data("impacts_odd.csv", &table(rows));
    compare(&set(&folder), options, QUIETLY).unwrap().remove(0)
}

#[test]
fn the_law_that_made_the_impacts_predicts_them_best() {
    let options = CompareOptions { folds: 3, ..CompareOptions::default() };
    let tangential = Coefficients { tangential_restitution: 0.4, ..rough(0.5, 0.3) };
    for (law, truth) in [("smith", rough(0.5, 0.3)), ("chatterjee-ruina", tangential)] {
        let rows = ellipse(law, truth, 60);
        let mut found = compared(&rows, &options);
        // no effect is selected, because none made the impacts
        assert_eq!(found.selected.unwrap().models, [law; 3]);
        found.rows.retain(|row| row.effects.is_empty());
        let [best, next] = [&found.rows[0], &found.rows[1]];
        assert_eq!((best.law.as_str(), found.rows.len()), (law, LAW_NAMES.len()));
        assert!(next.to_best.mean > 2.0 * next.to_best.standard_error, "{law}: {} {:?}", next.law, next.to_best);
        let values = [truth.restitution, truth.friction, truth.tangential_restitution];
        for (fitted, truth) in best.coefficients.iter().zip(values) {
            for value in &fitted.values {
                // 1 % of noise in 40 impacts, most of which slip
                close(fitted.name, *value, truth, 0.03);
            }
        }
        // the bound is below every law, impact by impact in the mean
        let bound = found.bound.unwrap().estimate.mean;
        assert!(found.rows.iter().all(|row| row.error.estimate.mean >= bound - 1e-12));
        assert!(bound > 0.0 && found.rows.iter().all(|row| row.refused == 0));
    }
}

/// The coefficients for a fold do not change when its own impacts are replaced by others; those for the other folds do.
#[test]
fn coefficients_for_a_fold_are_fitted_without_it() {
    let options = CompareOptions { folds: 3, seed: 4, ..CompareOptions::default() };
    let mut rows = ellipse("newton", rough(0.5, 0.3), 24);
    let before = compared(&rows, &options);
    for (row, fold) in rows.iter_mut().zip(&before.folds) {
        if *fold == 1 {
            row[5] *= 0.3; // the vertical velocity after the impact
        }
    }
    let after = compared(&rows, &options);
    assert_eq!(before.folds, after.folds);
    for row in before.rows.iter().filter(|row| row.effects.is_empty()) {
        let other = self::row(&after, &row.law, &[]);
        let (a, b) = (&row.coefficients[0].values, &other.coefficients[0].values);
        assert_eq!(a[1], b[1], "{}: the fold decides on its own coefficients", row.law);
        assert!((a[0] - b[0]).abs() > 1e-3 && (a[2] - b[2]).abs() > 1e-3, "{}: {a:?} {b:?}", row.law);
    }
}

/// The table of tosses, with velocities along x that are wrong by `off`, m/s.
fn toss_table(tosses: &[Toss], off: f64) -> String {
    let mut text = "toss,t,px,py,pz,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz\n".to_owned();
    for toss in tosses {
        for Moment { time, q, qd } in &toss.samples {
            let turn = nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]));
            let v = turn * Vector3::new(qd[0] + off, qd[1], qd[2]);
            let _ = writeln!(
                text,
                "{},{time},{},{},{},{},{},{},{},{},{},{},{},{},{}",
                toss.number, q[0], q[1], q[2], q[6], q[3], q[4], q[5], v.x, v.y, v.z, qd[3], qd[4], qd[5]
            );
        }
    }
    text
}

/// Tosses of a ball with an error of the velocities of the table. Without friction the spin never changes, so that law loses;
/// the laws that agree for a ball agree; a fitted start is better than the given one.
#[test]
fn tosses_are_judged_from_both_starts_and_to_both_ends() {
    let ball = load("ball");
    let law = carom_impact::Energetic { restitution: 0.6, friction: 0.15 };
    let tosses = thrown(&ball, law, &mut Rng::with_seed(16), 8);
    let folder = data("tosses.csv", &toss_table(&tosses, 0.1));
    folder.copy("robots/ball.urdf");
    let options = CompareOptions { folds: 2, trials: 36, tosses: 4, ..CompareOptions::default() };
    let set = set(&folder);
    let all = compare(&set, &options, QUIETLY).unwrap();
    assert_eq!(all.len(), 4);
    assert_eq!(all[0].numbers.len(), 8);
    let of = |part: usize, law: &str| {
        let of_law = |row: &&Row| row.law == law && row.effects.is_empty() && row.several == Some("moreau");
        all[part].rows.iter().find(of_law).unwrap().error.estimate.mean
    };
    for part in [0, 1] {
        // the search ends at 1 % of the range, and an error of 0.01 in e moves a bounce of 1 m/s by 1 mm in 0.1 s
        assert!(of(part, "energetic") < 1e-2, "{}", of(part, "energetic"));
        assert!(of(part, "frictionless") > 10.0 * of(part, "energetic"));
        // H of a ball is diagonal
        close("poisson", of(part, "poisson"), of(part, "energetic"), 1e-6);
        // the velocities of the table are wrong by 0.1 m/s
        assert!(of(part + 2, "energetic") > of(part, "energetic"));
        let [fitted, given] = [all[part].floor.unwrap(), all[part + 2].floor.unwrap()];
        assert!(fitted.estimate.mean < 1e-6 && given.estimate.mean > 1e-4, "{fitted:?} {given:?}");
    }
    assert!(all[1].rows.iter().all(|row| row.below_threshold.is_some()));
    // effects are judged from the fitted start alone
    let effects = |part: usize| all[part].rows.iter().any(|row| !row.effects.is_empty());
    assert_eq!([0, 1, 2, 3].map(effects), [true, true, false, false]);

    // roll-outs to the end of the early part give the errors of this part
    let early = compare(&set, &CompareOptions { judged: Horizon::Early, ..options }, QUIETLY).unwrap();
    assert_eq!(early.len(), 2);
    for (one, part) in early.iter().zip([0, 2]) {
        for row in &one.rows {
            let same =
                |other: &&Row| (&other.law, other.several, &other.effects) == (&row.law, row.several, &row.effects);
            let whole = all[part].rows.iter().find(same).unwrap();
            // the tolerance of the simulation is 1e-5
            let near = row.errors.iter().zip(&whole.errors).all(|(a, b)| (a - b).abs() < 1e-4 * b + 1e-7);
            assert!(near, "{row:?} {whole:?}");
        }
    }

    // what is exported is enough to compute the errors of the table again: start, fold, poses, end of the early part
    let cases = toss_cases(&set, &options).unwrap().unwrap();
    assert_eq!((cases.set.as_str(), cases.trials, cases.horizon), (all[0].set.as_str(), 36, "early"));
    assert_eq!(cases.cases.iter().map(|case| case.number).collect::<Vec<_>>(), all[0].numbers);
    assert_eq!(cases.cases.iter().map(|case| case.fold).collect::<Vec<_>>(), all[0].folds);
    assert_eq!(cases.cases.iter().filter(|case| case.fitted).count(), 4);
    for (k, case) in cases.cases.iter().enumerate() {
        for (part, start, end) in [
            (0, &case.fitted_start, case.early),
            (1, &case.fitted_start, case.poses.len() - 1),
            (3, &case.given_start, case.poses.len() - 1),
        ] {
            let row =
                all[part].rows.iter().find(|row| row.law == "energetic" && row.several == Some("moreau")).unwrap();
            let [e, mu] = [0, 1].map(|c| row.coefficients[c].values[case.fold]);
            let law = carom_impact::Energetic { restitution: e, friction: mu };
            let last = case.times.len() - 1;
            let every = case.times[last] / last as f64;
            let rolled = rolled(&ball, law, &start.q, &start.qd, every, case.times[last] + 1e-9);
            let error = |(moment, pose): (&Moment, &Vec<f64>)| {
                let turn = |q: &[f64]| {
                    nalgebra::UnitQuaternion::new_normalize(nalgebra::Quaternion::new(q[6], q[3], q[4], q[5]))
                };
                let place = (0..3).map(|k| (moment.q[k] - pose[k]).powi(2)).sum::<f64>();
                place / cases.length + turn(&moment.q).angle_to(&turn(pose)).powi(2)
            };
            let sum: f64 = rolled.iter().zip(&case.poses).take(end + 1).map(error).sum();
            // the tolerances of the two simulations are 1e-6 and 1e-5
            let (found, told) = (sum / (end + 1) as f64, row.errors[k]);
            assert!((found - told).abs() < 1e-4 * told + 1e-7, "toss {}, part {part}: {found} {told}", case.number);
        }
    }
}

#[test]
fn data_that_cannot_be_compared_are_refused() {
    let rows = ellipse("newton", rough(0.5, 0.3), 10);
    let folder = data("impacts.csv", &table(&rows));
    let few = compare(&set(&folder), &CompareOptions::default(), QUIETLY).unwrap_err().to_string();
    assert!(few.ends_with("it has 10 measurements that can be compared, but 20 are needed for 5 folds"), "{few}");
    let one = compare(&set(&folder), &CompareOptions { folds: 1, ..CompareOptions::default() }, QUIETLY).unwrap_err();
    assert_eq!(one.to_string(), "number of folds is 1: it must be at least 2");
    folder.write("impacts.csv", "a,b\n1,2\n");
    let none = data_sets(&folder.0, &LoadOptions::default()).unwrap_err().to_string();
    assert!(none.contains("it holds no data set"), "{none}");
    folder.write("impacts.csv", table(&rows).replacen("\n0,", "\nx,", 1));
    let line = data_sets(&folder.0, &LoadOptions::default()).unwrap_err().to_string();
    assert!(line.ends_with("impacts.csv: line 2, column i: 'x' is not a finite number"), "{line}");
}

/// A table whose tangent has the opposite sense of the rotation: the effect finds it, the error falls to the noise, and only
/// this effect is selected. Every fold determines the sense.
#[test]
fn the_sense_of_the_tangential_arm_is_found() {
    let mut rows = ellipse("energetic", rough(0.5, 0.15), 60);
    rows.iter_mut().for_each(|row| row[9] = -row[9]);
    let found = compared(&rows, &CompareOptions { folds: 3, ..CompareOptions::default() });
    let arm = row(&found, "energetic", &["arm"]);
    let fitted = arm.coefficients.iter().find(|one| one.name == "arm").unwrap();
    // noise of 1 % in 40 impacts
    fitted.values.iter().for_each(|value| close("arm", *value, -1.0, 0.03));
    let by = arm.to_simpler.unwrap();
    assert!(by.mean < -2.0 * by.standard_error, "{by:?}");
    assert!(arm.error.estimate.mean < 0.1 * row(&found, "energetic", &[]).error.estimate.mean);
    // the bound is that of the geometry of the best model
    assert!(found.bound.unwrap().estimate.mean <= arm.error.estimate.mean + 1e-12);
    let selected = found.selected.unwrap();
    assert!(selected.models.iter().all(|model| model.ends_with(" + arm")), "{:?}", selected.models);
    assert!(selected.to_constant.mean < -2.0 * selected.to_constant.standard_error);
}

/// Impacts whose restitution falls with the power 1/4 of the approach speed: exponent and coefficient at 1 m/s are recovered,
/// and the constant law is worse by more than two standard errors.
#[test]
fn the_exponent_of_the_approach_speed_is_recovered() {
    let at = |speed: f64| law_by_name::<2>("poisson", rough(0.6 * speed.powf(-0.25), 0.2)).unwrap();
    let rows = ellipse_at(&at, 60);
    let found = compared(&rows, &CompareOptions { folds: 3, ..CompareOptions::default() });
    let own = row(&found, "poisson", &["arm", "speed"]);
    for (name, truth) in [("restitution", 0.6), ("friction", 0.2), ("arm", 1.0), ("speed_exponent", 0.25)] {
        let fitted = own.coefficients.iter().find(|one| one.name == name).unwrap();
        // noise of 1 % in 40 impacts at 0.2 to 3 m/s
        fitted.values.iter().for_each(|value| close(name, *value, truth, 0.04));
    }
    let by = own.to_simpler.unwrap();
    assert!(by.mean < -2.0 * by.standard_error, "{by:?}");
    let models = found.selected.unwrap().models;
    assert!(models.iter().all(|model| model.ends_with(" + arm + speed")), "{models:?}");
}
