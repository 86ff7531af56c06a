//! Computes the impact of a row and its quantities from a pose and the impact conditions. Symbols as in `arm.rs`.

use super::arm::{Hand, Limit};
use super::boundary::{Along, edge_code, nearest_change};
use super::quantity::{Class, Quantity as Q};
use carom_chain::algebra::Algebra;
use carom_chain::{ChainError, ContactInertia, PointResponse};
use carom_impact::{AnyLaw, Boundary, Coefficients, Flags, ImpactOutcome, ImpactProblem, Law, Mode};
use nalgebra::{Matrix3, SMatrix, SVector};

/// A pivot of H below this fraction of the largest diagonal entry is treated as nearly singular.
const DOUBTFUL: f64 = 1e-9;
/// Where all pivots are above this fraction, H⁻¹u⁻ is accurate to much less than [`ATTAINED`].
const REGULAR: f64 = 1e-4;
/// Relative tolerance of the contact velocity that qd⁻ attains.
const ATTAINED: f64 = 1e-9;
/// Relative tolerance of equal tangential velocities: a jump that is zero by symmetry has rounding errors.
const ALIKE: f64 = 1e-9;

/// Impact conditions.
#[derive(Clone, Copy)]
pub(super) struct Condition<'a, const D: usize> {
    axes: &'a SMatrix<f64, D, D>,
    /// Approach angle, degrees, and speed, m/s; `u` is computed from both.
    approach: f64,
    speed: f64,
    u: SVector<f64, D>,
    law: AnyLaw,
}

/// The impact of a row.
struct Told<'a, const D: usize> {
    condition: &'a Condition<'a, D>,
    problem: ImpactProblem<f64, D>,
    hit: ImpactOutcome<f64, D>,
}

/// Sine and cosine of an approach angle, degrees; exact at 90° and 180°.
pub(super) fn sin_cos(approach: f64) -> (f64, f64) {
    match approach {
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        angle => angle.to_radians().sin_cos(),
    }
}

/// Velocity of the contact point, contact axes.
pub(super) fn velocity<const D: usize>(speed: f64, (sin, cos): (f64, f64)) -> SVector<f64, D> {
    let mut u = SVector::zeros();
    u[0] = speed * cos;
    u[D - 1] = -speed * sin;
    u
}

impl<'a, A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize> Hand<'a, A, D> {
    /// Computes the impact at the present pose, and its quantities into `out`. Returns the class of the row.
    pub(super) fn strike(&mut self, out: &mut [f64]) -> Result<Class, ChainError> {
        let condition = self.condition();
        let response = self.response();
        let mut h = in_contact_axes(&delassus(&response), condition.axes);
        if !response.is_regular(&h) {
            h = response.delassus_in(std::array::from_fn(|k| condition.axes.column(k).into_owned()));
            // Zero along a normal along which no joint moves the point; NaN is not above it either.
            let moves = h[(D - 1, D - 1)] > 0.0;
            if !moves {
                return Ok(Class::Singular);
            }
        }
        let attained = if self.arm.tool.is_some() { self.move_tool(&condition)? } else { self.attain(&h, &condition) };
        if !attained {
            return Ok(Class::Singular);
        }
        let Ok(problem) = ImpactProblem::from_gram(h, condition.u) else { return Ok(Class::Refused) };
        let Ok(hit) = condition.law.resolve(&problem) else { return Ok(Class::Refused) };
        if hit.flags.contains(Flags::NO_APPROACH) {
            return Ok(Class::NoImpact);
        }
        if !hit.impulse.sum().is_finite() {
            return Ok(Class::Refused);
        }
        if self.arm.wants.jump {
            let mut jump = std::mem::take(&mut self.jump);
            respond(&self.response(), &(condition.axes * hit.impulse), &mut jump);
            self.jump = jump;
        }
        let told = Told { condition: &condition, problem, hit };
        self.fill(&told, out)?;
        Ok(class(&told.hit, condition.speed))
    }

    /// The impact conditions at the present places.
    fn condition(&mut self) -> Condition<'a, D> {
        if let Some(condition) = self.condition {
            return condition;
        }
        let (arm, first) = (self.arm, self.arm.pose_axes());
        let [approach, speed, restitution, tangential, friction] = std::array::from_fn(|k| self.values[first + 1 + k]);
        let tangential_restitution = if arm.tangential_restitution { tangential } else { 0.0 };
        let coefficients = Coefficients { restitution, tangential_restitution, friction };
        let sin_cos = self.sin_cos(approach);
        *self.condition.insert(Condition {
            axes: &arm.surfaces[self.places[first] as usize],
            approach,
            speed,
            u: velocity(speed, sin_cos),
            law: arm.laws[self.places[first + 6] as usize].with(coefficients),
        })
    }

    /// Keeps the last angle, as consecutive rows often share it.
    fn sin_cos(&mut self, approach: f64) -> (f64, f64) {
        if self.approach.0 != approach {
            self.approach = (approach, sin_cos(approach));
        }
        self.approach.1
    }

    /// Whether joint velocities with contact velocity u⁻ exist; computes those of least kinetic energy into `qd_minus` if they
    /// are needed.
    fn attain(&mut self, h: &SMatrix<f64, D, D>, condition: &Condition<D>) -> bool {
        let (least, solution) = solve(h, &condition.u);
        let regular = least > REGULAR;
        if regular && !self.arm.wants.qd_minus {
            return true;
        }
        let u = condition.axes * condition.u;
        let force = if least > DOUBTFUL { condition.axes * solution } else { self.least_force(&u) };
        let mut qd_minus = std::mem::take(&mut self.qd_minus);
        respond(&self.response(), &force, &mut qd_minus);
        // also false for non-finite values
        let mut attained = regular || self.missed(&u, &qd_minus).norm() <= ATTAINED * u.norm();
        if !attained {
            // What is missed may be the rounding of a large q̇⁻: one step of refinement.
            let more = self.least_force(&self.missed(&u, &qd_minus));
            let mut change = vec![0.0; qd_minus.len()];
            respond(&self.response(), &more, &mut change);
            qd_minus.iter_mut().zip(change).for_each(|(rate, change)| *rate += change);
            attained = self.missed(&u, &qd_minus).norm() <= ATTAINED * u.norm();
        }
        self.qd_minus = qd_minus;
        attained
    }

    /// Whether joint velocities with contact velocity u⁻ exist that move the tip as the study asks; computes them and their energy.
    fn move_tool(&mut self, condition: &Condition<D>) -> Result<bool, ChainError> {
        let (Some(tool), Some(memory)) = (&self.arm.tool, &mut self.tool) else { return Ok(true) };
        let u = self.arm.basis * (condition.axes * condition.u);
        let mut at = memory.update(&tool.chain, &self.pose.q)?;
        match at.tool_velocity(tool.at, u, tool.motion) {
            Ok(qd) => {
                self.energy = Some(at.kinetic_energy(qd.as_slice())?);
                self.qd_minus.copy_from_slice(qd.as_slice());
                Ok(true)
            }
            Err(ChainError::NoVelocity { .. }) => Ok(false),
            Err(error) => Err(error),
        }
    }

    /// u − J q̇.
    fn missed(&self, u: &SVector<f64, D>, qd: &[f64]) -> SVector<f64, D> {
        u - self.response().velocity(qd)
    }

    /// H⁺u: the shortest impulse that changes the contact velocity by `u`, as far as impulses can. Axes of the chain.
    fn least_force(&mut self, u: &SVector<f64, D>) -> SVector<f64, D> {
        let found = self.pose.principal.take().unwrap_or_else(|| ContactInertia::of(self.response()));
        let mut force = SVector::zeros();
        for (direction, sigma) in &found.principal[..found.rank] {
            let direction = SVector::<f64, D>::from_column_slice(direction.as_slice());
            force += direction * (direction.dot(u) / (sigma * sigma));
        }
        self.pose.principal = Some(found);
        force
    }

    fn fill(&mut self, told: &Told<D>, out: &mut [f64]) -> Result<(), ChainError> {
        let Told { condition, problem, hit } = told;
        let n = D - 1;
        let (normal, coupling) = (problem.delassus()[(n, n)], problem.delassus()[(0, n)]);
        let worst = if self.arm.wants.worst { self.worst() } else { (0, f64::NAN) };
        let mut nearest = None;
        let mut at = 0;
        for quantity in &self.arm.quantities {
            let (value, width) = match quantity {
                Q::Mode => (f64::from(hit.mode as u8), 1),
                Q::Flags => (f64::from(hit.flags.bits()), 1),
                Q::TangentialJump => (hit.u_plus[0] - hit.u_minus[0], 1),
                Q::TangentialRatio => (hit.u_plus[0] / hit.u_minus[0], 1),
                Q::TangentialAfter => (hit.u_plus[0], 1),
                Q::NormalAfter => (hit.u_plus[n], 1),
                Q::Impulse => (hit.impulse.norm(), 1),
                Q::NormalImpulse => (hit.impulse[n], 1),
                Q::TangentialImpulse => (hit.impulse[0], 1),
                Q::EffectiveMass => (1.0 / normal, 1),
                Q::LockedMass => (self.locked_mass(condition)?, 1),
                Q::Coupling => (-coupling / normal, 1),
                Q::EnergyLoss => (-hit.energy_change, 1),
                // The energy of the contact is that of the chain, ½ u⁻ᵀH⁻¹u⁻, for the velocities of least kinetic energy.
                Q::EnergyRatio => (1.0 + hit.energy_change / self.energy.unwrap_or(hit.energy_before), 1),
                Q::JointJump => (self.jump.iter().fold(0.0, |worst, x| x.abs().max(worst)), 1),
                Q::JointLoad => {
                    let p = condition.axes * hit.impulse;
                    let columns = self.response().jacobian.iter();
                    (columns.map(|column| column.dot(&p).abs()).fold(0.0, f64::max), 1)
                }
                Q::JointImpulse => {
                    let p = condition.axes * hit.impulse;
                    let columns = self.response().jacobian;
                    out[at..].iter_mut().zip(columns).for_each(|(x, column)| *x = column.dot(&p));
                    (out[at], columns.len())
                }
                Q::LimitShare => (worst.1, 1),
                Q::LimitJoint => (worst.0 as f64, 1),
                Q::ImpactEllipse => {
                    out[at..at + 3].copy_from_slice(&self.ellipse());
                    (out[at], 3)
                }
                Q::Position => {
                    let tip = self.arm.origin + self.arm.basis * self.response().position;
                    out[at..at + 3].copy_from_slice(tip.as_slice());
                    (out[at], 3)
                }
                Q::ModeMargin => (told.nearest(&mut nearest).map_or(f64::NAN, |b| b.margin), 1),
                Q::ModeEdge => (told.nearest(&mut nearest).map_or(f64::NAN, |b| edge_code(b.edge)), 1),
                Q::ModeBeyond => (told.nearest(&mut nearest).map_or(f64::NAN, |b| f64::from(b.beyond as u8)), 1),
                Q::BoundaryFriction => (told.change(Along::Friction), 1),
                Q::BoundaryRestitution => (told.change(Along::Restitution), 1),
                Q::BoundaryApproach => (told.change(Along::Approach), 1),
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

    /// The joint with the greatest velocity jump relative to its limit, and that ratio.
    fn worst(&self) -> (usize, f64) {
        let share = |limit: &Limit| (self.jump[limit.v] * limit.ratio).abs() / limit.velocity;
        let shares = self.arm.limits.iter().map(share).enumerate();
        shares.fold((0, 0.0), |worst, next| if next.1 > worst.1 { next } else { worst })
    }

    /// 1/(nᵀ H_locked n): effective mass with locked joints and released base, kg. NaN if the locked inertia is singular.
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

    /// Semi-axes of the ellipsoid of impulses with |Δqd| = 1: pᵀ(J M⁻² Jᵀ)p = 1. In the plane two semi-axes and the direction
    /// of the longer one (degrees from the plane's first axis, −90 to 90); in space three semi-axes.
    fn ellipse(&self) -> [f64; 3] {
        let rows = self.response().response;
        let g = |i: usize, j: usize| rows.iter().map(|x| x[i] * x[j]).sum::<f64>();
        let axis = |eigenvalue: f64| 1.0 / eigenvalue.max(0.0).sqrt();
        if D == 2 {
            let (a, b, c) = (g(0, 0), g(0, 1), g(1, 1));
            let (mean, radius) = ((a + c) / 2.0, ((a - c) / 2.0).hypot(b));
            let large = mean + radius;
            // det/large avoids the cancellation of mean - radius
            let small = ((a * c - b * b) / large).max(0.0);
            // the eigenvector of `large` is perpendicular to the long axis
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

impl<const D: usize> Told<'_, D> {
    /// The nearest boundary of the mode, computed once.
    fn nearest(&self, found: &mut Option<Option<Boundary>>) -> Option<Boundary> {
        let look = || self.problem.boundaries(&self.condition.law).ok()?.into_iter().next();
        *found.get_or_insert_with(look)
    }

    /// Signed distance to the nearest change of the mode in one parameter, all others held; NaN if there is none.
    fn change(&self, along: Along) -> f64 {
        let Condition { law, approach, speed, .. } = *self.condition;
        let with = law.coefficients();
        let mode = |x: f64| -> Option<Mode> {
            let (law, problem) = match along {
                Along::Friction => (law.with(Coefficients { friction: x, ..with }), self.problem),
                Along::Restitution => (law.with(Coefficients { restitution: x, ..with }), self.problem),
                Along::Approach => {
                    (law, ImpactProblem::new(*self.problem.delassus(), velocity(speed, sin_cos(x))).ok()?)
                }
            };
            law.resolve(&problem).ok().map(|hit| hit.mode)
        };
        let at = match along {
            Along::Friction => with.friction,
            Along::Restitution => with.restitution,
            Along::Approach => approach,
        };
        nearest_change(along, at, self.hit.mode, mode)
    }
}

/// H, axes of the chain.
fn delassus<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
    response: &PointResponse<A>,
) -> SMatrix<f64, D, D> {
    SMatrix::from_fn(|i, j| response.delassus[j][i])
}

/// Writes X · impulse, the change of the joint velocities.
fn respond<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
    response: &PointResponse<A>,
    impulse: &SVector<f64, D>,
    into: &mut [f64],
) {
    for (x, row) in into.iter_mut().zip(response.response) {
        *x = row.dot(impulse);
    }
}

/// The smallest pivot of H = L D Lᵀ relative to its largest diagonal entry, and H⁻¹u.
fn solve<const D: usize>(h: &SMatrix<f64, D, D>, u: &SVector<f64, D>) -> (f64, SVector<f64, D>) {
    let (mut rest, mut x) = (*h, *u);
    let mut least = h[(0, 0)];
    for k in 0..D {
        let inverse = 1.0 / rest[(k, k)];
        for i in k + 1..D {
            let share = rest[(i, k)] * inverse;
            for j in k + 1..=i {
                rest[(i, j)] -= share * rest[(j, k)];
            }
            x[i] -= share * x[k];
        }
        least = least.min(rest[(k, k)]);
    }
    for k in (0..D).rev() {
        for i in k + 1..D {
            x[k] -= rest[(i, k)] * x[i];
        }
        x[k] /= rest[(k, k)];
    }
    (least / h.diagonal().max(), x)
}

/// RᵀHR.
fn in_contact_axes<const D: usize>(h: &SMatrix<f64, D, D>, axes: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    axes.tr_mul(&(h * axes))
}

/// Class of an impact by its tangential velocities.
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
