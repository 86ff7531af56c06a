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

use super::super::gauss::{COUNT, NODES, WEIGHTS, running, whole};
use super::super::series::TERMS;
use super::Turn;
use crate::contact::length;

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

#[inline(always)]
fn across(u: Vector2<f64>) -> Vector2<f64> {
    Vector2::new(-u.y, u.x)
}

impl Turn {
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
        ([x, y].map(|of| of.map(|slip| slip * self.r)), v_n)
    }

    pub fn response(&self, t: f64) -> Response {
        Arch::new().dispatch(Respond(self, t))
    }

    #[inline(always)]
    fn respond(&self, t: f64) -> Response {
        let Self { tangents, coupling, normal, mu, .. } = *self;
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

/// The derivatives of a step, computed with the vector instructions of the processor.
struct Respond<'a>(&'a Turn, f64);

impl WithSimd for Respond<'_> {
    type Output = Response;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Response {
        self.0.respond(self.1)
    }
}
