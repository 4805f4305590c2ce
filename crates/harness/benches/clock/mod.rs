//! A limit in seconds that the search knows and plans with.

use bvh_search::Observer;
use std::time::Instant;

/// From now on, so many seconds.
pub struct Clock {
    pub start: Instant,
    pub seconds: f64,
}

impl Observer for Clock {
    fn progress(&self) -> Option<f64> {
        Some(self.start.elapsed().as_secs_f64() / self.seconds)
    }

    fn cancelled(&self) -> bool {
        self.start.elapsed().as_secs_f64() >= self.seconds
    }
}
