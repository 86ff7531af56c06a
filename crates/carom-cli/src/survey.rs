//! `carom inspect --all`: a summary of all URDF files in a folder.

use crate::error::CliError;
use crate::output::{brief, to_json};
use carom_chain::Chain;
use carom_chain::urdf::LoadOptions;
use serde::Serialize;
use std::io::Write;
use std::path::{Path, PathBuf};

#[derive(Serialize)]
struct Line {
    file: String,
    status: &'static str,
    name: Option<String>,
    dof: Option<usize>,
    mass: Option<f64>,
    warnings: usize,
    /// The error, the links without mass, or the first warning.
    reason: Option<String>,
}

#[derive(Serialize)]
struct Total {
    counts: Counts,
}

/// Numbers of files.
#[derive(Serialize, Default)]
struct Counts {
    files: usize,
    loads: usize,
    warnings: usize,
    partial: usize,
    refused: usize,
}

impl Counts {
    fn add(&mut self, status: &str) {
        self.files += 1;
        match status {
            "loads" => self.loads += 1,
            "warnings" => self.warnings += 1,
            "partial" => self.partial += 1,
            _ => self.refused += 1,
        }
    }
}

/// Loads every URDF file in a folder and prints a line about each, in the order of their names, then the counts.
pub fn survey(folder: &Path, options: &LoadOptions, json: bool, out: &mut dyn Write) -> Result<(), CliError> {
    let mut files = Vec::new();
    find(folder, &mut files)?;
    if files.is_empty() {
        return Err(CliError::Input(format!("--all {}: the folder contains no .urdf file", folder.display())));
    }
    let mut counts = Counts::default();
    for file in &files {
        let line = line(file, options);
        counts.add(line.status);
        if json {
            writeln!(out, "{}", to_json(&line)?)?;
        } else {
            for_people(&line, out)?;
        }
    }
    if json {
        return Ok(writeln!(out, "{}", to_json(&Total { counts })?)?);
    }
    let Counts { files, loads, warnings, partial, refused } = counts;
    Ok(writeln!(out, "{files} files: {loads} load, {warnings} with warnings, {partial} partial, {refused} refused")?)
}

/// The URDF files in a folder and the folders in it, sorted. Links to folders are not followed, so there are no loops.
fn find(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), CliError> {
    let unreadable = |e| CliError::unreadable(folder.display(), &e);
    let mut entries =
        std::fs::read_dir(folder).map_err(unreadable)?.collect::<Result<Vec<_>, _>>().map_err(unreadable)?;
    entries.sort_by_key(std::fs::DirEntry::file_name);
    for entry in entries {
        let (path, kind) = (entry.path(), entry.file_type().map_err(unreadable)?);
        if kind.is_dir() {
            find(&path, files)?;
        } else if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("urdf")) {
            files.push(path);
        }
    }
    Ok(())
}

fn line(path: &Path, options: &LoadOptions) -> Line {
    let file = path.display().to_string();
    // A pipe without a writer would be waited for without end.
    let special = path.metadata().is_ok_and(|it| !it.is_file());
    let chain = if special {
        Err("it is a folder, a pipe or a device: give a file".into())
    } else {
        Chain::from_urdf_file_with(path, options).map_err(|error| error.to_string())
    };
    let chain = match chain {
        Ok(chain) => chain,
        Err(reason) => {
            let reason = reason.strip_prefix(&format!("{file}:")).unwrap_or(&reason);
            let reason = Some(reason.trim_start().to_owned());
            return Line { file, status: "refused", name: None, dof: None, mass: None, warnings: 0, reason };
        }
    };
    let report = chain.report();
    let massless = chain.massless_links();
    let (status, reason) = if !massless.is_empty() {
        ("partial", Some(format!("no dynamics, since these links move without mass: {}", massless.join(", "))))
    } else if let Some(first) = report.warnings.first() {
        ("warnings", Some(first.clone()))
    } else {
        ("loads", report.repairs.first().map(|repair| format!("repaired: {repair}")))
    };
    Line {
        file,
        status,
        name: Some(chain.name().to_owned()),
        dof: Some(chain.nv()),
        mass: Some(chain.total_mass()),
        warnings: report.warnings.len(),
        reason,
    }
}

fn for_people(line: &Line, out: &mut dyn Write) -> Result<(), CliError> {
    let told = match (line.dof, line.mass) {
        (Some(dof), Some(mass)) => {
            let status = match (line.status, line.warnings) {
                ("warnings", 1) => "loads with 1 warning".into(),
                ("warnings", n) => format!("loads with {n} warnings"),
                (status, _) => status.to_owned(),
            };
            format!("{status}, {dof} degrees of freedom, {} kg", brief(mass))
        }
        _ => line.status.to_owned(),
    };
    let reason = line.reason.as_ref().map_or_else(String::new, |reason| format!(": {reason}"));
    Ok(writeln!(out, "{}: {told}{reason}", line.file)?)
}
