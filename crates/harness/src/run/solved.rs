//! The rows of a finished run.

use super::job::Job;
use crate::rows::{ClockRow, HistoryRow, RayRow, RunRow, TimingRow, TrialRow};
use crate::spec::Experiment;
use bvh_core::cost::{self, SahConstants};
use bvh_scenes::rays::{Family, RandomRays, empirical_cost};
use bvh_scenes::trace::Query;
use bvh_search::{Event, Outcome};

/// A finished run with its tree.
pub(crate) struct Solved<'a> {
    pub experiment: &'a Experiment,
    pub job: &'a Job<'a>,
    pub seed: u64,
    pub outcome: &'a Outcome,
    /// Wall time of the run.
    pub seconds: f64,
}

impl Solved<'_> {
    /// Columns common to most rows: scene, method and repetition.
    fn identity(&self) -> (String, String, u32) {
        (self.job.scene.name.clone(), self.job.labelled.label.clone(), self.job.repetition)
    }

    /// `base` is the cost of the scene's greedy tree.
    pub fn run_row(&self, base: f64) -> RunRow {
        let Self { job: &Job { scene, .. }, seed, outcome, .. } = *self;
        let tree = &outcome.tree;
        let (scene_name, method, repetition) = self.identity();
        let internal_area = cost::internal_area(tree);
        RunRow {
            scene: scene_name,
            scene_kind: scene.kind.to_string(),
            method,
            seed,
            repetition,
            objects: scene.boxes.len(),
            evaluations: outcome.evaluations,
            work: outcome.work,
            stop: outcome.stop,
            cost: outcome.cost,
            base_cost: base,
            cost_over_base: if base > 0.0 { outcome.cost / base } else { 1.0 },
            cost_over_root_area: cost::over_root_area(tree, internal_area),
            internal_area,
            goldsmith_salmon: cost::goldsmith_salmon(tree),
            sah: cost::sah(tree, &SahConstants::default()),
            nodes: tree.nodes.len(),
            depth: tree.depth(),
        }
    }

    /// Returns the first event, every improvement and the last event, if a report reads them.
    pub fn history_rows(&self) -> Vec<HistoryRow> {
        let mut rows = Vec::new();
        if !self.experiment.keeps_history() {
            return rows;
        }
        for (_, event) in milestones(&self.outcome.history) {
            let Event { evaluations, work, incumbent, .. } = *event;
            let (scene, method, repetition) = self.identity();
            rows.push(HistoryRow { scene, method, repetition, evaluations, work, incumbent });
        }
        rows
    }

    /// Returns the costs of all trials, if a report reads them.
    pub fn trial_rows(&self) -> Vec<TrialRow> {
        let mut rows = Vec::new();
        if !self.experiment.keeps_trials_of(&self.job.labelled.label) {
            return rows;
        }
        for event in &self.outcome.history {
            let Event { evaluations, cost, .. } = *event;
            let (scene, method, repetition) = self.identity();
            rows.push(TrialRow { scene, method, repetition, evaluations, cost });
        }
        rows
    }

    pub fn timing_row(&self) -> TimingRow {
        let (scene, method, repetition) = self.identity();
        let threads = rayon::current_num_threads();
        TimingRow { scene, method, seed: self.seed, repetition, threads, seconds: self.seconds }
    }

    /// Returns the time of every row of the history, if a report needs it; `event_seconds` are the
    /// times of all events.
    pub fn clock_rows(&self, event_seconds: &[f64]) -> Vec<ClockRow> {
        let mut rows = Vec::new();
        if !self.experiment.needs_references() {
            return rows;
        }
        for (event, (index, _)) in milestones(&self.outcome.history).enumerate() {
            let (scene, method, repetition) = self.identity();
            rows.push(ClockRow { scene, method, repetition, event, seconds: event_seconds[index] });
        }
        rows
    }

    pub fn ray_rows(&self) -> Vec<RayRow> {
        self.experiment.rays.iter().map(|config| self.ray_row(config)).collect()
    }

    fn ray_row(&self, config: &RandomRays) -> RayRow {
        let (family, stream) = match config.family {
            Family::Inside => ("inside", "rays Inside"),
            Family::Lines => ("lines", "rays Lines"),
        };
        let query = match config.query {
            Query::Any => "any",
            Query::Nearest => "nearest",
            Query::All => "all",
        };
        let (scene, method, repetition) = self.identity();
        // Every method gets the same rays, so that methods differ only in their trees.
        let ray_seed = self.experiment.seed_of(&scene, stream, 0);
        let primitives = &self.job.scene.primitives;
        let cost = empirical_cost(config, primitives, &self.outcome.tree, ray_seed);
        let [boxes_low, boxes_high] = cost.boxes.interval();
        RayRow {
            scene,
            method,
            seed: self.seed,
            repetition,
            family: family.into(),
            query: query.into(),
            rays: cost.rays,
            hit_fraction: cost.hit_fraction,
            boxes_per_ray: cost.boxes.mean,
            boxes_standard_error: cost.boxes.standard_error,
            boxes_low,
            boxes_high,
            objects_per_ray: cost.objects.mean,
            objects_standard_error: cost.objects.standard_error,
        }
    }
}

/// Returns the events that `history.csv` keeps, each with its index: the first, every improvement,
/// and the last.
fn milestones(history: &[Event]) -> impl Iterator<Item = (usize, &Event)> {
    history.iter().enumerate().filter(|&(index, event)| {
        let is_end = index == 0 || index + 1 == history.len();
        is_end || event.incumbent < history[index - 1].incumbent
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_history_keeps_the_first_event_every_improvement_and_the_last() {
        let incumbents = [9.0, 9.0, 7.0, 7.0, 6.0, 6.0, 6.0];
        let history = incumbents.map(|incumbent| Event {
            evaluations: 1,
            work: 1,
            cost: incumbent,
            incumbent,
        });
        let kept: Vec<usize> = milestones(&history).map(|(index, _)| index).collect();
        assert_eq!(kept, [0, 2, 4, 6]);
        assert_eq!(milestones(&history[..1]).count(), 1);
        assert_eq!(milestones(&[]).count(), 0);
    }
}
