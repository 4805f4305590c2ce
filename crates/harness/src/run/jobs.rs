//! The runs of an experiment, before they are performed, their choice when several processes share an
//! experiment, and what all measurements share.

use super::watch::Watch;
use crate::Error;
use crate::contestant::Labelled;
use crate::rows::kept_run::RunName;
use crate::spec::Experiment;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::Objective;
use bvh_core::{Bvh, RayDensity};
use bvh_scenes::Scene;
use rayon::prelude::*;
use std::collections::{BTreeMap, HashSet};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// One run of an experiment.
#[derive(Clone)]
pub(crate) struct Job<'a> {
    /// The position of the run in the order of the spec.
    pub index: usize,
    /// The identifier, which stays the same when other runs join the spec.
    pub id: String,
    pub scene: &'a Scene,
    pub labelled: &'a Labelled,
    pub repetition: u32,
    pub seed: u64,
    /// True if this run also makes the measurements that depend only on the scene.
    pub first_of_scene: bool,
}

/// Returns the runs with these identifiers, scene by scene, in the order of the spec; all runs if
/// there are none.
///
/// # Errors
///
/// If no run has one of the identifiers.
pub(crate) fn selected<'a>(
    experiment: &'a Experiment,
    scenes: &'a [Scene],
    ids: &[String],
) -> Result<Vec<Job<'a>>, Error> {
    let mut jobs = Vec::new();
    for scene in scenes {
        let first = jobs.len();
        for labelled in &experiment.methods {
            for repetition in 0..experiment.repetitions {
                let index = jobs.len();
                let id = experiment.run_id(&scene.name, &labelled.label, repetition);
                let label = labelled.options.seed_as.as_ref().unwrap_or(&labelled.label);
                let seed = experiment.seed_of(&scene.name, label, repetition);
                let first_of_scene = index == first;
                jobs.push(Job { index, id, scene, labelled, repetition, seed, first_of_scene });
            }
        }
    }
    let known: HashSet<&str> = jobs.iter().map(|job| &*job.id).collect();
    if let Some(id) = ids.iter().find(|id| !known.contains(id.as_str())) {
        let name = &experiment.name;
        return Err(Error::Usage(format!(
            "--run {id}: {name} has no such run; accepted: an identifier that `harness jobs` lists"
        )));
    }
    let wanted: HashSet<&String> = ids.iter().collect();
    jobs.retain(|job| ids.is_empty() || wanted.contains(&job.id));
    Ok(jobs)
}

impl Job<'_> {
    /// The name of the run in its rows.
    pub fn name(&self) -> RunName {
        let (scene, method) = (self.scene.name.clone(), self.labelled.label.clone());
        RunName { scene, method, repetition: self.repetition }
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
        let density =
            config.density(trained, self.scene, seed).map_err(tracing_error(self.scene))?;
        Ok(Some(density))
    }

    /// Returns how often the run's training rays enter each node of `tree`, which decides its
    /// layout.
    pub fn visits(&self, experiment: &Experiment, tree: &Bvh) -> Result<Option<Vec<f32>>, Error> {
        Ok(self.density(experiment)?.map(|density| density.visits(tree)))
    }
}

/// For `map_err` where rays cannot be traced: names the scene.
pub(crate) fn tracing_error(scene: &Scene) -> impl Fn(String) -> Error + use<> {
    let scene = scene.name.clone();
    move |message| Error::Tracing { scene: scene.clone(), message }
}

/// The jobs of an experiment, with everything that its measurements share.
pub(crate) struct Jobs<'a> {
    pub experiment: &'a Experiment,
    /// The selected runs: all runs, unless several processes share the experiment.
    pub list: Vec<Job<'a>>,
    /// The costs of the greedy trees by scene.
    pub bases: BTreeMap<String, f64>,
    pub watch: Watch<'a>,
    trees: Mutex<BTreeMap<usize, Arc<Bvh>>>,
}

impl<'a> Jobs<'a> {
    /// Selects the runs with these identifiers, as [`selected`] does, and builds the greedy trees of
    /// their scenes.
    pub fn new(
        experiment: &'a Experiment,
        scenes: &'a [Scene],
        ids: &[String],
        interrupted: &'a AtomicBool,
    ) -> Result<Self, Error> {
        let list = selected(experiment, scenes, ids)?;
        let bases = base_costs(&experiment.objective, &list)?;
        let watch = Watch::new(list.len() as u64, interrupted);
        Ok(Self { experiment, list, bases, watch, trees: Mutex::default() })
    }

    /// The trees of performed runs that later measurements need, by the index of the run.
    pub fn trees(&self) -> MutexGuard<'_, BTreeMap<usize, Arc<Bvh>>> {
        self.trees.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the error of a measurement that is interrupted after all runs are finished.
    pub fn interrupted(&self) -> Error {
        Error::Interrupted { finished: self.list.len(), runs: self.list.len() }
    }
}

/// Returns the costs of the greedy Müller–Fellner trees of the jobs' scenes, the bases of all
/// ratios, by the scene's name.
fn base_costs(objective: &Objective, jobs: &[Job]) -> Result<BTreeMap<String, f64>, Error> {
    let base = |jobs: &[Job]| {
        let scene = jobs[0].scene;
        let tree = muller_fellner::Config::default().build(&scene.boxes);
        let tree = tree.map_err(Error::search(&scene.name, "muller_fellner, the base"))?;
        Ok((scene.name.clone(), objective.cost(&tree)))
    };
    // A process that performs one run of a large sweep needs no bases of the other scenes.
    let scenes: Vec<&[Job]> = jobs.chunk_by(|a, b| a.scene.name == b.scene.name).collect();
    scenes.into_par_iter().map(base).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::Overrides;

    #[test]
    fn every_run_has_an_identifier_that_selects_it_also_after_others_have_joined() {
        let text = "question = 'Q'\nscenes = ['escher', 'spheres750']\nrepetitions = 3\n\
                    methods = [{ method = 'muller_fellner' }, { method = 'grasp', trials = 9 }]\n";
        let spec = Experiment::parse("spec.toml".as_ref(), text, &Overrides::default());
        let mut experiment = spec.unwrap();
        let scenes = ["escher", "spheres750"].map(|name| Scene::load(name).unwrap());
        let ids = |experiment: &Experiment| {
            let jobs = selected(experiment, &scenes, &[]).unwrap();
            jobs.into_iter().map(|job| job.id).collect::<Vec<_>>()
        };
        let before = ids(&experiment);
        for (index, id) in before.iter().enumerate() {
            let one = selected(&experiment, &scenes, std::slice::from_ref(id)).unwrap();
            assert_eq!(one.iter().map(|job| job.index).collect::<Vec<_>>(), [index]);
        }
        let mut added = experiment.methods[0].clone();
        added.label = "added".into();
        experiment.methods.insert(0, added);
        let after = ids(&experiment);
        assert_eq!((before.len(), after.len()), (12, 18));
        assert!(before.iter().all(|id| after.contains(id)));
    }
}
