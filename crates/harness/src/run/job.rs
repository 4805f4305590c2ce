//! The runs of an experiment, before they are performed, and their choice when several processes
//! share an experiment.

use crate::Error;
use crate::contestant::{Contestant, Labelled};
use crate::spec::Experiment;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::Objective;
use bvh_core::{Bvh, RayDensity};
use bvh_scenes::Scene;
use bvh_search::{Budget, Method};
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BTreeSet;

/// One run of an experiment.
pub(crate) struct Job<'a> {
    /// The position of the run in the order of the spec.
    pub index: usize,
    pub scene: &'a Scene,
    /// The cost of the scene's greedy Müller–Fellner tree.
    pub base: f64,
    pub labelled: &'a Labelled,
    pub repetition: u32,
    /// True if this run also makes the measurements that depend only on the scene.
    pub first_of_scene: bool,
}

impl<'a> Job<'a> {
    /// Returns the runs of an experiment with these identifiers, all if there are none, scene by
    /// scene, in the order of the spec.
    pub fn selected(
        experiment: &'a Experiment,
        scenes: &'a [Scene],
        ids: &[String],
    ) -> Result<Vec<Self>, Error> {
        let selected = selected(ids, experiment, scenes)?;
        let runs: Vec<_> = experiment.runs().collect();
        let runs_of_scenes: Vec<&[usize]> =
            selected.chunk_by(|a, b| a / runs.len() == b / runs.len()).collect();
        // A process that performs one run of a large sweep needs no bases of the other scenes.
        let jobs_of_scenes = runs_of_scenes
            .into_par_iter()
            .map(|indices| {
                let scene = &scenes[indices[0] / runs.len()];
                let base = base_cost(scene, &experiment.objective)?;
                let job = |&index: &usize| {
                    let (labelled, repetition, first_of_scene) = runs[index % runs.len()];
                    Self { index, scene, base, labelled, repetition, first_of_scene }
                };
                Ok(indices.iter().map(job).collect())
            })
            .collect::<Result<Vec<Vec<Self>>, Error>>()?;
        Ok(jobs_of_scenes.into_iter().flatten().collect())
    }

    /// The seed of the run.
    pub fn seed(&self, experiment: &Experiment) -> u64 {
        let label = self.labelled.options.seed_as.as_ref().unwrap_or(&self.labelled.label);
        experiment.seed_of(&self.scene.name, label, self.repetition)
    }

    /// Returns the density of the rays whose visits the run minimises, if it does. Every repetition
    /// uses different rays.
    pub fn density(&self, experiment: &Experiment) -> Result<Option<RayDensity>, Error> {
        let (Some(config), Some(trained)) = (&experiment.ray_cost, self.labelled.options.for_rays)
        else {
            return Ok(None);
        };
        let seed =
            experiment.seed_of(&self.scene.name, "rays that trees are trained on", self.repetition);
        let density = config.density(trained, self.scene, seed).map_err(self.tracing_error())?;
        Ok(Some(density))
    }

    /// For `map_err` where rays cannot be traced: names the scene.
    pub fn tracing_error(&self) -> impl Fn(String) -> Error + use<> {
        tracing_error(self.scene)
    }

    /// Returns how often the run's training rays enter each node of `tree`, which decides its
    /// layout.
    pub fn visits(&self, experiment: &Experiment, tree: &Bvh) -> Result<Option<Vec<f32>>, Error> {
        Ok(self.density(experiment)?.map(|density| density.visits(tree)))
    }
}

/// For `map_err` where rays cannot be traced through a scene.
pub(crate) fn tracing_error(scene: &Scene) -> impl Fn(String) -> Error + use<> {
    let scene = scene.name.clone();
    move |message| Error::Tracing { scene: scene.clone(), message }
}

/// Returns the cost of the scene's greedy Müller–Fellner tree, the base of all ratios.
fn base_cost(scene: &Scene, objective: &Objective) -> Result<f64, Error> {
    let tree = muller_fellner::Config::default().build(&scene.boxes);
    Ok(objective.cost(&tree.map_err(Error::search(&scene.name, "muller_fellner, the base"))?))
}

/// Returns the indices of the runs with these identifiers, ascending; of all runs if there are none.
///
/// # Errors
///
/// If no run has one of the identifiers.
fn selected(
    ids: &[String],
    experiment: &Experiment,
    scenes: &[Scene],
) -> Result<Vec<usize>, Error> {
    let listed = listed(experiment, scenes);
    if ids.is_empty() {
        return Ok((0..listed.len()).collect());
    }
    let index = |id: &String| {
        let run = listed.iter().find(|run| run.id == *id);
        run.map(|run| run.index).ok_or_else(|| {
            let name = &experiment.name;
            Error::Usage(format!(
                "--run {id}: {name} has no such run; accepted: an identifier that `harness jobs` lists"
            ))
        })
    };
    let indices: BTreeSet<usize> = ids.iter().map(index).collect::<Result<_, _>>()?;
    Ok(indices.into_iter().collect())
}

/// One run in the list of all runs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ListedRun {
    /// The identifier, which stays the same when other runs join the spec.
    pub id: String,
    /// An estimate of its work, in nodes created or visited.
    pub work: u64,
    /// The name of the scene.
    pub scene: String,
    /// The label of the method.
    pub label: String,
    /// The number of the repetition.
    pub repetition: u32,
    index: usize,
}

/// Returns all runs of an experiment, those with most work first: a long run that begins last would
/// leave all other workers idle.
pub fn listed(experiment: &Experiment, scenes: &[Scene]) -> Vec<ListedRun> {
    let mut runs = Vec::new();
    for scene in scenes {
        for (labelled, repetition, _) in experiment.runs() {
            runs.push(ListedRun {
                id: experiment.run_id(&scene.name, &labelled.label, repetition),
                work: estimated_work(
                    labelled,
                    experiment.budget_of(labelled),
                    scene.boxes.len() as u64,
                ),
                scene: scene.name.clone(),
                label: labelled.label.clone(),
                repetition,
                index: runs.len(),
            });
        }
    }
    runs.sort_by_key(|run| Reverse(run.work));
    runs
}

/// Estimates the work of a run from the method's parameters and its budget.
fn estimated_work(labelled: &Labelled, budget: Budget, objects: u64) -> u64 {
    let tree_work = 2 * objects;
    let Contestant::Ours(method) = &labelled.method else { return tree_work };
    let (trees, work_per_object) = match method {
        Method::Grasp(config) => (config.trials, 0),
        Method::RandomOrders(config) => (config.trials, 0),
        Method::Genetic(config) => {
            (config.generations.saturating_add(1).saturating_mul(config.population as u64), 0)
        }
        Method::Annealing(config) => (0, config.work_per_object),
        Method::Rebuild(config) => (0, config.work_per_object),
        Method::RuinRecreate(config) => (0, config.work_per_object),
        Method::Best(config) => (0, config.work_per_object),
        Method::MullerFellner(_)
        | Method::MedianCut(_)
        | Method::GoldsmithSalmon(_)
        | Method::Agglomerative(_)
        | Method::Reinsertion(_)
        | Method::Rotation(_)
        | Method::Treelet(_)
        | Method::Exact(_) => (1, 0),
    };
    // An evaluation is a tree of these methods, and a move of all others.
    let trees = trees.min(budget.max_evaluations.unwrap_or(u64::MAX));
    let work =
        trees.saturating_mul(tree_work).saturating_add(work_per_object.saturating_mul(objects));
    work.min(budget.max_work.unwrap_or(u64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::Overrides;

    fn experiment() -> (Experiment, Vec<Scene>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("spec.toml");
        let text = "question = 'Q'\nscenes = ['escher', 'spheres750']\nrepetitions = 3\n\
                    methods = [{ method = 'muller_fellner' }, { method = 'grasp', trials = 9 }]\n";
        std::fs::write(&path, text).unwrap();
        let experiment = Experiment::read(&path, &Overrides::default()).unwrap();
        let scenes = ["escher", "spheres750"].map(|name| Scene::load(name).unwrap());
        (experiment, scenes.into())
    }

    #[test]
    fn every_run_has_one_identifier_and_those_with_most_work_come_first() {
        let (experiment, scenes) = experiment();
        assert_eq!(selected(&[], &experiment, &scenes).unwrap(), Vec::from_iter(0..12));
        let runs = listed(&experiment, &scenes);
        let works: Vec<u64> = runs.iter().map(|run| run.work).collect();
        assert!(works.is_sorted_by(|a, b| a >= b), "{works:?}");
        assert_eq!(works[0], 9 * 2 * scenes[0].boxes.len().max(750) as u64);
        assert_eq!(works[11], 2 * scenes[0].boxes.len().min(750) as u64);
        for run in runs {
            assert_eq!(selected(&[run.id], &experiment, &scenes).unwrap(), [run.index]);
        }
    }

    #[test]
    fn a_budget_and_another_method_change_the_estimate_but_no_identifier() {
        let (mut experiment, scenes) = experiment();
        let before = listed(&experiment, &scenes);
        experiment.budget.max_work = Some(1000);
        let mut added = experiment.methods[0].clone();
        added.label = "added".into();
        experiment.methods.insert(0, added);
        let after = listed(&experiment, &scenes);
        assert!(after.iter().all(|run| run.work <= 1000));
        let ids: BTreeSet<String> = after.into_iter().map(|run| run.id).collect();
        assert_eq!(ids.len(), 18);
        assert!(before.iter().all(|run| ids.contains(&run.id)));
    }
}
