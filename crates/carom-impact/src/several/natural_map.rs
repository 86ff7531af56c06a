//! The law as equations: a map F of the impulses that is zero exactly at a solution.
//!
//! F is the map of Alart & Curnier (1991), with each constraint's own h in place of their common parameter; it is
//! written out at [`SeveralOutcome::residual`](super::SeveralOutcome). F is piecewise smooth; its pieces are the modes
//! open, stick and slip. On each piece the derivative F' is exact, so Newton's method converges quadratically once no
//! constraint changes its mode.

use nalgebra::{DVector, Vector2};

use super::block::{Block, nothing};
use super::response::Response;
use super::{Constraint, SeveralProblem};

/// The problem in the form that the iteration uses.
pub(super) struct NaturalMap<'a> {
    pub response: &'a Response<'a>,
    /// Velocities without impulse plus the `e min(u_n⁻, 0)` of restitution: y at p = 0 (m/s).
    pub offset: DVector<f64>,
    pub blocks: Vec<Block>,
    /// Largest velocity (m/s), to which the residual is relative.
    speed: f64,
    /// Diagonal entries of H up to this count as zero (1/kg).
    nothing: f64,
}

impl<'a> NaturalMap<'a> {
    pub fn new(problem: &SeveralProblem, response: &'a Response) -> Self {
        let nothing = nothing(&problem.delassus);
        let mut offset = problem.u_free.clone();
        let mut blocks = Vec::with_capacity(problem.constraints.len());
        for (row, constraint) in problem.rows() {
            blocks.push(Block::new(*constraint, row, &problem.delassus, nothing));
            let last = row + constraint.rows() - 1;
            offset[last] += constraint.restitution() * problem.u_minus[last].min(0.0);
        }
        let speed = problem.u_free.amax().max(problem.u_minus.amax());
        Self { response, offset, blocks, speed, nothing }
    }

    /// The same problem with `share` of each constraint's h added to H, and with the velocities shifted by the
    /// corresponding multiple of the impulses `near`: regular, and with the same solution if `near` is one.
    pub fn regularised(&self, share: f64, near: &DVector<f64>) -> Self {
        let mut offset = self.offset.clone();
        for block in &self.blocks {
            for i in block.row..block.row + block.constraint.rows() {
                offset[i] -= share * block.scale * near[i];
            }
        }
        let blocks = self.blocks.iter().map(|block| block.regularised(share, self.nothing)).collect();
        Self { offset, blocks, ..*self }
    }

    /// The same problem with every coefficient of friction multiplied by `share`.
    pub fn with_friction(&self, share: f64) -> Self {
        let mut blocks = self.blocks.clone();
        for block in &mut blocks {
            if let Constraint::Contact { friction, .. } = &mut block.constraint {
                *friction *= share;
            }
        }
        Self { offset: self.offset.clone(), blocks, ..*self }
    }

    /// These impulses, projected on the cones and bounds, with their velocities and F; without them zero.
    pub fn at(&self, impulse: Option<&DVector<f64>>) -> Point {
        let mut at = Point::new(self);
        if let Some(impulse) = impulse {
            at.p.copy_from(impulse);
            self.admissible(&mut at.p);
        }
        self.evaluate(&mut at);
        at
    }

    /// Velocities and value of F at the impulses of `at`; of a regularised problem with what has been added to H.
    pub fn evaluate(&self, at: &mut Point) {
        self.response.reduce(&at.p, &mut at.w);
        self.response.velocities(&at.w, &mut at.y);
        for block in self.blocks.iter().filter(|block| block.added > 0.0) {
            for i in block.row..block.row + block.constraint.rows() {
                at.y[i] += block.added * at.p[i];
            }
        }
        at.y += &self.offset;
        self.value(&at.p, &at.y, &mut at.f);
    }

    /// F (m/s) at the impulses p, where the velocities are y.
    pub fn value(&self, p: &DVector<f64>, y: &DVector<f64>, f: &mut DVector<f64>) {
        let (p, y, f) = (p.as_slice(), y.as_slice(), f.as_mut_slice());
        for block in &self.blocks {
            let (i, h) = (block.row, block.scale);
            match block.constraint {
                Constraint::Contact { friction, .. } => {
                    let piece = Piece::of(block, friction, p, y);
                    let friction = piece.friction();
                    let value = [h * p[i] - friction.x, h * p[i + 1] - friction.y, h * p[i + 2] - piece.push];
                    f[i..i + 3].copy_from_slice(&value);
                }
                Constraint::Stop { .. } => f[i] = (h * p[i]).min(y[i]),
                Constraint::Dry { bound } => f[i] = h * p[i] - (h * p[i] - y[i]).clamp(-h * bound, h * bound),
                Constraint::Held => f[i] = y[i],
            }
        }
    }

    /// The largest violation among the constraints, relative to the largest velocity; infinite if F contains NaN, after
    /// an overflow.
    pub fn residual(&self, f: &DVector<f64>) -> f64 {
        let sizes = self.blocks.iter().map(|block| f.rows(block.row, block.constraint.rows()).norm());
        let worst = sizes.fold(0.0_f64, f64::max);
        if f.iter().any(|f| f.is_nan()) {
            f64::INFINITY
        } else if worst == 0.0 {
            0.0
        } else {
            worst / self.speed
        }
    }

    /// Projects the impulses on the cones and bounds; whether that changes them.
    pub fn admissible(&self, p: &mut DVector<f64>) -> bool {
        admissible(self.blocks.iter().map(|block| (block.row, &block.constraint)), p)
    }

    /// What the search makes small: the residual times one plus the largest impulse, as a share of the largest velocity.
    /// Without the second factor the best impulses of a problem without a solution may be of any size.
    pub fn cost(&self, residual: f64, p: &DVector<f64>) -> f64 {
        let pushed = self
            .blocks
            .iter()
            .fold(0.0_f64, |most, block| most.max(block.scale * p.rows(block.row, block.constraint.rows()).amax()));
        if residual == 0.0 { 0.0 } else { residual * (1.0 + pushed / self.speed) }
    }
}

/// Impulses, and what the map gives for them.
#[derive(Clone)]
pub(super) struct Point {
    /// Impulses (N s).
    pub p: DVector<f64>,
    /// Reduced impulses.
    pub w: DVector<f64>,
    /// Velocities minus their targets (m/s).
    pub y: DVector<f64>,
    /// F (m/s).
    pub f: DVector<f64>,
}

impl Point {
    pub fn new(map: &NaturalMap) -> Self {
        let n = map.offset.len();
        let zeros = || DVector::zeros(n);
        Self { p: zeros(), w: DVector::zeros(map.response.rank()), y: zeros(), f: zeros() }
    }
}

/// Projects the impulses on the cones and bounds (the normal first, then the tangents); whether that changes them.
pub(super) fn admissible<'a>(rows: impl Iterator<Item = (usize, &'a Constraint)>, p: &mut DVector<f64>) -> bool {
    let mut changes = false;
    for (i, constraint) in rows {
        match *constraint {
            Constraint::Contact { friction, .. } => {
                let [x, y, z] = [p[i], p[i + 1], p[i + 2]];
                let size = x.hypot(y);
                let most = friction * z.max(0.0);
                if z < 0.0 || size > most {
                    // Divided first: most/size may overflow for a tiny size.
                    let [x, y] = if size > most { [x / size * most, y / size * most] } else { [x, y] };
                    p.fixed_rows_mut::<3>(i).copy_from_slice(&[x, y, z.max(0.0)]);
                    changes = true;
                }
            }
            Constraint::Stop { .. } => {
                changes |= p[i] < 0.0;
                p[i] = p[i].max(0.0);
            }
            Constraint::Dry { bound } => {
                changes |= p[i].abs() > bound;
                p[i] = p[i].clamp(-bound, bound);
            }
            Constraint::Held => {}
        }
    }
    changes
}

/// The piece of F on which a contact is, in velocities.
pub(super) struct Piece {
    /// `max(0, h p_n - y)`.
    pub push: f64,
    /// `h p_t - u_t`.
    pub aim: Vector2<f64>,
    /// The length of `aim`.
    pub size: f64,
    /// `μ push`.
    pub radius: f64,
}

impl Piece {
    pub fn of(block: &Block, mu: f64, p: &[f64], y: &[f64]) -> Self {
        let (i, h) = (block.row, block.scale);
        let push = (h * p[i + 2] - y[i + 2]).max(0.0);
        let aim = Vector2::new(h * p[i] - y[i], h * p[i + 1] - y[i + 1]);
        Self { push, aim, size: aim.norm(), radius: mu * push }
    }

    pub fn sticks(&self) -> bool {
        self.size <= self.radius
    }

    /// Friction impulse: the trial impulse `aim`, projected on the friction disc.
    fn friction(&self) -> Vector2<f64> {
        if self.sticks() { self.aim } else { self.aim / self.size * self.radius }
    }
}
