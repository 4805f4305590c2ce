//! `--explain`: lists, before an experiment runs, which steps it skips and which it performs.
//!
//! A step is skipped if the scene does not need it or the spec does not ask for it.

use crate::Error;
use crate::run::resolved::load_scenes;
use crate::spec::Experiment;
use bvh_scenes::explain::scene;

/// Returns the text that lists the skipped steps scene by scene, and the runs to come.
pub fn experiment(experiment: &Experiment) -> Result<String, Error> {
    let (scenes, _) = load_scenes(experiment)?;
    let mut text = format!("{}: {}\n", experiment.name, experiment.question);
    for loaded in &scenes {
        text += &scene(loaded).map_err(Error::search(&loaded.name, "--explain"))?;
    }
    let steps = [
        (!experiment.rays.is_empty(), "random rays"),
        (experiment.render.is_some(), "pictures and their shadow rays"),
        (experiment.tracing.is_some(), "wide layouts and timed rays"),
        (experiment.lower_bound.is_some(), "lower bounds"),
        (
            experiment
                .reports
                .iter()
                .any(|report| report.needs_references()),
            "references and the clock of every event",
        ),
        (!experiment.reports.is_empty(), "tables and figures"),
    ];
    let skipped: Vec<_> = steps
        .iter()
        .filter(|(is_wanted, _)| !is_wanted)
        .map(|&(_, name)| name)
        .collect();
    if !skipped.is_empty() {
        text += &format!("skipped, not in the spec: {}\n", skipped.join(", "));
    }
    let labels: Vec<_> = experiment
        .methods
        .iter()
        .map(|labelled| labelled.label.as_str())
        .collect();
    let labels = labels.join("; ");
    let repetitions = experiment.repetitions;
    text += &match experiment.suite {
        Some(_) => format!("to run: the suite of cases with {labels}\n"),
        None => format!("to run: {} scenes, {repetitions} times each of {labels}\n", scenes.len()),
    };
    Ok(text)
}
