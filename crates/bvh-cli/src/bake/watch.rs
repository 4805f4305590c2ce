//! Observes a bake, ends it in time, and shows its progress.

use super::effort::Effort;
use crate::output::bar;
use bvh_search::{Deadline, Event, Observer};
use indicatif::ProgressBar;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The length of the bar: thousandths of the budget.
const LENGTH: f64 = 1000.0;

/// Ends a bake when its time is over or when it is interrupted, and shows its progress.
pub struct Watch<'a> {
    /// The progress bar, which is hidden unless standard error is a terminal.
    pub bar: ProgressBar,
    pub deadline: Deadline,
    effort: Effort,
    interrupted: &'a AtomicBool,
}

impl<'a> Watch<'a> {
    /// Begins to measure the time.
    pub fn new(effort: Effort, interrupted: &'a AtomicBool) -> Self {
        let bar = bar(LENGTH as u64, "{bar:10} {wide_msg} {eta} left");
        Self { bar, deadline: effort.deadline(), effort, interrupted }
    }
}

impl Observer for Watch<'_> {
    fn event(&self, event: &Event) {
        if !self.bar.is_hidden() {
            self.bar.set_message(format!("cost {:.6e}", event.incumbent));
        }
    }

    fn counted(&self, _evaluations: u64, work: u64) {
        if let Effort::Work(most) = self.effort {
            let done = work as f64 / most.max(1) as f64;
            self.bar.set_position((LENGTH * done.min(1.0)) as u64);
        }
    }

    fn cancelled(&self) -> bool {
        if let Some(done) = self.progress() {
            self.bar.set_position((LENGTH * done) as u64);
        }
        self.interrupted.load(Relaxed) || self.deadline.has_passed()
    }

    fn progress(&self) -> Option<f64> {
        matches!(self.effort, Effort::Time(_)).then(|| self.deadline.fraction())
    }
}
