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
    /// Whether this run also measures what depends on the scene alone.
    pub first_of_scene: bool,
}

impl<'a> Job<'a> {
    /// All runs of an experiment, scene by scene, in the order of the spec.
    pub fn all(experiment: &'a Experiment, scenes: &'a [Scene]) -> Result<Vec<Self>, Error> {
        let bases = scenes
            .par_iter()
            .map(|scene| base_cost(scene, &experiment.objective));
        let bases = bases.collect::<Result<Vec<_>, _>>()?;
        let of_scene = |(scene, base): (&'a Scene, f64)| {
            experiment
                .runs()
                .map(move |(labelled, repetition, first_of_scene)| Self {
                    scene,
                    base,
                    labelled,
                    repetition,
                    first_of_scene,
                })
        };
        Ok(scenes
            .iter()
            .zip(bases)
            .flat_map(of_scene)
            .collect())
    }

    /// The seed of the run.
    pub fn seed(&self, experiment: &Experiment) -> u64 {
        let seeds = self
            .labelled
            .own
            .seed_as
            .as_ref()
            .unwrap_or(&self.labelled.label);
        experiment.seed_of(&self.scene.name, seeds, self.repetition)
    }

    /// The density of the rays whose visits the run's method minimises, if it does; every repetition has its own rays.
    pub fn density(&self, experiment: &Experiment) -> Result<Option<RayDensity>, Error> {
        let (Some(config), Some(trained)) = (&experiment.ray_cost, self.labelled.own.for_rays)
        else {
            return Ok(None);
        };
        let seed =
            experiment.seed_of(&self.scene.name, "rays that trees are trained on", self.repetition);
        let failed = |message| Error::Tracing { scene: self.scene.name.clone(), message };
        config
            .density(trained, self.scene, seed)
            .map(Some)
            .map_err(failed)
    }

    /// How often those rays enter the nodes of the run's tree, which decides how it is laid out.
    pub fn visits(&self, experiment: &Experiment, tree: &Bvh) -> Result<Option<Vec<f32>>, Error> {
        Ok(self
            .density(experiment)?
            .map(|density| density.visits(tree)))
    }
}

/// The cost of the scene's greedy Müller–Fellner tree, the base of all ratios.
fn base_cost(scene: &Scene, objective: &Objective) -> Result<f64, Error> {
    let tree = muller_fellner::Config::default().build(&scene.boxes);
    Ok(objective.cost(&tree.map_err(Error::search(&scene.name, "muller_fellner, the base"))?))
}
