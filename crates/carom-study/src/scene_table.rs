//! Columns and rows of the tables of a simulation: states, lasting contacts, events, loads on the joints.

use crate::table::Column;
use carom_chain::urdf::JointType;
use carom_chain::{Chain, Coordinates};
use carom_impact::Flags;
use carom_sim::{ContactState, Event, NamedEvent, Simulation, StateError, coordinate_names};
use nalgebra::Vector3;

/// Key of the scene's text in the metadata of Parquet tables.
pub const SCENE_KEY: &str = "carom.scene";

/// Key of the study's text in the metadata of Parquet tables.
pub const STUDY_KEY: &str = "carom.study";

/// Units of the coordinates of a joint, and of its velocities.
fn units(kind: JointType) -> (&'static [&'static str], &'static [&'static str]) {
    match kind {
        JointType::Revolute | JointType::Continuous => (&["rad"], &["rad/s"]),
        JointType::Prismatic => (&["m"], &["m/s"]),
        JointType::Planar => (&["m", "m", "rad"], &["m/s", "m/s", "rad/s"]),
        JointType::Floating => (&["m", "m", "m", "", "", "", ""], &["m/s", "m/s", "m/s", "rad/s", "rad/s", "rad/s"]),
        JointType::Fixed => (&[], &[]),
    }
}

/// Columns `head.JOINT`, or `head.JOINT.K` for a joint of several coordinates: of q (`positions`), or of qd.
pub fn coordinate_columns(chain: &Chain, head: &str, positions: bool) -> Vec<Column> {
    let units = chain.moving_joints().flat_map(|joint| {
        let (q, qd) = units(joint.kind);
        if positions { q } else { qd }
    });
    let names = coordinate_names(chain, head, positions).into_iter();
    names.zip(units).map(|(name, unit)| Column::number(name).in_unit(unit)).collect()
}

/// The columns of a table of states: time, q and qd by joint.
pub fn state_columns(chain: &Chain) -> Vec<Column> {
    let mut columns = vec![Column::number("time").in_unit("s")];
    columns.extend(coordinate_columns(chain, "q", true));
    columns.extend(coordinate_columns(chain, "qd", false));
    columns
}

/// The columns of the forces of the motors, by joint, which follow [`state_columns`].
pub fn motor_columns(chain: &Chain) -> Vec<Column> {
    let mut columns = coordinate_columns(chain, "motor", false);
    columns.iter_mut().for_each(|column| column.unit = if column.unit == "m/s" { "N" } else { "N m" });
    columns
}

/// The columns of the estimated errors of the state, by joint: of q, as a displacement, and of qd. They are the last ones of a table of states.
pub fn error_columns(chain: &Chain) -> Vec<Column> {
    let mut displaced = coordinate_columns(chain, "error.q", false);
    displaced.iter_mut().for_each(|column| column.unit = column.unit.trim_end_matches("/s"));
    displaced.into_iter().chain(coordinate_columns(chain, "error.qd", false)).collect()
}

/// The numbers of [`error_columns`]; NaN without an estimate.
pub fn error_row(chain: &Chain, error: Option<&StateError>) -> Vec<f64> {
    error.map_or_else(|| vec![f64::NAN; 2 * chain.nv()], |error| [&error.q[..], &error.qd].concat())
}

/// Kinds of the rows of a table of loads.
const STRUCK: [&str; 4] = ["impact", "several", "latch", "limit"];

/// The columns of a table of the loads of impacts: time, kind, joint, the impulse through the joint with its moment, and of joints with
/// one coordinate Jᵀp and the forces of the motor before and after.
pub fn load_columns(chain: &Chain) -> Vec<Column> {
    let nothing = chain.joints().is_empty().then(String::new);
    let names = chain.joints().iter().map(|joint| &joint.name).chain(&nothing);
    let mut columns =
        vec![Column::number("time").in_unit("s"), Column::word("kind", STRUCK), Column::word("joint", names)];
    let own = ["joint_impulse", "motor_minus", "motor_plus"];
    let units = [("N s", &["fx", "fy", "fz"][..]), ("N m s", &["mx", "my", "mz"])];
    let own = [("N m s or N s", &own[..1]), ("N m or N", &own[1..])];
    for (unit, names) in units.into_iter().chain(own) {
        columns.extend(names.iter().map(|name| Column::number(*name).in_unit(unit)));
    }
    columns
}

/// The rows of an event for [`load_columns`], one for each joint that moves; none without [loads](Event::loads). Missing numbers are NaN.
pub fn load_rows(chain: &Chain, event: &Event) -> Vec<Vec<f64>> {
    let Some(loads) = &event.loads else { return Vec::new() };
    let kind = STRUCK.iter().position(|kind| *kind == event.kind.name()).map_or(f64::NAN, |k| k as f64);
    let row = |(k, joint): (usize, &carom_chain::JointInfo)| {
        let through = loads.impact.through.iter().find(|own| own.joint == joint.name);
        let v = match &joint.coordinates {
            Coordinates::Own { v, .. } if v.len() == 1 => Some(v.start),
            Coordinates::None => return None,
            _ => None,
        };
        let vectors = through.map_or([Vector3::repeat(f64::NAN); 2], |own| [own.force, own.moment]);
        let of = |numbers: &[f64]| v.map_or(f64::NAN, |v| numbers[v]);
        let own = [&loads.impact.joint_impulse, &loads.motors_minus, &loads.motors_plus].map(|numbers| of(numbers));
        Some(
            [event.time, kind, k as f64]
                .into_iter()
                .chain(vectors.into_iter().flat_map(<[f64; 3]>::from))
                .chain(own)
                .collect(),
        )
    };
    chain.joints().iter().enumerate().filter_map(row).collect()
}

/// Modes of the rows of a table of contacts.
const MODES: [&str; 5] = ["sliding", "sticking", "latched", "pressing", "stepping"];

/// Flags of the rows of a table of contacts.
const FLAGS: [&str; 1] = ["non-unique"];

/// The columns of a table of lasting contacts: time, contact, mode, point, normal, gap, force on the robot, normal force, flags.
pub fn contact_columns(sim: &Simulation) -> Vec<Column> {
    // A column of words needs a word, which no row uses if nothing touches.
    let nothing = sim.touches.is_empty().then(String::new);
    let mut columns = vec![
        Column::number("time").in_unit("s"),
        Column::word("contact", sim.touches.iter().map(|it| &it.name).chain(&nothing)),
        Column::word("mode", MODES),
    ];
    let units = [("m", &["x", "y", "z"][..]), ("", &["nx", "ny", "nz"]), ("m or rad", &["gap"])];
    let forces = [("N", &["fx", "fy", "fz"][..]), ("N or N m", &["normal_force"])];
    for (unit, names) in units.into_iter().chain(forces) {
        columns.extend(names.iter().map(|name| Column::number(*name).in_unit(unit)));
    }
    columns.push(Column::word("flags", FLAGS));
    columns
}

/// The row of a lasting contact, for [`contact_columns`].
pub fn contact_row(time: f64, state: &ContactState) -> Vec<f64> {
    let mode = MODES.iter().position(|mode| *mode == state.mode.name()).unwrap_or(0);
    let mut row = vec![time, state.touch as f64, mode as f64];
    row.extend(state.point.iter().chain(state.normal.iter()).chain([&state.gap]));
    row.extend(state.force.iter().chain([&state.normal_force]));
    // NaN is the empty word.
    row.push(if state.flags.contains(Flags::NON_UNIQUE) { 0.0 } else { f64::NAN });
    row
}

/// The columns and rows of a table of events: a row for each event, of an event of several contacts for each of them; empty words
/// and no numbers (NaN) where an event has none. With errors the last column is `time_error`.
pub fn event_table(chain: &Chain, events: &[NamedEvent], with_errors: bool) -> (Vec<Column>, Vec<Vec<f64>>) {
    let mut words: [Vec<String>; 4] = Default::default();
    let mut code = |column: usize, word: &str| {
        let known = &mut words[column];
        if word.is_empty() {
            return f64::NAN;
        }
        known.iter().position(|it| it == word).unwrap_or_else(|| {
            known.push(word.to_owned());
            known.len() - 1
        }) as f64
    };
    let mut rows = Vec::new();
    for event in events {
        let struck = event.impulses.iter().map(|it| (it.contact, Some(it.what)));
        let without = |name: &&&str| event.impulses.iter().all(|it| it.contact != **name);
        let others = event.contacts.iter().chain(&event.contact).filter(without).map(|name| (*name, None));
        let mut places: Vec<_> = struck.chain(others).collect();
        if places.is_empty() {
            places.push(("", None));
        }
        for (contact, impulse) in places {
            let hit = event.impact.map(|it| it.hit);
            let detail = hit.map_or(event.reason.unwrap_or_default(), |hit| hit.mode.name());
            let flags = hit.map_or(event.flags.join(" "), |hit| hit.flags.names().collect::<Vec<_>>().join(" "));
            let mut row = vec![event.time, code(0, event.kind), code(1, contact), code(2, detail), code(3, &flags)];
            let vectors = [
                impulse.map(|it| it.point),
                impulse.map(|it| it.impulse),
                hit.map(|hit| hit.u_minus),
                hit.map(|hit| hit.u_plus),
            ];
            vectors.iter().for_each(|v| row.extend(v.unwrap_or(Vector3::repeat(f64::NAN)).iter()));
            row.extend(event.qd_minus.iter().chain(event.qd_plus));
            row.extend(with_errors.then_some(event.time_error.unwrap_or(f64::NAN)));
            rows.push(row);
        }
    }
    let mut columns = vec![Column::number("time").in_unit("s")];
    for (name, mut known) in ["event", "contact", "detail", "flags"].into_iter().zip(words) {
        if known.is_empty() {
            known.push(String::new()); // a column of words needs one
        }
        columns.push(Column::word(name, known));
    }
    for (unit, names) in [
        ("m", ["x", "y", "z"]),
        ("N s", ["px", "py", "pz"]),
        ("m/s", ["ux_minus", "uy_minus", "uz_minus"]),
        ("m/s", ["ux_plus", "uy_plus", "uz_plus"]),
    ] {
        columns.extend(names.map(|name| Column::number(name).in_unit(unit)));
    }
    columns.extend(["qd_minus", "qd_plus"].iter().flat_map(|head| coordinate_columns(chain, head, false)));
    columns.extend(with_errors.then(|| Column::number("time_error").in_unit("s")));
    (columns, rows)
}
