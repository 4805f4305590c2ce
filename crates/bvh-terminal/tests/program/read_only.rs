//! Folders that cannot be written into.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Makes a folder unwritable, for root too where the file system can; undone when dropped.
#[cfg(unix)]
pub struct ReadOnly<'a>(&'a Path);

#[cfg(unix)]
impl<'a> ReadOnly<'a> {
    /// `None` if this user can write there all the same.
    pub fn new(folder: &'a Path) -> Option<Self> {
        let this = Self(folder);
        this.set("555", "+i");
        let probe = folder.join("probe");
        let refused = fs::write(&probe, "").is_err();
        let _ = fs::remove_file(probe);
        refused.then_some(this)
    }

    fn set(&self, mode: &str, attribute: &str) {
        for (program, argument) in [("chattr", "-i"), ("chmod", mode), ("chattr", attribute)] {
            let _ = Command::new(program)
                .arg(argument)
                .arg(self.0)
                .stderr(Stdio::null())
                .status();
        }
    }
}

#[cfg(unix)]
impl Drop for ReadOnly<'_> {
    fn drop(&mut self) {
        self.set("755", "-i");
    }
}
