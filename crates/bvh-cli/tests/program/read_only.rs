//! Folders without permission to write.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// A folder without permission to write until the value is dropped.
pub struct ReadOnly<'a>(&'a Path);

impl<'a> ReadOnly<'a> {
    /// Removes the permission to write; `None` if this user can still write there, which is always
    /// so on Windows.
    pub fn new(folder: &'a Path) -> Option<Self> {
        let this = Self(folder);
        // Modes do not stop root, but the attribute `immutable` does where the file system has it.
        this.set("555", "+i");
        let probe = folder.join("probe");
        let is_read_only = fs::write(&probe, "").is_err();
        let _ = fs::remove_file(probe);
        is_read_only.then_some(this)
    }

    fn set(&self, mode: &str, attribute: &str) {
        // An immutable folder's mode cannot be changed, so the attribute is removed first.
        for (program, argument) in [("chattr", "-i"), ("chmod", mode), ("chattr", attribute)] {
            let _ = Command::new(program).arg(argument).arg(self.0).stderr(Stdio::null()).status();
        }
    }
}

impl Drop for ReadOnly<'_> {
    fn drop(&mut self) {
        self.set("755", "-i");
    }
}
