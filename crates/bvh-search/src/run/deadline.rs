//! Time limits for searches: the only code of this crate that reads a wall clock.

use super::observer::Observer;
use std::time::{Duration, Instant};

/// A time limit for a search, which starts with the construction of this value.
///
/// The search reads the clock through [`Observer`]: it plans with the elapsed fraction of the limit
/// and ends soon after the limit. No second thread is needed.
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

    /// The time since the limit began.
    pub fn elapsed(&self) -> Duration {
        self.start.elapsed()
    }

    /// Returns whether the time is over. A limit of zero has passed from the start.
    pub fn has_passed(&self) -> bool {
        self.elapsed() >= self.limit
    }

    /// The elapsed fraction of the limit, 0 to 1.
    pub fn fraction(&self) -> f64 {
        // Zero elapsed over a limit of zero is NaN, and `f64::min` of NaN and 1 is 1.
        self.elapsed().div_duration_f64(self.limit).min(1.0)
    }
}

impl Observer for Deadline {
    fn cancelled(&self) -> bool {
        self.has_passed()
    }

    fn progress(&self) -> Option<f64> {
        Some(self.fraction())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limit_passes_once_and_a_limit_of_zero_has_passed_at_once() {
        let none = Deadline::after(Duration::ZERO);
        assert!(none.has_passed() && none.fraction() == 1.0);
        let day = Deadline::after(Duration::from_secs(86_400));
        assert!(!day.has_passed() && day.fraction() < 0.01);
        let short = Deadline::after(Duration::from_millis(1));
        while !short.has_passed() {
            std::thread::yield_now();
        }
        assert_eq!(short.fraction(), 1.0);
    }
}
