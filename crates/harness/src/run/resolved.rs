//! The resolved spec of an experiment: every default spelled out, and the scenes it runs on.

use crate::Error;
use crate::rows::store::is_unfinished;
use crate::spec::{Experiment, turn};
use bvh_scenes::files::read_text;
use bvh_scenes::{Scene, subset};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::collections::HashSet;
use std::path::Path;

/// Contents of `resolved.toml`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Resolved {
    pub experiment: Experiment,
    pub scenes: Vec<LoadedScene>,
}

/// The identity of a scene.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct LoadedScene {
    pub name: String,
    pub kind: String,
    pub objects: usize,
    /// [`Scene::checksum`], hexadecimal.
    pub checksum: String,
}

impl Resolved {
    /// Combines an experiment with the scenes that were loaded for it.
    pub fn new(experiment: &Experiment, scenes: &[Scene]) -> Self {
        let loaded = scenes.iter().map(|scene| LoadedScene {
            name: scene.name.clone(),
            kind: scene.kind.to_string(),
            objects: scene.boxes.len(),
            checksum: format!("{:016x}", scene.checksum()),
        });
        Self { experiment: experiment.clone(), scenes: loaded.collect() }
    }

    /// Returns true if the experiment requests these runs; its reports may differ.
    pub fn has_runs_of(&self, experiment: &Experiment) -> bool {
        Experiment { reports: experiment.reports.clone(), ..self.experiment.clone() } == *experiment
    }

    /// Returns true if `found` has the same runs, and perhaps further ones on optional scenes.
    pub fn repeats(&self, found: &Self) -> bool {
        // A machine without fetched scenes may repeat results that have them.
        let optional = &self.experiment.optional_scenes;
        let mut required = self.scenes.iter();
        let mut recorded = found.scenes.iter();
        found.has_runs_of(&self.experiment)
            && required.all(|scene| found.scenes.contains(scene))
            && recorded.all(|scene| self.scenes.contains(scene) || optional.contains(&scene.name))
    }

    /// The number of runs over all scenes.
    pub fn run_count(&self) -> usize {
        self.scenes.len() * self.experiment.methods.len() * self.experiment.repetitions as usize
    }
}

/// Returns the text of the resolved spec of the finished results in a folder, if it has any.
pub(crate) fn finished(folder: &Path) -> Result<Option<String>, Error> {
    let recorded = folder.join("resolved.toml");
    if is_unfinished(folder) || !recorded.is_file() {
        return Ok(None);
    }
    Ok(Some(read_text(&recorded)?))
}

/// Loads an experiment's scenes. Returns them and the names of optional scenes that are missing.
pub fn load_scenes(experiment: &Experiment) -> Result<(Vec<Scene>, Vec<String>), Error> {
    // The scenes of the suite are names of cases, which the suite itself makes.
    if experiment.suite.is_some() {
        return Ok(Default::default());
    }
    let names = experiment.scenes.iter().flat_map(|name| subset::expand(name));
    let mut scenes = names.map(|name| turn::load(&name)).collect::<Result<Vec<_>, _>>()?;
    let mut skipped_scenes = Vec::new();
    for name in &experiment.optional_scenes {
        match turn::load(name) {
            Ok(scene) => scenes.push(scene),
            // An optional scene that cannot be loaded is one that nobody has fetched.
            Err(_) => skipped_scenes.push(name.clone()),
        }
    }
    let mut names = HashSet::new();
    match scenes.iter().find(|scene| !names.insert(&scene.name)) {
        Some(twice) => {
            Err(Error::Usage(format!("two scenes are called {}; name each once", twice.name)))
        }
        None => Ok((scenes, skipped_scenes)),
    }
}

/// Reads a TOML file that a harness has written.
pub(crate) fn read_toml<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    toml::from_str(&read_text(path)?).map_err(Error::toml(path))
}

/// Serialises `value` as TOML.
pub(crate) fn to_toml(value: &impl Serialize) -> Result<String, Error> {
    toml::to_string(value)
        .map_err(|error| Error::Usage(format!("cannot be written as TOML: {error}")))
}
