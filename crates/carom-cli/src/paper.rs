//! `carom paper`: the figures and the table of Pagilla & Yu (2004), computed for the preset arm.

use crate::error::CliError;
use crate::files;
use crate::output::answer_about;
use carom_evidence::EvidenceError;
use carom_evidence::paper::{Paper, stand_in};
use clap::Args;
use std::io::Write;
use std::path::PathBuf;

/// Compute Figures 4 to 10 and Table I of Pagilla & Yu (2004) for the preset arm
///
/// The paper prints no inertia and no joint angles, so the arm robots/planar2.urdf stands in for
/// the authors' robot: 2 elbow poses × 4 approach angles × 3 speeds, without friction, with the
/// restitutions of Table I.
///
/// Output: figures (SVG), their numbers (CSV) and report.md in --out; and each claim of the paper,
/// with whether the model confirms it and the numbers that show it.
/// JSON keys: arm, stand_in, files, claims [{place, statement, confirmed, evidence}],
///   impacts [{elbow, speed (m/s), angle_deg, newton, tangential and normal ([before, after], m/s),
///   energy_loss (J), energy_root = √(T⁺/T⁻), coupling, change}].
#[derive(Args)]
#[command(verbatim_doc_comment)]
pub struct PaperCommand {
    /// Folder to write to: new, empty, or of an earlier report, which is replaced
    ///
    /// It is made if it is missing; its parent must exist. A folder that holds anything else, or
    /// only some of the files of a report, is refused.
    #[arg(short, long, value_name = "DIR", verbatim_doc_comment)]
    out: PathBuf,
    /// Print one line of JSON instead of text
    #[arg(long)]
    json: bool,
}

impl PaperCommand {
    pub fn run(self, out: &mut dyn Write) -> Result<(), CliError> {
        files::check_folder(&self.out)?;
        let paper = Paper::of(&stand_in().map_err(EvidenceError::from)?)?;
        paper.write(&self.out)?;
        answer_about(&self.out, out, &paper, self.json, |paper, out| paper.print(&self.out, out))
    }
}
