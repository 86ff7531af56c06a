//! Destinations of recordings: a file, which is complete or not there, or a viewer.

use crate::RecordError;
use crate::rerun;
use crate::rerun::external::re_uri::{self, RedapUri};
use crate::rerun::{AsComponents, EntityPath, RecordingStream, RecordingStreamBuilder};
use carom_study::Part;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The application id under which the viewer keeps recordings and their layout.
pub(crate) const APPLICATION: &str = "carom";

/// Destination of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// A file. It is written under a temporary name in the same folder and renamed when it is complete.
    File(PathBuf),
    /// A running viewer at an address like `rerun+http://127.0.0.1:9876/proxy`; `None` is Rerun's default address.
    Connect(Option<String>),
    /// A viewer that is started for the recording: the program `rerun` on the PATH.
    Spawn,
}

impl Target {
    /// Whether the recording is shown while it is written.
    pub(crate) fn is_live(&self) -> bool {
        !matches!(self, Self::File(_))
    }
}

/// Longest wait for the viewer's answer when the recording is flushed.
const PATIENCE: Duration = Duration::from_secs(30);

/// An open recording. Fields are dropped in their order: the stream ends before its file is removed.
pub(crate) struct Sink {
    pub rec: RecordingStream,
    file: Option<Part>,
    /// The viewer did not answer in time.
    lost: bool,
}

impl Sink {
    /// # Errors
    /// [`RecordError::Unwritable`], [`RecordError::Viewer`].
    pub fn open(target: &Target, name: &str) -> Result<Self, RecordError> {
        // A recording that is asked for is made whatever the value of the environment variable RERUN.
        let builder = RecordingStreamBuilder::new(APPLICATION).recording_name(name).enabled(true);
        let viewer = |e: rerun::RecordingStreamError| RecordError::Viewer { reason: e.to_string() };
        match target {
            Target::File(path) => {
                let file = Part::unique(path).map_err(|e| unwritable(path, e.to_string()))?;
                let rec = builder.save(file.temporary()).map_err(|e| part_unwritable(&file, &e.to_string()))?;
                Ok(Self { rec, file: Some(file), lost: false })
            }
            Target::Connect(url) => {
                let url = url.as_deref().unwrap_or(rerun::DEFAULT_CONNECT_URL);
                answers(url)?;
                Ok(Self { rec: builder.connect_grpc_opts(url).map_err(viewer)?, file: None, lost: false })
            }
            Target::Spawn => Ok(Self { rec: builder.spawn().map_err(viewer)?, file: None, lost: false }),
        }
    }

    /// The error with this reason: of the file if the destination is one, else of the viewer.
    pub fn error(&self, reason: String) -> RecordError {
        match &self.file {
            Some(file) => part_unwritable(file, &reason),
            None => RecordError::Viewer { reason },
        }
    }

    /// Logs a value that is valid at all times.
    pub fn fixed(&self, path: impl Into<EntityPath>, what: &dyn AsComponents) -> Result<(), RecordError> {
        self.rec.log_static(path, what).map_err(|e| self.error(e.to_string()))
    }

    /// Logs a value at the present time.
    pub fn now(&self, path: impl Into<EntityPath>, what: &dyn AsComponents) -> Result<(), RecordError> {
        self.rec.log(path, what).map_err(|e| self.error(e.to_string()))
    }

    /// Writes what is buffered and closes the recording.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn finish(mut self) -> Result<(), RecordError> {
        let flushed = self.flush();
        self.lost = flushed.is_err();
        flushed?;
        let file = self.file.take();
        drop(self); // the end of the stream writes the last bytes of the file
        let Some(file) = file else { return Ok(()) };
        let path = file.path().to_owned();
        file.keep().map_err(|e| unwritable(&path, e.to_string()))
    }

    fn flush(&self) -> Result<(), RecordError> {
        let flushed = match self.file {
            Some(_) => self.rec.flush_blocking(),
            None => self.rec.flush_with_timeout(PATIENCE),
        };
        flushed.map_err(|e| self.error(e.to_string()))
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        // Dropping a stream waits for its viewer without a time limit: if the viewer does not answer, it is not dropped.
        if self.lost || (self.file.is_none() && self.flush().is_err()) {
            std::mem::forget(self.rec.clone());
        }
    }
}

/// Checks that a viewer listens at the address, since Rerun waits for it without a time limit.
fn answers(url: &str) -> Result<(), RecordError> {
    let refuse = |reason: String| RecordError::Viewer { reason: format!("{url}: {reason}") };
    let RedapUri::Proxy(uri) = url.parse().map_err(|e: re_uri::Error| refuse(e.to_string()))? else {
        return Err(refuse("the address of a viewer ends in /proxy".into()));
    };
    let address = format!("{}:{}", uri.origin.host, uri.origin.port);
    std::net::TcpStream::connect(address).map(drop).map_err(|e| refuse(e.to_string()))
}

/// The error of a file that is being written; the message names the file itself, not its temporary name.
fn part_unwritable(file: &Part, reason: &str) -> RecordError {
    let (path, part) = (file.path(), file.temporary());
    unwritable(path, reason.replace(&part.display().to_string(), &path.display().to_string()))
}

fn unwritable(path: &Path, reason: String) -> RecordError {
    RecordError::Unwritable { path: path.to_owned(), reason }
}
