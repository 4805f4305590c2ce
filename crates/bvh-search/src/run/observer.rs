//! How a caller follows a search, and stops it.

use bvh_build::Watch;

/// One point of a search's history: a trial, a generation, or an improvement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Trees or moves evaluated so far, including this one.
    pub evaluations: u64,
    /// Nodes created or visited so far.
    pub work: u64,
    /// The cost found now.
    pub cost: f64,
    /// The lowest cost so far.
    pub incumbent: f64,
}

/// Nodes visited between two polls of an observer: less than a millisecond, whatever a single move takes.
pub(crate) const WORK_PER_POLL: u64 = 1 << 14;

/// Follows a search from outside, from any thread. `()` watches nothing.
pub trait Observer: Sync {
    /// Called after every event of the history, in order.
    fn event(&self, _event: &Event) {}
    /// Called whenever moves or trees have been counted, with all evaluations and all work so far: a search may go on for long
    /// without an event.
    fn counted(&self, _evaluations: u64, _work: u64) {}
    /// Polled often, by constructions too; the search returns its incumbent soon after this becomes true. If there is none yet, it
    /// returns the caller's [known](crate::Problem::known) tree, or that of the fastest builder.
    fn cancelled(&self) -> bool {
        false
    }
    /// The elapsed fraction of the available time, 0 to 1, if the time of the cancellation is known in advance. The
    /// search then plans to be done when this reaches 1. Such runs cannot be repeated exactly.
    fn progress(&self) -> Option<f64> {
        None
    }
}

impl Observer for () {}

/// Constructs something, unless the observer cancels.
pub(crate) fn watched<T>(observer: &dyn Observer, construct: impl FnOnce(&Watch) -> T) -> T {
    let is_cancelled = || observer.cancelled();
    construct(&Watch::new(&is_cancelled))
}
