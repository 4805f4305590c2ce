//! The rows of a run whose tree is found.

use super::job::Job;
use crate::measure::empirical_cost;
use crate::measure::layout::collapsed_sah;
use crate::report::Report;
use crate::rows::{ClockRow, ClockedRow, HistoryRow, RayRow, RunRow, TimingRow};
use crate::spec::Experiment;
use bvh_core::cost::{self, SahConstants};
use bvh_scenes::rays::Family;
use bvh_scenes::trace::Query;
use bvh_search::{Event, Outcome};

/// A run whose tree is found.
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

    pub fn run_row(&self) -> RunRow {
        let Self { job: &Job { scene, base, .. }, seed, outcome, .. } = *self;
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

    pub fn history_rows(&self) -> Vec<HistoryRow> {
        let row = |event: &Event| {
            let Event { evaluations, work, cost, incumbent } = *event;
            let (scene, method, repetition) = self.identity();
            HistoryRow {
                scene,
                method,
                seed: self.seed,
                repetition,
                evaluations,
                work,
                cost,
                incumbent,
            }
        };
        self.outcome.history.iter().map(row).collect()
    }

    pub fn timing_row(&self) -> TimingRow {
        let (scene, method, repetition) = self.identity();
        let threads = rayon::current_num_threads();
        TimingRow { scene, method, seed: self.seed, repetition, threads, seconds: self.seconds }
    }

    pub fn clocked_row(&self, run: RunRow) -> ClockedRow {
        let tree = &self.outcome.tree;
        ClockedRow {
            scene: run.scene,
            method: run.method,
            seed: run.seed,
            repetition: run.repetition,
            threads: rayon::current_num_threads(),
            seconds: self.seconds,
            evaluations: run.evaluations,
            work: run.work,
            cost: run.cost,
            cost_over_base: run.cost_over_base,
            references_per_object: tree.prim_ids.len() as f64 / run.objects as f64,
            collapsed_sah: collapsed_sah(tree),
        }
    }

    /// When each event happened, if a report asks for it; `event_seconds` are these times.
    pub fn clock_rows(&self, event_seconds: Vec<f64>) -> Vec<ClockRow> {
        if !self
            .experiment
            .reports
            .iter()
            .any(Report::needs_clock)
        {
            return vec![];
        }
        let row = |(event, seconds)| {
            let (scene, method, repetition) = self.identity();
            ClockRow { scene, method, repetition, event, seconds }
        };
        event_seconds
            .into_iter()
            .enumerate()
            .map(row)
            .collect()
    }

    pub fn ray_rows(&self) -> Vec<RayRow> {
        let Self { experiment, job: &Job { scene, .. }, seed, .. } = *self;
        let row = |config: &empirical_cost::Config| {
            let (family, of_family) = match config.family {
                Family::Inside => ("inside", "rays Inside"),
                Family::Lines => ("lines", "rays Lines"),
            };
            let query = match config.query {
                Query::Any => "any",
                Query::Nearest => "nearest",
                Query::All => "all",
            };
            let (scene_name, method, repetition) = self.identity();
            // Every method gets the same rays, so that differences between methods come from their trees.
            let ray_seed = experiment.seed_of(&scene_name, of_family, 0);
            let named = RayRow {
                scene: scene_name,
                method,
                seed,
                repetition,
                family: family.into(),
                query: query.into(),
                ..Default::default()
            };
            empirical_cost::measure(config, scene, &self.outcome.tree, ray_seed, named)
        };
        experiment.rays.iter().map(row).collect()
    }
}
