//! The forces from outside, `[[force]]`, and the loops of the mechanism, `[[loop]]`.

use super::file;
use super::keys::Numbers;
use super::table::Columns;
use crate::model::{Load, Loop, LoopFrame, LoopJoint, Wrench};
use crate::state::Profile;
use carom_chain::Chain;
use std::path::Path;

/// A table of N numbers over time; missing columns are zero.
pub(crate) fn profile<const N: usize>(path: &Path, columns: [&str; N], what: &str) -> Result<Profile<N>, String> {
    let columns = columns.map(str::to_owned);
    let (times, rows) = Columns::named(path, &columns)?.pick(&columns, |_| true, what)?;
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

/// Why a force does nothing in a run of this duration.
pub(crate) fn idle(wrench: &Wrench, chain: &Chain, duration: f64) -> Option<String> {
    let link = &wrench.link;
    if chain.frame(link).is_ok_and(|frame| chain.point(frame, wrench.point).body.is_none()) {
        return Some(format!("{link} is fixed to the world: no force moves it"));
    }
    wrench.is_idle(duration).then(|| format!("the table of {link} is zero at all times of the run, 0 to {duration} s"))
}

/// The `k`-th loop of a scene.
pub(crate) fn closure(chain: &Chain, k: usize, given: &file::Loop) -> Result<Loop, String> {
    let name = given.name.clone().unwrap_or_else(|| format!("loop {}", k + 1));
    let refuse = |why: String| format!("[[loop]] {}: {why}", k + 1);
    let joint = match (given.joint, given.axis) {
        (file::LoopJoint::Pin, axis) => LoopJoint::Pin { axis: axis.unwrap_or(Numbers([0.0, 0.0, 1.0])).into() },
        (_, Some(_)) => return Err(refuse("has an axis, which only joint = \"pin\" has: remove it".into())),
        (file::LoopJoint::Point, None) => LoopJoint::Point,
        (file::LoopJoint::Weld, None) => LoopJoint::Weld,
    };
    let frame = |given: &file::LoopFrame| LoopFrame::new(given.link.as_deref(), *given.xyz, *given.rpy);
    let own = Loop { name, joint, frames: [frame(&given.first), frame(&given.second)] };
    own.check(chain).map_err(|e| refuse(e.to_string()))?;
    Ok(own)
}
