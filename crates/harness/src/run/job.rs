//! The runs of an experiment, before they are performed.

use crate::Error;
use crate::contestant::Labelled;
use crate::run::selection::selected;
use crate::spec::Experiment;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::Objective;
use bvh_core::{Bvh, RayDensity};
use bvh_scenes::Scene;
use rayon::prelude::*;

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
