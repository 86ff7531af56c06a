//! Slip that turns, in plain numbers: power series in τ, with `dp = r dτ/κ`.
//!
//! In τ the flow is regular down to r = 0, which it reaches only as τ -> ∞:
//!
//! ```text
//! κ v_t' = h r - μ A v_t,   r² = v_t·v_t
//! κ p' = r,  κ p_t' = -μ v_t,  κ W_n' = r v_n,  κ W_t' = -μ r²,  v_n = v_n(0) + C p + h·p_t
//! ```
//!
//! Each coefficient follows from those before it (Taylor's method); κ = |h| + μ |A| makes the rates at most about 1. A
//! step ends where the last terms are at rounding relative to r itself, because a small r may grow again.

mod response;
mod values;

use nalgebra::{Matrix2, RealField, Vector2};
use pulp::{Arch, Scalar, Simd, WithSimd};

use super::series::{At, MOST_LANES, Series, TERMS, first, mul_add, root};
use super::state::Return;
use crate::contact::{Contact, length};
use crate::problem::plain;
use crate::roots::Function;
pub(super) use response::CHANGES;
use values::{Above, Evaluate, FindReturn, FindRise, Signed, Sum};

/// Truncation allowed in a step.
const FINE: f64 = f64::EPSILON / 2.0;

/// Products that are added side by side.
const BLOCK: usize = 4;

/// `1/k` by blocks; the first entry is zero.
const INVERSES: [[f64; BLOCK]; TERMS / BLOCK] = {
    let mut blocks = [[0.0; BLOCK]; TERMS / BLOCK];
    let mut k = 1;
    while k < TERMS {
        blocks[k / BLOCK][k % BLOCK] = 1.0 / k as f64;
        k += 1;
    }
    blocks
};

/// `1/(k + 1)`, which the integral of power k contains.
const INVERSES_OF_NEXT: Series = {
    let mut inverses = [0.0; TERMS];
    let mut k = 0;
    while k < TERMS {
        inverses[k] = 1.0 / (k + 1) as f64;
        k += 1;
    }
    inverses
};

/// A smaller coefficient may have underflowed.
const LEAST: f64 = 8.0 / f64::MAX;

/// One step of Taylor's method. The memory is made once for an impact.
pub(super) struct Turn {
    /// A, h, C and μ.
    tangents: Matrix2<f64>,
    coupling: Vector2<f64>,
    normal: f64,
    mu: f64,
    /// `1/κ`.
    by_scale: f64,
    /// Whether friction can lower v_n: `μ |h| > C`.
    lowers: bool,
    /// Direction and speed of slip and normal velocity at the start of the step.
    heading: Vector2<f64>,
    r: f64,
    start_v_n: f64,
    /// v_t/r(0).
    slip: [Series; 2],
    /// r/r(0).
    speed: Series,
    v_n: Series,
    /// Integrals over τ, divided by τ, of v_t/r(0), r/r(0) and `r v_n/r(0)`.
    path: [Series; 2],
    impulse: Series,
    work: Series,
    /// Ends of the intervals on which v_n is monotone; the last is the end of the step.
    cuts: [f64; 4],
    intervals: usize,
}

/// A quantity of a step as a function of τ.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quantity {
    /// v_n.
    Velocity,
    /// p.
    Impulse,
    /// W_n.
    Work,
}

/// Impulses and works from the start of a step, and the slip at its end.
pub(super) struct Sums {
    pub p: f64,
    pub p_t: Vector2<f64>,
    pub normal_work: f64,
    pub friction_work: f64,
    pub heading: Vector2<f64>,
    pub r: f64,
}

impl Turn {
    /// Memory for the steps of an impact with this friction; κ is given.
    pub fn new<T: RealField + Copy>(contact: &Contact<T>, mu: T, scale: T) -> Self {
        let (coupling, normal, mu, zero) =
            (contact.coupling.map(plain), plain(contact.normal), plain(mu), [0.0; TERMS]);
        Self {
            tangents: contact.tangents.map(plain),
            coupling,
            normal,
            mu,
            by_scale: 1.0 / plain(scale),
            lowers: mu * length(&coupling) > normal,
            heading: Vector2::zeros(),
            r: 0.0,
            start_v_n: 0.0,
            slip: [zero; 2],
            speed: zero,
            v_n: zero,
            path: [zero; 2],
            impulse: zero,
            work: zero,
            cuts: [0.0; 4],
            intervals: 1,
        }
    }

    /// Computes the step from a slip in this direction, at speed r, and a normal velocity.
    pub fn begin(&mut self, heading: Vector2<f64>, r: f64, v_n: f64) {
        (self.heading, self.r, self.start_v_n) = (heading, r, v_n);
        Arch::new().dispatch(Expand(self));
        (self.cuts[0], self.intervals) = (self.length(), 1);
        if self.lowers {
            self.cut();
        }
    }

    /// The coefficients, by recursion. With `k v_k = drive r_{k-1} - hold v_{k-1}` and `r² = v·v`, in units of r(0),
    ///
    /// ```text
    /// r_k = v_0·v_k + Σ_{0<i<k/2} (v_i·v_{k-i} - r_i r_{k-i}) + ½ (v_{k/2}² - r_{k/2}²)
    /// ```
    ///
    /// Each r_k waits for the one before it, so r_{k-1} enters with one product, and the products of earlier blocks
    /// are added up before a block of coefficients begins.
    #[inline(always)]
    fn expand<S: Simd>(&mut self, simd: S) {
        let (mu, u, r_0) = (self.mu, self.heading, self.r);
        let (drive, hold) = (self.coupling * self.by_scale, self.tangents * (mu * self.by_scale));
        // v_0·v_k = (along r_{k-1} - across·v_{k-1})/k.
        let (along, across) = (u.dot(&drive), hold * u);
        let zero = [u.x, u.y, 1.0];
        let one = [drive.x - across.x, drive.y - across.y, along - across.dot(&u)];
        // All products with 1/k, so that a coefficient waits for three operations on the one before it.
        let drive_by = [by_k(drive.x), by_k(drive.y), by_k(along)];
        let hold_by = [by_k(hold[(0, 0)]), by_k(hold[(0, 1)]), by_k(hold[(1, 1)])];
        let across_by = [by_k(across.x), by_k(across.y)];
        let next = |k: usize, [x, y, r]: [f64; 3], [x_1, y_1, r_1]: [f64; 3], sum: f64| {
            let (from, l) = (k / BLOCK, k % BLOCK);
            let [a, b, d] = [hold_by[0][from][l], hold_by[1][from][l], hold_by[2][from][l]];
            let (v_x, v_y) = (drive_by[0][from][l] * r - (a * x + b * y), drive_by[1][from][l] * r - (b * x + d * y));
            let rest = (x_1 - across_by[0][from][l]) * x + (y_1 - across_by[1][from][l]) * y;
            [v_x, v_y, mul_add(simd, drive_by[2][from][l] - r_1, r, sum) + rest]
        };
        let product = |a, b| product(simd, a, b);
        let two = next(2, one, one.map(|x| 0.5 * x), 0.0);
        let three = next(3, two, one, 0.0);
        let four = next(4, three, one, 0.5 * product(two, two));
        let five = next(5, four, one, product(two, three));
        let six = next(6, five, one, product(two, four) + 0.5 * product(three, three));
        let seven = next(7, six, one, product(two, five) + product(three, four));
        // The products with the first coefficient are in `next`.
        self.put(0, [zero, [0.0; 3], two, three]);
        let mut last = [four, five, six, seven];
        self.put(BLOCK, last);
        for from in (2 * BLOCK..TERMS).step_by(BLOCK) {
            let [mut along_x, mut along_y, mut fast] = [[0.0; BLOCK]; 3];
            // Late coefficients one by one with blocks of early ones, which have reached the memory.
            for j in from / 2 + BLOCK..from - 2 {
                let [x, y, r] = self.get(j);
                let [x_i, y_i, r_i] = [&self.slip[0], &self.slip[1], &self.speed].map(|of| block(of, from - j));
                for l in 0..BLOCK {
                    along_x[l] = mul_add(simd, x, x_i[l], along_x[l]);
                    along_y[l] = mul_add(simd, y, y_i[l], along_y[l]);
                    fast[l] = mul_add(simd, r, r_i[l], fast[l]);
                }
            }
            let mut sums: [f64; BLOCK] = std::array::from_fn(|l| along_x[l] + (along_y[l] - fast[l]));
            // Those about the middle, from/2: a block would have them twice.
            let [a, b, c, d, e, f, g] = std::array::from_fn(|i| self.get(from / 2 - 3 + i));
            sums[0] += (product(a, g) + product(b, f)) + (product(c, e) + 0.5 * product(d, d));
            sums[1] += (product(b, g) + product(c, f)) + product(d, e);
            sums[2] += (product(c, g) + product(d, f)) + 0.5 * product(e, e);
            sums[3] += product(d, g) + product(e, f);
            // The last two, without a way through memory; for the first block they are among those about the middle.
            let [y, z] = if from == 2 * BLOCK { [[0.0; 3]; 2] } else { [last[2], last[3]] };
            sums[0] += product(two, y);
            sums[1] += product(three, y) + product(two, z);
            sums[2] += product(four, y) + product(three, z);
            sums[3] += product(five, y) + product(four, z);
            let first = next(from, last[3], one, sums[0]);
            let second = next(from + 1, first, one, sums[1]);
            let third = next(from + 2, second, one, sums[2] + product(two, first));
            let rest = product(two, second) + product(three, first);
            last = [first, second, third, next(from + 3, third, one, sums[3] + rest)];
            self.put(from, last);
        }
        (self.slip[0][1], self.slip[1][1], self.speed[1]) = (one[0], one[1], one[2]);
        let Self { slip: [x, y], speed: r, path, impulse, work, .. } = self;
        let (rise, fall) = (self.normal * self.by_scale * r_0, drive * (mu * r_0));
        // Zeros before the coefficients of v_n, for the products below.
        let mut v_n = [0.0; MOST_LANES + TERMS + 1];
        v_n[MOST_LANES] = self.start_v_n;
        for k in 0..TERMS {
            let by = INVERSES_OF_NEXT[k];
            let (along_x, along_y, pushed) = (x[k] * by, y[k] * by, r[k] * by);
            (path[0][k], path[1][k], impulse[k]) = (along_x, along_y, pushed);
            v_n[MOST_LANES + k + 1] = rise * pushed - (fall.x * along_x + fall.y * along_y);
        }
        let (blocks, _) = S::as_mut_simd_f64s(work);
        let (inverses, _) = S::as_simd_f64s(&INVERSES_OF_NEXT);
        for (i, (block, inverses)) in blocks.iter_mut().zip(inverses).enumerate() {
            let mut sums = [simd.splat_f64s(0.0); BLOCK];
            let end = MOST_LANES + i * S::F64_LANES;
            for (k, r) in r.as_chunks::<BLOCK>().0[..=(i * S::F64_LANES + S::F64_LANES - 1) / BLOCK].iter().enumerate()
            {
                let speeds = &v_n[end - BLOCK * k - (BLOCK - 1)..][..S::F64_LANES + BLOCK - 1];
                for l in 0..BLOCK {
                    let speed = first::<S>(&speeds[BLOCK - 1 - l..]);
                    sums[l] = simd.mul_add_e_f64s(simd.splat_f64s(r[l]), speed, sums[l]);
                }
            }
            let sum = simd.add_f64s(simd.add_f64s(sums[0], sums[1]), simd.add_f64s(sums[2], sums[3]));
            *block = simd.mul_f64s(sum, *inverses);
        }
        self.v_n.copy_from_slice(&v_n[MOST_LANES..][..TERMS]);
    }

    /// (x, y, r) of coefficient k.
    #[inline(always)]
    fn get(&self, k: usize) -> [f64; 3] {
        [self.slip[0][k], self.slip[1][k], self.speed[k]]
    }

    #[inline(always)]
    fn put(&mut self, from: usize, of: [[f64; 3]; BLOCK]) {
        let Self { slip: [x, y], speed, .. } = self;
        for (i, series) in [x, y, speed].into_iter().enumerate() {
            series[from..from + BLOCK].copy_from_slice(&of.map(|of| of[i]));
        }
    }

    /// The τ at which the last two terms of v_t, r and W_n are at rounding.
    #[inline]
    fn length(&self) -> f64 {
        let rate = (self.normal + self.mu * self.coupling.amax()) * self.by_scale;
        let by_speed = 1.0 / (self.start_v_n.abs() + rate * self.r);
        let reach = |k: usize| {
            let turn = self.slip[0][k].abs().max(self.slip[1][k].abs());
            let work = (self.work[k] * by_speed).abs();
            let size = turn.max(self.speed[k].abs()).max(work).max(LEAST);
            (FINE.log2() - rough_log2(size)) * INVERSES_OF_NEXT[k - 1]
        };
        reach(TERMS - 1).min(reach(TERMS - 2)).exp2().min(1e3)
    }

    /// v_n, p or W_n, and its slope.
    pub fn quantity(&self, of: Quantity, t: f64) -> (f64, f64) {
        Arch::new().dispatch(Evaluate(self, of, t))
    }

    /// `κ dv_n/dτ = C r - μ h·v_t` changes sign at most once on either side of the direction of h, where it is least.
    #[cold]
    #[inline(never)]
    fn cut(&mut self) {
        let end = self.cuts[0];
        let (h, c) = (self.coupling, self.normal);
        let Self { slip: [x, y], speed, .. } = &*self;
        let (mut aside, mut rise) = ([0.0; TERMS], [0.0; TERMS]);
        for k in 0..TERMS {
            aside[k] = x[k] * h.y - y[k] * h.x;
            rise[k] = c * speed[k] - self.mu * (x[k] * h.x + y[k] * h.y);
        }
        // A zero between the ends, of either sign change.
        let crossing = |of: &Series, from: f64, to: f64| {
            let [first, last] = [from, to].map(|t| At::new(Scalar, t).value(of));
            let sign = if last >= 0.0 { 1.0 } else { -1.0 };
            (first * sign < 0.0).then(|| root(from, to, to, &Signed { of, sign }))
        };
        let mut cuts = [end; 4];
        let mut n = 0;
        let mut from = 0.0;
        let least = crossing(&aside, 0.0, end);
        for to in [least.unwrap_or(end), end] {
            if let Some(t) = crossing(&rise, from, to) {
                cuts[n] = t;
                n += 1;
            }
            if to < end {
                cuts[n] = to;
                n += 1;
            }
            from = to;
        }
        (self.cuts, self.intervals) = (cuts, n + 1);
    }

    /// The intervals after `after` on which v_n is monotone.
    #[inline(always)]
    fn intervals(&self, after: f64) -> impl Iterator<Item = (f64, f64)> {
        let start = |i: usize| if i == 0 { 0.0 } else { self.cuts[i - 1] };
        let all = (0..self.intervals).map(move |i| (start(i), self.cuts[i]));
        all.filter(move |&(_, to)| to > after).map(move |(from, to)| (from.max(after), to))
    }

    pub fn end(&self) -> f64 {
        self.cuts[self.intervals - 1]
    }

    /// The τ at which `v_n = 0` is reached from below, if it lies within the step.
    pub fn rises(&self) -> Option<f64> {
        Arch::new().dispatch(FindRise(self))
    }

    /// The τ at which the normal impulse has grown to `p`, if it lies within the step.
    pub fn reaches(&self, p: f64) -> Option<f64> {
        let above = Above { simd: Scalar, turn: self, of: Quantity::Impulse, aim: p, sign: 1.0 };
        let end = self.end();
        (above.at(end).0 >= 0.0).then(|| root(0.0, end, end, &above))
    }

    /// Where a quantity has grown to `aim`, or `v_n = 0` is reached from above, whichever is first after τ = `from`.
    pub fn returns(&self, of: Quantity, aim: f64, from: f64) -> Return<f64> {
        Arch::new().dispatch(FindReturn { turn: self, of, aim, from })
    }

    /// Impulses and works up to τ. The work of friction is the whole work `½ P·(u(0) + u)` without W_n.
    pub fn sums(&self, t: f64) -> Sums {
        Arch::new().dispatch(Sum(self, t))
    }

    /// Whether slip at τ is faster than at the start.
    pub fn grows(&self, t: f64) -> bool {
        At::new(Scalar, t).value(&self.speed) > 1.0
    }

    /// Whether v_n decreases anywhere up to t.
    pub fn jams(&self, t: f64) -> bool {
        let passed = self.cuts[..self.intervals - 1].iter().filter(|&&cut| cut < t);
        let falls = |t: &f64| self.quantity(Quantity::Velocity, *t).1 < 0.0;
        self.v_n[1] <= 0.0 || self.intervals > 1 && passed.chain([&t]).any(falls)
    }

    /// `1/κ`.
    pub fn by_scale(&self) -> f64 {
        self.by_scale
    }

    /// `W_n''/2` at `v_n = 0`.
    pub fn bend(&self) -> f64 {
        self.work[1] * self.r * self.by_scale
    }
}

/// The coefficients, computed with the vector instructions of the processor.
struct Expand<'a>(&'a mut Turn);

impl WithSimd for Expand<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        self.0.expand(simd);
    }
}

/// The binary logarithm of a positive number, at most 0.09 too small: linear between powers of two.
#[inline(always)]
fn rough_log2(x: f64) -> f64 {
    const UNIT: f64 = (1_u64 << 52) as f64;
    x.to_bits() as f64 / UNIT - 1023.0
}

/// Quotients of a number and each k.
#[inline(always)]
fn by_k(share: f64) -> [[f64; BLOCK]; TERMS / BLOCK] {
    let mut quotients = INVERSES;
    for block in &mut quotients {
        for quotient in block {
            *quotient *= share;
        }
    }
    quotients
}

/// A block of a series.
#[inline(always)]
fn block<const N: usize>(of: &[f64; N], from: usize) -> [f64; BLOCK] {
    let mut block = [0.0; BLOCK];
    block.copy_from_slice(&of[from..from + BLOCK]);
    block
}

/// `v·w - r s` of coefficients (v, r) and (w, s).
#[inline(always)]
fn product<S: Simd>(simd: S, [x, y, r]: [f64; 3], [v, w, s]: [f64; 3]) -> f64 {
    mul_add(simd, x, v, mul_add(simd, y, w, -r * s))
}
