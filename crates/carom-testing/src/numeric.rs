//! Methods of integration, for the formulas of tests.

/// The state a step `h` later, by the classical method of Runge and Kutta.
pub fn rk4<const N: usize>(rate: impl Fn([f64; N]) -> [f64; N], y: [f64; N], h: f64) -> [f64; N] {
    let plus = |k: [f64; N], h: f64| std::array::from_fn(|i| y[i] + h * k[i]);
    let k1 = rate(y);
    let k2 = rate(plus(k1, h / 2.0));
    let k3 = rate(plus(k2, h / 2.0));
    let k4 = rate(plus(k3, h));
    std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]))
}

/// The integral over an interval, by Simpson's rule with 2000 pieces.
pub fn simpson(of: impl Fn(f64) -> f64, [from, to]: [f64; 2]) -> f64 {
    let n = 2000;
    let h = (to - from) / f64::from(n);
    let inner: f64 = (1..n).map(|k| of(from + f64::from(k) * h) * if k % 2 == 1 { 4.0 } else { 2.0 }).sum();
    (of(from) + inner + of(to)) * h / 3.0
}
