//! Computes the rows of a study for an arm in the plane (D = 2) or in space (D = 3).
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | D | 1 | 2 in the plane, 3 in space | – |
//! | R | D×D | contact axes as columns: tangent of the approach, (second tangent,) normal | `axes` |
//! | J | D×nv | Jacobian of the contact point, axes of the chain | `response.jacobian` |
//! | H | D×D | Delassus matrix J M⁻¹ Jᵀ, axes of the chain; in contact axes RᵀHR | `response.delassus`, `h` |
//! | X = M⁻¹Jᵀ | nv×D | change of the joint velocities per unit impulse | `response.response` |
//! | u⁻ | D | contact velocity before the impact, contact axes: speed · (cos α, (0,) −sin α) | `u` |
//! | qd⁻ | nv | X H⁻¹ u⁻: the joint velocities of least kinetic energy with contact velocity u⁻; others with `motion` | `qd_minus` |
//!
//! J, H and X are those of [`carom_chain::PointResponse`]. A row allocates no memory, except where H is nearly
//! singular: its principal directions are then computed from its factor ([`ContactInertia`]).

use super::axis::{Axis, advance, places};
use super::pointing::Pointing;
use super::quantity::{Class, Quantity, Wants};
use super::reach::{Reach, Triangle};
use super::strike::Condition;
use carom_chain::algebra::Algebra;
use carom_chain::{
    Chain, ChainError, ContactInertia, FramePoint, Keep, Point, PointResponse, ResponseMemory, Spatial, ToolMotion,
    Workspace,
};
use carom_impact::AnyLaw;
use nalgebra::{DMatrix, DVector, SMatrix, SVector, Vector3};

/// A joint with a velocity limit.
#[derive(Debug, Clone)]
pub(super) struct Limit {
    /// Index of qd, and the ratio of the joint's velocity to that entry (mimic joints).
    pub v: usize,
    pub ratio: f64,
    /// rad/s or m/s.
    pub velocity: f64,
}

/// How the tip moves before the impact.
pub(super) struct Tool {
    /// The chain in space.
    pub chain: Chain,
    pub at: FramePoint,
    pub motion: ToolMotion,
}

/// How the poses are given.
pub(super) enum Poses<const D: usize> {
    /// The pose axes are the entries of q.
    Joints,
    /// The pose axes are coordinates of the contact point, then the branch of the inverse kinematics.
    Tip { reach: Box<Reach<D>>, branches: Vec<usize> },
}

/// The data that rows are computed from.
pub(super) struct Arm<A: Algebra, const D: usize> {
    pub chain: Chain<A>,
    pub point: Point<A>,
    /// Axes of the chain in the world frame, as columns, and its origin there, m.
    pub basis: SMatrix<f64, 3, D>,
    pub origin: Vector3<f64>,
    /// Contact axes for each normal, in the axes of the chain.
    pub surfaces: Vec<SMatrix<f64, D, D>>,
    pub poses: Poses<D>,
    /// Joints with position limits: index of q, ratio, shift, lower and upper limit. Empty with `limits = false`.
    pub ranges: Vec<(usize, f64, f64, f64, f64)>,
    pub limits: Vec<Limit>,
    pub tangential_restitution: bool,
    /// Inertia added to the diagonal of M: infinite at locked joints. Empty without any.
    pub added: Vec<f64>,
    /// Which q̇⁻ are taken, if not those of least kinetic energy.
    pub tool: Option<Tool>,
    /// All axes: those of the pose, then normal, approach, speed, restitution, tangential restitution, friction, law.
    pub axes: Vec<Axis>,
    /// The laws of the last axis; a row sets their coefficients.
    pub laws: Vec<AnyLaw>,
    pub quantities: Vec<Quantity>,
    pub wants: Wants,
}

/// Number of axes after those of the pose.
pub(super) const CONDITIONS: usize = 7;

/// Computes rows in memory of its own.
pub(super) trait Worker {
    /// Computes row `index` into `out`, a number for each column.
    fn row(&mut self, index: u64, out: &mut [f64]);
    /// The configuration of a row, if it has one.
    fn pose(&mut self, index: u64) -> Option<Vec<f64>>;
    /// Computes the row of configuration `q` under the conditions of row `index`.
    fn row_at(&mut self, index: u64, q: &[f64], out: &mut [f64]);
    /// World position of the contact point, m.
    fn tip(&mut self, q: &[f64]) -> Option<Vector3<f64>>;
    /// The part of the joint motion `along` that lies in the null space of J.
    fn self_motion(&mut self, q: &[f64], along: &[f64]) -> Option<Vec<f64>>;
    /// Moves the contact point to world position `tip` by Newton's method from `q`. Returns whether it converged within the
    /// position limits.
    fn hold(&mut self, q: &mut [f64], tip: Vector3<f64>) -> bool;
}

/// An arm in the plane or in space.
pub(super) trait Engine: Send + Sync {
    fn worker(&self) -> Box<dyn Worker + '_>;
    fn axes(&self) -> &[Axis];
    fn nv(&self) -> usize;
    /// Number of conditions on the pose: of the contact point's position, and of its direction. An arm with more joints is
    /// redundant.
    fn conditions(&self) -> usize;
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize> Engine for Arm<A, D> {
    fn worker(&self) -> Box<dyn Worker + '_> {
        let nv = self.chain.nv();
        Box::new(Hand {
            arm: self,
            workspace: self.chain.workspace(),
            at: None,
            places: vec![0; self.axes.len()],
            varying: (0..self.axes.len()).filter(|k| self.axes[*k].varies()).collect(),
            values: self.axes.iter().map(|axis| axis.value(0)).collect(),
            condition: None,
            approach: (f64::NAN, (0.0, 0.0)),
            pose: Pose { class: None, q: vec![0.0; self.chain.nq()], principal: None },
            triangle: None,
            memory: ResponseMemory::default(),
            tool: self.tool.as_ref().map(|tool| tool.chain.workspace()),
            energy: None,
            qd_minus: vec![0.0; nv],
            jump: vec![0.0; nv],
        })
    }

    fn axes(&self) -> &[Axis] {
        &self.axes
    }

    fn nv(&self) -> usize {
        self.chain.nv()
    }

    fn conditions(&self) -> usize {
        D + self.pointing().map_or(0, Pointing::rows)
    }
}

/// Configuration, kinematics and inertia, which do not depend on the impact conditions. Kept for the following rows.
pub(super) struct Pose {
    /// Why the row has no numbers; `None` if the pose is valid.
    class: Option<Class>,
    pub q: Vec<f64>,
    /// Principal directions of H, computed on demand.
    pub principal: Option<ContactInertia>,
}

/// Computes rows: poses in this file, impacts in `strike.rs`.
pub(super) struct Hand<'a, A: Algebra, const D: usize> {
    pub arm: &'a Arm<A, D>,
    pub workspace: Workspace<A>,
    /// The row that `places` and `pose` belong to.
    at: Option<u64>,
    pub places: Vec<u64>,
    /// Indices of the axes that vary, in their order.
    varying: Vec<usize>,
    /// Value of each axis at its place.
    pub values: Vec<f64>,
    /// The impact conditions at these places, computed on demand.
    pub condition: Option<Condition<'a, D>>,
    /// The last approach angle, with its sine and cosine.
    pub approach: (f64, (f64, f64)),
    pub pose: Pose,
    /// The solutions for the tip's position, if they have a closed form.
    triangle: Option<Triangle>,
    /// The response at the pose, for chains with a fused pass; of others it is in the workspace.
    memory: ResponseMemory<A>,
    /// Memory of [`Arm::tool`].
    pub tool: Option<Workspace<Spatial<f64>>>,
    /// T⁻ of `qd_minus`, J, where it is not the least.
    pub energy: Option<f64>,
    pub qd_minus: Vec<f64>,
    pub jump: Vec<f64>,
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize> Worker for Hand<'_, A, D> {
    fn row(&mut self, index: u64, out: &mut [f64]) {
        self.take_pose(index);
        self.tell(out);
    }

    fn pose(&mut self, index: u64) -> Option<Vec<f64>> {
        self.take_pose(index);
        let there = !matches!(self.pose.class, Some(Class::Unreachable | Class::OutsideLimits | Class::Refused));
        there.then(|| self.pose.q.clone())
    }

    fn row_at(&mut self, index: u64, q: &[f64], out: &mut [f64]) {
        self.at = None;
        self.take_places(index);
        self.at = None;
        self.pose.q.copy_from_slice(q);
        self.weigh_pose();
        self.tell(out);
    }

    fn tip(&mut self, q: &[f64]) -> Option<Vector3<f64>> {
        let at = self.workspace.update(&self.arm.chain, q).ok()?.position(self.arm.point);
        Some(self.arm.origin + self.arm.basis * at)
    }

    fn self_motion(&mut self, q: &[f64], along: &[f64]) -> Option<Vec<f64>> {
        let (_, jacobian) = self.conditions(q, &SVector::zeros())?;
        let along = DVector::from_column_slice(along);
        // subtract the minimum-norm joint motion with the same velocity of the tip
        let tip = &jacobian * &along;
        let moves = jacobian.svd(true, true).solve(&tip, 1e-12).ok()?;
        Some((along - moves).as_slice().to_vec())
    }

    fn hold(&mut self, q: &mut [f64], tip: Vector3<f64>) -> bool {
        let arm = self.arm;
        let own = arm.basis.tr_mul(&(tip - arm.origin));
        for _ in 0..20 {
            let Some((missing, jacobian)) = self.conditions(q, &own) else { return false };
            if missing.norm() <= 1e-13 * (1.0 + own.norm()) {
                return arm.in_range(q);
            }
            let Ok(step) = jacobian.svd(true, true).solve(&missing, 1e-9) else { return false };
            for body in arm.chain.bodies() {
                q[body.q_index] += step[body.v_index];
            }
        }
        false
    }
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize> Arm<A, D> {
    /// Number of axes of the pose.
    pub(super) fn pose_axes(&self) -> usize {
        self.axes.len() - CONDITIONS
    }

    /// The direction that the tip keeps.
    fn pointing(&self) -> Option<&Pointing<D>> {
        if let Poses::Tip { reach, .. } = &self.poses { reach.pointing.as_ref() } else { None }
    }

    fn in_range(&self, q: &[f64]) -> bool {
        self.ranges.iter().all(|&(i, ratio, shift, lower, upper)| {
            let at = ratio * q[i] + shift;
            (lower..=upper).contains(&at)
        })
    }
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize> Hand<'_, A, D> {
    /// What the position `tip` (axes of the chain) and the direction lack at `q`, and the Jacobian of both.
    fn conditions(&mut self, q: &[f64], tip: &SVector<f64, D>) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let Arm { chain, point, .. } = self.arm;
        let kin = self.workspace.update(chain, q).ok()?;
        let mut jacobian = DMatrix::zeros(D, chain.nv());
        kin.point_jacobian_into(*point, &mut jacobian);
        let at = kin.position(*point);
        let mut missing = DVector::from_column_slice((tip - at).as_slice());
        if let Some(pointing) = self.arm.pointing() {
            let (ahead, m) = (pointing.ahead(*point), D + pointing.rows());
            let (position, turning) = (jacobian, kin.point_jacobian(ahead));
            let turned = kin.position(ahead) - at;
            missing = missing.resize_vertically(m, 0.0);
            (D..m).for_each(|i| missing[i] = pointing.missing(i - D, &turned));
            let entry = |i: usize, v: usize| match i.checked_sub(D) {
                None => position[(i, v)],
                Some(k) => pointing.slope(k, v, [&position, &turning]),
            };
            jacobian = DMatrix::from_fn(m, chain.nv(), entry);
        }
        Some((missing, jacobian))
    }

    /// Sets the places and values of a row. Returns the first axis that changed, the number of axes if none did.
    fn take_places(&mut self, index: u64) -> usize {
        let axes = &self.arm.axes;
        let moved = match self.at.replace(index) {
            Some(at) if at == index => return axes.len(),
            Some(at) if at + 1 == index => advance(axes, &self.varying, &mut self.places),
            _ => {
                places(axes, index, &mut self.places);
                0
            }
        };
        for &k in self.varying.iter().filter(|k| **k >= moved) {
            self.values[k] = axes[k].value(self.places[k]);
            if k >= self.arm.pose_axes() {
                self.condition = None;
            }
        }
        moved
    }

    /// Computes the pose of a row unless it is the present one.
    fn take_pose(&mut self, index: u64) {
        let arm = self.arm;
        let moved = self.take_places(index);
        if moved >= arm.pose_axes() {
            return;
        }
        let own = &self.values[..arm.pose_axes()];
        match &arm.poses {
            Poses::Joints => self.pose.q.copy_from_slice(own),
            Poses::Tip { reach, branches } => {
                let coordinates = own.len() - 1;
                let branch = branches[self.places[coordinates] as usize];
                let (target, q) = (&own[..coordinates], &mut self.pose.q);
                let found = if reach.is_closed() {
                    // both elbows have the same triangle
                    if moved < coordinates {
                        self.triangle = reach.triangle(target);
                    }
                    if let Some(triangle) = &self.triangle {
                        reach.bend(triangle, branch, q);
                    }
                    Ok(self.triangle.is_some())
                } else {
                    reach.seek(&arm.chain, arm.point, &mut self.workspace, target, branch, q)
                };
                if !matches!(found, Ok(true)) {
                    self.pose.class = Some(if found.is_ok() { Class::Unreachable } else { Class::Refused });
                    return;
                }
            }
        }
        self.weigh_pose();
    }

    /// Checks the limits and computes the response at the pose's q.
    fn weigh_pose(&mut self) {
        self.pose.principal = None;
        self.pose.class = if self.arm.in_range(&self.pose.q) { None } else { Some(Class::OutsideLimits) };
        if self.pose.class.is_none() && self.weigh().is_err() {
            self.pose.class = Some(Class::Refused);
        }
    }

    fn weigh(&mut self) -> Result<(), ChainError> {
        let Arm { chain, point, added, .. } = self.arm;
        let (q, normal) = (&self.pose.q, SVector::zeros());
        if !chain.has_fused_pass() {
            return self.workspace.update(chain, q)?.contact(*point, normal, added).map(|_| ());
        }
        chain.contact_point(*point)?.visit(q, normal, added, &mut self.memory, Keep)?;
        if self.memory.response().is_doubtful() {
            self.workspace.update(chain, q)?.check_inertia(added)?;
        }
        Ok(())
    }

    /// The response at the pose. Its normal is zero, as several normals may share it.
    pub(super) fn response(&self) -> PointResponse<'_, A> {
        if self.arm.chain.has_fused_pass() { self.memory.response() } else { self.workspace.contact() }
    }

    /// Computes the row of the present places and pose into `out`.
    fn tell(&mut self, out: &mut [f64]) {
        let arm = self.arm;
        out.fill(f64::NAN);
        let mut at = 0;
        let mut put = |x: f64, out: &mut [f64]| {
            out[at] = x;
            at += 1;
        };
        let normal_axis = arm.pose_axes();
        for &k in &self.varying {
            if k == normal_axis && !arm.axes[k].names().is_empty() {
                let normal = arm.basis * arm.surfaces[self.places[k] as usize].column(D - 1);
                normal.iter().for_each(|x| put(*x, out));
            } else {
                put(self.values[k], out);
            }
        }
        if matches!(arm.poses, Poses::Tip { .. }) {
            let there = self.pose.class.is_none_or(|class| class != Class::Unreachable);
            self.pose.q.iter().for_each(|x| put(if there { *x } else { f64::NAN }, out));
        }
        let class_at = at;
        out[class_at] = match self.pose.class {
            Some(class) => class,
            None => self.strike(&mut out[class_at + 1..]).unwrap_or(Class::Refused),
        }
        .code();
    }
}
