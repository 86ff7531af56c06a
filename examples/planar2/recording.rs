//! The recording of the two-link experiment: both elbow poses, from the free motion before the impact to that after it.
//!
//! Per elbow pose: `/up/map` (where the tip would reverse), `/up/wall`, `/up/links`, `/up/path/…`,
//! `/up/impulse`, `/up/velocity/…`; time series under `/series`; the table as a text document.

use carom::chain::{Chain, ChainError, Spatial, Workspace};
use carom::record::rerun::{self, RecordingStream, blueprint as view, blueprint::components::PanelState};
use carom::sim::{Moment, free_motion};
use carom::study::{Approach, MapPoint, Part, tangential_map};
use carom_evidence::paper::Run;
use nalgebra::{Vector2, Vector3};
use std::error::Error;
use std::path::Path;

/// Data of one elbow pose.
struct Side<'a> {
    /// The impact.
    run: &'a Run,
    /// Free motion before the impact; the last time is 0 s.
    before: Vec<Moment>,
    /// Free motion after the impact; the first time is 0 s.
    after: Vec<Moment>,
    /// v_t⁺/v_t⁻ over the workspace.
    map: Vec<MapPoint>,
}

const WALL: u32 = 0x9aa4_b2ff;
const LINK: u32 = 0x2f3b_52ff;
const GHOST: u32 = 0x2f3b_5250;
const JOINT: u32 = 0xffff_ffff;
const BEFORE: u32 = 0x1f78_b4ff;
const AFTER: u32 = 0xe31a_1cff;
const IMPULSE: u32 = 0xff7f_00ff;
/// Length of the arrow of 1 N s, m.
const IMPULSE_SCALE: f64 = 0.5;
/// Length of the arrow of 1 m/s, m.
const VELOCITY_SCALE: f64 = 0.8;

/// Writes the recording of the impacts at 0.2 m/s and 45° under a temporary name and then renames it to `path`; `table` is its page of
/// Markdown.
pub fn record(arm: &Chain, runs: &[Run], table: &str, path: &Path) -> Result<(), Box<dyn Error>> {
    let flat = arm.to_planar()?;
    let tip = arm.frame("tip")?;
    // The workspace around the wall, every centimetre.
    let targets = || (0..110).flat_map(|i| (0..121).map(move |k| [-0.15 + 0.01 * i as f64, -0.6 + 0.01 * k as f64]));
    let file = Part::unique(path)?;
    let rec = rerun::RecordingStreamBuilder::new("carom_planar2").save(file.temporary())?;
    let mut pen = Pen { rec: &rec, chain: arm, workspace: arm.workspace() };
    for run in runs.iter().filter(|r| r.speed == 0.2 && r.angle_deg == 45.0) {
        let pose = run.elbow.pose();
        // The arm moves in a horizontal plane, so gravity has no effect. The approach is integrated back in time.
        let motion = |qd: &[f64], end: f64| free_motion(arm, &pose, qd, Vector3::zeros(), end, 151);
        let mut before = motion(&run.qd_minus, -0.6)?;
        before.reverse();
        let after = motion(&run.hit.qd_plus, 0.6)?;
        let approach = Approach { normal: -Vector2::x(), tangent: -Vector2::y(), restitution: run.restitution };
        let map = tangential_map(&flat, tip, [0.45, 0.45], approach, run.elbow.side(), targets())?;
        pen.side(&Side { run, before, after, map })?;
    }
    finish(&rec, table)?;
    drop(rec); // the end of the stream writes the last bytes of the file
    Ok(file.keep()?)
}

fn finish(rec: &RecordingStream, table: &str) -> Result<(), Box<dyn Error>> {
    rec.log_static("table", &rerun::TextDocument::from_markdown(table))?;
    for (elbow, colour) in [("up", BEFORE), ("down", AFTER)] {
        for name in ["tangential", "normal", "energy"] {
            let style = rerun::SeriesLines::new().with_names([format!("{elbow}-elbow")]).with_colors([colour]);
            rec.log_static(format!("series/{name}/{elbow}"), &style.with_widths([2.0]))?;
        }
    }
    let arm = |elbow: &str| {
        view::Spatial2DView::new(format!("{elbow}-elbow: map of the tangential velocity ratio (red: the tip reverses)"))
            .with_origin(elbow.to_owned())
            .with_contents([format!("/{elbow}/**")])
    };
    let series =
        |name: &str, what: &str| view::TimeSeriesView::new(name.to_owned()).with_origin(format!("series/{what}"));
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
    .with_column_shares([5.0, 2.0]);
    let blueprint = view::Blueprint::new(layout)
        .with_auto_views(false)
        .with_selection_panel(view::SelectionPanel::from_state(PanelState::Hidden))
        .with_blueprint_panel(view::BlueprintPanel::from_state(PanelState::Hidden))
        .with_time_panel(
            view::TimePanel::new().with_state(PanelState::Collapsed).with_timeline("time").with_playback_speed(0.1),
        );
    let at_once = view::BlueprintActivation { make_active: true, make_default: true };
    blueprint.send(rec, at_once)?;
    rec.flush_blocking()?;
    Ok(())
}

/// Draws in the plane of the chain, y up.
struct Pen<'a> {
    rec: &'a RecordingStream,
    chain: &'a Chain,
    workspace: Workspace<Spatial<f64>>,
}

/// Coordinates of the viewer, whose y axis points down.
fn screen(p: Vector2<f64>) -> [f32; 2] {
    [p.x as f32, -p.y as f32]
}

impl Pen<'_> {
    /// Base, elbow and tip at `q`.
    fn joints(&mut self, q: &[f64]) -> Result<[Vector2<f64>; 3], ChainError> {
        let frames = [self.chain.frame("link1")?, self.chain.frame("link2")?, self.chain.frame("tip")?];
        let kin = self.workspace.update(self.chain, q)?;
        Ok(frames.map(|f| kin.pose(f).translation.xy()))
    }

    fn side(&mut self, side: &Side) -> Result<(), Box<dyn Error>> {
        let elbow = side.run.elbow.name();
        let at = |what: &str| format!("{elbow}/{what}");
        let rec = self.rec;
        let [_, _, tip] = self.joints(&side.run.elbow.pose())?;
        rec.log_static(at("map"), &map_points(side))?;
        rec.log_static(at("wall"), &wall(tip))?;

        // The path of the tip, and the arm at the first and the last sample.
        for (name, samples, colour) in [("before", &side.before, BEFORE), ("after", &side.after, AFTER)] {
            let path: Result<Vec<_>, ChainError> = samples.iter().map(|s| Ok(screen(self.joints(&s.q)?[2]))).collect();
            let path = strips([path?], colour, 0.003).with_draw_order(35.0);
            rec.log_static(at(&format!("path/{name}")), &path)?;
        }
        for (name, sample) in [("first", side.before.first()), ("last", side.after.last())] {
            let Some(sample) = sample else { continue };
            let ghost = strips([self.joints(&sample.q)?.map(screen).to_vec()], GHOST, 0.012);
            rec.log_static(at(&format!("ghost/{name}")), &ghost.with_draw_order(20.0))?;
        }

        let hit = &side.run.hit;
        let impulse = arrow(tip, hit.impulse.xy() * IMPULSE_SCALE, IMPULSE);
        let label = format!("{:.3} N s", hit.impulse.norm());
        rec.log_static(at("impulse"), &impulse.with_labels([label]).with_draw_order(40.0))?;
        for (name, u, colour) in [("before", hit.u_minus, BEFORE), ("after", hit.u_plus, AFTER)] {
            let velocity = arrow(tip, u.xy() * VELOCITY_SCALE, colour).with_draw_order(45.0);
            rec.log_static(at(&format!("velocity/{name}")), &velocity)?;
        }

        // Times of the viewer start at 0. At the impact the states before and after are logged at the same time.
        let start = side.before.first().map_or(0.0, |s| s.time);
        for sample in side.before.iter().chain(&side.after) {
            rec.set_duration_secs("time", sample.time - start);
            self.moment(elbow, sample)?;
        }
        Ok(())
    }

    /// Logs the arm, the velocities of the tip and the energy at one time.
    fn moment(&mut self, elbow: &str, sample: &Moment) -> Result<(), Box<dyn Error>> {
        let arm = self.joints(&sample.q)?.map(screen);
        let tip = self.chain.point(self.chain.frame("tip")?, Vector3::zeros());
        let mut kin = self.workspace.update(self.chain, &sample.q)?;
        let u = kin.point_velocity(tip, &sample.qd)?;
        let energy = kin.kinetic_energy(&sample.qd)?;
        let links = strips([arm.to_vec()], LINK, 0.018).with_draw_order(30.0);
        let joints = rerun::Points2D::new(arm).with_colors([JOINT]).with_radii([0.012, 0.012, 0.006]);
        self.rec.log(format!("{elbow}/links"), &links)?;
        self.rec.log(format!("{elbow}/joints"), &joints.with_draw_order(31.0))?;
        for (name, value) in [("tangential", -u.y), ("normal", -u.x), ("energy", energy)] {
            self.rec.log(format!("series/{name}/{elbow}"), &rerun::Scalars::single(value))?;
        }
        Ok(())
    }
}

fn strips(strips: impl IntoIterator<Item = Vec<[f32; 2]>>, colour: u32, radius: f32) -> rerun::LineStrips2D {
    rerun::LineStrips2D::new(strips).with_colors([colour]).with_radii([radius])
}

fn arrow(from: Vector2<f64>, along: Vector2<f64>, colour: u32) -> rerun::Arrows2D {
    rerun::Arrows2D::from_vectors([screen(along)])
        .with_origins([screen(from)])
        .with_colors([colour])
        .with_radii([0.005])
}

/// Points of the map by their ratio of tangential velocities. Red: reverses; grey-blue: shrinks; yellow to orange: grows.
fn map_points(side: &Side) -> rerun::Points2D {
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
    let positions = side.map.iter().map(|p| screen(p.tip));
    rerun::Points2D::new(positions)
        .with_colors(side.map.iter().map(|p| colour(p.tangential_ratio)))
        .with_radii([0.0075])
        .with_draw_order(1.0)
}

fn wall(tip: Vector2<f64>) -> rerun::LineStrips2D {
    let at = |y: f64| screen(Vector2::new(tip.x + 0.012, y));
    strips([vec![at(-0.45), at(0.45)]], WALL, 0.008).with_draw_order(10.0)
}
