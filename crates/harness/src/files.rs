//! Files and folders: inputs are regular files, outputs are replaced whole, one harness writes to a folder at a time.

use crate::Error;
use crate::scenes::Scene;
use bvh_core::file::{FileError, TreeFile};
use bvh_core::{Bvh, validate_references};
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// The bytes of the regular file at `path`. Anything else is refused unread: a pipe could keep the program waiting for
/// ever, and a device need not end.
pub fn read(path: &Path) -> Result<Vec<u8>, Error> {
    let failed = |source: io::Error| match source.kind() {
        io::ErrorKind::NotFound => Error::Usage(format!("{}: no such file", path.display())),
        _ => Error::Io { path: path.to_owned(), action: "read the file", source },
    };
    let found = fs::metadata(path).map_err(failed)?;
    if !found.is_file() {
        let found = if found.is_dir() { "a folder" } else { "not a regular file" };
        return Err(Error::Usage(format!("{}: {found}; accepted: a file", path.display())));
    }
    fs::read(path).map_err(failed)
}

/// The text of the regular file at `path`.
pub fn read_text(path: &Path) -> Result<String, Error> {
    String::from_utf8(read(path)?)
        .map_err(|error| Error::Usage(format!("{}: {}; accepted: UTF-8", path.display(), error.utf8_error())))
}

/// The tree over a scene's objects in the file at `path`: refuses one that is damaged, or saved for another scene, and one
/// that is not [valid](validate_references) over these objects.
pub fn load_tree(path: &Path, scene: &Scene) -> Result<Bvh, Error> {
    let bytes = read(path)?;
    let refused = |source| Error::TreeFile { path: path.to_owned(), source };
    let tree = bvh_core::file::load(&bytes, &scene.boxes).map_err(refused)?;
    validate_references(&tree, &scene.boxes, &scene.primitives)
        .map_err(|invalid| refused(FileError::Tree(invalid)))?;
    Ok(tree)
}

/// Opens the bytes of a tree file; its name is for the error.
pub fn open_tree<'a>(path: &Path, bytes: &'a [u8]) -> Result<TreeFile<'a>, Error> {
    TreeFile::open(bytes).map_err(|source| Error::TreeFile { path: path.to_owned(), source })
}

/// Replaces the file at `path` by `bytes`: at any moment it is the old file or the whole new one.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    Reserved::new(path, 0)?.write(bytes)
}

/// Writes a new file and waits until it is on the disk.
pub fn write_synced(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let write = |path: &Path| {
        let mut file = File::create(path)?;
        file.write_all(bytes)?;
        file.sync_all()
    };
    write(path).map_err(Error::io(path, "write the file"))
}

/// The names of what a folder holds.
pub fn names(folder: &Path) -> Result<BTreeSet<String>, Error> {
    let entries = fs::read_dir(folder).map_err(Error::io(folder, "read the folder"))?;
    let name = |entry: io::Result<fs::DirEntry>| Ok(entry?.file_name().to_string_lossy().into_owned());
    entries.map(name).collect::<io::Result<_>>().map_err(Error::io(folder, "read the folder"))
}

/// Locks a folder of results against other harnesses until the file is dropped.
pub fn lock_folder(folder: &Path) -> Result<File, Error> {
    let (path, lock) = lock_file(folder)?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(fs::TryLockError::WouldBlock) => Err(Error::Busy(folder.to_owned())),
        Err(fs::TryLockError::Error(source)) => Err(Error::Io { path, action: "lock the file", source }),
    }
}

/// As [`lock_folder`], but waits for another harness, which holds this lock for moments only.
pub fn wait_for_folder(folder: &Path) -> Result<File, Error> {
    let (path, lock) = lock_file(folder)?;
    lock.lock().map_err(Error::io(&path, "lock the file"))?;
    Ok(lock)
}

fn lock_file(folder: &Path) -> Result<(PathBuf, File), Error> {
    let path = folder.join(".lock");
    // Neither truncated nor opened through a link, which could lead to somebody's file.
    if fs::symlink_metadata(&path).is_ok_and(|found| !found.is_file()) {
        let source = io::Error::other("it is not a regular file; remove it");
        return Err(Error::Io { path, action: "create the file", source });
    }
    let lock = File::options().write(true).create(true).truncate(false).open(&path);
    let lock = lock.map_err(Error::io(&path, "create the file"))?;
    Ok((path, lock))
}

/// How the names of files end that are not finished yet. Such a file is locked by its writer.
const UNFINISHED: &str = ".unfinished";

/// Removes the unfinished files of writers that were killed: those that nobody has locked.
fn remove_leftovers(folder: &Path, prefix: &str) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_file
            && name.starts_with(prefix)
            && name.ends_with(UNFINISHED)
            && File::open(entry.path()).is_ok_and(|file| file.try_lock().is_ok())
        {
            let _ = fs::remove_file(entry.path());
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
    pub fn new(path: &Path, bytes: usize) -> Result<Self, Error> {
        // A link stays, and its target is replaced.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let name = path.file_name().filter(|_| path.is_file() || !path.exists());
        let Some(name) = name else {
            return Err(Error::io(&path, "replace the file")(io::Error::other("not a regular file")));
        };
        let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let prefix = format!("{}.", name.to_string_lossy());
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(UNFINISHED);
        // The permissions of any new file, within the user's mask.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut unfinished = builder
            .tempfile_in(folder)
            .map_err(Error::io(&path, "write the file: cannot create a file there"))?;
        unfinished.as_file().try_lock().ok();
        remove_leftovers(folder, &prefix);
        let zeros = vec![0; bytes.min(PIECE)];
        (0..bytes)
            .step_by(PIECE)
            .try_for_each(|at| unfinished.write_all(&zeros[..zeros.len().min(bytes - at)]))
            .and_then(|()| if bytes > 0 { unfinished.as_file().sync_all() } else { Ok(()) })
            .map_err(Error::io(&path, "reserve the file's space"))?;
        Ok(Self { path, unfinished })
    }

    /// Writes the bytes, synced, and renames: at any moment there is the old file or the whole new one.
    pub fn write(self, bytes: &[u8]) -> Result<(), Error> {
        let Self { path, mut unfinished } = self;
        let write = |file: &mut File| {
            file.rewind()?;
            file.write_all(bytes)?;
            file.set_len(bytes.len() as u64)?;
            file.sync_all()
        };
        write(unfinished.as_file_mut()).map_err(Error::io(&path, "write the file"))?;
        let folder = path.parent().map(Path::to_owned);
        unfinished.persist(&path).map_err(|refused| Error::io(&path, "replace the file")(refused.error))?;
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
        Reserved::new(&path, 1000).unwrap().write(b"new").unwrap();
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
        assert!(!folder.path().join("x.bvh.abc.unfinished").exists());
        reserved.write(b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
    }

    #[cfg(unix)]
    #[test]
    fn a_lock_is_never_taken_through_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let precious = folder.path().join("precious");
        fs::write(&precious, "kept").unwrap();
        std::os::unix::fs::symlink(&precious, folder.path().join(".lock")).unwrap();
        assert!(matches!(lock_folder(folder.path()), Err(Error::Io { .. })));
        assert_eq!(fs::read(&precious).unwrap(), b"kept");
    }

    #[test]
    fn only_regular_files_are_replaced() {
        let folder = tempfile::tempdir().unwrap();
        for wrong in [folder.path(), &folder.path().join("no/x.bvh"), Path::new("/dev/null")] {
            assert!(matches!(Reserved::new(wrong, 1), Err(Error::Io { .. })), "{}", wrong.display());
        }
    }
}
