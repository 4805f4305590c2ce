//! The mark of the thread that improves or moves a tree.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::process;
use std::sync::atomic::{AtomicU32, Ordering};

const IMPROVING: &str =
    "another thread is improving this tree; accepted: `improve` when its call has returned";

/// The process of the thread that improves a tree, or `NOBODY`. A child process has a copy of its
/// parent's mark but none of its threads, so a mark of another process counts for nothing.
pub struct Improver(AtomicU32);

/// No process has this id.
const NOBODY: u32 = 0;

impl Improver {
    /// Returns the mark of a tree that no thread improves.
    pub fn nobody() -> Self {
        Self(AtomicU32::new(NOBODY))
    }

    /// Marks the tree until the returned value is dropped, or fails if a thread of this process has
    /// marked it. Never waits: that would block the interpreter and with it the other thread.
    pub fn begin(&self) -> PyResult<Improving<'_>> {
        let process = process::id();
        // The mark of another thread of this process remains as it was.
        if self.0.swap(process, Ordering::Acquire) == process {
            return Err(PyRuntimeError::new_err(IMPROVING));
        }
        Ok(Improving(self))
    }
}

/// The right to change a tree.
pub struct Improving<'a>(&'a Improver);

impl Drop for Improving<'_> {
    fn drop(&mut self) {
        self.0.0.store(NOBODY, Ordering::Release);
    }
}
