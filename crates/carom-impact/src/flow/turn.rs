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
use pulp::{Arch, Simd, WithSimd};

use super::gauss::{COUNT, NODES, WEIGHTS, running, whole};
use super::series::{Series, TERMS, inverse, root, value, with_slope};
use crate::contact::length;

/// Truncation allowed in a step.
const FINE: f64 = f64::EPSILON / 16.0;

/// Products that are added side by side.
const BLOCK: usize = 4;

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

/// One step of Taylor's method. The memory is made once for an impact.
pub(super) struct Turn {
    start: Start,
    /// `1/κ`.
    by_scale: f64,
    /// v_t/r(0).
    slip: [Series; 2],
    /// r/r(0).
    speed: Series,
    v_n: Series,
    /// `r v_n/r(0)`.
    power: Series,
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

#[inline(always)]
fn across(u: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-u.y, u.x)
}

impl Turn {
    /// Memory for steps.
    pub fn new() -> Self {
        let (none, zero) = (Vector2::zeros(), [0.0; TERMS]);
        let start = Start {
            tangents: Matrix2::zeros(),
            coupling: none,
            normal: 0.0,
            mu: 0.0,
            scale: 1.0,
            heading: none,
            r: 0.0,
            v_n: 0.0,
        };
        Self {
            start,
            by_scale: 1.0,
            slip: [zero; 2],
            speed: zero,
            v_n: zero,
            power: zero,
            cuts: [0.0; 4],
            intervals: 1,
        }
    }

    /// Computes the step from this start.
    pub fn begin(&mut self, start: Start) {
        (self.start, self.by_scale) = (start, 1.0 / start.scale);
        Arch::new().dispatch(Expand(self));
        (self.cuts[0], self.intervals) = (self.length(), 1);
        if start.mu * length(&start.coupling) > start.normal {
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
    fn expand(&mut self) {
        let Start { tangents, coupling, normal, mu, heading: u, r: r_0, v_n: v_0, .. } = self.start;
        let (drive, hold) = (coupling * self.by_scale, tangents * (mu * self.by_scale));
        // v_0·v_k = (along r_{k-1} - across·v_{k-1})/k.
        let (along, across) = (u.dot(&drive), hold * u);
        let (a, b, d) = (hold[(0, 0)], hold[(0, 1)], hold[(1, 1)]);
        let next = |k: usize, [x, y, r]: [f64; 3], [x_1, y_1, r_1]: [f64; 3], sum: f64| {
            let by = inverse(k);
            let rest = (x_1 - across.x * by) * x + (y_1 - across.y * by) * y;
            let v = [(drive.x * r - (a * x + b * y)) * by, (drive.y * r - (b * x + d * y)) * by];
            [v[0], v[1], (along * by - r_1) * r + (rest + sum)]
        };
        // (x, y, r) of the first coefficients.
        let zero = [u.x, u.y, 1.0];
        let one = next(1, zero, [0.0; 3], 0.0);
        let two = next(2, one, one.map(|x| 0.5 * x), 0.0);
        let three = next(3, two, one, 0.0);
        let four = next(4, three, one, 0.5 * product(two, two));
        let five = next(5, four, one, product(two, three));
        let six = next(6, five, one, product(two, four) + 0.5 * product(three, three));
        let seven = next(7, six, one, product(two, five) + product(three, four));
        self.put(0, [zero, one, two, three]);
        let mut last = [four, five, six, seven];
        self.put(BLOCK, last);
        for from in (2 * BLOCK..TERMS).step_by(BLOCK) {
            let mut sums = [0.0; BLOCK];
            for i in BLOCK..from / 2 {
                let [x, y, r] = self.get(i);
                let [x_j, y_j, r_j] = [&self.slip[0], &self.slip[1], &self.speed].map(|of| block(of, from - i));
                for l in 0..BLOCK {
                    sums[l] += x * x_j[l] + (y * y_j[l] - r * r_j[l]);
                }
            }
            let [m, n, o, p] = [0, 1, 2, 3].map(|i| self.get(from / 2 + i));
            sums[0] += 0.5 * product(m, m) + (product(two, last[2]) + product(three, last[1]));
            sums[1] += product(m, n) + (product(two, last[3]) + product(three, last[2]));
            sums[2] += (product(m, o) + 0.5 * product(n, n)) + product(three, last[3]);
            sums[3] += product(m, p) + product(n, o);
            let first = next(from, last[3], one, sums[0]);
            let second = next(from + 1, first, one, sums[1]);
            let third = next(from + 2, second, one, sums[2] + product(two, first));
            let rest = product(two, second) + product(three, first);
            last = [first, second, third, next(from + 3, third, one, sums[3] + rest)];
            self.put(from, last);
        }
        let Self { slip: [x, y], speed: r, power, .. } = self;
        let (rise, fall) = (normal * self.by_scale * r_0, drive * (mu * r_0));
        // Zeros before the coefficients of v_n, for the products below.
        let mut v_n = [0.0; BLOCK + TERMS];
        v_n[BLOCK] = v_0;
        for k in 1..TERMS {
            v_n[BLOCK + k] = (rise * r[k - 1] - (fall.x * x[k - 1] + fall.y * y[k - 1])) * inverse(k);
        }
        for from in (0..TERMS).step_by(BLOCK) {
            let mut sum = [0.0; BLOCK];
            for (i, r_i) in r.iter().enumerate().take(from + BLOCK) {
                let speeds = block(&v_n, BLOCK + from - i);
                for l in 0..BLOCK {
                    sum[l] += r_i * speeds[l];
                }
            }
            power[from..from + BLOCK].copy_from_slice(&sum);
        }
        self.v_n.copy_from_slice(&v_n[BLOCK..]);
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
        let Start { coupling, normal, mu, r, v_n, .. } = self.start;
        let by_speed = 1.0 / (v_n.abs() + (normal + mu * coupling.amax()) * self.by_scale * r);
        let reach = |k: usize| {
            let turn = self.slip[0][k].abs().max(self.slip[1][k].abs());
            let work = (self.power[k] * inverse(k) * by_speed).abs();
            // Half the coefficient of r².
            let half: f64 = (0..k.div_ceil(2)).map(|i| self.speed[i] * self.speed[k - i]).sum();
            let size = turn.max(self.speed[k].abs()).max(work).max((2.0 * half * inverse(k)).abs()).max(LEAST);
            (FINE / size).log2() * inverse(k)
        };
        reach(TERMS - 1).min(reach(TERMS - 2)).exp2().min(1e3)
    }

    /// v_n and its slope.
    #[inline]
    pub fn v_n(&self, t: f64) -> (f64, f64) {
        with_slope(|k| self.v_n[k], t)
    }

    /// `κ dv_n/dτ = C r - μ h·v_t` changes sign at most once on either side of the direction of h, where it is least.
    fn cut(&mut self) {
        let end = self.cuts[0];
        let (h, c) = (self.start.coupling, self.start.normal);
        let Self { slip: [x, y], speed, .. } = &*self;
        let beside = |t: f64| with_slope(|k| x[k] * h.y - y[k] * h.x, t);
        let rate = |t: f64| with_slope(|k| c * speed[k] - self.start.mu * (x[k] * h.x + y[k] * h.y), t);
        // A zero between the ends, of either sign change.
        let crossing = |f: &dyn Fn(f64) -> (f64, f64), from: f64, to: f64| {
            let (first, last) = (f(from).0, f(to).0);
            let sign = if last >= 0.0 { 1.0 } else { -1.0 };
            (first * sign < 0.0).then(|| {
                root(from, to, to, |t| {
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

    /// Impulses and works up to τ. The work of friction is the whole work `½ P·(u(0) + u)` without W_n.
    pub fn sums(&self, t: f64) -> Sums {
        let Self { start, slip: [x, y], speed, power, .. } = self;
        let slip = Vector2::new(value(|k| x[k], t), value(|k| y[k], t));
        let over = |of: &Series| value(|k| of[k] * inverse(k + 1), t) * (t * self.by_scale * start.r);
        let path = Vector2::new(over(x), over(y));
        let (p, normal_work) = (over(speed), over(power));
        let p_t = path * -start.mu;
        let rise = start.normal * p + start.coupling.dot(&p_t);
        let work = p * (start.v_n + 0.5 * rise) + 0.5 * start.r * p_t.dot(&(start.heading + slip));
        let r = length(&slip);
        Sums { p, p_t, normal_work, friction_work: (work - normal_work).min(0.0), heading: slip / r, r: r * start.r }
    }

    /// The integral over `dτ/κ` of a series times r(0), with its slope.
    #[inline(always)]
    fn sum(&self, of: &Series, t: f64) -> (f64, f64) {
        let by = self.by_scale * self.start.r;
        let (mean, slope) = with_slope(|k| of[k] * inverse(k + 1), t);
        (mean * t * by, (mean + t * slope) * by)
    }

    /// Whether slip at τ is faster than at the start.
    pub fn grows(&self, t: f64) -> bool {
        value(|k| self.speed[k], t) > 1.0
    }

    /// p and its slope.
    pub fn p(&self, t: f64) -> (f64, f64) {
        self.sum(&self.speed, t)
    }

    /// W_n and its slope.
    pub fn normal_work(&self, t: f64) -> (f64, f64) {
        self.sum(&self.power, t)
    }

    /// Whether v_n decreases anywhere up to t.
    pub fn jams(&self, t: f64) -> bool {
        let passed = self.cuts[..self.intervals - 1].iter().filter(|&&cut| cut < t);
        self.v_n[1] <= 0.0 || self.intervals > 1 && passed.chain([&t]).any(|&t| self.v_n(t).1 < 0.0)
    }

    /// `1/κ`.
    pub fn by_scale(&self) -> f64 {
        self.by_scale
    }

    /// `W_n''/2` at `v_n = 0`.
    pub fn bend(&self) -> f64 {
        self.power[1] * self.start.r * self.by_scale / 2.0
    }

    /// `δf` and `δg` for each parameter.
    #[inline(always)]
    fn forcing(u: Vector2<f64>) -> [(f64, f64); PARAMETERS] {
        let (c, s) = (u.x, u.y);
        [(-s, c), (c, s), (s * c, -c * c), (s * s - c * c, -2.0 * s * c), (-s * c, -s * s)]
    }

    /// v_t and v_n at the nodes of Gauss's rule on [0, t].
    #[inline(always)]
    fn at_nodes(&self, t: f64) -> ([[f64; COUNT]; 2], [f64; COUNT]) {
        let x = NODES.map(|node| t * node);
        let mut all = [[0.0; COUNT]; 3];
        for k in (0..TERMS).rev() {
            for (sum, c) in all.iter_mut().zip([self.slip[0][k], self.slip[1][k], self.v_n[k]]) {
                for i in 0..COUNT {
                    sum[i] = sum[i] * x[i] + c;
                }
            }
        }
        let [x, y, v_n] = all;
        ([x, y].map(|of| of.map(|slip| slip * self.start.r)), v_n)
    }

    pub fn response(&self, t: f64) -> Response {
        Arch::new().dispatch(Respond(self, t))
    }

    #[inline(always)]
    fn respond(&self, t: f64) -> Response {
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

/// The coefficients, computed with the vector instructions of the processor.
struct Expand<'a>(&'a mut Turn);

impl WithSimd for Expand<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        self.0.expand();
    }
}

/// The derivatives of a step, computed with the vector instructions of the processor.
struct Respond<'a>(&'a Turn, f64);

impl WithSimd for Respond<'_> {
    type Output = Response;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Response {
        self.0.respond(self.1)
    }
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
fn product([x, y, r]: [f64; 3], [v, w, s]: [f64; 3]) -> f64 {
    x * v + (y * w - r * s)
}
