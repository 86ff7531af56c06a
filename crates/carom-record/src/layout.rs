//! The blueprint: the views that the viewer opens with.
//!
//! It is logged entry by entry, because rerun's blueprint builder cannot set the eye of a 3D view, the visible time range of an
//! entity, or linked time axes.

use crate::RecordError;
use crate::bounds::{Eye, xyz};
use crate::rerun;
use crate::rerun::AsComponents;
use crate::rerun::blueprint::components as part;
use crate::rerun::blueprint::datatypes as datatype;
use crate::rerun::external::re_log_types::{BlueprintActivationCommand, LogMsg};
use crate::target::{APPLICATION, Sink};
use re_sdk_types::blueprint::archetypes as blueprint;

/// A view, or a row or column of tiles with their shares of the space.
pub(crate) enum Tile {
    View(View),
    Row(Vec<(f32, Tile)>),
    Column(Vec<(f32, Tile)>),
}

/// One view: its class, name, the root of the entities it shows, and its settings with their paths below the view.
pub(crate) struct View {
    class: &'static str,
    name: String,
    origin: String,
    settings: Vec<(String, Box<dyn AsComponents>)>,
}

impl View {
    fn new(class: &'static str, name: &str, origin: &str) -> Self {
        Self { class, name: name.into(), origin: origin.into(), settings: Vec::new() }
    }
}

/// A 3D view. Entities of `trails` are shown from the start to the cursor, all others at the cursor.
pub(crate) fn space(name: &str, origin: &'static str, eye: &Eye, trails: &[&str]) -> Tile {
    let mut view = View::new("3D", name, origin);
    view.settings.push(("EyeControls3D".into(), Box::new(controls(eye))));
    view.settings.push(("Background".into(), Box::new(dark())));
    view.settings.push(("LineGrid3D".into(), Box::new(blueprint::LineGrid3D::new().with_visible(false))));
    for trail in trails {
        let past = rerun::datatypes::VisibleTimeRange {
            timeline: "time".into(),
            range: rerun::datatypes::TimeRange {
                start: rerun::datatypes::TimeRangeBoundary::Infinite,
                end: rerun::datatypes::TimeRangeBoundary::AT_CURSOR,
            },
        };
        let place = format!("ViewContents/overrides{trail}/visualizers");
        view.settings.push((place, Box::new(blueprint::VisibleTimeRanges::new([past]))));
    }
    Tile::View(view)
}

/// The 2D view of an image, all of it.
pub(crate) fn image(name: &str, origin: &str) -> Tile {
    Tile::View(View::new("2D", name, origin))
}

/// The 2D view of a diagram, y up, that shows its window.
pub(crate) fn plane(name: &str, origin: &'static str, window: [[f64; 2]; 2]) -> Tile {
    let mut view = View::new("2D", name, origin);
    let [[left, right], [low, high]] = window;
    let (x_range, y_range) = ([left, right].into(), [-high, -low].into());
    let range = rerun::datatypes::Range2D { x_range, y_range };
    view.settings.push(("VisualBounds2D".into(), Box::new(blueprint::VisualBounds2D::new(range))));
    view.settings.push(("Background".into(), Box::new(dark())));
    Tile::View(view)
}

fn dark() -> blueprint::Background {
    blueprint::Background::new(part::BackgroundKind::SolidColor).with_color(0x16_1a21ff)
}

fn controls(eye: &Eye) -> blueprint::EyeControls3D {
    let [position, target, up] = [eye.position, eye.target, eye.up].map(xyz);
    blueprint::EyeControls3D::new().with_position(position).with_look_target(target).with_eye_up(up)
}

/// Time series; all of these views share one time axis. `legend`: whether the names of the lines are shown.
pub(crate) fn series(name: &str, origin: &'static str, legend: bool) -> Tile {
    let mut view = View::new("TimeSeries", name, origin);
    let axis = blueprint::TimeAxis::new().with_link(part::LinkAxis::LinkToGlobal);
    view.settings.push(("TimeAxis".into(), Box::new(axis)));
    view.settings.push(("PlotLegend".into(), Box::new(blueprint::PlotLegend::new().with_visible(legend))));
    Tile::View(view)
}

/// Named states over time.
pub(crate) fn states(name: &str, origin: &'static str) -> Tile {
    Tile::View(View::new("StateTimeline", name, origin))
}

/// The list of events.
pub(crate) fn log(name: &str, origin: &'static str) -> Tile {
    use datatype::TextLogColumnKind::{Body, EntityPath, LogLevel};
    let mut view = View::new("TextLog", name, origin);
    // The columns for entity, level and time are hidden: there is one entity and one level, and the text begins with the time.
    let columns = [(EntityPath, false), (LogLevel, false), (Body, true)];
    let columns = columns.map(|(kind, visible)| datatype::TextLogColumn { visible: visible.into(), kind });
    let time = datatype::TimelineColumn { visible: false.into(), timeline: "time".into() };
    let columns = blueprint::TextLogColumns::new().with_text_log_columns(columns).with_timeline_columns([time]);
    view.settings.push(("TextLogColumns".into(), Box::new(columns)));
    Tile::View(view)
}

/// A text page.
pub(crate) fn text(name: &str, origin: &'static str) -> Tile {
    Tile::View(View::new("TextDocument", name, origin))
}

/// How the viewer moves its cursor.
pub(crate) enum Cursor {
    /// It follows the newest time, of which a replay shows `speed` seconds per second.
    Newest { speed: f64 },
    /// It replays the run, and repeats it from the time `from` to `to`, s.
    Replay { speed: f64, from: f64, to: f64 },
    /// It passes over the rows, `speed` times as fast as 30 rows a second, again and again.
    Rows { speed: f64 },
}

/// Sends a layout.
///
/// # Errors
/// [`RecordError`] of the recorder.
pub(crate) fn send(sink: &Sink, root: &Tile, cursor: &Cursor) -> Result<(), RecordError> {
    let told = || -> rerun::RecordingStreamResult<Vec<LogMsg>> {
        let (rec, messages) = rerun::RecordingStreamBuilder::new(APPLICATION)
            .recording_id(rerun::external::re_log_types::RecordingId::random())
            .enabled(true)
            .blueprint()
            .memory()?;
        rec.set_time_sequence("blueprint", 0);
        let mut page = Page { rec: &rec, count: 0 };
        let (_, root) = page.tile(root)?;
        let viewport = blueprint::ViewportBlueprint::new().with_root_container(rerun::datatypes::Uuid::from(root));
        rec.log("viewport", &viewport.with_auto_layout(false).with_auto_views(false))?;
        for panel in ["blueprint_panel", "selection_panel"] {
            rec.log(panel, &blueprint::PanelBlueprint::new().with_state(part::PanelState::Hidden))?;
        }
        let panel = blueprint::TimePanelBlueprint::new().with_state(part::PanelState::Collapsed);
        let of = |timeline: &str, speed: &f64| panel.clone().with_timeline(timeline).with_playback_speed(*speed);
        let panel = match cursor {
            Cursor::Newest { speed } => of("time", speed).with_play_state(part::PlayState::Following),
            Cursor::Replay { speed, from, to } => {
                let [min, max] = [from, to].map(|time| rerun::datatypes::TimeInt((time * 1e9) as i64));
                let repeated = rerun::datatypes::AbsoluteTimeRange { min, max };
                of("time", speed)
                    .with_play_state(part::PlayState::Playing)
                    .with_loop_mode(part::LoopMode::Selection)
                    .with_time_selection(repeated)
            }
            Cursor::Rows { speed } => {
                of("row", speed).with_play_state(part::PlayState::Playing).with_loop_mode(part::LoopMode::All)
            }
        };
        rec.log("time_panel", &panel)?;
        Ok(messages.take())
    };
    let messages = told().map_err(|e| sink.error(e.to_string()))?;
    if let Some(first) = messages.first() {
        let blueprint_id = first.store_id().clone();
        let at_once = BlueprintActivationCommand { blueprint_id, make_active: true, make_default: true };
        sink.rec.send_blueprint(messages, at_once);
    }
    Ok(())
}

/// Logs tiles, each under a number of its own.
struct Page<'a> {
    rec: &'a rerun::RecordingStream,
    count: u8,
}

impl Page<'_> {
    /// Logs a tile; returns its path and its number.
    fn tile(&mut self, tile: &Tile) -> rerun::RecordingStreamResult<(String, [u8; 16])> {
        let (kind, tiles) = match tile {
            Tile::View(view) => return self.view(view),
            Tile::Row(tiles) => (part::ContainerKind::Horizontal, tiles),
            Tile::Column(tiles) => (part::ContainerKind::Vertical, tiles),
        };
        let mut contents = Vec::new();
        for (_, tile) in tiles {
            contents.push(part::IncludedContent(self.tile(tile)?.0.into()));
        }
        let shares: Vec<f32> = tiles.iter().map(|(share, _)| *share).collect();
        let (path, number) = self.number("container");
        let group = blueprint::ContainerBlueprint::new(kind).with_contents(contents);
        let group = match tile {
            Tile::Row(_) => group.with_col_shares(shares),
            _ => group.with_row_shares(shares),
        };
        self.rec.log(path.as_str(), &group)?;
        Ok((path, number))
    }

    fn view(&mut self, view: &View) -> rerun::RecordingStreamResult<(String, [u8; 16])> {
        let (path, number) = self.number("view");
        let about = blueprint::ViewBlueprint::new(view.class).with_display_name(view.name.as_str());
        self.rec.log(path.as_str(), &about.with_space_origin(view.origin.as_str()))?;
        self.rec.log(format!("{path}/ViewContents"), &blueprint::ViewContents::new(["$origin/**"]))?;
        for (place, setting) in &view.settings {
            self.rec.log(format!("{path}/{place}"), setting.as_ref())?;
        }
        Ok((path, number))
    }

    /// The next number, also in the form of a UUID, by which the viewer identifies views and containers.
    fn number(&mut self, kind: &str) -> (String, [u8; 16]) {
        self.count += 1;
        let mut number = [0; 16];
        number[15] = self.count;
        (format!("{kind}/00000000-0000-0000-0000-0000000000{:02x}", self.count), number)
    }
}
