//! Replaces files as a whole: the new file is written next to the old one, synced, and renamed.

use crate::error::WriteError;
use crate::unfinished::{self, behind_links};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Replaces the contents of the file at `path` by `bytes`. At any moment the file is the old one or
/// the complete new one.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    Reserved::new(path, 0)?.write(bytes)
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
    /// True if a file that somebody else creates meanwhile is not replaced.
    only_new: bool,
}

impl Reserved {
    /// Reserves `bytes` bytes in a file with a temporary name next to `path`.
    pub fn new(path: &Path, bytes: usize) -> Result<Self, WriteError> {
        let path = behind_links(path);
        let mut unfinished = unfinished::create(&path)?;
        // Written zeros reserve space on every file system; a mere length may be a hole.
        let zeros = vec![0; bytes.min(PIECE)];
        (0..bytes)
            .step_by(PIECE)
            .map(|start| zeros.len().min(bytes - start))
            .try_for_each(|length| unfinished.write_all(&zeros[..length]))
            .and_then(|()| if bytes > 0 { unfinished.as_file().sync_all() } else { Ok(()) })
            .map_err(WriteError::of(&path, "reserve the file's space"))?;
        Ok(Self { path, unfinished, ahead: 0..0, only_new: false })
    }

    /// Reserves like [`new`](Self::new) for a name that nobody gave, at which there is no file. If
    /// somebody creates one meanwhile, it stays: writing then fails, and keeps the bytes under
    /// another name, which the error names.
    pub fn new_file(path: &Path, bytes: usize) -> Result<Self, WriteError> {
        let reserved = Self::new(path, bytes)?;
        Ok(Self { only_new: true, ..reserved })
    }

    /// Writes and syncs sections that begin at byte `start` of the file, while the caller still
    /// computes the others. [`write_sections`](Self::write_sections) must get the same sections at
    /// the same place, and does not write them again.
    pub fn write_ahead(&mut self, start: u64, sections: &[&[u8]]) -> Result<(), WriteError> {
        self.replace_lost()?;
        let file = self.unfinished.as_file_mut();
        let end = file
            .seek(SeekFrom::Start(start))
            .and_then(|_| sections.iter().try_for_each(|section| file.write_all(section)))
            .and_then(|()| file.sync_data())
            .and_then(|()| file.stream_position())
            .map_err(WriteError::of(&self.path, "write the file"))?;
        self.ahead = start..end;
        Ok(())
    }

    /// Creates the unfinished file again if the user has removed it during hours of search.
    fn replace_lost(&mut self) -> Result<(), WriteError> {
        if !self.unfinished.path().exists() {
            let again = Self::new(&self.path, 0)?;
            *self = Self { only_new: self.only_new, ..again };
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
        let Self { path, mut unfinished, ahead, only_new } = self;
        overwrite(unfinished.as_file_mut(), sections, &ahead)
            .map_err(WriteError::of(&path, "write the file"))?;
        let folder = path.parent().map(Path::to_owned);
        let persisted =
            if only_new { unfinished.persist_noclobber(&path) } else { unfinished.persist(&path) };
        let file =
            persisted.map_err(|failed| WriteError::of(&path, "replace the file")(kept(failed)))?;
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
    use std::fs;

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
        let kept = entries.find(|entry| entry.path() != path).unwrap().path();
        assert_eq!(fs::read(&kept).unwrap(), b"found in hours");
        assert!(error.to_string().contains(&kept.display().to_string()), "{error}");
    }

    #[test]
    fn a_file_that_somebody_creates_at_a_name_that_nobody_gave_stays_and_both_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.bvh");
        let reserved = Reserved::new_file(&path, 10).unwrap();
        fs::write(&path, "notes").unwrap();
        let error = reserved.write(b"found in hours").unwrap_err();
        assert_eq!(fs::read(&path).unwrap(), b"notes");
        let mut entries = fs::read_dir(folder.path()).unwrap().flatten();
        let kept = entries.find(|entry| entry.path() != path).unwrap().path();
        assert_eq!(fs::read(&kept).unwrap(), b"found in hours");
        let name = kept.display().to_string();
        assert!(error.to_string().contains(&name), "{error}");
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
