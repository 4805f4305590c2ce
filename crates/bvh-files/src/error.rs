//! The failure to write a file.

use std::io;
use std::path::{Path, PathBuf};

/// A failure to write a file.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot {action}: {source}", .path.display())]
pub struct WriteError {
    /// The file that was to be written.
    pub path: PathBuf,
    /// The operation, after 'cannot'.
    pub action: &'static str,
    /// The system's error.
    pub source: io::Error,
}

impl WriteError {
    pub(crate) fn of(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self { path: path.to_owned(), action, source }
    }
}
