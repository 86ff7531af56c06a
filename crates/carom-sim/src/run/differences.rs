//! Difference quotients of a vector field.

/// ∂f/∂y at y by forward differences with these steps, passed to `set` with row and column; zero where a step is zero.
pub(crate) fn differences(
    f: impl Fn(&[f64], &mut [f64]),
    y: &[f64],
    steps: &[f64],
    mut set: impl FnMut((usize, usize), f64),
) {
    let (mut moved, mut here, mut there) = (y.to_vec(), vec![0.0; y.len()], vec![0.0; y.len()]);
    f(y, &mut here);
    for (column, step) in steps.iter().enumerate() {
        moved[column] += step;
        // The step as the numbers have it.
        let whole = moved[column] - y[column];
        if whole > 0.0 {
            f(&moved, &mut there);
        }
        moved[column] = y[column];
        for (row, (there, here)) in there.iter().zip(&here).enumerate() {
            set((row, column), if whole > 0.0 { (there - here) / whole } else { 0.0 });
        }
    }
}
