//! Searches that let other Python threads run, and that end with their time or after Ctrl-C.

use crate::elements::invalid;
use crate::scalars::SECONDS;
use crate::threads::{Follower, followed};
use bvh_search::{Event, Observer, prelude::*};
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

/// The limits of a search, and the function that follows it.
pub struct Limits {
    /// The time.
    pub seconds: Option<f64>,
    /// Nodes created or visited.
    pub work: Option<u64>,
    /// Called with the elapsed seconds and the lowest cost so far.
    pub progress: Option<Py<PyAny>>,
}

struct Watch {
    deadline: Option<Deadline>,
    pressed: AtomicBool,
    /// The bits of the lowest cost so far.
    cost: AtomicU64,
}

impl Observer for Watch {
    fn cancelled(&self) -> bool {
        let is_late = self.deadline.as_ref().is_some_and(Observer::cancelled);
        self.pressed.load(Relaxed) || is_late
    }

    fn progress(&self) -> Option<f64> {
        self.deadline.as_ref()?.progress()
    }

    fn event(&self, event: &Event) {
        self.cost.store(event.incumbent.to_bits(), Relaxed);
    }
}

fn duration(seconds: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds)
        .map_err(|_| invalid(format!("seconds is {seconds:?}; accepted: {SECONDS}")))
}

/// Runs `search` within its limits. Returns its result, and the exception that a signal handler or
/// the function `progress` has raised meanwhile.
pub fn run<T: Send>(
    py: Python,
    Limits { seconds, work, progress }: Limits,
    search: impl FnOnce(Budget, &dyn Observer) -> T + Send,
) -> PyResult<(T, PyResult<()>)> {
    let limit = seconds.map(duration).transpose()?;
    let budget = Budget { max_work: work, ..Budget::UNLIMITED };
    let watch = &Watch {
        deadline: limit.map(Deadline::after),
        pressed: AtomicBool::new(false),
        cost: AtomicU64::new(f64::INFINITY.to_bits()),
    };
    let cost = || f64::from_bits(watch.cost.load(Relaxed));
    let found = || search(budget, watch);
    followed(py, &Follower::new(progress), &watch.pressed, cost, found)
}
