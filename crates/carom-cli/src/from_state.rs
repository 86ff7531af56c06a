//! `carom simulate --from-state`: the start of a scene from a file.
//!
//! A state is q, q̇ and a time. What a run remembers besides, as which robots an impact has hit, is not part of it.

use crate::error::CliError;
use crate::output::say;
use carom_chain::Coordinates;
use carom_sim::Scene;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::path::Path;

/// What is read of the answer of `carom simulate --json`, whose last state it is.
#[derive(Deserialize)]
struct Summary {
    joints: Vec<String>,
    r#final: State,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    time: Option<f64>,
    q: Vec<f64>,
    qd: Vec<f64>,
    /// Those of an answer, which follow from the state.
    #[serde(rename = "contacts")]
    _contacts: Option<IgnoredAny>,
}

/// Replaces the start of a scene, and its time if the file gives one, and warns where the end of a run does not determine how it goes
/// on.
pub fn apply(path: &Path, scene: &mut Scene) -> Result<(), CliError> {
    let refuse = |why: String| CliError::Input(format!("--from-state {}: {why}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|e| CliError::unreadable(path.display(), &e))?;
    let text = text.trim_start_matches('\u{feff}').trim();
    let unread = |e: serde_json::Error| {
        refuse(format!(
            "{e}: it must be an object with q and qd, and time if wanted, or the answer of carom simulate --json"
        ))
    };
    let keys: BTreeMap<String, IgnoredAny> = serde_json::from_str(text).map_err(unread)?;
    let chain = &scene.simulation.chain;
    let (mut q, mut qd) = (scene.q.clone(), scene.qd.clone());
    let time = match keys.contains_key("final") {
        false => {
            let state: State = serde_json::from_str(text).map_err(unread)?;
            (q, qd) = (state.q, state.qd);
            state.time
        }
        // The plan of the run may have left joints out; they start as the scene says.
        true => {
            let Summary { joints, r#final: last } = serde_json::from_str(text).map_err(unread)?;
            let (mut from_q, mut from_qd) = (last.q.iter(), last.qd.iter());
            for name in &joints {
                let joint = chain.joint(name).map_err(|e| refuse(e.to_string()))?;
                let Coordinates::Own { q: own_q, v: own_v } = &joint.coordinates else { continue };
                let short = || refuse(format!("final has fewer numbers than the joints {} need", joints.join(", ")));
                for k in own_q.clone() {
                    q[k] = *from_q.next().ok_or_else(short)?;
                }
                for k in own_v.clone() {
                    qd[k] = *from_qd.next().ok_or_else(short)?;
                }
            }
            if from_q.next().is_some() || from_qd.next().is_some() {
                return Err(refuse(format!("final has more numbers than the joints {} need", joints.join(", "))));
            }
            last.time
        }
    };
    chain.check_state(&q, &qd).map_err(|e| refuse(e.to_string()))?;
    if let Some(time) = time.filter(|time| !time.is_finite()) {
        return Err(refuse(format!("time is {time}: it must be finite")));
    }
    let simulation = &scene.simulation;
    let file = path.display();
    if simulation.after_impact.is_some() {
        say(&format!(
            "warning: --from-state {file}: after_impact acts from the first impact after this state on, whether or not there was one \
             before: make it the controller to go on after an impact"
        ));
    }
    if simulation.touches.iter().any(|touch| touch.contact.compliance.is_some()) {
        say(&format!(
            "warning: --from-state {file}: compliant contacts that press begin anew, with the damping of their present approach and \
             without deflection of bristles"
        ));
    }
    let start = time.unwrap_or(0.0);
    scene.simulation.start_time = start;
    (scene.q, scene.qd) = (q, qd);
    Ok(())
}
