//! The variational equations of one contact mode, dS/dt = A S + P, along the steps of the integrator.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | x | n | q, q̇, deflections of bristles, and what compliant contacts remember | `x` |
//! | f | n | ẋ in the mode | [`field`] |
//! | S | n×k | derivatives of x by the quantities asked for | `s` |
//! | A, P | n×n, n×k | derivatives of f by x, and by the quantities at fixed x | `slope`, `push` |
//! | c, a, b | s | points and weights of Gauss's method | [`Gauss`] |
//!
//! A and P are those of the linearised motion (`motion/slope.rs`), with central differences of the forces that have no closed form. S is
//! integrated over each step of the motion by Gauss's method of order 8 (Hairer, Nørsett & Wanner 1993, section II.7), which needs A at
//! four times of the step only: the equations are linear, so its stages are the solution of one linear system.

use super::changed::{AT, Changed, DIFFERENCE, SHORT, WEIGHTS};
use super::run_state::Run;
use super::trajectory::Step;
use crate::error::SimError;
use crate::model::Place;
use crate::motion::{Hold, Kink, Lasting, Linear};
use crate::state::{ROUNDING, STEPS, Space};
use carom_chain::Chain;
use nalgebra::{DMatrix, DVector, DVectorView, Dyn, LU, Matrix4, Vector3, Vector4};

/// Gauss's collocation method with four stages.
pub(crate) struct Gauss {
    pub a: Matrix4<f64>,
    pub b: Vector4<f64>,
}

impl Gauss {
    /// The weights a: Σⱼ aᵢⱼ cⱼᵏ⁻¹ = cᵢᵏ/k for k = 1 … 4.
    pub fn new() -> Self {
        let c = Step::POINTS;
        let powers = Matrix4::from_fn(|j, k| c[j].powi(k as i32));
        let inverse = powers.try_inverse().unwrap_or_else(|| unreachable!("the points differ"));
        let a = Matrix4::from_fn(|i, k| c[i].powi(k as i32 + 1) / (k + 1) as f64) * inverse;
        Self { a, b: Vector4::from(Step::WEIGHTS) }
    }
}

/// The numbers that compliant contacts remember: damping, and the penetration of the last change between loading and unloading.
fn memory(lasting: &mut [Lasting]) -> impl Iterator<Item = &mut f64> {
    let pressing = lasting.iter_mut().filter_map(|own| match &mut own.hold {
        Hold::Presses { damping, deepest } => Some([Some(damping), Some(deepest).filter(|depth| depth.is_finite())]),
        _ => None,
    });
    pressing.flatten().flatten()
}

/// The variational equations at a time.
struct Slopes {
    /// A.
    slope: DMatrix<f64>,
    /// P.
    push: DMatrix<f64>,
    /// Where a joint floats the map from x to the directions in which it can change.
    inverse: Option<DMatrix<f64>>,
}

impl<A: Space> Run<'_, '_, A> {
    /// x at the present state.
    pub fn x(&mut self) -> Vec<f64> {
        let (y, memory) = (self.y.clone(), self.remembered());
        self.x_of(&y, &memory)
    }

    /// What the compliant contacts remember.
    pub fn remembered(&mut self) -> Vec<f64> {
        memory(&mut self.motion.active.lasting).map(|number| *number).collect()
    }

    /// x of a state, without the works that it contains, and of what compliant contacts remember.
    pub fn x_of(&self, y: &[f64], memory: &[f64]) -> Vec<f64> {
        let n = self.motion.sim.chain.nq() + self.motion.sim.chain.nv();
        [&y[..n], &y[n + 2..], memory].concat()
    }

    /// Sets what compliant contacts remember, and returns the state of x.
    pub fn y_of(&mut self, x: &[f64]) -> Vec<f64> {
        let n = self.motion.sim.chain.nq() + self.motion.sim.chain.nv();
        let tail = self.y.len() - n - 2;
        for (number, x) in memory(&mut self.motion.active.lasting).zip(&x[n + tail..]) {
            *number = *x;
        }
        [&x[..n], &[0.0, 0.0], &x[n..n + tail]].concat()
    }

    /// f.
    pub fn field(&mut self, time: f64, x: &[f64]) -> Result<DVector<f64>, SimError> {
        let n = self.motion.sim.chain.nq() + self.motion.sim.chain.nv();
        let y = self.y_of(x);
        let mut rate = vec![0.0; y.len()];
        let held = if self.motion.moves_freely() { None } else { Some(self.motion.accelerations(time, &y)?) };
        self.motion.rate(time, &y, held.as_ref(), &mut rate)?;
        let mut f = DVector::zeros(x.len());
        f.rows_mut(0, n).copy_from_slice(&rate[..n]);
        f.rows_mut(n, rate.len() - n - 2).copy_from_slice(&rate[n + 2..]);
        Ok(f)
    }

    /// The [`tangent`] of a state.
    pub fn tangent(&self, x: &[f64]) -> DMatrix<f64> {
        let chain = &self.motion.sim.chain;
        tangent(chain, &x[..chain.nq()], x.len())
    }

    /// Whether a contact slides with friction.
    pub fn slips(&self) -> bool {
        let slips = |own: &Lasting| matches!(own.hold, Hold::Slides { toward } | Hold::Starts { toward } if toward != Vector3::zeros());
        self.motion.active.lasting.iter().any(slips)
    }

    fn slopes(&mut self, time: f64, x: &[f64], changed: &mut [&mut Changed<A>]) -> Result<Slopes, SimError> {
        let tangent = self.tangent(x);
        let y = self.y_of(x);
        if self.slips() {
            self.motion.follow_slip(time, &y)?;
        }
        let kinks = self.motion.kinks(time, &y)?;
        let mut push = DMatrix::zeros(x.len(), changed.len());
        let mut slope = DMatrix::zeros(x.len(), tangent.ncols());
        if self.motion.is_linear() {
            self.linear_slopes((time, x), (&y, &tangent, &kinks), changed, (&mut slope, &mut push))?;
        } else {
            for (j, direction) in tangent.column_iter().enumerate() {
                let nearest = self.nearest_kink((time, x), direction, &kinks)?;
                slope.set_column(j, &self.difference(x, direction, nearest, |run, x| run.field(time, x))?);
            }
            for (p, changed) in changed.iter_mut().enumerate() {
                let mut column = push.column_mut(p);
                for (run, weight) in changed.runs_in(&self.motion.active, (&kinks, |run| run.motion.kinks(time, &y)))? {
                    column += run.field(time, x)? * weight;
                }
            }
        }
        if tangent.is_square() {
            return Ok(Slopes { slope, push, inverse: None });
        }
        let inverse = left_inverse(&tangent);
        Ok(Slopes { slope: slope * &inverse, push, inverse: Some(inverse) })
    }

    /// A along the tangent and P, by the linearised motion.
    fn linear_slopes(
        &mut self,
        (time, x): (f64, &[f64]),
        (y, tangent, kinks): (&[f64], &DMatrix<f64>, &[Kink]),
        changed: &mut [&mut Changed<A>],
        (slope, push): (&mut DMatrix<f64>, &mut DMatrix<f64>),
    ) -> Result<(), SimError> {
        let (nq, nv) = (self.motion.sim.chain.nq(), self.motion.sim.chain.nv());
        let at = self.motion.linear(time, y)?;
        let mut changes = Vec::with_capacity(tangent.ncols() + changed.len());
        let bristles = 3 * self.motion.bristles.len();
        let decoupled = self.motion.decoupled(&at);
        for (j, direction) in tangent.column_iter().enumerate() {
            let mut change = if let Some(slopes) = &decoupled {
                let mut change = DVector::zeros(nv + bristles);
                if let Some(slopes) = slopes.get(j / nv) {
                    change[j % nv] = -slopes[j % nv];
                }
                change
            } else {
                let nearest = self.nearest_kink((time, x), direction, kinks)?;
                self.difference(x, direction, nearest, |run, x| {
                    let y = run.y_of(x);
                    run.motion.balance(time, &y, &at)
                })?
            };
            if let Some(by) = at.inertial.get(j / nv) {
                let mut forces = change.rows_mut(0, nv);
                forces -= by.column(j % nv);
            }
            changes.push(change);
        }
        self.y_of(x); // the differences have changed what is remembered
        let len = changes.first().map_or(0, DVector::len);
        for changed in changed {
            changes.push(self.push_of(changed, (time, y), (&at, kinks), len)?);
        }
        for (j, qdd) in self.motion.answers(y, &at, &changes)?.iter().enumerate() {
            let columns = tangent.ncols();
            let mut column = if j < columns { slope.column_mut(j) } else { push.column_mut(j - columns) };
            column.rows_mut(nq, nv).copy_from_slice(qdd);
            let bends = changes[j].len() - bristles;
            column.rows_mut(nq + nv, bristles).copy_from(&changes[j].rows(bends, bristles));
        }
        // q̇ of the coordinates: (q, q̇) by itself where no joint floats.
        for (j, direction) in tangent.column_iter().enumerate().take(2 * nv) {
            if nq == nv {
                slope.view_mut((0, j), (nq, 1)).copy_from(&direction.rows(nq, nv));
                continue;
            }
            let rate = self.difference(x, direction, f64::INFINITY, |run, x| {
                let mut rate = DVector::zeros(nq);
                run.motion.sim.chain.q_rate_into(&x[..nq], &x[nq..nq + nv], rate.as_mut_slice());
                Ok(rate)
            })?;
            slope.view_mut((0, j), (nq, 1)).copy_from(&rate);
        }
        Ok(())
    }

    /// δ̄ of a parameter, `len` numbers: see `motion/slope.rs`.
    fn push_of(
        &mut self,
        changed: &mut Changed<A>,
        (time, y): (f64, &[f64]),
        (at, kinks): (&Linear, &[Kink]),
        len: usize,
    ) -> Result<DVector<f64>, SimError> {
        let mut change = DVector::zeros(len);
        match changed.parameter.place() {
            Place::Motor { number, joint } => change[joint.v] = self.motion.motor_by((number, &joint), (time, y), at),
            Place::Restitution | Place::Friction if self.motion.is_free(at) => {}
            _ => {
                for (run, weight) in changed.runs_in(&self.motion.active, (kinks, |run| run.motion.kinks(time, y)))? {
                    let mut part = run.motion.balance(time, y, at)?;
                    // Those of all are the same, unless gravity or the chain is changed.
                    let (own, sim) = (run.motion.sim, self.motion.sim);
                    if own.gravity != sim.gravity || own.chain != sim.chain {
                        let needed = run.motion.inertial_forces(y, at)?;
                        part.as_mut_slice().iter_mut().zip(needed.iter()).for_each(|(part, needed)| *part -= needed);
                    }
                    change.axpy(weight, &part, 1.0);
                }
            }
        }
        Ok(change)
    }

    /// How many times this direction leads from x to the nearest kink of the contact forces: see [`Motion::kinks`](crate::motion::Motion::kinks).
    fn nearest_kink(
        &mut self,
        (time, x): (f64, &[f64]),
        direction: DVectorView<f64>,
        kinks: &[Kink],
    ) -> Result<f64, SimError> {
        if kinks.is_empty() {
            return Ok(f64::INFINITY);
        }
        let beside: Vec<f64> = x.iter().zip(direction.iter()).map(|(x, d)| x + DIFFERENCE * d).collect();
        let y = self.y_of(&beside);
        let there = self.motion.kinks(time, &y)?;
        Ok(DIFFERENCE * Kink::nearest(kinks, &there))
    }

    /// The derivative of a function of x along a direction, by a central difference of fourth order. Near a kink, so many times the direction
    /// away, the forces are strongly curved, and it must not be within the difference.
    pub fn difference(
        &mut self,
        x: &[f64],
        direction: DVectorView<f64>,
        nearest: f64,
        mut of: impl FnMut(&mut Self, &[f64]) -> Result<DVector<f64>, SimError>,
    ) -> Result<DVector<f64>, SimError> {
        let moving = x.iter().zip(direction.iter()).filter(|(_, d)| **d != 0.0);
        let size = moving.fold(1.0, |most: f64, (x, _)| most.max(x.abs()));
        let h = (DIFFERENCE * size).min(SHORT * nearest).max(ROUNDING * size);
        let mut found: Option<DVector<f64>> = None;
        for (times, weight) in AT.iter().zip(WEIGHTS) {
            let moved: Vec<f64> = x.iter().zip(direction.iter()).map(|(x, d)| x + times * h * d).collect();
            let part = of(self, &moved)? * (weight / h);
            found = Some(match found {
                Some(sum) => sum + part,
                None => part,
            });
        }
        Ok(found.unwrap_or_default())
    }
}

/// T⁺ of a matrix of full column rank.
pub(crate) fn left_inverse(t: &DMatrix<f64>) -> DMatrix<f64> {
    let gram = t.tr_mul(t).cholesky().unwrap_or_else(|| unreachable!("the directions are independent"));
    gram.solve(&t.transpose())
}

/// One step of a motion, linearised: A and P at the four points of Gauss's method.
///
/// Where no joint floats, q̇ is part of x: A = (0, E; B, C) with the unit matrix E in the columns of q̇, and the stages of q follow from
/// those of the rest. Of n = nq + r numbers then r remain, otherwise all (nq = 0 here):
///
/// ```text
/// Zᵢ − h Σⱼ (aᵢⱼ Cᵢ + h (a²)ᵢⱼ Bᵢ) Zⱼ = Bᵢ (S_q + h cᵢ S_v) + Cᵢ S_z + Pᵢ
/// S_z⁺ = S_z + h Σ bᵢ Zᵢ,   S_q⁺ = S_q + h S_v + h² Σ (bᵀa)ⱼ V_j
/// ```
#[derive(Debug, Clone)]
pub(crate) struct LinearStep {
    start: f64,
    h: f64,
    /// (q, q̇) at the four points.
    states: Vec<Vec<f64>>,
    /// Displacement and velocity by x at the four points, where a joint floats; elsewhere they are the first of x.
    inverses: Vec<DMatrix<f64>>,
    /// nq and r.
    sizes: (usize, usize),
    /// (B, C), r×n.
    slopes: Vec<DMatrix<f64>>,
    /// The columns of P of the parameters that act during the step, r×p.
    pushes: Vec<DMatrix<f64>>,
    /// The numbers of these parameters.
    acting: Vec<usize>,
}

impl LinearStep {
    pub fn of<A: Space>(step: &Step, run: &mut Run<A>, changed: &mut [Changed<A>]) -> Result<Self, SimError> {
        run.motion.sim.go_on(step.start)?;
        let h = step.end - step.start;
        let memory = run.remembered();
        let (nq, nv) = (run.motion.sim.chain.nq(), run.motion.sim.chain.nv());
        let known = if nq == nv { nq } else { 0 };
        let (mut slopes, mut pushes) = (Vec::with_capacity(4), Vec::with_capacity(4));
        let acts = |changed: &Changed<A>| changed.acts(step.start, step.end);
        let acting = changed.iter().enumerate().filter(|(_, it)| acts(it)).map(|(p, _)| p).collect();
        let mut changed: Vec<&mut Changed<A>> = changed.iter_mut().filter(|it| acts(it)).collect();
        let (mut n, mut states, mut inverses) = (0, Vec::with_capacity(4), Vec::new());
        for (point, state) in Step::POINTS.iter().zip(&step.states) {
            let x = run.x_of(state, &memory);
            n = x.len();
            states.push(x[..nq + nv].to_vec());
            let Slopes { slope, push, inverse } = run.slopes(step.start + h * point, &x, &mut changed)?;
            inverses.extend(inverse.map(|inverse| inverse.rows(0, 2 * nv).into_owned()));
            slopes.push(slope.rows(known, n - known).into_owned());
            pushes.push(push.rows(known, n - known).into_owned());
        }
        run.y_of(&run.x_of(&step.states[3], &memory));
        Ok(Self { start: step.start, h, states, inverses, sizes: (known, n - known), slopes, pushes, acting })
    }

    /// Times, weights (s) and states (q, q̇) of the quadrature over it.
    pub fn quadrature(&self) -> impl Iterator<Item = (f64, f64, &[f64])> {
        let points = Step::POINTS.iter().zip(Step::WEIGHTS).zip(&self.states);
        points.map(|((c, b), state)| (self.start + self.h * c, self.h * b, state.as_slice()))
    }

    /// The derivatives of a number by x at a point of the quadrature, by those by displacement and velocity.
    fn by_x(&self, point: usize, by: &[f64]) -> DVector<f64> {
        let (nq, r) = self.sizes;
        let mut all = DVector::zeros(nq + r);
        match self.inverses.get(point) {
            Some(inverse) => all.gemv_tr(1.0, inverse, &DVector::from_column_slice(by), 0.0),
            None => all.rows_mut(0, by.len()).copy_from_slice(by),
        }
        all
    }

    /// Its length, s.
    pub fn length(&self) -> f64 {
        self.h
    }

    /// A and P at the four points, of all numbers of x and of this number of parameters.
    pub fn equations(&self, parameters: usize) -> Vec<[DMatrix<f64>; 2]> {
        let (nq, r) = self.sizes;
        let n = nq + r;
        let whole = |(slope, push): (&DMatrix<f64>, &DMatrix<f64>)| {
            let mut all = [DMatrix::zeros(n, n), DMatrix::zeros(n, parameters)];
            all[0].view_mut((0, nq), (nq, nq)).fill_with_identity();
            all[0].rows_mut(nq, r).copy_from(slope);
            for (k, &p) in self.acting.iter().enumerate() {
                all[1].view_mut((nq, p), (r, 1)).copy_from(&push.column(k));
            }
            all
        };
        self.slopes.iter().zip(&self.pushes).map(whole).collect()
    }

    /// The matrix of the stages Z, or its transpose.
    fn stages(&self, gauss: &Gauss, adjoint: bool) -> LU<f64, Dyn, Dyn> {
        let (nq, r) = self.sizes;
        let square = gauss.a * gauss.a;
        let mut matrix = DMatrix::identity(4 * r, 4 * r);
        for (i, slope) in self.slopes.iter().enumerate() {
            for j in 0..4 {
                let mut block = slope.columns(nq, r) * (-self.h * gauss.a[(i, j)]);
                let mut by_velocity = block.columns_mut(0, nq);
                by_velocity -= slope.columns(0, nq) * (self.h * self.h * square[(i, j)]);
                let (at, block) = if adjoint { ((j * r, i * r), block.transpose()) } else { ((i * r, j * r), block) };
                let mut own = matrix.view_mut(at, (r, r));
                own += block;
            }
        }
        matrix.lu()
    }

    /// S after the step, by the columns of S before it and of the changes of the parameters.
    pub fn forward(&self, gauss: &Gauss, s: &DMatrix<f64>, changes: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let (nq, r) = self.sizes;
        let (h, k) = (self.h, s.ncols());
        let mut right = DMatrix::zeros(4 * r, k);
        let changes = changes.select_rows(&self.acting);
        for i in 0..4 {
            let mut middle = s.clone();
            let mut positions = middle.rows_mut(0, nq);
            positions += s.rows(nq, nq) * (h * Step::POINTS[i]);
            right.view_mut((i * r, 0), (r, k)).copy_from(&(&self.slopes[i] * middle + &self.pushes[i] * &changes));
        }
        if r > 0 && !self.stages(gauss, false).solve_mut(&mut right) {
            return None;
        }
        let ahead = gauss.a.tr_mul(&gauss.b);
        let mut after = s.clone();
        let mut positions = after.rows_mut(0, nq);
        positions += s.rows(nq, nq) * h;
        for i in 0..4 {
            let mut positions = after.rows_mut(0, nq);
            positions += right.view((i * r, 0), (nq, k)) * (h * h * ahead[i]);
            let mut rest = after.rows_mut(nq, r);
            rest += right.view((i * r, 0), (r, k)) * (h * gauss.b[i]);
        }
        Some(after)
    }

    /// λ before the step, from λ after it, a column for each number that is differentiated; the derivatives by the parameters are added to
    /// `gradients`. It is the transpose of [`forward`](Self::forward): both agree to rounding.
    ///
    /// `along`: for each number none, or its derivatives by displacement and velocity at the four points, where x is
    /// S_q + h cᵢ S_v + h² Σ (a²)ᵢⱼ V_j and S_z + h Σ aᵢⱼ Zⱼ.
    pub fn reverse(
        &self,
        gauss: &Gauss,
        lambda: &DMatrix<f64>,
        along: &[&[Vec<f64>]],
        gradients: &mut DMatrix<f64>,
    ) -> Option<DMatrix<f64>> {
        let (nq, r) = self.sizes;
        let (h, m) = (self.h, lambda.ncols());
        let ahead = gauss.a.tr_mul(&gauss.b);
        let mut right = DMatrix::zeros(4 * r, m);
        for i in 0..4 {
            right.rows_mut(i * r, r).copy_from(&(lambda.rows(nq, r) * (h * gauss.b[i])));
            let mut velocities = right.rows_mut(i * r, nq);
            velocities += lambda.rows(0, nq) * (h * h * ahead[i]);
        }
        let mut before = lambda.clone();
        let mut velocities = before.rows_mut(nq, nq);
        velocities += lambda.rows(0, nq) * h;
        let square = gauss.a * gauss.a;
        for (k, own) in along.iter().enumerate() {
            for (i, by) in own.iter().enumerate() {
                let by = self.by_x(i, by);
                let mut column = before.column_mut(k);
                column += &by;
                let mut velocities = column.rows_mut(nq, nq);
                velocities.axpy(h * Step::POINTS[i], &by.rows(0, nq), 1.0);
                for j in 0..4 {
                    let mut stage = right.column_mut(k);
                    stage.rows_mut(j * r, r).axpy(h * gauss.a[(i, j)], &by.rows(nq, r), 1.0);
                    stage.rows_mut(j * r, nq).axpy(h * h * square[(i, j)], &by.rows(0, nq), 1.0);
                }
            }
        }
        let weights = match self.iterated(gauss, &right) {
            Some(weights) => weights,
            None => {
                self.stages(gauss, true).solve_mut(&mut right).then_some(())?;
                right
            }
        };
        for i in 0..4 {
            let own = weights.rows(i * r, r);
            let back = self.slopes[i].tr_mul(&own);
            before += &back;
            let mut velocities = before.rows_mut(nq, nq);
            velocities += back.rows(0, nq) * (h * Step::POINTS[i]);
            let by = self.pushes[i].tr_mul(&own);
            for (row, &p) in self.acting.iter().enumerate() {
                let mut gradient = gradients.row_mut(p);
                gradient += by.row(row);
            }
        }
        Some(before)
    }

    /// The solution w of the transposed equations of the stages, w = `right` + h (…)ᵀ w, by iteration, without their matrix: steps of the explicit
    /// integrators are so short that few iterations reach rounding. `None` where they are not.
    fn iterated(&self, gauss: &Gauss, right: &DMatrix<f64>) -> Option<DMatrix<f64>> {
        let (nq, r) = self.sizes;
        let square = gauss.a * gauss.a;
        let mut weights = right.clone();
        for _ in 0..STEPS {
            let mut next = right.clone();
            for (i, slope) in self.slopes.iter().enumerate() {
                let back = slope.tr_mul(&weights.rows(i * r, r));
                for j in 0..4 {
                    let mut own = next.rows_mut(j * r, r);
                    own += back.rows(nq, r) * (self.h * gauss.a[(i, j)]);
                    let mut velocities = next.rows_mut(j * r, nq);
                    velocities += back.rows(0, nq) * (self.h * self.h * square[(i, j)]);
                }
            }
            let settled = next.column_iter().zip(weights.column_iter()).all(|(new, old)| {
                let apart = new.iter().zip(old.iter()).fold(0.0, |most: f64, (a, b)| most.max((a - b).abs()));
                apart <= f64::EPSILON * new.amax()
            });
            weights = next;
            if settled {
                return Some(weights);
            }
        }
        None
    }
}

/// T of a configuration, for x of this length: the directions in which x can change, as with floating joints a quaternion keeps its length.
/// Columns; their number is that of q̇ twice and of the rest.
pub(super) fn tangent(chain: &Chain, q: &[f64], n: usize) -> DMatrix<f64> {
    let (nq, nv) = (chain.nq(), chain.nv());
    let mut tangent = DMatrix::identity(n, n - nq + nv);
    if nq != nv {
        tangent.fill(0.0);
        let mut unit = vec![0.0; nv];
        for j in 0..nv {
            unit[j] = 1.0;
            chain.q_rate_into(q, &unit, &mut tangent.column_mut(j).as_mut_slice()[..nq]);
            unit[j] = 0.0;
        }
        for j in nv..tangent.ncols() {
            tangent[(j - nv + nq, j)] = 1.0;
        }
    }
    tangent
}
