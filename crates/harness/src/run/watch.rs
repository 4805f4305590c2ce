//! What observes runs: the progress bar, Ctrl-C, and the times of a run's events.

use bvh_search::{Event, Observer};
use indicatif::{ProgressBar, ProgressStyle};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// Observes all runs: moves the bar and forwards an interruption.
pub(crate) struct Watch<'a> {
    pub bar: ProgressBar,
    interrupted: &'a AtomicBool,
}

impl<'a> Watch<'a> {
    /// Shows a bar with the time left, which is hidden unless standard error is a terminal.
    pub fn new(runs: u64, interrupted: &'a AtomicBool) -> Self {
        let bar = ProgressBar::new(runs);
        let template = "{msg} {wide_bar} {pos}/{len} runs, {eta} left";
        bar.set_style(
            ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
        );
        Self { bar, interrupted }
    }
}

impl Observer for Watch<'_> {
    fn event(&self, _event: &Event) {
        self.bar.tick();
    }

    fn cancelled(&self) -> bool {
        self.interrupted.load(Relaxed)
    }
}

/// Records the times of a run's events, in seconds since its start.
pub(crate) struct Stopwatch<'a> {
    watch: &'a Watch<'a>,
    pub start: Instant,
    events: Mutex<Vec<f64>>,
}

impl<'a> Stopwatch<'a> {
    pub fn start(watch: &'a Watch<'a>) -> Self {
        Self { watch, start: Instant::now(), events: Mutex::default() }
    }

    pub fn note(&self, seconds: f64) {
        self.events.lock().unwrap_or_else(PoisonError::into_inner).push(seconds);
    }

    pub fn into_seconds(self) -> Vec<f64> {
        self.events.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Observer for Stopwatch<'_> {
    fn event(&self, event: &Event) {
        self.note(self.start.elapsed().as_secs_f64());
        self.watch.event(event);
    }

    fn cancelled(&self) -> bool {
        self.watch.cancelled()
    }
}
