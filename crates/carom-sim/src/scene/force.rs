//! The forces from outside, `[[force]]`.

use super::file;
use super::table::Columns;
use crate::model::{Load, Wrench};
use crate::state::Profile;
use carom_chain::Chain;
use std::path::Path;

/// A table of N numbers over time; missing columns are zero.
pub(crate) fn profile<const N: usize>(path: &Path, columns: [&str; N], what: &str) -> Result<Profile<N>, String> {
    let columns = columns.map(str::to_owned);
    let (times, rows) = Columns::named(path, &columns)?.pick(&columns, false, what)?;
    let rows: Vec<[f64; N]> = rows.iter().map(|row| std::array::from_fn(|i| row[i])).collect();
    Profile::new(&times, &rows).map_err(|e| e.to_string())
}

pub(crate) fn wrench(folder: &Path, chain: &Chain, k: usize, given: &file::Force) -> Result<Wrench, String> {
    let refuse = |why: String| format!("[[force]] {}: {why}", k + 1);
    let file::Force { link, point, axes, force, torque, file, .. } = given;
    let constant = force.is_some() || torque.is_some();
    let load = match file {
        Some(_) if constant => {
            return Err(refuse("has file and a constant force or torque: give a table of its own to each".into()));
        }
        Some(name) => {
            let (path, columns) = (folder.join(name), ["fx", "fy", "fz", "tx", "ty", "tz"]);
            let table = profile(&path, columns, "force or torque");
            Load::Table(table.map_err(|why| refuse(format!("file {}: {why}", path.display())))?)
        }
        None if constant => {
            Load::Constant { force: force.unwrap_or_default().into(), torque: torque.unwrap_or_default().into() }
        }
        None => return Err(refuse("needs force, torque or both, or else file (a table over time)".into())),
    };
    let wrench = Wrench { link: link.clone(), point: (*point).into(), axes: *axes, load };
    wrench.check(chain).map_err(|e| refuse(e.to_string()))?;
    Ok(wrench)
}
