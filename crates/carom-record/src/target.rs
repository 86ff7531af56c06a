//! Where a recording goes: into a file that is whole or not there at all, or to a viewer.

use crate::RecordError;
use rerun::external::re_uri::{self, RedapUri};
use rerun::{RecordingStream, RecordingStreamBuilder};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// What the viewer knows these recordings, and their layout, by.
pub(crate) const APPLICATION: &str = "carom";

/// Where a recording goes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Target {
    /// Into a file, written beside its place and moved there when it is whole.
    File(PathBuf),
    /// To a viewer that runs already, at an address like `rerun+http://127.0.0.1:9876/proxy`; `None`: Rerun's default.
    Connect(Option<String>),
    /// To a viewer that is started for it: the `rerun` on the PATH.
    Spawn,
}

impl Target {
    /// Whether somebody may be looking while the recording grows.
    pub(crate) fn is_live(&self) -> bool {
        !matches!(self, Self::File(_))
    }
}

/// A viewer answers within this time, or it is not there.
const PATIENCE: Duration = Duration::from_secs(30);

/// An open recording. Fields are dropped in their order: the stream ends before its file is removed.
pub(crate) struct Sink {
    pub rec: RecordingStream,
    file: Option<Partial>,
    /// The viewer has not answered.
    lost: bool,
}

impl Sink {
    /// # Errors
    /// [`RecordError::Unwritable`], [`RecordError::Viewer`].
    pub fn open(target: &Target, name: &str) -> Result<Self, RecordError> {
        // Whoever asks for a recording gets it, whatever the environment variable RERUN says.
        let builder = RecordingStreamBuilder::new(APPLICATION).recording_name(name).enabled(true);
        let viewer = |e: rerun::RecordingStreamError| RecordError::Viewer { reason: e.to_string() };
        match target {
            Target::File(path) => {
                let file = Partial::beside(path);
                let rec = builder.save(&file.partial).map_err(|e| file.unwritable(e.to_string()))?;
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

    /// What went wrong, with the file's name if it goes into one.
    pub fn error(&self, reason: String) -> RecordError {
        match &self.file {
            Some(file) => file.unwritable(reason),
            None => RecordError::Viewer { reason },
        }
    }

    /// Hands over what is left and closes.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn finish(mut self) -> Result<(), RecordError> {
        let flushed = self.flush();
        self.lost = flushed.is_err();
        flushed?;
        let file = self.file.take();
        drop(self); // a file gets its last bytes when its stream ends
        file.map_or(Ok(()), Partial::keep)
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
        // A stream that ends waits for its viewer, for ever if there is none any more: then it never ends.
        if self.lost || (self.file.is_none() && self.flush().is_err()) {
            std::mem::forget(self.rec.clone());
        }
    }
}

/// Rerun would wait for ever for a viewer that does not run.
fn answers(url: &str) -> Result<(), RecordError> {
    let refuse = |reason: String| RecordError::Viewer { reason: format!("{url}: {reason}") };
    let RedapUri::Proxy(uri) = url.parse().map_err(|e: re_uri::Error| refuse(e.to_string()))? else {
        return Err(refuse("a viewer's address ends in /proxy".into()));
    };
    let address = format!("{}:{}", uri.origin.host, uri.origin.port);
    std::net::TcpStream::connect(address).map(drop).map_err(|e| refuse(e.to_string()))
}

/// A file on its way.
struct Partial {
    path: PathBuf,
    partial: PathBuf,
}

impl Partial {
    fn beside(path: &Path) -> Self {
        let mut name = path.file_name().unwrap_or_default().to_owned();
        name.push(".part");
        Self { path: path.to_owned(), partial: path.with_file_name(name) }
    }

    fn unwritable(&self, reason: String) -> RecordError {
        // The partial file is nobody's business.
        let reason = reason.replace(&self.partial.display().to_string(), &self.path.display().to_string());
        RecordError::Unwritable { path: self.path.clone(), reason }
    }

    fn keep(self) -> Result<(), RecordError> {
        std::fs::rename(&self.partial, &self.path).map_err(|e| self.unwritable(e.to_string()))
    }
}

impl Drop for Partial {
    /// What is not kept leaves nothing behind.
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.partial);
    }
}
