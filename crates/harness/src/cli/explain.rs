//! `--explain`: lists before the work what a scene does not need and what was not asked for, both of which are left out.

use crate::Error;
use crate::run::resolved::load_scenes;
use crate::scenes::Scene;
use crate::spec::Experiment;
use bvh_core::Primitives;
use bvh_search::shortcuts::Facts;

/// What is left out of an experiment, scene by scene, and what is going to run.
pub fn experiment(experiment: &Experiment) -> Result<String, Error> {
    let (scenes, _) = if experiment.suite.is_some() { Default::default() } else { load_scenes(experiment)? };
    let mut text = format!("{}: {}\n", experiment.name, experiment.question);
    for of_one in &scenes {
        text += &scene(of_one)?;
    }
    let asked = [
        (!experiment.rays.is_empty(), "random rays"),
        (experiment.render.is_some(), "pictures and their shadow rays"),
        (experiment.tracing.is_some(), "wide layouts and timed rays"),
        (experiment.lower_bound.is_some(), "lower bounds"),
        (
            experiment.reports.iter().any(|report| report.needs_references()),
            "references and the clock of every event",
        ),
        (!experiment.reports.is_empty(), "tables and figures"),
    ];
    let not_asked: Vec<_> = asked.iter().filter(|(asked, _)| !asked).map(|&(_, what)| what).collect();
    if !not_asked.is_empty() {
        text += &format!("left out, not asked for: {}\n", not_asked.join(", "));
    }
    let labels: Vec<_> = experiment.methods.iter().map(|labelled| labelled.label.as_str()).collect();
    let (times, labels) = (experiment.repetitions, labels.join("; "));
    text += &match experiment.suite {
        Some(_) => format!("to run: the suite of cases with {labels}\n"),
        None => format!("to run: {} scenes, {times} times each of {labels}\n", scenes.len()),
    };
    Ok(text)
}

/// What is left out of a scene, one line each.
pub fn scene(scene: &Scene) -> Result<String, Error> {
    let facts = Facts::of(&scene.boxes).map_err(Error::search(&scene.name, "--explain"))?;
    let kind = match scene.primitives {
        Primitives::Triangles(_) => "triangles",
        Primitives::Spheres(_) => "spheres",
    };
    let size = facts.bounds.max - facts.bounds.min;
    let mut text = format!("{} ({}): {} {kind} within {size}\n", scene.name, scene.kind, facts.objects);
    if let Some(remark) = &scene.remark {
        text += &format!("  {remark}\n");
    }
    for (_, why) in facts.shortcuts() {
        text += &format!("  left out: {why}\n");
    }
    text += &format!("  left out: tests of anything but {kind}: there is a traversal for these alone\n");
    if facts.repeated > 0 {
        text += &format!(
            "  not left out: {} objects with the box of the one before; between them a split may be as good as any\n",
            facts.repeated
        );
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn explained(name: &str) -> String {
        scene(&Scene::load(name).unwrap()).unwrap()
    }

    #[test]
    fn every_scene_is_told_what_it_does_not_need() {
        for (name, parts) in [
            ("escher:12", &["12 triangles", "the optimum takes no more", "no tree has less"][..]),
            ("spheres75", &["75 spheres", "tests of anything but spheres"]),
            ("S08:50", &["sorting along y", "sorting along z", "splits along z: the order is that along y"]),
            ("S10:50", &["splits along y and z", "an internal area of 0"]),
            ("S34:50", &["45 objects with the box of the one before"]),
        ] {
            let text = explained(name);
            assert!(parts.iter().all(|part| text.contains(part)), "{name}: {text}");
        }
        let escher = explained("escher");
        assert!(!escher.contains("splits along") && !escher.contains("the optimum"), "{escher}");
    }
}
