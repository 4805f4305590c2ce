//! Observes a bake, ends it in time, and shows its progress.

use super::effort::Effort;
use crate::output::{bar, print_error};
use bvh_search::{Deadline, Event, Observer};
use indicatif::ProgressBar;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};

/// Ends a bake when its time is over or when it is interrupted, and shows its progress.
pub struct Watch<'a> {
    /// The progress bar, which is hidden unless standard error is a terminal.
    pub bar: ProgressBar,
    pub deadline: Deadline,
    effort: Effort,
    /// The lowest cost so far, as the bits of a number.
    incumbent: AtomicU64,
    /// The work so far. Events are rare while the search is hot, so that their work would be out of
    /// date.
    work: AtomicU64,
    /// The time of the bar's last update, in milliseconds since the beginning.
    shown: AtomicU64,
    interrupted: &'a AtomicBool,
}

impl<'a> Watch<'a> {
    /// Begins to measure the time.
    pub fn new(effort: Effort, interrupted: &'a AtomicBool) -> Self {
        Self {
            // The bar counts thousandths of the budget.
            bar: bar(1000, "{bar:10} {wide_msg}"),
            deadline: effort.deadline(),
            effort,
            incumbent: AtomicU64::new(f64::INFINITY.to_bits()),
            work: AtomicU64::default(),
            shown: AtomicU64::default(),
            interrupted,
        }
    }

    /// Shows the lowest cost and the time left: in the bar ten times a second, or
    /// without a terminal as a line every ten seconds.
    fn show(&self) {
        const BAR_MILLISECONDS: u64 = 100;
        const LINE_MILLISECONDS: u64 = 10_000;
        let is_bar = !self.bar.is_hidden();
        let interval = if is_bar { BAR_MILLISECONDS } else { LINE_MILLISECONDS };
        let elapsed = self.deadline.elapsed();
        let now = elapsed.as_millis() as u64;
        let before = self.shown.load(Relaxed);
        if now < before + interval {
            return;
        }
        // All threads of a search come here; the one that changes the time updates the bar.
        let claim = self.shown.compare_exchange(before, now, Relaxed, Relaxed);
        if claim.is_err() {
            return;
        }
        let incumbent = f64::from_bits(self.incumbent.load(Relaxed));
        if incumbent == f64::INFINITY {
            return;
        }
        let seconds = elapsed.as_secs_f64().max(1e-9);
        let done = match self.effort {
            Effort::Time(_) => self.deadline.fraction(),
            Effort::Work(work) => self.work.load(Relaxed) as f64 / work.max(1) as f64,
        };
        let mut message = format!("cost {:.6e}", incumbent);
        // The rate of the first moments predicts nothing.
        if done >= 0.01 {
            message += &format!(", {:.0} s left", (seconds / done - seconds).max(0.0));
        }
        if !is_bar {
            print_error(&message);
            return;
        }
        self.bar.set_position((1000.0 * done.min(1.0)) as u64);
        self.bar.set_message(message);
    }
}

impl Observer for Watch<'_> {
    fn event(&self, event: &Event) {
        self.incumbent.store(event.incumbent.to_bits(), Relaxed);
    }

    fn counted(&self, _evaluations: u64, work: u64) {
        self.work.store(work, Relaxed);
    }

    fn cancelled(&self) -> bool {
        self.show();
        self.interrupted.load(Relaxed)
            || matches!(self.effort, Effort::Time(_)) && self.deadline.has_passed()
    }

    fn progress(&self) -> Option<f64> {
        matches!(self.effort, Effort::Time(_)).then(|| self.deadline.fraction())
    }
}
