//! The failures at a program's interface.

use std::io;
use std::path::{Path, PathBuf};

/// A failure of an argument, a file or a folder.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The command line has an invalid value.
    #[error("{0}")]
    Usage(String),
    /// A file or folder cannot be read or written.
    #[error("{}: cannot {action}: {source}", .path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The operation, after 'cannot'.
        action: &'static str,
        /// The system's error.
        source: io::Error,
    },
}

impl Error {
    /// Returns a function for `map_err` on file operations that names the path and the operation.
    pub fn io(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), action, source }
    }
}

impl From<bvh_files::WriteError> for Error {
    fn from(error: bvh_files::WriteError) -> Self {
        let bvh_files::WriteError { path, action, source } = error;
        Self::Io { path, action, source }
    }
}
