//! The archive of the best known trees.

use crate::support::{rows, top};
use bvh_core::cost;
use bvh_scenes::{Scene, tree_file};
use harness::report::query::Row;
use std::fs;

#[test]
fn every_tree_of_the_archive_is_valid_has_the_recorded_cost_and_is_the_best_known() {
    let results = top().join("results");
    let trees = rows(&results.join("trees/trees.csv"));
    let files = fs::read_dir(results.join("trees")).unwrap().count();
    assert_eq!(files, trees.len() + 1, "a row for every file");
    let known = rows(&results.join("best_known.csv"));
    for row in trees {
        let scene = Scene::load(&row["scene"]).unwrap();
        let file = format!("trees/{}.bvh", row["scene"].replace(':', "-"));
        let (tree, _) = tree_file::load(&results.join(file), &scene).unwrap();
        // Wider nodes and leaves would make every cost beatable.
        assert_eq!(tree.nodes.len() + 1, 2 * scene.boxes.len(), "{}", row["scene"]);
        let area = cost::internal_area(&tree);
        let boxes = [scene.boxes.len().to_string(), format!("{:016x}", scene.checksum())];
        assert_eq!(area.to_string(), row["internal_area"], "{}", row["scene"]);
        let is_own = |other: &&Row| {
            ["scene", "objects", "checksum"].iter().all(|column| row[*column] == other[*column])
                && other["objective"] == "internal_area"
        };
        assert_eq!(boxes, [row["objects"].clone(), row["checksum"].clone()]);
        let known = known.iter().find(is_own).unwrap();
        let least: f64 = known["cost"].parse().unwrap();
        assert!(area <= least * (1.0 + 1e-12), "{}: {least} is known", row["scene"]);
    }
}
