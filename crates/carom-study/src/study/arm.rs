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

use super::axis::{Axis, places};
use super::quantity::{Class, Quantity as Q, flag_code};
use super::reach::Reach;
use carom_chain::algebra::Algebra;
use carom_chain::{Chain, ChainError, ContactInertia, Point, Workspace};
use carom_impact::{Coefficients, Flags, ImpactOutcome, ImpactProblem, Mode, law_by_name};
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};

/// Below this share of the largest, a pivot of H has lost too many digits for the quick route.
const DOUBTFUL: f64 = 1e-9;
/// A tip velocity is attained within this share of its speed.
const ATTAINED: f64 = 1e-9;
/// Tangential velocities are alike within this share: a jump that symmetry forbids is rounding.
const ALIKE: f64 = 1e-9;

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
    pub quantities: Vec<Q>,
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
            places: vec![0; self.axes.len()],
            pose: Pose {
                of: None,
                class: None,
                q: vec![0.0; self.chain.nq()],
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
struct Pose<const D: usize> {
    of: Option<u64>,
    /// Why there is none.
    class: Option<Class>,
    q: Vec<f64>,
    jacobian: DMatrix<f64>,
    delassus: SMatrix<f64, D, D>,
    response: DMatrix<f64>,
    /// The careful route, once it was needed.
    careful: Option<ContactInertia>,
}

struct Hand<'a, A: Algebra, const D: usize> {
    arm: &'a Arm<A, D>,
    workspace: Workspace<A>,
    places: Vec<u64>,
    pose: Pose<D>,
    row: Vec<f64>,
    column: Vec<f64>,
    qd_minus: Vec<f64>,
    jump: Vec<f64>,
}

/// How the surface is met.
struct Condition<'a, const D: usize> {
    axes: &'a SMatrix<f64, D, D>,
    u: SVector<f64, D>,
    coefficients: Coefficients,
    law: &'a str,
}

/// What a row tells once there is an impact.
struct Told<'a, const D: usize> {
    condition: &'a Condition<'a, D>,
    /// nᵀHn, and tᵀHn.
    normal: f64,
    coupling: f64,
    hit: ImpactOutcome<f64, D>,
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
        places(&self.arm.axes, index, &mut self.places);
        self.pose.of = None;
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
    fn pose_axes(&self) -> usize {
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
    /// Moves to the pose of a row, unless it is there already.
    fn take_pose(&mut self, index: u64) {
        let arm = self.arm;
        places(&arm.axes, index, &mut self.places);
        let (own, rest) = arm.axes.split_at(arm.pose_axes());
        let id = index / rest.iter().map(Axis::count).product::<u64>();
        if self.pose.of == Some(id) {
            return;
        }
        self.pose.of = Some(id);
        let value = |k: usize| own[k].value(self.places[k]);
        match &arm.poses {
            Poses::Joints => {
                for (k, q) in self.pose.q.iter_mut().enumerate() {
                    *q = value(k);
                }
            }
            Poses::Tip { reach, branches } => {
                let coordinates = own.len() - 1;
                let mut target = [0.0; 3];
                for (k, x) in target[..coordinates].iter_mut().enumerate() {
                    *x = value(k);
                }
                let branch = branches[self.places[coordinates] as usize];
                let (target, q) = (&target[..coordinates], &mut self.pose.q);
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
    fn careful(&mut self) -> Result<&ContactInertia, ChainError> {
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
        for (k, axis) in arm.axes.iter().enumerate().filter(|(_, axis)| axis.varies()) {
            if k == normal_axis && !axis.names().is_empty() {
                let normal = arm.basis * arm.surfaces[self.places[k] as usize].column(D - 1);
                normal.iter().for_each(|x| put(*x, out));
            } else {
                put(axis.value(self.places[k]), out);
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

    /// The impact at the present pose; fills the quantities.
    fn strike(&mut self, out: &mut [f64]) -> Result<Class, ChainError> {
        let arm = self.arm;
        let first = arm.pose_axes();
        let value = |k: usize| arm.axes[first + k].value(self.places[first + k]);
        let (sin, cos) = match value(1) {
            90.0 => (1.0, 0.0),
            180.0 => (0.0, -1.0),
            angle => angle.to_radians().sin_cos(),
        };
        let speed = value(2);
        let mut u = SVector::zeros();
        u[0] = speed * cos;
        u[D - 1] = -speed * sin;
        let tangential = if arm.tangential_restitution { value(4) } else { 0.0 };
        let condition = Condition {
            axes: &arm.surfaces[self.places[first] as usize],
            u,
            coefficients: Coefficients {
                restitution: value(3),
                tangential_restitution: tangential,
                friction: value(5),
            },
            law: &arm.axes[first + 6].names()[self.places[first + 6] as usize],
        };
        let normal = condition.axes.column(D - 1).into_owned();
        let mut h = self.in_contact_axes(condition.axes);
        if h[(D - 1, D - 1)] <= h.trace() * DOUBTFUL || !h.trace().is_finite() {
            let inertia = self.careful()?;
            if inertia.effective_mass(normal.as_slice()).is_none() {
                return Ok(Class::Singular);
            }
            let delassus = SMatrix::from_fn(|i, j| inertia.delassus[(i, j)]);
            self.pose.delassus = delassus;
            h = self.in_contact_axes(condition.axes);
        }
        if !self.attain(&h, &condition)? {
            return Ok(Class::Singular);
        }
        let Ok(problem) = ImpactProblem::new(h, u) else { return Ok(Class::Refused) };
        let Some(law) = law_by_name::<D>(condition.law, condition.coefficients) else { return Ok(Class::Refused) };
        let Ok(hit) = law.resolve(&problem) else { return Ok(Class::Refused) };
        if hit.flags.contains(Flags::NO_APPROACH) {
            return Ok(Class::NoImpact);
        }
        let impulse = condition.axes * hit.impulse;
        for (v, jump) in self.jump.iter_mut().enumerate() {
            *jump = (0..D).map(|k| self.pose.response[(v, k)] * impulse[k]).sum();
        }
        if self.jump.iter().any(|x| !x.is_finite()) {
            return Ok(Class::Refused);
        }
        let told = Told { normal: h[(D - 1, D - 1)], coupling: h[(0, D - 1)], hit, condition: &condition };
        let class = class(&told.hit, speed);
        self.fill(&told, out)?;
        Ok(class)
    }

    fn in_contact_axes(&self, axes: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
        axes.tr_mul(&(self.pose.delassus * axes))
    }

    /// Joint velocities that move the tip as asked, with the least kinetic energy; whether there are any.
    fn attain(&mut self, h: &SMatrix<f64, D, D>, condition: &Condition<D>) -> Result<bool, ChainError> {
        let u = condition.axes * condition.u;
        let regular = h.cholesky().filter(|factor| {
            let pivots = factor.l_dirty().diagonal().map(|x| x * x);
            pivots.min() > DOUBTFUL * h.diagonal().max()
        });
        let force = match regular {
            Some(factor) => condition.axes * factor.solve(&condition.u),
            None => {
                let inertia = self.careful()?;
                let mut force = SVector::zeros();
                for (direction, sigma) in &inertia.principal[..inertia.rank] {
                    let direction = SVector::<f64, D>::from_fn(|i, _| direction[i]);
                    force += direction * (direction.dot(&u) / (sigma * sigma));
                }
                force
            }
        };
        for (v, qd) in self.qd_minus.iter_mut().enumerate() {
            *qd = (0..D).map(|k| self.pose.response[(v, k)] * force[k]).sum();
        }
        let reached = SVector::<f64, D>::from_fn(|k, _| {
            self.qd_minus.iter().enumerate().map(|(v, qd)| self.pose.jacobian[(k, v)] * qd).sum()
        });
        // false for what is not finite, too
        Ok((reached - u).norm() <= ATTAINED * condition.u.norm())
    }

    fn fill(&mut self, told: &Told<D>, out: &mut [f64]) -> Result<(), ChainError> {
        let Told { condition, hit, .. } = told;
        let n = D - 1;
        let mut at = 0;
        for quantity in &self.arm.quantities {
            let (value, width) = match quantity {
                Q::Mode => (f64::from(hit.mode as u8), 1),
                Q::Flags => (flag_code(hit.flags), 1),
                Q::TangentialJump => (hit.u_plus[0] - hit.u_minus[0], 1),
                Q::TangentialRatio => (hit.u_plus[0] / hit.u_minus[0], 1),
                Q::TangentialAfter => (hit.u_plus[0], 1),
                Q::NormalAfter => (hit.u_plus[n], 1),
                Q::Impulse => (hit.impulse.norm(), 1),
                Q::NormalImpulse => (hit.impulse[n], 1),
                Q::TangentialImpulse => (hit.impulse[0], 1),
                Q::EffectiveMass => (1.0 / told.normal, 1),
                Q::LockedMass => (self.locked_mass(condition)?, 1),
                Q::Coupling => (-told.coupling / told.normal, 1),
                Q::EnergyLoss => (-hit.energy_change, 1),
                Q::EnergyRatio => {
                    let mut kin = self.workspace.update(&self.arm.chain, &self.pose.q)?;
                    (1.0 + hit.energy_change / kin.kinetic_energy(&self.qd_minus)?, 1)
                }
                Q::JointJump => (self.jump.iter().fold(0.0, |worst, x| x.abs().max(worst)), 1),
                Q::LimitShare => (self.worst().1, 1),
                Q::LimitJoint => (self.worst().0 as f64, 1),
                Q::ImpactEllipse => {
                    out[at..at + 3].copy_from_slice(&self.ellipse());
                    (out[at], 3)
                }
                Q::Position => {
                    let q = self.pose.q.clone();
                    let tip = self.tip(&q).unwrap_or_else(|| Vector3::repeat(f64::NAN));
                    out[at..at + 3].copy_from_slice(tip.as_slice());
                    (out[at], 3)
                }
                Q::QdMinus => {
                    out[at..at + self.qd_minus.len()].copy_from_slice(&self.qd_minus);
                    (out[at], self.qd_minus.len())
                }
                Q::QdPlus => {
                    for (k, (qd, jump)) in self.qd_minus.iter().zip(&self.jump).enumerate() {
                        out[at + k] = qd + jump;
                    }
                    (out[at], self.jump.len())
                }
            };
            out[at] = value;
            at += width;
        }
        Ok(())
    }

    /// The joint whose velocity jumps by the greatest share of its limit, and that share.
    fn worst(&self) -> (usize, f64) {
        let share = |limit: &Limit| (self.jump[limit.v] * limit.ratio).abs() / limit.velocity;
        let shares = self.arm.limits.iter().map(share).enumerate();
        shares.fold((0, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst })
    }

    /// 1/(nᵀH_locked n): the mass that the locked arm shows. NaN where the locked arm has none.
    fn locked_mass(&mut self, condition: &Condition<D>) -> Result<f64, ChainError> {
        let mut kin = self.workspace.update(&self.arm.chain, &self.pose.q)?;
        match kin.locked_delassus(self.arm.point) {
            Ok(h) => {
                let n = condition.axes.column(D - 1);
                let h = SMatrix::<f64, D, D>::from_fn(|i, j| h[(i, j)]);
                Ok(1.0 / n.dot(&(h * n)))
            }
            Err(ChainError::NoLockedInertia) => Ok(f64::NAN),
            Err(error) => Err(error),
        }
    }

    /// Semi-axes of the impulses that make |Δqd| = 1: pᵀ(J M⁻² Jᵀ)p = 1. In the plane the two and the direction of the
    /// longer (degrees from the plane's first axis, −90 to 90); in space the three.
    fn ellipse(&self) -> [f64; 3] {
        let g = |i: usize, j: usize| self.pose.response.column(i).dot(&self.pose.response.column(j));
        let axis = |eigenvalue: f64| 1.0 / eigenvalue.max(0.0).sqrt();
        if D == 2 {
            let (a, b, c) = (g(0, 0), g(0, 1), g(1, 1));
            let (mean, radius) = ((a + c) / 2.0, ((a - c) / 2.0).hypot(b));
            let large = mean + radius;
            // det/large: the small one without the difference of near equals
            let small = ((a * c - b * b) / large).max(0.0);
            // the large eigenvalue's direction, a right angle from the long axis
            let turn = (0.5 * (2.0 * b).atan2(a - c)).to_degrees() + 90.0;
            [axis(small), axis(large), if turn > 90.0 { turn - 180.0 } else { turn }]
        } else {
            let matrix = Matrix3::from_fn(g);
            let mut found = matrix.symmetric_eigenvalues();
            found.as_mut_slice().sort_by(f64::total_cmp);
            [axis(found[0]), axis(found[1]), axis(found[2])]
        }
    }
}

/// What the tip does along the surface.
fn class<const D: usize>(hit: &ImpactOutcome<f64, D>, speed: f64) -> Class {
    let n = D - 1;
    let (mut before, mut after) = (hit.u_minus, hit.u_plus);
    before[n] = 0.0;
    after[n] = 0.0;
    let (b, a) = (before.norm(), after.norm());
    if hit.mode == Mode::Stick || a <= ALIKE * 1e-3 * speed {
        Class::Stick
    } else if b <= ALIKE * 1e-3 * speed {
        Class::Starts
    } else if before.dot(&after) < 0.0 {
        Class::Reverses
    } else if (after - before).norm() <= ALIKE * b {
        Class::Keeps
    } else if a > b {
        Class::Grows
    } else {
        Class::Shrinks
    }
}
