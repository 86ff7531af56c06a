//! Gauss's rule on [0, 1], and the integrals up to each node of the polynomial through values at the nodes.

use pulp::Simd;

use super::series::mul_add;

/// Number of nodes. The rule is exact for polynomials of degree 31.
pub(super) const COUNT: usize = 16;

/// Positive nodes on [-1, 1], with their weights.
const HALF: [(f64, f64); COUNT / 2] = [
    (0.095_012_509_837_637_44, 0.189_450_610_455_068_5),
    (0.281_603_550_779_258_9, 0.182_603_415_044_923_6),
    (0.458_016_777_657_227_4, 0.169_156_519_395_002_54),
    (0.617_876_244_402_643_7, 0.149_595_988_816_576_73),
    (0.755_404_408_355_003, 0.124_628_971_255_533_87),
    (0.865_631_202_387_831_7, 0.095_158_511_682_492_78),
    (0.944_575_023_073_232_6, 0.062_253_523_938_647_89),
    (0.989_400_934_991_649_9, 0.027_152_459_411_754_095),
];

/// Nodes on [-1, 1] in ascending order.
const SYMMETRIC: [f64; COUNT] = {
    let mut nodes = [0.0; COUNT];
    let mut i = 0;
    while i < COUNT / 2 {
        nodes[COUNT / 2 + i] = HALF[i].0;
        nodes[COUNT / 2 - 1 - i] = -HALF[i].0;
        i += 1;
    }
    nodes
};

pub(super) const NODES: [f64; COUNT] = {
    let mut nodes = [0.0; COUNT];
    let mut i = 0;
    while i < COUNT {
        nodes[i] = (1.0 + SYMMETRIC[i]) / 2.0;
        i += 1;
    }
    nodes
};

pub(super) const WEIGHTS: [f64; COUNT] = {
    let mut weights = [0.0; COUNT];
    let mut i = 0;
    while i < COUNT / 2 {
        weights[COUNT / 2 + i] = HALF[i].1 / 2.0;
        weights[COUNT / 2 - 1 - i] = HALF[i].1 / 2.0;
        i += 1;
    }
    weights
};

/// `RUNNING[j][i]`: the integral up to node i of the polynomial that is 1 at node j and 0 at the others.
const RUNNING: [[f64; COUNT]; COUNT] = {
    // That polynomial is w_j Σ (2 k + 1) P_k(x_j) P_k(x)/2 in Legendre's polynomials, for k < COUNT, and
    // ∫ (2 k + 1) P_k = P_(k+1) - P_(k-1).
    let mut running = [[0.0; COUNT]; COUNT];
    let mut j = 0;
    while j < COUNT {
        let at = legendre(SYMMETRIC[j]);
        let mut i = 0;
        while i < COUNT {
            let to = legendre(SYMMETRIC[i]);
            let mut sum = 1.0 + SYMMETRIC[i];
            let mut k = 1;
            while k < COUNT {
                sum += at[k] * (to[k + 1] - to[k - 1]);
                k += 1;
            }
            running[j][i] = WEIGHTS[j] * sum / 2.0;
            i += 1;
        }
        j += 1;
    }
    running
};

/// The integrals up to each node.
#[inline(always)]
pub(super) fn running<S: Simd>(simd: S, values: &[f64; COUNT]) -> [f64; COUNT] {
    let mut sums = [0.0; COUNT];
    for (row, value) in RUNNING.iter().zip(values) {
        for (sum, share) in sums.iter_mut().zip(row) {
            *sum = mul_add(simd, *share, *value, *sum);
        }
    }
    sums
}

/// The integral.
#[inline(always)]
pub(super) fn whole<S: Simd>(simd: S, values: &[f64; COUNT]) -> f64 {
    dot(simd, values, &WEIGHTS)
}

/// `Σ x_i y_i`.
#[inline(always)]
pub(super) fn dot<S: Simd>(simd: S, x: &[f64; COUNT], y: &[f64; COUNT]) -> f64 {
    let (x, y) = (S::as_simd_f64s(x).0, S::as_simd_f64s(y).0);
    let sum = x.iter().zip(y).fold(simd.splat_f64s(0.0), |sum, (x, y)| simd.mul_add_e_f64s(*x, *y, sum));
    simd.reduce_sum_f64s(sum)
}

/// P_0 to P_COUNT.
const fn legendre(x: f64) -> [f64; COUNT + 1] {
    let mut p = [1.0; COUNT + 1];
    p[1] = x;
    let mut k = 1;
    while k < COUNT {
        p[k + 1] = ((2 * k + 1) as f64 * x * p[k] - k as f64 * p[k - 1]) / (k + 1) as f64;
        k += 1;
    }
    p
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `∫_0^t x^k dx = t^(k+1)/(k+1)`: to degree 31 over the whole interval, to degree 15 up to the nodes.
    #[test]
    fn powers_are_integrated_exactly() {
        for k in 0..2 * COUNT as i32 {
            let exact = |t: f64| t.powi(k + 1) / f64::from(k + 1);
            let powers = NODES.map(|x| x.powi(k));
            assert!((whole(pulp::Scalar, &powers) - exact(1.0)).abs() < 1e-15, "{k} {}", whole(pulp::Scalar, &powers));
            if k < COUNT as i32 {
                let off = running(pulp::Scalar, &powers)
                    .iter()
                    .zip(NODES)
                    .map(|(sum, x)| (sum - exact(x)).abs())
                    .fold(0.0, f64::max);
                assert!(off < 1e-15, "{k} {off}");
            }
        }
    }
}
