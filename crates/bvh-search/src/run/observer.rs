//! [`Observer`]: the caller's way to follow a search and to stop it.

use super::SearchError;
use bvh_build::{BuildError, Watch};
use core::sync::atomic::{AtomicBool, Ordering::Relaxed};

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

/// Nodes visited between two polls of an observer, less than a millisecond.
pub(crate) const WORK_PER_POLL: u64 = 1 << 14;

/// Follows a search. The search may call it from any thread. `()` ignores everything.
///
/// ```
/// use bvh_search::{Event, Observer, prelude::*};
/// /// A time limit that prints every improvement.
/// struct Printed(Deadline);
/// impl Observer for Printed {
///     fn event(&self, event: &Event) {
///         println!("{} after {:?}", event.incumbent, self.0.elapsed());
///     }
///     fn cancelled(&self) -> bool {
///         self.0.cancelled()
///     }
///     fn progress(&self) -> Option<f64> {
///         self.0.progress()
///     }
/// }
/// let corners = (0..300u16).map(|i| [17, 71, 173].map(|factor| f32::from(i * factor % 251)));
/// let boxes: Vec<Aabb> = corners.map(|low| Aabb::from([low, low.map(|x| x + 9.0)])).collect();
/// // Any binary tree will do, also one from another library.
/// let tree = median_cut::Config::default().build(&boxes)?;
/// let limit = Printed(Deadline::after(Duration::from_millis(300)));
/// let method = best::Config::default();
/// let found = optimize(&tree, &Problem::new(&boxes), &method, 1, Budget::UNLIMITED, &limit)?;
/// assert!(found.cost < cost::internal_area(&tree));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Observer: Sync {
    /// Called after every event of the history, in order.
    fn event(&self, _event: &Event) {}
    /// Called whenever moves or trees have been counted, with all evaluations and all work so far.
    /// A search may run long without an event.
    fn counted(&self, _evaluations: u64, _work: u64) {}
    /// Called before each of the combinations that a [choice](crate::Bake::choose) tries, with the
    /// number of those before it, and at the end.
    fn trying(&self, _tried: usize, _of: usize) {}
    /// Polled often, by constructions too. The search returns its incumbent soon after this becomes
    /// true. Without an incumbent, it returns the tree that the caller [kept](crate::solve_or_keep),
    /// or a tree of the fastest builder.
    fn cancelled(&self) -> bool {
        false
    }
    /// The elapsed fraction of the available time, 0 to 1, if the time of the cancellation is known
    /// in advance. The search then plans to end when this reaches 1. Such runs cannot be repeated
    /// exactly.
    fn progress(&self) -> Option<f64> {
        None
    }
}

impl Observer for () {}

/// A flag cancels a search once it is true.
impl Observer for AtomicBool {
    fn cancelled(&self) -> bool {
        self.load(Relaxed)
    }
}

/// Calls `construct` with a watch that the observer can cancel.
pub(crate) fn watched<T>(observer: &dyn Observer, construct: impl FnOnce(&Watch) -> T) -> T {
    construct(&Watch::new(&|| observer.cancelled()))
}

/// Calls `construct` with a watch that the observer can cancel; `None` if it does.
pub(crate) fn built_unless_cancelled<T>(
    observer: &dyn Observer,
    construct: impl FnOnce(&Watch) -> Result<T, BuildError>,
) -> Result<Option<T>, SearchError> {
    match watched(observer, construct) {
        Err(BuildError::Cancelled) => Ok(None),
        built => Ok(Some(built?)),
    }
}
