//! Writes the paper's figures and table into a folder: SVG, CSV with the data, and a report.

use super::claims::{Claim, claims, claims_of_figures};
use super::simulated::{ANGLE, FRICTION, Forces, RESTITUTION, SPEED, STIFFNESS, TipMotion, forces, motion};
use super::{ANGLES_DEG, Elbow, Run, SPEEDS, experiment, strike};
use crate::EvidenceError;
use crate::consistency::{Findings, consistency, measured_from};
use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, ChainError};
use carom_study::Table;
use serde::Serialize;
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};

/// The default arm, `robots/planar2.urdf`: a stand-in, not the authors' arm.
///
/// # Errors
/// Does not occur: the file is compiled into the program and tested.
pub fn stand_in() -> Result<Chain, ChainError> {
    Chain::from_urdf_str(include_str!("../../data/planar2.urdf"), &LoadOptions::default())
}

/// Impacts at one angle of one elbow at 0.2 m/s.
#[derive(Debug, Clone)]
pub(crate) struct Row {
    /// The impact with Newton's coefficient of Table I.
    pub newton: Run,
    /// The impact with the "energetic coefficient" of Table I in place of Newton's, as in the paper's Figs. 9 and 10.
    pub energy: Run,
    /// √(T⁺/T⁻) of Table I.
    pub measured: f64,
}

impl Row {
    /// √(T⁺/T⁻) of the model.
    pub fn model(&self) -> f64 {
        self.newton.hit.energy_ratio().sqrt()
    }

    /// v_n⁺ by eq. (11) with the energetic coefficient, divided by the measured v_n⁺ (−e v_n⁻ by the definition of Table I's
    /// e).
    pub(super) fn overshoot(&self) -> f64 {
        self.energy.restitution / self.newton.restitution
    }
}

/// The model's results for the paper's figures, table and claims.
#[derive(Debug, Clone, Serialize)]
pub struct Paper {
    /// Name of the arm.
    pub(crate) arm: String,
    /// Always: the arm is not the authors'.
    stand_in: bool,
    /// The names of the files of a report.
    files: Vec<String>,
    /// The claims with their verdicts.
    pub(crate) claims: Vec<Claim>,
    /// All impacts of the experiment, in the order elbow, speed, angle.
    #[serde(rename = "impacts")]
    pub(crate) runs: Vec<Run>,
    /// Impacts for Table I, in the order elbow (up first), angle.
    #[serde(skip)]
    pub(crate) rows: Vec<Row>,
    /// Figs. 4, 6, 7: motion of the tip, elbow up and down.
    #[serde(skip)]
    pub(crate) motions: [TipMotion; 2],
    /// Fig. 5: contact forces, elbow up and down.
    #[serde(skip)]
    pub(crate) forces: [Forces; 2],
    /// Rows of Table I with the results of [`consistency`].
    #[serde(skip)]
    pub(crate) table: Vec<Findings>,
}

/// The figures: name, title, and what the axes show.
pub(super) const FIGURES: [(&str, &str, [&str; 2]); 7] = [
    ("fig4", "Fig. 4: velocity of the tip", ["time, ms", "velocity, m/s"]),
    ("fig5", "Fig. 5: force on the wall, compliant contact", ["time from contact, ms", "force, N"]),
    ("fig6", "Fig. 6: path of the tip", ["position down the wall, mm", "position towards the wall, mm"]),
    (
        "fig7",
        "Fig. 7: normal over tangential velocity",
        ["velocity along the wall, m/s", "velocity into the wall, m/s"],
    ),
    ("fig8", "Fig. 8: kinetic energy loss", ["angle of impact, degrees", "energy loss, mJ"]),
    (
        "fig9",
        "Fig. 9: tangential velocity before and after",
        ["angle of impact, degrees", "velocity along the wall, m/s"],
    ),
    (
        "fig10",
        "Fig. 10: normal velocity before and after",
        ["angle of impact, degrees", "velocity away from the wall, m/s"],
    ),
];
/// The picture and the data of Table I.
const TABLE: &str = "table1";
const REPORT: &str = "report.md";

impl Paper {
    /// Computes all impacts and simulations for an arm with two links and a frame `tip`, whose tip is 0.6364 m from the base in
    /// the poses of [`Elbow::pose`].
    ///
    /// # Errors
    /// [`EvidenceError`] for any other arm.
    pub fn of(arm: &Chain) -> Result<Self, EvidenceError> {
        let [up, down] = Elbow::ALL;
        let mut rows = Vec::new();
        for elbow in Elbow::ALL {
            let measured = elbow.newton().into_iter().zip(elbow.measured_energy_root());
            for (angle, (e, root)) in ANGLES_DEG.into_iter().zip(measured) {
                let struck = |e| strike(arm, elbow, angle, SPEED, e);
                rows.push(Row { newton: struck(e)?, energy: struck(root)?, measured: root });
            }
        }
        let table = measured_from(include_str!("../../data/table1.csv"), Path::new("docs/table1.csv"), None)?;
        let mut paper = Self {
            arm: arm.name().to_owned(),
            stand_in: true,
            files: files(),
            runs: experiment(arm)?,
            rows,
            motions: [motion(arm, up)?, motion(arm, down)?],
            forces: [forces(arm, up, FRICTION)?, forces(arm, down, FRICTION)?],
            table: table.iter().map(consistency).collect(),
            claims: Vec::new(),
        };
        paper.claims = claims(arm, &paper.runs)?;
        paper.claims.extend(claims_of_figures(arm, &paper)?);
        Ok(paper)
    }

    /// The row of an elbow and an angle of [`ANGLES_DEG`].
    pub(super) fn row(&self, elbow: Elbow, angle_deg: f64) -> Option<&Row> {
        self.rows.iter().find(|row| row.newton.elbow == elbow && row.newton.angle_deg == angle_deg)
    }

    /// Writes the figures (SVG), their data (CSV) and `report.md` into a folder. The files are written to a temporary folder
    /// beside it, which is then renamed. An existing folder must be empty or contain all files of a report and nothing else;
    /// it is replaced.
    ///
    /// # Errors
    /// [`EvidenceError`]: the folder contains other files or cannot be written. Its contents are unchanged then.
    pub fn write(&self, folder: &Path) -> Result<(), EvidenceError> {
        let unwritable = |file: &Path| {
            let file = file.to_owned();
            move |reason: io::Error| EvidenceError::of_file(&file, format!("cannot be written: {reason}"))
        };
        let named = folder;
        // resolve symbolic links
        let folder =
            if folder.exists() { folder.canonicalize().map_err(unwritable(named))? } else { folder.to_owned() };
        if let Some(found) = occupied(&folder).map_err(unwritable(named))? {
            let rule = "give a new or empty folder, or the folder of an earlier report, which is replaced";
            return Err(EvidenceError::of_file(named, format!("it contains {found}: {rule}")));
        }
        if std::env::current_dir().is_ok_and(|here| here == folder) {
            let reason = io::Error::other("it is the working directory, which cannot be replaced: give a folder in it");
            return Err(unwritable(named)(reason));
        }
        let beside = |ending: &str| {
            let name = folder.file_name().unwrap_or_default().to_string_lossy();
            folder.with_file_name(format!(".{name}.{}.{ending}", std::process::id()))
        };
        let (part, old) = (Part(beside("part")), beside("old"));
        std::fs::create_dir(&part.0).map_err(unwritable(named))?;
        for name in pictures() {
            let file = part.0.join(format!("{name}.svg"));
            std::fs::write(&file, self.figure(name)?).map_err(unwritable(named))?;
            let (columns, rows) = self.numbers(name);
            let columns: Vec<String> = columns.into_iter().map(str::to_owned).collect();
            let mut table = Table::create(&part.0.join(format!("{name}.csv")), &columns)?;
            rows.iter().try_for_each(|row| table.row(row))?;
            table.finish()?;
        }
        std::fs::write(part.0.join(REPORT), self.report()).map_err(unwritable(named))?;
        let replaced = folder.exists();
        if replaced {
            std::fs::rename(&folder, &old).map_err(unwritable(named))?;
        }
        if let Err(reason) = std::fs::rename(&part.0, &folder) {
            if replaced {
                let _ = std::fs::rename(&old, &folder);
            }
            return Err(unwritable(named)(reason));
        }
        if replaced {
            // one by one, so that no other file is lost that has come into the folder meanwhile
            self.files.iter().for_each(|name| _ = std::fs::remove_file(old.join(name)));
            std::fs::remove_dir(&old).map_err(unwritable(&old))?;
        }
        Ok(())
    }

    /// Prints the claims with their verdicts as text.
    ///
    /// # Errors
    /// Those of `out`.
    pub fn print(&self, folder: &Path, out: &mut dyn io::Write) -> io::Result<()> {
        let arm = &self.arm;
        writeln!(out, "Claims of the paper, and whether {arm} confirms them (a stand-in, not the authors' arm):")?;
        for claim in &self.claims {
            let verdict = if claim.holds { "yes" } else { "NO " };
            writeln!(out, "  {verdict} {}", claim.statement)?;
            writeln!(out, "      {}", claim.evidence)?;
        }
        let report = folder.join(REPORT);
        writeln!(out, "Figures 4 to 10, Table I, the numbers behind them and the report: {}", report.display())
    }

    /// The report, Markdown.
    fn report(&self) -> String {
        let mut text = format!(
            "# Comparison of a model with Pagilla & Yu (2004)\n\n\
             *An Experimental Study of Planar Impact of a Robot Manipulator*, IEEE/ASME Trans. Mechatronics 9 (2004), \
             doi 10.1109/TMECH.2004.823888. Written by `carom paper`; all numbers and verdicts are computed.\n\n\
             The arm is `{}`, a **stand-in, not the authors' arm**, whose geometry, inertia and joint angles are not \
             published. Base and tip lie on the normal of the wall, and the two elbows are mirror images. The impact is rigid \
             and frictionless, eqs. (10) to (15), with Newton's coefficient e of Table I (measured at {SPEED} m/s, used at all \
             speeds). E is the energetic coefficient of the paper, √(T⁺/T⁻) of eq. (16): the root of a ratio of kinetic \
             energies, not Stronge's coefficient.\n\n",
            self.arm
        );
        let confirmed = self.claims.iter().filter(|claim| claim.holds).count();
        let _ = writeln!(text, "## Claims: {confirmed} of {} confirmed\n", self.claims.len());
        text += "| claim of the paper | source | model | numbers |\n| --- | --- | --- | --- |\n";
        for Claim { place, statement, holds, evidence } in &self.claims {
            let verdict = if *holds { "confirmed" } else { "**not confirmed**" };
            let cells = [statement, *place, verdict, evidence].map(|cell| cell.replace('|', "\\|"));
            let _ = writeln!(text, "| {} |", cells.join(" | "));
        }
        text += "\nThe magnitudes in Figs. 4 to 10 cannot be compared: the paper gives no velocities, forces, paths or energies \
                 as numbers. Table I has its only printed measurements.\n\n";
        for (name, title, _) in FIGURES {
            let caption = self.caption(name);
            let _ = writeln!(text, "## {title}\n\n![{title}]({name}.svg)\n\n{caption} ([data]({name}.csv))\n");
        }
        text += &self.table1();
        text
    }

    /// Caption of a figure.
    fn caption(&self, figure: &str) -> String {
        let [up, down] = &self.motions;
        let sides = |m: &TipMotion| {
            let after = m.states.iter().rposition(|s| s.time == 0.0).unwrap_or_default();
            (m.states[after.saturating_sub(1)], m.states[after])
        };
        let ((up_before, up_after), (down_before, down_after)) = (sides(up), sides(down));
        let jump = |name: &str, before: f64, after: f64| format!("{name} from {before:.5} to {after:.5} m/s");
        match figure {
            "fig4" => format!(
                "{SPEED} m/s, {ANGLE}°, e = {RESTITUTION}. Lines: model; dots: model at the paper's sampling interval of 4 ms. \
                 Velocity along the wall: {} and {}; into the wall: {}.",
                jump("up-elbow", up_before.tangential, up_after.tangential),
                jump("down-elbow", down_before.tangential, down_after.tangential),
                jump("both", up_before.normal, up_after.normal)
            ),
            "fig5" => {
                let of = |forces: &Forces| {
                    let [normal, tangential] = forces.impulse();
                    format!(
                        "{}-elbow: peak {:.1} N, duration {:.3} ms, normal and tangential impulse {normal:.5} and \
                         {tangential:.5} N s",
                        forces.elbow.name(),
                        forces.peak(),
                        forces.duration() * 1e3
                    )
                };
                format!(
                    "Compliant contact, as a rigid impact has no finite force: Hunt and Crossley, {STIFFNESS:e} N/m^1.5, with \
                     the damping that gives Stronge's coefficient {RESTITUTION}, friction {FRICTION}. The stiffness, which \
                     determines duration and peak, and the friction are chosen here, not taken from the paper. {}; {}. With a \
                     sampling interval of 4 ms such a force appears in one sample at most.",
                    of(&self.forces[0]),
                    of(&self.forces[1])
                )
            }
            "fig6" => "The origin is the point of impact; dots every 4 ms.".into(),
            "fig7" => format!("Dots: {} samples around the impact, 4 ms apart; lines: model.", up.samples.len()),
            "fig8" => {
                let lost = |speed: f64| {
                    let of = self.runs.iter().filter(|run| run.speed == speed).map(|run| run.hit.energy_loss() * 1e3);
                    of.fold((f64::MAX, 0.0_f64), |(least, most), x| (least.min(x), most.max(x)))
                };
                let each = SPEEDS.map(|speed| {
                    let (least, most) = lost(speed);
                    format!("{least:.3} to {most:.3} mJ at {speed} m/s")
                });
                format!("Energy loss {}; with e of Table I, measured at {SPEED} m/s, at all speeds.", each.join(", "))
            }
            "fig9" => "Velocity along the wall by eq. (15), with e and with E in place of e. The paper does not print the \
                       measured velocities."
                .into(),
            _ => "Velocity away from the wall. \"Measured\" is −e v_n⁻, the definition of e in Table I, eq. (11); \"with E\" is \
                  eq. (11) with E in place of e, as in the paper."
                .into(),
        }
    }

    /// Section on Table I: comparison with the model, and the consistency test.
    fn table1(&self) -> String {
        let mut text = "## Table I\n\n".to_owned();
        text += "| elbow | angle | e | E of Table I | E of the model | difference |\n| --- | --- | --- | --- | --- | --- |\n";
        for row in &self.rows {
            let (run, model) = (&row.newton, row.model());
            let _ = writeln!(
                text,
                "| {} | {}° | {} | {} | {model:.4} | {:+.4} |",
                run.elbow.name(),
                run.angle_deg,
                run.restitution,
                row.measured,
                model - row.measured
            );
        }
        text += "\n### Consistency with any arm\n\nBy eqs. (10) to (16), Y = √((1−e²)/(1−E²) − 1) equals |cot α − h|/√D for \
                 every arm, with h = tᵀHn/nᵀHn and D = det H/(nᵀHn)², so Y is a V-shaped function of cot α. Result of `carom \
                 consistency docs/table1.csv`:\n\n\
                 ![Consistency of energies](table1.svg)\n\n";
        for found in &self.table {
            let _ = writeln!(text, "**{}**\n", found.row);
            for sentence in &found.verdict {
                let _ = writeln!(text, "- {sentence}");
            }
            text.push('\n');
        }
        text += "The test assumes rigid, frictionless impacts with Newton's coefficient. The authors themselves call the values \
                 of the table not consistent.\n";
        text
    }
}

/// The names of the pictures, which are those of their data.
fn pictures() -> impl Iterator<Item = &'static str> {
    FIGURES.iter().map(|(name, ..)| *name).chain([TABLE])
}

/// The names of the files of a report.
fn files() -> Vec<String> {
    let of = |name| [format!("{name}.svg"), format!("{name}.csv")];
    pictures().flat_map(of).chain([REPORT.to_owned()]).collect()
}

/// Why a folder is neither new nor empty nor that of a report.
fn occupied(folder: &Path) -> io::Result<Option<String>> {
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        entries => entries?,
    };
    let known = files();
    let mut found = Vec::new();
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !known.contains(&name) || !entry.file_type()?.is_file() {
            return Ok(Some(format!("'{name}', which is not a file of this report")));
        }
        found.push(name);
    }
    // A file of this name alone may be anybody's.
    let missing = known.iter().find(|name| !found.contains(name));
    Ok(found
        .first()
        .zip(missing)
        .map(|(name, missing)| format!("'{name}' but not '{missing}', so it is no whole report")))
}

/// A temporary folder, removed on drop unless it was renamed.
struct Part(PathBuf);

impl Drop for Part {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
