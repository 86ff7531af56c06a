//! The values of a picture, and their places and colours on its scale.

use super::super::Axis;
use super::colours::{DIVERGING, NOTHING, SEQUENTIAL, mix, word_colour};

/// Width of the legend, pixels.
pub(super) const LEGEND: u32 = 150;

/// One column of a whole map, arranged by the axes that vary.
pub struct Values {
    /// The axes that vary: horizontal, vertical, and the axis over which heat maps stand side by side.
    pub axes: Vec<Axis>,
    /// Row number at each place; the horizontal axis varies fastest, then the vertical one.
    pub rows: Vec<u64>,
    /// Value at each place; NaN where the row has none. In a column of words, the index of the word.
    pub values: Vec<f64>,
    /// The conditions that do not vary, in one line: law, coefficients, speed, angle.
    pub title: String,
    /// Name of the column, with its unit.
    pub label: String,
    /// The words of a column of words; empty for a column of numbers.
    pub words: Vec<String>,
    /// Whether colours and the vertical axis of curves are logarithmic.
    pub logarithmic: bool,
}

impl Values {
    /// Whether the picture consists of curves: one axis of numbers, and possibly one of words.
    #[doc(hidden)]
    pub fn is_curve(&self) -> bool {
        self.axes.len() == 1 || (self.axes.len() == 2 && !self.axes[1].names().is_empty())
    }

    /// The range of the finite values. Equal values get an interval around them; without finite values the range is (0, 1).
    #[doc(hidden)]
    pub fn range(&self) -> (f64, f64) {
        let finite = self.values.iter().filter(|x| x.is_finite());
        let (low, high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        match (low, high) {
            (l, h) if l < h => (l, h),
            (l, h) if l == h => (l - 0.5 * l.abs().max(1e-12), h + 0.5 * h.abs().max(1e-12)),
            _ => (0.0, 1.0),
        }
    }

    /// Range of the colour bar: the 1st to the 99th percentile of the finite values, so that large values near a singular
    /// pose do not compress the rest of the scale. [`Values::range`] if the two percentiles are equal.
    #[doc(hidden)]
    pub fn colour_range(&self) -> (f64, f64) {
        let mut finite: Vec<f64> = self.values.iter().copied().filter(|x| x.is_finite()).collect();
        finite.sort_by(f64::total_cmp);
        let at = |share: f64| finite.get((share * finite.len() as f64) as usize).copied();
        match (at(0.01), at(0.99)) {
            (Some(low), Some(high)) if low < high => (low, high),
            _ => self.range(),
        }
    }

    /// Place of a value on a scale over `(low, high)`, 0 to 1 between its ends.
    pub(super) fn place(&self, value: f64, (low, high): (f64, f64)) -> f64 {
        let of = |x: f64| if self.logarithmic { x.ln() } else { x };
        (of(value) - of(low)) / (of(high) - of(low))
    }

    /// Colour (RGB) of a value for a colour bar over `(low, high)`. Values beyond the bar have the colour of its end, NaN is
    /// grey, words have one colour each.
    #[doc(hidden)]
    pub fn colour(&self, value: f64, (low, high): (f64, f64)) -> [u8; 3] {
        if !self.words.is_empty() {
            return word_colour(&self.words, value);
        }
        if value.is_nan() {
            return NOTHING;
        }
        let value = value.clamp(low, high);
        if low < 0.0 && high > 0.0 {
            // signed values: white at zero
            let size = low.abs().max(high);
            return mix(&DIVERGING, (value / size + 1.0) / 2.0);
        }
        mix(&SEQUENTIAL, self.place(value, (low, high)))
    }
}
