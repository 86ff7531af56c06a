//! Where a recording goes: into a file that is whole or not there at all, or to a viewer.

use crate::RecordError;
use rerun::{RecordingStream, RecordingStreamBuilder};
use std::path::{Path, PathBuf};

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

/// An open recording. Fields are dropped in their order: the stream ends before its file is removed.
pub(crate) struct Sink {
    pub rec: RecordingStream,
    file: Option<Partial>,
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
                Ok(Self { rec, file: Some(file) })
            }
            Target::Connect(None) => Ok(Self { rec: builder.connect_grpc().map_err(viewer)?, file: None }),
            Target::Connect(Some(url)) => {
                Ok(Self { rec: builder.connect_grpc_opts(url.as_str()).map_err(viewer)?, file: None })
            }
            Target::Spawn => Ok(Self { rec: builder.spawn().map_err(viewer)?, file: None }),
        }
    }

    /// What went wrong, with the file's name if it goes into one.
    pub fn error(&self, reason: String) -> RecordError {
        self.file.as_ref().map_or(RecordError::Viewer { reason: reason.clone() }, |file| file.unwritable(reason))
    }

    /// Hands over what is left and closes.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn finish(self) -> Result<(), RecordError> {
        self.rec.flush_blocking().map_err(|e| self.error(e.to_string()))?;
        let Self { rec, file } = self;
        drop(rec); // a file gets its last bytes when its stream ends
        file.map_or(Ok(()), |file| file.keep())
    }
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
