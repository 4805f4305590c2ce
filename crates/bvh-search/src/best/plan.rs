//! The annealing runs of a search whose end is known.

use super::config::Config;
use crate::tuning::{MOST_GENERATIONS, WORK_PER_PAIR};

/// One annealing run of the plan.
pub(super) struct Planned {
    /// First temperature.
    pub hot: f64,
    /// The fraction of all work or time at which the run ends.
    pub until: f64,
}

/// Returns the annealing runs for `length` work per object, and the work per object of each long
/// run including its short runs.
pub(super) fn plan(config: &Config, length: f64, n: u64) -> (Vec<Planned>, f64) {
    let longest = config.longest.min(WORK_PER_PAIR * n as f64);
    // Runs of equal length: a short last run would begin at a low temperature.
    let long_runs = (length / longest).ceil().clamp(1.0, MOST_GENERATIONS as f64);
    let length_of_run = length / long_runs;
    let hot = config.hot(length_of_run);
    let reheats = if length_of_run < config.reheats_from { 0 } else { config.reheats };
    let kept = if reheats == 0 { 0.0 } else { config.reheated };
    let mut plan = Vec::new();
    for number in 0..long_runs as u64 {
        for reheat in 0..=reheats {
            // A short run never starts hotter than its long run.
            let hot = if reheat == 0 { hot } else { hot.min(config.reheat) };
            let part = 1.0 - kept + kept * f64::from(reheat) / f64::from(reheats.max(1));
            plan.push(Planned { hot, until: (number as f64 + part) / long_runs });
        }
    }
    (plan, length_of_run)
}
