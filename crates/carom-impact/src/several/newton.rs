//! One step of Newton's method on the natural map, as an r × r system.
//!
//! | Symbol | Size | Meaning |
//! |---|---|---|
//! | D, E | n × n | `F' = D + E H` on the current piece; block diagonal, one block per constraint |
//! | d | n | step of the impulses: p becomes p − d |
//! | w | r | its reduced impulse, `Vᵀ d`, so that `H d = U w` (`response.rs`) |
//! | σ | 1 | regularisation of a constraint (1/kg) |
//! | X, z | n × n, n | `(D + σ E)⁻¹ E` and `(D + σ E)⁻¹ F`, block by block in closed form |
//!
//! The step solves `(D + σ E) d + E H d = F`, which is a step for the problem with σ added to the diagonal of H. For a
//! constraint that is active D is singular, and with redundant contacts so is F'; σ, a tiny share of h, selects one of
//! the steps and costs no accuracy, because the next step starts from the exact F. With `d = z - X U w`
//!
//! ```text
//! (1 + Vᵀ X U) w = Vᵀ z
//! ```
//!
//! On the pieces of a contact, with t along `h p_t - u_t`, a across it, R = μ (h p_n - y) and ρ = R/|h p_t - u_t|:
//!
//! ```text
//! open   F = h p            D = h, E = 0
//! stick  F = (u_t, y)       D = 0, E = 1
//! slip   F_t = h p_t - R t  D_tt = h (1 - ρ a aᵀ), D_tn = -μ h t, E_tt = ρ a aᵀ, E_tn = μ t
//!        F_n = y            E_nn = 1
//! ```

use nalgebra::{DVector, Matrix3, Vector2, Vector3};

use super::Constraint;
use super::block::Block;
use super::elimination;
use super::natural_map::{NaturalMap, Piece, Point};

/// X and z of one constraint, in the first entries if it has one row.
struct Eliminated {
    x: Matrix3<f64>,
    z: Vector3<f64>,
}

impl Eliminated {
    /// Whether X is not zero: the contact is closed, the stop pushes, dry friction sticks.
    fn is_active(&self) -> bool {
        self.x[(0, 0)] != 0.0 || self.x[(2, 2)] != 0.0
    }
}

/// Memory of the steps of one problem.
pub(super) struct Newton {
    blocks: Vec<Eliminated>,
    /// The rows of the active constraints.
    active: Vec<usize>,
    /// The columns of the matrix of the equations.
    matrix: Vec<f64>,
    /// w, and before the solution its right-hand side.
    w: DVector<f64>,
    /// d.
    pub step: DVector<f64>,
}

impl Newton {
    pub fn new(map: &NaturalMap) -> Self {
        let n = map.offset.len();
        Self {
            blocks: Vec::with_capacity(map.blocks.len()),
            active: Vec::with_capacity(n),
            matrix: Vec::new(),
            w: DVector::zeros(map.response.rank()),
            step: DVector::zeros(n),
        }
    }

    /// The step, with σ as this share of each h beside what the problem itself has added to it, and how much of F it
    /// leaves because of σ, about `|σ d|` of the active constraints (m/s); `None` if the equations are singular.
    pub fn solve(&mut self, map: &NaturalMap, at: &Point, share: f64) -> Option<f64> {
        self.blocks.clear();
        self.blocks.extend(map.blocks.iter().map(|block| eliminated(block, at, share)));
        for (block, own) in map.blocks.iter().zip(&self.blocks) {
            self.step.rows_mut(block.row, block.constraint.rows()).copy_from(&own.z.rows(0, block.constraint.rows()));
        }
        if map.response.is_thin() {
            self.by_reduced_impulse(map)?
        } else {
            self.by_active_rows(map)?
        }
        let mut left = 0.0;
        for (block, _) in map.blocks.iter().zip(&self.blocks).filter(|(_, own)| own.is_active()) {
            let d = self.step.rows(block.row, block.constraint.rows());
            left += (share * block.scale).powi(2) * d.norm_squared();
        }
        Some(left.sqrt())
    }

    /// d from z by the r × r system.
    fn by_reduced_impulse(&mut self, map: &NaturalMap) -> Option<()> {
        let rows = map.response.rows();
        let r = rows.nrows();
        identity(r, &mut self.matrix);
        for (block, own) in map.blocks.iter().zip(&self.blocks).filter(|(_, own)| own.is_active()) {
            let i = block.row;
            if block.constraint.rows() == 3 {
                let u = rows.fixed_columns::<3>(i);
                let along = u * own.x;
                let [x, y, z] = [0, 1, 2].map(|k| &along.as_slice()[k * r..(k + 1) * r]);
                for (column, u) in self.matrix.chunks_exact_mut(r).zip(u.row_iter()) {
                    let [a, b, c] = [u[0], u[1], u[2]];
                    let entries = column.iter_mut().zip(x).zip(y).zip(z);
                    entries.for_each(|(((entry, x), y), z)| *entry += a * x + b * y + c * z);
                }
            } else {
                let u = rows.column(i);
                for (column, own_u) in self.matrix.chunks_exact_mut(r).zip(&u) {
                    let share = own.x[(0, 0)] * own_u;
                    column.iter_mut().zip(&u).for_each(|(entry, u)| *entry += share * u);
                }
            }
        }
        map.response.reduce(&self.step, &mut self.w);
        elimination::solve(&mut self.matrix, self.w.as_mut_slice()).then_some(())?;
        for (block, own) in map.blocks.iter().zip(&self.blocks).filter(|(_, own)| own.is_active()) {
            let i = block.row;
            let u = |k: usize| map.response.velocity(i + k, &self.w);
            if block.constraint.rows() == 3 {
                let d = own.z - own.x * Vector3::new(u(0), u(1), u(2));
                self.step.fixed_rows_mut::<3>(i).copy_from(&d);
            } else {
                self.step[i] -= own.x[(0, 0)] * u(0);
            }
        }
        Some(())
    }

    /// The same with V = 1, so that w = d: `(1 + X H) d = z` in the rows of the active constraints; in the others, where X is 0, d = z.
    fn by_active_rows(&mut self, map: &NaturalMap) -> Option<()> {
        self.active.clear();
        for (block, _) in map.blocks.iter().zip(&self.blocks).filter(|(_, own)| own.is_active()) {
            self.active.extend(block.row..block.row + block.constraint.rows());
        }
        let (rows, active) = (map.response.rows(), &self.active);
        let (n, m) = (rows.nrows(), active.len());
        identity(m, &mut self.matrix);
        // The steps of the others.
        self.w.copy_from(&self.step);
        active.iter().for_each(|&i| self.w[i] = 0.0);
        let others = self.w.iter().any(|z| *z != 0.0);
        let mut d = Vec::with_capacity(m);
        for (block, own) in map.blocks.iter().zip(&self.blocks).filter(|(_, own)| own.is_active()) {
            let (i, count) = (block.row, block.constraint.rows());
            let pushed = |k: usize| if others && k < count { map.response.velocity(i + k, &self.w) } else { 0.0 };
            let known = own.z - own.x * Vector3::new(pushed(0), pushed(1), pushed(2));
            let at = d.len();
            d.extend_from_slice(&known.as_slice()[..count]);
            let h = |k: usize| &rows.as_slice()[(i + k) * n..(i + k + 1) * n];
            if count == 3 {
                let [x, y, z] = [h(0), h(1), h(2)];
                for (column, &j) in self.matrix.chunks_exact_mut(m).zip(active) {
                    let column = &mut column[at..at + 3];
                    let moved = own.x * Vector3::new(x[j], y[j], z[j]);
                    column.iter_mut().zip(&moved).for_each(|(entry, moved)| *entry += moved);
                }
            } else {
                let x = h(0);
                let columns = self.matrix.chunks_exact_mut(m).zip(active);
                columns.for_each(|(column, &j)| column[at] += own.x[(0, 0)] * x[j]);
            }
        }
        elimination::solve(&mut self.matrix, &mut d).then_some(())?;
        active.iter().zip(&d).for_each(|(&i, d)| self.step[i] = *d);
        Some(())
    }
}

/// The columns of the identity of n × n.
fn identity(n: usize, matrix: &mut Vec<f64>) {
    matrix.clear();
    matrix.resize(n * n, 0.0);
    (0..n).for_each(|k| matrix[k * (n + 1)] = 1.0);
}

/// X and z of one constraint, by the table at the head of this module.
fn eliminated(block: &Block, at: &Point, share: f64) -> Eliminated {
    let (i, h) = (block.row, block.scale);
    let sigma = block.added + share * h;
    let one = |active: bool| {
        let (x, z) = if active { (1.0 / sigma, at.f[i] / sigma) } else { (0.0, at.f[i] / h) };
        Eliminated { x: Matrix3::from_diagonal(&Vector3::new(x, 0.0, 0.0)), z: Vector3::new(z, 0.0, 0.0) }
    };
    match block.constraint {
        Constraint::Stop { .. } => one(h * at.p[i] > at.y[i]),
        Constraint::Dry { bound } => one((h * at.p[i] - at.y[i]).abs() <= h * bound),
        Constraint::Held => one(true),
        Constraint::Contact { friction, .. } => {
            let f = at.f.fixed_rows::<3>(i).into_owned();
            let piece = Piece::of(block, friction, at.p.as_slice(), at.y.as_slice());
            if piece.push <= 0.0 {
                return Eliminated { x: Matrix3::zeros(), z: f / h };
            }
            if piece.sticks() {
                return Eliminated { x: Matrix3::from_diagonal_element(1.0 / sigma), z: f / sigma };
            }
            let t = piece.aim / piece.size;
            let a = Vector2::new(-t.y, t.x);
            let rho = piece.radius / piece.size;
            let across = h * (1.0 - rho) + sigma * rho;
            let mut x = Matrix3::zeros();
            x.fixed_view_mut::<2, 2>(0, 0).copy_from(&(a * a.transpose() * (rho / across)));
            x.fixed_view_mut::<2, 1>(0, 2).copy_from(&(t * (friction / sigma)));
            x[(2, 2)] = 1.0 / sigma;
            let normal = f.z / sigma;
            let along = (t.dot(&f.xy()) + friction * (h - sigma) * normal) / h;
            let z = t * along + a * (a.dot(&f.xy()) / across);
            Eliminated { x, z: Vector3::new(z.x, z.y, normal) }
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::super::SeveralProblem;
    use super::super::response::Response;
    use super::*;

    fn wide(rng: &mut fastrand::Rng) -> f64 {
        2.0 * rng.f64() - 1.0
    }

    /// Contacts, stops, dry joints and held directions on this share of as many freedoms as rows.
    fn drawn(rng: &mut fastrand::Rng, share: f64) -> SeveralProblem {
        let constraints: Vec<_> = (0..8)
            .map(|k| match k % 4 {
                0 => Constraint::Stop { restitution: rng.f64() },
                1 => Constraint::Dry { bound: rng.f64() },
                2 if rng.bool() => Constraint::Held,
                _ => Constraint::Contact { restitution: rng.f64(), friction: 2.0 * rng.f64() },
            })
            .collect();
        let rows: usize = constraints.iter().map(Constraint::rows).sum();
        let j = DMatrix::from_fn(rows, (share * rows as f64) as usize, |_, _| wide(rng));
        let v = DVector::from_fn(j.ncols(), |_, _| wide(rng));
        SeveralProblem::new(&j * j.transpose(), &j * v, constraints).unwrap()
    }

    /// F at p − s d is F − s F' d. With the step of the problem to which σ has been added, whose F' d is F exactly, it is
    /// (1 − s) F wherever no piece ends, and the error of the difference quotient is of second order in s.
    #[test]
    fn step_removes_the_value_to_first_order() {
        let mut rng = fastrand::Rng::with_seed(1);
        let (mut checked, mut thin_ones) = (0, 0);
        for k in 0..400 {
            let thin = k % 2 == 0;
            let problem = drawn(&mut rng, if thin { 0.4 } else { 1.3 });
            let factors = Response::thin(&problem.delassus);
            assert_eq!(factors.is_some(), thin);
            let response = factors.unwrap_or_else(|| Response::whole(&problem.delassus, true));
            let start = DVector::from_fn(problem.u_free.len(), |_, _| wide(&mut rng));
            // Regularised, so that σ of the problem enters the step as well.
            let map = NaturalMap::new(&problem, &response).regularised(0.05, &start);
            let mut at = Point::new(&map);
            at.p.copy_from(&start);
            map.evaluate(&mut at);
            let mut newton = Newton::new(&map);
            newton.solve(&map, &at, 0.0).unwrap();
            let s = 1e-7;
            let mut next = Point::new(&map);
            next.p.copy_from(&(&at.p - &newton.step * s));
            map.evaluate(&mut next);
            let moved = (&at.y - &next.y) / s;
            for block in &map.blocks {
                let rows = |x: &DVector<f64>| x.rows(block.row, block.constraint.rows()).into_owned();
                let left = (rows(&at.f) - rows(&next.f)) / s - rows(&at.f);
                let size = 1.0 + moved.amax() + block.scale * newton.step.amax();
                // A curved piece, near the tip of its cone, or the end of a piece within the step.
                if left.amax() <= 1e-4 * size {
                    checked += 1;
                    thin_ones += usize::from(thin);
                }
            }
        }
        println!("{checked} of 3200 constraints, {thin_ones} of them in thin problems");
        assert!(checked > 3190 && thin_ones > 1595, "{checked} {thin_ones}");
    }
}
