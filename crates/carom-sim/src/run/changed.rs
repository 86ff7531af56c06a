//! The parameters by which a run is differentiated, and the runs beside it in which one of them is changed.

use super::run_state::Run;
use super::trajectory::{Sampling, Seen};
use crate::error::{SimError, named};
use crate::model::{Parameter, Place, Simulation};
use crate::motion::{ActiveSet, Kink};
use crate::state::Space;
use std::cell::OnceCell;

/// Step of the central differences of fourth order, relative to the size of the number that is changed: of events, and of forces and
/// places of contacts, whose error is then some 1e-11 of their size.
pub(crate) const DIFFERENCE: f64 = 1e-5;

/// How many times this step is shortened to a tenth, at most, where a kink of the forces is near: then it is the rounding of the number.
const SHORTER: usize = 9;

/// Longest step of these differences relative to the distance to the nearest kink.
pub(crate) const SHORT: f64 = 0.01;

/// The multiples of the step at which a function is evaluated, and the weights of the derivative.
pub(crate) const AT: [f64; 4] = [-2.0, -1.0, 1.0, 2.0];
pub(crate) const WEIGHTS: [f64; 4] = [1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0];

/// Where a derivative by a parameter is taken from: the multiples of the step, and their weights.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stencil {
    pub at: [f64; 4],
    pub weights: [f64; 4],
}

/// On both sides, of fourth order.
pub(crate) const CENTRAL: Stencil = Stencil { at: AT, weights: WEIGHTS };

/// At an end of a parameter's range: on the side of greater or of smaller numbers, of third order.
const ONE_SIDED: [Stencil; 2] = [
    Stencil { at: [0.0, 1.0, 2.0, 3.0], weights: [-11.0 / 6.0, 3.0, -1.5, 1.0 / 3.0] },
    Stencil { at: [0.0, -1.0, -2.0, -3.0], weights: [11.0 / 6.0, -3.0, 1.5, -1.0 / 3.0] },
];

impl Stencil {
    /// Whether it is on one side, from the place itself.
    pub fn is_one_sided(&self) -> bool {
        self.at[0] == 0.0
    }

    /// The place which is one step away.
    pub fn beside(&self) -> usize {
        self.at.iter().rposition(|times| times.abs() == 1.0).unwrap_or(0)
    }
}

/// What a run is made of: the simulation, its chain in the plane or in space, and q and qd of the start.
pub(crate) type Base<'a, A> = (&'a Simulation, &'a <A as Space>::Model, (&'a [f64], &'a [f64]));

/// The simulations with a parameter changed by multiples of a number, and their chains where they differ.
pub(crate) struct Four<A: Space> {
    stencil: Stencil,
    sims: [Simulation; 4],
    models: Option<[A::Model; 4]>,
}

/// These for each length of the step, once they are made.
pub(crate) type Others<A> = [OnceCell<Box<Four<A>>>; SHORTER + 1];

/// A parameter, and the runs in which it is changed, which are made when they are needed: its derivative may have closed forms.
pub(crate) struct Changed<'a, 'w, A: Space> {
    pub parameter: &'a Parameter,
    /// The number of which multiples are added to it.
    by: f64,
    /// The first and the last time at which it acts.
    span: [f64; 2],
    base: Base<'a, A>,
    /// The chain of a changed simulation.
    model: fn(&Simulation) -> Option<A::Model>,
    others: &'a Others<A>,
    runs: [Option<Box<[Run<'a, 'w, A>; 4]>>; SHORTER + 1],
}

impl<'a, 'w, A: Space> Changed<'a, 'w, A> {
    /// # Errors
    /// [`SimError::Setting`] for a parameter that changes the joints, the number of possible contacts or the plane.
    pub fn new(
        parameter: &'a Parameter,
        base: Base<'a, A>,
        model: fn(&Simulation) -> Option<A::Model>,
        others: &'a Others<A>,
    ) -> Result<Self, SimError> {
        let by = DIFFERENCE * parameter.scale();
        let span = match parameter.place() {
            Place::Motor { number, joint } => base.0.drive.span(number, &joint),
            _ => [f64::NEG_INFINITY, f64::INFINITY],
        };
        let mut changed = Self { parameter, by, span, base, model, others, runs: Default::default() };
        if matches!(parameter.place(), Place::Anywhere) {
            changed.runs_at(0)?;
        }
        Ok(changed)
    }

    /// Whether it acts between these times.
    pub fn acts(&self, from: f64, to: f64) -> bool {
        self.span[0] < to && from < self.span[1]
    }

    /// The runs, in any mode, with a step that is shortened so many times; their stencil, and the step.
    ///
    /// # Errors
    /// Those of the change and of the start of a run.
    pub fn runs_at(&mut self, shorter: usize) -> Result<(Stencil, f64, &mut [Run<'a, 'w, A>; 4]), SimError> {
        let (_, model, start) = self.base;
        let by = self.by * 0.1f64.powi(shorter as i32);
        let others = match self.others[shorter].get() {
            Some(others) => others,
            None => {
                let made = Box::new(self.change(by)?);
                self.others[shorter].get_or_init(|| made)
            }
        };
        let runs = &mut self.runs[shorter];
        if runs.is_none() {
            let [a, b, c, d] = others.sims.each_ref();
            let beside = |k: usize, other| {
                let model = others.models.as_ref().map_or(model, |models| &models[k]);
                Run::at_start(other, model, start, Sampling::default(), silent())
            };
            *runs = Some(Box::new([beside(0, a)?, beside(1, b)?, beside(2, c)?, beside(3, d)?]));
        }
        runs.as_deref_mut().map_or_else(|| unreachable!("the runs are made"), |runs| Ok((others.stencil, by, runs)))
    }

    fn change(&self, by: f64) -> Result<Four<A>, SimError> {
        let sim = self.base.0;
        let refused = |does: String| {
            let problem = format!("has no derivative: changed by {by:e} it {does}");
            named("parameter", self.parameter.name(), problem)
        };
        let changed = |stencil: Stencil| -> Result<_, SimError> {
            let [a, b, c, d] = stencil.at.map(|times| self.parameter.apply(sim, times * by));
            Ok((stencil, [a?, b?, c?, d?]))
        };
        let [ahead, behind] = ONE_SIDED;
        // Refused on all sides, the reason is that of the first.
        let (stencil, sims) =
            changed(CENTRAL).or_else(|why| changed(ahead).or_else(|_| changed(behind)).map_err(|_| why))?;
        let fits = |other: &Simulation| {
            let (own, chain) = (&sim.chain, &other.chain);
            (own.nq(), own.nv()) == (chain.nq(), chain.nv()) && other.touches.len() == sim.touches.len()
        };
        if let Some(other) = sims.iter().find(|other| !fits(other)) {
            let [own, other] = [sim, other].map(|sim| [sim.touches.len(), sim.chain.nv()]);
            return Err(refused(format!(
                "makes {} possible contacts of {} and {} velocities of {} ('carom plan' tells which; model = \"full\" keeps all)",
                other[0], own[0], other[1], own[1]
            )));
        }
        if sims.iter().all(|other| other.chain == sim.chain) {
            return Ok(Four { stencil, sims, models: None });
        }
        let mut models = sims.iter().map_while(self.model);
        let four = std::array::from_fn(|_| models.next());
        let [Some(a), Some(b), Some(c), Some(d)] = four else {
            return Err(refused(
                "takes the robot out of the plane in which it moves (model = \"full\" is in space)".into(),
            ));
        };
        Ok(Four { stencil, sims, models: Some([a, b, c, d]) })
    }

    /// Its runs in this mode, each with its weight in the derivative. `kinks`: those of the forces, of a run in this mode and here. The step is at most `SHORT` of what leads to the nearest.
    ///
    /// # Errors
    /// Those of [`Changed::runs_at`], and of `kinks`.
    pub fn runs_in(
        &mut self,
        active: &ActiveSet,
        (here, kinks): (&[Kink], impl Fn(&mut Run<'a, 'w, A>) -> Result<Vec<Kink>, SimError>),
    ) -> Result<impl Iterator<Item = (&mut Run<'a, 'w, A>, f64)>, SimError> {
        let mut shorter = 0;
        if !here.is_empty() {
            let (stencil, _, runs) = self.runs_at(0)?;
            let run = &mut runs[stencil.beside()];
            run.motion.active.clone_from(active);
            let steps = Kink::nearest(here, &kinks(run)?);
            shorter = ((SHORT * steps).log10().floor().min(0.0).abs() as usize).min(SHORTER);
        }
        let (stencil, by, runs) = self.runs_at(shorter)?;
        runs.iter_mut().for_each(|run| run.motion.active.clone_from(active));
        Ok(runs.iter_mut().zip(stencil.weights).map(move |(run, weight)| (run, weight / by)))
    }
}

/// A callback that does nothing; it has no size, so nothing is allocated.
pub(crate) fn silent<'w>() -> &'w mut dyn FnMut(Seen) {
    Box::leak(Box::new(|_: Seen| {}))
}
