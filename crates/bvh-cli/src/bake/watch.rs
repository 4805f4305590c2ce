//! Observes a bake, ends it in time, and shows its progress.

use super::effort::Effort;
use crate::answer::gain;
use crate::interrupt::is_interrupted;
use crate::output::{Lines, bar, print_error};
use bvh_search::{Deadline, Event, Observer};
use indicatif::ProgressBar;
use std::sync::OnceLock;
use std::time::Duration;

/// The length of the bar: thousandths of the budget.
const LENGTH: f64 = 1000.0;

/// Ends a bake when its time is over or when it is interrupted, and shows its progress: in a bar, or
/// without a terminal as a line every ten seconds.
pub struct Watch {
    /// The progress bar, which is hidden unless standard error is a terminal.
    pub bar: ProgressBar,
    /// The time of the command, and its end if the budget is a time.
    pub deadline: Deadline,
    effort: Option<Effort>,
    /// The first cost.
    first: OnceLock<f64>,
    lines: Lines,
}

impl Watch {
    /// Begins to measure the time. `None` is a budget that is not chosen yet.
    pub fn new(effort: Option<Effort>) -> Self {
        let limit = if let Some(Effort::Time(limit)) = effort { limit } else { Duration::MAX };
        Self {
            bar: bar(LENGTH as u64, "{bar:10} {wide_msg} {eta} left").with_message("searching"),
            deadline: Deadline::after(limit),
            effort,
            first: OnceLock::new(),
            lines: Lines::default(),
        }
    }

    /// Continues with this budget of work, if there is one.
    pub fn within(self, work: Option<u64>) -> Self {
        Self { effort: work.map(Effort::Work).or(self.effort), ..self }
    }

    /// The time left of a budget of time.
    pub fn left(&self) -> Option<Duration> {
        match self.effort {
            Some(Effort::Time(limit)) => Some(limit.saturating_sub(self.deadline.elapsed())),
            Some(Effort::Work(_)) | None => None,
        }
    }

    fn line(&self, elapsed: Duration) -> String {
        let percent = 100.0 * self.bar.position() as f64 / LENGTH;
        let seconds = elapsed.as_secs();
        format!("{} after {seconds} s, {percent:.1} % of the budget", self.bar.message())
    }
}

impl Observer for Watch {
    fn event(&self, event: &Event) {
        let cost = event.incumbent;
        let first = *self.first.get_or_init(|| cost);
        self.bar.set_message(format!("searching, cost {}", gain(cost, first)));
    }

    fn trying(&self, tried: usize, of: usize) {
        if tried == 0 && self.bar.is_hidden() {
            print_error(&format!("trying {of} combinations of the choices"));
        }
        self.bar.set_message(format!("trying the choices, {tried} of {of}"));
    }

    fn counted(&self, _evaluations: u64, work: u64) {
        if let Some(Effort::Work(most)) = self.effort {
            let done = work as f64 / most.max(1) as f64;
            self.bar.set_position((LENGTH * done.min(1.0)) as u64);
        }
    }

    fn cancelled(&self) -> bool {
        if let Some(done) = self.progress() {
            self.bar.set_position((LENGTH * done) as u64);
        }
        let elapsed = self.deadline.elapsed();
        if self.lines.is_due(elapsed) && self.bar.is_hidden() {
            print_error(&self.line(elapsed));
        }
        is_interrupted() || self.deadline.cancelled()
    }

    fn progress(&self) -> Option<f64> {
        match self.effort {
            Some(Effort::Time(_)) => self.deadline.progress(),
            Some(Effort::Work(_)) | None => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ten_seconds_one_line_says_how_far_the_search_has_come() {
        let watch = Watch::new(Some(Effort::Work(1000)));
        let line = || watch.line(Duration::from_secs(12));
        assert_eq!(line(), "searching after 12 s, 0.0 % of the budget");
        watch.counted(7, 255);
        for cost in [2e3, 1.25e3] {
            watch.event(&Event { evaluations: 7, work: 255, cost, incumbent: cost });
        }
        assert_eq!(line(), "searching, cost −37.5 % after 12 s, 25.5 % of the budget");
        // Whichever thread comes first.
        let times = [0.0, 9.9, 10.0, 10.1, 45.0, 39.0, 49.9, 50.0];
        let due = times.map(|seconds| watch.lines.is_due(Duration::from_secs_f64(seconds)));
        assert_eq!(due, [false, false, true, false, true, false, false, true]);
    }
}
