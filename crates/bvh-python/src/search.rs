//! Searches that let other Python threads run, end with their time, and sooner when Ctrl-C is pressed.

use crate::arrays::refused;
use bvh_search::{Observer, prelude::*};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;

/// How long a press of Ctrl-C may go unnoticed.
const NOTICE: Duration = Duration::from_millis(50);

/// A time limit, and whether Ctrl-C was pressed before it.
struct Watch {
    deadline: Deadline,
    pressed: AtomicBool,
}

impl Observer for Watch {
    fn cancelled(&self) -> bool {
        self.pressed.load(Relaxed) || self.deadline.cancelled()
    }

    fn progress(&self) -> Option<f64> {
        self.deadline.progress()
    }
}

/// What `search` finds in so many seconds, and what a handler of signals raised meanwhile.
pub fn searched<T: Send>(
    py: Python,
    seconds: f64,
    search: impl FnOnce(&dyn Observer) -> T + Send,
) -> PyResult<(T, PyResult<()>)> {
    let limit = Duration::try_from_secs_f64(seconds);
    let limit =
        limit.map_err(|_| refused(format!("seconds is {seconds}; accepted: 0 or more, finite")))?;
    let watch = &Watch { deadline: Deadline::after(limit), pressed: AtomicBool::new(false) };
    // Python hands signals to its main thread only, which is the one that called, if any. So another one searches.
    Ok(py.detach(|| {
        thread::scope(|scope| {
            let (sender, receiver) = channel();
            scope.spawn(move || sender.send(search(watch)));
            let mut raised = Ok(());
            loop {
                match receiver.recv_timeout(NOTICE) {
                    Ok(found) => return (found, raised),
                    Err(RecvTimeoutError::Disconnected) => {
                        panic!("the search ended without a tree")
                    }
                    Err(RecvTimeoutError::Timeout) if raised.is_ok() => {
                        raised = Python::attach(|py| py.check_signals());
                        watch.pressed.store(raised.is_err(), Relaxed);
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                }
            }
        })
    }))
}
