//! Replaces files as a whole: the new file is written next to the old one, synced, and renamed.

use std::fs::{self, File};
use std::io::{self, Seek, SeekFrom, Write};
use std::ops::Range;
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
    /// The system's error.
    pub source: io::Error,
}

impl WriteError {
    fn of(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self { path: path.to_owned(), action, source }
    }
}

/// Replaces the contents of the file at `path` by `bytes`. At any moment the file is the old one or
/// the complete new one.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    Reserved::new(path, 0)?.write(bytes)
}

/// The suffix of unfinished files. The writer of such a file has locked it.
const UNFINISHED: &str = ".unfinished";

/// Removes the unfinished files of killed writers, which no process has locked.
fn remove_leftovers(folder: &Path, prefix: &str) {
    // A leftover does no harm, so failures are ignored.
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if !(is_file && name.starts_with(prefix) && name.ends_with(UNFINISHED)) {
            continue;
        }
        let Ok(leftover) = File::open(entry.path()) else { continue };
        if leftover.try_lock().is_ok() {
            // The lock must still be held here; `create_locked` explains why.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Creates a file that no other writer removes; `create` makes a file with an unused name.
///
/// Between the creation and the lock another writer may mistake the file for a leftover. That
/// writer removes the file while it holds the lock. After this writer gets the lock, it can
/// therefore rely on the name: if the name is gone, so is the file; if it exists, no writer will
/// remove it.
fn create_locked(
    mut create: impl FnMut() -> io::Result<NamedTempFile>,
) -> io::Result<NamedTempFile> {
    loop {
        let file = create()?;
        // On a file system without locks no writer removes any file.
        let _ = file.as_file().lock();
        if file.path().exists() {
            return Ok(file);
        }
    }
}

/// The number of bytes of a reserved file that are written at a time. The kernel caches large
/// writes in large pages, which it maps faster than many small ones.
const PIECE: usize = 1 << 21;

/// A file whose space on the disk is reserved before its contents exist. A search of hours thus
/// learns at its beginning and not at its end that its result cannot be saved. Dropping it leaves
/// no file behind.
#[derive(Debug)]
pub struct Reserved {
    path: PathBuf,
    unfinished: NamedTempFile,
    /// The bytes that have been written ahead.
    ahead: Range<u64>,
}

/// The number of characters of a file's name in the name of its unfinished file, which has 18 bytes
/// more and may have 255. A character has at most four bytes.
const LONGEST_PREFIX: usize = 59;

/// The most links behind each other that a file system follows.
const MOST_LINKS: usize = 40;

/// Returns the file that a path leads to, even if the file does not exist yet. Renaming onto a
/// symbolic link would replace the link instead of its target. A loop of links remains a link.
fn behind_links(path: &Path) -> PathBuf {
    if let Ok(found) = fs::canonicalize(path) {
        return found;
    }
    let mut path = path.to_owned();
    for _ in 0..MOST_LINKS {
        let Ok(target) = fs::read_link(&path) else { break };
        path = path.with_file_name("").join(target);
    }
    path
}

impl Reserved {
    /// Reserves `bytes` bytes in a file with a temporary name next to `path`.
    pub fn new(path: &Path, bytes: usize) -> Result<Self, WriteError> {
        let path = behind_links(path);
        let name = path
            .file_name()
            .filter(|_| path.is_file() || (!path.exists() && !path.is_symlink()));
        let Some(name) = name else {
            return Err(WriteError::of(&path, "replace the file")(io::Error::other(
                "not a regular file",
            )));
        };
        let folder = path
            .parent()
            .filter(|parent| !parent.as_os_str().is_empty())
            .unwrap_or(Path::new("."));
        let name = name.to_string_lossy();
        let beginning: String = name.chars().take(LONGEST_PREFIX).collect();
        let prefix = format!("{beginning}.");
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(UNFINISHED);
        // Temporary files are private by default; this one becomes an ordinary file.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut unfinished = create_locked(|| builder.tempfile_in(folder))
            .map_err(WriteError::of(&path, "write the file: cannot create a file there"))?;
        // Whoever may not read the old file may not read the new one.
        #[cfg(unix)]
        if let Ok(old) = fs::metadata(&path) {
            unfinished
                .as_file()
                .set_permissions(old.permissions())
                .map_err(WriteError::of(&path, "give the new file the old one's permissions"))?;
        }
        remove_leftovers(folder, &prefix);
        // Written zeros reserve space on every file system; a mere length may be a hole.
        let zeros = vec![0; bytes.min(PIECE)];
        (0..bytes)
            .step_by(PIECE)
            .map(|start| zeros.len().min(bytes - start))
            .try_for_each(|length| unfinished.write_all(&zeros[..length]))
            .and_then(|()| if bytes > 0 { unfinished.as_file().sync_all() } else { Ok(()) })
            .map_err(WriteError::of(&path, "reserve the file's space"))?;
        Ok(Self { path, unfinished, ahead: 0..0 })
    }

    /// Writes and syncs sections that begin at byte `start` of the file, while the caller still
    /// computes the others. [`write_sections`](Self::write_sections) must get the same sections at
    /// the same place, and does not write them again.
    pub fn write_ahead(&mut self, start: u64, sections: &[&[u8]]) -> Result<(), WriteError> {
        self.replace_lost()?;
        let file = self.unfinished.as_file_mut();
        let end = file
            .seek(SeekFrom::Start(start))
            .and_then(|_| {
                sections
                    .iter()
                    .try_for_each(|section| file.write_all(section))
            })
            .and_then(|()| file.sync_data())
            .and_then(|()| file.stream_position())
            .map_err(WriteError::of(&self.path, "write the file"))?;
        self.ahead = start..end;
        Ok(())
    }

    /// Creates the unfinished file again if the user has removed it during hours of search.
    fn replace_lost(&mut self) -> Result<(), WriteError> {
        if !self.unfinished.path().exists() {
            *self = Self::new(&self.path, 0)?;
        }
        Ok(())
    }

    /// Writes the bytes, syncs the file, and renames it. At any moment the file at the path is the
    /// old one or the complete new one.
    pub fn write(self, bytes: &[u8]) -> Result<(), WriteError> {
        self.write_sections(&[bytes])
    }

    /// Writes the sections one after the other like [`write`](Self::write).
    pub fn write_sections(mut self, sections: &[&[u8]]) -> Result<(), WriteError> {
        self.replace_lost()?;
        let Self { path, mut unfinished, ahead } = self;
        overwrite(unfinished.as_file_mut(), sections, &ahead)
            .map_err(WriteError::of(&path, "write the file"))?;
        let folder = path.parent().map(Path::to_owned);
        let file = unfinished
            .persist(&path)
            .map_err(|failed| WriteError::of(&path, "replace the file")(kept(failed)))?;
        // On Windows a lock keeps others from reading, and may outlast the file that holds it.
        let _ = file.unlock();
        // Syncing the folder makes the new name outlast a loss of power. Where that is impossible,
        // the old file may come back, complete.
        if let Some(folder) = folder.and_then(|folder| File::open(folder).ok()) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

/// Keeps a complete file that could not get its name, because the old file is in use on Windows or
/// is a folder by now. Returns the failure, which names the kept file.
fn kept(failed: tempfile::PersistError) -> io::Error {
    let tempfile::PersistError { error, file } = failed;
    // With another suffix it is no leftover, which the next writer would remove.
    let path = file.path().with_extension("kept");
    let message = match file.persist_noclobber(&path) {
        Ok(_) => format!("{error}; the new file is complete, as {}", path.display()),
        Err(_) => return error,
    };
    io::Error::new(error.kind(), message)
}

/// Writes the sections to the beginning of the file, except those whose bytes are `ahead`.
fn overwrite(file: &mut File, sections: &[&[u8]], ahead: &Range<u64>) -> io::Result<()> {
    let mut start = 0;
    for section in sections {
        let end = start + section.len() as u64;
        if start < ahead.start || end > ahead.end {
            file.seek(SeekFrom::Start(start))?;
            file.write_all(section)?;
        }
        start = end;
    }
    // The reserved space may be larger than the contents.
    file.set_len(start)?;
    file.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reserved_file_replaces_the_old_one_only_when_it_is_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        fs::write(&path, "old").unwrap();
        let reserved = Reserved::new(&path, 1000).unwrap();
        assert_eq!((fs::read(&path).unwrap(), count(&folder)), (b"old".to_vec(), 2));
        drop(reserved);
        assert_eq!((fs::read(&path).unwrap(), count(&folder)), (b"old".to_vec(), 1));
        let reserved = Reserved::new(&path, 1000).unwrap();
        reserved.write(b"new").unwrap();
        assert_eq!((fs::read(&path).unwrap(), count(&folder)), (b"new".to_vec(), 1));
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_missing_file_stays_and_a_loop_of_links_is_rejected() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        symlink("second", at("first")).unwrap();
        symlink(at("missing"), at("second")).unwrap();
        Reserved::new(&at("first"), 10)
            .unwrap()
            .write(b"new")
            .unwrap();
        assert_eq!(fs::read(at("missing")).unwrap(), b"new");
        assert!(at("first").is_symlink() && at("second").is_symlink());
        symlink("a", at("b")).unwrap();
        symlink("b", at("a")).unwrap();
        assert!(Reserved::new(&at("a"), 10).is_err());
        assert!(at("a").is_symlink());
    }

    #[test]
    fn a_name_may_be_as_long_as_the_file_system_permits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a".repeat(255));
        Reserved::new(&path, 10)
            .unwrap()
            .write(b"new")
            .unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[cfg(unix)]
    #[test]
    fn a_new_file_has_the_permissions_of_the_old_one() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        fs::write(&path, "old").unwrap();
        for mode in [0o600, 0o666, 0o444] {
            fs::set_permissions(&path, PermissionsExt::from_mode(mode)).unwrap();
            Reserved::new(&path, 10)
                .unwrap()
                .write(b"new")
                .unwrap();
            assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, mode);
        }
    }

    #[test]
    fn sections_that_were_written_ahead_are_not_written_again() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        let sections = [&b"head"[..], b"one", b"two", b"end"];
        let mut reserved = Reserved::new(&path, 1000).unwrap();
        reserved.write_ahead(4, &sections[1..3]).unwrap();
        // Other bytes at their place show which sections are written.
        let shown = [&b"HEAD"[..], b"ONE", b"TWO", b"END"];
        reserved.write_sections(&shown).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"HEADonetwoEND");
        // The user removes the unfinished file after its sections were written.
        let mut reserved = Reserved::new(&path, 1000).unwrap();
        reserved.write_ahead(4, &sections[1..3]).unwrap();
        fs::remove_file(reserved.unfinished.path()).unwrap();
        reserved.write_sections(&shown).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"HEADONETWOEND");
        assert_eq!(count(&folder), 1);
    }

    fn count(folder: &tempfile::TempDir) -> usize {
        fs::read_dir(folder.path()).unwrap().count()
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
        let leftover = folder.path().join("x.bvh.abc.unfinished");
        assert!(!leftover.exists());
        reserved.write(b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(count(&folder), 3);
    }

    #[test]
    fn a_file_that_another_writer_removes_before_the_lock_is_created_again() {
        let folder = tempfile::tempdir().unwrap();
        let mut builder = tempfile::Builder::new();
        builder.prefix("x.").suffix(UNFINISHED);
        let mut times = 0;
        let file = create_locked(|| {
            times += 1;
            let file = builder.tempfile_in(folder.path());
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
    fn a_reserved_file_that_the_user_removes_is_written_nevertheless() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        let reserved = Reserved::new(&path, 1000).unwrap();
        fs::remove_file(reserved.unfinished.path()).unwrap();
        reserved.write(b"found in hours").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"found in hours");
    }

    #[test]
    fn bytes_that_cannot_get_the_name_of_the_file_are_kept_under_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        let reserved = Reserved::new(&path, 1000).unwrap();
        fs::create_dir(&path).unwrap();
        let error = reserved.write(b"found in hours").unwrap_err();
        fs::remove_dir(&path).unwrap();
        // The next writer removes no kept file.
        write(&path, b"later").unwrap();
        let mut entries = fs::read_dir(folder.path()).unwrap().flatten();
        let kept = entries
            .find(|entry| entry.path() != path)
            .unwrap()
            .path();
        assert_eq!(fs::read(&kept).unwrap(), b"found in hours");
        assert!(
            error
                .to_string()
                .contains(&kept.display().to_string()),
            "{error}"
        );
    }

    #[test]
    fn writers_of_one_file_at_the_same_time_all_succeed() {
        const WRITERS: usize = 4;
        const TIMES: usize = 200;
        let folder = tempfile::tempdir().unwrap();
        let path = &folder.path().join("x.bvh");
        // The scope joins the threads and panics if one of them has.
        std::thread::scope(|scope| {
            for writer in 0..WRITERS {
                scope.spawn(move || {
                    for _ in 0..TIMES {
                        write(path, &[writer as u8; 100]).unwrap();
                    }
                });
            }
        });
        let bytes = fs::read(path).unwrap();
        assert!(bytes.len() == 100 && bytes.iter().all(|byte| *byte == bytes[0]), "{bytes:?}");
        assert_eq!(count(&folder), 1);
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
