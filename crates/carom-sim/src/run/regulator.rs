//! Feedback gains along a motion with impacts: the linear-quadratic regulator of its linearisation.
//!
//! | symbol | size | meaning |
//! | --- | --- | --- |
//! | δx | n | deviation of the state from the motion |
//! | A, B | n×n, n×m | derivatives of ẋ by x, and by forces of the m motors |
//! | Ξ | – | saltation matrix of an event: δx⁺ = Ξ δx⁻ |
//! | T | n×2nv | derivatives of x by displacement and velocity |
//! | Q, R | n×n, m×m | weights |
//! | V | n×n | least cost from now on, ½ δxᵀV δx |
//! | X, Y | n×n | V = Y X⁻¹ |
//!
//! The forces δτ = −K δx that minimise ½ ∫ (δxᵀQ δx + δτᵀR δτ) dt + ½ δx(T)ᵀ Q_T δx(T) have K = R⁻¹BᵀV with
//!
//! ```text
//! −V̇ = Q + AᵀV + V A − V B R⁻¹ Bᵀ V,   V(T) = Q_T,   V⁻ = Ξᵀ V⁺ Ξ at an event
//! ```
//!
//! (A. E. Bryson, Y.-C. Ho, *Applied Optimal Control*, 1975, chapter 5; through impacts N. J. Kong, C. Li, G. Council, A. M. Johnson, *Hybrid iLQR
//! model predictive control for contact implicit stabilization on legged robots*, 2023). Instead of Riccati's equation the linear one
//!
//! ```text
//! Ẋ = A X − B R⁻¹ Bᵀ Y,   Ẏ = −Q X − AᵀY
//! ```
//!
//! is integrated from the end of each step, X = 1 and Y = V there, to its begin, by Gauss's method, as the variational equations (`variation.rs`).
//!
//! Where contacts or loops are closed, δx has the directions of their motions only, N. The equations keep them, but have others, too, in which no
//! force acts: V is V on N, and zero across it, Π V Π with the orthogonal projection Π onto N.

use super::follow::{Broken, differentiate};
use super::linear_run::{AllColumns, Maps, Piece, Tangents};
use super::trajectory::Step;
use super::variation::{Gauss, LinearStep, left_inverse, tangent};
use crate::error::{SimError, require};
use crate::model::{Drive, Feedback, FeedbackRow, Motor, Parameter, TorqueTable, motors};
use crate::plan::Plan;
use crate::state::{CLEAR, EXACT, between};
use carom_chain::Chain;
use nalgebra::{DMatrix, DVector};

/// What a regulator is to do. Its deviations of positions, velocities and joint forces cost the same, each for as long as the others (Bryson &
/// Ho's rule).
#[derive(Debug, Clone, PartialEq)]
pub struct Regulator {
    /// Of each displacement, rad, m.
    pub position: f64,
    /// Of each number of qd, rad/s, m/s.
    pub velocity: f64,
    /// Of the force of each motor, N m, N.
    pub force: f64,
    /// For how long a deviation lasts that costs what it costs at the end of the motion, s.
    pub end: f64,
    /// Least number of rows.
    pub rows: usize,
    /// Names of the joints that have feedback; none: the joints with forces in the motion, or without forces all with one coordinate.
    pub joints: Vec<String>,
}

impl Default for Regulator {
    fn default() -> Self {
        Self { position: 0.01, velocity: 0.1, force: 1.0, end: 1.0, rows: 200, joints: Vec::new() }
    }
}

/// A step of the motion, with what is known at its points.
struct Stretch {
    equations: Vec<[DMatrix<f64>; 2]>,
    /// Its end, from which its length leads back to its begin.
    h: f64,
    times: [f64; 4],
    states: Vec<(Vec<f64>, Vec<f64>)>,
    /// Π at its start and at its points.
    projections: Vec<DMatrix<f64>>,
    impacts: usize,
}

enum Part {
    Stretch(Stretch),
    Event(DMatrix<f64>),
}

/// The parts of a motion, first one first.
struct Parts<'c> {
    chain: &'c Chain,
    motors: usize,
    all: Vec<Part>,
    next: Option<(Step, usize, Vec<DMatrix<f64>>)>,
    columns: AllColumns,
    broken: Option<Broken>,
}

impl Maps for Parts<'_> {
    fn step(&mut self, step: &Step, impacts: usize, tangents: Tangents) -> Result<(), SimError> {
        self.next = Some((step.clone(), impacts, tangents()?.into_iter().map(onto).collect()));
        Ok(())
    }

    fn add(&mut self, piece: Piece) -> Option<()> {
        self.columns.pass(&piece)?;
        match piece {
            Piece::Start(_) => {}
            Piece::Step(linear) => {
                let next = self.next.take()?;
                self.all.push(Part::Stretch(self.stretch(&linear, next)));
            }
            Piece::Event(event) => {
                if event.around.is_none() && !event.happened.is_empty() {
                    let reason =
                        "it ends an accumulation of impacts, whose number differs beside the motion".to_owned();
                    self.broken.get_or_insert(Broken { time: event.time, reason });
                }
                self.all.push(Part::Event(event.map));
            }
        }
        Some(())
    }

    fn columns(&mut self) -> Option<DMatrix<f64>> {
        self.columns.columns()
    }
}

/// The orthogonal projection onto the span of columns.
fn onto(columns: DMatrix<f64>) -> DMatrix<f64> {
    let n = columns.nrows();
    let decomposed = columns.svd(true, false);
    let least = CLEAR * decomposed.singular_values.max();
    let mut projection = DMatrix::zeros(n, n);
    for (unit, size) in decomposed.u.iter().flat_map(|u| u.column_iter()).zip(&decomposed.singular_values) {
        if *size > least {
            projection += unit * unit.transpose();
        }
    }
    projection
}

impl Parts<'_> {
    fn stretch(&self, linear: &LinearStep, (step, impacts, projections): (Step, usize, Vec<DMatrix<f64>>)) -> Stretch {
        let (nq, nv) = (self.chain.nq(), self.chain.nv());
        let h = linear.length();
        let states = step.states.iter().map(|y| (y[..nq].to_vec(), y[nq..nq + nv].to_vec())).collect();
        let times = Step::POINTS.map(|c| step.start + h * c);
        Stretch { equations: linear.equations(self.motors), h, times, states, projections, impacts }
    }

    /// T of a state, for x of this length: of q and q̇ alone.
    fn tangent(&self, q: &[f64], n: usize) -> DMatrix<f64> {
        tangent(self.chain, q, n).columns(0, 2 * self.chain.nv()).into_owned()
    }

    /// Q at a state, for x of this length.
    fn weight(&self, q: &[f64], n: usize, costs: &DVector<f64>) -> DMatrix<f64> {
        let inverse = left_inverse(&self.tangent(q, n));
        inverse.tr_mul(&(DMatrix::from_diagonal(costs) * &inverse))
    }
}

impl Plan {
    /// Gains along the motion of the plan, which has no feedback: of a linear-quadratic regulator through its impacts. A motion with them,
    /// [`Drive::Feedback`], follows the motion of the plan.
    ///
    /// # Errors
    /// As [`Simulation::linear_run`](crate::Simulation::linear_run); [`SimError::Setting`] for deviations that are not positive;
    /// [`SimError::Feedback`] for another controller than none, constant forces and a table, and for joints without a motor;
    /// [`SimError::NoDerivative`] where an accumulation of impacts ends.
    pub fn feedback(&self, duration: f64, regulator: &Regulator) -> Result<Feedback, SimError> {
        let Regulator { position, velocity, force, end, rows, ref joints } = *regulator;
        let each = [("deviation of positions", position), ("deviation of velocities", velocity)];
        for (what, value) in each.into_iter().chain([("deviation of forces", force), ("time of the end", end)]) {
            require(value > 0.0 && value.is_finite(), what, value, "it must be positive")?;
        }
        let rule = "it must be 1 to 100 000: each is a matrix of gains in memory";
        require((1..=100_000).contains(&rows), "number of rows of the feedback", rows as f64, rule)?;
        let mut plan = self.clone();
        let (forces, table) = table(&plan, duration, rows)?;
        let chain = &self.simulation.chain;
        let (nv, motors) = (chain.nv(), chosen(chain, joints, &table)?);
        plan.simulation.drive = Drive::Table(table);
        let parameters: Vec<_> = motors.iter().map(|motor| Parameter::of_table(*motor)).collect();
        let columns = AllColumns::new(2 * nv, motors.len());
        let mut parts = Parts { chain, motors: motors.len(), all: Vec::new(), next: None, columns, broken: None };
        let start = (plan.q.as_slice(), plan.qd.as_slice());
        let last = differentiate(&plan.simulation, plan.in_plane(), (start, duration), &parameters, &mut parts)?;
        if let Some(Broken { time, reason }) = last.broken.or_else(|| parts.broken.take()) {
            return Err(SimError::NoDerivative { time, reason });
        }
        let costs = DVector::from_fn(2 * nv, |i, _| (if i < nv { position } else { velocity }).powi(-2));
        let n = parts.columns.s.nrows();
        let mut v = parts.weight(&last.last.q, n, &costs) * end;
        let gauss = Gauss::new();
        let mut rows = Vec::new();
        for part in parts.all.iter().rev() {
            match part {
                Part::Event(map) => v = map.tr_mul(&(v * map)),
                Part::Stretch(own) => {
                    let q: Vec<_> = own.states.iter().map(|(q, _)| parts.weight(q, v.nrows(), &costs)).collect();
                    let singular = || SimError::Integration {
                        time: own.times[0],
                        reason: "Riccati's equation is singular".to_owned(),
                    };
                    let (before, stages) = own.back(&gauss, &v, &q, force * force).ok_or_else(singular)?;
                    v = before;
                    for (i, value) in stages.into_iter().enumerate().rev() {
                        let (state, [_, b]) = (&own.states[i], &own.equations[i]);
                        let by = b.tr_mul(&value) * parts.tangent(&state.0, value.nrows()) * (force * force);
                        let mut gains = DMatrix::zeros(nv, 2 * nv);
                        motors.iter().enumerate().for_each(|(k, motor)| gains.row_mut(motor.v).copy_from(&by.row(k)));
                        let (q, qd) = state.clone();
                        rows.push(FeedbackRow { time: own.times[i], impacts: own.impacts, q, qd, gains });
                    }
                }
            }
        }
        rows.reverse();
        Ok(Feedback { forces, rows })
    }
}

impl Stretch {
    /// V at the begin of the step, from V at its end, and V at its points. `weights`: Q at the points; `ease`: R⁻¹.
    fn back(
        &self,
        gauss: &Gauss,
        v: &DMatrix<f64>,
        weights: &[DMatrix<f64>],
        ease: f64,
    ) -> Option<(DMatrix<f64>, Vec<DMatrix<f64>>)> {
        let (n, h) = (v.nrows(), self.h);
        let hamiltonian = |([a, b], q): (&[DMatrix<f64>; 2], &DMatrix<f64>)| {
            let mut all = DMatrix::zeros(2 * n, 2 * n);
            all.view_mut((0, 0), (n, n)).copy_from(a);
            all.view_mut((0, n), (n, n)).copy_from(&(b * b.transpose() * -ease));
            all.view_mut((n, 0), (n, n)).copy_from(&-q);
            all.view_mut((n, n), (n, n)).copy_from(&-a.transpose());
            all
        };
        let equations: Vec<_> = self.equations.iter().zip(weights).map(hamiltonian).collect();
        let mut end = DMatrix::zeros(2 * n, n);
        end.rows_mut(0, n).fill_with_identity();
        end.rows_mut(n, n).copy_from(v);
        // Stages Zᵢ = Hᵢ Wᵢ with Wᵢ = W(1) − h Σⱼ (bⱼ − aᵢⱼ) Zⱼ.
        let left = |i: usize, j: usize| h * (gauss.b[j] - gauss.a[(i, j)]);
        let mut matrix = DMatrix::identity(8 * n, 8 * n);
        let mut stages = DMatrix::zeros(8 * n, n);
        for (i, own) in equations.iter().enumerate() {
            for j in 0..4 {
                let mut block = matrix.view_mut((2 * n * i, 2 * n * j), (2 * n, 2 * n));
                block += own * left(i, j);
            }
            stages.rows_mut(2 * n * i, 2 * n).copy_from(&(own * &end));
        }
        matrix.lu().solve_mut(&mut stages).then_some(())?;
        let at = |weight: &dyn Fn(usize) -> f64| {
            let mut w = end.clone();
            (0..4).for_each(|j| w -= stages.rows(2 * n * j, 2 * n) * weight(j));
            let x = w.rows(0, n).transpose().lu();
            // V X = Y, so Xᵀ Vᵀ = Yᵀ; V is symmetric.
            let v = x.solve(&w.rows(n, n).transpose())?;
            Some((&v + v.transpose()) * 0.5)
        };
        let on = |place: usize, v: DMatrix<f64>| &self.projections[place] * v * &self.projections[place];
        let points = (0..4).map(|i| Some(on(1 + i, at(&|j| left(i, j))?))).collect::<Option<Vec<_>>>()?;
        Some((on(0, at(&|j| h * gauss.b[j])?), points))
    }
}

/// The motors of these joints; without names those with forces, or all.
fn chosen(chain: &Chain, joints: &[String], table: &TorqueTable) -> Result<Vec<Motor>, SimError> {
    let all = motors(chain);
    let name = |motor: &Motor| chain.joint_of_velocity(motor.v).map_or("", |joint| joint.name.as_str());
    let known = || all.iter().map(name).collect::<Vec<_>>().join(", ");
    let refused = SimError::Feedback;
    if all.is_empty() {
        return Err(refused(format!("'{}' has no joint with one coordinate, which a motor could drive", chain.name())));
    }
    if let Some(joint) = joints.iter().find(|joint| !all.iter().any(|motor| name(motor) == **joint)) {
        return Err(refused(format!("'{joint}' is no joint with one coordinate: there are {}", known())));
    }
    let acts = |motor: &Motor| table.forces.iter().any(|forces| forces[motor.v] != 0.0);
    let any = all.iter().any(acts);
    let taken = |motor: &Motor| {
        if joints.is_empty() { !any || acts(motor) } else { joints.iter().any(|own| own == name(motor)) }
    };
    Ok(all.iter().copied().filter(taken).collect())
}

/// The forces of the motors of a plan without feedback, as a table; and the same with so many rows that a motion has no longer steps.
fn table(plan: &Plan, duration: f64, rows: usize) -> Result<(Option<TorqueTable>, TorqueTable), SimError> {
    let sim = &plan.simulation;
    let refused = || {
        let name = sim.drive.description();
        let after = sim
            .after_impact
            .as_ref()
            .map_or_else(String::new, |after| format!(", after_impact = \"{}\"", after.name()));
        let rule = format!(
            "controller = \"{name}\"{after}: it is added to a motion without it: set controller = \"off\", \"constant\" or \
             \"torque-file\", and no after_impact"
        );
        SimError::Feedback(rule)
    };
    if sim.after_impact.is_some() {
        return Err(refused());
    }
    let forces = match &sim.drive {
        Drive::Table(own) => Some(own.clone()),
        Drive::Constant(own) => Some(TorqueTable { times: vec![sim.start_time], forces: vec![own.clone()] }),
        drive if drive.each_robot().all(|(_, own)| *own == Drive::Off) => None,
        _ => return Err(refused()),
    };
    let none = || TorqueTable { times: vec![sim.start_time], forces: vec![vec![0.0; sim.chain.nv()]] };
    let own = forces.clone().unwrap_or_else(none);
    let legs = rows.div_ceil(4);
    let mut fine: Vec<(f64, Vec<f64>)> = own.times.iter().copied().zip(own.forces.iter().cloned()).collect();
    for k in 0..=legs {
        let time = sim.start_time + duration * k as f64 / legs as f64;
        if own.times.iter().all(|other| (other - time).abs() > EXACT * duration) {
            let (before, after, share) = between(&own.times, time);
            let mixed = own.forces[before].iter().zip(&own.forces[after]).map(|(a, b)| a + (b - a) * share);
            fine.push((time, mixed.collect()));
        }
    }
    fine.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (times, rows) = fine.into_iter().unzip();
    Ok((forces, TorqueTable { times, forces: rows }))
}
