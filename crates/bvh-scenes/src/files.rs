//! Files that are read only where they are regular, and replaced whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A failure to read a file.
#[derive(Debug, thiserror::Error)]
#[error("{}: {source}", .path.display())]
pub struct ReadError {
    /// The file.
    pub path: PathBuf,
    /// The fault of the path or of its text, or the system's error.
    pub source: io::Error,
}

impl ReadError {
    fn new(path: &Path, kind: io::ErrorKind, message: String) -> Self {
        Self { path: path.to_owned(), source: io::Error::new(kind, message) }
    }

    /// Returns a function for `map_err` on errors of the system that names the file.
    pub fn of(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |error| match error.kind() {
            kind @ io::ErrorKind::NotFound => {
                if let Ok(end) = fs::read_link(path) {
                    let message = format!("a link to {}, which is not there", end.display());
                    return Self::new(path, kind, message);
                }
                let name = path.file_name().map(|name| name.to_string_lossy());
                let files = fs::read_dir(folder_of(path)).into_iter().flatten().flatten();
                let files = files.take(1000).map(|file| file.file_name().into_string());
                let meant = did_you_mean(&name.unwrap_or_default(), files.flatten());
                Self::new(path, kind, format!("no such file{meant}"))
            }
            kind => Self::new(path, kind, format!("could not be read: {error}")),
        }
    }

    /// Returns the kind of the error. Bindings choose their exception by it.
    pub fn kind(&self) -> io::ErrorKind {
        self.source.kind()
    }

    /// Returns whether the path or the text is at fault and not the system.
    pub fn is_of_the_path(&self) -> bool {
        use io::ErrorKind::{InvalidData, InvalidInput, IsADirectory, NotFound};
        matches!(self.kind(), NotFound | IsADirectory | InvalidInput | InvalidData)
    }
}

/// Returns the question after the nearest of these names, as `; did you mean escher?`, or nothing if
/// none is near.
pub(crate) fn did_you_mean(name: &str, known: impl Iterator<Item = String>) -> String {
    const NEAR: f64 = 0.6;
    let near = |known: String| (strsim::normalized_damerau_levenshtein(name, &known), known);
    let nearest = known.map(near).max_by(|a, b| a.0.total_cmp(&b.0).then_with(|| b.1.cmp(&a.1)));
    match nearest {
        Some((nearness, known)) if nearness >= NEAR => format!("; did you mean {known}?"),
        _ => String::new(),
    }
}

/// Returns the text of the regular file at `path`.
pub fn read_text(path: &Path) -> Result<String, ReadError> {
    String::from_utf8(read(path)?).map_err(|error| {
        let message = format!("{}; accepted: UTF-8", error.utf8_error());
        ReadError::new(path, io::ErrorKind::InvalidData, message)
    })
}

/// Returns the bytes of the regular file at `path`. Rejects anything else unread, because a pipe
/// could block the program and a device might never end.
pub fn read(path: &Path) -> Result<Vec<u8>, ReadError> {
    regular(path)?;
    fs::read(path).map_err(ReadError::of(path))
}

/// Returns the number of bytes of the regular file at `path`.
pub fn regular(path: &Path) -> Result<u64, ReadError> {
    let file = fs::metadata(path).map_err(ReadError::of(path))?;
    let (kind, found) = match file.is_file() {
        true => return Ok(file.len()),
        false if file.is_dir() => (io::ErrorKind::IsADirectory, "a folder"),
        false => (io::ErrorKind::InvalidInput, "not a regular file"),
    };
    Err(ReadError::new(path, kind, format!("{found}; accepted: a file")))
}

/// A failure to write a file.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot {action}: {source}", .path.display())]
pub struct WriteError {
    /// The file to write.
    pub path: PathBuf,
    /// The operation, after 'cannot'.
    pub action: &'static str,
    /// The system's error.
    pub source: io::Error,
}

impl WriteError {
    /// Returns a function for `map_err` that names the file and the operation.
    pub fn of(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self { path: path.to_owned(), action, source }
    }
}

/// Replaces the contents of the file at `path` by `bytes`. At any moment the file is the old one or
/// the complete new one.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    Reserved::new(path, 0, false)?.write(&[bytes])
}

/// A file whose space on the disk is reserved before its contents exist. A search of hours thus
/// learns at its beginning and not at its end that its result cannot be saved. Dropping it leaves
/// no file behind.
#[derive(Debug)]
pub struct Reserved {
    path: PathBuf,
    new: NamedTempFile,
    /// True if a file that somebody else creates meanwhile is not replaced.
    only_new: bool,
}

impl Reserved {
    /// Reserves `bytes` bytes in a file with a temporary name next to `path`. At the path that
    /// nobody gave there is no file yet: if somebody creates one meanwhile, `only_new` makes it
    /// stay, writing fails, and the error names the file with the bytes.
    pub fn new(path: &Path, bytes: usize, only_new: bool) -> Result<Self, WriteError> {
        // Renaming onto a symbolic link would replace the link instead of the file.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let mut new = create_beside(&path)?;
        reserve(new.as_file_mut(), bytes)
            .map_err(WriteError::of(&path, "reserve the file's space"))?;
        Ok(Self { path, new, only_new })
    }

    /// Writes the sections one after the other, syncs the file, and renames it. At any moment the
    /// file at the path is the old one or the complete new one.
    pub fn write(self, sections: &[&[u8]]) -> Result<(), WriteError> {
        let Self { path, mut new, only_new } = self;
        // The user may have removed it during hours of search.
        if !new.path().exists() {
            new = create_beside(&path)?;
        }
        overwrite(new.as_file_mut(), sections).map_err(WriteError::of(&path, "write the file"))?;
        let persisted = if only_new { new.persist_noclobber(&path) } else { new.persist(&path) };
        persisted.map_err(|unnamed| WriteError::of(&path, "replace the file")(keep(unnamed)))?;
        // The new name must outlast a loss of power. Where folders cannot be synced, the old file
        // may come back, complete.
        if let Ok(folder) = File::open(folder_of(&path)) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

/// Creates a file with a temporary name beside the file at `path`, and with the permissions of the
/// file there, because whoever may not read the old file may not read the new one.
fn create_beside(path: &Path) -> Result<NamedTempFile, WriteError> {
    let old = fs::metadata(path).ok();
    if path.file_name().is_none() || old.as_ref().is_some_and(|old| !old.is_file()) {
        let error = io::Error::other("not a regular file");
        return Err(WriteError::of(path, "replace the file")(error));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix("bvh-").suffix(".new");
    // Temporary files are private by default; this one becomes an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let new = builder
        .tempfile_in(folder_of(path))
        .map_err(WriteError::of(path, "write the file: cannot create a file there"))?;
    #[cfg(unix)]
    if let Some(old) = old {
        new.as_file()
            .set_permissions(old.permissions())
            .map_err(WriteError::of(path, "give the new file the old one's permissions"))?;
    }
    Ok(new)
}

/// Returns the folder of a file.
pub fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Fills the beginning of a new file. Written zeros reserve space on every file system; a mere
/// length may be a hole.
fn reserve(file: &mut File, bytes: usize) -> io::Result<()> {
    // The kernel caches large writes in large pages, which it maps faster than many small ones.
    const PIECE: usize = 1 << 21;
    if bytes == 0 {
        return Ok(());
    }
    let mut pieces = BufWriter::with_capacity(PIECE, file);
    io::copy(&mut io::repeat(0).take(bytes as u64), &mut pieces)?;
    pieces.flush()?;
    pieces.get_ref().sync_all()
}

fn overwrite(file: &mut File, sections: &[&[u8]]) -> io::Result<()> {
    file.rewind()?;
    sections.iter().try_for_each(|section| file.write_all(section))?;
    // The reserved space may be larger than the contents.
    let end = file.stream_position()?;
    file.set_len(end)?;
    file.sync_all()
}

/// Keeps a complete file that could not get its name, because the old file is in use on Windows or
/// is a folder by now. Returns the failure, which names the kept file.
fn keep(unnamed: tempfile::PersistError) -> io::Error {
    let tempfile::PersistError { error, file } = unnamed;
    match file.keep() {
        Ok((_, path)) => {
            let message = format!("{error}; the new file is complete, as {}", path.display());
            io::Error::new(error.kind(), message)
        }
        Err(_) => error,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<PathBuf> {
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect()
    }

    #[test]
    fn only_regular_files_are_read_and_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no/x.bvh");
        for (path, kind) in [
            (folder.path(), io::ErrorKind::IsADirectory),
            (missing.as_path(), io::ErrorKind::NotFound),
            #[cfg(unix)]
            (Path::new("/dev/zero"), io::ErrorKind::InvalidInput),
        ] {
            assert_eq!(read(path).unwrap_err().kind(), kind);
            assert!(Reserved::new(path, 1, false).is_err(), "{}", path.display());
        }
    }

    #[cfg(unix)]
    #[test]
    fn a_link_that_leads_nowhere_is_named_with_its_end() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dead.obj");
        std::os::unix::fs::symlink("nowhere.obj", &path).unwrap();
        let error = read(&path).unwrap_err().source.to_string();
        assert!(error.contains("nowhere.obj") && !error.contains("dead.obj"), "{error}");
    }

    #[test]
    fn a_reserved_file_replaces_the_old_one_only_when_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        fs::write(&path, "old").unwrap();
        for is_removed in [false, true] {
            let reserved = Reserved::new(&path, 1000, false).unwrap();
            assert_eq!(fs::metadata(reserved.new.path()).unwrap().len(), 1000);
            drop(reserved);
            assert_eq!((fs::read(&path).unwrap(), names(folder.path()).len()), (b"old".into(), 1));
            let reserved = Reserved::new(&path, 1000, false).unwrap();
            if is_removed {
                fs::remove_file(reserved.new.path()).unwrap();
            }
            reserved.write(&[b"the ", b"new"]).unwrap();
            assert_eq!(fs::read(&path).unwrap(), b"the new");
            assert_eq!(names(folder.path()).len(), 1);
            write(&path, b"old").unwrap();
        }
    }

    #[test]
    fn bytes_that_cannot_get_the_name_of_the_file_are_kept_under_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        let kept = |reserved: Reserved| {
            let error = reserved.write(&[b"the work of hours"]).unwrap_err().to_string();
            let kept = names(folder.path()).into_iter().find(|name| *name != path).unwrap();
            assert!(error.contains(&kept.display().to_string()), "{error}");
            assert_eq!(fs::read(&kept).unwrap(), b"the work of hours");
            fs::remove_file(kept).unwrap();
        };
        let reserved = Reserved::new(&path, 1000, false).unwrap();
        fs::create_dir(&path).unwrap();
        kept(reserved);
        fs::remove_dir(&path).unwrap();
        let reserved = Reserved::new(&path, 10, true).unwrap();
        fs::write(&path, "notes").unwrap();
        kept(reserved);
        assert_eq!(fs::read(&path).unwrap(), b"notes");
    }

    #[test]
    fn writers_of_one_file_at_the_same_time_all_succeed() {
        let folder = tempfile::tempdir().unwrap();
        let path = &folder.path().join("x.bvh");
        std::thread::scope(|scope| {
            for writer in 0..4 {
                scope.spawn(move || (0..50).for_each(|_| write(path, &[writer; 100]).unwrap()));
            }
        });
        let bytes = fs::read(path).unwrap();
        assert!(bytes.len() == 100 && bytes.iter().all(|byte| *byte == bytes[0]), "{bytes:?}");
        assert_eq!(names(folder.path()).len(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_and_a_file_has_the_permissions_of_the_old_one_or_those_of_any_new_file() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        let link = folder.path().join("link");
        symlink("x.bvh", &link).unwrap();
        fs::write(&path, "old").unwrap();
        let new = folder.path().join("new");
        write(&new, b"new").unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&new), mode(&path), "an ordinary file");
        for mode in [0o600, 0o666, 0o444] {
            fs::set_permissions(&path, PermissionsExt::from_mode(mode)).unwrap();
            write(&link, b"new").unwrap();
            assert!(link.is_symlink());
            assert_eq!(fs::read(&path).unwrap(), b"new");
            assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, mode);
        }
    }
}
