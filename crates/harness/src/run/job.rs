//! The runs of an experiment, before they are performed.

use crate::Error;
use crate::contestant::Labelled;
use crate::spec::Experiment;
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::Objective;
use bvh_core::{Bvh, RayDensity};
use bvh_scenes::Scene;
use rayon::prelude::*;

/// One run of an experiment.
pub(crate) struct Job<'a> {
    pub scene: &'a Scene,
    /// The cost of the scene's greedy Müller–Fellner tree.
    pub base: f64,
    pub labelled: &'a Labelled,
    pub repetition: u32,
    /// True if this run also makes the measurements that depend only on the scene.
    pub first_of_scene: bool,
}

impl<'a> Job<'a> {
    /// Returns all runs of an experiment, scene by scene, in the order of the spec.
    pub fn all(experiment: &'a Experiment, scenes: &'a [Scene]) -> Result<Vec<Self>, Error> {
        // Bases are needed before any run, and scenes are independent.
        let bases = scenes
            .par_iter()
            .map(|scene| base_cost(scene, &experiment.objective))
            .collect::<Result<Vec<_>, _>>()?;
        let mut jobs = Vec::new();
        for (scene, base) in scenes.iter().zip(bases) {
            for (labelled, repetition, first_of_scene) in experiment.runs() {
                jobs.push(Self { scene, base, labelled, repetition, first_of_scene });
            }
        }
        Ok(jobs)
    }

    /// The seed of the run.
    pub fn seed(&self, experiment: &Experiment) -> u64 {
        let label = self
            .labelled
            .options
            .seed_as
            .as_ref()
            .unwrap_or(&self.labelled.label);
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
        let density = config
            .density(trained, self.scene, seed)
            .map_err(self.tracing_error())?;
        Ok(Some(density))
    }

    /// For `map_err` where rays cannot be traced: names the scene.
    pub fn tracing_error(&self) -> impl Fn(String) -> Error + use<> {
        tracing_error(self.scene)
    }

    /// Returns how often the run's training rays enter each node of `tree`, which decides its
    /// layout.
    pub fn visits(&self, experiment: &Experiment, tree: &Bvh) -> Result<Option<Vec<f32>>, Error> {
        Ok(self
            .density(experiment)?
            .map(|density| density.visits(tree)))
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
