//! Observes a bake: ends it in time, and shows its progress.

use super::effort::Effort;
use bvh_search::{Deadline, Event, Observer};
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

/// Cancels a search once it is set.
pub struct Interrupted<'a>(pub &'a AtomicBool);

impl Observer for Interrupted<'_> {
    fn cancelled(&self) -> bool {
        self.0.load(Relaxed)
    }
}

/// Watches a bake: ends it with its budget of time or when it is interrupted, and shows its progress.
pub struct Watch<'a> {
    /// Hidden unless standard error is a terminal.
    pub bar: ProgressBar,
    deadline: Deadline,
    effort: Effort,
    /// The cost that gains are relative to.
    base: f64,
    last: Mutex<Option<Event>>,
    /// Moves and work so far, which events are far behind while it is hot.
    moves: AtomicU64,
    work: AtomicU64,
    /// When the bar was last brought up to date, in milliseconds since the beginning.
    shown: AtomicU64,
    interrupted: &'a AtomicBool,
}

impl<'a> Watch<'a> {
    pub fn new(effort: Effort, deadline: Deadline, base: f64, interrupted: &'a AtomicBool) -> Self {
        // In thousandths of the budget.
        let bar = ProgressBar::new(1000);
        let style = ProgressStyle::with_template("{bar:10} {wide_msg}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        let [moves, work, shown] = [0, 0, 0].map(AtomicU64::new);
        Self {
            bar,
            deadline,
            effort,
            base,
            last: Mutex::default(),
            moves,
            work,
            shown,
            interrupted,
        }
    }

    /// Shows incumbent, gain, rate and time left, ten times a second.
    fn show(&self) {
        const REFRESH_MILLISECONDS: u64 = 100;
        if self.bar.is_hidden() {
            return;
        }
        let elapsed = self.deadline.elapsed();
        let now = elapsed.as_millis() as u64;
        let before = self.shown.load(Relaxed);
        let due = now >= before + REFRESH_MILLISECONDS;
        if !due
            || self
                .shown
                .compare_exchange(before, now, Relaxed, Relaxed)
                .is_err()
        {
            return;
        }
        let Some(event) = *self
            .last
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
        else {
            return;
        };
        let seconds = elapsed.as_secs_f64().max(1e-9);
        let done = match self.effort {
            Effort::Time(_) => self.deadline.fraction(),
            Effort::Work(work) => self.work.load(Relaxed) as f64 / work.max(1) as f64,
        };
        self.bar
            .set_position((1000.0 * done.min(1.0)) as u64);
        self.bar.set_message(format!(
            "{:.6e}, {} MF, {:.2} M moves/s, {:.0} s left",
            event.incumbent,
            gain(event.incumbent, self.base),
            self.moves.load(Relaxed) as f64 / seconds / 1e6,
            (seconds / done.max(1e-9) - seconds).max(0.0)
        ));
    }
}

impl Observer for Watch<'_> {
    fn event(&self, event: &Event) {
        *self
            .last
            .lock()
            .unwrap_or_else(PoisonError::into_inner) = Some(*event);
    }

    fn counted(&self, evaluations: u64, work: u64) {
        self.moves.store(evaluations, Relaxed);
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

/// Returns in words how far `cost` is below or above `base`.
pub fn gain(cost: f64, base: f64) -> String {
    let percent = if base > 0.0 { 100.0 * (1.0 - cost / base) } else { 0.0 };
    if percent >= 0.0 {
        format!("{percent:.2} % below")
    } else {
        format!("{:.2} % above", -percent)
    }
}
