//! Replaces files whole: what is new is written beside the old file, synced, and renamed.

use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// A failure to write a file.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot {action}: {source}", .path.display())]
pub struct WriteError {
    /// The file that was to be written.
    pub path: PathBuf,
    /// The operation, after 'cannot'.
    pub action: &'static str,
    /// Why it failed.
    pub source: io::Error,
}

impl WriteError {
    fn of(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self { path: path.to_owned(), action, source }
    }
}

/// Replaces the file at `path` by `bytes`: at any moment it is the old file or the whole new one.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    Reserved::new(path, 0)?.write(bytes)
}

/// How the names of files end that are not finished yet. Such a file is locked by its writer.
const UNFINISHED: &str = ".unfinished";

/// Removes the unfinished files of writers that were killed: those that nobody has locked.
fn remove_leftovers(folder: &Path, prefix: &str) {
    for entry in fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
    {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if !(is_file && name.starts_with(prefix) && name.ends_with(UNFINISHED)) {
            continue;
        }
        let Ok(leftover) = File::open(entry.path()) else { continue };
        if leftover.try_lock().is_ok() {
            // Removed under the lock: see `create_locked`.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// A new file that no other writer removes, by `create`, which makes one under a name that there was not.
///
/// Between its creation and its lock another writer may take the file for a leftover. That writer removes it under the lock, so that
/// whoever has the lock afterwards knows: where the name is gone, so is the file, and where it is still there, nobody removes it.
fn create_locked(
    mut create: impl FnMut() -> io::Result<NamedTempFile>,
) -> io::Result<NamedTempFile> {
    loop {
        let file = create()?;
        // Where files cannot be locked, nobody removes any.
        let _ = file.as_file().lock();
        if file.path().exists() {
            return Ok(file);
        }
    }
}

/// Bytes of a reserved file written at a time. In large pieces, because the kernel caches large writes in large pages,
/// which it maps faster than many small ones.
const PIECE: usize = 1 << 21;

/// A file to be written later whose space on the disk is taken now: a search of hours learns at its beginning, not at
/// its end, that its result cannot be kept. Leaves nothing behind if it is dropped unwritten.
#[derive(Debug)]
pub struct Reserved {
    path: PathBuf,
    unfinished: NamedTempFile,
}

impl Reserved {
    /// Takes `bytes` bytes in a file of another name beside `path`.
    pub fn new(path: &Path, bytes: usize) -> Result<Self, WriteError> {
        // A link stays, and its target is replaced.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let name = path
            .file_name()
            .filter(|_| path.is_file() || !path.exists());
        let Some(name) = name else {
            return Err(WriteError::of(&path, "replace the file")(io::Error::other(
                "not a regular file",
            )));
        };
        let folder = path
            .parent()
            .filter(|parent| !parent.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let prefix = format!("{}.", name.to_string_lossy());
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(UNFINISHED);
        // The permissions of any new file, within the user's mask.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut unfinished = create_locked(|| builder.tempfile_in(folder))
            .map_err(WriteError::of(&path, "write the file: cannot create a file there"))?;
        remove_leftovers(folder, &prefix);
        let zeros = vec![0; bytes.min(PIECE)];
        (0..bytes)
            .step_by(PIECE)
            .try_for_each(|at| unfinished.write_all(&zeros[..zeros.len().min(bytes - at)]))
            .and_then(|()| if bytes > 0 { unfinished.as_file().sync_all() } else { Ok(()) })
            .map_err(WriteError::of(&path, "reserve the file's space"))?;
        Ok(Self { path, unfinished })
    }

    /// Writes the bytes, synced, and renames: at any moment there is the old file or the whole new one.
    pub fn write(self, bytes: &[u8]) -> Result<(), WriteError> {
        let Self { path, mut unfinished } = self;
        // Somebody else may have removed the file during hours of search.
        if !unfinished.path().exists() {
            unfinished = Self::new(&path, 0)?.unfinished;
        }
        let write = |file: &mut File| {
            file.rewind()?;
            file.write_all(bytes)?;
            file.set_len(bytes.len() as u64)?;
            file.sync_all()
        };
        write(unfinished.as_file_mut()).map_err(WriteError::of(&path, "write the file"))?;
        let folder = path.parent().map(Path::to_owned);
        unfinished
            .persist(&path)
            .map_err(|refused| WriteError::of(&path, "replace the file")(refused.error))?;
        // Where folders can be synced, the new name outlasts a loss of power, too; the file is safe in any case.
        if let Some(folder) = folder.and_then(|folder| File::open(folder).ok()) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reserved_file_replaces_the_old_one_only_when_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        fs::write(&path, "old").unwrap();
        let names = || fs::read_dir(folder.path()).unwrap().count();
        let reserved = Reserved::new(&path, 1000).unwrap();
        assert_eq!((fs::read(&path).unwrap(), names()), (b"old".to_vec(), 2));
        drop(reserved);
        assert_eq!((fs::read(&path).unwrap(), names()), (b"old".to_vec(), 1));
        Reserved::new(&path, 1000)
            .unwrap()
            .write(b"new")
            .unwrap();
        assert_eq!((fs::read(&path).unwrap(), names()), (b"new".to_vec(), 1));
    }

    #[test]
    fn the_leftovers_of_killed_writers_are_removed_and_no_other_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        let reserved = Reserved::new(&path, 10).unwrap();
        for name in ["x.bvh.abc.unfinished", "y.bvh.abc.unfinished", "x.bvh.txt"] {
            fs::write(folder.path().join(name), "").unwrap();
        }
        write(&path, b"first").unwrap();
        assert!(
            !folder
                .path()
                .join("x.bvh.abc.unfinished")
                .exists()
        );
        reserved.write(b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[test]
    fn a_file_that_another_writer_removes_before_it_is_locked_is_created_anew() {
        let folder = tempfile::tempdir().unwrap();
        let create = || {
            tempfile::Builder::new()
                .prefix("x.")
                .suffix(UNFINISHED)
                .tempfile_in(folder.path())
        };
        let mut times = 0;
        let file = create_locked(|| {
            times += 1;
            let file = create();
            if times == 1 {
                remove_leftovers(folder.path(), "x.");
            }
            file
        });
        let file = file.unwrap();
        remove_leftovers(folder.path(), "x.");
        assert!(file.path().exists() && times == 2);
    }

    #[test]
    fn a_reserved_file_that_somebody_removes_is_written_all_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        let reserved = Reserved::new(&path, 1000).unwrap();
        fs::remove_file(reserved.unfinished.path()).unwrap();
        reserved.write(b"found in hours").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"found in hours");
    }

    #[test]
    fn writers_of_one_file_at_the_same_time_all_succeed() {
        const WRITERS: usize = 4;
        const TIMES: usize = 200;
        let folder = tempfile::tempdir().unwrap();
        let path = &folder.path().join("x.bvh");
        let write_often =
            |writer: usize| (0..TIMES).try_for_each(|_| write(path, &[writer as u8; 100]));
        let results: Vec<Result<(), WriteError>> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..WRITERS)
                .map(|writer| scope.spawn(move || write_often(writer)))
                .collect();
            threads
                .into_iter()
                .map(|thread| thread.join().unwrap())
                .collect()
        });
        assert!(results.iter().all(Result::is_ok), "{results:?}");
        let bytes = fs::read(path).unwrap();
        assert!(bytes.len() == 100 && bytes.iter().all(|byte| *byte == bytes[0]), "{bytes:?}");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn only_regular_files_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        for wrong in [folder.path(), &folder.path().join("no/x.bvh"), Path::new("/dev/null")] {
            assert!(
                matches!(Reserved::new(wrong, 1), Err(WriteError { .. })),
                "{}",
                wrong.display()
            );
        }
    }
}
