//! Experiments with pictures, as their users meet them.

use crate::support::{folder_with, said};
use harness::rows::{self, RenderRow};
use std::fs;

#[test]
fn an_experiment_draws_with_every_tree_and_the_baselines_and_keeps_seconds_apart() {
    let spec = "
question = 'Is it faster?'
scenes = ['spheres75', 'escher:cluster:90:1']
render = { width = 24, height = 16 }
repetitions = 2
methods = [{ method = 'median_cut' }, { method = 'random_orders', trials = 1 }]
[[reports]]
kind = 'query'
title = 'a picture'
file = 'timing_pictures'
rows = 'timing_renders.csv'
join = 'renders.csv'
by = ['scene', 'method', 'picture']
base = 'method=brute force'
columns = [
    { name = 'tests', value = 'first boxes_per_ray + objects_per_ray' },
    { name = 'speed_up', value = 'min render_seconds', ratio = 'base_over', paper = [
        { row = 'scene=spheres75, method=KD-tree', value = 32.77, over = 1.8 },
    ] },
]
";
    let folder = folder_with("spec.toml", spec);
    let shown = said(folder.path(), &["spec.toml"]);
    assert!(shown.contains("18.21") && shown.contains("speed_up"), "{shown}");
    let results = folder.path().join("results/spec");
    let rows: Vec<RenderRow> = rows::read(&results.join("renders.csv")).unwrap();
    assert_eq!(rows.len(), 2 * (2 + 2 * 2));
    for scene in rows.chunks(6) {
        assert!(
            scene.iter().all(|row| row.picture == scene[0].picture && row.rays == scene[0].rays)
        );
        assert_eq!((scene[0].method.as_str(), scene[0].boxes_per_ray), ("brute force", 0.0));
        assert!(scene[1..].iter().all(|row| row.objects_per_ray < scene[0].objects_per_ray));
    }
    assert!(
        fs::read_to_string(results.join("timing_pictures.csv"))
            .unwrap()
            .starts_with("scene,method,picture,tests,speed_up,paper_speed_up\n")
    );
    said(folder.path(), &["spec.toml", "--check", "--jobs", "1"]);
}
