//! `--explain`: lists before the work what an experiment's scenes do not need and what was not asked for, both of which are left out.

use crate::Error;
use crate::run::resolved::load_scenes;
use crate::spec::Experiment;
use bvh_scenes::explain::scene;

/// What is left out of an experiment, scene by scene, and what is going to run.
pub fn experiment(experiment: &Experiment) -> Result<String, Error> {
    let (scenes, _) = load_scenes(experiment)?;
    let mut text = format!("{}: {}\n", experiment.name, experiment.question);
    for of_one in &scenes {
        text += &scene(of_one).map_err(Error::search(&of_one.name, "--explain"))?;
    }
    let asked = [
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
    let not_asked: Vec<_> = asked
        .iter()
        .filter(|(asked, _)| !asked)
        .map(|&(_, what)| what)
        .collect();
    if !not_asked.is_empty() {
        text += &format!("left out, not asked for: {}\n", not_asked.join(", "));
    }
    let labels: Vec<_> = experiment
        .methods
        .iter()
        .map(|labelled| labelled.label.as_str())
        .collect();
    let times = experiment.repetitions;
    let labels = labels.join("; ");
    text += &match experiment.suite {
        Some(_) => format!("to run: the suite of cases with {labels}\n"),
        None => format!("to run: {} scenes, {times} times each of {labels}\n", scenes.len()),
    };
    Ok(text)
}
