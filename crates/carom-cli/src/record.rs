//! Recordings for the Rerun viewer, with the feature `rerun`; without it, the options that ask for one are refused.

use crate::error::CliError;
use carom_sim::{Plan, Scene};
use carom_study::Diagram;
use carom_study::map_study::Study;
use clap::Args;
use std::path::{Path, PathBuf};

// Destination of a recording: a file, a viewer, or none.
#[derive(Args)]
#[group(multiple = false)]
pub struct Record {
    /// The file of a recording, an `--out`.
    #[arg(skip)]
    out: Option<PathBuf>,
    /// Record into a running Rerun viewer [default URL: rerun+http://127.0.0.1:9876/proxy]
    ///
    /// Recordings need a carom that is built with the feature `rerun`.
    #[arg(long, value_name = "URL")]
    #[allow(clippy::option_option)] // clap's type for an option whose value is optional
    connect: Option<Option<String>>,
    /// Start a Rerun viewer (`rerun` on the PATH) and record into it
    #[arg(long)]
    spawn: bool,
}

impl Record {
    /// Whether a recording is asked for.
    pub fn is_asked(&self) -> bool {
        self.out.is_some() || self.connect.is_some() || self.spawn
    }

    /// Takes the file of `--out`, and refuses two destinations, or any in a build without the feature `rerun`.
    pub fn check(&mut self, file: Option<&Path>) -> Result<(), CliError> {
        self.out = file.map(Path::to_owned);
        if let (Some(file), true) = (file, self.connect.is_some() || self.spawn) {
            let why = "a recording has one destination: leave out --connect and --spawn, or this file";
            return Err(CliError::Input(format!("--out {}: {why}", file.display())));
        }
        if self.is_asked() && !cfg!(feature = "rerun") {
            Err(without("--out, --connect and --spawn need"))
        } else {
            Ok(())
        }
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

/// Records the diagrams of one impact and a page of text.
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

/// Refuses: this build has no recordings.
#[cfg(not(feature = "rerun"))]
pub fn record_diagrams(asked: &Record, _: &Diagram<2>, _: Option<&Diagram<3>>, _: &str) -> Result<(), CliError> {
    let _ = asked;
    Err(without("--out, --connect and --spawn need"))
}

/// The refusal in a build without recordings; `who` ends in its verb.
fn without(who: &str) -> CliError {
    CliError::Input(format!("{who} recordings: build carom with the feature rerun"))
}

/// Refuses the recording of a map in a build without the feature `rerun`.
pub fn check_recording(rrd: Option<&Path>) -> Result<(), CliError> {
    if rrd.is_some() && !cfg!(feature = "rerun") { Err(without("a recording needs")) } else { Ok(()) }
}

/// Refuses a map that a recording cannot show.
#[cfg(feature = "rerun")]
pub fn check_map(study: &Study, column: &str) -> Result<(), CliError> {
    Ok(carom_record::check_map(study, column)?)
}

/// No recording exists in this build.
#[cfg(not(feature = "rerun"))]
pub fn check_map(_: &Study, _: &str) -> Result<(), CliError> {
    Ok(())
}

/// Records one column of a map.
#[cfg(feature = "rerun")]
pub fn record_map(study: &Study, column: &str, path: &Path) -> Result<(), CliError> {
    Ok(carom_record::record_map(study, column, &carom_record::Target::File(path.to_owned()))?)
}

/// Refuses: this build has no recordings.
#[cfg(not(feature = "rerun"))]
pub fn record_map(_: &Study, _: &str, path: &Path) -> Result<(), CliError> {
    check_recording(Some(path))
}

/// A recording that is being written.
#[cfg(feature = "rerun")]
pub use carom_record::SceneRecorder as Recorder;

/// Begins the recording of a scene, if one is asked for.
#[cfg(feature = "rerun")]
pub fn begin_recording(asked: &Record, scene: &Scene, plan: &Plan) -> Result<Option<Recorder>, CliError> {
    Ok(asked.target().map(|target| Recorder::begin(&target, scene, plan)).transpose()?)
}

/// Refuses: this build has no recordings.
#[cfg(not(feature = "rerun"))]
pub fn begin_recording(asked: &Record, _: &Scene, _: &Plan) -> Result<Option<Recorder>, CliError> {
    if asked.is_asked() { Err(without("--out, --connect and --spawn need")) } else { Ok(None) }
}

/// No recording exists in this build.
#[cfg(not(feature = "rerun"))]
pub enum Recorder {}

#[cfg(not(feature = "rerun"))]
impl Recorder {
    pub fn see(&mut self, _: carom_sim::Seen) {
        match *self {}
    }

    pub fn errors(&mut self, _: &[carom_sim::Moment], _: &[Option<carom_sim::StateError>]) {
        match *self {}
    }

    pub fn finish(self, _: &carom_sim::Summary) -> Result<(), CliError> {
        match self {}
    }
}
