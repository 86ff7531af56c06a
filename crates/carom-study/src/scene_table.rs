//! Columns and rows of the tables of a simulation: states, and lasting contacts.

use crate::table::Column;
use carom_chain::urdf::JointType;
use carom_chain::{Chain, Coordinates};
use carom_impact::Flags;
use carom_sim::{ContactState, Simulation};

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
    let own = chain.joints().iter().filter(|joint| matches!(joint.coordinates, Coordinates::Own { .. }));
    let of = |joint: &carom_chain::JointInfo| -> Vec<Column> {
        let (q, qd) = units(joint.kind);
        let units = if positions { q } else { qd };
        let name = |k: usize| match units.len() {
            1 => format!("{head}.{}", joint.name),
            _ => format!("{head}.{}.{k}", joint.name),
        };
        units.iter().enumerate().map(|(k, unit)| Column::number(name(k)).in_unit(unit)).collect()
    };
    own.flat_map(of).collect()
}

/// The columns of a table of states: time, q and qd by joint.
pub fn state_columns(chain: &Chain) -> Vec<Column> {
    let mut columns = vec![Column::number("time").in_unit("s")];
    columns.extend(coordinate_columns(chain, "q", true));
    columns.extend(coordinate_columns(chain, "qd", false));
    columns
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
