//! The frictionless impact of an arm of two links in closed form over columns, for comparison with batches of the generic
//! kernel. It uses carom's sine and cosine and the same dispatch to instruction sets as the batches.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | s₁, c₁, s₂, c₂, s, c | sine and cosine of q₁, q₂, q₁ + q₂ |
//! | l₁, l₂ | from the first joint to the second, m; from there to the tip |
//! | m₂, h₂ | mass of the second link, kg; that times the distance of its centre, kg m |
//! | I₁, I₂ | rotational inertia of each link about its own joint, kg m² |
//! | a, b, d | M = [[a, b], [b, d]]: a = I₁ + I₂ + m₂l₁² + 2 l₁h₂c₂, b = I₂ + l₁h₂c₂, d = I₂ |
//! | g | Jᵀn |
//!
//! M⁻¹g = (d g₁ − b g₂, a g₂ − b g₁)/(ad − b²): in q̇⁺ the determinant cancels, so that q̇⁺ and the impulse cost one division.

use carom_chain::algebra::{PlanarJoint, Turn};
use carom_chain::sine::sin_cos_into;
use carom_chain::{Body, Chain, Planar, Point};
use carom_sim::{Outcomes, States};
use nalgebra::Vector2;
use pulp::{Arch, Simd, WithSimd};

/// Number of configurations in a block, as in the batches.
const BLOCK: usize = 64;
type Block = [f64; BLOCK];

/// An arm of two links, both along x at q = 0, with centres of mass on that line.
#[derive(Debug, Clone, Copy)]
pub struct TwoLinks {
    l1: f64,
    l2: f64,
    /// I₁ + I₂ + m₂l₁²
    whole: f64,
    /// I₂
    outer: f64,
    /// l₁h₂
    coupling: f64,
}

impl TwoLinks {
    /// `None` for other chains.
    pub fn new(chain: &Chain<Planar<f64>>, tip: Point<Planar<f64>>) -> Option<Self> {
        let [inner, outer] = chain.bodies() else { return None };
        let (along, h) = (outer.placement.translation, outer.inertia.first_moment);
        let straight = |it: &Body<Planar<f64>>| {
            let driven = it.joint == PlanarJoint::Revolute && it.ratio == 1.0 && it.shift == 0.0;
            driven && it.placement.rotation == Turn { sin: 0.0, cos: 1.0 }
        };
        let in_row = outer.parent == Some(0) && tip.body == Some(1) && straight(inner) && straight(outer);
        let on_line = along.y == 0.0 && h.y == 0.0 && tip.position.y == 0.0;
        (in_row && on_line).then(|| Self {
            l1: along.x,
            l2: tip.position.x,
            whole: inner.inertia.rotational + outer.inertia.rotational + outer.inertia.mass * along.x * along.x,
            outer: outer.inertia.rotational,
            coupling: along.x * h.x,
        })
    }

    /// As [`carom_sim::FrictionlessJump::many`], with all columns or with those of q̇⁺ and the impulse alone; a last block that
    /// is not full is left out.
    pub fn many(&self, states: States, normal: Vector2<f64>, restitution: f64, outcomes: &mut Outcomes) {
        Arch::new().dispatch(Sweep { links: *self, states, normal, restitution, outcomes });
    }
}

struct Sweep<'a, 'b, 'c> {
    links: TwoLinks,
    states: States<'a>,
    normal: Vector2<f64>,
    restitution: f64,
    outcomes: &'a mut Outcomes<'b, 'c>,
}

impl WithSimd for Sweep<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { links: TwoLinks { l1, l2, whole, outer, coupling }, states, normal, restitution, outcomes } = self;
        let States { q: [q1, q2], qd: [v1, v2] } = states else { return };
        let Outcomes { qd_plus: [after1, after2], impulse: [impulse], delassus, jacobian, mass_matrix } = outcomes
        else {
            return;
        };
        let all = !mass_matrix.is_empty();
        let blocks = |column| -> &[Block] { <[f64]>::as_chunks(column).0 };
        let states = blocks(q1).iter().zip(blocks(q2)).zip(blocks(v1).iter().zip(blocks(v2)));
        for (at, ((q1, q2), (v1, v2))) in states.enumerate() {
            let [mut s1, mut c1, mut s2, mut c2] = [[0.0; BLOCK]; 4];
            sin_cos_into(q1, &mut s1, &mut c1);
            sin_cos_into(q2, &mut s2, &mut c2);
            let [mut u1, mut u2, mut p] = [[0.0; BLOCK]; 3];
            let [mut j1x, mut j1y, mut j2x, mut j2y] = [[0.0; BLOCK]; 4];
            let [mut a, mut b, mut xx, mut xy, mut yy] = [[0.0; BLOCK]; 5];
            for i in 0..BLOCK {
                let (s, c) = (s1[i] * c2[i] + c1[i] * s2[i], c1[i] * c2[i] - s1[i] * s2[i]);
                (j2x[i], j2y[i]) = (-l2 * s, l2 * c);
                (j1x[i], j1y[i]) = (j2x[i] - l1 * s1[i], j2y[i] + l1 * c1[i]);
                let bent = coupling * c2[i];
                (a[i], b[i]) = (whole + 2.0 * bent, outer + bent);
                let (g1, g2) = (j1x[i] * normal.x + j1y[i] * normal.y, j2x[i] * normal.x + j2y[i] * normal.y);
                let (x1, x2) = (outer * g1 - b[i] * g2, a[i] * g2 - b[i] * g1);
                let scaled = -(1.0 + restitution) * (g1 * v1[i] + g2 * v2[i]) / (g1 * x1 + g2 * x2);
                (u1[i], u2[i]) = (v1[i] + x1 * scaled, v2[i] + x2 * scaled);
                p[i] = scaled * (a[i] * outer - b[i] * b[i]);
            }
            (after1.as_chunks_mut().0[at], after2.as_chunks_mut().0[at]) = (u1, u2);
            impulse.as_chunks_mut().0[at] = p;
            if all {
                for i in 0..BLOCK {
                    let (over, ratio) = (1.0 / (a[i] * outer - b[i] * b[i]), b[i]);
                    let (x, y) = (outer * j1x[i] - ratio * j2x[i], outer * j1y[i] - ratio * j2y[i]);
                    let (z, w) = (a[i] * j2x[i] - ratio * j1x[i], a[i] * j2y[i] - ratio * j1y[i]);
                    xx[i] = (j1x[i] * x + j2x[i] * z) * over;
                    xy[i] = (j1x[i] * y + j2x[i] * w) * over;
                    yy[i] = (j1y[i] * y + j2y[i] * w) * over;
                }
                let rows = [&xx, &xy, &xy, &yy, &j1x, &j1y, &j2x, &j2y, &a, &b, &b, &[outer; BLOCK]];
                let columns = delassus.iter_mut().chain(jacobian.iter_mut()).chain(mass_matrix.iter_mut());
                for (column, row) in columns.zip(rows) {
                    column.as_chunks_mut().0[at] = *row;
                }
            }
        }
    }
}
