//! Feedback along the motion of a scene: the scene file with it, the table of its gains, and what it does to small disturbances.

use crate::aim::names_of_motors;
use crate::moved_scene::keys_in;
use carom_sim::{Drive, Feedback, Plan, Regulator, Scene, Sensitivity, SimError};
use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use std::path::Path;

/// A scene with feedback along its motion.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Tracked {
    /// The text of the scene file.
    #[serde(skip)]
    pub scene: String,
    /// The table of the reference and the gains (CSV).
    #[serde(skip)]
    pub table: String,
    /// Number of its rows.
    pub rows: usize,
    /// The joints whose motors have feedback.
    pub motors: Vec<String>,
    /// The number of impacts of the motion.
    pub impacts: usize,
    /// What becomes of small disturbances of the start.
    pub growth: Growth,
}

/// The largest factor by which a small disturbance of the start grows until the end, each number in units of the deviations of the [`Regulator`].
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Growth {
    /// Of the motion of the scene. Serde leaves out what is `None`: a motion without derivatives.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub without: Option<f64>,
    /// With the feedback.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with: Option<f64>,
}

/// Feedback along the motion of a scene, with [`Plan::feedback`], for a scene file in this folder and a table of this name beside it.
///
/// # Errors
/// As [`Plan::feedback`]; [`SimError::Scene`] if the text of the scene cannot be written again.
pub fn tracked(
    (scene, plan): (&Scene, &Plan),
    regulator: &Regulator,
    (folder, table): (&Path, &str),
) -> Result<Tracked, SimError> {
    let feedback = plan.feedback(scene.duration, regulator)?;
    let chain = &plan.simulation.chain;
    let unread = |rule| SimError::Scene { file: "the scene that is written".into(), rule };
    let mut keys = keys_in(scene, folder).map_err(unread)?;
    if let Some(run) = keys.get_mut("run").and_then(toml::Value::as_table_mut) {
        run.insert("controller".into(), "feedback".into());
        run.insert("feedback_file".into(), table.into());
    }
    let text = toml::to_string(&keys).map_err(|e| unread(e.to_string()))?;
    let mut lines = format!("time,{}\n", Feedback::columns(chain).join(","));
    for row in feedback.table(chain) {
        lines += &row.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        lines.push('\n');
    }
    let mut fed = plan.clone();
    let has = |joint: &String| {
        let at = chain.joint(joint).ok().and_then(|joint| chain.coordinate_of(joint));
        at.is_some_and(|at| feedback.rows.iter().any(|row| row.gains.row(at.v).amax() > 0.0))
    };
    let motors = names_of_motors(scene).into_iter().filter(has).collect();
    let (count, impacts) = (feedback.rows.len(), feedback.rows.last().map_or(0, |row| row.impacts));
    fed.simulation.drive = Drive::Feedback(feedback);
    let of = |plan: &Plan| Ok::<_, SimError>(growth(&plan.sensitivity(scene.duration, &[])?, regulator));
    let growth = Growth { without: of(plan)?, with: of(&fed)? };
    Ok(Tracked { scene: text, table: lines, rows: count, motors, impacts, growth })
}

/// The largest singular value of the derivatives of the end by the start.
fn growth(sensitivity: &Sensitivity, regulator: &Regulator) -> Option<f64> {
    let by = sensitivity.last_by.as_ref()?;
    let nv = by.nrows() / 2;
    let unit = DVector::from_fn(2 * nv, |i, _| if i < nv { regulator.position } else { regulator.velocity });
    let scaled = DMatrix::from_fn(2 * nv, 2 * nv, |i, j| by[(i, j)] * unit[j] / unit[i]);
    Some(scaled.tr_mul(&scaled).symmetric_eigenvalues().max().max(0.0).sqrt())
}
