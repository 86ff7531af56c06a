//! The return map P and its derivative.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | φ(t, x) | state of the run from x after time t |
//! | τ(x) | time at which it reaches the section |
//! | S | ∂φ/∂x at t = τ; at an event that of the motion after it, continued to the time of the event |
//! | f | rate of the state after the section |
//! | R | the linear part of the relabelling |
//!
//! P(x) = R φ(τ(x), x) + c, so that
//!
//! ```text
//! DP = R (S + f τ′)
//! ```
//!
//! τ′ is that of the event; of a function w of the state τ′ = −∂w S/(∂w f); of a given time 0, but by a parameter that it follows. Where the start
//! is later by the share σ of this time, it moves by σ τ′, too: that adds (f − S f₀) σ τ′, with the rate f₀ of x at the start.

use super::problem::{ByParameter, Problem, Section, Timed};
use super::{Happened, OrbitError, State};
use carom_chain::Chain;
use carom_sim::{
    Broken, Event, EventKind, Moment, Parameter, Plan, Sampling, Seen, Segment, Session, SimError, StopReason,
};
use nalgebra::{DMatrix, DVector};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The rate at the start is that after this share of the passage.
const AT_ONCE: f64 = 1e-12;
/// No passage is shorter, as a share of the duration of the scene: a start on the section is below it by rounding.
const SHORTEST: f64 = 1e-9;

/// A passage from a state on the section to the next, or a period: its passages together.
#[derive(Clone)]
pub(super) struct Period {
    pub end: State,
    pub time: f64,
    pub events: Vec<Happened>,
}

/// A period with its derivatives.
#[derive(Clone)]
pub(super) struct Differentiated {
    pub period: Period,
    pub by_state: DMatrix<f64>,
    pub by_parameter: DVector<f64>,
}

impl Problem {
    /// P, with its derivatives by x and by the parameter.
    pub(super) fn differentiated(
        &self,
        plan: &Timed,
        start: &State,
        parameter: Option<&ByParameter>,
    ) -> Result<Differentiated, OrbitError> {
        let n = 2 * plan.simulation.chain.nv();
        let (mut by_state, mut by_parameter) = (DMatrix::identity(n, n), DVector::zeros(n));
        let period = self.follow(plan, start, |from, passage| {
            let (state, own) = self.slope(plan, from, passage, parameter)?;
            by_parameter = &state * &by_parameter + own;
            by_state = &state * &by_state;
            Ok(())
        })?;
        Ok(Differentiated { period, by_state, by_parameter })
    }

    /// P without derivatives.
    pub(super) fn period(&self, plan: &Timed, start: &State) -> Result<Period, OrbitError> {
        self.follow(plan, start, |_, _| Ok(()))
    }

    fn follow(
        &self,
        plan: &Timed,
        start: &State,
        mut each: impl FnMut(&State, &Period) -> Result<(), OrbitError>,
    ) -> Result<Period, OrbitError> {
        let mut period = Period { end: start.clone(), time: 0.0, events: Vec::new() };
        for _ in 0..self.passages {
            let passage = self.passage(plan, &period.end)?;
            each(&period.end, &passage)?;
            let since = period.time;
            period.events.extend(passage.events.into_iter().map(|it| Happened { time: since + it.time, ..it }));
            (period.end, period.time) = (self.relabelled(passage.end), since + passage.time);
        }
        self.keep(&plan.simulation.chain, start, &mut period.end.q);
        Ok(period)
    }

    /// Returns the coordinates that need not return, so that they do not run away.
    pub(super) fn keep(&self, chain: &Chain, start: &State, q: &mut [f64]) {
        for &v in &self.modulo {
            if let Some(at) = chain.joint_of_velocity(v).and_then(|joint| chain.coordinate_of(joint)) {
                q[at.q] = start.q[at.q];
            }
        }
    }

    /// A session that begins at a state.
    pub(super) fn session(&self, plan: &Plan, start: &State) -> Result<Session, SimError> {
        Plan { q: start.q.clone(), qd: start.qd.clone(), ..plan.clone() }.start()
    }

    fn passage(&self, plan: &Timed, start: &State) -> Result<Period, OrbitError> {
        // The zero of a function is no event: the session is stopped at it, by a flag that also passes on that of the problem.
        let (interrupted, at_zero) = (plan.simulation.stop.clone(), Arc::new(AtomicBool::new(false)));
        let is_rising = matches!(self.section, Section::Rising { .. });
        let mut own = Plan { q: start.q.clone(), qd: start.qd.clone(), ..plan.plan.clone() };
        if is_rising {
            own.simulation.stop = Some(at_zero.clone());
        }
        let mut session = own.start()?;
        let (longest, from) = (plan.longest, session.time());
        let mut events = Vec::new();
        let mut seen = Crossing::new(&self.section, start.q.len(), from + SHORTEST * longest);
        let ends = |event: &Event| match &self.section {
            Section::Contact { touches, .. } => event.struck().any(|touch| touches.contains(&touch)),
            _ => false,
        };
        loop {
            // In this order the rest of a start at any time is zero in the end.
            let left = from + longest - session.time();
            if left <= 0.0 {
                break;
            }
            let (saved, before, mut ended) = (session.save(), session.time(), false);
            let touches = plan.simulation.touches.as_slice();
            let sampling = Sampling { dense: is_rising, ..Sampling::default() };
            let mut own = Vec::new();
            let streamed = session.stream_to_event(left, sampling, &mut |it| match it {
                Seen::Event(event) => {
                    let mut what = event.named(touches).told();
                    if let EventKind::Impact { touch, hit } = &event.kind
                        && touches[*touch].contact.law.friction() > 0.0
                    {
                        what += &format!(" ({})", hit.contact.mode.name());
                    }
                    own.push(Happened { time: event.time - from, what });
                    ended |= ends(event) && event.time > from;
                }
                Seen::Segment(segment) => {
                    seen.look(segment);
                    let stops = interrupted.as_ref().is_some_and(|it| it.load(Ordering::Relaxed));
                    at_zero.store(stops || seen.found.is_some() || seen.jumps.is_some(), Ordering::Relaxed);
                }
                _ => {}
            });
            let stopped = match streamed {
                Err(SimError::Stopped { .. }) if seen.found.is_some() || seen.jumps.is_some() => None,
                stopped => Some(stopped?),
            };
            if let Some(time) = seen.jumps {
                return Err(OrbitError::Jumps { section: self.section.name(), time: time - from });
            }
            if let Some(mut time) = seen.found.take() {
                at_zero.store(false, Ordering::Relaxed);
                // The dense output has the error of an interpolation, the state at its end that of the integration.
                for _ in 0..3 {
                    session.restore(&saved)?;
                    session.advance(time - before)?;
                    time -= seen.value(&session.moment()) / seen.rate;
                }
                return self.end_of(&session, from, events);
            }
            events.extend(own);
            if ended {
                return self.end_of(&session, from, events);
            }
            if stopped == Some(StopReason::Events) {
                let seen = format!("after {} events, max_events of the scene, the run ended", events.len());
                return Err(OrbitError::NoReturn { section: self.section.name(), longest, seen });
            }
        }
        if matches!(self.section, Section::After(_)) {
            return self.end_of(&session, from, events);
        }
        let names: Vec<&str> = events.iter().take(5).map(|event| event.what.as_str()).collect();
        let seen =
            if names.is_empty() { "no event was seen".into() } else { format!("seen were {}", names.join(", ")) };
        Err(OrbitError::NoReturn { section: self.section.name(), longest, seen })
    }

    fn end_of(&self, session: &Session, from: f64, events: Vec<Happened>) -> Result<Period, OrbitError> {
        let touches = &session.simulation().touches;
        if touches.iter().any(|touch| touch.contact.compliance.is_some()) {
            let presses = |touch: &usize| touches[*touch].contact.compliance.is_some();
            if let Some(touch) = session.contacts()?.iter().map(|it| it.touch).find(presses) {
                let touch = touches[touch].name.clone();
                return Err(OrbitError::Presses { section: self.section.name(), touch });
            }
        }
        let Moment { time, q, qd } = session.moment();
        Ok(Period { end: State { q, qd }, time: time - from, events })
    }

    /// DP of one passage, and ∂P/∂p.
    fn slope(
        &self,
        plan: &Timed,
        start: &State,
        passage: &Period,
        parameter: Option<&ByParameter>,
    ) -> Result<(DMatrix<f64>, DVector<f64>), OrbitError> {
        let n = 2 * plan.simulation.chain.nv();
        let mut plan = Plan { q: start.q.clone(), qd: start.qd.clone(), ..plan.plan.clone() };
        // A run that ends with the event of the section, or at the time.
        let duration = match self.section {
            Section::Contact { .. } => {
                plan.simulation.max_events = passage.events.len();
                2.0 * passage.time
            }
            _ => passage.time,
        };
        let parameters: Vec<Parameter> = parameter.map(|by| by.parameter.clone()).into_iter().collect();
        let found = plan.sensitivity(duration, &parameters)?;
        let refuse = |time: f64, reason: String| Err(OrbitError::NoDerivative { time, reason });
        if let Some(Broken { time, reason }) = found.broken {
            return refuse(time - plan.simulation.start_time, reason);
        }
        let Some(s) = found.last_by else { return refuse(passage.time, "the final state has none".into()) };
        let since = found.last.time - plan.simulation.start_time;
        if (since - passage.time).abs() > 1e-6 * passage.time {
            return refuse(since, "the run with derivatives has other events than the run".into());
        }
        let f = DVector::from_vec(found.rate);
        let time_by = match &self.section {
            Section::After(_) => {
                DVector::from_fn(s.ncols(), |k, _| parameter.filter(|_| k == n).map_or(0.0, |by| by.period))
            }
            Section::Contact { .. } => match found.events.last().map(|event| &event.time_by) {
                Some(by) if by.iter().all(|x| x.is_finite()) => DVector::from_column_slice(by),
                _ => return refuse(since, "the impact of the section is too slow for a derivative of its time".into()),
            },
            Section::Rising { function, .. } => {
                let slope = DVector::from_vec(function.slope(&plan.simulation.chain, &found.last.q));
                -s.tr_mul(&slope) / slope.dot(&f)
            }
        };
        let r = self.relabelling(n / 2);
        let mut all = &s + &f * time_by.transpose();
        if let Some(by) = parameter.filter(|by| self.phase * by.period != 0.0) {
            let before = DVector::from_vec(plan.sensitivity(AT_ONCE * passage.time, &[])?.rate);
            let mut own = all.column_mut(n);
            own += (f - s.columns(0, n) * before) * (self.phase * by.period);
        }
        let all = r * all;
        let own = if parameters.is_empty() { DVector::zeros(n) } else { all.column(n).into_owned() };
        Ok((all.columns(0, n).into_owned(), own))
    }

    /// The state after the relabelling.
    fn relabelled(&self, state: State) -> State {
        let (whole, mut after) = ([state.q.clone(), state.qd.clone()].concat(), state.clone());
        for joint in &self.relabel {
            after.q[joint.q] = joint.to.at(&whole);
            after.qd[joint.v] = joint.rates.iter().map(|(v, c)| c * state.qd[*v]).sum();
        }
        after
    }

    /// R, for changes of a state of nv joints.
    fn relabelling(&self, nv: usize) -> DMatrix<f64> {
        let mut r = DMatrix::identity(2 * nv, 2 * nv);
        for joint in &self.relabel {
            for level in [0, nv] {
                r.row_mut(level + joint.v).fill(0.0);
                joint.rates.iter().for_each(|(v, c)| r[(level + joint.v, level + v)] += c);
            }
        }
        r
    }
}

impl Section {
    /// As it is written.
    pub fn name(&self) -> String {
        match self {
            Self::Contact { name, .. } => format!("contact {name}"),
            Self::Rising { formula, .. } => formula.clone(),
            Self::After(period) => format!("period {period}"),
        }
    }
}

/// Looks for the first passage of a function through zero, upwards, after it was below.
struct Crossing<'s> {
    section: &'s Section,
    /// The length of q.
    nq: usize,
    /// The time until which it is that of the start.
    since: f64,
    below: bool,
    found: Option<f64>,
    rate: f64,
    /// When it jumped over zero.
    jumps: Option<f64>,
}

impl<'s> Crossing<'s> {
    fn new(section: &'s Section, nq: usize, since: f64) -> Self {
        Self { section, nq, since, below: false, found: None, rate: 0.0, jumps: None }
    }

    fn at(&self, state: &[f64]) -> f64 {
        match self.section {
            Section::Rising { function, .. } => function.at(state),
            _ => 0.0,
        }
    }

    /// The size of the terms of the function, if each coordinate or velocity were as large as the largest.
    fn size(&self, state: &[f64]) -> f64 {
        let Section::Rising { function, .. } = self.section else { return 0.0 };
        let (q, qd) = state.split_at(self.nq);
        let [q, qd] = [q, qd].map(|all| all.iter().fold(0.0, |most: f64, x| most.max(x.abs())));
        let terms = function.terms.iter().map(|(k, c)| c.abs() * if *k < self.nq { q } else { qd });
        function.constant.abs() + terms.sum::<f64>()
    }

    fn value(&self, moment: &Moment) -> f64 {
        self.at(&[moment.q.as_slice(), &moment.qd].concat())
    }

    fn look(&mut self, segment: &Segment) {
        /// A start on the section is below or above it by rounding, as a share of the size of the state.
        const ROUNDING: f64 = 1e-9;
        if self.found.is_some() || self.jumps.is_some() {
            return;
        }
        let count = segment.states.len();
        let span = segment.end - segment.start;
        // The polynomial of a segment has fewer extremes than nodes.
        let times = (0..=2 * count).map(|k| segment.start + span * k as f64 / (2 * count) as f64);
        let seen: Vec<(f64, f64)> = times.map(|time| (time, self.at(&segment.at(time)))).collect();
        // On the section itself all terms of the function may be zero.
        let rounding = ROUNDING * segment.states.iter().map(|state| self.size(state)).fold(0.0, f64::max);
        let mut last = segment.start;
        for (time, value) in seen {
            if self.below && value >= 0.0 && time == segment.start {
                self.jumps = Some(time);
                return;
            }
            if self.below && value >= 0.0 {
                let (mut low, mut high) = (last, time);
                while high - low > f64::EPSILON * high.abs().max(span) {
                    let middle = 0.5 * (low + high);
                    if middle <= low || middle >= high {
                        break;
                    }
                    if self.at(&segment.at(middle)) < 0.0 { low = middle } else { high = middle }
                }
                let step = 1e-4 * span;
                let (before, after) = ((high - step).max(segment.start), (high + step).min(segment.end));
                self.rate = (self.at(&segment.at(after)) - self.at(&segment.at(before))) / (after - before);
                self.found = Some(high);
                return;
            }
            self.below |= value < -rounding && time > self.since;
            last = time;
        }
    }
}

/// The states on the section that follow one another, without Newton's method: see [`Problem::cycle`].
pub struct Cycle<'p> {
    problem: &'p Problem,
    plan: Timed,
    state: State,
}

impl Iterator for Cycle<'_> {
    type Item = Result<State, OrbitError>;

    fn next(&mut self) -> Option<Self::Item> {
        let period = self.problem.period(&self.plan, &self.state);
        Some(period.map(|period| {
            self.state.clone_from(&period.end);
            period.end
        }))
    }
}

impl Problem {
    /// The states P(x), P(P(x)), … at a value of the parameter, which has no effect on a problem without one: by runs alone.
    ///
    /// # Errors
    /// [`OrbitError`] of the scene; the items are those of the runs.
    pub fn cycle(&self, parameter: f64, start: State) -> Result<Cycle<'_>, OrbitError> {
        let plan = self.plan(Some(parameter))?;
        self.check_modulo(&plan, &start)?;
        Ok(Cycle { problem: self, plan, state: start })
    }
}
