//! From a row's places to its numbers: one arm, in the plane or in space.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | D | 1 | 2 in the plane, 3 in space | – |
//! | R | D×D | contact axes as columns: along the approach, (sideways,) normal | `axes` |
//! | J | D×nv | Jacobian of the tip, the chain's own axes | `jacobian` |
//! | H | D×D | J M⁻¹ Jᵀ | `delassus` |
//! | M⁻¹Jᵀ | nv×D | joint velocities that unit impulses give | `response` |
//! | u⁻ | D | contact velocity before, contact axes: speed · (cos α, (0,) −sin α) | `u` |
//! | qd⁻ | nv | M⁻¹Jᵀ H⁻¹ u⁻: the joint velocities of least kinetic energy that move the tip so | `qd_minus` |
//!
//! A row with an ordinary pose allocates nothing but its law. Where H is nearly singular, the careful and slower route
//! of [`carom_chain::ContactInertia`] decides, which works on a factor of H and not on H.

use super::axis::{Axis, advance, places};
use super::quantity::{Class, Quantity};
use super::reach::Reach;
use super::strike::Condition;
use carom_chain::algebra::Algebra;
use carom_chain::{Chain, ChainError, ContactInertia, Point, Workspace};
use carom_impact::AnyLaw;
use nalgebra::{DMatrix, SMatrix, SVector, Vector3};

/// Below this share of the largest, a pivot of H has lost too many digits for the quick route.
pub(super) const DOUBTFUL: f64 = 1e-9;

/// A joint that has a velocity limit.
#[derive(Debug, Clone)]
pub(super) struct Limit {
    /// Its entry of qd, and its ratio to it.
    pub v: usize,
    pub ratio: f64,
    /// rad/s or m/s.
    pub velocity: f64,
}

/// Where the poses come from.
pub(super) enum Poses<const D: usize> {
    /// The pose axes are the entries of q.
    Joints,
    /// The pose axes are the tip's coordinates, and then the branch.
    Tip { reach: Box<Reach<D>>, branches: Vec<usize> },
}

/// Everything that a row is computed from.
pub(super) struct Arm<A: Algebra, const D: usize> {
    pub chain: Chain<A>,
    pub point: Point<A>,
    /// The chain's own axes in the world, as columns; its origin there.
    pub basis: SMatrix<f64, 3, D>,
    pub origin: Vector3<f64>,
    /// Contact axes in the chain's own, for each normal.
    pub surfaces: Vec<SMatrix<f64, D, D>>,
    pub poses: Poses<D>,
    /// (lower, upper) of every moving joint: entry of q, ratio, shift, limits. Empty if limits don't count.
    pub ranges: Vec<(usize, f64, f64, f64, f64)>,
    pub limits: Vec<Limit>,
    pub tangential_restitution: bool,
    /// All axes: those of the pose, then normal, approach, speed, restitution, tangential restitution, friction, law.
    pub axes: Vec<Axis>,
    /// Those of the last axis; their coefficients are a row's.
    pub laws: Vec<AnyLaw>,
    pub quantities: Vec<Quantity>,
}

/// How many axes follow those of the pose.
pub(super) const CONDITIONS: usize = 7;

/// Answers rows, one after another, in memory of its own.
pub(super) trait Worker {
    /// Fills a row: a number for each column.
    fn row(&mut self, index: u64, out: &mut [f64]);
    /// The configuration of a row, if there is one.
    fn pose(&mut self, index: u64) -> Option<Vec<f64>>;
    /// The row of a configuration of one's own, under the conditions of row `index`.
    fn row_at(&mut self, index: u64, q: &[f64], out: &mut [f64]);
    /// World position of the tip.
    fn tip(&mut self, q: &[f64]) -> Option<Vector3<f64>>;
    /// Motion of the joints that leaves the tip where it is, nearest to `along`: its part in the null space of J.
    fn self_motion(&mut self, q: &[f64], along: &[f64]) -> Option<Vec<f64>>;
    /// Brings the tip to a world position by Newton's steps from `q`, within the joints' ranges. Whether it came there.
    fn hold(&mut self, q: &mut [f64], tip: Vector3<f64>) -> bool;
}

/// An arm of either kind.
pub(super) trait Engine: Send + Sync {
    fn worker(&self) -> Box<dyn Worker + '_>;
    fn axes(&self) -> &[Axis];
    fn nv(&self) -> usize;
    /// How many coordinates of the tip there are: joints beyond them make an arm redundant.
    fn dimension(&self) -> usize;
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
            pose: Pose {
                class: None,
                q: vec![0.0; self.chain.nq()],
                tip: SVector::zeros(),
                jacobian: DMatrix::zeros(D, nv),
                delassus: SMatrix::zeros(),
                response: DMatrix::zeros(nv, D),
                careful: None,
            },
            row: vec![0.0; nv],
            column: vec![0.0; nv],
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

    fn dimension(&self) -> usize {
        D
    }
}

/// What does not depend on how the surface is met. Kept from row to row, as it depends on the row's number alone.
pub(super) struct Pose<const D: usize> {
    /// Why there is none.
    class: Option<Class>,
    pub q: Vec<f64>,
    /// The tip, the chain's own coordinates.
    pub tip: SVector<f64, D>,
    pub jacobian: DMatrix<f64>,
    pub delassus: SMatrix<f64, D, D>,
    pub response: DMatrix<f64>,
    /// The careful route, once it was needed.
    careful: Option<ContactInertia>,
}

/// Computes rows: the pose here, the impact in `strike.rs`.
pub(super) struct Hand<'a, A: Algebra, const D: usize> {
    pub arm: &'a Arm<A, D>,
    pub workspace: Workspace<A>,
    /// The row whose places and pose these are.
    at: Option<u64>,
    pub places: Vec<u64>,
    /// The axes that vary, in their order.
    varying: Vec<usize>,
    /// Each axis' value at its place.
    pub values: Vec<f64>,
    /// How the surface is met at these places, once it was needed.
    pub condition: Option<Condition<'a, D>>,
    /// The last angle of approach, with its sine and cosine.
    pub approach: (f64, (f64, f64)),
    pub pose: Pose<D>,
    row: Vec<f64>,
    column: Vec<f64>,
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
        let mut jacobian = DMatrix::zeros(D, self.arm.chain.nv());
        self.workspace.update(&self.arm.chain, q).ok()?.point_jacobian_into(self.arm.point, &mut jacobian);
        let along = nalgebra::DVector::from_column_slice(along);
        // the minimum-norm joint motion that moves the tip as `along` does, taken away
        let tip = &jacobian * &along;
        let moves = jacobian.svd(true, true).solve(&tip, 1e-12).ok()?;
        Some((along - moves).as_slice().to_vec())
    }

    fn hold(&mut self, q: &mut [f64], tip: Vector3<f64>) -> bool {
        let arm = self.arm;
        let own = arm.basis.tr_mul(&(tip - arm.origin));
        let mut jacobian = DMatrix::zeros(D, arm.chain.nv());
        for _ in 0..20 {
            let Ok(kin) = self.workspace.update(&arm.chain, q) else { return false };
            let missing = own - kin.position(arm.point);
            if missing.norm() <= 1e-13 * (1.0 + own.norm()) {
                return arm.in_range(q);
            }
            kin.point_jacobian_into(arm.point, &mut jacobian);
            let missing = nalgebra::DVector::from_column_slice(missing.as_slice());
            let Ok(step) = jacobian.clone().svd(true, true).solve(&missing, 1e-9) else { return false };
            for body in arm.chain.bodies() {
                q[body.q_index] += step[body.v_index];
            }
        }
        false
    }
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize> Arm<A, D> {
    /// How many axes the pose has.
    pub(super) fn pose_axes(&self) -> usize {
        self.axes.len() - CONDITIONS
    }

    fn in_range(&self, q: &[f64]) -> bool {
        self.ranges.iter().all(|&(i, ratio, shift, lower, upper)| {
            let at = ratio * q[i] + shift;
            (lower..=upper).contains(&at)
        })
    }
}

impl<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize> Hand<'_, A, D> {
    /// Moves to the places of a row; the first axis that moved, the number of axes if none did.
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

    /// Moves to the pose of a row, unless it is there already.
    fn take_pose(&mut self, index: u64) {
        let arm = self.arm;
        if self.take_places(index) >= arm.pose_axes() {
            return;
        }
        let own = &self.values[..arm.pose_axes()];
        match &arm.poses {
            Poses::Joints => self.pose.q.copy_from_slice(own),
            Poses::Tip { reach, branches } => {
                let coordinates = own.len() - 1;
                let branch = branches[self.places[coordinates] as usize];
                let (target, q) = (&own[..coordinates], &mut self.pose.q);
                match reach.solve(&arm.chain, arm.point, &mut self.workspace, target, branch, q) {
                    Ok(true) => {}
                    Ok(false) => {
                        self.pose.class = Some(Class::Unreachable);
                        return;
                    }
                    Err(_) => {
                        self.pose.class = Some(Class::Refused);
                        return;
                    }
                }
            }
        }
        self.weigh_pose();
    }

    /// J, H and M⁻¹Jᵀ at the pose's q.
    fn weigh_pose(&mut self) {
        self.pose.careful = None;
        self.pose.class = if self.arm.in_range(&self.pose.q) { None } else { Some(Class::OutsideLimits) };
        if self.pose.class.is_none() && self.weigh().is_err() {
            self.pose.class = Some(Class::Refused);
        }
    }

    fn weigh(&mut self) -> Result<(), ChainError> {
        let arm = self.arm;
        let pose = &mut self.pose;
        let mut kin = self.workspace.update(&arm.chain, &pose.q)?;
        pose.tip = kin.position(arm.point);
        kin.point_jacobian_into(arm.point, &mut pose.jacobian);
        if arm.chain.is_coupled() {
            let inertia = kin.contact_inertia(arm.point)?;
            pose.delassus = SMatrix::from_fn(|i, j| inertia.delassus[(i, j)]);
            pose.response.copy_from(&inertia.response);
            pose.careful = Some(inertia);
            return Ok(());
        }
        let mut articulation = kin.articulate()?;
        articulation.delassus_into(arm.point, &mut pose.delassus);
        for k in 0..D {
            for (v, x) in self.row.iter_mut().enumerate() {
                *x = pose.jacobian[(k, v)];
            }
            articulation.solve_into(&self.row, &mut self.column)?;
            pose.response.column_mut(k).copy_from_slice(&self.column);
        }
        Ok(())
    }

    /// The careful route at this pose.
    pub(super) fn careful(&mut self) -> Result<&ContactInertia, ChainError> {
        if self.pose.careful.is_none() {
            let mut kin = self.workspace.update(&self.arm.chain, &self.pose.q)?;
            self.pose.careful = Some(kin.contact_inertia(self.arm.point)?);
        }
        self.pose.careful.as_ref().ok_or(ChainError::NoLockedInertia)
    }

    /// Writes the row of the present places and pose.
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
