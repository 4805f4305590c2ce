//! What an experiment comes to: its spec with every default spelled out, and the scenes it runs on.

use crate::Error;
use crate::spec::Experiment;
use bvh_scenes::load::OutsideFiles;
use bvh_scenes::{Scene, subset};
use serde::{Deserialize, Serialize};
use std::collections::HashSet;

/// Contents of `resolved.toml`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Resolved {
    pub experiment: Experiment,
    pub scenes: Vec<LoadedScene>,
}

/// A scene by what identifies it.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct LoadedScene {
    pub name: String,
    pub kind: String,
    pub objects: usize,
    /// [`Scene::checksum`], hexadecimal.
    pub checksum: String,
}

/// As in [`LoadedScene::checksum`].
pub(crate) fn checksum(scene: &Scene) -> String {
    format!("{:016x}", scene.checksum())
}

impl Resolved {
    /// An experiment with the scenes that were loaded for it.
    pub fn new(experiment: &Experiment, scenes: &[Scene]) -> Self {
        let loaded = |scene: &Scene| LoadedScene {
            name: scene.name.clone(),
            kind: scene.kind.to_string(),
            objects: scene.boxes.len(),
            checksum: checksum(scene),
        };
        Self { experiment: experiment.clone(), scenes: scenes.iter().map(loaded).collect() }
    }

    /// Whether the experiment asks for these runs; its reports may be others.
    pub fn has_runs_of(&self, experiment: &Experiment) -> bool {
        Experiment { reports: experiment.reports.clone(), ..self.experiment.clone() } == *experiment
    }

    /// Whether `found` has the same runs, and perhaps further ones on optional scenes.
    pub fn repeats(&self, found: &Self) -> bool {
        let optional = |name: &String| self.experiment.optional_scenes.contains(name);
        found.has_runs_of(&self.experiment)
            && self
                .scenes
                .iter()
                .all(|scene| found.scenes.contains(scene))
            && found
                .scenes
                .iter()
                .all(|scene| self.scenes.contains(scene) || optional(&scene.name))
    }

    /// Number of runs over all scenes.
    pub fn run_count(&self) -> usize {
        self.experiment.runs().count() * self.scenes.len()
    }
}

/// Loads an experiment's scenes. Returns them and the names of the optional ones that are not there.
pub fn load_scenes(experiment: &Experiment) -> Result<(Vec<Scene>, Vec<String>), Error> {
    // The scenes of the suite are names of cases.
    if experiment.suite.is_some() {
        return Ok(Default::default());
    }
    let names = experiment
        .scenes
        .iter()
        .flat_map(|name| subset::expand(name));
    let outside = OutsideFiles::from(experiment.outside_files);
    let mut scenes = names
        .map(|name| Scene::load_with(&name, outside))
        .collect::<Result<Vec<_>, _>>()?;
    let mut left_out = Vec::new();
    for name in &experiment.optional_scenes {
        match Scene::load_with(name, outside) {
            Ok(scene) => scenes.push(scene),
            Err(_) => left_out.push(name.clone()),
        }
    }
    let mut names = HashSet::new();
    match scenes
        .iter()
        .find(|scene| !names.insert(&scene.name))
    {
        Some(twice) => {
            Err(Error::Usage(format!("two scenes are called {}; name each once", twice.name)))
        }
        None => Ok((scenes, left_out)),
    }
}

/// `value` as TOML.
pub(crate) fn to_toml(value: &impl Serialize) -> Result<String, Error> {
    toml::to_string(value)
        .map_err(|error| Error::Usage(format!("cannot be written as TOML: {error}")))
}
