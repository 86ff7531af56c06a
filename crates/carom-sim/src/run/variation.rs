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
//! A and P are central differences of f, with an error of some 1e-9 of its size. S is integrated over each step of the motion by
//! Gauss's method of order 8 (Hairer, Nørsett & Wanner 1993, section II.7), which needs A at four times of the step only: the
//! equations are linear, so its stages are the solution of one linear system.

use super::run_state::Run;
use super::sampler::Step;
use crate::error::SimError;
use crate::motion::{Hold, Lasting};
use crate::state::Space;
use nalgebra::{DMatrix, DVector, Matrix4, Vector3, Vector4};

/// Step of the central differences of f, relative to the size of the number that is changed.
const DIFFERENCE: f64 = 1e-6;
/// Largest step of these differences relative to the slowest slip.
const SHORT: f64 = 0.01;

/// Gauss's collocation method with four stages.
pub(crate) struct Gauss {
    a: Matrix4<f64>,
    b: Vector4<f64>,
}

impl Gauss {
    /// The weights: Σⱼ aᵢⱼ cⱼᵏ⁻¹ = cᵢᵏ/k and Σⱼ bⱼ cⱼᵏ⁻¹ = 1/k for k = 1 … 4.
    pub fn new() -> Self {
        let c = Step::POINTS;
        let powers = Matrix4::from_fn(|j, k| c[j].powi(k as i32));
        let inverse = powers.try_inverse().unwrap_or_else(|| unreachable!("the points differ"));
        let a = Matrix4::from_fn(|i, k| c[i].powi(k as i32 + 1) / (k + 1) as f64) * inverse;
        let b = (Vector4::from_fn(|k, _| 1.0 / (k + 1) as f64).transpose() * inverse).transpose();
        Self { a, b }
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

    /// The directions in which x can change: with floating joints a quaternion keeps its length. Columns; their number is that of
    /// q̇ twice and of the rest.
    pub fn tangent(&self, x: &[f64]) -> DMatrix<f64> {
        let chain = &self.motion.sim.chain;
        let (nq, nv) = (chain.nq(), chain.nv());
        let mut tangent = DMatrix::identity(x.len(), x.len() - nq + nv);
        if nq != nv {
            tangent.fill(0.0);
            let mut unit = vec![0.0; nv];
            for j in 0..nv {
                unit[j] = 1.0;
                chain.q_rate_into(&x[..nq], &unit, &mut tangent.column_mut(j).as_mut_slice()[..nq]);
                unit[j] = 0.0;
            }
            for j in nv..tangent.ncols() {
                tangent[(j - nv + nq, j)] = 1.0;
            }
        }
        tangent
    }

    /// Whether a contact slides with friction.
    pub fn slips(&self) -> bool {
        let slips = |own: &Lasting| matches!(own.hold, Hold::Slides { toward } | Hold::Starts { toward } if toward != Vector3::zeros());
        self.motion.active.lasting.iter().any(slips)
    }

    /// A.
    fn slope(&mut self, time: f64, x: &[f64]) -> Result<DMatrix<f64>, SimError> {
        let tangent = self.tangent(x);
        let mut slope = DMatrix::zeros(x.len(), tangent.ncols());
        // The direction of a slow slip is strongly curved in the velocities: differences of fourth order, on this side of its stop.
        let slips = self.slips();
        let y = self.y_of(x);
        if slips {
            self.motion.follow_slip(time, &y)?;
        }
        let slowest = self.motion.slowest_slip(time, &y)?;
        for (j, direction) in tangent.column_iter().enumerate() {
            let size = x
                .iter()
                .zip(direction.iter())
                .fold(1.0, |most: f64, (x, d)| if *d == 0.0 { most } else { most.max(x.abs()) });
            let h = (DIFFERENCE * size).min(SHORT * slowest).max(DIFFERENCE * DIFFERENCE);
            let moved = |h: f64| x.iter().zip(direction.iter()).map(|(x, d)| x + h * d).collect::<Vec<_>>();
            let mut difference = (self.field(time, &moved(h))? - self.field(time, &moved(-h))?) / (2.0 * h);
            if slips {
                let wide = (self.field(time, &moved(2.0 * h))? - self.field(time, &moved(-2.0 * h))?) / (4.0 * h);
                difference = (difference * 4.0 - wide) / 3.0;
            }
            slope.set_column(j, &difference);
        }
        Ok(if tangent.is_square() { slope } else { slope * left_inverse(&tangent) })
    }
}

/// T⁺ of a matrix of full column rank.
pub(crate) fn left_inverse(t: &DMatrix<f64>) -> DMatrix<f64> {
    let gram = t.tr_mul(t).cholesky().unwrap_or_else(|| unreachable!("the directions are independent"));
    gram.solve(&t.transpose())
}

/// S after one step. `changed`: for each parameter, whose columns are the last ones, the runs with the parameter changed by −2, −1,
/// 1 and 2 times a number, and that number.
pub(crate) fn over_step<A: Space>(
    gauss: &Gauss,
    step: &Step,
    run: &mut Run<A>,
    changed: &mut [([Run<A>; 4], f64)],
    s: &DMatrix<f64>,
) -> Result<DMatrix<f64>, SimError> {
    let (n, k) = s.shape();
    let h = step.end - step.start;
    let first = k - changed.len();
    let memory = run.remembered();
    let (mut matrix, mut right) = (DMatrix::identity(4 * n, 4 * n), DMatrix::zeros(4 * n, k));
    for i in 0..4 {
        let time = step.start + h * Step::POINTS[i];
        let x = run.x_of(&step.states[i], &memory);
        let slope = run.slope(time, &x)?;
        let mut push = &slope * s;
        for (p, ([_, less, more, _], by)) in changed.iter_mut().enumerate() {
            // The direction of slip of this time: friction acts against it.
            less.motion.active.lasting.clone_from(&run.motion.active.lasting);
            more.motion.active.lasting.clone_from(&run.motion.active.lasting);
            let difference = (more.field(time, &x)? - less.field(time, &x)?) / (2.0 * *by);
            let column = push.column(first + p) + difference;
            push.set_column(first + p, &column);
        }
        for j in 0..4 {
            let block = &slope * (-h * gauss.a[(i, j)]);
            let mut own = matrix.view_mut((i * n, j * n), (n, n));
            own += block;
        }
        right.view_mut((i * n, 0), (n, k)).copy_from(&push);
    }
    let failed = || SimError::Integration { time: step.start, reason: "the variational equations are singular".into() };
    run.y_of(&run.x_of(&step.states[3], &memory)); // the differences have changed what is remembered
    let stages = matrix.lu().solve(&right).ok_or_else(failed)?;
    let mut after = s.clone();
    for i in 0..4 {
        after += stages.view((i * n, 0), (n, k)) * (h * gauss.b[i]);
    }
    Ok(after)
}
