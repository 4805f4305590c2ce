//! The unfinished file next to a file that is being replaced: its name, its lock, its removal.

use crate::error::WriteError;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// The suffix of unfinished files. The writer of such a file has locked it.
const UNFINISHED: &str = ".unfinished";

/// The number of characters of a file's name in the name of its unfinished file, which has 18 bytes
/// more and may have 255. A character has at most four bytes.
const LONGEST_PREFIX: usize = 59;

/// The most links behind each other that a file system follows.
const MOST_LINKS: usize = 40;

/// Returns the file that a path leads to, even if the file does not exist yet. Renaming onto a
/// symbolic link would replace the link instead of its target. A loop of links remains a link.
pub fn behind_links(path: &Path) -> PathBuf {
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

/// Creates the unfinished file of the file at `path`, locked, in the same folder, and with the old
/// file's permissions. `path` must lead through no link; [`behind_links`] returns such a path.
pub fn create(path: &Path) -> Result<NamedTempFile, WriteError> {
    let name =
        path.file_name().filter(|_| path.is_file() || (!path.exists() && !path.is_symlink()));
    let Some(name) = name else {
        let error = io::Error::other("not a regular file");
        return Err(WriteError::of(path, "replace the file")(error));
    };
    let folder =
        path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = name.to_string_lossy();
    let beginning: String = name.chars().take(LONGEST_PREFIX).collect();
    let prefix = format!("{beginning}.");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(UNFINISHED);
    // Temporary files are private by default; this one becomes an ordinary file.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let unfinished = create_locked(|| builder.tempfile_in(folder))
        .map_err(WriteError::of(path, "write the file: cannot create a file there"))?;
    // Whoever may not read the old file may not read the new one.
    #[cfg(unix)]
    if let Ok(old) = fs::metadata(path) {
        unfinished
            .as_file()
            .set_permissions(old.permissions())
            .map_err(WriteError::of(path, "give the new file the old one's permissions"))?;
    }
    remove_leftovers(folder, &prefix);
    Ok(unfinished)
}

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Reserved;

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_missing_file_stays_and_a_loop_of_links_is_rejected() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        symlink("second", at("first")).unwrap();
        symlink(at("missing"), at("second")).unwrap();
        Reserved::new(&at("first"), 10).unwrap().write(b"new").unwrap();
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
        Reserved::new(&path, 10).unwrap().write(b"new").unwrap();
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
            Reserved::new(&path, 10).unwrap().write(b"new").unwrap();
            assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, mode);
        }
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
}
