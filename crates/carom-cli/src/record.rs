//! Recordings for the Rerun viewer, with the feature `rerun`; without it, asking for one is refused.

use crate::error::CliError;
use carom_sim::{Plan, Scene, Seen, Summary};
use carom_study::{Diagram, Study};
use clap::Args;
use std::path::{Path, PathBuf};

/// Where a recording goes: one place, or none.
#[derive(Args)]
#[group(multiple = false)]
pub struct Record {
    /// Write a recording for the Rerun viewer
    #[arg(long, value_name = "X.rrd")]
    out: Option<PathBuf>,
    /// Record into a viewer that runs already, at its address or Rerun's default
    #[arg(long, value_name = "URL")]
    #[allow(clippy::option_option)] // as clap says "an option whose value may be left out"
    connect: Option<Option<String>>,
    /// Start a viewer and record into it
    #[arg(long)]
    spawn: bool,
}

impl Record {
    /// Whether there is to be one.
    pub fn is_asked(&self) -> bool {
        self.out.is_some() || self.connect.is_some() || self.spawn
    }

    /// Refuses a recording where there can be none.
    pub fn check(&self) -> Result<(), CliError> {
        if self.is_asked() && !cfg!(feature = "rerun") {
            Err(without("--out, --connect and --spawn need"))
        } else {
            Ok(())
        }
    }

    /// The file that is written, if it is a file.
    pub fn file(&self) -> Option<&Path> {
        self.out.as_deref()
    }

    #[cfg(feature = "rerun")]
    fn target(&self) -> Option<carom_record::Target> {
        use carom_record::Target;
        match self {
            Self { out: Some(path), .. } => Some(Target::File(path.clone())),
            Self { connect: Some(url), .. } => Some(Target::Connect(url.clone())),
            Self { spawn: true, .. } => Some(Target::Spawn),
            _ => None,
        }
    }
}

/// Records the diagrams of one impact, with a page of words.
#[cfg(feature = "rerun")]
pub fn record_diagrams(
    asked: &Record,
    plane: &Diagram<2>,
    space: Option<&Diagram<3>>,
    words: &str,
) -> Result<(), CliError> {
    match asked.target() {
        Some(target) => Ok(carom_record::record_diagrams(&target, plane, space, words)?),
        None => Ok(()),
    }
}

/// Refuses: there are no recordings.
#[cfg(not(feature = "rerun"))]
pub fn record_diagrams(asked: &Record, _: &Diagram<2>, _: Option<&Diagram<3>>, _: &str) -> Result<(), CliError> {
    asked.check()
}

/// `who` ends in its verb.
fn without(who: &str) -> CliError {
    CliError::Option(format!("{who} recordings, without which this carom was built (feature rerun)"))
}

/// Refuses to record a map where there can be no recordings.
pub fn check_map(rrd: Option<&Path>) -> Result<(), CliError> {
    if rrd.is_some() && !cfg!(feature = "rerun") { Err(without("--rrd needs")) } else { Ok(()) }
}

/// Records one column of a map.
#[cfg(feature = "rerun")]
pub fn record_map(study: &Study, column: &str, path: &Path) -> Result<(), CliError> {
    Ok(carom_record::record_map(study, column, &carom_record::Target::File(path.to_owned()))?)
}

/// There are no recordings.
#[cfg(not(feature = "rerun"))]
pub fn record_map(_: &Study, _: &str, path: &Path) -> Result<(), CliError> {
    check_map(Some(path))
}

/// A recording on its way.
#[cfg(feature = "rerun")]
pub struct Recorder(carom_record::SceneRecorder);

#[cfg(feature = "rerun")]
impl Recorder {
    pub fn begin(asked: &Record, scene: &Scene, plan: &Plan) -> Result<Option<Self>, CliError> {
        let Some(target) = asked.target() else { return Ok(None) };
        Ok(Some(Self(carom_record::SceneRecorder::begin(&target, scene, plan)?)))
    }

    pub fn see(&mut self, seen: Seen) {
        self.0.see(seen);
    }

    pub fn finish(self, run: &Summary) -> Result<(), CliError> {
        Ok(self.0.finish(run)?)
    }
}

/// There is none.
#[cfg(not(feature = "rerun"))]
pub enum Recorder {}

#[cfg(not(feature = "rerun"))]
impl Recorder {
    pub fn begin(asked: &Record, _: &Scene, _: &Plan) -> Result<Option<Self>, CliError> {
        asked.check().map(|()| None)
    }

    pub fn see(&mut self, _: Seen) {
        match *self {}
    }

    pub fn finish(self, _: &Summary) -> Result<(), CliError> {
        match self {}
    }
}
