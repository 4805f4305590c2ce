//! A finished run, and the rows that it leaves.

use super::jobs::{Job, Jobs};
use crate::Error;
use crate::measure::picture;
use crate::rows::kept_run::{KeptRun, RunName};
use crate::rows::{
    ClockRow, HistoryRow, RayRow, RenderRow, RenderTimeRow, RunRow, TimingRow, TrialRow,
};
use crate::spec::scenes::turn_of;
use bvh_core::cost::{self, SahConstants};
use bvh_scenes::Scene;
use bvh_scenes::rays::{Family, RandomRays, empirical_cost};
use bvh_scenes::trace::Query;
use bvh_search::{Event, Outcome};
use std::borrow::Cow;

/// A finished run, from which all its rows are made.
pub(crate) struct Finished<'a> {
    pub jobs: &'a Jobs<'a>,
    pub job: &'a Job<'a>,
    /// The scene, in the frame that was chosen for the run.
    pub scene: Cow<'a, Scene>,
    pub outcome: Outcome,
    /// Wall time of the whole run.
    pub seconds: f64,
    /// The time of each event since the run began.
    pub event_seconds: Vec<f64>,
}

impl Finished<'_> {
    /// Returns all rows of the run.
    pub fn rows(&self) -> Result<KeptRun, Error> {
        let run = self.run();
        let (renders, render_times) = self.pictures(&run)?;
        let turn = turn_of(&self.scene.name).filter(|_| self.job.first_of_scene);
        let mut kept = KeptRun::here();
        kept.add(&[run])?;
        kept.add(&self.history())?;
        kept.add(&self.trials())?;
        kept.add(&[self.timing()])?;
        kept.add(&self.rays())?;
        kept.add(&self.clock())?;
        kept.add(turn.as_slice())?;
        kept.add(&renders)?;
        kept.add(&render_times)?;
        Ok(kept)
    }

    fn run(&self) -> RunRow {
        let RunName { scene, method, repetition } = self.job.name();
        let Outcome { ref tree, cost, evaluations, work, stop, .. } = self.outcome;
        let base_cost = self.jobs.bases[&scene];
        let internal_area = cost::internal_area(tree);
        RunRow {
            scene,
            scene_kind: self.scene.kind.to_string(),
            method,
            seed: self.job.seed,
            repetition,
            objects: self.scene.boxes.len(),
            evaluations,
            work,
            stop,
            cost,
            base_cost,
            cost_over_base: if base_cost > 0.0 { cost / base_cost } else { 1.0 },
            cost_over_root_area: cost::over_root_area(tree, internal_area),
            internal_area,
            goldsmith_salmon: cost::goldsmith_salmon(tree),
            sah: cost::sah(tree, &SahConstants::default()),
            nodes: tree.nodes.len(),
            depth: tree.depth(),
        }
    }

    fn timing(&self) -> TimingRow {
        let RunName { scene, method, repetition } = self.job.name();
        let (seed, threads) = (self.job.seed, rayon::current_num_threads());
        TimingRow { scene, method, seed, repetition, threads, seconds: self.seconds }
    }

    fn history(&self) -> Vec<HistoryRow> {
        if !self.jobs.experiment.keeps_history() {
            return vec![];
        }
        let row = |(_, event): (usize, &Event)| {
            let RunName { scene, method, repetition } = self.job.name();
            let Event { evaluations, work, incumbent, .. } = *event;
            HistoryRow { scene, method, repetition, evaluations, work, incumbent }
        };
        milestones(&self.outcome.history).map(row).collect()
    }

    fn clock(&self) -> Vec<ClockRow> {
        if !self.jobs.experiment.needs_references() {
            return vec![];
        }
        let row = |(event, (index, _)): (usize, (usize, &Event))| {
            let RunName { scene, method, repetition } = self.job.name();
            ClockRow { scene, method, repetition, event, seconds: self.event_seconds[index] }
        };
        milestones(&self.outcome.history).enumerate().map(row).collect()
    }

    fn trials(&self) -> Vec<TrialRow> {
        if !self.jobs.experiment.trial_methods().contains(&self.job.labelled.label) {
            return vec![];
        }
        let row = |event: &Event| {
            let RunName { scene, method, repetition } = self.job.name();
            let Event { evaluations, cost, .. } = *event;
            TrialRow { scene, method, repetition, evaluations, cost }
        };
        self.outcome.history.iter().map(row).collect()
    }

    fn rays(&self) -> Vec<RayRow> {
        self.jobs.experiment.rays.iter().map(|config| self.rays_of(config)).collect()
    }

    fn rays_of(&self, config: &RandomRays) -> RayRow {
        let (family, stream) = match config.family {
            Family::Inside => ("inside", "rays Inside"),
            Family::Lines => ("lines", "rays Lines"),
        };
        let query = match config.query {
            Query::Any => "any",
            Query::Nearest => "nearest",
            Query::All => "all",
        };
        let RunName { scene, method, repetition } = self.job.name();
        let straight = turn_of(&scene).map_or(scene.clone(), |turn| turn.mesh);
        // Every method gets the same rays, at all angles, so that methods differ only in their
        // trees.
        let seed = self.jobs.experiment.seed_of(&straight, stream, 0);
        let cost = empirical_cost(config, &self.scene.primitives, &self.outcome.tree, seed);
        let [boxes_low, boxes_high] = cost.boxes.interval();
        RayRow {
            scene,
            method,
            seed: self.job.seed,
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

    fn pictures(&self, run: &RunRow) -> Result<(Vec<RenderRow>, Vec<RenderTimeRow>), Error> {
        let experiment = self.jobs.experiment;
        let Some(config) = &experiment.render else { return Ok(Default::default()) };
        // Nobody reads the seconds of quick variants.
        let most = if experiment.quick { 1 } else { picture::MOST_REPEATS };
        let Self { scene, outcome: Outcome { tree, .. }, seconds, .. } = self;
        config.measure(scene, tree, run, *seconds, self.job.first_of_scene, most)
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
