//! The controllers of `[run]` in a scene file, and the keys that each of them reads.

use super::file::{Controller, File, Run};
use super::surface::half_space;
use crate::contact::Surface;
use crate::model::{Drive, ImpactInvariant, Transition};
use carom_chain::{Chain, ChainError};
use nalgebra::Vector3;
use std::path::Path;

/// What the controllers of a scene are made from.
pub(crate) struct Drives<'a> {
    pub folder: &'a Path,
    pub file: &'a File,
    pub chain: &'a Chain,
    pub surfaces: &'a [Surface],
    pub qd: &'a [f64],
}

impl Drives<'_> {
    /// The drive of a controller; `asks` is the key that chose it.
    pub fn drive(&self, asks: &str, controller: Controller) -> Result<Drive, String> {
        let run = &self.file.run;
        let needs = |key: &str| format!("[run] {asks} = \"{}\" needs the key {key}", controller.name());
        let number = |key: &str, given: Option<f64>| given.ok_or_else(|| needs(key));
        Ok(match controller {
            Controller::Off => Drive::Off,
            Controller::GravityCompensation => Drive::GravityCompensation,
            Controller::Constant => Drive::Constant(run.torque.clone().ok_or_else(|| needs("torque"))?),
            Controller::TorqueFile => {
                let file = run.torque_file.as_ref().ok_or_else(|| needs("torque_file"))?;
                torque_table(&self.folder.join(file), self.chain.nv())?
            }
            Controller::Pd => Drive::Pd {
                kp: number("kp", run.kp)?,
                kd: number("kd", run.kd)?,
                target: run.target.clone().ok_or_else(|| needs("target"))?,
            },
            Controller::ImpactInvariant => Drive::ImpactInvariant(ImpactInvariant {
                tip: self.file.robot.tip.clone(),
                normal: self.normal("impact-invariant")?,
                kp: number("kp", run.kp)?,
                kd: number("kd", run.kd)?,
                target: run.target.clone().ok_or_else(|| needs("target"))?,
                velocity: vec![0.0; self.chain.nv()],
            }),
            Controller::Transition => Drive::Transition(Transition {
                tip: self.file.robot.tip.clone(),
                normal: self.normal("transition")?,
                velocity: self.velocity().map_err(|e| e.to_string())?,
                gain: number("gain", run.gain)?,
                press: run.press.unwrap_or(0.0),
                compensate: run.compensate.unwrap_or(true),
                restitution: self.surfaces.first().map_or(0.0, |surface| surface.contact.law.restitution()),
            }),
        })
    }

    /// Refuses keys that no chosen controller reads.
    pub fn check_unused(&self) -> Result<(), String> {
        let run: &Run = &self.file.run;
        use Controller::{Constant, ImpactInvariant, Pd, TorqueFile, Transition};
        let readers: [(&str, bool, &[Controller], &str); 8] = [
            ("target", run.target.is_some(), &[Pd, ImpactInvariant], "pd"),
            ("kp", run.kp.is_some(), &[Pd, ImpactInvariant], "pd"),
            ("kd", run.kd.is_some(), &[Pd, ImpactInvariant], "pd"),
            ("torque", run.torque.is_some(), &[Constant], "constant"),
            ("torque_file", run.torque_file.is_some(), &[TorqueFile], "torque-file"),
            ("gain", run.gain.is_some(), &[Transition], "transition"),
            ("press", run.press.is_some(), &[Transition], "transition"),
            ("compensate", run.compensate.is_some(), &[Transition], "transition"),
        ];
        for (key, given, controllers, name) in readers {
            let read = controllers.iter().any(|&c| run.controller == c || run.after_impact == Some(c));
            if given && !read {
                return Err(format!(
                    "[run] {key} is not read by the chosen controller: remove it or set controller = \"{name}\""
                ));
            }
        }
        Ok(())
    }

    fn normal(&self, controller: &str) -> Result<Vector3<f64>, String> {
        half_space(self.surfaces.first()).ok_or_else(|| {
            format!("[run] controller = \"{controller}\" refers to the first surface, which must be a halfspace")
        })
    }

    /// Velocity of the tip at the start.
    fn velocity(&self) -> Result<Vector3<f64>, ChainError> {
        let point = self.chain.point(self.chain.frame(&self.file.robot.tip)?, Vector3::zeros());
        self.chain.workspace().update(self.chain, &self.file.robot.q)?.point_velocity(point, self.qd)
    }
}

/// Times in the first column, joint forces in the others; the first line may be a header.
fn torque_table(path: &Path, joints: usize) -> Result<Drive, String> {
    let refuse = |why: String| format!("[run] torque_file {}: {why}", path.display());
    let text = std::fs::read_to_string(path).map_err(|e| refuse(e.to_string()))?;
    let text = text.trim_start_matches('\u{feff}');
    let (mut times, mut forces): (Vec<f64>, Vec<Vec<f64>>) = (Vec::new(), Vec::new());
    for (k, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let cells = || line.split(',').map(|cell| cell.trim().parse::<f64>());
        let refuse = |why: String| refuse(format!("line {}: {why}", k + 1));
        match cells().collect::<Result<Vec<f64>, _>>() {
            Ok(numbers) if numbers.len() != joints + 1 => {
                let (columns, needed) = (numbers.len(), joints + 1);
                return Err(refuse(format!(
                    "{columns} columns, but {needed} are needed: the time and {joints} joint forces"
                )));
            }
            Ok(numbers) if times.last().is_some_and(|last| numbers[0] <= *last) => {
                return Err(refuse(format!(
                    "time {} is not above that of the previous row: times must ascend",
                    numbers[0]
                )));
            }
            Ok(numbers) if numbers.iter().all(|x| x.is_finite()) => {
                times.push(numbers[0]);
                forces.push(numbers[1..].to_vec());
            }
            Err(_) if k == 0 && cells().all(|cell| cell.is_err()) => {}
            _ => return Err(refuse("every cell must be a finite number, separated by commas".into())),
        }
    }
    if times.is_empty() {
        return Err(refuse("it has no row of numbers: give the time and one joint force for each joint".into()));
    }
    Ok(Drive::Table { times, forces })
}
