//! Diagrams of one impact on which laws can be compared: as data with exact coordinates, for whoever draws them.

mod hodograph;
mod impulse_space;
mod routh;
mod svg;

pub use hodograph::hodograph;
pub use impulse_space::impulse_space;
pub use routh::routh_diagram;

use carom_impact::LAW_NAMES;

/// A law's impulse, in contact axes: tangents first, normal last.
#[derive(Debug, Clone, PartialEq)]
pub struct LawPoint<const D: usize> {
    /// The law's name.
    pub law: String,
    /// N s.
    pub impulse: [f64; D],
}

/// A picture in D dimensions, not drawn yet.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagram<const D: usize> {
    /// What it shows.
    pub title: String,
    /// What is along each axis, with its unit.
    pub axes: [String; D],
    /// What is to be seen along each axis, from and to.
    pub window: [[f64; 2]; D],
    /// One length for one unit on all axes.
    pub equal_scales: bool,
    /// Areas and lines, in the order in which they are drawn.
    pub shapes: Vec<Shape<D>>,
    /// Points, drawn after them.
    pub marks: Vec<Mark<D>>,
}

/// An area or a line, which may have several pieces.
#[derive(Debug, Clone, PartialEq)]
pub struct Shape<const D: usize> {
    /// What it is, for the legend.
    pub name: String,
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// How it is drawn.
    pub stroke: Stroke,
    /// Corners of each piece; pieces without room in the window are left out.
    pub pieces: Vec<Vec<[f64; D]>>,
}

/// How a shape is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// Filled: each piece is a polygon.
    Area,
    /// A thin line.
    Thin,
    /// The line that matters.
    Thick,
}

/// A point with a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark<const D: usize> {
    /// A law's name, or what happens there.
    pub name: String,
    /// Red, green, blue.
    pub colour: [u8; 3],
    /// What it stands for.
    pub symbol: Symbol,
    /// Where it is.
    pub at: [f64; D],
}

/// What a mark stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Symbol {
    /// A law's answer.
    Law,
    /// The path begins here.
    Start,
    /// Compression ends.
    Turn,
    /// Slip stops.
    Stop,
}

const BLACK: [u8; 3] = [0, 0, 0];
const DARK: [u8; 3] = [70, 70, 70];
const GREY: [u8; 3] = [120, 120, 120];
const PALE: [u8; 3] = [210, 210, 210];
const BLUE: [u8; 3] = [31, 120, 180];
const RED: [u8; 3] = [227, 26, 28];
const GREEN: [u8; 3] = [178, 223, 138];

/// A law keeps its colour whichever others are asked.
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

/// From the least to the greatest of some numbers, 0 among them.
fn spread(numbers: impl Iterator<Item = f64>) -> [f64; 2] {
    numbers.fold([0.0, 0.0], |[low, high], x| [x.min(low), x.max(high)])
}

/// Whether there is something to see, in numbers that can be drawn.
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
    fn a_line_is_cut_at_the_window_and_keeps_what_is_inside() {
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
    fn laws_have_colours_of_their_own() {
        let mut colours = LAW_NAMES.map(law_colour).to_vec();
        colours.sort_unstable();
        colours.dedup();
        assert_eq!(colours.len(), LAW_NAMES.len());
    }
}
