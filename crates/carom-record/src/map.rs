//! The recording of an impact map: the map as images, its rows as points at the positions of the tip, and poses of the arm on
//! the timeline `row`.
//!
//! `/map/k`: image k; `/map/k/here`: the pixel of the row on the timeline. `/space/tip/k`: the same rows as points in space.
//! `/space/arm`: the pose of the row. `/colours`: the colour bar, or a square for each word. `/legend`: the axes, and how often each word
//! occurs.

use crate::RecordError;
use crate::bounds::{Bounds, Eye, xyz};
use crate::layout::{self, Cursor, Tile};
use crate::rerun;
use crate::target::{Sink, Target};
use carom_chain::{Chain, Spatial, Workspace};
use carom_study::NumberedRows;
use carom_study::map_study::{Evaluator, Study, StudyError, Values};
use nalgebra::Vector3;

/// Largest number of rows of a recording; each row is a point.
const MOST: u64 = 1 << 20;
/// Approximate number of recorded poses, spread evenly over the rows that have one.
const POSES: usize = 400;
const ARM: u32 = 0xe8ec_f0ff;
const HERE: u32 = 0xffff_ffff;
const WORDS: u32 = 0xe8ec_f0ff;
/// Duration of one pass over all rows, s.
const REPLAY: f64 = 10.0;

/// Checks that a recording can show this column of a map, without computing it.
///
/// # Errors
/// [`RecordError::Map`]: an error of [`Study::values`], a map of more than 2²⁰ rows.
pub fn check_map(study: &Study, column: &str) -> Result<(), RecordError> {
    study.check_picture(column)?;
    if study.rows() > MOST {
        let rows = study.rows();
        let rule = format!("the map has {rows} rows: a recording holds {MOST} at most, give the axes fewer values");
        return Err(RecordError::Map(rule));
    }
    Ok(())
}

/// Records one column of a whole map.
///
/// # Errors
/// As [`check_map`], and a file or a viewer that cannot be used.
pub fn record_map(study: &Study, column: &str, target: &Target) -> Result<(), RecordError> {
    check_map(study, column)?;
    let values = study.values(column)?;
    let sink = Sink::open(target, column)?;
    let width = values.axes[0].count() as usize;
    let height = if values.is_curve() { 1 } else { values.axes[1].count() as usize };
    let range = values.colour_range();
    let mut evaluator = study.evaluator();
    let mut images = Vec::new();
    for (k, cells) in values.values.chunks(width * height).enumerate() {
        let pixels: Vec<u8> = cells.chunks(width).rev().flatten().flat_map(|x| values.colour(*x, range)).collect();
        let image = rerun::Image::from_rgb24(pixels, [width as u32, height as u32]);
        sink.fixed(format!("map/{k}"), &image)?;
        let rows = &values.rows[k * width * height..][..cells.len()];
        let (points, colours): (Vec<[f32; 3]>, Vec<rerun::Color>) = rows
            .iter()
            .zip(cells)
            .filter_map(|(row, x)| {
                let [r, g, b] = values.colour(*x, range);
                Some((tip(&mut evaluator, *row)?, rerun::Color::from_rgb(r, g, b)))
            })
            .unzip();
        let points = rerun::Points3D::new(points).with_colors(colours).with_radii([rerun::Radius::new_ui_points(1.5)]);
        sink.fixed(format!("space/tip/{k}"), &points)?;
        let name = values.axes.get(if values.is_curve() { 1 } else { 2 }).map_or(column.to_owned(), |axis| {
            let names = axis.names();
            format!(
                "{column}, {} {}",
                axis.name,
                names.get(k).cloned().unwrap_or_else(|| axis.value(k as u64).to_string())
            )
        });
        images.push((1.0, layout::image(&name, &format!("/map/{k}"))));
    }
    let legend = rerun::TextDocument::from_markdown(legend(&values));
    sink.fixed("legend", &legend)?;
    let bar = colours(&sink, &values, range)?;

    let with_pose: Vec<usize> = (0..values.rows.len()).filter(|i| evaluator.pose(values.rows[*i]).is_some()).collect();
    let mut workspace = study.chain().workspace();
    let mut bounds = Bounds::empty();
    for &i in with_pose.iter().step_by(with_pose.len().div_ceil(POSES).max(1)) {
        let Some(q) = evaluator.pose(values.rows[i]) else { continue };
        sink.rec.set_time_sequence("row", values.rows[i] as i64);
        let links = links(study.chain(), &mut workspace, &q)?;
        links.iter().flatten().for_each(|end| bounds.include(Vector3::from(*end).cast(), 0.0));
        let links = rerun::LineStrips3D::new(links);
        let links = links.with_colors([ARM]).with_radii([rerun::Radius::new_ui_points(3.0)]);
        sink.now("space/arm", &links)?;
        let (panel, cell) = (i / (width * height), i % (width * height));
        for k in 0..values.rows.len() / (width * height) {
            let at = [(cell % width) as f32 + 0.5, (height - 1 - cell / width) as f32 + 0.5];
            let here = rerun::Points2D::new((k == panel).then_some(at));
            let here = here.with_colors([HERE]).with_radii([rerun::Radius::new_ui_points(5.0)]);
            sink.now(format!("map/{k}/here"), &here)?;
        }
    }

    let space = layout::space("positions of the tip, and the arm", "/space", &eye(&bounds), &[]);
    let meaning = Tile::Column(vec![(3.0, bar), (1.0, layout::text("the map", "/legend"))]);
    let root = Tile::Row(vec![(3.0, Tile::Column(images)), (3.0, space), (1.3, meaning)]);
    // The viewer passes over 30 rows a second at speed 1.
    let speed = (study.rows() as f64 / (30.0 * REPLAY)).max(0.1);
    layout::send(&sink, &root, &Cursor::Rows { speed })?;
    sink.finish()
}

impl From<StudyError> for RecordError {
    fn from(error: StudyError) -> Self {
        Self::Map(error.to_string())
    }
}

/// The eye from which all poses are seen: at right angles to the plane in which they are, if there is one.
fn eye(bounds: &Bounds) -> Eye {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let flat = axes.iter().position(|axis| bounds.half_depth(axis) < 1e-9 * bounds.size());
    let (from, up) = match flat {
        Some(0) => (axes[0], axes[2]),
        Some(1) => (-axes[1], axes[2]),
        Some(_) => (axes[2], axes[1]),
        None => (Vector3::new(0.45, -0.8, 0.4).normalize(), axes[2]),
    };
    // The view is one of three columns over the whole height.
    Eye::looking(bounds, from, up, 0.65)
}

/// Draws the colour bar with numbers beside it, or a square with each word that occurs.
fn colours(sink: &Sink, values: &Values, (low, high): (f64, f64)) -> Result<Tile, RecordError> {
    const HEIGHT: usize = 240;
    const WIDTH: usize = 24;
    let occurs = |k: &usize| values.values.contains(&(*k as f64));
    let words: Vec<usize> = (0..values.words.len()).filter(occurs).collect();
    let count = words.len();
    let value = |line: usize| match count {
        0 => high + (low - high) * line as f64 / (HEIGHT - 1) as f64,
        _ => words[line * count / HEIGHT] as f64,
    };
    let pixels: Vec<u8> =
        (0..HEIGHT).flat_map(|line| [values.colour(value(line), (low, high)); WIDTH]).flatten().collect();
    let bar = rerun::Image::from_rgb24(pixels, [WIDTH as u32, HEIGHT as u32]);
    let labels: Vec<(f64, String)> = match count {
        0 => {
            (0..=5).map(|k| (f64::from(k) / 5.0, format!("{:.3e}", high + (low - high) * f64::from(k) / 5.0))).collect()
        }
        _ => {
            words.iter().enumerate().map(|(k, w)| ((k as f64 + 0.5) / count as f64, values.words[*w].clone())).collect()
        }
    };
    // The viewer writes a label below its point.
    let at = labels.iter().map(|(share, _)| [3.0 * WIDTH as f32, (*share * HEIGHT as f64) as f32 - 7.0]);
    let texts = rerun::Points2D::new(at).with_labels(labels.iter().map(|(_, text)| text.as_str()));
    let texts = texts.with_show_labels(true).with_colors([WORDS]).with_radii([rerun::Radius::new_ui_points(0.0)]);
    sink.fixed("colours", &bar)?;
    sink.fixed("colours/words", &texts)?;
    let margin = 0.08 * HEIGHT as f64;
    let seen = [[-margin, 7.0 * WIDTH as f64], [-(HEIGHT as f64) - margin, margin]];
    Ok(layout::plane(&values.label, "/colours", seen))
}

/// The position of the tip in a row, m; `None` for a row without a pose.
fn tip(evaluator: &mut Evaluator, row: u64) -> Option<[f32; 3]> {
    let q = evaluator.pose(row)?;
    evaluator.tip(&q).map(xyz)
}

/// Lines from the origin of each joint's parent link to that of its child link, m.
fn links(chain: &Chain, workspace: &mut Workspace<Spatial<f64>>, q: &[f64]) -> Result<Vec<[[f32; 3]; 2]>, RecordError> {
    let kin = workspace.update(chain, q)?;
    let place = |link: &str| -> Result<_, RecordError> { Ok(xyz(kin.pose(chain.frame(link)?).translation)) };
    let ends = chain.joints().iter().filter(|joint| joint.parent != "world");
    ends.map(|joint| Ok([place(&joint.parent)?, place(&joint.child)?])).collect()
}

/// Name and axes of the map, and how often each word occurs, as Markdown.
fn legend(values: &Values) -> String {
    let mut text = format!("## {}\n\n", values.label);
    let total = values.values.len() as f64;
    for (k, word) in values.words.iter().enumerate() {
        let share = values.values.iter().filter(|x| **x == k as f64).count() as f64 / total;
        if share > 0.0 {
            text += &format!("- {word}: {:.1} %\n", 100.0 * share);
        }
    }
    let axes: Vec<&str> = values.axes.iter().map(|axis| axis.name.as_str()).collect();
    text + &format!("\naxes: {}\n", axes.join(", "))
}
