//! Judges the trees of all runs by rays that they were not trained on.

use super::job::Job;
use super::measurement::{Measurement, Work};
use crate::Error;
use crate::measure::layout::{collapsed_sah, widened};
use crate::measure::ray_cost::{Config, TrainedOn, test_rays};
use crate::rows::{LayoutRow, RunTestRow, TestRow, TestTimeRow, VisitRow};
use crate::spec::Experiment;
use bvh_core::cost::{self, Objective};
use bvh_core::{Bvh, WideBvh};
use bvh_search::Observer;
use rayon::prelude::*;

/// The name in results of the trees that are trained on rays, whatever the label of their method.
const RAYS: &str = "rays";

/// Rays that judge the trees of all runs.
pub(crate) struct Judging<'a>(pub &'a Config);

impl Measurement for Judging<'_> {
    fn whole_only(&self) -> Option<&'static str> {
        Some("trees are judged by rays beside each other, not in parts")
    }

    fn measure(&self, work: &mut Work) -> Result<String, Error> {
        work.complete_trees(|_| true)?;
        judge(self.0, work)?;
        Ok(String::new())
    }
}

/// Counts the tests of the same rays in the trees of all runs on a scene, each in the layout for the rays that it was trained on, and
/// takes the time of those in the trees of first runs.
fn judge(config: &Config, work: &Work) -> Result<(), Error> {
    let Work { experiment, jobs, trees, store, watch, .. } = work;
    let mut rows = Vec::new();
    let mut times = Vec::new();
    let mut sizes = Vec::new();
    let mut visits = Vec::new();
    let mut of_runs = Vec::new();
    let runs: Vec<(&Job, &Bvh)> = trees
        .iter()
        .map(|(&index, tree)| (&jobs[index], tree))
        .collect();
    for of_scene in runs.chunk_by(|a, b| a.0.scene.name == b.0.scene.name) {
        let scene = of_scene[0].0.scene;
        let layouts = of_scene
            .par_iter()
            .map(|(job, tree)| layout(experiment, job, tree));
        let layouts = layouts.collect::<Result<Vec<WideBvh>, Error>>()?;
        // By method, with all repetitions.
        let methods: Vec<usize> = (0..of_scene.len())
            .step_by(experiment.repetitions as usize)
            .collect();
        let first: Vec<&WideBvh> = methods.iter().map(|&at| &layouts[at]).collect();
        for &at in &methods {
            let range = at..at + experiment.repetitions as usize;
            sizes.push(size(&of_scene[range.clone()], &layouts[range]));
        }
        for &trained in &config.costs {
            visits.extend(costs(experiment, config, trained, of_scene)?);
        }
        let seed = experiment.seed_of(&scene.name, "rays that judge trees", 0);
        for rays in test_rays(config, scene, of_scene[0].1, seed) {
            if watch.cancelled() {
                return Err(work.interrupted());
            }
            let tests: Vec<[f64; 2]> = layouts
                .par_iter()
                .map(|wide| rays.tests(wide))
                .collect();
            let of_run = |((job, _), tests): (&(&Job, &Bvh), &[f64; 2])| RunTestRow {
                scene: scene.name.clone(),
                method: job.labelled.label.clone(),
                repetition: job.repetition,
                judged_on: rays.kind.name().into(),
                camera: rays.camera.into(),
                tests: tests[0] + tests[1],
            };
            if !config.costs.is_empty() {
                of_runs.extend(of_scene.iter().zip(&tests).map(of_run));
            }
            let speeds = rays.speeds(&first, config.rounds);
            for (number, &at) in methods.iter().enumerate() {
                let own = &tests[at..at + experiment.repetitions as usize];
                let labelled = of_scene[at].0.labelled;
                let plain = labelled.own.objective.is_none() && labelled.own.references.is_none();
                let tree =
                    if labelled.own.for_rays.is_some() && plain { RAYS } else { &labelled.label };
                let [node_tests, block_tests, tests] =
                    [mean(own, |t| t[0]), mean(own, |t| t[1]), mean(own, |t| t[0] + t[1])];
                rows.push(TestRow {
                    scene: scene.name.clone(),
                    method: labelled.label.clone(),
                    tree: tree.into(),
                    trained_on: TrainedOn::name(labelled.own.for_rays).into(),
                    judged_on: rays.kind.name().into(),
                    camera: rays.camera.into(),
                    node_tests: node_tests.0,
                    block_tests: block_tests.0,
                    repetitions: own.len(),
                    tests_standard_error: tests.1,
                    rays: rays.count(),
                });
                if let Some(&million_per_s) = speeds.get(number).filter(|_| config.rounds > 0) {
                    times.push(TestTimeRow {
                        scene: scene.name.clone(),
                        method: labelled.label.clone(),
                        judged_on: rays.kind.name().into(),
                        camera: rays.camera.into(),
                        million_per_s,
                    });
                }
            }
        }
    }
    store.write_rows(&rows)?;
    store.write_rows(&sizes)?;
    if !config.costs.is_empty() {
        store.write_rows(&visits)?;
        store.write_rows(&of_runs)?;
    }
    if !times.is_empty() {
        store.write_rows(&times)?;
    }
    Ok(())
}

/// The costs of a scene's trees by the density of rays that none of them is tested by.
fn costs(
    experiment: &Experiment,
    config: &Config,
    trained: TrainedOn,
    of_scene: &[(&Job, &Bvh)],
) -> Result<Vec<VisitRow>, Error> {
    let scene = of_scene[0].0.scene;
    let seed = experiment.seed_of(&scene.name, "rays that costs are of", 0);
    let density = config.density(trained, scene, seed);
    let density =
        density.map_err(|message| Error::Tracing { scene: scene.name.clone(), message })?;
    let row = |(job, tree): &(&Job, &Bvh)| VisitRow {
        scene: scene.name.clone(),
        method: job.labelled.label.clone(),
        repetition: job.repetition,
        rays: TrainedOn::name(Some(trained)).into(),
        goldsmith_salmon: Objective::GoldsmithSalmon.cost_by(tree, &density),
    };
    Ok(of_scene.iter().map(row).collect())
}

/// The layout of a run's tree: for the rays that it was trained on, else for random lines.
fn layout(experiment: &Experiment, job: &Job, tree: &Bvh) -> Result<WideBvh, Error> {
    let failed = |message| Error::Tracing { scene: job.scene.name.clone(), message };
    let triangles = job
        .scene
        .triangles()
        .map_err(|error| failed(error.to_string()))?;
    let visits = job.visits(experiment, tree)?;
    widened(tree, triangles, visits.as_deref()).map_err(|error| failed(error.to_string()))
}

/// The sizes and costs of a method's trees and their layouts, means over repetitions.
fn size(runs: &[(&Job, &Bvh)], layouts: &[WideBvh]) -> LayoutRow {
    let job = runs[0].0;
    let objects = job.scene.boxes.len() as f64;
    let mean = |of: &dyn Fn(&Bvh) -> f64| {
        runs.iter().map(|(_, tree)| of(tree)).sum::<f64>() / runs.len() as f64
    };
    let bytes: usize = layouts.iter().map(WideBvh::bytes).sum();
    LayoutRow {
        scene: job.scene.name.clone(),
        method: job.labelled.label.clone(),
        repetitions: runs.len(),
        references_per_object: mean(&|tree| tree.prim_ids.len() as f64 / objects),
        bytes_per_object: bytes as f64 / (objects * layouts.len() as f64),
        collapsed_sah: mean(&collapsed_sah),
        layout_over_root: mean(&|tree| cost::over_root_area(tree, cost::layout_area(tree))),
    }
}

/// The mean of a number over repetitions, and its standard error if there are several.
fn mean(tests: &[[f64; 2]], of: impl Fn(&[f64; 2]) -> f64) -> (f64, Option<f64>) {
    let n = tests.len() as f64;
    let mean = tests.iter().map(&of).sum::<f64>() / n;
    let squares: f64 = tests
        .iter()
        .map(|tests| (of(tests) - mean).powi(2))
        .sum();
    (mean, (tests.len() > 1).then(|| (squares / (n - 1.0) / n).sqrt()))
}
