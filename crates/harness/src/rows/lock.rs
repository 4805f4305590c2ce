//! Locks folders of results: one harness writes to a folder at a time.

use crate::Error;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Locks a folder of results against other harnesses until the file is dropped.
pub fn lock_folder(folder: &Path) -> Result<File, Error> {
    let (path, lock) = lock_file(folder)?;
    match lock.try_lock() {
        Ok(()) => Ok(lock),
        Err(fs::TryLockError::WouldBlock) => Err(Error::Busy(folder.to_owned())),
        Err(fs::TryLockError::Error(source)) => {
            Err(Error::Io { path, action: "lock the file", source })
        }
    }
}

/// Locks a folder like [`lock_folder`], but waits for another harness, which holds this lock for
/// moments only.
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
