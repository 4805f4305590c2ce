//! The resolved spec of an experiment: every default spelled out, and the scenes it runs on.

use crate::Error;
use crate::rows::store::{Existing, finished_spec};
use crate::spec::Experiment;
use bvh_scenes::Scene;
use serde::{Deserialize, Serialize};
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
    fn repeats(&self, found: &Self) -> bool {
        // A machine without fetched scenes may repeat results that have them.
        let optional = &self.experiment.optional_scenes;
        let mut required = self.scenes.iter();
        let mut recorded = found.scenes.iter();
        found.has_runs_of(&self.experiment)
            && required.all(|scene| found.scenes.contains(scene))
            && recorded.all(|scene| self.scenes.contains(scene) || optional.contains(&scene.name))
    }

    /// Returns true if a folder already holds all requested results.
    ///
    /// Finished results may also cover optional scenes that are missing now. Resuming them leaves
    /// nothing to do.
    ///
    /// # Errors
    ///
    /// If the folder holds finished results that are neither replaced nor resumed.
    pub fn is_finished(
        &self,
        folder: &Path,
        existing: Existing,
        is_part: bool,
    ) -> Result<bool, Error> {
        let recorded = match existing {
            Existing::Replace => None,
            _ => finished_spec(folder)?,
        };
        let Some(text) = recorded else { return Ok(false) };
        let is_same = toml::from_str(&text).is_ok_and(|found| self.repeats(&found));
        let found = match (is_same, existing == Existing::Resume && !is_part) {
            (true, true) => return Ok(true),
            (true, false) => "finished results",
            (false, _) => "the results of another spec, scene or seed",
        };
        let folder = folder.display();
        Err(Error::Usage(format!(
            "{folder} has {found}, --force replaces them, another --out keeps them"
        )))
    }

    /// The number of runs over all scenes.
    pub fn run_count(&self) -> usize {
        self.scenes.len() * self.experiment.methods.len() * self.experiment.repetitions as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::read_toml;
    use std::fs;
    use toml::Table;

    #[test]
    fn committed_specs_are_written_again_as_they_are() {
        let results = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../results");
        let folders = [results.join("quick"), results];
        let entries = folders.iter().flat_map(|folder| fs::read_dir(folder).unwrap());
        let paths = entries.map(|entry| entry.unwrap().path().join("resolved.toml"));
        let paths: Vec<_> = paths.filter(|path| path.exists()).collect();
        assert!(paths.len() > 50, "{} specs", paths.len());
        for path in paths {
            let resolved: Resolved = read_toml(&path).unwrap();
            // The program in attic/ leaves other keys out.
            if resolved.experiment.tracing.is_none() {
                let written: Table = toml::from_str(&toml::to_string(&resolved).unwrap()).unwrap();
                // A new key is left out while it has its default: see `per_processor`.
                assert_eq!(written, read_toml::<Table>(&path).unwrap(), "{path:?}");
            }
        }
    }
}
