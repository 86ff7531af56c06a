//! Inverse kinematics: configurations with the contact point at a given position.
//!
//! Two revolute links in the plane are solved in closed form, with both elbows. All other arms are solved by damped Newton
//! steps (Levenberg–Marquardt: `δq = Jᵀ (J Jᵀ + λ tr(J Jᵀ)/m)⁻¹ r`) from fixed start configurations, so that a row depends on
//! its number alone. The first solution within the position limits is returned. For a redundant arm this is one of many
//! solutions, near its start configuration.
//!
//! | symbol | size | meaning | our name |
//! | --- | --- | --- | --- |
//! | m | 1 | number of prescribed world coordinates, 1 to 3, and of the rows of a direction ([`Pointing`]), 0 or D − 1 | `count` |
//! | r | m | residual, m | `missing` |
//! | J | m×nv | Jacobian of the prescribed coordinates and of the direction | `j` |
//! | λ | 1 | damping relative to the mean of the diagonal of J Jᵀ | `damping` |

use super::pointing::Pointing;
use crate::self_motion::triangle;
use carom_chain::algebra::Algebra;
use carom_chain::{Chain, ChainError, Kinematics, Point, Workspace};
use nalgebra::{DMatrix, SMatrix, SVector, Vector3};

/// Greatest number of steps from one start; convergence is quadratic and usually needs about ten.
const STEPS: usize = 60;
/// Number of starts tried after a seed has failed.
const MORE_STARTS: usize = 12;
/// Residual at which the iteration ends, relative to the size of the problem: rounding.
const REACHED: f64 = 1e-13;
/// Residual that is accepted if rounding ends the iteration earlier, relative to the size of the problem.
const NEARLY: f64 = 1e-10;
/// Greatest change of a joint in one step, rad or m.
const LONGEST_STEP: f64 = 0.7;

/// Inverse kinematics of a point of a chain.
pub(super) struct Reach<const D: usize> {
    /// For each prescribed world coordinate: its row over the coordinates of the chain, and its origin.
    rows: Vec<(SVector<f64, D>, f64)>,
    /// Inverse of the rows if all D coordinates are prescribed: from world coordinates, less their origins, to the chain's.
    back: Option<SMatrix<f64, D, D>>,
    pub pointing: Option<Pointing<D>>,
    closed: Option<TwoLinks>,
    seeds: Vec<Vec<f64>>,
    more: Vec<Vec<f64>>,
    /// Position of the first joint and the total length of the links after it, if all joints are revolute.
    within: Option<(SVector<f64, D>, f64)>,
    /// Reach of the arm, m: its links, and its sliders where the search starts. The size of the problem is this, or the distance of a
    /// target that is farther, since rounding of positions is relative to the largest length that they are sums of.
    size: f64,
    /// (lower, upper) of each entry of q.
    limits: Vec<(f64, f64)>,
    hinges: Vec<bool>,
}

/// Two revolute links in the plane.
struct TwoLinks {
    base: [f64; 2],
    lengths: [f64; 2],
    /// Direction of the first link, and angle from the first to the second, with both joints at zero; rad.
    zero: [f64; 2],
    /// ±1: left in the axes of the chain is left in the view in which an elbow is up.
    view: f64,
    /// ±1: sense of rotation of each joint.
    sense: [f64; 2],
}

/// The triangle of base, elbow and tip that [`triangle`] computes.
pub(super) type Triangle = [f64; 3];

/// Placement and limits of an arm.
pub(super) struct About<'a, const D: usize> {
    /// Axes of the chain in the world frame, as columns.
    pub basis: &'a SMatrix<f64, 3, D>,
    /// World position of the chain's origin, m.
    pub origin: Vector3<f64>,
    /// (lower, upper) limit of each entry of q, infinite where there is none.
    pub limits: Vec<(f64, f64)>,
    /// Whether each entry of q is an angle.
    pub hinges: Vec<bool>,
}

impl<const D: usize> Reach<D> {
    /// `coordinates`: which of the world's x, y, z (0, 1, 2) are prescribed.
    pub fn new<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>>(
        chain: &Chain<A>,
        point: Point<A>,
        coordinates: &[usize],
        (pointing, seeds): (Option<Pointing<D>>, Option<Vec<Vec<f64>>>),
        about: About<D>,
    ) -> Result<Self, ChainError> {
        let rows: Vec<_> = coordinates.iter().map(|&k| (about.basis.row(k).transpose(), about.origin[k])).collect();
        let mut path = Vec::new();
        let mut next = point.body;
        while let Some(i) = next {
            path.push(i);
            next = chain.bodies()[i].parent;
        }
        let root = path.last().copied();
        let links = path.iter().filter(|i| Some(**i) != root).map(|&i| chain.bodies()[i].placement.translation.norm());
        let length = links.sum::<f64>() + point.position.norm();
        let base = root.map_or(SVector::zeros(), |i| chain.bodies()[i].placement.translation);
        let turns = path.iter().all(|&i| about.hinges[chain.bodies()[i].q_index]);
        let whole = rows.len() == D;
        let slides = path.iter().map(|&i| &chain.bodies()[i]).filter(|body| !about.hinges[body.q_index]);
        let strokes = slides.map(|body| {
            let (low, high) = starts(about.limits[body.q_index], 1.0);
            body.ratio.abs() * low.abs().max(high.abs())
        });
        let size = length + base.norm() + strokes.sum::<f64>();
        let pointing = pointing.map(|it| it.weighted(size));
        let closed = if D == 2 && whole && turns && pointing.is_none() {
            TwoLinks::of(chain, point, &path, about.basis)?
        } else {
            None
        };
        let default_seeds = || {
            let bent = |angle: f64| {
                let each = about.limits.iter().zip(&about.hinges);
                each.map(
                    |(&(lower, upper), hinge)| if *hinge { angle.clamp(lower, upper) } else { middle(lower, upper) },
                )
                .collect()
            };
            vec![bent(0.6), bent(-0.6)]
        };
        let square = DMatrix::from_fn(rows.len(), D, |i, j| rows[i].0[j]);
        let back = if whole { square.try_inverse().map(|back| SMatrix::from_fn(|i, j| back[(i, j)])) } else { None };
        let more = (1..=MORE_STARTS).map(|k| start(k, &about)).collect();
        Ok(Self {
            rows,
            back,
            pointing,
            closed,
            seeds: seeds.unwrap_or_else(default_seeds),
            more,
            within: (whole && turns).then_some((base, length)),
            size,
            limits: about.limits,
            hinges: about.hinges,
        })
    }

    /// Whether the solution is in closed form, so that the branches are the two elbows.
    pub fn is_closed(&self) -> bool {
        self.closed.is_some()
    }

    /// Number of seeds.
    pub fn seeds(&self) -> usize {
        self.seeds.len()
    }

    /// The triangle of both solutions in closed form for the point at `target`; `None` out of reach.
    pub fn triangle(&self, target: &[f64]) -> Option<Triangle> {
        let (links, own) = (self.closed.as_ref()?, self.own(target)?);
        triangle(links.lengths, [own[0] - links.base[0], own[1] - links.base[1]])
    }

    /// Computes `q` from a triangle; `branch` is 0 for elbow up and 1 for elbow down.
    pub fn bend(&self, triangle: &Triangle, branch: usize, q: &mut [f64]) {
        let Some(links) = &self.closed else { return };
        q.copy_from_slice(&links.pose(triangle, if branch == 0 { 1.0 } else { -1.0 }));
        self.unwind(q);
    }

    /// Computes `q` with the point at `target` (the prescribed world coordinates, m) from seed number `branch`. Returns whether a
    /// solution was found.
    pub fn seek<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>>(
        &self,
        chain: &Chain<A>,
        point: Point<A>,
        workspace: &mut Workspace<A>,
        target: &[f64],
        branch: usize,
        q: &mut [f64],
    ) -> Result<bool, ChainError> {
        if let Some((base, length)) = self.within
            && let Some(own) = self.own(target)
            && (own - base).norm() > length * (1.0 + 1e-12)
        {
            return Ok(false);
        }
        let mut beyond: Option<Vec<f64>> = None;
        for from in self.seeds.get(branch).into_iter().chain(&self.more) {
            q.copy_from_slice(from);
            let found = match self.pointing {
                None => self.lead::<A, 3>(chain, point, workspace, target, q),
                Some(_) => self.lead::<A, 5>(chain, point, workspace, target, q),
            };
            if found? {
                self.unwind(q);
                if q.iter().zip(&self.limits).all(|(x, &(lower, upper))| (lower..=upper).contains(x)) {
                    return Ok(true);
                }
                beyond.get_or_insert_with(|| q.to_vec());
            }
        }
        // no solution within the limits: return the first one, which the caller classifies
        Ok(beyond.map(|pose| q.copy_from_slice(&pose)).is_some())
    }

    /// The target in the coordinates of the chain, if all of them are prescribed.
    fn own(&self, target: &[f64]) -> Option<SVector<f64, D>> {
        let back = self.back?;
        Some(back * SVector::<f64, D>::from_fn(|i, _| target[i] - self.rows[i].1))
    }

    /// Damped Newton steps from `q`. Returns whether they converged. M is the largest number of rows: 3 without a direction, else 5.
    fn lead<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const M: usize>(
        &self,
        chain: &Chain<A>,
        point: Point<A>,
        workspace: &mut Workspace<A>,
        target: &[f64],
        q: &mut [f64],
    ) -> Result<bool, ChainError> {
        let (m, facing) = (self.rows.len(), self.pointing.as_ref());
        let count = m + facing.map_or(0, Pointing::rows);
        let distance = self.rows.iter().zip(target).map(|((_, origin), x)| (x - origin).powi(2)).sum::<f64>().sqrt();
        let size = self.size.max(distance);
        let missing = |kin: &Kinematics<A>| {
            let at = kin.position(point);
            let turned = facing.map(|facing| kin.position(facing.ahead(point)) - at);
            SVector::<f64, M>::from_fn(|i, _| match (facing, turned) {
                _ if i < m => target[i] - self.rows[i].1 - self.rows[i].0.dot(&at),
                (Some(facing), Some(turned)) if i < count => facing.missing(i - m, &turned),
                _ => 0.0,
            })
        };
        let mut r = missing(&workspace.update(chain, q)?);
        let mut jacobian = DMatrix::zeros(D, chain.nv());
        let mut ahead = jacobian.clone();
        let mut damping = 1e-4;
        let mut trial = q.to_vec();
        for _ in 0..STEPS {
            if r.norm() <= REACHED * size {
                break;
            }
            let kin = workspace.update(chain, q)?;
            kin.point_jacobian_into(point, &mut jacobian);
            if let Some(facing) = facing {
                kin.point_jacobian_into(facing.ahead(point), &mut ahead);
            }
            let j = |i: usize, v: usize| match facing {
                Some(facing) if i >= m => facing.slope(i - m, v, [&jacobian, &ahead]),
                _ => (0..D).map(|k| self.rows[i].0[k] * jacobian[(k, v)]).sum::<f64>(),
            };
            let square = |i: usize, l: usize| (0..chain.nv()).map(|v| j(i, v) * j(l, v)).sum::<f64>();
            let mut jj = SMatrix::<f64, M, M>::identity();
            for i in 0..count {
                for l in 0..count {
                    jj[(i, l)] = square(i, l);
                }
            }
            let mean = (0..count).map(|i| jj[(i, i)]).sum::<f64>() / count as f64;
            let better = loop {
                let mut damped = jj;
                for i in 0..count {
                    damped[(i, i)] += damping * mean;
                }
                let y = damped.cholesky().map_or_else(SVector::zeros, |factor| factor.solve(&r));
                let step = |v: usize| (0..count).map(|i| j(i, v) * y[i]).sum::<f64>();
                let longest = (0..chain.nv()).map(|v| step(v).abs()).fold(0.0, f64::max);
                let share = if longest > LONGEST_STEP { LONGEST_STEP / longest } else { 1.0 };
                for body in chain.bodies() {
                    trial[body.q_index] = q[body.q_index] + share * step(body.v_index);
                }
                let left = missing(&workspace.update(chain, &trial)?);
                if left.norm() < r.norm() {
                    damping *= 0.1;
                    break Some(left);
                }
                damping = damping.max(1e-12) * 10.0;
                if damping > 1e6 {
                    break None;
                }
            };
            let Some(left) = better else { break };
            q.copy_from_slice(&trial);
            r = left;
        }
        if r.norm() > NEARLY * size {
            return Ok(false);
        }
        let Some(facing) = facing else { return Ok(true) };
        let kin = workspace.update(chain, q)?;
        Ok(facing.is_ahead(&(kin.position(facing.ahead(point)) - kin.position(point))))
    }

    /// Shifts each revolute joint by whole turns to within half a turn of the middle of its limits, or of 0.
    fn unwind(&self, q: &mut [f64]) {
        for ((x, &(lower, upper)), hinge) in q.iter_mut().zip(&self.limits).zip(&self.hinges) {
            if *hinge {
                let off = *x - middle(lower, upper);
                if off.abs() >= std::f64::consts::PI {
                    *x -= std::f64::consts::TAU * (off / std::f64::consts::TAU).round();
                }
            }
        }
    }
}

/// The middle of a joint's range; for an unbounded range the value nearest to 0.
fn middle(lower: f64, upper: f64) -> f64 {
    let middle = lower / 2.0 + upper / 2.0;
    if middle.is_finite() { middle } else { 0.0_f64.clamp(lower, upper) }
}

/// Start configuration number `k`: a Weyl sequence over the joint ranges, entry i from the fractional part of k times the
/// square root of the i-th prime.
fn start<const D: usize>(k: usize, about: &About<D>) -> Vec<f64> {
    let primes = (2_u32..).filter(|n| (2..*n).all(|d| n % d != 0));
    let each = about.limits.iter().zip(&about.hinges).zip(primes);
    each.map(|((&(lower, upper), hinge), prime)| {
        let share = (k as f64 * f64::from(prime).sqrt()).fract();
        let widest = if *hinge { std::f64::consts::PI } else { 1.0 };
        let (low, high) = starts((lower, upper), widest);
        low + (high - low) * share
    })
    .collect()
}

/// The part of a joint's range from which the search starts: `widest` to both sides of its middle at most.
fn starts((lower, upper): (f64, f64), widest: f64) -> (f64, f64) {
    let middle = middle(lower, upper);
    (lower.max(middle - widest), upper.min(middle + widest))
}

impl TwoLinks {
    /// The two links of a chain whose bodies from the point to the root are `path`; `None` if the chain is not of this kind.
    fn of<A: Algebra<Scalar = f64, Vector = SVector<f64, D>>, const D: usize>(
        chain: &Chain<A>,
        point: Point<A>,
        path: &[usize],
        basis: &SMatrix<f64, 3, D>,
    ) -> Result<Option<Self>, ChainError> {
        let &[second, first] = path else { return Ok(None) };
        if chain.nq() != 2 || chain.bodies().len() != 2 || chain.bodies()[first].q_index != 0 {
            return Ok(None);
        }
        let mut workspace = chain.workspace();
        // sense of rotation of each joint, from the velocities of elbow and tip
        let elbow = Point { body: Some(first), position: chain.bodies()[second].placement.translation };
        let kin = workspace.update(chain, &[0.0, 0.0])?;
        let pair = |v: SVector<f64, D>| [v[0], v[1]];
        let base = pair(chain.bodies()[first].placement.translation);
        let (at_elbow, at_tip) = (pair(kin.position(elbow)), pair(kin.position(point)));
        let way = |a: [f64; 2], b: [f64; 2]| [b[0] - a[0], b[1] - a[1]];
        let (upper, lower) = (way(base, at_elbow), way(at_elbow, at_tip));
        let lengths = [upper[0].hypot(upper[1]), lower[0].hypot(lower[1])];
        if lengths[0] == 0.0 || lengths[1] == 0.0 {
            return Ok(None);
        }
        let sense = |arm: [f64; 2], velocity: SVector<f64, D>| (arm[0] * velocity[1] - arm[1] * velocity[0]).signum();
        let senses = [
            sense(upper, kin.point_velocity(elbow, &[1.0, 0.0])?),
            sense(lower, kin.point_velocity(point, &[0.0, 1.0])?),
        ];
        let direction = upper[1].atan2(upper[0]);
        let zero = [direction, lower[1].atan2(lower[0]) - direction];
        // The plane is seen with x to the right and z up, y to the right and z up, or x to the right and y up: for the axes of a plane
        // whose normal is next to y, which is positive, this is the view from behind.
        let normal = Vector3::from(basis.column(0)).cross(&basis.column(1));
        let view = if normal.iamax() == 1 { -1.0 } else { 1.0 };
        Ok(Some(Self { base, lengths, zero, view, sense: senses }))
    }

    /// A solution, up to whole turns; `elbow` = +1: left of the line from base to tip.
    fn pose(&self, &[direction, base, bend]: &Triangle, elbow: f64) -> [f64; 2] {
        let side = elbow * self.view;
        let turns = [direction + side * base, -side * bend];
        std::array::from_fn(|k| self.sense[k] * (turns[k] - self.zero[k]))
    }
}
