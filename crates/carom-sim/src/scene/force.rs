//! The forces from outside, `[[force]]`, and the springs of joints, `[[spring]]`.

use super::file;
use super::table::Columns;
use crate::model::{Load, Spring, Wrench, WrenchAxes};
use crate::state::Profile;
use carom_chain::Chain;
use std::path::Path;

/// A table of N numbers over time; missing columns are zero.
pub(crate) fn profile<const N: usize>(path: &Path, columns: [&str; N], what: &str) -> Result<Profile<N>, String> {
    let table = Columns::read(path)?;
    if !table.has_names() {
        return Err(format!("the first line must name the columns: time, {}", columns.join(", ")));
    }
    let (times, rows) = table.pick(&columns.map(str::to_owned), true, what)?;
    let rows: Vec<[f64; N]> = rows.iter().map(|row| std::array::from_fn(|i| row[i])).collect();
    Profile::new(&times, &rows).map_err(|e| e.to_string())
}

pub(crate) fn wrench(folder: &Path, chain: &Chain, k: usize, given: &file::Force) -> Result<Wrench, String> {
    let refuse = |why: String| format!("[[force]] {}: {why}", k + 1);
    let file::Force { link, point, axes, force, torque, file } = given;
    let load = match (file, force, torque) {
        (Some(_), None, None) | (None, ..) => match file {
            Some(name) => {
                let columns = ["fx", "fy", "fz", "tx", "ty", "tz"];
                let table = profile(&folder.join(name), columns, "force or torque");
                Load::Table(table.map_err(|why| refuse(format!("file {}: {why}", folder.join(name).display())))?)
            }
            None if force.is_none() && torque.is_none() => {
                return Err(refuse("needs force, torque or both, or else file (a table over time)".into()));
            }
            None => {
                Load::Constant { force: force.unwrap_or_default().into(), torque: torque.unwrap_or_default().into() }
            }
        },
        _ => return Err(refuse("has file and a constant force or torque: give a table of its own to each".into())),
    };
    let axes = match axes {
        file::Axes::World => WrenchAxes::World,
        file::Axes::Body => WrenchAxes::Body,
    };
    let wrench = Wrench { link: link.clone(), point: (*point).into(), axes, load };
    wrench.check(chain).map_err(|e| refuse(e.to_string()))?;
    Ok(wrench)
}

pub(crate) fn spring(chain: &Chain, k: usize, given: &file::Spring) -> Result<Spring, String> {
    let file::Spring { joint, rest, stiffness, damping } = given;
    let spring = Spring { joint: joint.clone(), rest: *rest, stiffness: *stiffness, damping: *damping };
    spring.on(chain).map_err(|e| format!("[[spring]] {}: {e}", k + 1))?;
    Ok(spring)
}
