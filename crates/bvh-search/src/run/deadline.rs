//! Time limits for searches: the only code of this crate that reads a wall clock.

use super::observer::Observer;
use std::time::{Duration, Instant};

/// A time limit for a search, which starts with the construction of this value.
///
/// The search reads the clock through [`Observer`]: it plans with the elapsed fraction of the limit
/// and ends soon after the limit. No second thread is needed.
///
/// ```
/// use bvh_search::{Bake, prelude::*};
/// let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(|x| Aabb::from([[x; 3], [x + 1.5; 3]])).collect();
/// let tree = Bake::new(&boxes).search(None, &Deadline::after(Duration::from_millis(10)))?.outcome.tree;
/// validate(&tree, &boxes)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Deadline {
    start: Instant,
    limit: Duration,
}

impl Deadline {
    /// Returns a limit that begins now.
    pub fn after(limit: Duration) -> Self {
        Self { start: Instant::now(), limit }
    }

    /// Returns a limit that is over earlier by so much.
    pub fn sooner(self, by: Duration) -> Self {
        Self { limit: self.limit.saturating_sub(by), ..self }
    }

    /// The time since the limit began.
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }
}

impl Observer for Deadline {
    /// Returns whether the time is over. A limit of zero has passed from the start.
    fn cancelled(&self) -> bool {
        self.elapsed() >= self.limit
    }

    fn progress(&self) -> Option<f64> {
        // Zero elapsed over a limit of zero is NaN, and `f64::min` of NaN and 1 is 1.
        Some(self.elapsed().div_duration_f64(self.limit).min(1.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_passes_once_and_a_limit_of_zero_has_passed_at_once() {
        let none = Deadline::after(Duration::ZERO);
        assert!(none.cancelled() && none.progress() == Some(1.0));
        let day = Deadline::after(Duration::from_secs(86_400));
        assert!(!day.cancelled() && day.progress() < Some(0.01));
        let short = Deadline::after(Duration::from_millis(1));
        while !short.cancelled() {
            std::thread::yield_now();
        }
        assert_eq!(short.progress(), Some(1.0));
    }
}
