//! The recording of the diagrams of one impact, in the plane and in space, and of its outcomes as text.
//!
//! | entity | what |
//! | --- | --- |
//! | `/plane/…`, `/space/…` | each shape and each mark of the diagram under its name; `axes`, `numbers` |
//! | `/laws` | the outcomes of the laws, as a page |

use crate::bounds::{Bounds, Eye};
use crate::layout::{self, Cursor, Tile};
use crate::rerun;
use crate::rerun::{AsComponents, EntityPath, EntityPathPart, Radius};
use crate::target::{Sink, Target};
use crate::{RecordError, round, summary};
use carom_study::{Diagram, Mark, Stroke, Symbol};
use nalgebra::Vector3;

const AXES: u32 = 0x8a93_a3ff;
/// Marks nearer to each other than this share of the window share one label.
const NEAR: f64 = 0.03;

/// Records the diagrams of one impact and a page of Markdown, `words`.
///
/// # Errors
/// [`RecordError::Unwritable`], [`RecordError::Viewer`].
pub fn record_diagrams(
    target: &Target,
    plane: &Diagram<2>,
    space: Option<&Diagram<3>>,
    words: &str,
) -> Result<(), RecordError> {
    let sink = Sink::open(target, &plane.title)?;
    draw(&sink, "plane", plane)?;
    // Margins for the numbers and names at the edge of the window.
    let seen = plane.window.map(|[low, high]| [low - 0.08 * (high - low), high + 0.16 * (high - low)]);
    let mut views = vec![(1.0, layout::plane(&plane.title, "/plane", seen))];
    if let Some(space) = space {
        draw(&sink, "space", space)?;
        sink.fixed("space", &rerun::ViewCoordinates::RIGHT_HAND_Z_UP())?;
        let mut bounds = Bounds::empty();
        for end in [0, 1] {
            bounds.include(Vector3::from(space.window.map(|ends| ends[end])), 0.0);
        }
        let eye = Eye::looking(&bounds, Vector3::new(0.6, -0.8, 0.3).normalize(), Vector3::z(), Eye::WIDE);
        views.push((1.0, layout::space(&space.title, "/space", &eye, &[])));
    }
    sink.fixed("laws", &rerun::TextDocument::from_markdown(words))?;
    let root = Tile::Column(vec![(2.2, Tile::Row(views)), (1.0, layout::text("the laws", "/laws"))]);
    layout::send(&sink, &root, &Cursor::Newest { speed: 1.0 })?;
    sink.finish()
}

/// Drawing of lines and points in 2D and 3D; widths in pixels, a larger `order` is drawn above a smaller one.
trait Place: Copy {
    fn lines(pieces: &[Vec<Self>], colour: u32, width: f32, order: f32) -> Box<dyn AsComponents>;
    fn points(points: &[(Self, String)], colour: u32, radius: f32, order: f32) -> Box<dyn AsComponents>;
}

/// Coordinates of the viewer, whose y axis points down.
fn screen(p: [f64; 2]) -> [f32; 2] {
    [p[0] as f32, -p[1] as f32]
}

impl Place for [f64; 2] {
    fn lines(pieces: &[Vec<Self>], colour: u32, width: f32, order: f32) -> Box<dyn AsComponents> {
        let strips = pieces.iter().map(|piece| piece.iter().map(|p| screen(*p)).collect::<Vec<_>>());
        let lines = rerun::LineStrips2D::new(strips).with_colors([colour]).with_draw_order(order);
        Box::new(lines.with_radii([Radius::new_ui_points(width)]))
    }

    fn points(points: &[(Self, String)], colour: u32, radius: f32, order: f32) -> Box<dyn AsComponents> {
        let drawn = rerun::Points2D::new(points.iter().map(|(p, _)| screen(*p))).with_colors([colour]);
        let drawn = drawn.with_radii([Radius::new_ui_points(radius)]).with_draw_order(order);
        Box::new(drawn.with_labels(points.iter().map(|(_, label)| label.as_str())).with_show_labels(true))
    }
}

impl Place for [f64; 3] {
    fn lines(pieces: &[Vec<Self>], colour: u32, width: f32, _: f32) -> Box<dyn AsComponents> {
        let strips = pieces.iter().map(|piece| piece.iter().map(|p| p.map(|x| x as f32)).collect::<Vec<_>>());
        let lines = rerun::LineStrips3D::new(strips).with_colors([colour]);
        Box::new(lines.with_radii([Radius::new_ui_points(width)]))
    }

    fn points(points: &[(Self, String)], colour: u32, radius: f32, _: f32) -> Box<dyn AsComponents> {
        let drawn = rerun::Points3D::new(points.iter().map(|(p, _)| p.map(|x| x as f32))).with_colors([colour]);
        let drawn = drawn.with_radii([Radius::new_ui_points(radius)]);
        Box::new(drawn.with_labels(points.iter().map(|(_, label)| label.as_str())).with_show_labels(true))
    }
}

/// Draws everything of a diagram under one root.
fn draw<const D: usize>(sink: &Sink, root: &str, diagram: &Diagram<D>) -> Result<(), RecordError>
where
    [f64; D]: Place,
{
    let under = |name: &str| EntityPath::new([root, name].map(EntityPathPart::new).to_vec());
    let (lines, numbers) = axes(diagram);
    sink.fixed(under("axes"), Place::lines(&lines, AXES, 0.5, 0.0).as_ref())?;
    sink.fixed(under("numbers"), Place::points(&numbers, AXES, 1.0, 0.0).as_ref())?;
    for (k, shape) in diagram.shapes.iter().enumerate() {
        let (width, closed) = match shape.stroke {
            Stroke::Area => (1.5, true), // the viewer cannot fill polygons: the outline is drawn
            Stroke::Thin => (0.7, false),
            Stroke::Thick => (2.0, false),
        };
        let mut pieces = shape.pieces.clone();
        if closed {
            pieces.iter_mut().for_each(|piece| piece.extend(piece.first().copied()));
        }
        sink.fixed(under(&shape.name), Place::lines(&pieces, colour(shape.colour), width, 1.0 + k as f32).as_ref())?;
    }
    for (k, (mark, label)) in diagram.marks.iter().zip(labels(diagram)).enumerate() {
        let k = k as f32;
        let radius = if mark.symbol == Symbol::Law { (8.0 - 0.5 * k).max(3.0) } else { 4.0 };
        let point = Place::points(&[(mark.at, label)], colour(mark.colour), radius, 100.0 + k);
        sink.fixed(under(&mark.name), point.as_ref())?;
    }
    Ok(())
}

/// Converts a colour for a white ground to the dark ground of the viewer: greys are inverted, other colours lightened.
fn colour(rgb: [u8; 3]) -> u32 {
    let grey = rgb.iter().max().zip(rgb.iter().min()).is_some_and(|(most, least)| most - least < 30);
    let [r, g, b] = rgb.map(|x| if grey { (255 - x).saturating_add(24) } else { x + (255 - x) / 3 });
    u32::from_be_bytes([r, g, b, 0xff])
}

/// The labels of the marks; the names of marks near to each other are joined at the first of them.
fn labels<const D: usize>(diagram: &Diagram<D>) -> Vec<String> {
    let size = diagram.window.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
    let near = |a: &Mark<D>, b: &Mark<D>| a.at.iter().zip(&b.at).all(|(x, y)| (x - y).abs() < NEAR * size);
    let mut labels: Vec<String> = diagram.marks.iter().map(|mark| mark.name.clone()).collect();
    for k in 1..labels.len() {
        let first = (0..k).find(|&j| !labels[j].is_empty() && near(&diagram.marks[j], &diagram.marks[k]));
        if let Some(j) = first {
            let name = std::mem::take(&mut labels[k]);
            labels[j] = format!("{}, {name}", labels[j]);
        }
    }
    labels
}

/// Pieces of lines, and points with their labels.
type Axes<P> = (Vec<Vec<P>>, Vec<(P, String)>);

/// The axes through zero with names at their ends; in 2D also numbers along the edge of the window.
fn axes<const D: usize>(diagram: &Diagram<D>) -> Axes<[f64; D]> {
    let (mut lines, mut words) = (Vec::new(), Vec::new());
    for (k, ([low, high], name)) in diagram.window.iter().zip(&diagram.axes).enumerate() {
        let at = |x: f64, aside: [f64; D]| -> [f64; D] { std::array::from_fn(|j| if j == k { x } else { aside[j] }) };
        let zero = [0.0; D];
        lines.push(vec![at(*low, zero), at(*high, zero)]);
        if D > 2 {
            words.push((at(*high, zero), name.clone()));
            continue;
        }
        let edge = diagram.window.map(|ends| ends[0]);
        lines.push(vec![at(*low, edge), at(*high, edge)]);
        let step = round((high - low) / 4.0);
        let (first, last) = ((low / step).ceil() as i32, (high / step).floor() as i32);
        words.extend((first..=last).map(|n| f64::from(n) * step).map(|x| (at(x, edge), summary::short(x))));
        words.push((at(high + 0.1 * (high - low), edge), name.clone()));
    }
    (lines, words)
}
