//! The threads of this module, which survive a fork.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::mem::forget;
use std::process;
use std::sync::{Arc, Mutex, PoisonError};

/// The pool, with the process that made it. Only a thread that holds the interpreter's lock locks
/// this, and so does a thread that forks. No fork therefore copies a locked lock.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

/// Returns the pool of this process. A child process has a copy of its parent's pool but none of its
/// threads, for which it would wait forever; it gets a new pool.
pub fn pool(_holds_interpreter: Python) -> PyResult<Arc<ThreadPool>> {
    let mut pool = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = process::id();
    if let Some((owner, pool)) = pool.as_ref()
        && *owner == process
    {
        return Ok(pool.clone());
    }
    let new = ThreadPoolBuilder::new()
        .build()
        .map_err(|error| PyRuntimeError::new_err(format!("no threads can be started: {error}")))?;
    let new = Arc::new(new);
    // The end of the parent's pool would wait for its threads.
    forget(pool.replace((process, new.clone())));
    Ok(new)
}

/// Calls a function on the pool's threads while other Python threads run.
pub fn detached<T: Send>(py: Python, function: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool(py)?;
    Ok(py.detach(|| pool.install(function)))
}
