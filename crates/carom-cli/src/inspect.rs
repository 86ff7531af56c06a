//! `carom inspect`: the content of a URDF file, or a summary of all URDF files in a folder.

use crate::error::CliError;
use crate::input::LoadArgs;
use crate::output::{brief, to_json};
use crate::survey::survey;
use carom_chain::urdf::Repair;
use carom_chain::{Chain, Coordinates, JointInfo, Member};
use carom_sim::Scene;
use clap::Args;
use serde::Serialize;
use std::io::{self, Write};
use std::ops::Range;
use std::path::PathBuf;

/// Print what a URDF file contains: joints, links, degrees of freedom, mass, warnings
///
/// Input: one URDF file, a scene (a file that ends in .toml), or a folder (--all). A scene shows its
/// robots as they are simulated together, and which entries of q and qd belong to each.
/// Output: the robot's name; degrees of freedom; the lengths nq and nv of q and qd; the total mass
/// (kg); whether all motion stays in one plane, with its unit normal or the reason why not; each
/// joint with type, parent link, child link, position limits (rad or m), mimic relation, damping
/// and dry friction (which `simulate` uses), reflected inertia of the rotor; links that move without
/// mass, so that the robot has no dynamics; changes of --repair; warnings; elements of the file that
/// are not used.
/// JSON keys: name, dof, nq, nv, joints, links, total_mass, planar, massless, repairs, warnings;
/// for scenes with several robots robots [{name, q, qd}] with the first entry and the number of
/// entries.
/// With --all, one line for each file: whether it loads (with warnings, partial for robots without
/// dynamics, or refused), degrees of freedom, mass and the first reason; the last line counts them.
/// JSON keys: file, status, name, dof, mass, warnings, reason; at the end counts.
#[derive(Args)]
#[command(verbatim_doc_comment)]
#[command(
    override_usage = "carom inspect [OPTIONS] <ROBOT.urdf|SCENE.toml>\n       carom inspect [OPTIONS] --all <DIR>"
)]
pub struct Inspect {
    /// Robot (URDF file) or scene (TOML file)
    #[arg(value_name = "ROBOT.urdf", required_unless_present = "all", conflicts_with = "all")]
    urdf: Option<PathBuf>,
    /// Summarise every .urdf file in a folder and the folders in it
    #[arg(long, value_name = "DIR")]
    all: Option<PathBuf>,
    /// Add a floating joint `root_joint` between the world and the root link
    #[arg(long)]
    floating: bool,
    #[command(flatten)]
    load: LoadArgs,
    /// Print JSON in one line for each file instead of a table; also holds the limits of velocity
    /// and effort
    #[arg(long, verbatim_doc_comment)]
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
    massless: Vec<&'a str>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    robots: Vec<Part<'a>>,
    repairs: Vec<Change<'a>>,
    warnings: Vec<&'a str>,
}

/// A robot of a scene: the first entry and the number of its entries of q and qd.
#[derive(Serialize)]
struct Part<'a> {
    name: &'a str,
    q: [usize; 2],
    qd: [usize; 2],
}

/// A change of `--repair`.
#[derive(Serialize)]
#[serde(tag = "change", rename_all = "lowercase")]
enum Change<'a> {
    Weld { joint: &'a str, link: &'a str, parent: &'a str, position: f64 },
    Inertia { link: &'a str, before: [f64; 3], after: [f64; 3] },
}

fn change(repair: &Repair) -> Option<Change<'_>> {
    match repair {
        Repair::Welded { joint, link, parent, position } => {
            Some(Change::Weld { joint, link, parent, position: *position })
        }
        Repair::Raised { link, before, after } => Some(Change::Inertia { link, before: *before, after: *after }),
        _ => None,
    }
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
    damping: f64,
    friction: f64,
    rotor_inertia: f64,
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

/// A joint of a chain whose velocity coordinates have these inertias of rotors.
fn joint<'a>(joint: &'a JointInfo, rotors: &[f64]) -> Joint<'a> {
    let rotor_inertia = match &joint.coordinates {
        Coordinates::Own { v, .. } if v.len() == 1 => rotors[v.start],
        _ => 0.0,
    };
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
        damping: joint.damping,
        friction: joint.friction,
        rotor_inertia,
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
        let options = self.load.options(self.floating)?;
        let urdf = match (self.urdf, self.all) {
            (Some(urdf), _) => urdf,
            (None, Some(folder)) => return survey(&folder, &options, self.json, out),
            (None, None) => unreachable!("one of them is required"),
        };
        let chain = if urdf.extension().is_some_and(|ending| ending == "toml") {
            if options != LoadArgs::default().options(false)? {
                let why = "options for loading are keys of the scene: remove them here";
                return Err(CliError::Input(format!("{}: {why}", urdf.display())));
            }
            Scene::from_file(&urdf).map_err(|e| CliError::scene(&urdf, e))?.simulation.chain
        } else {
            Chain::from_urdf_file_with(urdf, &options).map_err(|e| CliError::Input(e.to_string()))?
        };
        let (found, rotors) = (chain.report(), chain.rotor_inertias());
        let entries = |range: &Range<usize>| [range.start, range.len()];
        let report = Report {
            name: chain.name(),
            dof: chain.nv(),
            nq: chain.nq(),
            nv: chain.nv(),
            joints: chain.joints().iter().map(|it| joint(it, &rotors)).collect(),
            links: chain.links().iter().map(|l| l.name.as_str()).collect(),
            total_mass: chain.total_mass(),
            planar: planar(&chain),
            massless: chain.massless_links(),
            robots: (chain.members().iter())
                .map(|Member { name, q, v }| Part { name, q: entries(q), qd: entries(v) })
                .collect(),
            repairs: found.repairs.iter().filter_map(change).collect(),
            warnings: found.warnings.iter().chain(&found.unused).map(String::as_str).collect(),
        };
        if self.json {
            return writeln!(out, "{}", to_json(&report)?).map_err(CliError::Output);
        }
        for_people(&report, &found.repairs, out).map_err(CliError::Output)
    }
}

/// The entries of a robot, counted from 0.
fn entries(first: usize, count: usize) -> String {
    if count == 0 { "none".into() } else { format!("{first} … {}", first + count - 1) }
}

fn for_people(r: &Report, repairs: &[Repair], out: &mut dyn Write) -> io::Result<()> {
    writeln!(
        out,
        "{}: {} degrees of freedom (nq {}, nv {}), {} kg in {} links",
        r.name,
        r.dof,
        r.nq,
        r.nv,
        brief(r.total_mass),
        r.links.len()
    )?;
    for Part { name, q: [q, nq], qd: [v, nv] } in &r.robots {
        writeln!(out, "robot {name}: q {}, qd {}", entries(*q, *nq), entries(*v, *nv))?;
    }
    match (&r.planar.normal, &r.planar.reason) {
        (Some(normal), _) => {
            let [x, y, z] = normal.map(brief);
            writeln!(out, "moves in a plane, normal ({x}, {y}, {z})")?;
        }
        (_, Some(why)) => writeln!(out, "does not move in one plane: {why}")?,
        _ => {}
    }
    let width = |f: fn(&Joint) -> usize| r.joints.iter().map(f).max().unwrap_or(0);
    let (names, parents, children) = (width(|j| j.name.len()), width(|j| j.parent.len()), width(|j| j.child.len()));
    for j in &r.joints {
        let mut line = format!("  {:names$}  {:10}  {:parents$} → {:children$}", j.name, j.kind, j.parent, j.child);
        if let (Some(lower), Some(upper)) = (j.lower, j.upper) {
            line += &format!("  {} … {}", brief(lower), brief(upper));
        }
        if let Some(m) = &j.mimic {
            line += &format!("  = {} · {} + {}", brief(m.multiplier), m.joint, brief(m.offset));
        }
        for (name, value) in [("damping", j.damping), ("friction", j.friction), ("rotor inertia", j.rotor_inertia)] {
            if value != 0.0 {
                line += &format!("  {name} {}", brief(value));
            }
        }
        writeln!(out, "{line}")?;
    }
    if r.joints.iter().any(|j| j.damping != 0.0 || j.friction != 0.0) {
        writeln!(out, "damping and friction of the joints act in simulate; dynamics and impact leave them out")?;
    }
    if !r.massless.is_empty() {
        writeln!(out, "no dynamics, since these links move without mass: {}", r.massless.join(", "))?;
    }
    for repair in repairs {
        writeln!(out, "repaired: {repair}")?;
    }
    for warning in &r.warnings {
        writeln!(out, "warning: {warning}")?;
    }
    Ok(())
}
