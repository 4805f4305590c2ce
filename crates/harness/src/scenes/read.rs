//! Whole files, or why there is none: nothing is read that might never end.

use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a file could not be read.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum ReadError {
    /// Nothing at this path.
    #[error("{}: no such file", .path.display())]
    NotFound { path: PathBuf },
    /// A directory at this path.
    #[error("{} is a directory; expected the path of one file", .path.display())]
    Directory { path: PathBuf },
    /// A device, pipe or socket at this path, which might never end.
    #[error("{} is no regular file; expected the path of one file", .path.display())]
    NotRegular { path: PathBuf },
    /// The file exists and could not be read.
    #[error("{} could not be read: {source}", .path.display())]
    Failed { path: PathBuf, source: io::Error },
}

/// The bytes of a regular file.
pub fn read(path: &Path) -> Result<Vec<u8>, ReadError> {
    let failed = |source: io::Error| {
        let path = path.to_path_buf();
        match source.kind() {
            io::ErrorKind::NotFound => ReadError::NotFound { path },
            _ => ReadError::Failed { path, source },
        }
    };
    let file = std::fs::metadata(path).map_err(failed)?;
    match file.is_file() {
        true => std::fs::read(path).map_err(failed),
        false if file.is_dir() => Err(ReadError::Directory { path: path.to_path_buf() }),
        false => Err(ReadError::NotRegular { path: path.to_path_buf() }),
    }
}
