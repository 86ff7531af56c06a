//! What varies: each axis of a map, and how a row's number is read as one place on each of them.

use super::file::Values;

/// Something that varies over a map, or is held at one value.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// Its name, which is that of its column.
    pub name: String,
    /// Unit of its values, for people: `rad`, `m/s`, empty for numbers without.
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
                        "count = {count}: a range has 2 values or more; write the number itself for one"
                    ));
                }
                if from == to {
                    return Err(format!(
                        "from = {from} and to = {to}: a range needs two ends; write the number itself"
                    ));
                }
                if degrees && unit != "rad" {
                    return Err("unit = \"deg\": only a hinge's range may be given in degrees".into());
                }
                let scale = |x: f64| if degrees { x.to_radians() } else { x };
                Points::Range { from: scale(from), to: scale(to), count }
            }
        };
        let numbers = match &points {
            Points::Range { from, to, .. } => vec![*from, *to, to - from],
            Points::List(list) if list.is_empty() => return Err("the list is empty: give a value".into()),
            Points::List(list) => list.clone(),
            Points::Words(_) => Vec::new(),
        };
        match numbers.iter().find(|x| !x.is_finite()) {
            Some(x) => Err(format!("{x}: every value must be finite")),
            None => Ok(Self { name, unit, points }),
        }
    }

    pub(super) fn words(name: &str, words: Vec<String>) -> Self {
        Self { name: name.into(), unit: "", points: Points::Words(words) }
    }

    /// How many values it takes.
    pub fn count(&self) -> u64 {
        match &self.points {
            Points::Range { count, .. } => *count,
            Points::List(list) => list.len() as u64,
            Points::Words(words) => words.len() as u64,
        }
    }

    /// Whether it takes more than one value.
    pub fn varies(&self) -> bool {
        self.count() > 1
    }

    /// Its value number `k`, SI units (degrees where its name ends in `_deg`); for an axis of words, `k`.
    pub fn value(&self, k: u64) -> f64 {
        match &self.points {
            Points::Range { from, .. } if k == 0 => *from,
            Points::Range { to, count, .. } if k + 1 == *count => *to,
            // a middle comes out exactly
            Points::Range { from, to, count } => {
                let last = (count - 1) as f64;
                (from * (last - k as f64) + to * k as f64) / last
            }
            Points::List(list) => list[k as usize],
            Points::Words(_) => k as f64,
        }
    }

    /// The words of an axis of words.
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

/// The product of the counts, if it can be counted.
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

/// Moves the places on to the next row; the first axis that moved. `varying` are the axes that do, in their order.
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
    fn a_range_has_both_its_ends_and_its_middle_exactly() {
        let axis = range(-0.3, 0.3, 7);
        assert_eq!((axis.value(0), axis.value(6), axis.value(3)), (-0.3, 0.3, 0.0));
        assert!((1..7).all(|k| axis.value(k) > axis.value(k - 1)));
    }

    /// Every combination of places comes once, in the order of the rows.
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
    fn a_product_beyond_counting_is_none() {
        let axes = [range(0.0, 1.0, u64::MAX), range(0.0, 1.0, 2)];
        assert_eq!(total(&axes), None);
    }
}
