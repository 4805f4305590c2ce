//! Tree files on disk: read with every check, replaced whole.

use crate::Error;
use bvh_core::file::{FileError, TreeFile};
use bvh_core::{Aabb, Bvh, validate};
use std::fs::{self, File};
use std::io::{self, Seek, Write};
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// The tree over `boxes` in the file at `path`: refuses one that is damaged, or saved for another scene, and one that
/// is not [valid](validate) over these boxes.
pub fn load_tree(path: &Path, boxes: &[Aabb]) -> Result<Bvh, Error> {
    let bytes = read(path)?;
    let refused = |source| Error::TreeFile { path: path.to_owned(), source };
    let tree = bvh_core::file::load(&bytes, boxes).map_err(refused)?;
    validate(&tree, boxes).map_err(|invalid| refused(FileError::Tree(invalid)))?;
    Ok(tree)
}

/// The bytes of the file at `path`.
pub fn read(path: &Path) -> Result<Vec<u8>, Error> {
    fs::read(path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => Error::Usage(format!("{}: no such file", path.display())),
        io::ErrorKind::IsADirectory => Error::Usage(format!("{}: a folder, not a tree file", path.display())),
        _ => Error::Io { path: path.to_owned(), action: "read the file", source },
    })
}

/// Opens the bytes of a tree file; its name is for the error.
pub fn open<'a>(path: &Path, bytes: &'a [u8]) -> Result<TreeFile<'a>, Error> {
    TreeFile::open(bytes).map_err(|source| Error::TreeFile { path: path.to_owned(), source })
}

/// Bytes of a reserved file written at a time.
const PIECE: usize = 1 << 21;

/// A file to be written later, its place on the disk taken now: whoever searches for hours is told before, not
/// after, that the result cannot be kept. Dropped, it leaves nothing behind.
#[derive(Debug)]
pub struct Reserved {
    path: PathBuf,
    unfinished: NamedTempFile,
}

impl Reserved {
    /// Takes `bytes` bytes beside `path`, under another name.
    pub fn new(path: &Path, bytes: usize) -> Result<Self, Error> {
        // Links are followed: what they lead to is replaced, not they.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let name = path.file_name().filter(|_| !path.is_dir());
        let Some(name) = name else {
            return Err(Error::Usage(format!("{} is a folder; a file is to be written", path.display())));
        };
        if path.exists() && !path.is_file() {
            return Err(Error::Usage(format!("{} is not a regular file", path.display())));
        }
        let folder = path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let prefix = format!("{}.", name.to_string_lossy());
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(".unfinished");
        // As for any new file: what the user's mask leaves of it.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut unfinished = builder.tempfile_in(folder).map_err(Error::io(folder, "create a file there"))?;
        // In large pieces: the kernel keeps the file in memory in such, and maps few large ones faster than many small.
        let zeros = vec![0; bytes.min(PIECE)];
        (0..bytes)
            .step_by(PIECE)
            .try_for_each(|at| unfinished.write_all(&zeros[..zeros.len().min(bytes - at)]))
            .and_then(|()| unfinished.as_file().sync_all())
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
        // The file is safe in any case; its new name outlasts a loss of power once the folder is synced too, where
        // folders can be.
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
    fn what_is_no_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        assert!(matches!(Reserved::new(folder.path(), 1), Err(Error::Usage(_))));
        assert!(matches!(Reserved::new(&folder.path().join("no/x.bvh"), 1), Err(Error::Io { .. })));
        #[cfg(unix)]
        assert!(matches!(Reserved::new(Path::new("/dev/null"), 1), Err(Error::Usage(_))));
    }
}
