//! Reads regular files completely. Pipes and devices, which might never end, are rejected.

use std::io;
use std::path::{Path, PathBuf};
use std::str::Utf8Error;
use thiserror::Error;

/// The reason why a file cannot be read.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message describes its fields")]
pub enum ReadError {
    /// The path does not exist.
    #[error("{}: no such file", .path.display())]
    NotFound { path: PathBuf },
    /// The path is a folder.
    #[error("{}: a folder; accepted: a file", .path.display())]
    Folder { path: PathBuf },
    /// The path is a device, pipe or socket, which might never end.
    #[error("{}: not a regular file; accepted: a file", .path.display())]
    NotRegular { path: PathBuf },
    /// The text is not UTF-8.
    #[error("{}: {source}; accepted: UTF-8", .path.display())]
    NotUtf8 { path: PathBuf, source: Utf8Error },
    /// The file exists, but the system cannot read it.
    #[error("{} could not be read: {source}", .path.display())]
    Failed { path: PathBuf, source: io::Error },
}

impl ReadError {
    /// Returns the kind of error that the operating system would report. Bindings choose their
    /// exception by it.
    pub fn kind(&self) -> io::ErrorKind {
        match self {
            Self::NotFound { .. } => io::ErrorKind::NotFound,
            Self::Folder { .. } => io::ErrorKind::IsADirectory,
            Self::NotRegular { .. } => io::ErrorKind::InvalidInput,
            Self::NotUtf8 { .. } => io::ErrorKind::InvalidData,
            Self::Failed { source, .. } => source.kind(),
        }
    }

    /// Returns whether the path is at fault and not the system.
    pub fn is_of_the_path(&self) -> bool {
        !matches!(self, Self::Failed { .. })
    }
}

/// Returns the text of the regular file at `path`.
pub fn read_text(path: &Path) -> Result<String, ReadError> {
    String::from_utf8(read(path)?).map_err(|error| ReadError::NotUtf8 {
        path: path.to_path_buf(),
        source: error.utf8_error(),
    })
}

/// Returns the bytes of the regular file at `path`. Rejects anything else unread, because a pipe
/// could block the program and a device might never end.
pub fn read(path: &Path) -> Result<Vec<u8>, ReadError> {
    regular(path)?;
    std::fs::read(path).map_err(|source| failed(path, source))
}

/// Returns the number of bytes of the regular file at `path`.
pub fn regular(path: &Path) -> Result<u64, ReadError> {
    let file = std::fs::metadata(path).map_err(|source| failed(path, source))?;
    match file.is_file() {
        true => Ok(file.len()),
        false if file.is_dir() => Err(ReadError::Folder { path: path.to_path_buf() }),
        false => Err(ReadError::NotRegular { path: path.to_path_buf() }),
    }
}

fn failed(path: &Path, source: io::Error) -> ReadError {
    let path = path.to_path_buf();
    match source.kind() {
        io::ErrorKind::NotFound => ReadError::NotFound { path },
        _ => ReadError::Failed { path, source },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_file;

    #[test]
    fn folders_devices_and_missing_files_are_rejected_unread() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("x");
        assert!(matches!(read(folder.path()), Err(ReadError::Folder { .. })));
        assert!(matches!(read(&missing), Err(ReadError::NotFound { .. })));
        for path in [folder.path(), &missing, Path::new("/dev/zero")] {
            assert!(
                matches!(tree_file::read(path), Err(tree_file::TreeFileError::Read(_))),
                "{}",
                path.display()
            );
        }
        #[cfg(unix)]
        assert!(matches!(read(Path::new("/dev/zero")), Err(ReadError::NotRegular { .. })));
    }
}
