//! The runs that one process performs when several share an experiment.

use crate::Error;
use crate::contestant::{Contestant, Labelled};
use crate::spec::Experiment;
use bvh_scenes::Scene;
use bvh_search::{Budget, Method};
use std::cmp::Reverse;
use std::collections::BTreeSet;

/// All runs of an experiment, or a part of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Selection {
    /// All runs.
    #[default]
    All,
    /// The runs with these identifiers.
    Runs(Vec<String>),
}

impl Selection {
    /// Returns true if other processes perform the rest.
    pub fn is_part(&self) -> bool {
        *self != Self::All
    }

    /// Returns the indices of the selected runs, ascending.
    ///
    /// # Errors
    ///
    /// If no run has one of the identifiers.
    pub(crate) fn of(
        &self,
        experiment: &Experiment,
        scenes: &[Scene],
    ) -> Result<Vec<usize>, Error> {
        let listed = listed(experiment, scenes);
        let selected: BTreeSet<usize> = match self {
            Self::All => listed.iter().map(|run| run.index).collect(),
            Self::Runs(ids) => ids
                .iter()
                .map(|id| {
                    let run = listed.iter().find(|run| run.id == *id);
                    run.map(|run| run.index).ok_or_else(|| {
                        let name = &experiment.name;
                        Error::Usage(format!(
                            "--run {id}: {name} has no such run; accepted: an identifier that \
                             `harness jobs` lists"
                        ))
                    })
                })
                .collect::<Result<_, _>>()?,
        };
        Ok(selected.into_iter().collect())
    }
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
        _ => (1, 0),
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
        let all = Selection::All.of(&experiment, &scenes).unwrap();
        assert_eq!(all, (0..12).collect::<Vec<_>>());
        let runs = listed(&experiment, &scenes);
        let works: Vec<u64> = runs.iter().map(|run| run.work).collect();
        assert!(works.is_sorted_by(|a, b| a >= b), "{works:?}");
        assert_eq!(works[0], 9 * 2 * scenes[0].boxes.len().max(750) as u64);
        assert_eq!(works[11], 2 * scenes[0].boxes.len().min(750) as u64);
        for run in runs {
            let selection = Selection::Runs(vec![run.id]);
            assert_eq!(selection.of(&experiment, &scenes).unwrap(), [run.index]);
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
