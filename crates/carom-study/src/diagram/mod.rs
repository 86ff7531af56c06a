//! Diagrams of one impact that compare impact laws, as data with exact coordinates.

mod hodograph;
mod impulse_space;
mod routh;
mod svg;

pub use hodograph::hodograph;
pub use impulse_space::impulse_space;
pub use routh::routh_diagram;

use carom_impact::LAW_NAMES;

/// The impulse of a law, as a point of a diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct LawPoint<const D: usize> {
    /// Name of the law.
    pub law: String,
    /// Impulse on the robot, N s, in contact axes: tangents first, normal last.
    pub impulse: [f64; D],
}

impl<const D: usize> LawPoint<D> {
    /// The result of the law at a place of a diagram.
    fn mark<const E: usize>(&self, at: [f64; E]) -> Mark<E> {
        Mark { name: self.law.clone(), colour: law_colour(&self.law), symbol: Symbol::Law, at }
    }
}

/// A diagram in D dimensions, as data.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagram<const D: usize> {
    /// Title.
    pub title: String,
    /// Label of each axis, with its unit.
    pub axes: [String; D],
    /// Lower and upper end of each axis.
    pub window: [[f64; 2]; D],
    /// Whether all axes have the same scale.
    pub equal_scales: bool,
    /// Areas and lines, in drawing order.
    #[doc(hidden)]
    pub shapes: Vec<Shape<D>>,
    /// Points, drawn after the shapes.
    #[doc(hidden)]
    pub marks: Vec<Mark<D>>,
}

/// An area or a line, in one or several pieces.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape<const D: usize> {
    /// Name, for the legend.
    pub name: String,
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// Style.
    pub stroke: Stroke,
    /// Vertices of each piece; pieces outside the window are left out.
    pub pieces: Vec<Vec<[f64; D]>>,
}

impl<const D: usize> Shape<D> {
    pub(crate) fn new(name: impl Into<String>, colour: [u8; 3], stroke: Stroke, pieces: Vec<Vec<[f64; D]>>) -> Self {
        Self { name: name.into(), colour, stroke, pieces }
    }
}

/// Style of a shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// Filled: each piece is a polygon.
    Area,
    /// A thin line.
    Thin,
    /// A thick line.
    Thick,
}

/// A named point.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark<const D: usize> {
    /// Name of a law, or of the event at this point.
    pub name: String,
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// Meaning.
    pub symbol: Symbol,
    /// Coordinates.
    pub at: [f64; D],
}

/// Meaning of a mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symbol {
    /// Result of a law.
    Law,
    /// Start of the path.
    Start,
    /// End of compression.
    Turn,
    /// End of slip.
    Stop,
}

const BLACK: [u8; 3] = [0, 0, 0];
const DARK: [u8; 3] = [70, 70, 70];
pub(crate) const GREY: [u8; 3] = [120, 120, 120];
const PALE: [u8; 3] = [210, 210, 210];
pub(crate) const BLUE: [u8; 3] = [31, 120, 180];
pub(crate) const RED: [u8; 3] = [227, 26, 28];
const GREEN: [u8; 3] = [178, 223, 138];

/// Colour of a law, independent of the other laws of a diagram.
fn law_colour(law: &str) -> [u8; 3] {
    const COLOURS: [[u8; 3]; 8] = [
        [90, 90, 90],
        [227, 26, 28],
        [255, 127, 0],
        [31, 120, 180],
        [51, 160, 44],
        [106, 61, 154],
        [177, 89, 40],
        [0, 150, 160],
    ];
    LAW_NAMES.iter().position(|name| *name == law).and_then(|k| COLOURS.get(k).copied()).unwrap_or(BLACK)
}

/// Least and greatest of the numbers and 0.
fn spread(numbers: impl Iterator<Item = f64>) -> [f64; 2] {
    numbers.fold([0.0, 0.0], |[low, high], x| [x.min(low), x.max(high)])
}

/// Whether the window is not empty and its numbers can be drawn.
fn has_room<const D: usize>(window: &[[f64; 2]; D]) -> bool {
    window.iter().all(|[low, high]| {
        let size = high - low;
        size > f64::MIN_POSITIVE.sqrt() && size < f64::MAX.sqrt() && low.abs() < 1e6 * size
    })
}

/// The pieces of a line that lie in the window (Liang & Barsky, edge by edge).
fn visible(line: &[[f64; 2]], window: &[[f64; 2]; 2]) -> Vec<Vec<[f64; 2]>> {
    let mut pieces: Vec<Vec<[f64; 2]>> = Vec::new();
    for ends in line.windows(2) {
        let (a, b) = (ends[0], ends[1]);
        let (mut from, mut to) = (0.0_f64, 1.0_f64);
        for k in 0..2 {
            let (length, [low, high]) = (b[k] - a[k], window[k]);
            if length == 0.0 {
                to = if (low..=high).contains(&a[k]) { to } else { -1.0 };
                continue;
            }
            let shares = [(low - a[k]) / length, (high - a[k]) / length];
            from = from.max(shares[0].min(shares[1]));
            to = to.min(shares[0].max(shares[1]));
        }
        if from >= to {
            continue;
        }
        let at = |share: f64| match share {
            0.0 => a,
            1.0 => b,
            _ => [0, 1].map(|k| (a[k] + (b[k] - a[k]) * share).clamp(window[k][0], window[k][1])),
        };
        match pieces.last_mut().filter(|piece| piece.last() == Some(&at(from))) {
            Some(piece) => piece.push(at(to)),
            None => pieces.push(vec![at(from), at(to)]),
        }
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_clipped_at_the_window() {
        let window = [[0.0, 2.0], [0.0, 1.0]];
        let line = [[-1.0, 0.5], [1.0, 0.5], [1.0, 3.0], [1.5, 3.0], [1.5, 0.25], [1.75, 0.25]];
        let pieces = visible(&line, &window);
        assert_eq!(
            pieces,
            [vec![[0.0, 0.5], [1.0, 0.5], [1.0, 1.0]], vec![[1.5, 1.0], [1.5, 0.25], [1.75, 0.25]]],
            "in two pieces"
        );
        assert!(visible(&[[-1.0, 0.5], [-1.0, 0.7]], &window).is_empty());
        assert!(visible(&[[-1.0, 0.9], [0.5, 2.0]], &window).is_empty(), "past the corner");
    }

    #[test]
    fn laws_have_distinct_colours() {
        let mut colours = LAW_NAMES.map(law_colour).to_vec();
        colours.sort_unstable();
        colours.dedup();
        assert_eq!(colours.len(), LAW_NAMES.len());
    }
}
