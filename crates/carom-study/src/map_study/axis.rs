//! The axes of a map, and the conversion between a row number and its places on the axes.

use super::file::Values;

/// An axis of a map: a name and its values, numbers or words.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// The name, which is also that of its column.
    pub name: String,
    /// Unit of the values, for labels: `rad`, `m`, `m/s`, `°`; empty for dimensionless numbers and words.
    pub unit: &'static str,
    points: Points,
}

#[derive(Debug, Clone, PartialEq)]
enum Points {
    Range { from: f64, to: f64, count: u64 },
    List(Vec<f64>),
    Words(Vec<String>),
}

impl Axis {
    /// # Errors
    /// The rule that the values break.
    pub(super) fn new(name: String, unit: &'static str, values: &Values) -> Result<Self, String> {
        let points = match values {
            Values::One(x) => Points::List(vec![*x]),
            Values::List(list) => Points::List(list.clone()),
            &Values::Range { from, to, count, degrees } => {
                if count < 2 {
                    return Err(format!(
                        "count = {count}: a range has at least 2 values; for one value write the number itself"
                    ));
                }
                if from == to {
                    return Err(format!(
                        "from = {from} and to = {to}: the ends of a range must differ; for one value write the number itself"
                    ));
                }
                if degrees && unit != "rad" {
                    return Err("unit = \"deg\": only the range of a revolute joint may be given in degrees".into());
                }
                let scale = |x: f64| if degrees { x.to_radians() } else { x };
                Points::Range { from: scale(from), to: scale(to), count }
            }
        };
        let numbers = match &points {
            Points::Range { from, to, .. } => vec![*from, *to, to - from],
            Points::List(list) if list.is_empty() => return Err("the list is empty: give at least one value".into()),
            Points::List(list) => list.clone(),
            Points::Words(_) => Vec::new(),
        };
        match numbers.iter().find(|x| !x.is_finite()) {
            Some(x) => Err(format!("{x}: every value must be finite")),
            None => Ok(Self { name, unit, points }),
        }
    }

    /// An axis of `count` numbers, evenly spaced.
    ///
    /// # Errors
    /// The rule that the numbers break.
    pub(crate) fn range(name: String, unit: &'static str, [from, to]: [f64; 2], count: u64) -> Result<Self, String> {
        Self::new(name, unit, &Values::Range { from, to, count, degrees: false })
    }

    pub(super) fn words(name: &str, words: Vec<String>) -> Self {
        Self { name: name.into(), unit: "", points: Points::Words(words) }
    }

    /// Number of values.
    pub fn count(&self) -> u64 {
        match &self.points {
            Points::Range { count, .. } => *count,
            Points::List(list) => list.len() as u64,
            Points::Words(words) => words.len() as u64,
        }
    }

    /// Whether the axis has more than one value.
    pub fn varies(&self) -> bool {
        self.count() > 1
    }

    /// Value number `k`, counted from 0, in SI units (degrees if the name ends in `_deg`); for an axis of words, `k`.
    ///
    /// # Panics
    /// If the values are a list and `k` is not below [`Axis::count`].
    pub fn value(&self, k: u64) -> f64 {
        match &self.points {
            Points::Range { from, .. } if k == 0 => *from,
            Points::Range { to, count, .. } if k + 1 == *count => *to,
            // symmetric in both ends: exact at the middle
            Points::Range { from, to, count } => {
                let last = (count - 1) as f64;
                (from * (last - k as f64) + to * k as f64) / last
            }
            Points::List(list) => list[k as usize],
            Points::Words(_) => k as f64,
        }
    }

    /// The words of an axis of words; empty for an axis of numbers.
    pub fn names(&self) -> &[String] {
        match &self.points {
            Points::Words(words) => words,
            _ => &[],
        }
    }

    /// The first value outside `low..=high`.
    pub(super) fn outside(&self, low: f64, high: f64) -> Option<f64> {
        let ends: &[f64] = match &self.points {
            Points::Range { from, to, .. } => &[*from, *to],
            Points::List(list) => list,
            Points::Words(_) => &[],
        };
        ends.iter().copied().find(|x| !(low..=high).contains(x))
    }
}

/// The product of the counts; `None` if it overflows.
pub(super) fn total(axes: &[Axis]) -> Option<u64> {
    axes.iter().try_fold(1_u64, |n, axis| n.checked_mul(axis.count()))
}

/// The place of row `index` on each axis; the last axis varies fastest.
pub(super) fn places(axes: &[Axis], mut index: u64, places: &mut [u64]) {
    for (axis, place) in axes.iter().zip(places).rev() {
        let count = axis.count();
        *place = index % count;
        index /= count;
    }
}

/// Advances the places to the next row and returns the first axis that changed. `varying` are the axes with more than one
/// value, in their order.
pub(super) fn advance(axes: &[Axis], varying: &[usize], places: &mut [u64]) -> usize {
    for &k in varying.iter().rev() {
        places[k] += 1;
        if places[k] < axes[k].count() {
            return k;
        }
        places[k] = 0;
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn range(from: f64, to: f64, count: u64) -> Axis {
        Axis::new("x".into(), "", &Values::Range { from, to, count, degrees: false }).unwrap()
    }

    #[test]
    fn a_range_has_exact_ends_and_an_exact_middle() {
        let axis = range(-0.3, 0.3, 7);
        assert_eq!((axis.value(0), axis.value(6), axis.value(3)), (-0.3, 0.3, 0.0));
        assert!((1..7).all(|k| axis.value(k) > axis.value(k - 1)));
    }

    /// Each combination of places occurs once, in the order of the rows.
    #[test]
    fn row_numbers_and_places_are_one_to_one() {
        let one = Axis::new("one".into(), "", &Values::One(0.5)).unwrap();
        let axes = [range(0.0, 1.0, 3), range(0.0, 1.0, 2), one, range(0.0, 1.0, 4)];
        assert_eq!(total(&axes), Some(24));
        let mut last: Option<[u64; 4]> = None;
        for index in 0..24 {
            let mut at = [0; 4];
            places(&axes, index, &mut at);
            assert_eq!((at[0] * 2 + at[1]) * 4 + at[3], index);
            assert!(last.is_none_or(|last| last < at));
            if let Some(mut before) = last {
                let moved = advance(&axes, &[0, 1, 3], &mut before);
                assert_eq!(before, at);
                assert!(last.is_some_and(|last| last[..moved] == at[..moved] && last[moved] + 1 == at[moved]));
            }
            last = Some(at);
        }
    }

    #[test]
    fn a_row_count_that_overflows_is_none() {
        let axes = [range(0.0, 1.0, u64::MAX), range(0.0, 1.0, 2)];
        assert_eq!(total(&axes), None);
    }
}
