//! The threads of this module, which survive a fork.

use crate::elements::invalid;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::mem::forget;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::Relaxed};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The longest time between a press of Ctrl-C and the reaction.
const NOTICE: Duration = Duration::from_millis(50);

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

/// The function that follows a search or a query.
pub struct Follower {
    pub progress: Option<Py<PyAny>>,
    pub start: Instant,
}

impl Follower {
    pub fn new(progress: Option<Py<PyAny>>) -> Self {
        Self { progress, start: Instant::now() }
    }

    /// Calls the function with the elapsed seconds and a state, `None` if it is infinite.
    fn tell(&self, py: Python, state: f64) -> PyResult<()> {
        if let Some(progress) = &self.progress {
            let known = state.is_finite().then_some(state);
            progress.call1(py, (self.start.elapsed().as_secs_f64(), known))?;
        }
        Ok(())
    }
}

/// Calls a function on the pool's threads as [`detached`] does, and meanwhile the signal handlers
/// and the follower. The first exception sets `stop`. Returns the result and that exception.
pub fn followed<T: Send>(
    py: Python,
    follower: &Follower,
    stop: &AtomicBool,
    state: impl Fn() -> f64 + Sync,
    function: impl FnOnce() -> T + Send,
) -> PyResult<(T, PyResult<()>)> {
    let react = |py: Python| {
        py.check_signals()?;
        follower.tell(py, state())
    };
    let pool = pool(py)?;
    let mut result = None;
    // Python runs signal handlers on its main thread only. The calling thread may be the main
    // thread, so another thread works while this one waits for signals.
    let raised = py.detach(|| {
        pool.in_place_scope(|scope| {
            let (sender, receiver) = channel::<()>();
            let result = &mut result;
            scope.spawn(move |_| {
                *result = Some(function());
                drop(sender);
            });
            let mut raised = Ok(());
            while receiver.recv_timeout(NOTICE) == Err(RecvTimeoutError::Timeout) {
                // Whoever has been stopped is about to end.
                if raised.is_ok() {
                    raised = Python::attach(react);
                    stop.store(raised.is_err(), Relaxed);
                }
            }
            raised
        })
    });
    Ok((result.expect("a scope passes panics on"), raised))
}

/// A call that answers many rays or points, a part of them at a time.
pub struct Query {
    stop: AtomicBool,
    /// The number of parts that have been answered.
    done: AtomicUsize,
}

impl Query {
    /// Calls a function that answers so many parts, until it ends or an exception is raised. An
    /// error of the function is a fault in the arguments.
    pub fn ask<T: Send>(
        py: Python,
        progress: Option<Py<PyAny>>,
        parts: usize,
        answer: impl FnOnce(&Self) -> Result<T, String> + Send,
    ) -> PyResult<T> {
        let query = &Self { stop: AtomicBool::new(false), done: AtomicUsize::new(0) };
        let follower = Follower::new(progress);
        let state = || query.done.load(Relaxed) as f64 / parts.max(1) as f64;
        let (answers, raised) = followed(py, &follower, &query.stop, state, || answer(query))?;
        raised?;
        let answers = answers.map_err(invalid)?;
        follower.tell(py, 1.0)?;
        Ok(answers)
    }

    /// Returns an error, which nobody sees, if an exception has been raised.
    pub fn go_on(&self) -> Result<(), String> {
        if self.stop.load(Relaxed) { Err(String::new()) } else { Ok(()) }
    }

    /// Calls a function for every part, by its number, on all threads.
    pub fn answer<P: Send>(
        &self,
        parts: impl IndexedParallelIterator<Item = P>,
        answer: impl Fn(usize, P) -> Result<(), String> + Sync,
    ) -> Result<(), String> {
        parts.enumerate().try_for_each(|(number, part)| {
            self.go_on()?;
            answer(number, part)?;
            self.done.fetch_add(1, Relaxed);
            Ok(())
        })
    }
}
