//! The recording of an impact map: the map as images, its rows as points at the positions of the tip, and poses of the arm on
//! the timeline `row`.
//!
//! `/map/k`: image k; `/map/k/here`: the pixel of the row on the timeline. `/workspace/k`: the same rows as points in space.
//! `/arm`: the pose of the row. `/legend`: the meaning of the colours.

use crate::RecordError;
use crate::target::{Sink, Target};
use carom_chain::{Chain, Spatial, Workspace};
use carom_study::map_study::{Evaluator, Values};
use carom_study::{Study, StudyError};
use rerun::blueprint as view;
use rerun::blueprint::components::PanelState;

/// Largest number of rows of a recording; each row is a point.
const MOST: usize = 1 << 20;
/// Approximate number of recorded poses, spread evenly over the rows that have one.
const POSES: usize = 400;
const ARM: u32 = 0xe8ec_f0ff;
const HERE: u32 = 0xffff_ffff;

/// Records one column of a whole map.
///
/// # Errors
/// [`RecordError`]: an error of [`Study::values`], a map of more than 2²⁰ rows, a file or a viewer that cannot be used.
pub fn record_map(study: &Study, column: &str, target: &Target) -> Result<(), RecordError> {
    let values = study.values(column)?;
    if values.rows.len() > MOST {
        return Err(RecordError::Map(format!(
            "the map has {} rows: a recording holds {MOST} at most, give the axes fewer values",
            values.rows.len()
        )));
    }
    let sink = Sink::open(target, column)?;
    let trouble = |e: rerun::RecordingStreamError| sink.error(e.to_string());
    let rec = &sink.rec;
    let width = values.axes[0].count() as usize;
    let height = if values.is_curve() { 1 } else { values.axes[1].count() as usize };
    let range = values.colour_range();
    let mut evaluator = study.evaluator();
    let mut images = Vec::new();
    for (k, cells) in values.values.chunks(width * height).enumerate() {
        let pixels: Vec<u8> = cells.chunks(width).rev().flatten().flat_map(|x| values.colour(*x, range)).collect();
        let image = rerun::Image::from_rgb24(pixels, [width as u32, height as u32]);
        rec.log_static(format!("map/{k}"), &image).map_err(trouble)?;
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
        rec.log_static(format!("workspace/{k}"), &points).map_err(trouble)?;
        let name = values.axes.get(if values.is_curve() { 1 } else { 2 }).map_or(column.to_owned(), |axis| {
            let names = axis.names();
            format!(
                "{column}, {} {}",
                axis.name,
                names.get(k).cloned().unwrap_or_else(|| axis.value(k as u64).to_string())
            )
        });
        let image = view::Spatial2DView::new(name).with_origin(format!("map/{k}"));
        images.push(view::ContainerLike::from(image));
    }
    let legend = rerun::TextDocument::from_markdown(legend(&values));
    rec.log_static("legend", &legend).map_err(trouble)?;

    let with_pose: Vec<usize> = (0..values.rows.len()).filter(|i| evaluator.pose(values.rows[*i]).is_some()).collect();
    let mut workspace = study.chain().workspace();
    for &i in with_pose.iter().step_by(with_pose.len().div_ceil(POSES).max(1)) {
        let Some(q) = evaluator.pose(values.rows[i]) else { continue };
        rec.set_time_sequence("row", values.rows[i] as i64);
        let links = rerun::LineStrips3D::new(links(study.chain(), &mut workspace, &q)?);
        let links = links.with_colors([ARM]).with_radii([rerun::Radius::new_ui_points(3.0)]);
        rec.log("arm", &links).map_err(trouble)?;
        let (panel, cell) = (i / (width * height), i % (width * height));
        for k in 0..images.len() {
            let at = [(cell % width) as f32 + 0.5, (height - 1 - cell / width) as f32 + 0.5];
            let here = rerun::Points2D::new((k == panel).then_some(at));
            let here = here.with_colors([HERE]).with_radii([rerun::Radius::new_ui_points(5.0)]);
            rec.log(format!("map/{k}/here"), &here).map_err(trouble)?;
        }
    }

    let layout = view::Horizontal::new([
        view::Vertical::new(images).into(),
        view::Spatial3DView::new("positions of the tip, and the arm").with_contents(["/workspace/**", "/arm"]).into(),
        view::TextDocumentView::new("colours").with_origin("legend").into(),
    ])
    .with_column_shares([3.0, 3.0, 1.0]);
    let blueprint = view::Blueprint::new(layout)
        .with_auto_views(false)
        .with_selection_panel(view::SelectionPanel::from_state(PanelState::Hidden))
        .with_blueprint_panel(view::BlueprintPanel::from_state(PanelState::Hidden))
        .with_time_panel(
            view::TimePanel::new().with_state(PanelState::Collapsed).with_timeline("row").with_playback_speed(1.0),
        );
    let at_once = view::BlueprintActivation { make_active: true, make_default: true };
    blueprint.send(rec, at_once).map_err(trouble)?;
    sink.finish()
}

impl From<StudyError> for RecordError {
    fn from(error: StudyError) -> Self {
        Self::Map(error.to_string())
    }
}

/// The position of the tip in a row, m; `None` for a row without a pose.
fn tip(evaluator: &mut Evaluator, row: u64) -> Option<[f32; 3]> {
    let q = evaluator.pose(row)?;
    let tip = evaluator.tip(&q)?;
    Some([tip.x as f32, tip.y as f32, tip.z as f32])
}

/// Lines from the origin of each joint's parent link to that of its child link, m.
fn links(chain: &Chain, workspace: &mut Workspace<Spatial<f64>>, q: &[f64]) -> Result<Vec<[[f32; 3]; 2]>, RecordError> {
    let kin = workspace.update(chain, q)?;
    let place = |link: &str| -> Result<[f32; 3], RecordError> {
        let p = kin.pose(chain.frame(link)?).translation;
        Ok([p.x as f32, p.y as f32, p.z as f32])
    };
    let ends = chain.joints().iter().filter(|joint| joint.parent != "world");
    ends.map(|joint| Ok([place(&joint.parent)?, place(&joint.child)?])).collect()
}

/// The meaning of the colours, as Markdown.
fn legend(values: &Values) -> String {
    let mut text = format!("## {}\n\n", values.label);
    if values.words.is_empty() {
        let (low, high) = values.colour_range();
        text += &format!("dark or blue: {low:.4e}\n\nlight or red: {high:.4e}\n\n");
    } else {
        let total = values.values.len() as f64;
        for (k, word) in values.words.iter().enumerate() {
            let share = values.values.iter().filter(|x| **x == k as f64).count() as f64 / total;
            let [r, g, b] = values.colour(k as f64, (0.0, 1.0));
            if share > 0.0 {
                text += &format!("- {word}: {:.1} % (red {r}, green {g}, blue {b})\n", 100.0 * share);
            }
        }
    }
    let axes: Vec<&str> = values.axes.iter().map(|axis| axis.name.as_str()).collect();
    text + &format!("\naxes: {}\n", axes.join(", "))
}
