//! [`Watch`]: the caller's way to cancel a construction.

use crate::BuildError;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Asks the caller whether to cancel a construction. Each thread of a builder polls about once per
/// millisecond, and never before it has visited [`OBJECTS_PER_POLL`] objects, so small scenes are
/// always built.
///
/// The [default](Default) never cancels.
///
/// ```
/// use bvh_build::{BuildError, Builder, Watch, muller_fellner};
/// use bvh_core::Aabb;
/// let boxes = vec![Aabb::from([[0.0; 3], [1.0; 3]]); 100_000];
/// let stop = || true;
/// let built = muller_fellner::Config::default().build_watched(&boxes, None, &Watch::new(&stop));
/// assert_eq!(built, Err(BuildError::Cancelled));
/// ```
#[derive(Default)]
pub struct Watch<'a> {
    is_cancelled: Option<&'a (dyn Fn() -> bool + Sync)>,
    /// Set by the first poll that cancels, so that all threads agree.
    ended: AtomicBool,
}

/// The number of objects that a builder visits between two polls.
pub const OBJECTS_PER_POLL: usize = 1 << 15;

impl<'a> Watch<'a> {
    /// Returns a watch that cancels a construction soon after `is_cancelled` returns true on any
    /// thread.
    pub fn new(is_cancelled: &'a (dyn Fn() -> bool + Sync)) -> Self {
        Self { is_cancelled: Some(is_cancelled), ended: AtomicBool::new(false) }
    }

    /// Polls the caller. A cancellation is final.
    pub fn is_cancelled(&self) -> bool {
        // Relaxed suffices: the flag orders no other memory.
        if self.ended.load(Relaxed) {
            return true;
        }
        let cancelled = self.is_cancelled.is_some_and(|is_cancelled| is_cancelled());
        if cancelled {
            self.ended.store(true, Relaxed);
        }
        cancelled
    }

    /// Returns [`BuildError::Cancelled`] if a poll has cancelled the construction. Does not poll.
    pub fn ensure_wanted(&self) -> Result<(), BuildError> {
        if self.ended.load(Relaxed) { Err(BuildError::Cancelled) } else { Ok(()) }
    }
}

/// The polls of one thread, spaced by its work.
pub(crate) struct Pace<'a> {
    watch: &'a Watch<'a>,
    /// Objects to visit before the next poll.
    left: usize,
}

impl<'a> Pace<'a> {
    pub fn new(watch: &'a Watch<'a>) -> Self {
        Self { watch, left: OBJECTS_PER_POLL }
    }

    /// Counts visits of objects. Returns whether the construction is cancelled.
    #[inline(always)]
    pub fn ends_after(&mut self, objects: usize) -> bool {
        if objects < self.left {
            self.left -= objects;
            return false;
        }
        self.left = OBJECTS_PER_POLL;
        self.watch.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[test]
    fn polls_are_spaced_by_work_and_a_cancellation_is_final() {
        let asked = AtomicUsize::new(0);
        let third = || asked.fetch_add(1, Relaxed) == 2;
        let watch = Watch::new(&third);
        let mut pace = Pace::new(&watch);
        let mut visited = 0;
        while !pace.ends_after(1000) {
            assert_eq!(watch.ensure_wanted(), Ok(()));
            visited += 1000;
        }
        assert!((2 * OBJECTS_PER_POLL..4 * OBJECTS_PER_POLL).contains(&visited), "{visited}");
        assert!(watch.is_cancelled() && asked.load(Relaxed) == 3);
        assert_eq!(watch.ensure_wanted(), Err(BuildError::Cancelled));
    }
}
