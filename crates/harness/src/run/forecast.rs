//! How long an experiment will take, by the times of its earlier results.

use crate::Error;
use crate::rows::{TimingRow, read_if_any};
use crate::spec::Experiment;
use bvh_scenes::subset;
use std::collections::HashSet;
use std::path::Path;
use std::time::Duration;

/// Shorter experiments are over before the line is read.
const WORTH_A_LINE: f64 = 10.0;

/// Returns a line about the time that the experiment will take by the times in a folder, unless
/// there are none or it is short.
pub fn line(experiment: &Experiment, folder: &Path) -> Result<Option<String>, Error> {
    let threads = if experiment.sequential { 1 } else { rayon::current_num_threads() };
    let seconds = seconds(experiment, &read_if_any(folder)?) / threads as f64;
    let time = humantime::format_duration(Duration::from_secs(seconds as u64));
    let (name, folder) = (&experiment.name, folder.display());
    // Optional scenes that have not been fetched take no time.
    let about = if experiment.optional_scenes.is_empty() { "about" } else { "up to" };
    let line = format!("{name}: {about} {time} on {threads} thread(s), by the times in {folder}");
    Ok((seconds >= WORTH_A_LINE).then_some(line))
}

/// Returns the seconds of the experiment's runs one after the other, as far as their scenes and
/// methods are known.
fn seconds(experiment: &Experiment, known: &[TimingRow]) -> f64 {
    let scenes = experiment.scenes.iter().flat_map(|name| subset::expand(name));
    let scenes: HashSet<String> = scenes.chain(experiment.optional_scenes.clone()).collect();
    let labels: HashSet<&String> = experiment.methods.iter().map(|method| &method.label).collect();
    let own =
        known.iter().filter(|row| scenes.contains(&row.scene) && labels.contains(&row.method));
    let repetitions = known.iter().map(|row| row.repetition + 1).max().unwrap_or(1);
    let sum: f64 = own.map(|row| row.seconds).sum();
    sum * f64::from(experiment.repetitions) / f64::from(repetitions)
}

#[test]
fn the_runs_that_are_asked_for_take_their_share_of_the_known_times() {
    let spec = "question = 'q'\nscenes = ['a', 'b']\nrepetitions = 4\nmethods = [{ method = 'median_cut' }]";
    let experiment = Experiment::parse("x.toml".as_ref(), spec, &Default::default()).unwrap();
    let row = |scene: &str, method: &str, repetition, seconds| TimingRow {
        scene: scene.into(),
        method: method.into(),
        seed: 0,
        repetition,
        threads: 2,
        seconds,
    };
    let known = ["a", "b", "other"].map(|scene| {
        [
            row(scene, "median_cut", 0, 1.0),
            row(scene, "median_cut", 1, 2.0),
            row(scene, "grasp", 0, 9.0),
        ]
    });
    assert_eq!(seconds(&experiment, &known.concat()), 12.0);
    assert_eq!(seconds(&experiment, &[]), 0.0);
}
