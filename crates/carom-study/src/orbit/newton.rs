//! Newton's method for a fixed point of P.
//!
//! With r = P(x) − x the step δ solves (1 − DP) δ = r; x + δ is reached from P(x), which is on the constraints, by δ − r, and then moved to
//! the nearest state in which the contacts of the section are closed.

use super::problem::{ByParameter, Problem, Section, Timed};
use super::return_map::Differentiated;
use super::{Orbit, OrbitError, Stability, State};
use carom_chain::Chain;
use carom_impact::least_norm;
use carom_sim::{Moment, SimError};
use nalgebra::{Complex, DMatrix, DVector, Schur};

/// Steps of Newton's method at most.
pub(super) const STEPS: usize = 40;
/// Pivots below this share of the largest belong to directions in which the orbits are a family.
const FAMILY: f64 = 1e-9;

/// By what a `modulo` coordinate is changed (rad, m) to see whether the motion depends on it, and a change that is none of rounding, of which
/// velocities have so many times more as they are larger than 1.
const MOVED: f64 = 0.1;
const DEPENDS: f64 = 1e-6;
/// Residuals are shares of x, or of this share of the start of the scene.
const SMALL: f64 = 1e-3;
/// The share of a period after which a motion has moved.
const SOON: f64 = 0.01;

/// A state with P and its derivatives there.
#[derive(Clone)]
pub(super) struct Look {
    pub x: State,
    pub found: Differentiated,
    /// P(x) − x; zero for `modulo` coordinates.
    pub r: DVector<f64>,
    /// Its largest component, velocities times the period, and the same as a share of the size of x.
    pub most: f64,
    pub size: f64,
    /// The size of x, m, rad.
    pub scale: f64,
}

impl Problem {
    /// Finds the orbit near the start of the scene.
    ///
    /// # Errors
    /// [`OrbitError`]: the run fails, does not return, has no derivative, or Newton's method does not converge.
    pub fn find(&self) -> Result<Orbit, OrbitError> {
        let plan = self.plan(self.vary.as_ref().map(|vary| vary.from))?;
        let (look, iterations) = self.first(&plan)?;
        Ok(self.orbit(look, iterations, &plan))
    }

    /// [`Self::check_modulo`] at the start of the scene, of tables that no orbit begins.
    pub(super) fn check_modulo_at_start(&self) -> Result<(), OrbitError> {
        if self.modulo.is_empty() {
            return Ok(());
        }
        self.check_modulo(&self.plan(self.vary.as_ref().map(|vary| vary.from))?, &self.start())
    }

    /// Compares a period with those from starts whose `modulo` coordinates are others.
    ///
    /// # Errors
    /// [`OrbitError::File`]: the motion depends on one of them, so that its return is not that of the motion.
    pub(super) fn check_modulo(&self, plan: &Timed, start: &State) -> Result<(), OrbitError> {
        let chain = &plan.simulation.chain;
        let names = plan.simulation.state_names();
        for &k in &self.modulo {
            let mut unit = vec![0.0; chain.nv()];
            unit[k] = 1.0;
            // A start that is not admissible is told by the run itself; a change may lead into a surface.
            let Ok(own) = self.period(plan, start) else { continue };
            let beside = [MOVED, -MOVED, SMALL, -SMALL].into_iter().find_map(|by| {
                let q = chain.integrate(&start.q, &unit, by).ok()?;
                Some((by, self.period(plan, &State { q, qd: start.qd.clone() }).ok()?))
            });
            let name = names[k].strip_prefix("q ").unwrap_or(&names[k]);
            let (by, other) = beside.ok_or_else(|| {
                let why = "no motion beside the orbit tells whether it depends on it";
                self.refusal(format!(
                    "[orbit] modulo: from {name} ± {MOVED} and ± {SMALL} the motion does not return, so that {why}"
                ))
            })?;
            let mut change = vec![("the period".to_owned(), (other.time - own.time) / own.time)];
            let moved = difference(chain, &own.end, &other.end)?;
            let size = own.end.qd.iter().fold(1.0, |most: f64, v| most.max(v.abs()));
            change.extend(self.unknown(moved.len()).into_iter().map(|row| (names[row].clone(), moved[row] / size)));
            if let Some((what, share)) = change.into_iter().find(|(_, share)| share.abs() > DEPENDS) {
                return Err(self.refusal(format!(
                    "[orbit] modulo: the motion depends on {name}, so that it must return: from {name} changed by {by} {what} changes by a share of \
                     {share:.1e} in a period; leave {name} out of modulo, and if it turns on, subtract the turn by relabel, as {name} = \"{name}-2*PI\""
                )));
            }
        }
        Ok(())
    }

    /// # Errors
    /// [`OrbitError::File`]: the state on a section of a function is one at rest, which has no period.
    fn check_motion(&self, plan: &Timed, found: &Look) -> Result<(), OrbitError> {
        if !matches!(self.section, Section::Rising { .. }) {
            return Ok(());
        }
        let mut session = self.session(plan, &found.x)?;
        session.advance(SOON * found.found.period.time)?;
        let Moment { q, qd, .. } = session.moment();
        let moved = difference(&plan.simulation.chain, &found.x, &State { q, qd })?;
        let (nv, time) = (plan.simulation.chain.nv(), found.found.period.time);
        let most =
            moved.iter().enumerate().map(|(k, by)| (by * if k < nv { 1.0 } else { time }).abs()).fold(0.0, f64::max);
        if most > SOON * DEPENDS * found.scale {
            return Ok(());
        }
        let why = "the motion near the start comes to rest, and a state at rest has no period: start nearer to an orbit, or choose another section";
        Err(self.refusal(format!("[section] {}: {why}", self.section.name())))
    }

    /// The orbit near the start of the scene, at the first value of the parameter.
    pub(super) fn first(&self, plan: &Timed) -> Result<(Look, usize), OrbitError> {
        let mut start = State { q: plan.q.clone(), qd: plan.qd.clone() };
        for _ in 0..self.before {
            start = self.period(plan, &start)?.end;
        }
        let found = match &self.vary {
            Some(vary) => self.find_at_end(plan, start, vary.from),
            None => self.find_from(plan, start, None),
        }?;
        self.check_modulo(plan, &found.0.x)?;
        self.check_motion(plan, &found.0)?;
        Ok(found)
    }

    /// Finds the orbit at an end of the range of the parameter; without the derivative by it where values beyond it are inadmissible, as of a
    /// coefficient of restitution at 1.
    pub(super) fn find_at_end(&self, plan: &Timed, start: State, value: f64) -> Result<(Look, usize), OrbitError> {
        match self.find_from(plan, start.clone(), self.parameter(value).as_ref()) {
            Err(OrbitError::Run(SimError::Scene { .. })) => self.find_from(plan, start, None),
            found => found,
        }
    }

    /// Finds the orbit near a state on the section; returns also the number of runs with derivatives.
    pub(super) fn find_from(
        &self,
        plan: &Timed,
        start: State,
        parameter: Option<&ByParameter>,
    ) -> Result<(Look, usize), OrbitError> {
        let mut here = self.look(plan, start, parameter)?;
        for iteration in 1..=STEPS {
            let step = self.step(&here);
            let (mut share, mut next, mut refused) = (1.0, None, None);
            while share > 1e-3 {
                let tried = self.moved(plan, &here, &(&step * share)).and_then(|x| self.look(plan, x, parameter));
                match tried {
                    // As a share alone it decreases where x runs away.
                    Ok(there) if there.size < here.size && there.most <= here.most => {
                        next = Some(there);
                        break;
                    }
                    Err(error @ (OrbitError::File { .. } | OrbitError::NotConverged { .. })) => return Err(error),
                    Err(error) => {
                        refused.get_or_insert(error);
                        share *= 0.5;
                    }
                    Ok(_) => share *= 0.5,
                }
            }
            let ended = match next {
                Some(there) => {
                    let slow = there.size > 0.5 * here.size;
                    here = there;
                    slow
                }
                None => true,
            };
            if here.size <= self.converged() && (ended || here.size <= f64::EPSILON) {
                return Ok((here, iteration + 1));
            }
            if ended && share <= 1e-3 {
                let residual = here.size;
                return Err(match refused {
                    None => OrbitError::NotConverged { iterations: iteration, residual },
                    // Not the start of the scene.
                    Some(why @ OrbitError::Run(SimError::Overlap { .. })) => {
                        OrbitError::LeadsInside { iterations: iteration, residual, why: Box::new(why) }
                    }
                    Some(why) => why,
                });
            }
        }
        Err(OrbitError::NotConverged { iterations: STEPS, residual: here.size })
    }

    /// A residual that is the error of the integration.
    pub(super) fn converged(&self) -> f64 {
        (100.0 * self.tolerance).max(1e-13)
    }

    pub(super) fn look(&self, plan: &Timed, x: State, parameter: Option<&ByParameter>) -> Result<Look, OrbitError> {
        let found = self.differentiated(plan, &x, parameter)?;
        let chain = &plan.simulation.chain;
        let mut r = difference(chain, &x, &found.period.end)?;
        self.modulo.iter().for_each(|&k| r[k] = 0.0);
        let (nv, time) = (chain.nv(), found.period.time);
        let weight = |k: usize| if k < nv { 1.0 } else { time };
        let numbers = x.q.iter().copied().chain(x.qd.iter().map(|v| time * v));
        let scale = numbers.fold(0.0, |most: f64, number| most.max(number.abs()));
        // Near zero a share of x itself has no digits.
        let first = plan.q.iter().copied().chain(plan.qd.iter().map(|v| time * v));
        let scale = first.fold(scale, |most: f64, number| most.max(SMALL * number.abs()));
        let most = (0..r.len()).map(|k| (r[k] * weight(k)).abs()).fold(0.0, f64::max);
        let scale = scale.max(SMALL * SMALL);
        Ok(Look { x, found, r, most, size: most / scale, scale })
    }

    /// The numbers of a change of a state that must return.
    pub(super) fn unknown(&self, numbers: usize) -> Vec<usize> {
        (0..numbers).filter(|k| !self.modulo.contains(k)).collect()
    }

    /// DP without the rows and columns of `modulo` coordinates.
    pub(super) fn returning(&self, map: &DMatrix<f64>) -> DMatrix<f64> {
        let unknown = self.unknown(map.nrows());
        map.select_rows(&unknown).select_columns(&unknown)
    }

    /// δ.
    fn step(&self, here: &Look) -> DVector<f64> {
        let n = here.r.len();
        let unknown = self.unknown(n);
        let matrix = DMatrix::identity(unknown.len(), unknown.len()) - self.returning(&here.found.by_state);
        let solved = least_norm(&matrix, &here.r.select_rows(&unknown), FAMILY);
        let mut step = DVector::zeros(n);
        unknown.iter().zip(solved.iter()).for_each(|(k, x)| step[*k] = *x);
        step
    }

    /// x + δ, on the constraints of P(x).
    pub(super) fn moved(&self, plan: &Timed, here: &Look, step: &DVector<f64>) -> Result<State, OrbitError> {
        let chain = &plan.simulation.chain;
        let end = &here.found.period.end;
        let change = step - &here.r;
        let nv = chain.nv();
        let q = chain.integrate(&end.q, change.rows(0, nv).as_slice(), 1.0).map_err(carom_sim::SimError::from)?;
        let qd: Vec<f64> = end.qd.iter().zip(change.rows(nv, nv).iter()).map(|(v, x)| v + x).collect();
        let (mut q, qd) = self.session(plan, end)?.nearest(&q, &qd)?;
        self.keep(chain, &here.x, &mut q);
        Ok(State { q, qd })
    }

    pub(super) fn orbit(&self, here: Look, iterations: usize, plan: &Timed) -> Orbit {
        let Look { x, found, size, .. } = here;
        let multipliers = self.multipliers(&found.by_state);
        let stability = Stability::of(&multipliers);
        Orbit {
            start: x,
            start_time: plan.simulation.start_time,
            period: found.period.time,
            events: found.period.events,
            multipliers,
            stability,
            residual: size,
            iterations,
            map: found.by_state,
        }
    }

    /// The eigenvalues of DP without `modulo` coordinates, by decreasing absolute value.
    pub(super) fn multipliers(&self, map: &DMatrix<f64>) -> Vec<Complex<f64>> {
        let mut found = eigenvalues(&self.returning(map));
        found.sort_by(|a, b| b.norm().total_cmp(&a.norm()).then(b.im.total_cmp(&a.im)));
        found
    }
}

/// The eigenvalues of a matrix. The QR iteration of nalgebra may go on without end in blocks of numbers that are rounding: then each attempt is
/// less accurate than the one before, and beyond [`FAMILY`] there are none.
fn eigenvalues(matrix: &DMatrix<f64>) -> Vec<Complex<f64>> {
    let most = matrix.len().max(1) * STEPS;
    let accuracies = std::iter::successors(Some(f64::EPSILON), |accuracy| Some(10.0 * accuracy));
    let mut schurs = accuracies.take_while(|it| *it < FAMILY).map(|it| Schur::try_new(matrix.clone(), it, most));
    let found = schurs.find_map(|it| it).map(|schur| schur.complex_eigenvalues());
    found.map_or_else(|| vec![Complex::from(f64::NAN); matrix.nrows()], |all| all.iter().copied().collect())
}

/// The change from one state to another: a displacement and a change of velocity.
pub(super) fn difference(chain: &Chain, from: &State, to: &State) -> Result<DVector<f64>, OrbitError> {
    let mut change = chain.difference(&from.q, &to.q).map_err(carom_sim::SimError::from)?;
    change.extend(to.qd.iter().zip(&from.qd).map(|(b, a)| b - a));
    Ok(DVector::from_vec(change))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What dry friction holds in a period comes back, and what is left of its velocity is rounding: some of these matrices have no Schur form to
    /// machine accuracy within the steps.
    #[test]
    fn eigenvalues_of_matrices_with_blocks_of_rounding_are_found() {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut stalled = 0;
        for case in 0..2000 {
            let n = 6 + case % 3;
            let matrix = DMatrix::from_fn(n, n, |i, j| match (i < 3, j < 3) {
                (true, true) => f64::from(u8::from(i == j)),
                (true, false) => rng.f64() - 0.5,
                _ => 10f64.powi(-14 - i32::from(rng.u8(0..8))) * (rng.f64() - 0.5) * f64::from(rng.u8(0..2)),
            });
            stalled += u32::from(Schur::try_new(matrix.clone(), f64::EPSILON, n * n * STEPS).is_none());
            let mut sizes: Vec<f64> = eigenvalues(&matrix).iter().map(|x| x.norm()).collect();
            sizes.sort_by(f64::total_cmp);
            let exact = |k: usize| if k < n - 3 { 0.0 } else { 1.0 };
            let apart = sizes.iter().enumerate().map(|(k, x)| (x - exact(k)).abs()).fold(0.0, f64::max);
            assert!(apart < 1e-7, "{case}: {sizes:?}");
        }
        assert!(stalled > 0);
    }
}
