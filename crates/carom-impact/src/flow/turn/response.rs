//! Derivatives of a step: integrals along it. With `f = k_φ`, `g = dr/dp`, `ℓ = ln r`, at the same τ, a change of
//! φ and r at the start and of the parameters of the flow, h and `μ A`, changes
//!
//! ```text
//! κ (δφ)' = f_φ δφ + δf,   κ (δℓ)' = g_φ δφ + δg,   δf = u⊥·(δh - δ(μ A) u),   δg = u·(δh - δ(μ A) u)
//! δφ = E (δφ(0) + ∫ δf/(κ E) dτ),   ln E = ∫ f_φ/κ dτ
//! δp = ∫ δℓ dp,   δp_t = -∫ (μ u δℓ + μ u⊥ δφ + δμ u) dp,   δW_n = ∫ (δv_n + v_n δℓ) dp,   δW_t = -∫ r (2 μ δℓ + δμ) dp
//! ```

use nalgebra::Vector2;
use pulp::{Arch, Simd, WithSimd};

use super::super::gauss::{COUNT, NODES, WEIGHTS, dot, running, whole};
use super::super::series::{TERMS, mul_add};
use super::Turn;

/// Parameters of the flow: h, and `μ A` as (1, 1), (1, 2), (2, 2).
const PARAMETERS: usize = 5;

/// Changes of which [`Response`] has the derivatives: of φ and ln r at the start, and of the parameters.
pub(in super::super) const CHANGES: usize = 2 + PARAMETERS;

/// Derivatives of [`Sums`](super::Sums) at the same τ, one per change, without what changes of μ, C, h and v_n(0) add at the same
/// slip.
#[derive(Default)]
pub(in super::super) struct Response {
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

impl Turn {
    /// `δf` and `δg` for each parameter, at a slip in direction (c, s).
    #[inline(always)]
    fn forcing(c: f64, s: f64) -> [(f64, f64); PARAMETERS] {
        [(-s, c), (c, s), (s * c, -c * c), (s * s - c * c, -2.0 * s * c), (-s * c, -s * s)]
    }

    /// v_t/r(0) and v_n at the nodes of Gauss's rule on [0, t].
    #[inline(always)]
    fn at_nodes<S: Simd>(&self, simd: S, t: f64) -> [[f64; COUNT]; 3] {
        let x = NODES.map(|node| t * node);
        let mut all = [[0.0; COUNT]; 3];
        for k in (0..TERMS).rev() {
            for (sum, c) in all.iter_mut().zip([self.slip[0][k], self.slip[1][k], self.v_n[k]]) {
                for i in 0..COUNT {
                    sum[i] = mul_add(simd, sum[i], x[i], c);
                }
            }
        }
        all
    }

    pub fn response(&self, t: f64) -> Response {
        Arch::new().dispatch(Respond(self, t))
    }

    #[inline(always)]
    fn respond<S: Simd>(&self, simd: S, t: f64) -> Response {
        let Self { tangents, coupling, normal, mu, .. } = *self;
        let span = t * self.by_scale;
        let [x, y, speed] = self.at_nodes(simd, t);
        let [mut c, mut s, mut r, mut dp] = [[0.0; COUNT]; 4];
        // f_φ and g_φ, times the length of the step; dv_n/dp, and its derivative with respect to φ.
        let [mut bends, mut grows, mut rises, mut turns] = [[0.0; COUNT]; 4];
        let [mut pushes, mut draws] = [[[0.0; COUNT]; PARAMETERS]; 2];
        for i in 0..COUNT {
            let length = (x[i] * x[i] + y[i] * y[i]).sqrt();
            (c[i], s[i], r[i]) = (x[i] / length, y[i] / length, length * self.r);
            dp[i] = r[i] * span;
            let (u, n) = (Vector2::new(c[i], s[i]), Vector2::new(-s[i], c[i]));
            let rate = coupling - tangents * u * mu;
            let hold = tangents * n * mu;
            bends[i] = -(u.dot(&rate) + n.dot(&hold)) * span;
            grows[i] = (n.dot(&rate) - u.dot(&hold)) * span;
            (rises[i], turns[i]) = (normal - mu * coupling.dot(&u), -mu * coupling.dot(&n));
            for (j, (push, draw)) in Self::forcing(c[i], s[i]).into_iter().enumerate() {
                (pushes[j][i], draws[j][i]) = (push, draw * span);
            }
        }
        let decay = running(simd, &bends).map(f64::exp);
        let decay_end = whole(simd, &bends).exp();
        let by_decay = decay.map(|decay| span / decay);
        let (so_far, p_end) = (running(simd, &dp), whole(simd, &dp));
        // What δℓ and δφ at a node add to δW_n: ∫ δv_n dp = ∫ (p_end - p) d(δv_n).
        let [mut left, mut longer_works, mut turned_works] = [[0.0; COUNT]; 3];
        for i in 0..COUNT {
            let rest = p_end - so_far[i];
            (longer_works[i], turned_works[i]) = (speed[i] + rest * rises[i], rest * turns[i]);
            dp[i] *= WEIGHTS[i];
            left[i] = rest * dp[i];
        }
        let lever = left.iter().sum();
        let lever_t = Vector2::new(dot(simd, &left, &c), dot(simd, &left, &s));
        let mut out = Response { lever, lever_t, ..Response::default() };
        for j in 0..CHANGES {
            // A change of ln r alone changes neither direction nor rates.
            let (mut phi, mut log_r) = ([0.0; COUNT], [1.0; COUNT]);
            (out.phi[j], out.log_r[j]) = (0.0, 1.0);
            if j == 0 {
                phi = decay;
                let growth = std::array::from_fn(|i| grows[i] * phi[i]);
                log_r = running(simd, &growth);
                (out.phi[j], out.log_r[j]) = (decay_end, whole(simd, &growth));
            } else if j > 1 {
                let (push, draw) = (&pushes[j - 2], &draws[j - 2]);
                let push = std::array::from_fn(|i| push[i] * by_decay[i]);
                let shift = running(simd, &push);
                phi = std::array::from_fn(|i| decay[i] * shift[i]);
                let growth = std::array::from_fn(|i| grows[i] * phi[i] + draw[i]);
                log_r = running(simd, &growth);
                (out.phi[j], out.log_r[j]) = (decay_end * whole(simd, &push), whole(simd, &growth));
            }
            let longer = std::array::from_fn(|i| log_r[i] * dp[i]);
            let turned = std::array::from_fn(|i| phi[i] * dp[i]);
            out.p[j] = dot(simd, &log_r, &dp);
            out.p_t[0][j] = -mu * (dot(simd, &longer, &c) - dot(simd, &turned, &s));
            out.p_t[1][j] = -mu * (dot(simd, &longer, &s) + dot(simd, &turned, &c));
            out.normal_work[j] = dot(simd, &longer, &longer_works) + dot(simd, &turned, &turned_works);
            out.friction_work[j] = -2.0 * mu * dot(simd, &longer, &r);
        }
        out
    }
}

/// The derivatives of a step, computed with the vector instructions of the processor.
struct Respond<'a>(&'a Turn, f64);

impl WithSimd for Respond<'_> {
    type Output = Response;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Response {
        self.0.respond(simd, self.1)
    }
}
