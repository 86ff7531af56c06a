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
//!
//! The derivatives of a step are integrals along it. With `f = k_φ`, `g = dr/dp`, `ℓ = ln r`, at the same τ, a change of
//! φ and r at the start and of the parameters of the flow, h and `μ A`, changes
//!
//! ```text
//! κ (δφ)' = f_φ δφ + δf,   κ (δℓ)' = g_φ δφ + δg,   δf = u⊥·(δh - δ(μ A) u),   δg = u·(δh - δ(μ A) u)
//! δφ = E (δφ(0) + ∫ δf/(κ E) dτ),   ln E = ∫ f_φ/κ dτ
//! δp = ∫ δℓ dp,   δp_t = -∫ (μ u δℓ + μ u⊥ δφ + δμ u) dp,   δW_n = ∫ (δv_n + v_n δℓ) dp,   δW_t = -∫ r (2 μ δℓ + δμ) dp
//! ```

use nalgebra::{Matrix2, Vector2};

use super::gauss::{COUNT, NODES, WEIGHTS, running, whole};
use super::series::{ORDER, Series, inverse, root, with_slope};
use crate::contact::length;

/// Truncation allowed in a step.
const FINE: f64 = f64::EPSILON / 16.0;

/// A smaller coefficient may have underflowed.
const LEAST: f64 = 8.0 / f64::MAX;

/// Parameters of the flow: h, and `μ A` as (1, 1), (1, 2), (2, 2).
const PARAMETERS: usize = 5;

/// Changes of which [`Response`] has the derivatives: of φ and ln r at the start, and of the parameters.
pub(super) const CHANGES: usize = 2 + PARAMETERS;

/// The contact and its state at the start of a step.
#[derive(Debug, Clone, Copy)]
pub(super) struct Start {
    pub tangents: Matrix2<f64>,
    pub coupling: Vector2<f64>,
    pub normal: f64,
    pub mu: f64,
    /// κ.
    pub scale: f64,
    pub heading: Vector2<f64>,
    pub r: f64,
    pub v_n: f64,
}

/// One step of Taylor's method.
pub(super) struct Turn {
    start: Start,
    /// `1/κ`.
    by_scale: f64,
    /// v_t.
    slip: Series<Vector2<f64>>,
    /// r and v_n.
    speeds: Series<Vector2<f64>>,
    /// `r²` and `r v_n`.
    squares: Series<Vector2<f64>>,
    /// Ends of the intervals on which v_n is monotone; the last is the end of the step.
    cuts: [f64; 4],
    intervals: usize,
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

/// Derivatives of [`Sums`] at the same τ, one per change, without what changes of μ, C, h and v_n(0) add at the same
/// slip.
#[derive(Default)]
pub(super) struct Response {
    pub phi: [f64; CHANGES],
    pub log_r: [f64; CHANGES],
    pub p: [f64; CHANGES],
    pub p_t: [[f64; CHANGES]; 2],
    pub normal_work: [f64; CHANGES],
    pub friction_work: [f64; CHANGES],
    /// `∫ (p_end - p) dp`, and `∫ (p_end - p) u dp`.
    pub lever: f64,
    pub lever_t: Vector2<f64>,
}

fn across(u: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-u.y, u.x)
}

impl Turn {
    #[inline(always)]
    pub fn new(start: Start) -> Self {
        let Start { tangents, coupling, normal, mu, r: r_0, v_n: v_0, .. } = start;
        let (none, by_scale) = (Vector2::zeros(), 1.0 / start.scale);
        let (drive, hold, rise) = (coupling * by_scale, tangents * (mu * by_scale), normal * by_scale);
        let mut slip = [none; ORDER + 1];
        let mut speeds = [none; ORDER + 1];
        let mut squares = [none; ORDER + 1];
        slip[0] = start.heading * r_0;
        speeds[0] = Vector2::new(r_0, v_0);
        squares[0] = speeds[0] * r_0;
        let by_twice = 1.0 / (r_0 + r_0);
        for k in 1..=ORDER {
            let (v, r, by) = (slip[k - 1], speeds[k - 1].x, inverse(k));
            let v_t = (drive * r - hold.column(0) * v.x - hold.column(1) * v.y) * by;
            let v_n = (rise * r - mu * drive.dot(&v)) * by;
            // Coefficient k of the products (Cauchy), from the middle outwards: the newest coefficients enter last.
            // `half` contains half the terms of v_t·v_t, `ours` and `theirs` those of (r², r v_n) without r₀ r_k.
            let (mut half, mut ours, mut theirs) = (none, none, none);
            for i in (1..k.div_ceil(2)).rev() {
                let j = k - i;
                half += slip[i].component_mul(&slip[j]);
                ours += speeds[i] * speeds[j].x;
                theirs += speeds[j] * speeds[i].x;
            }
            half += slip[0].component_mul(&v_t);
            let (mut whole, mut rest) = (half + half, ours + theirs);
            if k % 2 == 0 {
                let i = k / 2;
                whole += slip[i].component_mul(&slip[i]);
                rest += speeds[i] * speeds[i].x;
            }
            let square = whole.x + whole.y;
            let r = (square - rest.x) * by_twice;
            slip[k] = v_t;
            speeds[k] = Vector2::new(r, v_n);
            squares[k] = Vector2::new(square, rest.y + r_0 * v_n + r * v_0);
        }
        let mut turn = Self { start, by_scale, slip, speeds, squares, cuts: [0.0; 4], intervals: 1 };
        turn.cuts[0] = turn.length();
        if mu * length(&coupling) > normal {
            turn.cut();
        }
        turn
    }

    /// The τ at which the last two terms of v_t, r and r² (in the works) are at rounding.
    #[inline]
    fn length(&self) -> f64 {
        let first = self.speeds[0].x;
        let reach = |k: usize| {
            let turn = self.slip[k].amax();
            let work = self.squares[k].x / (first * k as f64);
            let size = turn.max(self.speeds[k].x.abs()).max(work.abs()).max(LEAST) / first;
            (FINE / size).powf(inverse(k))
        };
        reach(ORDER).min(reach(ORDER - 1)).min(1e3)
    }

    /// v_n and its slope.
    #[inline]
    pub fn v_n(&self, t: f64) -> (f64, f64) {
        with_slope(|k| self.speeds[k].y, t)
    }

    /// `κ dv_n/dτ = C r - μ h·v_t` changes sign at most once on either side of the direction of h, where it is least.
    fn cut(&mut self) {
        let end = self.cuts[0];
        let (h, c) = (self.start.coupling, self.start.normal);
        let beside = |t: f64| with_slope(|k| self.slip[k].perp(&h), t);
        let rate = |t: f64| with_slope(|k| c * self.speeds[k].x - self.start.mu * self.slip[k].dot(&h), t);
        // A zero between the ends, of either sign change.
        let crossing = |f: &dyn Fn(f64) -> (f64, f64), from: f64, to: f64| {
            let (first, last) = (f(from).0, f(to).0);
            let sign = if last >= 0.0 { 1.0 } else { -1.0 };
            (first * sign < 0.0).then(|| {
                root(from, to, |t| {
                    let (value, slope) = f(t);
                    (value * sign, slope * sign)
                })
            })
        };
        let mut cuts = [end; 4];
        let mut n = 0;
        let mut from = 0.0;
        let least = crossing(&beside, 0.0, end);
        for to in [least.unwrap_or(end), end] {
            if let Some(t) = crossing(&rate, from, to) {
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

    pub fn intervals(&self) -> impl Iterator<Item = (f64, f64)> {
        let start = |i: usize| if i == 0 { 0.0 } else { self.cuts[i - 1] };
        (0..self.intervals).map(move |i| (start(i), self.cuts[i]))
    }

    pub fn end(&self) -> f64 {
        self.cuts[self.intervals - 1]
    }

    #[inline]
    pub fn sums(&self, t: f64) -> Sums {
        let none = Vector2::zeros();
        // The slip, and the integrals of slip, r and works divided by t.
        let (mut slip, mut path, mut impulse, mut works) = (none, none, 0.0, none);
        for k in (0..=ORDER).rev() {
            let by = inverse(k + 1);
            slip = slip * t + self.slip[k];
            path = path * t + self.slip[k] * by;
            impulse = impulse * t + self.speeds[k].x * by;
            works = works * t + self.squares[k] * by;
        }
        let (r, by) = (length(&slip), t * self.by_scale);
        let friction = -self.start.mu * by;
        Sums {
            p: impulse * by,
            p_t: path * friction,
            normal_work: works.y * by,
            friction_work: works.x * friction,
            heading: slip / r,
            r,
        }
    }

    /// The integral over `dτ/κ` of a series, with its slope.
    fn sum(&self, of: impl Fn(usize) -> f64, t: f64) -> (f64, f64) {
        with_slope(|k| if k == 0 { 0.0 } else { of(k - 1) * (self.by_scale * inverse(k)) }, t)
    }

    /// p and its slope.
    pub fn p(&self, t: f64) -> (f64, f64) {
        self.sum(|k| self.speeds[k].x, t)
    }

    /// W_n and its slope.
    #[inline]
    pub fn normal_work(&self, t: f64) -> (f64, f64) {
        self.sum(|k| self.squares[k].y, t)
    }

    /// Whether v_n decreases anywhere up to t.
    pub fn jams(&self, t: f64) -> bool {
        let passed = self.cuts[..self.intervals - 1].iter().filter(|&&cut| cut < t);
        self.speeds[1].y <= 0.0 || self.intervals > 1 && passed.chain([&t]).any(|&t| self.v_n(t).1 < 0.0)
    }

    /// `1/κ`.
    pub fn by_scale(&self) -> f64 {
        self.by_scale
    }

    /// `W_n''/2` at `v_n = 0`.
    pub fn bend(&self) -> f64 {
        self.squares[1].y * self.by_scale / 2.0
    }

    /// `δf` and `δg` for each parameter.
    fn forcing(u: Vector2<f64>) -> [(f64, f64); PARAMETERS] {
        let (c, s) = (u.x, u.y);
        [(-s, c), (c, s), (s * c, -c * c), (s * s - c * c, -2.0 * s * c), (-s * c, -s * s)]
    }

    /// v_t and v_n at the nodes of Gauss's rule on [0, t].
    fn at_nodes(&self, t: f64) -> ([[f64; COUNT]; 2], [f64; COUNT]) {
        // As many at a time as the registers hold.
        const PART: usize = 4;
        let mut all = [[0.0; COUNT]; 3];
        for from in (0..COUNT).step_by(PART) {
            let x: [f64; PART] = std::array::from_fn(|i| t * NODES[from + i]);
            let mut sums = [[0.0; PART]; 3];
            for k in (0..=ORDER).rev() {
                for (sum, c) in sums.iter_mut().zip([self.slip[k].x, self.slip[k].y, self.speeds[k].y]) {
                    for i in 0..PART {
                        sum[i] = sum[i] * x[i] + c;
                    }
                }
            }
            for (all, sum) in all.iter_mut().zip(sums) {
                all[from..from + PART].copy_from_slice(&sum);
            }
        }
        let [x, y, v_n] = all;
        ([x, y], v_n)
    }

    pub fn response(&self, t: f64) -> Response {
        let Start { tangents, coupling, normal, mu, .. } = self.start;
        let span = t * self.by_scale;
        let (slip, speed) = self.at_nodes(t);
        let (mut u, mut r, mut dp) = ([Vector2::zeros(); COUNT], [0.0; COUNT], [0.0; COUNT]);
        // f_φ and g_φ, times the length of the step.
        let (mut bends, mut grows) = ([0.0; COUNT], [0.0; COUNT]);
        for i in 0..COUNT {
            let slip = Vector2::new(slip[0][i], slip[1][i]);
            r[i] = length(&slip);
            (u[i], dp[i]) = (slip / r[i], r[i] * span);
            let n = across(u[i]);
            let rate = coupling - tangents * u[i] * mu;
            let hold = tangents * n * mu;
            bends[i] = -(u[i].dot(&rate) + n.dot(&hold)) * span;
            grows[i] = (n.dot(&rate) - u[i].dot(&hold)) * span;
        }
        let decay = running(&bends).map(f64::exp);
        let decay_end = whole(&bends).exp();
        let by_decay = decay.map(|decay| span / decay);
        let (so_far, p_end) = (running(&dp), whole(&dp));
        let mut out = Response::default();
        // What δℓ and δφ at a node add to δW_n: ∫ δv_n dp = ∫ (p_end - p) d(δv_n).
        let (mut longer_works, mut turned_works) = ([0.0; COUNT], [0.0; COUNT]);
        for i in 0..COUNT {
            let left = p_end - so_far[i];
            longer_works[i] = speed[i] + left * (normal - mu * coupling.dot(&u[i]));
            turned_works[i] = -left * mu * coupling.dot(&across(u[i]));
            dp[i] *= WEIGHTS[i];
            out.lever += left * dp[i];
            out.lever_t += u[i] * (left * dp[i]);
        }
        let forcing = u.map(Self::forcing);
        for j in 0..CHANGES {
            let start = if j == 0 { 1.0 } else { 0.0 };
            // A change of ln r alone changes neither direction nor rates.
            let (mut phi, mut log_r) = ([0.0; COUNT], [1.0; COUNT]);
            (out.phi[j], out.log_r[j]) = (0.0, 1.0);
            if j != 1 {
                let own = |i: usize| if j == 0 { (0.0, 0.0) } else { forcing[i][j - 2] };
                let pushes = std::array::from_fn(|i| own(i).0 * by_decay[i]);
                let shift = if j == 0 { [start; COUNT] } else { running(&pushes) };
                phi = std::array::from_fn(|i| decay[i] * shift[i]);
                let growth = std::array::from_fn(|i| grows[i] * phi[i] + own(i).1 * span);
                log_r = running(&growth);
                out.phi[j] = decay_end * (whole(&pushes) + start);
                out.log_r[j] = whole(&growth);
            }
            let (mut p, mut path, mut normal_work, mut friction_work) = (0.0, Vector2::zeros(), 0.0, 0.0);
            for i in 0..COUNT {
                let (longer, turned) = (log_r[i] * dp[i], phi[i] * dp[i]);
                p += longer;
                path += u[i] * longer + across(u[i]) * turned;
                normal_work += longer_works[i] * longer + turned_works[i] * turned;
                friction_work += r[i] * longer;
            }
            (out.p[j], out.p_t[0][j], out.p_t[1][j]) = (p, -mu * path.x, -mu * path.y);
            (out.normal_work[j], out.friction_work[j]) = (normal_work, -2.0 * mu * friction_work);
        }
        out
    }
}
