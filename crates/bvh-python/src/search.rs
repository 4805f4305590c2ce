//! Searches that let other Python threads run, and that end with their time or after Ctrl-C.

use crate::arrays::invalid;
use bvh_search::{Observer, prelude::*};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;

/// The longest time between a press of Ctrl-C and the reaction.
const NOTICE: Duration = Duration::from_millis(50);

/// Ends a search at its deadline or after Ctrl-C.
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

/// Runs `search` for `seconds`. Returns its result, and the exception that a signal handler has
/// raised meanwhile.
pub fn searched<T: Send>(
    py: Python,
    seconds: f64,
    search: impl FnOnce(&dyn Observer) -> T + Send,
) -> PyResult<(T, PyResult<()>)> {
    let limit = Duration::try_from_secs_f64(seconds)
        .map_err(|_| invalid(format!("seconds is {seconds}; accepted: 0 or more, finite")))?;
    let watch = &Watch { deadline: Deadline::after(limit), pressed: AtomicBool::new(false) };
    // Python runs signal handlers on its main thread only. The calling thread may be the main
    // thread, so a second thread searches while this one waits for signals.
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
                    // The search has been cancelled and is about to end.
                    Err(RecvTimeoutError::Timeout) => {}
                }
            }
        })
    }))
}
