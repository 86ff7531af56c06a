//! The paper's figures and table as a folder: SVG, the numbers behind as CSV, and a report that ties them together.

use super::claims::{Claim, claims, claims_of_figures};
use super::figures::title;
use super::simulated::{ANGLE, FRICTION, Forces, RESTITUTION, SPEED, STIFFNESS, TipMotion, forces, motion};
use super::{ANGLES_DEG, Elbow, Run, SPEEDS, experiment, strike};
use crate::consistency::{Findings, MeasuredRow, consistency, measured_from};
use crate::table::{Table, TableError};
use carom_chain::urdf::LoadOptions;
use carom_chain::{Chain, ChainError};
use carom_sim::SimError;
use std::fmt::Write;
use std::io;
use std::path::{Path, PathBuf};

/// Why there are no figures.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PaperError {
    /// The arm can't be struck as the paper's was.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// The simulated arm does not do what the figures show.
    #[error(
        "{elbow}-elbow: the tip of this arm does not meet the wall and leave it: give an arm like robots/planar2.urdf"
    )]
    Missed {
        /// Which elbow.
        elbow: &'static str,
    },
    /// A table can't be written.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A figure can't be drawn.
    #[error("{0}")]
    Figure(String),
    /// The folder holds something else.
    #[error(
        "{folder}: there is '{found}' in it, which is none of this report's files: choose a new or empty folder, or one of an earlier report, which is replaced"
    )]
    Occupied {
        /// The folder.
        folder: PathBuf,
        /// What is in it.
        found: String,
    },
    /// The file system says no.
    #[error("{file}: cannot be written: {reason}")]
    Unwritable {
        /// File or folder.
        file: PathBuf,
        /// What was said.
        reason: io::Error,
    },
}

impl From<ChainError> for PaperError {
    fn from(error: ChainError) -> Self {
        Self::Sim(error.into())
    }
}

/// The preset: a stand-in, not the authors' arm (`robots/planar2.urdf`).
///
/// # Errors
/// None: the file is part of the program and tested.
pub fn stand_in() -> Result<Chain, ChainError> {
    Chain::from_urdf_str(include_str!("../../../../robots/planar2.urdf"), &LoadOptions::default())
}

/// One angle of one elbow at 0.2 m/s.
#[derive(Debug, Clone)]
pub struct Row {
    /// With Table I's Newton coefficient.
    pub newton: Run,
    /// With Table I's "energetic" one in its place, as the paper's Figs. 9 and 10 do.
    pub energy: Run,
    /// √(T⁺/T⁻) as Table I has it.
    pub measured: f64,
}

impl Row {
    /// √(T⁺/T⁻) of the model.
    pub fn model(&self) -> f64 {
        self.newton.hit.energy_ratio().sqrt()
    }

    /// What eq. (11) with the energetic coefficient predicts, over what was measured: v_n⁺ is −e v_n⁻ by the definition of
    /// Table I's e.
    pub(super) fn overshoot(&self) -> f64 {
        self.energy.restitution / self.newton.restitution
    }
}

/// Everything that the paper shows, computed.
#[derive(Debug, Clone)]
pub struct Paper {
    /// Name of the arm.
    pub arm: String,
    /// All impacts, elbow by speed by angle.
    pub runs: Vec<Run>,
    /// Table I, up first.
    pub rows: Vec<Row>,
    /// Figs. 4, 6, 7: up and down.
    pub motions: [TipMotion; 2],
    /// Fig. 5: up and down.
    pub forces: [Forces; 2],
    /// Table I and what the inverse problem says of it.
    pub table: Vec<(MeasuredRow, Findings)>,
    /// Claim by claim.
    pub claims: Vec<Claim>,
}

const FIGURES: [&str; 8] = ["fig4", "fig5", "fig6", "fig7", "fig8", "fig9", "fig10", "table1"];
const REPORT: &str = "report.md";

impl Paper {
    /// Strikes and simulates the arm: two links and a frame `tip`, reaching 0.6364 m in the poses of [`Elbow::pose`].
    ///
    /// # Errors
    /// [`PaperError`]: an arm that is none such.
    pub fn of(arm: &Chain) -> Result<Self, PaperError> {
        let [up, down] = Elbow::BOTH;
        let mut rows = Vec::new();
        for elbow in Elbow::BOTH {
            let measured = elbow.newton().into_iter().zip(elbow.measured_energy_root());
            for (angle, (e, root)) in ANGLES_DEG.into_iter().zip(measured) {
                let struck = |e| strike(arm, elbow, angle, SPEED, e);
                rows.push(Row { newton: struck(e)?, energy: struck(root)?, measured: root });
            }
        }
        let table = measured_from(include_str!("../../../../docs/table1.csv"), Path::new("docs/table1.csv"), None);
        let table = table.map_err(|e| PaperError::Figure(e.to_string()))?;
        let mut paper = Self {
            arm: arm.name().to_owned(),
            runs: experiment(arm)?,
            rows,
            motions: [motion(arm, up)?, motion(arm, down)?],
            forces: [forces(arm, up, FRICTION)?, forces(arm, down, FRICTION)?],
            table: table.into_iter().map(|row| (row.clone(), consistency(&row))).collect(),
            claims: Vec::new(),
        };
        paper.claims = claims(arm, &paper.runs)?;
        paper.claims.extend(claims_of_figures(arm, &paper)?);
        Ok(paper)
    }

    /// The row of an elbow and an angle.
    pub fn row(&self, elbow: Elbow, angle_deg: f64) -> Option<&Row> {
        self.rows.iter().find(|row| row.newton.elbow == elbow && row.newton.angle_deg == angle_deg)
    }

    /// Names of all files of a report.
    pub fn files() -> Vec<String> {
        let of = |name: &&str| [format!("{name}.svg"), format!("{name}.csv")];
        FIGURES.iter().flat_map(of).chain([REPORT.to_owned()]).collect()
    }

    /// Writes figures (SVG), the numbers behind them (CSV) and `report.md` into a folder. It is filled beside its place and
    /// moved there whole. A folder that is there already must be empty or hold an earlier report and nothing else, which
    /// is replaced.
    ///
    /// # Errors
    /// [`PaperError`]: a folder with something else in it, or that can't be written. What was there before stays then.
    pub fn write(&self, folder: &Path) -> Result<(), PaperError> {
        let unwritable = |file: &Path| {
            let file = file.to_owned();
            move |reason| PaperError::Unwritable { file, reason }
        };
        let named = folder;
        // the folder itself, where the name is a link to it
        let folder =
            if folder.exists() { folder.canonicalize().map_err(unwritable(named))? } else { folder.to_owned() };
        if let Some(found) = occupied(&folder).map_err(unwritable(named))? {
            return Err(PaperError::Occupied { folder: named.to_owned(), found });
        }
        if std::env::current_dir().is_ok_and(|here| here == folder) {
            let reason = io::Error::other("it is the working directory, which can't be replaced: name a folder in it");
            return Err(unwritable(named)(reason));
        }
        let beside = |ending: &str| {
            let name = folder.file_name().unwrap_or_default().to_string_lossy();
            folder.with_file_name(format!(".{name}.{}.{ending}", std::process::id()))
        };
        let (part, old) = (Part(beside("part")), beside("old"));
        std::fs::create_dir(&part.0).map_err(unwritable(named))?;
        for name in FIGURES {
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
            std::fs::remove_dir_all(&old).map_err(unwritable(&old))?;
        }
        Ok(())
    }

    /// The report, Markdown.
    fn report(&self) -> String {
        let mut text = format!(
            "# What a model says of Pagilla & Yu (2004)\n\n\
             *An Experimental Study of Planar Impact of a Robot Manipulator*, IEEE/ASME Trans. Mechatronics 9 (2004), \
             doi 10.1109/TMECH.2004.823888. Written by `carom paper`; every number and verdict here is computed.\n\n\
             The arm is `{}`, a **stand-in, not the authors' arm**: no geometry, inertia or joint angle of theirs is \
             published. Base and tip lie on the wall's normal, and the two elbows mirror each other. The impact is rigid and \
             frictionless, eqs. (10) to (15), with Newton's coefficient e of Table I (measured at {SPEED} m/s, used at all \
             speeds). E is what the paper calls the energetic coefficient, √(T⁺/T⁻) of eq. (16): a ratio of kinetic \
             energies, not Stronge's coefficient.\n\n",
            self.arm
        );
        let confirmed = self.claims.iter().filter(|claim| claim.holds).count();
        let _ = writeln!(text, "## Claim by claim: {confirmed} of {} confirmed\n", self.claims.len());
        text += "| what the paper says | where | this model | numbers |\n| --- | --- | --- | --- |\n";
        for Claim { place, statement, holds, evidence } in &self.claims {
            let verdict = if *holds { "confirmed" } else { "**not confirmed**" };
            let cells = [statement, *place, verdict, evidence].map(|cell| cell.replace('|', "\\|"));
            let _ = writeln!(text, "| {} |", cells.join(" | "));
        }
        text += "\nThe sizes in Figs. 4 to 10 can't be compared: the text of the paper prints no velocity, force, path or \
                 energy, and Table I is all that it prints of its measurements.\n\n";
        for name in &FIGURES[..7] {
            let _ = writeln!(
                text,
                "## {}\n\n![{0}]({name}.svg)\n\n{} ([data]({name}.csv))\n",
                title(name),
                self.caption(name)
            );
        }
        text += &self.table1();
        text
    }

    /// What there is to say below a figure.
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
                "{SPEED} m/s, {ANGLE}°, e = {RESTITUTION}. Lines are the model, dots every 4 ms, the paper's clock. Along the \
                 wall {} and {}; into the wall {}.",
                jump("up-elbow", up_before.tangential, up_after.tangential),
                jump("down-elbow", down_before.tangential, down_after.tangential),
                jump("both", up_before.normal, up_after.normal)
            ),
            "fig5" => {
                let of = |forces: &Forces| {
                    let [normal, tangential] = forces.impulse();
                    format!(
                        "{}-elbow: {:.1} N at most, for {:.3} ms, impulses {normal:.5} and {tangential:.5} N s",
                        forces.elbow.name(),
                        forces.peak(),
                        forces.duration() * 1e3
                    )
                };
                format!(
                    "A rigid impact has no force, so here the contact gives way: Hunt & Crossley, {STIFFNESS:e} N/m^1.5, damped \
                     so that Stronge's coefficient is {RESTITUTION}, friction {FRICTION}; stiffness, and with it duration and \
                     peak, and friction are our choice. {}; {}. At one sample in 4 ms such a force would be seen once or not \
                     at all.",
                    of(&self.forces[0]),
                    of(&self.forces[1])
                )
            }
            "fig6" => "The place where the tip hits is the origin; dots every 4 ms.".into(),
            "fig7" => format!("{} samples, 4 ms apart, around the impact; the lines are the model.", up.samples.len()),
            "fig8" => {
                let lost = |speed: f64| {
                    let of = self.runs.iter().filter(|run| run.speed == speed).map(|run| run.hit.energy_loss() * 1e3);
                    of.fold((f64::MAX, 0.0_f64), |(least, most), x| (least.min(x), most.max(x)))
                };
                let each = SPEEDS.map(|speed| {
                    let (least, most) = lost(speed);
                    format!("{least:.3} to {most:.3} mJ at {speed} m/s")
                });
                format!("{}. With Table I's e of {SPEED} m/s at every speed.", each.join(", "))
            }
            "fig9" => "Along the wall, before and after, by eq. (15) with e and with E in its place. The measured velocities \
                       are not printed in the paper."
                .into(),
            _ => "Away from the wall. Measured is −e v_n⁻, by the definition of Table I's e, eq. (11); the other is eq. (11) \
                  with E in its place, as in the paper."
                .into(),
        }
    }

    /// Table I, beside the model, and the inverse problem.
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
        text += "\n### Could any arm give it?\n\nUnder eqs. (10) to (16) Y = √((1−e²)/(1−E²) − 1) is |cot α − h|/√D, with h = \
                 tᵀHn/nᵀHn and D = det H/(nᵀHn)²: a V over cot α, whatever the arm. `carom consistency docs/table1.csv`:\n\n\
                 ![Energies over angles](table1.svg)\n\n";
        for (row, found) in &self.table {
            let _ = writeln!(text, "**{}**\n", row.name);
            for sentence in found.verdict(row) {
                let _ = writeln!(text, "- {sentence}");
            }
            text.push('\n');
        }
        text += "This is arithmetic about the table under rigid, frictionless impact with Newton's coefficient. The authors \
                 themselves call its values not consistent.\n";
        text
    }
}

/// What stands in a folder that is no file of a report.
fn occupied(folder: &Path) -> io::Result<Option<String>> {
    let entries = match std::fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        entries => entries?,
    };
    let known = Paper::files();
    for entry in entries {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !known.contains(&name) || !entry.file_type()?.is_file() {
            return Ok(Some(name));
        }
    }
    Ok(None)
}

/// A folder that goes unless it was moved away.
struct Part(PathBuf);

impl Drop for Part {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}
