//! `carom inspect`: the content of a URDF file.

use crate::RobotArgs;
use crate::error::CliError;
use crate::output::to_json;
use carom_chain::{Chain, Coordinates, JointInfo};
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};

/// Print what a URDF file contains: joints, links, degrees of freedom, mass, warnings
///
/// Input: one URDF file.
/// Output: the robot's name; degrees of freedom; the lengths nq and nv of q and qd; the total mass
/// (kg); whether all motion stays in one plane, with its unit normal or the reason why not; each
/// joint with type, parent link, child link, position limits (rad or m) and mimic relation;
/// warnings for elements of the file that are not used.
/// JSON keys: name, dof, nq, nv, joints, links, total_mass, planar, warnings.
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct Inspect {
    #[command(flatten)]
    robot: RobotArgs,
    /// Print one line of JSON instead of a table; also holds the limits of velocity and effort
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    name: &'a str,
    dof: usize,
    nq: usize,
    nv: usize,
    joints: Vec<Joint<'a>>,
    links: Vec<&'a str>,
    total_mass: f64,
    planar: Planar,
    warnings: &'a [String],
}

#[derive(Serialize)]
struct Joint<'a> {
    name: &'a str,
    #[serde(rename = "type")]
    kind: &'static str,
    parent: &'a str,
    child: &'a str,
    lower: Option<f64>,
    upper: Option<f64>,
    velocity: Option<f64>,
    effort: Option<f64>,
    mimic: Option<Mimic<'a>>,
}

#[derive(Serialize)]
struct Mimic<'a> {
    joint: &'a str,
    multiplier: f64,
    offset: f64,
}

#[derive(Serialize)]
struct Planar {
    is: bool,
    normal: Option<[f64; 3]>,
    reason: Option<String>,
}

fn joint(joint: &JointInfo) -> Joint<'_> {
    let mimic = match &joint.coordinates {
        Coordinates::Follows { joint, multiplier, offset } => {
            Some(Mimic { joint, multiplier: *multiplier, offset: *offset })
        }
        _ => None,
    };
    Joint {
        name: &joint.name,
        kind: joint.kind.name(),
        parent: &joint.parent,
        child: &joint.child,
        lower: joint.limits.lower,
        upper: joint.limits.upper,
        velocity: joint.limits.velocity,
        effort: joint.limits.effort,
        mimic,
    }
}

fn planar(chain: &Chain) -> Planar {
    match chain.to_planar() {
        Ok(flat) => Planar { is: true, normal: Some(flat.plane.normal.into()), reason: None },
        Err(why) => Planar { is: false, normal: None, reason: Some(why.to_string()) },
    }
}

impl Inspect {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        let chain = self.robot.load()?;
        let report = Report {
            name: chain.name(),
            dof: chain.nv(),
            nq: chain.nq(),
            nv: chain.nv(),
            joints: chain.joints().iter().map(joint).collect(),
            links: chain.links().iter().map(|l| l.name.as_str()).collect(),
            total_mass: chain.total_mass(),
            planar: planar(&chain),
            warnings: chain.warnings(),
        };
        if self.json {
            return writeln!(out, "{}", to_json(&report)?).map_err(CliError::Output);
        }
        for_people(&report, out).map_err(CliError::Output)
    }
}

fn for_people(r: &Report, out: &mut dyn Write) -> io::Result<()> {
    writeln!(
        out,
        "{}: {} degrees of freedom (nq {}, nv {}), {} kg in {} links",
        r.name,
        r.dof,
        r.nq,
        r.nv,
        r.total_mass,
        r.links.len()
    )?;
    match (&r.planar.normal, &r.planar.reason) {
        (Some([x, y, z]), _) => writeln!(out, "moves in a plane, normal ({x}, {y}, {z})")?,
        (_, Some(why)) => writeln!(out, "does not move in one plane: {why}")?,
        _ => {}
    }
    let width = |f: fn(&Joint) -> usize| r.joints.iter().map(f).max().unwrap_or(0);
    let (names, parents, children) = (width(|j| j.name.len()), width(|j| j.parent.len()), width(|j| j.child.len()));
    for j in &r.joints {
        write!(out, "  {:names$}  {:10}  {:parents$} → {:children$}", j.name, j.kind, j.parent, j.child)?;
        if let (Some(lower), Some(upper)) = (j.lower, j.upper) {
            write!(out, "  {lower} … {upper}")?;
        }
        if let Some(m) = &j.mimic {
            write!(out, "  = {} · {} + {}", m.multiplier, m.joint, m.offset)?;
        }
        writeln!(out)?;
    }
    for warning in r.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    Ok(())
}
