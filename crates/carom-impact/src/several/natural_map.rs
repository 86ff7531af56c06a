//! The law as equations: a map F of the impulses that is zero exactly at a solution, and its derivative.
//!
//! F is the map of Alart & Curnier (1991), with each constraint's own h in place of their common parameter; it is
//! written out at [`SeveralOutcome::residual`](super::SeveralOutcome). F is piecewise smooth; its pieces are the modes
//! open, stick and slip. On each piece the derivative F' is exact, so Newton's method converges quadratically once no
//! constraint changes its mode.

use nalgebra::{DMatrix, DVector, Vector2, Vector3};

use super::block::Block;
use super::{Constraint, SeveralProblem};

/// The problem in the form that the iteration uses.
pub(super) struct NaturalMap {
    pub delassus: DMatrix<f64>,
    /// Velocities without impulse plus the `e min(u_n⁻, 0)` of restitution: y at p = 0 (m/s).
    pub offset: DVector<f64>,
    pub blocks: Vec<Block>,
    /// Largest velocity (m/s), to which the residual is relative.
    speed: f64,
}

impl NaturalMap {
    pub fn new(problem: &SeveralProblem) -> Self {
        let mut offset = problem.u_free.clone();
        let mut blocks = Vec::with_capacity(problem.constraints.len());
        let mut row = 0;
        for constraint in &problem.constraints {
            blocks.push(Block::new(*constraint, row, &problem.delassus));
            row += constraint.rows();
            offset[row - 1] += constraint.restitution() * problem.u_minus[row - 1].min(0.0);
        }
        let speed = problem.u_free.amax().max(problem.u_minus.amax());
        Self { delassus: problem.delassus.clone(), offset, blocks, speed }
    }

    /// The same problem with `share` of each constraint's h added to H, and with the velocities shifted by the
    /// corresponding multiple of the impulses `near`: regular, and with the same solution if `near` is one.
    pub fn regularised(&self, share: f64, near: &DVector<f64>) -> Self {
        let (mut delassus, mut offset) = (self.delassus.clone(), self.offset.clone());
        for block in &self.blocks {
            for i in block.row..block.row + block.constraint.rows() {
                delassus[(i, i)] += share * block.scale;
                offset[i] -= share * block.scale * near[i];
            }
        }
        let blocks = self.blocks.iter().map(|block| Block::new(block.constraint, block.row, &delassus)).collect();
        Self { delassus, offset, blocks, speed: self.speed }
    }

    /// F(p) (m/s).
    pub fn value(&self, p: &DVector<f64>) -> DVector<f64> {
        let y = &self.offset + &self.delassus * p;
        let mut f = DVector::zeros(p.len());
        for block in &self.blocks {
            let (i, h) = (block.row, block.scale);
            match block.constraint {
                Constraint::Contact { friction, .. } => {
                    let piece = Piece::of(block, friction, p, &y);
                    let t = Vector2::new(h * p[i], h * p[i + 1]) - piece.friction();
                    f[i] = t.x;
                    f[i + 1] = t.y;
                    f[i + 2] = h * p[i + 2] - piece.push;
                }
                Constraint::Stop { .. } => f[i] = (h * p[i]).min(y[i]),
                Constraint::Dry { bound } => f[i] = h * p[i] - (h * p[i] - y[i]).clamp(-h * bound, h * bound),
                Constraint::Held => f[i] = y[i],
            }
        }
        f
    }

    /// The largest violation among the constraints, relative to the largest velocity.
    pub fn residual(&self, f: &DVector<f64>) -> f64 {
        let worst = self
            .blocks
            .iter()
            .fold(0.0_f64, |worst, block| worst.max(f.rows(block.row, block.constraint.rows()).norm()));
        if worst == 0.0 { 0.0 } else { worst / self.speed }
    }

    /// F'(p) (1/kg).
    pub fn derivative(&self, p: &DVector<f64>) -> DMatrix<f64> {
        let y = &self.offset + &self.delassus * p;
        let n = p.len();
        let mut d = DMatrix::zeros(n, n);
        let copy = |d: &mut DMatrix<f64>, row: usize| d.row_mut(row).copy_from(&self.delassus.row(row));
        for block in &self.blocks {
            let (i, h) = (block.row, block.scale);
            match block.constraint {
                Constraint::Contact { friction, .. } => self.contact_rows(&mut d, block, friction, p, &y),
                Constraint::Stop { .. } if h * p[i] <= y[i] => d[(i, i)] = h,
                Constraint::Dry { bound } if (h * p[i] - y[i]).abs() > h * bound => d[(i, i)] = h,
                Constraint::Stop { .. } | Constraint::Dry { .. } | Constraint::Held => copy(&mut d, i),
            }
        }
        d
    }

    fn contact_rows(&self, d: &mut DMatrix<f64>, block: &Block, mu: f64, p: &DVector<f64>, y: &DVector<f64>) {
        let (i, h) = (block.row, block.scale);
        let piece = Piece::of(block, mu, p, y);
        if piece.push <= 0.0 {
            for k in i..i + 3 {
                d[(k, k)] = h;
            }
            return;
        }
        d.row_mut(i + 2).copy_from(&self.delassus.row(i + 2));
        if piece.sticks() {
            d.rows_mut(i, 2).copy_from(&self.delassus.rows(i, 2));
            return;
        }
        // F_t = h p_t - R r/|r| with r = h p_t - u_t and R = μ (h p_n - y).
        let size = piece.aim.norm();
        let towards = piece.aim / size;
        let across = Vector2::new(-towards.y, towards.x);
        for j in 0..d.ncols() {
            let unit = |k: usize| if j == k { h } else { 0.0 };
            let own = Vector2::new(unit(i), unit(i + 1));
            let aim = own - Vector2::new(self.delassus[(i, j)], self.delassus[(i + 1, j)]);
            let push = unit(i + 2) - self.delassus[(i + 2, j)];
            let t = own - towards * (mu * push) - across * (across.dot(&aim) * piece.radius / size);
            d[(i, j)] = t.x;
            d[(i + 1, j)] = t.y;
        }
    }

    /// The impulses projected on the cones and bounds (the normal first, then the tangents).
    pub fn admissible(&self, mut p: DVector<f64>) -> DVector<f64> {
        for block in &self.blocks {
            let i = block.row;
            match block.constraint {
                Constraint::Contact { friction, .. } => {
                    let own = Vector3::new(p[i], p[i + 1], p[i + 2].max(0.0));
                    let (size, most) = (own.xy().norm(), friction * own.z);
                    // Divided first: most/size may overflow for a tiny size.
                    let t = if size > most { own.xy() / size * most } else { own.xy() };
                    p.fixed_rows_mut::<3>(i).copy_from(&Vector3::new(t.x, t.y, own.z));
                }
                Constraint::Stop { .. } => p[i] = p[i].max(0.0),
                Constraint::Dry { bound } => p[i] = p[i].clamp(-bound, bound),
                Constraint::Held => {}
            }
        }
        p
    }
}

/// The piece of F on which a contact is, in velocities.
struct Piece {
    /// `max(0, h p_n - y)`.
    push: f64,
    /// `h p_t - u_t`.
    aim: Vector2<f64>,
    /// `μ push`.
    radius: f64,
}

impl Piece {
    fn of(block: &Block, mu: f64, p: &DVector<f64>, y: &DVector<f64>) -> Self {
        let (i, h) = (block.row, block.scale);
        let push = (h * p[i + 2] - y[i + 2]).max(0.0);
        Self { push, aim: Vector2::new(h * p[i] - y[i], h * p[i + 1] - y[i + 1]), radius: mu * push }
    }

    fn sticks(&self) -> bool {
        self.aim.norm() <= self.radius
    }

    /// Friction impulse: the trial impulse `aim`, projected on the friction disc.
    fn friction(&self) -> Vector2<f64> {
        if self.sticks() { self.aim } else { self.aim.normalize() * self.radius }
    }
}
