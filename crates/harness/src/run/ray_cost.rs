//! The measurement that judges the trees of all runs by rays that they were not trained on.

use super::jobs::{Job, Jobs, tracing_error};
use super::runs::with_trees;
use crate::Error;
use crate::measure::ray_cost::{Config, TestRays, TrainedOn, test_rays};
use crate::rows::store::Store;
use crate::rows::{LayoutRow, RunTestRow, TestRow, VisitRow};
use crate::spec::Experiment;
use crate::statistics::{mean, standard_error};
use bvh_core::cost::{self, Objective, SahConstants};
use bvh_core::{Bvh, WideBvh, collapse_leaves};
use bvh_scenes::rays::tests_per_ray;
use bvh_search::Observer;
use rayon::prelude::*;
use std::sync::Arc;

/// The name that results give to all trees trained on rays, whatever the label of their method.
const RAYS: &str = "rays";

/// A run and its tree.
type Run<'a> = (&'a Job<'a>, Arc<Bvh>);

/// Counts the tests of the same rays in the trees of all runs on a scene. Each tree is laid out for
/// the rays that it was trained on.
pub(crate) fn measure(config: &Config, jobs: &Jobs, store: &Store) -> Result<(), Error> {
    let runs: Vec<Run> = with_trees(jobs, |_| true)?;
    let experiment = jobs.experiment;
    let repetitions = experiment.repetitions as usize;
    let (mut tests, mut sizes, mut visits) = (Vec::new(), Vec::new(), Vec::new());
    let mut run_tests = Vec::new();
    for runs in runs.chunk_by(|a, b| a.0.scene.name == b.0.scene.name) {
        let scene = runs[0].0.scene;
        let layouts = runs.par_iter().map(|(job, tree)| layout(experiment, job, tree));
        let layouts = layouts.collect::<Result<Vec<WideBvh>, Error>>()?;
        // Runs are ordered by method, then by repetition.
        let methods = || runs.chunks(repetitions);
        let of_methods = methods().zip(layouts.chunks(repetitions));
        sizes.extend(of_methods.map(|(runs, layouts)| layout_row(runs, layouts)));
        for &trained_on in &config.costs {
            // These rays serve no other purpose.
            let seed = experiment.seed_of(&scene.name, "rays that costs are of", 0);
            let density = config.density(trained_on, scene, seed).map_err(tracing_error(scene))?;
            visits.extend(runs.iter().map(|(job, tree)| VisitRow {
                scene: scene.name.clone(),
                method: job.labelled.label.clone(),
                repetition: job.repetition,
                rays: TrainedOn::name(Some(trained_on)).into(),
                goldsmith_salmon: Objective::GoldsmithSalmon.cost_by(tree, &density),
            }));
        }
        let seed = experiment.seed_of(&scene.name, "rays that judge trees", 0);
        for rays in test_rays(config, scene, &runs[0].1, seed) {
            if jobs.watch.cancelled() {
                return Err(jobs.interrupted());
            }
            let tests_of = |wide: &WideBvh| tests_per_ray(wide, rays.kind, &rays.rays);
            let of_runs: Vec<[f64; 2]> = layouts.par_iter().map(tests_of).collect();
            if !config.costs.is_empty() {
                run_tests.extend(runs.iter().zip(&of_runs).map(|((job, _), tests)| RunTestRow {
                    scene: scene.name.clone(),
                    method: job.labelled.label.clone(),
                    repetition: job.repetition,
                    judged_on: rays.kind.name().into(),
                    camera: rays.camera.into(),
                    tests: tests[0] + tests[1],
                }));
            }
            let of_methods = methods().zip(of_runs.chunks(repetitions));
            tests.extend(of_methods.map(|(runs, tests)| test_row(runs[0].0, &rays, tests)));
        }
    }
    store.write_rows(&tests)?;
    store.write_rows(&sizes)?;
    if !config.costs.is_empty() {
        store.write_rows(&visits)?;
        store.write_rows(&run_tests)?;
    }
    Ok(())
}

fn test_row(job: &Job, rays: &TestRays, tests: &[[f64; 2]]) -> TestRow {
    let labelled = job.labelled;
    let options = &labelled.options;
    // Reports compare all plain trees for rays with all trees for areas, so they share one name.
    let is_plain = options.objective.is_none() && options.references.is_none();
    let tree = if options.for_rays.is_some() && is_plain { RAYS } else { &labelled.label };
    let totals: Vec<f64> = tests.iter().map(|tests| tests[0] + tests[1]).collect();
    TestRow {
        scene: job.scene.name.clone(),
        method: labelled.label.clone(),
        tree: tree.into(),
        trained_on: TrainedOn::name(options.for_rays).into(),
        judged_on: rays.kind.name().into(),
        camera: rays.camera.into(),
        node_tests: mean(tests.iter().map(|tests| tests[0])),
        block_tests: mean(tests.iter().map(|tests| tests[1])),
        repetitions: tests.len(),
        tests_standard_error: standard_error(&totals),
        rays: rays.rays.len() as u64,
    }
}

/// Lays out a run's tree for the rays that it was trained on, otherwise for random lines.
fn layout(experiment: &Experiment, job: &Job, tree: &Bvh) -> Result<WideBvh, Error> {
    let triangles =
        job.scene.triangles().map_err(|error| tracing_error(job.scene)(error.to_string()))?;
    let layout = match job.visits(experiment, tree)? {
        Some(visits) => WideBvh::for_rays(tree, triangles, &visits),
        None => WideBvh::new(tree, triangles),
    };
    layout.map_err(|error| tracing_error(job.scene)(error.to_string()))
}

fn layout_row(runs: &[Run], layouts: &[WideBvh]) -> LayoutRow {
    let job = runs[0].0;
    let objects = job.scene.boxes.len() as f64;
    let constants = SahConstants::default();
    let trees = runs.iter().map(|(_, tree)| &**tree);
    let bytes: usize = layouts.iter().map(WideBvh::bytes).sum();
    let references_per_object = trees.clone().map(|tree| tree.prim_ids.len() as f64 / objects);
    let layout_over_root =
        trees.clone().map(|tree| cost::over_root_area(tree, cost::layout_area(tree)));
    LayoutRow {
        scene: job.scene.name.clone(),
        method: job.labelled.label.clone(),
        repetitions: runs.len(),
        references_per_object: mean(references_per_object),
        bytes_per_object: bytes as f64 / (objects * layouts.len() as f64),
        collapsed_sah: mean(
            trees.map(|tree| cost::sah(&collapse_leaves(tree, &constants), &constants)),
        ),
        layout_over_root: mean(layout_over_root),
    }
}
