//! Branches: an orbit followed over a parameter by pseudo-arclength continuation (Keller 1977).
//!
//! | symbol | meaning |
//! | --- | --- |
//! | π | the parameter as a share of its range |
//! | G | (DP − 1, ∂P/∂π): its null space is the direction of the branch |
//! | t | unit vector of that direction |
//! | s | length along the branch |
//!
//! From a point the next one is predicted along t, and corrected by Newton's method perpendicular to t. A correction that is longer than the
//! longest step leads to an orbit that is not on the branch, and the step is shortened. Between two points a special one is
//! located where a function of the branch changes its sign:
//!
//! | special point | function | meaning |
//! | --- | --- | --- |
//! | `fold` | the component of t along π | a multiplier is +1: the branch turns back |
//! | `branch-point` | det of G above tᵀ | a multiplier is +1, and the branch goes on: another branch crosses it |
//! | `flip` | det(DP + 1) | a multiplier is −1: an orbit of twice the period begins |
//! | `neimark-sacker` | the largest |μ| − 1 of complex pairs | a complex pair has the size 1 |
//! | `grazing` | – | an impact appears or vanishes |
//! | `sticking` | – | sticking of a contact, or of a joint with dry friction, begins in the period or vanishes from it |
//! | `sliding` | – | the same of sliding |
//! | `accumulation` | – | an accumulation of impacts appears or vanishes |
//! | `events` | – | the sequence of events changes in another way |
//! | `section` | – | an event comes to the time of a section by a period, which is moved to the middle of the longest time without events and contacts |
//!
//! At a flip the orbits of twice the period begin ([`Problem::doubled`]): from the flip the first step is along the eigenvector of −1, at a
//! constant parameter.

use super::newton::{Look, STEPS, difference};
use super::problem::{Problem, Section, Timed, Vary};
use super::return_map::Period;
use super::{Happened, NEUTRAL, Orbit, OrbitError, State};
use carom_impact::least_norm;
use carom_sim::Moment;
use nalgebra::{Complex, DMatrix, DVector};
use serde::Serialize;

/// A branch of orbits.
#[derive(Debug, Clone, Serialize)]
pub struct Branch {
    /// Name of the parameter.
    pub parameter: String,
    /// The orbits, in the order of the branch.
    pub points: Vec<Point>,
    /// Number of passages of the section in one period.
    pub passages: usize,
    /// Where the branch bifurcates, turns back, or has another sequence of events.
    pub special: Vec<Special>,
    /// Why it ends, in a word: `range` (its end), `start` (back beyond the start of the range), `points` (their greatest number); `grazing`,
    /// `sticking`, `sliding`, `accumulation`, `events` (how the events change there); `section` (an event comes to the time of the section, which
    /// has no place elsewhere); an [`OrbitError::name`] (what fails there).
    pub ended: &'static str,
    /// Why it ends, in a sentence.
    pub end: String,
}

/// An orbit of a branch.
#[derive(Debug, Clone, Serialize)]
pub struct Point {
    /// Value of the parameter.
    pub parameter: f64,
    /// The orbit.
    #[serde(flatten)]
    pub orbit: Orbit,
}

/// A special point of a branch.
#[derive(Debug, Clone, Serialize)]
pub struct Special {
    /// `fold`, `branch-point`, `flip`, `neimark-sacker`; `grazing`, `sticking`, `sliding`, `accumulation`, `events`: how the events change;
    /// `section`: it has moved.
    pub kind: &'static str,
    /// Value of the parameter.
    pub parameter: f64,
    /// What changes.
    pub what: String,
    /// Number of points of the branch up to it.
    pub after: usize,
}

/// The next point of a branch, and the number of corrections that found it.
type Next = (Place, usize);

/// A point of a branch with its direction.
struct Place {
    value: f64,
    plan: Timed,
    look: Look,
    direction: DVector<f64>,
    branching: f64,
    flip: f64,
    torus: f64,
}

/// First, largest and smallest step, as shares of the range of the parameter.
const FIRST: f64 = 0.02;
const LONGEST: f64 = 0.05;
const SHORTEST: f64 = 1e-7;
/// A correction that takes this number of steps or fewer allows a longer one.
const QUICK: usize = 4;
/// Steps of a correction.
const CORRECTIONS: usize = 8;
/// Special points are located to this share of the range.
const LOCATED: f64 = 1e-10;
/// By what −1 is shifted to find its eigenvector: more than the error of the multiplier at a located flip, so that the matrix is regular.
const EIGENVALUE: f64 = 1e-6;
/// An event this near to the time of a section by a period, as a share of it, moves the section where the branch ends: slow impacts soon after
/// it, too, have no derivative by a parameter while the motion has hardly changed with it. One as near as the second share ends the branch
/// by that, where the section has no other place.
const NEAR_SECTION: f64 = 0.02;
const AT_SECTION: f64 = 1e-3;
/// A function that changes by more within the located interval jumps.
const JUMP: f64 = 1e-3;

impl Problem {
    /// Finds the orbit at the first value of the parameter, and follows it over the range.
    ///
    /// # Errors
    /// [`OrbitError`]: the problem has no parameter, or there is no orbit at the first value. A branch that ends later says why.
    pub fn branch(&self) -> Result<Branch, OrbitError> {
        let Some(vary) = self.vary.clone() else {
            return Err(self.refusal("[vary] is missing: give it parameter, from and to"));
        };
        let plan = self.plan(Some(vary.from))?;
        let (look, iterations) = self.first(&plan)?;
        let mut toward = DVector::zeros(look.r.len() + 1);
        toward[look.r.len()] = 1.0;
        let here = self.place(&vary, (vary.from, plan), look, &toward);
        self.follow_on(&vary, here, (iterations, FIRST))
    }

    /// The branch, and those of twice the period that begin at the first flip of the one before, so many times in turn; and why there are
    /// fewer of them.
    ///
    /// # Errors
    /// As [`Problem::branch`].
    pub fn branches(&self, doubled: u8) -> Result<(Branch, Vec<Branch>, Option<OrbitError>), OrbitError> {
        let branch = self.branch()?;
        let (mut problem, mut all) = (self.clone(), Vec::new());
        for _ in 0..doubled {
            match problem.doubled(all.last().unwrap_or(&branch)) {
                Ok((next, own)) => {
                    problem = next;
                    all.push(own);
                }
                Err(error @ OrbitError::Run(carom_sim::SimError::Stopped { .. })) => return Err(error),
                Err(why) => return Ok((branch, all, Some(why))),
            }
        }
        Ok((branch, all, None))
    }

    /// Follows the orbits of twice the period that begin at the first flip of a branch of this problem; returns also the problem of them,
    /// whose period has twice the passages.
    ///
    /// # Errors
    /// [`OrbitError`]: the branch has no flip, or the orbit at the flip is not found.
    pub fn doubled(&self, branch: &Branch) -> Result<(Self, Branch), OrbitError> {
        let flip = branch.special.iter().find(|it| it.kind == "flip");
        let (Some(vary), Some(flip)) = (self.vary.clone(), flip) else {
            return Err(self.refusal(format!(
                "the branch of {} has no flip, at which orbits of twice the period begin: follow it over a longer range of [vary]",
                if branch.passages == 1 { "1 passage".to_owned() } else { format!("{} passages", branch.passages) }
            )));
        };
        let near = &branch.points[flip.after.clamp(1, branch.points.len()) - 1].orbit;
        // Where the branch has its section there.
        let later = near.start_time - self.scene.simulation.start_time;
        let problem = Self { phase: later * self.passages as f64 / near.period, ..self.clone() };
        let plan = problem.plan(Some(flip.parameter))?;
        let parameter = problem.parameter(flip.parameter);
        let (look, iterations) = problem.find_from(&plan, near.start.clone(), None)?;
        let n = look.r.len();
        let unknown = self.unknown(n);
        let m = unknown.len();
        // Inverse iteration; the flip is located to less than the shift.
        let shifted = problem.returning(&look.found.by_state) + DMatrix::identity(m, m) * (1.0 + EIGENVALUE);
        let factors = shifted.lu();
        let mut along = DVector::from_element(m, 1.0);
        for _ in 0..STEPS {
            along = factors.solve(&along).unwrap_or(along);
            along /= along.norm();
        }
        let mut direction = DVector::zeros(n + 1);
        unknown.iter().enumerate().for_each(|(i, k)| direction[*k] = along[i]);
        let problem = Self { passages: 2 * self.passages, doubled: true, ..problem };
        let look = problem.look(&plan, look.x, parameter.as_ref())?;
        let place = problem.place(&vary, (flip.parameter, plan), look, &direction);
        let doubled = problem.follow_on(&vary, Place { direction, ..place }, (iterations, 0.1 * FIRST))?;
        Ok((problem, doubled))
    }

    /// Follows a branch from a place on it, which was found by so many runs, with a first step of this length.
    fn follow_on(
        &self,
        vary: &Vary,
        mut here: Place,
        (iterations, mut step): (usize, f64),
    ) -> Result<Branch, OrbitError> {
        let mut branch = Branch {
            parameter: vary.name.clone(),
            points: vec![self.point(&here, iterations)],
            passages: self.passages,
            special: Vec::new(),
            ended: "points",
            end: String::new(),
        };
        let beyond = |value: f64| (value - vary.from) / (vary.to - vary.from);
        let mut problem = self.clone();
        while branch.points.len() < vary.points {
            let left = (1.0 - beyond(here.value)) / here.direction[here.look.r.len()];
            if (0.0..=step).contains(&left)
                && let Some((last, iterations)) = problem.landed(vary, &here, left)
            {
                problem.specials(vary, &here, &last, left, &mut branch);
                branch.points.push(problem.point(&last, iterations));
                (branch.ended, branch.end) = ("range", format!("{} = {}, the end of the range", vary.name, vary.to));
                return Ok(branch);
            }
            let (mut next, mut is_over) = (problem.next(vary, &here, step), false);
            if next.is_err()
                && step <= SHORTEST
                && let Some((longer, over)) = problem.over(vary, &here)?
            {
                (step, next, is_over) = (longer, Ok(over), true);
            }
            match next {
                Ok((there, iterations)) => {
                    let share = beyond(there.value);
                    // Outside the range are no points of the branch: shorter steps lead to its end.
                    let outside = !(0.0..1.0).contains(&share);
                    if outside && step > SHORTEST && !is_over {
                        step *= 0.5;
                        continue;
                    }
                    if outside {
                        let (ended, which) =
                            if share < 0.0 { ("start", "back at the start") } else { ("range", "the end") };
                        (branch.ended, branch.end) =
                            (ended, format!("{} = {}, {which} of the range", vary.name, here.value));
                        return Ok(branch);
                    }
                    problem.specials(vary, &here, &there, step, &mut branch);
                    branch.points.push(problem.point(&there, iterations));
                    here = there;
                    if iterations <= QUICK {
                        step = (1.5 * step).min(LONGEST);
                    }
                }
                Err(error) if step <= SHORTEST => {
                    let period = &here.look.found.period;
                    let at_section = problem.at_section(period, NEAR_SECTION);
                    let after = branch.points.len();
                    let has_moved = branch.special.last().is_some_and(|it| it.kind == "section" && it.after == after);
                    let moved = at_section.filter(|_| !has_moved).and_then(|_| problem.elsewhere(vary, &here));
                    if let (Some(what), Some((moved, there))) = (at_section, moved) {
                        let time = there.plan.simulation.start_time;
                        let what = format!(
                            "an event ({what}) comes to the time of the section: from here on it is at {time} s"
                        );
                        branch.special.push(Special { kind: "section", parameter: here.value, what, after });
                        (problem, here, step) = (moved, there, FIRST);
                        continue;
                    }
                    let (ended, why) = match problem.at_section(period, AT_SECTION) {
                        Some(what) => {
                            let rule = "it has no place elsewhere, without contact";
                            ("section", format!("an event ({what}) comes to the time of the section, and {rule}"))
                        }
                        None => (problem.ended(vary, &here, &error), error.to_string()),
                    };
                    (branch.ended, branch.end) = (ended, format!("{} = {}, by {ended}: {why}", vary.name, here.value));
                    return Ok(branch);
                }
                Err(OrbitError::Run(error @ carom_sim::SimError::Stopped { .. })) => return Err(error.into()),
                Err(_) => step *= 0.5,
            }
        }
        branch.end = format!("{} points were computed: give [vary] more points", vary.points);
        Ok(branch)
    }

    /// The event that comes to the time of a section by a period, as near as this share of it.
    fn at_section<'p>(&self, period: &'p Period, share: f64) -> Option<&'p str> {
        matches!(self.section, Section::After(_)).then_some(())?;
        let one = period.time / self.passages as f64;
        let near = |event: &&Happened| {
            let since = event.time.rem_euclid(one);
            since.min(one - since) <= share * one
        };
        Some(&period.events.iter().find(near)?.what)
    }

    /// The same place with its section in the middle of the longest time without events and contacts where there are derivatives.
    fn elsewhere(&self, vary: &Vary, here: &Place) -> Option<(Self, Place)> {
        let period = &here.look.found.period;
        let one = period.time / self.passages as f64;
        let mut times: Vec<f64> = period.events.iter().map(|event| event.time.rem_euclid(one)).collect();
        times.sort_by(f64::total_cmp);
        let next = times.iter().skip(1).copied().chain([times.first()? + one]);
        let mut free: Vec<[f64; 2]> = times.iter().zip(next).map(|(from, to)| [*from, to]).collect();
        free.sort_by(|[from, to], [a, b]| (b - a).total_cmp(&(to - from)));
        free.iter().find_map(|[from, to]| {
            let later = 0.5 * (from + to);
            let mut session = self.session(&here.plan, &here.look.x).ok()?;
            session.advance(later).ok()?;
            session.contacts().is_ok_and(|contacts| contacts.is_empty()).then_some(())?;
            let Moment { q, qd, .. } = session.moment();
            let phase = self.phase + later / one;
            // A period later the motion is the same, or mirrored.
            let phase = if self.relabel.is_empty() { phase.fract() } else { phase };
            let problem = Self { phase, ..self.clone() };
            let plan = problem.plan(Some(here.value)).ok()?;
            let look = problem.look(&plan, State { q, qd }, problem.parameter(here.value).as_ref()).ok()?;
            let n = look.r.len();
            let mut before = DVector::zeros(n + 1);
            before[n] = here.direction[n].signum();
            let there = problem.place(vary, (here.value, plan), look, &before);
            Some((problem, there))
        })
    }

    /// The shortest of longer steps that leads on: without a derivative near here, as beside a grazing that was just passed, with its length.
    ///
    /// # Errors
    /// If it is stopped.
    fn over(&self, vary: &Vary, here: &Place) -> Result<Option<(f64, Next)>, OrbitError> {
        let mut step = 10.0 * SHORTEST;
        while step < LONGEST {
            match self.next(vary, here, step) {
                Err(OrbitError::Run(error @ carom_sim::SimError::Stopped { .. })) => return Err(error.into()),
                Ok(next) => return Ok(Some((step, next))),
                Err(_) => step *= 10.0,
            }
        }
        Ok(None)
    }

    /// Why a branch ends after a place, where longer steps fail with this error: how the events of motions beyond it differ, or what fails.
    fn ended(&self, vary: &Vary, here: &Place, error: &OrbitError) -> &'static str {
        let n = here.look.r.len();
        let before = sequence(&here.look.found.period);
        let mut step = SHORTEST;
        while step <= FIRST {
            let value = here.value + step * here.direction[n] * (vary.to - vary.from);
            let beyond = self.moved(&here.plan, &here.look, &(here.direction.rows(0, n) * step));
            let beyond = self.plan(Some(value)).and_then(|plan| self.period(&plan, &beyond?));
            match beyond {
                Ok(period) if sequence(&period) != before => return change(&before, &sequence(&period)),
                Ok(_) => step *= 10.0,
                Err(error) if step <= SHORTEST => return error.name(),
                // A long step may lead to no start of a motion.
                Err(_) => break,
            }
        }
        error.name()
    }

    fn point(&self, place: &Place, iterations: usize) -> Point {
        Point { parameter: place.value, orbit: self.orbit(place.look.clone(), iterations, &place.plan) }
    }

    /// A point with its direction: that of the null space of G along `before`.
    fn place(&self, vary: &Vary, (value, plan): (f64, Timed), look: Look, before: &DVector<f64>) -> Place {
        let n = look.r.len();
        let unknown = self.unknown(n);
        let m = unknown.len();
        // Bordered by the direction before, G has full rank also at a fold.
        let extended = self.extended(vary, &look, &unknown);
        let matrix = bordered(extended.clone(), &unknown, before);
        let mut right = DVector::zeros(m + 1);
        right[m] = 1.0;
        let null = least_norm(&matrix, &right, f64::EPSILON);
        let mut direction = DVector::zeros(n + 1);
        unknown.iter().enumerate().for_each(|(i, k)| direction[*k] = null[i]);
        direction[n] = null[m];
        direction /= direction.norm();
        let branching = bordered(extended, &unknown, &direction).determinant();
        let flip = (self.returning(&look.found.by_state) + DMatrix::identity(m, m)).determinant();
        let torus = torus(&self.multipliers(&look.found.by_state));
        Place { value, plan, look, direction, branching, flip, torus }
    }

    /// G, without the rows and columns of `modulo` coordinates.
    fn extended(&self, vary: &Vary, look: &Look, unknown: &[usize]) -> DMatrix<f64> {
        let m = unknown.len();
        let mut g = (self.returning(&look.found.by_state) - DMatrix::identity(m, m)).insert_column(m, 0.0);
        g.set_column(m, &(look.found.by_parameter.select_rows(unknown) * (vary.to - vary.from)));
        g
    }

    /// The point at a length `step` along the direction.
    fn next(&self, vary: &Vary, here: &Place, step: f64) -> Result<Next, OrbitError> {
        let n = here.look.r.len();
        let unknown = self.unknown(n);
        let m = unknown.len();
        let range = vary.to - vary.from;
        let mut value = here.value + step * here.direction[n] * range;
        let mut x = self.moved(&here.plan, &here.look, &(here.direction.rows(0, n) * step))?;
        let mut last = f64::INFINITY;
        for iteration in 1..=CORRECTIONS {
            let plan = self.plan(Some(value))?;
            let parameter = self.parameter(value);
            let look = self.look(&plan, x, parameter.as_ref())?;
            let done = difference(&plan.simulation.chain, &here.look.x, &look.x)?;
            if look.size <= self.converged() {
                self.check_distance(here, &done, (value - here.value) / range, step)?;
                if self.doubled {
                    self.check_double(&plan, &look)?;
                }
                return Ok((self.place(vary, (value, plan), look, &here.direction), iteration));
            }
            if look.size > 10.0 * last {
                return Err(OrbitError::NotConverged { iterations: iteration, residual: look.size });
            }
            last = look.size;
            let matrix = bordered(self.extended(vary, &look, &unknown), &unknown, &here.direction);
            let mut right = DVector::zeros(m + 1);
            unknown.iter().enumerate().for_each(|(i, k)| right[i] = -look.r[*k]);
            // Beside the constraint of the step: the distance that is left along the direction.
            let along: f64 = unknown.iter().map(|k| done[*k] * here.direction[*k]).sum();
            right[m] = step - along - here.direction[n] * (value - here.value) / range;
            let solved = least_norm(&matrix, &right, f64::EPSILON);
            let mut change = DVector::zeros(n);
            unknown.iter().enumerate().for_each(|(i, k)| change[*k] = solved[i]);
            x = self.moved(&plan, &look, &change)?;
            value += solved[m] * range;
        }
        Err(OrbitError::NotConverged { iterations: CORRECTIONS, residual: last })
    }

    /// The orbit at the end of the range after a point from which the branch leads there by a length `step`; `None` if
    /// it is not found on the branch.
    fn landed(&self, vary: &Vary, here: &Place, step: f64) -> Option<Next> {
        let n = here.look.r.len();
        let plan = self.plan(Some(vary.to)).ok()?;
        let along = here.direction.rows(0, n) * step;
        let near = self.moved(&here.plan, &here.look, &along).ok()?;
        let (look, iterations) = self.find_at_end(&plan, near, vary.to).ok()?;
        let done = difference(&plan.simulation.chain, &here.look.x, &look.x).ok()?;
        self.check_distance(here, &done, (vary.to - here.value) / (vary.to - vary.from), step).ok()?;
        Some((self.place(vary, (vary.to, plan), look, &here.direction), iterations))
    }

    /// Refuses an orbit that is farther than the longest step from where the branch leads by a length `step`; `done`, `share`: the change of
    /// the state and of the parameter to it.
    fn check_distance(&self, here: &Place, done: &DVector<f64>, share: f64, step: f64) -> Result<(), OrbitError> {
        let n = here.look.r.len();
        let beside = self.unknown(n).iter().map(|k| (done[*k] - step * here.direction[*k]).powi(2)).sum::<f64>();
        let distance = beside.sqrt().hypot(share - step * here.direction[n]);
        if distance > LONGEST { Err(OrbitError::Apart { distance }) } else { Ok(()) }
    }

    /// Refuses an orbit of twice the period that is one of the period run twice.
    fn check_double(&self, plan: &Timed, look: &Look) -> Result<(), OrbitError> {
        let once = Self { passages: self.passages / 2, ..self.clone() }.period(plan, &look.x)?;
        let size = difference(&plan.simulation.chain, &look.x, &once.end)?.amax() / look.scale;
        if size <= self.converged() { Err(OrbitError::Apart { distance: size }) } else { Ok(()) }
    }

    /// The special points between two points.
    fn specials(&self, vary: &Vary, here: &Place, there: &Place, step: f64, branch: &mut Branch) {
        let after = branch.points.len();
        let mut add = |kind, parameter, what: String| branch.special.push(Special { kind, parameter, what, after });
        let (before, now) = (sequence(&here.look.found.period), sequence(&there.look.found.period));
        if before != now {
            let near = self.border(vary, here, step, &before);
            add(change(&before, &now), near, format!("from {} to {}", before.join(", "), now.join(", ")));
            return;
        }
        type Test = (&'static str, fn(&Place) -> f64, &'static str);
        let functions: [Test; 4] = [
            ("fold", |place| place.direction[place.look.r.len()], "a multiplier passes +1, and the branch turns back"),
            ("branch-point", |place| place.branching, "a multiplier passes +1, and another branch crosses this one"),
            ("flip", |place| place.flip, "a multiplier passes -1: an orbit of twice the period begins"),
            ("neimark-sacker", |place| place.torus, "a complex pair of multipliers passes the unit circle"),
        ];
        for (kind, function, what) in functions {
            let (from, to) = (function(here), function(there));
            // A function that is zero along the branch changes its sign by rounding: the pairs of a motion without loss.
            if from * to < 0.0 && from.abs().min(to.abs()) > NEUTRAL {
                let value = self.between(vary, (here, there), step, |place| function(place) * from.signum());
                // A function that jumps has no zero: a complex pair that becomes real.
                if let Some(value) = value {
                    add(kind, value, what.into());
                }
            }
        }
    }

    /// The parameter at which a function that is positive at the start of a step becomes negative.
    fn between(
        &self,
        vary: &Vary,
        (here, there): (&Place, &Place),
        step: f64,
        function: impl Fn(&Place) -> f64,
    ) -> Option<f64> {
        let at = |s: f64| self.next(vary, here, s).ok().map(|(place, _)| (s, function(&place), place.value));
        let (mut low, mut high) = ((0.0, function(here), here.value), (step, function(there), there.value));
        for k in 0..STEPS {
            if high.0 - low.0 <= LOCATED {
                break;
            }
            // Secant and bisection in turn.
            let secant = low.0 + (high.0 - low.0) * low.1 / (low.1 - high.1);
            let middle = 0.5 * (low.0 + high.0);
            let s = if k % 3 == 2 || !(secant > low.0 && secant < high.0) { middle } else { secant };
            // The correction of a branch point itself has a singular matrix.
            let Some((s, value, parameter)) = at(s).or_else(|| at(middle)) else { break };
            if value == 0.0 {
                return Some(parameter);
            }
            if value > 0.0 { low = (s, value, parameter) } else { high = (s, value, parameter) }
        }
        let weight = low.1 / (low.1 - high.1);
        let jumps = low.1 - high.1 > JUMP;
        (!jumps).then_some(low.2 + weight * (high.2 - low.2))
    }

    /// The last value of the parameter within a step at which the orbits have this sequence of events.
    fn border(&self, vary: &Vary, here: &Place, step: f64, events: &[&str]) -> f64 {
        let (mut low, mut high, mut value) = (0.0, step, here.value);
        while high - low > LOCATED {
            let middle = 0.5 * (low + high);
            match self.next(vary, here, middle) {
                Ok((place, _)) if sequence(&place.look.found.period) == events => (low, value) = (middle, place.value),
                _ => high = middle,
            }
        }
        value
    }
}

/// G with the components of a direction as its last row.
fn bordered(g: DMatrix<f64>, unknown: &[usize], direction: &DVector<f64>) -> DMatrix<f64> {
    let m = unknown.len();
    let mut matrix = g.insert_row(m, 0.0);
    unknown.iter().enumerate().for_each(|(i, k)| matrix[(m, i)] = direction[*k]);
    matrix[(m, m)] = direction[direction.len() - 1];
    matrix
}

/// The sequence of events of an orbit.
fn sequence(period: &Period) -> Vec<&str> {
    period.events.iter().map(|event| event.what.as_str()).collect()
}

/// How a sequence of events differs from another: by an accumulation of impacts, by an impact, by sticking, by sliding, or in another way.
fn change(before: &[&str], after: &[&str]) -> &'static str {
    let kinds = |events: &[&str], of: &[&str]| {
        events.iter().filter(|event| of.iter().any(|kind| event.split(' ').next() == Some(kind))).count()
    };
    let tests: [(&'static str, &[&str]); 4] = [
        ("accumulation", &["zeno"]),
        ("grazing", &["impact", "several", "limit", "latch"]),
        ("sticking", &["sticking", "joint-stops"]),
        ("sliding", &["sliding", "joint-moves"]),
    ];
    let differs = tests.into_iter().find(|(_, of)| kinds(before, of) != kinds(after, of));
    differs.map_or("events", |(name, _)| name)
}

/// The largest |μ| − 1 of complex pairs; −1 without one.
fn torus(multipliers: &[Complex<f64>]) -> f64 {
    multipliers.iter().filter(|x| x.im > 0.0).map(|x| x.norm() - 1.0).fold(-1.0, f64::max)
}
