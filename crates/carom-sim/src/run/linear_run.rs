//! A run as a linear map from changes of its start and parameters to those of its outcome, and its transpose.

use super::trajectory::{Event, Step};
use super::variation::{Gauss, LinearStep};
use crate::error::{SimError, require};
use crate::state::Moment;
use nalgebra::{DMatrix, DVector, DVectorViewMut};
use serde::Serialize;

/// One of the linear maps of which the derivative of a run is the product.
pub(crate) enum Piece {
    /// From a change of the start (displacement and velocity) to that of x.
    Start(DMatrix<f64>),
    Step(LinearStep),
    Event(LinearEvent),
}

/// An event, linearised.
pub(crate) struct LinearEvent {
    pub time: f64,
    /// What happens, first one first.
    pub happened: Vec<Event>,
    /// The states just before and after it; `None` without a name, or where time passes in it.
    pub around: Option<Box<Around>>,
    /// Ξ.
    pub map: DMatrix<f64>,
    /// What the parameters add.
    pub push: DMatrix<f64>,
    /// τ′ by x, and by the parameters.
    pub time_by: DVector<f64>,
    pub time_push: DVector<f64>,
    /// Whether the digits of τ′ count.
    pub counts: bool,
}

/// A jump of forces at a time that parameters change.
pub(crate) struct MovedKink {
    /// The derivatives of the time.
    pub by: DVector<f64>,
    /// ẋ just before.
    pub before: DVector<f64>,
}

/// The states just before and after an event, each at its own time: displacement and velocity by x before the event, and by the
/// parameters.
pub(crate) struct Around {
    pub before: [DMatrix<f64>; 2],
    pub after: [DMatrix<f64>; 2],
}

impl LinearEvent {
    /// One that changes nothing, of x with n numbers and of this number of parameters.
    pub fn nothing(time: f64, n: usize, parameters: usize) -> Self {
        Self {
            time,
            happened: Vec::new(),
            around: None,
            map: DMatrix::identity(n, n),
            push: DMatrix::zeros(n, parameters),
            time_by: DVector::zeros(n),
            time_push: DVector::zeros(parameters),
            counts: true,
        }
    }

    /// Adds that parameters change its time, before which x has another rate than after it: δx⁺ = Ξ (δx⁻ + f⁻ δt) − f⁺ δt.
    pub fn later(&mut self, MovedKink { by, before }: &MovedKink, after: DVector<f64>) {
        self.push += (&self.map * before - after) * by.transpose();
        self.time_push += by;
    }

    /// Adds the derivatives of a number by the time of the event and by the states at it to those by x before it and by the parameters.
    fn add(
        &self,
        (lambda, gradient): (&mut DVectorViewMut<f64>, &mut DVectorViewMut<f64>),
        index: usize,
        by: &ByOutcome,
    ) -> Result<(), SimError> {
        let slow = || self.none("it is too slow for digits of the derivative of its time that count");
        for (_, weight) in by.times.iter().filter(|(k, _)| *k == index) {
            if !self.counts {
                return Err(slow());
            }
            gradient.axpy(*weight, &self.time_push, 1.0);
            lambda.axpy(*weight, &self.time_by, 1.0);
        }
        for (states, is_after) in [(&by.before, false), (&by.after, true)] {
            for (_, weights) in states.iter().filter(|(k, _)| *k == index) {
                let around = self.around.as_ref().ok_or_else(|| self.none("it ends an accumulation of impacts"))?;
                if !self.counts {
                    return Err(slow());
                }
                let [by_x, by_parameters] = if is_after { &around.after } else { &around.before };
                let weights = DVector::from_column_slice(weights);
                lambda.gemv_tr(1.0, by_x, &weights, 1.0);
                gradient.gemv_tr(1.0, by_parameters, &weights, 1.0);
            }
        }
        Ok(())
    }

    fn none(&self, reason: &str) -> SimError {
        SimError::NoDerivative { time: self.time, reason: reason.to_owned() }
    }

    fn kinds(&self) -> Vec<&'static str> {
        self.happened.iter().map(|event| event.kind.name()).collect()
    }
}

/// The time of an event, and its derivatives. Serde leaves out derivatives whose digits do not count.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EventTime {
    /// Time, s.
    pub time: f64,
    /// Names of what happens ([`EventKind::name`](crate::EventKind::name)).
    pub kinds: Vec<&'static str>,
    /// Derivatives by the columns of [`Sensitivity`](super::Sensitivity); not numbers for impacts so slow that their digits do not count: the last ones before
    /// an accumulation. Their effect on the motion is part of the other derivatives all the same.
    #[serde(skip_serializing_if = "uncounted")]
    pub time_by: Vec<f64>,
}

fn uncounted(numbers: &[f64]) -> bool {
    !numbers.iter().all(|x| x.is_finite())
}

/// Computes matrices of directions.
pub(crate) type Tangents<'a> = &'a mut dyn FnMut() -> Result<Vec<DMatrix<f64>>, SimError>;

/// What is done with the linear maps of a run, first one first.
pub(crate) trait Maps {
    /// `None` where the equations of the map are singular.
    fn add(&mut self, piece: Piece) -> Option<()>;
    /// The step of the motion whose map follows, which has so many impacts before it. `tangents` computes the directions in which x can change at
    /// its start and at its points, n×k each: with contacts and loops closed.
    ///
    /// # Errors
    /// Those of `tangents`.
    fn step(&mut self, _step: &Step, _impacts: usize, _tangents: Tangents) -> Result<(), SimError> {
        Ok(())
    }
    /// S up to now.
    fn columns(&mut self) -> Option<DMatrix<f64>>;
}

/// S, of which all columns are carried on.
pub(crate) struct AllColumns {
    gauss: Gauss,
    /// The changes of the parameters that belong to the columns.
    changes: DMatrix<f64>,
    pub s: DMatrix<f64>,
    pub events: Vec<EventTime>,
}

impl AllColumns {
    /// Of the derivatives by a start of `moving` numbers and by parameters.
    pub fn new(moving: usize, parameters: usize) -> Self {
        let columns = moving + parameters;
        Self::of(DMatrix::from_fn(parameters, columns, |i, j| if i + moving == j { 1.0 } else { 0.0 }))
    }

    /// Of these changes of the parameters.
    fn of(changes: DMatrix<f64>) -> Self {
        Self { gauss: Gauss::new(), s: DMatrix::zeros(0, changes.ncols()), changes, events: Vec::new() }
    }

    /// S after another map.
    pub fn pass(&mut self, piece: &Piece) -> Option<()> {
        match piece {
            Piece::Start(start) => {
                self.s = DMatrix::zeros(start.nrows(), self.changes.ncols());
                self.s.columns_mut(0, start.ncols()).copy_from(start);
            }
            Piece::Step(step) => self.s = step.forward(&self.gauss, &self.s, &self.changes)?,
            Piece::Event(event) => {
                let time_by = self.s.tr_mul(&event.time_by) + self.changes.tr_mul(&event.time_push);
                let mut time_by = time_by.as_slice().to_vec();
                self.s = &event.map * &self.s + &event.push * &self.changes;
                if !event.counts {
                    time_by.fill(f64::NAN);
                }
                if !event.happened.is_empty() {
                    self.events.push(EventTime { time: event.time, kinds: event.kinds(), time_by });
                }
            }
        }
        Some(())
    }
}

impl Maps for AllColumns {
    fn add(&mut self, piece: Piece) -> Option<()> {
        self.pass(&piece)
    }

    fn columns(&mut self) -> Option<DMatrix<f64>> {
        Some(self.s.clone())
    }
}

/// The linear maps of a run, and S after the first `done` of them.
pub(crate) struct Pieces {
    pieces: Vec<Piece>,
    /// The numbers of the start and of the parameters.
    sizes: (usize, usize),
    all: Option<AllColumns>,
    done: usize,
}

impl Pieces {
    /// Of the derivatives by a start of `moving` numbers and by parameters.
    pub fn new(moving: usize, parameters: usize) -> Self {
        Self { pieces: Vec::new(), sizes: (moving, parameters), all: None, done: 0 }
    }
}

impl Maps for Pieces {
    fn add(&mut self, piece: Piece) -> Option<()> {
        self.pieces.push(piece);
        Some(())
    }

    fn columns(&mut self) -> Option<DMatrix<f64>> {
        let (moving, parameters) = self.sizes;
        let all = self.all.get_or_insert_with(|| AllColumns::new(moving, parameters));
        self.pieces[self.done..].iter().try_for_each(|piece| all.pass(piece))?;
        self.done = self.pieces.len();
        all.columns()
    }
}

/// A run as a linear map: a first-order change of the start and of parameters changes the final state and the times of the events by
/// [`LinearRun::jvp`]; the derivatives of a number by the final state and the times become those by the start and the parameters by
/// [`LinearRun::vjp`] (the discrete adjoint; Hairer, Nørsett & Wanner 1993, section II.6). [`Plan::linear_run`](crate::Plan::linear_run)
/// makes one. Most of the cost is that of making it, which grows with the number of parameters.
///
/// ```
/// # use carom_sim::{Parameter, Scene};
/// # let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/planar2.toml");
/// let plan = Scene::from_file(file)?.plan()?;
/// let run = plan.linear_run(0.5, &Parameter::all(&plan.simulation))?;
/// // The gradient of the final angle of the shoulder, which is the first of the displacements.
/// let gradient = run.vjp(&[1.0, 0.0, 0.0, 0.0], &[])?;
/// assert_eq!(gradient.len(), run.names().len());
/// # Ok::<(), carom_sim::SimError>(())
/// ```
pub struct LinearRun {
    names: Vec<String>,
    parameters: usize,
    last: Moment,
    rate: Vec<f64>,
    pieces: Vec<Piece>,
    tangent: DMatrix<f64>,
    gauss: Gauss,
}

/// The derivatives of a number by the outcome of a run.
#[derive(Debug, Clone, Default)]
pub struct ByOutcome {
    /// By the final displacement and velocity, 2 nv numbers.
    pub last: Vec<f64>,
    /// By the times of events: the index of each among those of [`LinearRun::events`], and the derivative.
    pub times: Vec<(usize, f64)>,
    /// By the states just before and just after events, each at the time of its event: index, and 2 nv numbers.
    pub before: Vec<(usize, Vec<f64>)>,
    /// See `before`.
    pub after: Vec<(usize, Vec<f64>)>,
    /// By the states at the points of quadrature of the motion, 2 nv numbers each, as [`LinearRun::integral`] makes them; or none.
    pub along: Vec<Vec<f64>>,
}

impl LinearRun {
    /// `rate`, `tangent`: the rate of the final displacement and velocity, and the map to them from x.
    pub(super) fn new(
        (names, parameters): (Vec<String>, usize),
        (last, rate, tangent): (Moment, Vec<f64>, DMatrix<f64>),
        pieces: Pieces,
    ) -> Self {
        Self { names, parameters, last, rate, pieces: pieces.pieces, tangent, gauss: Gauss::new() }
    }

    /// The names of the numbers by which the run is differentiated: as those of the columns of a [`Sensitivity`](super::Sensitivity).
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The state at the end.
    pub fn last(&self) -> &Moment {
        &self.last
    }

    /// The rate of the final displacement and velocity: as [`Sensitivity::rate`](super::Sensitivity::rate).
    pub fn rate(&self) -> &[f64] {
        &self.rate
    }

    /// The times of the events, s, each with the names of what happens.
    pub fn events(&self) -> impl Iterator<Item = (f64, Vec<&'static str>)> {
        self.told().map(|event| (event.time, event.kinds()))
    }

    /// What happens at each of the [`events`](Self::events), with the states before and after it.
    pub fn happened(&self) -> impl Iterator<Item = &[Event]> {
        self.told().map(|event| event.happened.as_slice())
    }

    /// ∫ g dt over the run, and its derivatives by the outcome. `of` returns g and its derivatives by displacement and velocity (2 nv numbers)
    /// at a time (s), with a weight (s) in the sum that is the integral, and at a state (q, q̇). Over each step of the motion it is Gauss's
    /// quadrature of order 8; at an event whose time τ changes, the integral changes by (g⁻ − g⁺) dτ. The tolerance controls the error of
    /// the motion, not that of the quadrature, which over long steps is the larger one: about 1e-6 of an integral of squares.
    ///
    /// ```
    /// # use carom_sim::Scene;
    /// # let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenes/planar2.toml");
    /// // The integral of the first velocity is the change of the first angle.
    /// let plan = Scene::from_file(file)?.plan()?;
    /// let run = plan.linear_run(0.5, &[])?;
    /// let (sum, by) = run.integral(|_, _, state| Ok((state[2], vec![0.0, 0.0, 1.0, 0.0])))?;
    /// assert!((sum - (run.last().q[0] - plan.q[0])).abs() < 1e-9);
    /// // Its derivative by the angle at the start is that of the final angle, less one.
    /// assert!((run.gradient(&by)?[0] - (run.vjp(&[1.0, 0.0, 0.0, 0.0], &[])?[0] - 1.0)).abs() < 1e-9);
    /// # Ok::<(), carom_sim::SimError>(())
    /// ```
    ///
    /// # Errors
    /// That of `of`; [`SimError::NoDerivative`] for an accumulation of impacts, which is not integrated over.
    pub fn integral(
        &self,
        mut of: impl FnMut(f64, f64, &[f64]) -> Result<(f64, Vec<f64>), SimError>,
    ) -> Result<(f64, ByOutcome), SimError> {
        let (mut sum, mut index) = (0.0, 0);
        let mut by = ByOutcome { last: vec![0.0; self.tangent.nrows()], ..ByOutcome::default() };
        for piece in &self.pieces {
            match piece {
                Piece::Start(_) => {}
                Piece::Step(step) => {
                    for (time, weight, state) in step.quadrature() {
                        let (value, mut slope) = of(time, weight, state)?;
                        sum += weight * value;
                        slope.iter_mut().for_each(|x| *x *= weight);
                        by.along.push(slope);
                    }
                }
                Piece::Event(event) => {
                    let [Some(first), Some(last)] = [event.happened.first(), event.happened.last()] else { continue };
                    if event.around.is_none() {
                        return Err(event.none("it ends an accumulation of impacts, over which nothing is integrated"));
                    }
                    let mut at = |qd: &[f64]| of(event.time, 0.0, &[&first.q, qd].concat());
                    let jump = at(&first.qd_minus)?.0 - at(&last.qd_plus)?.0;
                    if jump != 0.0 {
                        by.times.push((index, jump));
                    }
                    index += 1;
                }
            }
        }
        Ok((sum, by))
    }

    fn told(&self) -> impl Iterator<Item = &LinearEvent> {
        self.pieces.iter().filter_map(|piece| match piece {
            Piece::Event(event) if !event.happened.is_empty() => Some(event),
            _ => None,
        })
    }

    /// The change of the final displacement and velocity (2 nv numbers, as the rows of [`Sensitivity::last_by`](super::Sensitivity::last_by)),
    /// and those of the times of the events, by a change of the start and the parameters (one for each of [`names`](Self::names)). Those of
    /// events whose digits do not count are not numbers.
    ///
    /// # Errors
    /// [`SimError::Setting`] for a wrong number of changes.
    pub fn jvp(&self, change: &[f64]) -> Result<(Vec<f64>, Vec<f64>), SimError> {
        self.check("number of changes of the start and the parameters", change.len(), self.names.len())?;
        let moving = self.names.len() - self.parameters;
        let change = DMatrix::from_column_slice(change.len(), 1, change);
        let mut all = AllColumns::of(change.rows(moving, self.parameters).into_owned());
        for piece in &self.pieces {
            match piece {
                Piece::Start(start) => all.s = start * change.rows(0, moving),
                piece => all.pass(piece).ok_or_else(Self::singular)?,
            }
        }
        let times = all.events.iter().map(|event| event.time_by[0]).collect();
        Ok(((&self.tangent * all.s).as_slice().to_vec(), times))
    }

    /// The derivatives of a number by the start and the parameters (one for each of [`names`](Self::names)), from its derivatives by the final
    /// displacement and velocity (`last`, 2 nv numbers) and by the times of the events (`times`, one for each of
    /// [`events`](Self::events), or none).
    ///
    /// # Errors
    /// [`SimError::Setting`] for a wrong number of derivatives; [`SimError::NoDerivative`] for one by the time of an event whose digits do
    /// not count.
    pub fn vjp(&self, last: &[f64], times: &[f64]) -> Result<Vec<f64>, SimError> {
        if !times.is_empty() {
            self.check("number of derivatives by the times of events", times.len(), self.told().count())?;
        }
        let times = times.iter().copied().enumerate().filter(|(_, by)| *by != 0.0).collect();
        self.gradient(&ByOutcome { last: last.to_vec(), times, ..ByOutcome::default() })
    }

    /// The derivatives of a number by the start and the parameters (one for each of [`names`](Self::names)), from those by the outcome.
    ///
    /// # Errors
    /// As [`LinearRun::gradients`].
    pub fn gradient(&self, by: &ByOutcome) -> Result<Vec<f64>, SimError> {
        Ok(self.gradients(std::slice::from_ref(by))?.pop().unwrap_or_default())
    }

    /// [`LinearRun::gradient`] of several numbers, which costs less than one after another.
    ///
    /// # Errors
    /// [`SimError::Setting`] for a wrong number of derivatives or an event that there is not; [`SimError::NoDerivative`] for one by the time
    /// of an event whose digits do not count, or by a state at it, or by a state at the end of an accumulation of impacts.
    pub fn gradients(&self, all: &[ByOutcome]) -> Result<Vec<Vec<f64>>, SimError> {
        let told = self.told().count();
        let mut points = 4 * self.pieces.iter().filter(|piece| matches!(piece, Piece::Step(_))).count();
        for by in all {
            if !by.along.is_empty() {
                self.check("number of points of quadrature", by.along.len(), points)?;
            }
            for own in &by.along {
                self.check("number of derivatives by a state", own.len(), self.tangent.nrows())?;
            }
            self.check("number of derivatives by the final state", by.last.len(), self.tangent.nrows())?;
            for (k, own) in by.before.iter().chain(&by.after) {
                self.check("number of derivatives by a state at an event", own.len(), self.tangent.nrows())?;
                require(*k < told, "event of a derivative", *k as f64, "it must be one of those of the run")?;
            }
        }
        let mut index = told;
        let mut gradients = DMatrix::zeros(self.parameters, all.len());
        let mut lambda = DMatrix::zeros(self.tangent.ncols(), all.len());
        for (by, mut own) in all.iter().zip(lambda.column_iter_mut()) {
            own.gemv_tr(1.0, &self.tangent, &DVector::from_column_slice(&by.last), 0.0);
        }
        let mut start = DMatrix::zeros(0, all.len());
        for piece in self.pieces.iter().rev() {
            match piece {
                Piece::Step(step) => {
                    points -= 4;
                    let along: Vec<&[Vec<f64>]> =
                        all.iter().map(|by| by.along.get(points..points + 4).unwrap_or_default()).collect();
                    lambda = step.reverse(&self.gauss, &lambda, &along, &mut gradients).ok_or_else(Self::singular)?;
                }
                Piece::Event(event) => {
                    gradients.gemm_tr(1.0, &event.push, &lambda, 1.0);
                    lambda = event.map.tr_mul(&lambda);
                    if !event.happened.is_empty() {
                        index -= 1;
                        for ((by, mut lambda), mut gradient) in
                            all.iter().zip(lambda.column_iter_mut()).zip(gradients.column_iter_mut())
                        {
                            event.add((&mut lambda, &mut gradient), index, by)?;
                        }
                    }
                }
                Piece::Start(from) => start = from.tr_mul(&lambda),
            }
        }
        let column = |k: usize| start.column(k).iter().chain(gradients.column(k).iter()).copied().collect();
        Ok((0..all.len()).map(column).collect())
    }

    fn singular() -> SimError {
        SimError::Integration { time: 0.0, reason: "the variational equations are singular".into() }
    }

    fn check(&self, what: &'static str, given: usize, needed: usize) -> Result<(), SimError> {
        require(given == needed, what, given as f64, "it must be that of the names, rows or events of the run")
    }
}
