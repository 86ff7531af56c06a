//! The protocol for tosses: coefficients are fitted to roll-outs from fitted starts, and judged on both parts of the tosses
//! from both starts.

use super::candidates::{Candidate, Effect, Parameter};
use super::cases::{TossCase, TossCases, TossStart};
use super::comparison::{CompareOptions, Comparison, Judged, Progress, centre, rows};
use super::data::{DataSet, too_few};
use super::identify::{Weakest, weakest};
use super::scenes::{effects, rule, scene};
use super::search::{Residuals, Trial, descend};
use super::selection::chosen;
use super::statistics::{Spread, folds};
use crate::EvidenceError;
use carom_chain::urdf::Robot;
use carom_sim::{Moment, SimError};
use carom_study::fit::shuffled;
use carom_study::tosses::{GRAVITY, Horizon, Launch, PoseError, RollOutOptions, Scene, Start, Toss, Tosses};
use nalgebra::DVector;
use rayon::prelude::*;
use std::cell::RefCell;
use std::collections::HashMap;

/// The tosses that are compared, with both starts.
struct Work<'a> {
    tosses: &'a Tosses,
    robot: &'a Robot,
    options: &'a CompareOptions,
    kept: Vec<Kept<'a>>,
    fold_of: Vec<usize>,
    /// Indices of the tosses to which coefficients are fitted.
    fitted: Vec<usize>,
}

struct Kept<'a> {
    toss: &'a Toss,
    given: Launch,
    launch: Launch,
}

/// The tosses of a set as [`compare`] uses them.
pub(super) fn export(
    set: &DataSet,
    tosses: &Tosses,
    robot: &Robot,
    options: &CompareOptions,
) -> Result<TossCases, EvidenceError> {
    let work = Work::new(&set.name, tosses, robot, options)?;
    let case = |(k, kept): (usize, &Kept<'_>)| {
        let Kept { toss, given, launch } = kept;
        let samples = &toss.samples[launch.sample..];
        let start = |launch: &Launch| TossStart { q: launch.q.clone(), qd: launch.qd.clone() };
        TossCase {
            number: toss.number,
            fold: work.fold_of[k],
            fitted: work.fitted.contains(&k),
            fitted_start: start(launch),
            given_start: start(given),
            times: samples.iter().map(|sample| sample.time - samples[0].time).collect(),
            poses: samples.iter().map(|sample| sample.q.clone()).collect(),
            early: launch.end(toss, Horizon::Early).map_or(0, |end| end - launch.sample),
        }
    };
    Ok(TossCases {
        set: set.name.clone(),
        urdf: tosses.urdf.clone(),
        gravity: GRAVITY.into(),
        folds: options.folds,
        seed: options.seed,
        trials: options.trials,
        horizon: options.horizon.name(),
        length: options.length,
        max_friction: options.max_friction,
        cases: work.kept.iter().enumerate().map(case).collect(),
    })
}

pub(super) fn compare(
    set: &DataSet,
    tosses: &Tosses,
    robot: &Robot,
    options: &CompareOptions,
    progress: Progress<'_>,
) -> Result<Vec<Comparison>, EvidenceError> {
    let work = Work::new(&set.name, tosses, robot, options)?;
    let candidates = Candidate::all_for_tosses();
    let effects = effects(robot);
    let all = candidates.len() + effects.len() + 1;
    let mut judged: Vec<[Judged; 4]> = Vec::new();
    for (k, candidate) in candidates.into_iter().enumerate() {
        progress(k, all);
        let four = work.judge(candidate, None);
        // a law that the simulation refuses for every toss has no error and no rank
        if predicts(&four) {
            judged.push(four);
        }
    }
    if judged.is_empty() {
        let (found, needed) = (0, 2 * options.folds);
        return Err(too_few(&set.name, found, needed, options.folds));
    }
    // the effects are added to the law with the least training error
    let training = |one: &[Judged; 4]| one[0].training.iter().flatten().sum::<f64>();
    let mut last =
        (0..judged.len()).min_by(|a, b| training(&judged[*a]).total_cmp(&training(&judged[*b]))).unwrap_or(0);
    for effect in effects {
        progress(judged.len(), all);
        let next = work.judge(judged[last][0].candidate.with(effect), Some(&judged[last][0]));
        if predicts(&next) {
            last = judged.len();
            judged.push(next);
        }
    }
    progress(all - 1, all);
    let best = judged.iter().min_by(|a, b| mean(&a[0].errors).total_cmp(&mean(&b[0].errors)));
    let floors = best.map(|best| work.floors(&best[0]));
    let weakest = best.and_then(|best| work.weakest(&best[0]));
    let mut parts: [Vec<Judged>; 4] = Default::default();
    for four in judged {
        for (part, one) in parts.iter_mut().zip(four) {
            if !one.errors.is_empty() {
                part.push(one);
            }
        }
    }
    progress(all, all);
    let what = ["to 0.1 s after the first impact", "whole toss"];
    let start = ["start fitted to the flight", "start given by the table"];
    let comparison = |(k, judged): (usize, Vec<Judged>)| Comparison {
        set: set.name.clone(),
        what: format!("{}, {}", what[k % 2], start[k / 2]),
        measure: format!("mean |Δp|²/L + mean Δθ² over the samples, L = {} m", options.length),
        numbers: work.kept.iter().map(|kept| kept.toss.number).collect(),
        folds: work.fold_of.clone(),
        left_out: tosses.tosses.len() - work.kept.len(),
        selected: chosen(&judged, &work.fold_of),
        rows: rows(judged, true, k % 2 == 1),
        bound: None,
        weakest: weakest.clone().filter(|_| k == 0),
        floor: floors.as_ref().map(|floors| Spread::of(&floors[k])),
    };
    let parts = parts.into_iter().enumerate().filter(|(_, judged)| !judged.is_empty());
    Ok(parts.map(comparison).collect())
}

/// Whether the model predicts any toss.
fn predicts(four: &[Judged; 4]) -> bool {
    four[0].errors.iter().any(|error| error.is_finite())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

impl<'a> Work<'a> {
    /// The tosses that have both starts and an impact, and those to which parameters are fitted.
    fn new(
        set: &str,
        tosses: &'a Tosses,
        robot: &'a Robot,
        options: &'a CompareOptions,
    ) -> Result<Self, EvidenceError> {
        let launches = tosses.launches(Start::Fitted).into_iter().zip(tosses.launches(Start::Given));
        let mut kept = Vec::new();
        for (toss, both) in tosses.tosses.iter().zip(launches) {
            let (Ok(launch), Ok(given)) = both else { continue };
            if launch.end(toss, Horizon::Early).is_some() {
                kept.push(Kept { toss, given, launch });
            }
        }
        let (found, needed) = (kept.len(), 2 * options.folds);
        if found < needed {
            return Err(too_few(set, found, needed, options.folds));
        }
        let fold_of = folds(found, options.folds, options.seed);
        // at least two of each fold, so that every fold leaves some to fit
        let fitted: Vec<usize> = shuffled(found, options.seed).into_iter().take(options.tosses.max(needed)).collect();
        Ok(Self { tosses, robot, options, kept, fold_of, fitted })
    }

    fn roll(&self, candidate: &Candidate) -> RollOutOptions {
        let CompareOptions { tolerance, contact_step, length, horizon, .. } = *self.options;
        let (start, several) = (Start::Fitted, candidate.several);
        RollOutOptions { tolerance, contact_step, length, start, horizon, several }
    }

    fn scene(&self, candidate: &Candidate, x: &[f64]) -> Scene {
        scene(self.robot, &self.tosses.chain, candidate, x)
    }

    /// The fitted starts of tosses for the parameters `x`: fitted again if the flight depends on them.
    fn launches(&self, candidate: &Candidate, x: &[f64], scene: &Scene, of: &[usize]) -> Vec<Launch> {
        let moves = flight(candidate, x).iter().any(|(parameter, x)| *x != parameter.nominal());
        let one = |&k: &usize| {
            let Kept { toss, launch, .. } = &self.kept[k];
            if moves { launch.refitted(&scene.chain, toss) } else { launch.clone() }
        };
        of.par_iter().map(one).collect()
    }

    /// Parameters for each fold, fitted without it, and the errors to which they were fitted. A model with effects starts from
    /// the model without the last one.
    fn fit(&self, candidate: &Candidate, simpler: Option<&Judged>) -> Vec<Trial> {
        let region = candidate.region(self.options.max_friction);
        let roll = self.roll(candidate);
        let seen: RefCell<Vec<Seen>> = RefCell::default();
        let starts: RefCell<Vec<Starts>> = RefCell::default();
        // Folds share the roll-outs at the same point.
        let residuals = |x: &[f64], of: &[usize]| -> Residuals {
            let at = place(&mut seen.borrow_mut(), x.to_vec());
            let from = place(&mut starts.borrow_mut(), flight(candidate, x));
            let new: Vec<usize> = of.iter().copied().filter(|k| !seen.borrow()[at].1.contains_key(k)).collect();
            let (rule, scene) = (rule(candidate, x), self.scene(candidate, x));
            let unknown: Vec<usize> =
                new.iter().copied().filter(|k| !starts.borrow()[from].1.contains_key(k)).collect();
            let launches = self.launches(candidate, x, &scene, &unknown);
            starts.borrow_mut()[from].1.extend(unknown.into_iter().zip(launches));
            let launches = &starts.borrow()[from].1;
            let one = |k: &usize| {
                let residual = launches[k].residual(&scene, self.kept[*k].toss, &rule, &roll);
                (*k, residual.ok().map(DVector::from_vec))
            };
            let rolled: Vec<_> = new.par_iter().map(one).collect();
            let known = &mut seen.borrow_mut()[at].1;
            known.extend(rolled);
            of.iter().map(|k| known[k].clone()).collect()
        };
        let in_fold = |fold: usize| {
            let outside: Vec<usize> = self.fitted.iter().copied().filter(|k| self.fold_of[*k] != fold).collect();
            let begin = match simpler {
                Some(simpler) => {
                    let x = candidate.nominal(&simpler.candidate, &simpler.coefficients[fold]);
                    candidate.starts(x)
                }
                None => region.points(),
            };
            // the standard deviation of errors is one of a grid; the other parameters keep their optimum
            let sought = candidate.effects.last() != Some(&Effect::Errors);
            let budget = if sought { (self.options.trials + 1).saturating_sub(begin.len()) } else { 0 };
            descend(&region, begin, budget, &|x| residuals(x, &outside))
        };
        (0..self.options.folds).filter_map(in_fold).collect()
    }

    /// The errors of all tosses by the parameters that were fitted without their fold: early and whole from the fitted start,
    /// early and whole from the given one. Models with effects are not judged from the given start, whose error hides them: they
    /// have no errors there.
    fn judge(&self, candidate: Candidate, simpler: Option<&Judged>) -> [Judged; 4] {
        let (coefficients, training): (Vec<Vec<f64>>, Vec<Vec<f64>>) =
            self.fit(&candidate, simpler).into_iter().map(|trial| (trial.x, trial.errors)).unzip();
        let roll = self.roll(&candidate);
        let mut all: Vec<Vec<Option<f64>>> = vec![Vec::new(); self.kept.len()];
        for (fold, x) in coefficients.iter().enumerate() {
            let (rule, scene) = (rule(&candidate, x), self.scene(&candidate, x));
            let held: Vec<usize> = (0..self.kept.len()).filter(|k| self.fold_of[*k] == fold).collect();
            let launches = self.launches(&candidate, x, &scene, &held);
            let one = |(&k, launch): (&usize, &Launch)| {
                let Kept { toss, given, .. } = &self.kept[k];
                let judged = self.options.judged;
                let errors = |launch: &Launch| {
                    let rolled = launch.roll_out(&scene, toss, &rule, &roll, judged);
                    let of = |horizon| match &rolled {
                        Ok(rolled) => rolled.error(horizon, roll.length).unwrap_or(f64::INFINITY),
                        Err(_) => f64::INFINITY,
                    };
                    [Some(of(Horizon::Early)), (judged == Horizon::Whole).then(|| of(Horizon::Whole))]
                };
                let other = if candidate.effects.is_empty() { errors(given) } else { [None; 2] };
                let all = [errors(launch), other].concat();
                (k, all)
            };
            let judged: Vec<(usize, Vec<Option<f64>>)> = held.par_iter().zip(&launches).map(one).collect();
            for (k, errors) in judged {
                all[k] = errors;
            }
        }
        [0, 1, 2, 3].map(|part| Judged {
            candidate: candidate.clone(),
            coefficients: coefficients.clone(),
            training: training.clone(),
            errors: all.iter().filter_map(|errors| errors[part]).collect(),
        })
    }

    /// The combination of a model's parameters that the fitted tosses determine least.
    fn weakest(&self, best: &Judged) -> Option<Weakest> {
        let (model, roll) = (&best.candidate, self.roll(&best.candidate));
        let residuals = |x: &[f64]| -> Residuals {
            let (rule, scene) = (rule(model, x), self.scene(model, x));
            let launches = self.launches(model, x, &scene, &self.fitted);
            let one = |(&k, launch): (&usize, &Launch)| {
                let residual = launch.residual(&scene, self.kept[k].toss, &rule, &roll);
                residual.ok().map(DVector::from_vec)
            };
            self.fitted.par_iter().zip(&launches).map(one).collect()
        };
        weakest(model, &model.region(self.options.max_friction), &centre(&best.coefficients), &residuals)
    }

    /// The error of a law against itself: from a start drawn from the estimate instead of the estimate, and from the given
    /// start instead of the fitted one; early and whole. Only tosses whose start was fitted.
    fn floors(&self, best: &Judged) -> [Vec<f64>; 4] {
        let roll = self.roll(&best.candidate);
        let one = |k: usize| -> Option<Vec<f64>> {
            let Kept { toss, given, .. } = &self.kept[k];
            let x = &best.coefficients[self.fold_of[k]];
            let (rule, scene) = (rule(&best.candidate, x), self.scene(&best.candidate, x));
            let launch = self.launches(&best.candidate, x, &scene, &[k]).pop()?;
            let state = &launch.fitted.as_ref()?.state;
            let mut rng = fastrand::Rng::with_seed(self.options.seed.wrapping_add(k as u64));
            let (q, qd) = state.drawn(&scene.chain, &mut || normal(&mut rng)).ok()?;
            let drawn = Launch { q, qd, ..launch.clone() };
            let last = launch.end(toss, self.options.judged)?;
            let simulated = |launch: &Launch| -> Result<Vec<Moment>, SimError> {
                Ok(launch.simulate(&scene, toss, last, &rule, &roll)?.0)
            };
            let truth = simulated(&launch).ok()?;
            let early = launch.end(toss, Horizon::Early)? - launch.sample;
            let mut errors = Vec::new();
            for other in [&drawn, given] {
                let other = simulated(other).ok()?;
                let apart: Vec<PoseError> = other.iter().zip(&truth).map(|(a, b)| PoseError::between(a, b)).collect();
                for end in [early, apart.len() - 1] {
                    errors.push(PoseError::mean(&apart[..=end], |x| x * x).measure(roll.length));
                }
            }
            Some(errors)
        };
        let all: Vec<Vec<f64>> = (0..self.kept.len()).into_par_iter().filter_map(one).collect();
        [0, 1, 2, 3].map(|part| all.iter().map(|errors| errors[part]).collect())
    }
}

/// The residuals of tosses, by their indices, at parameters.
type Seen = (Vec<f64>, HashMap<usize, Option<DVector<f64>>>);

/// The starts of tosses, by their indices, for parameters of [`flight`].
type Starts = (Vec<(Parameter, f64)>, HashMap<usize, Launch>);

/// The place of a key in a list, with a new map if it is new.
fn place<K: PartialEq, V>(list: &mut Vec<(K, HashMap<usize, V>)>, key: K) -> usize {
    list.iter().position(|(other, _)| *other == key).unwrap_or_else(|| {
        list.push((key, HashMap::new()));
        list.len() - 1
    })
}

/// The parameters on which the flight before the first impact depends, with their values.
fn flight(candidate: &Candidate, x: &[f64]) -> Vec<(Parameter, f64)> {
    let all = candidate.parameters.iter().copied().zip(x.iter().copied());
    all.filter(|(parameter, _)| parameter.moves_flight()).collect()
}

/// A standard normal number (G. E. P. Box, M. E. Muller 1958).
fn normal(rng: &mut fastrand::Rng) -> f64 {
    let (a, b) = (1.0 - rng.f64(), rng.f64());
    (-2.0 * a.ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

#[cfg(test)]
mod tests {
    use super::super::candidates::Effect;
    use super::super::tests::thrown::rolled;
    use super::*;
    use carom_chain::Chain;
    use carom_chain::urdf::{LoadOptions, read_str};
    use nalgebra::UnitQuaternion;

    /// A body of moments of inertia that are multiples of 7e-4 kg m².
    fn urdf(shapes: &str, multiples: [f64; 3]) -> String {
        let [x, y, z] = multiples.map(|multiple| 7e-4 * multiple);
        format!(
            "<robot name='b'><link name='b'><inertial><mass value='0.4'/><inertia ixx='{x}' iyy='{y}' izz='{z}' ixy='0' \
             ixz='0' iyz='0'/></inertial>{shapes}</link></robot>"
        )
    }

    /// A cube of 0.1 m with corners of a radius, from spheres.
    fn round(radius: f64, multiples: [f64; 3]) -> String {
        let inset = 0.05 - radius;
        let sphere = |k: usize| {
            let [x, y, z] = [0, 1, 2].map(|bit| if k >> bit & 1 == 1 { inset } else { -inset });
            format!(
                "<collision><origin xyz='{x} {y} {z}'/><geometry><sphere radius='{radius}'/></geometry></collision>"
            )
        };
        urdf(&(0..8).map(sphere).collect::<String>(), multiples)
    }

    fn floating() -> LoadOptions {
        LoadOptions { floating_base: true, ..LoadOptions::default() }
    }

    /// Tosses computed without the code of the comparison.
    fn thrown(chain: &Chain, count: i64) -> Vec<Toss> {
        let mut rng = fastrand::Rng::with_seed(3);
        let law = carom_impact::Energetic { restitution: 0.4, friction: 0.2 };
        let one = |number| {
            let mut wide = |size: f64| size * (2.0 * rng.f64() - 1.0);
            let turn = UnitQuaternion::from_euler_angles(wide(3.0), wide(1.5), wide(3.0));
            let q = [0.0, 0.0, 0.15, turn.i, turn.j, turn.k, turn.w];
            let qd = [wide(0.5), wide(0.5), wide(0.3), wide(5.0), wide(5.0), wide(5.0)];
            Toss { number, samples: rolled(chain, law, &q, &qd, 0.01, 0.28) }
        };
        (0..count).map(one).collect()
    }

    /// Tosses of a cube with rounded corners and unequal moments of inertia, judged with the sharp cube of the URDF, whose moments
    /// are equal: each effect lowers the held-out error by more than two standard errors, and the search recovers the
    /// coefficients of the law, the radius and the second moments of mass of each fold.
    #[test]
    fn the_parameters_of_synthetic_tosses_are_recovered() {
        let (radius, multiples) = (0.008, [1.2, 0.9, 1.1]);
        let tosses = thrown(&Chain::from_urdf_str(&round(radius, multiples), &floating()).unwrap(), 24);
        let cube = urdf("<collision><geometry><box size='0.1 0.1 0.1'/></geometry></collision>", [1.0; 3]);
        let (chain, robot) =
            (Chain::from_urdf_str(&cube, &floating()).unwrap(), read_str(&cube, None, &floating()).unwrap());
        let tosses = Tosses { chain, urdf: Default::default(), tosses };
        let options = CompareOptions { folds: 2, trials: 60, tosses: 24, max_friction: 0.5, ..Default::default() };
        let work = Work::new("cube", &tosses, &robot, &options).unwrap();
        let stronge = Candidate::all().into_iter().find(|one| one.law == "energetic").unwrap();
        let [sharp, ..] = work.judge(stronge.clone(), None);
        let [rounded, ..] = work.judge(stronge.with(Effect::Corners), Some(&sharp));
        let [full, ..] = work.judge(rounded.candidate.with(Effect::Inertia), Some(&rounded));
        for (more, less) in [(&rounded, &sharp), (&full, &rounded)] {
            let by = super::super::statistics::Estimate::of_pairs(&more.errors, &less.errors);
            assert!(by.mean < -2.0 * by.standard_error, "{by:?}");
        }
        // the starts are fitted to samples at the tolerance of the simulation; the search ends with a gain below 0.2 %
        let truth = [0.4, 0.2, radius, 0.0, multiples[0], multiples[1], multiples[2]];
        let tolerance = [0.01, 0.01, 5e-4, 1e-3, 0.02, 0.02, 0.02];
        for x in &full.coefficients {
            // each moment of inertia is the sum of the second moments along the other axes, which are equal for the cube
            let [.., x_x, y_y, z_z] = x[..] else { panic!("{x:?}") };
            let x = [&x[..4], &[0.5 * (y_y + z_z), 0.5 * (x_x + z_z), 0.5 * (x_x + y_y)]].concat();
            let near = x.iter().zip(truth).zip(tolerance).all(|((x, truth), tolerance)| (x - truth).abs() < tolerance);
            assert!(near, "{:?}", full.coefficients);
        }
        // the energetic law of several contacts refuses friction, and with it every toss of a body of several corners
        let energetic = Candidate::all_for_tosses().into_iter().find(|one| one.several.name() == "energetic").unwrap();
        assert!(!predicts(&work.judge(energetic, None)) && predicts(&work.judge(stronge.clone(), None)));
        // an effect at its nominal values is absent
        let none = rounded.candidate.nominal(&stronge, &sharp.coefficients[0]);
        let gap = work.scene(&rounded.candidate, &none).chain;
        assert_eq!(gap.links()[0].collisions, tosses.chain.links()[0].collisions);
    }
}
