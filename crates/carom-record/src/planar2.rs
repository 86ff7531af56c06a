//! The recording of the two-link experiment: both elbows beside each other, time 0 the impact.
//!
//! Per elbow: `/up/map` (where would the tip reverse?), `/up/wall`, `/up/links`, `/up/path`, `/up/impulse`,
//! `/up/velocity/…`; time series under `/series`; the table as a text document.

use crate::RecordError;
use carom_chain::{Chain, Spatial, Workspace};
use carom_sim::Sample;
use carom_study::paper::{NORMAL, Run, TANGENT};
use carom_study::{MapPoint, paper::Elbow};
use nalgebra::{Vector2, Vector3};
use rerun::blueprint as view;
use rerun::{RecordingStream, RecordingStreamResult};
use std::path::Path;

/// What is shown of one elbow.
#[derive(Debug, Clone)]
pub struct Side {
    /// The impact.
    pub run: Run,
    /// Free motion into the impact, times from the first to 0.
    pub before: Vec<Sample>,
    /// Free motion out of it, times from 0 to the last.
    pub after: Vec<Sample>,
    /// v_t⁺/v_t⁻ over the workspace.
    pub map: Vec<MapPoint>,
}

const WALL: u32 = 0x9aa4_b2ff;
const LINK: u32 = 0x2f3b_52ff;
const GHOST: u32 = 0x2f3b_5250;
const BEFORE: u32 = 0x1f78_b4ff;
const AFTER: u32 = 0xe31a_1cff;
const IMPULSE: u32 = 0xff7f_00ff;
/// Metres on the screen for one N s and for one m/s.
const IMPULSE_SCALE: f64 = 0.5;
const VELOCITY_SCALE: f64 = 0.8;

/// Writes the recording beside `path` and then moves it there.
///
/// # Errors
/// [`RecordError`].
pub fn record_planar2(chain: &Chain, sides: &[Side], table: &str, path: &Path) -> Result<(), RecordError> {
    let unwritable = |reason: String| RecordError::Unwritable { path: path.to_owned(), reason };
    let partial = path.with_extension("rrd.part");
    let written = (|| -> Result<RecordingStreamResult<()>, RecordError> {
        let rec = match rerun::RecordingStreamBuilder::new("carom_planar2").save(&partial) {
            Ok(rec) => rec,
            Err(error) => return Ok(Err(error)),
        };
        let mut pen = Pen { rec: &rec, chain, workspace: chain.workspace() };
        for side in sides {
            match pen.side(side)? {
                Ok(()) => {}
                Err(error) => return Ok(Err(error)),
            }
        }
        Ok(finish(&rec, table))
    })()?;
    written.map_err(|e| unwritable(e.to_string()))?;
    std::fs::rename(&partial, path).map_err(|e| unwritable(e.to_string()))
}

fn finish(rec: &RecordingStream, table: &str) -> RecordingStreamResult<()> {
    rec.log_static("table", &rerun::TextDocument::from_markdown(table))?;
    for (name, label, colour) in [
        ("tangential/up", "v_t up-elbow", 0x1f78_b4ff_u32),
        ("tangential/down", "v_t down-elbow", 0xe31a_1cff),
        ("normal/up", "v_n up-elbow", 0x1f78_b4ff),
        ("normal/down", "v_n down-elbow", 0xe31a_1cff),
        ("energy/up", "T up-elbow", 0x1f78_b4ff),
        ("energy/down", "T down-elbow", 0xe31a_1cff),
    ] {
        let style = rerun::SeriesLines::new().with_names([label]).with_colors([colour]).with_widths([2.0]);
        rec.log_static(format!("series/{name}"), &style)?;
    }
    let arm = |elbow: &str| {
        view::Spatial2DView::new(format!("{elbow}-elbow: the map says where the tip would reverse"))
            .with_origin(elbow.to_owned())
            .with_contents([format!("/{elbow}/**")])
    };
    let series = |name: &str, what: &str| view::TimeSeriesView::new(name.to_owned()).with_origin(format!("series/{what}"));
    let layout = view::Horizontal::new([
        view::Vertical::new([
            view::Horizontal::new([arm("up").into(), arm("down").into()]).into(),
            view::Horizontal::new([
                series("tangential velocity, down the wall (m/s)", "tangential").into(),
                series("normal velocity, off the wall (m/s)", "normal").into(),
                series("kinetic energy (J)", "energy").into(),
            ])
            .into(),
        ])
        .with_row_shares([2.0, 1.0])
        .into(),
        view::TextDocumentView::new("the experiment").with_origin("table").into(),
    ])
    .with_column_shares([3.0, 1.0]);
    let blueprint = view::Blueprint::new(layout)
        .with_auto_views(false)
        .with_selection_panel(view::SelectionPanel::from_state(rerun::blueprint::components::PanelState::Hidden))
        .with_blueprint_panel(view::BlueprintPanel::from_state(rerun::blueprint::components::PanelState::Hidden))
        .with_time_panel(view::TimePanel::new().with_timeline("time").with_playback_speed(0.1));
    let at_once = view::BlueprintActivation { make_active: true, make_default: true };
    blueprint.send(rec, at_once)?;
    rec.flush_blocking()?;
    Ok(())
}

/// Draws in the chain's plane, y up.
struct Pen<'a> {
    rec: &'a RecordingStream,
    chain: &'a Chain,
    workspace: Workspace<Spatial<f64>>,
}

/// The viewer's y points down.
fn screen(p: Vector2<f64>) -> [f32; 2] {
    [p.x as f32, -p.y as f32]
}

impl Pen<'_> {
    /// Base, elbow and tip at `q`.
    fn joints(&mut self, q: &[f64]) -> Result<[Vector2<f64>; 3], RecordError> {
        let frames = [self.chain.frame("link1")?, self.chain.frame("link2")?, self.chain.frame("tip")?];
        let kin = self.workspace.update(self.chain, q)?;
        Ok(frames.map(|f| kin.pose(f).translation.xy()))
    }

    fn tip_velocity(&mut self, q: &[f64], qd: &[f64]) -> Result<Vector3<f64>, RecordError> {
        let tip = self.chain.point(self.chain.frame("tip")?, Vector3::zeros());
        Ok(self.workspace.update(self.chain, q)?.point_velocity(tip, qd)?)
    }

    fn side(&mut self, side: &Side) -> Result<RecordingStreamResult<()>, RecordError> {
        let elbow = side.run.elbow.name();
        let pose = side.run.elbow.pose();
        let [base, knee, tip] = self.joints(&pose)?;
        let paths = [&side.before, &side.after];
        let mut tips = [Vec::new(), Vec::new()];
        for (path, tips) in paths.iter().zip(&mut tips) {
            for sample in path.iter() {
                tips.push(screen(self.joints(&sample.q)?[2]));
            }
        }
        // Ghosts: where the arm comes from and where it goes.
        let ends = [side.before.first(), side.after.last()].into_iter().flatten();
        let mut ghosts = Vec::new();
        for sample in ends {
            ghosts.push(self.joints(&sample.q)?.map(screen).to_vec());
        }
        let mut frames = Vec::new();
        for (after, sample) in paths.iter().enumerate().flat_map(|(k, path)| path.iter().map(move |s| (k == 1, s))) {
            let energy = self.workspace.update(self.chain, &sample.q)?.kinetic_energy(&sample.qd)?;
            frames.push((after, sample.time, self.joints(&sample.q)?, self.tip_velocity(&sample.q, &sample.qd)?, energy));
        }
        let drawn = (|| -> RecordingStreamResult<()> {
            let rec = self.rec;
            let at = |what: &str| format!("{elbow}/{what}");
            rec.log_static(at("map"), &map_points(side, base))?;
            rec.log_static(at("wall"), &wall(tip))?;
            rec.log_static(at("ghosts"), &rerun::LineStrips2D::new(ghosts).with_colors([GHOST]).with_radii([0.012]).with_draw_order(20.0))?;
            let path_colours = [BEFORE, AFTER];
            rec.log_static(at("path"), &rerun::LineStrips2D::new(tips).with_colors(path_colours).with_radii([0.003]).with_draw_order(35.0))?;
            let impulse = side.run.hit.impulse.xy() * IMPULSE_SCALE;
            let label = format!("impulse {:.3} N s", side.run.hit.impulse.norm());
            rec.log_static(
                at("impulse"),
                &rerun::Arrows2D::from_vectors([screen(impulse)])
                    .with_origins([screen(tip)])
                    .with_colors([IMPULSE])
                    .with_radii([0.006])
                    .with_labels([label])
                    .with_draw_order(40.0),
            )?;
            for (name, u, colour) in [("before", side.run.hit.u_minus, BEFORE), ("after", side.run.hit.u_plus, AFTER)] {
                rec.log_static(
                    at(&format!("velocity/{name}")),
                    &rerun::Arrows2D::from_vectors([screen(u.xy() * VELOCITY_SCALE)])
                        .with_origins([screen(tip)])
                        .with_colors([colour])
                        .with_radii([0.005])
                        .with_draw_order(45.0),
                )?;
            }
            for (after, time, joints, u, energy) in frames {
                rec.set_duration_secs("time", time);
                let arm = joints.map(screen);
                rec.log(at("links"), &rerun::LineStrips2D::new([arm.to_vec()]).with_colors([LINK]).with_radii([0.018]).with_draw_order(30.0))?;
                rec.log(at("joints"), &rerun::Points2D::new(arm).with_colors([0xffff_ffff_u32]).with_radii([0.012, 0.012, 0.006]).with_draw_order(31.0))?;
                let (t, n) = (Vector3::from(TANGENT), Vector3::from(NORMAL));
                rec.log(format!("series/tangential/{elbow}"), &rerun::Scalars::single(t.dot(&u)))?;
                rec.log(format!("series/normal/{elbow}"), &rerun::Scalars::single(n.dot(&u)))?;
                rec.log(format!("series/energy/{elbow}"), &rerun::Scalars::single(energy))?;
                if time == 0.0 {
                    let side = if after { "after" } else { "before" };
                    rec.log(at("event"), &rerun::TextLog::new(format!("{elbow}-elbow, {side} the impact: u = ({:.4}, {:.4}) m/s", u.x, u.y)))?;
                }
            }
            Ok(())
        })();
        let _ = knee;
        Ok(drawn)
    }
}

/// Red: reverses; grey-blue: shrinks; yellow to orange: grows.
fn map_points(side: &Side, base: Vector2<f64>) -> rerun::Points2D {
    let colour = |ratio: f64| -> u32 {
        let mix = |a: [f64; 3], b: [f64; 3], x: f64| {
            let c = |k: usize| (a[k] + (b[k] - a[k]) * x.clamp(0.0, 1.0)).round() as u32;
            (c(0) << 24) | (c(1) << 16) | (c(2) << 8) | 0xff
        };
        if ratio < 0.0 {
            mix([253.0, 205.0, 205.0], [214.0, 96.0, 96.0], -ratio / 2.0)
        } else if ratio < 1.0 {
            mix([225.0, 232.0, 240.0], [205.0, 222.0, 238.0], ratio)
        } else {
            mix([253.0, 243.0, 200.0], [240.0, 190.0, 90.0], (ratio - 1.0) / 2.0)
        }
    };
    let positions = side.map.iter().map(|p| screen(p.tip + base));
    rerun::Points2D::new(positions)
        .with_colors(side.map.iter().map(|p| colour(p.tangential_ratio)))
        .with_radii([0.009])
        .with_draw_order(1.0)
}

fn wall(tip: Vector2<f64>) -> rerun::LineStrips2D {
    let at = |y: f64| screen(Vector2::new(tip.x + 0.012, y));
    rerun::LineStrips2D::new([vec![at(-0.45), at(0.45)]]).with_colors([WALL]).with_radii([0.008]).with_draw_order(10.0)
}

/// Both sides in the order up, down.
impl Side {
    /// Which elbow this is.
    pub fn elbow(&self) -> Elbow {
        self.run.elbow
    }
}
