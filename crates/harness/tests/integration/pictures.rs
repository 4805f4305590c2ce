//! Experiments with pictures, as their users meet them.

use crate::support::{folder_with, rows, said};
use harness::report::query::Row;

/// What a picture of this scene by this method has in a column.
fn of(table: &[Row], scene: &str, method: &str, column: &str) -> f64 {
    let mut own = table.iter().filter(|row| row["scene"] == scene && row["method"] == method);
    own.next().unwrap()[column].parse().unwrap()
}

#[test]
fn an_experiment_draws_with_every_tree_and_the_baselines_and_keeps_seconds_apart() {
    let spec = "
question = 'Is it faster?'
scenes = ['spheres75', 'escher:cluster:90:1']
render = { width = 24, height = 16 }
methods = [{ method = 'median_cut' }, { method = 'random_orders', trials = 1 }]
[[reports]]
kind = 'query'
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
    said(folder.path(), &["spec.toml"]);
    let [renders, times, pictures] = ["renders", "timing_renders", "timing_pictures"]
        .map(|file| rows(&folder.path().join(format!("results/spec/{file}.csv"))));
    assert_eq!(of(&pictures, "spheres75", "KD-tree", "paper_speed_up"), 32.77 / 1.8);
    for scene in ["spheres75", "escher:cluster:90:1"] {
        let own: Vec<&Row> = renders.iter().filter(|row| row["scene"] == scene).collect();
        assert_eq!(own.len(), 4, "two methods, brute force and a KD-tree");
        // Every structure traces the same rays to the same pixels.
        assert!(own.iter().all(|row| ["picture", "rays"].iter().all(|c| row[*c] == own[0][*c])));
        let brute = |table, column| of(table, scene, "brute force", column);
        assert_eq!(brute(&renders, "boxes_per_ray"), 0.0);
        assert_eq!(brute(&pictures, "tests"), brute(&renders, "objects_per_ray"));
        for method in ["KD-tree", "median_cut", "random_orders"] {
            let ours = |table, column| of(table, scene, method, column);
            assert!(ours(&renders, "objects_per_ray") < brute(&renders, "objects_per_ray"));
            let [base, own] = [brute(&times, "render_seconds"), ours(&times, "render_seconds")];
            assert_eq!(ours(&pictures, "speed_up"), base / own, "{scene}, {method}");
        }
    }
    said(folder.path(), &["spec.toml", "--check", "--jobs", "1"]);
}
