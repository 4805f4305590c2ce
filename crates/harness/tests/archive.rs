//! The archive of the best known trees: what is committed is true, and only what is better comes in.

mod support;

use bvh_core::cost;
use harness::files::load_tree;
use harness::run::{archive, reference};
use harness::scenes::Scene;
use std::fs;
use std::path::Path;
use support::{refused, said, text};

#[test]
fn every_tree_of_the_archive_is_valid_costs_what_is_written_and_is_the_best_known() {
    let results = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../results");
    let rows = archive::rows(&results).unwrap();
    assert_eq!(fs::read_dir(results.join("trees")).unwrap().count(), rows.len() + 1, "a row for every file");
    for row in rows {
        let scene = Scene::load(&row.scene).unwrap();
        let tree = load_tree(&archive::path(&results, &row.scene), &scene).unwrap();
        assert_eq!(cost::internal_area(&tree), row.internal_area, "{}", row.scene);
        assert_eq!((row.objects, row.checksum), (scene.boxes.len(), format!("{:016x}", scene.checksum())));
        let known = reference::best_known(&results, &scene).unwrap().unwrap();
        assert!(row.internal_area <= known.cost * (1.0 + 1e-12), "{}: {} is known", row.scene, known.cost);
        assert_eq!(row.lower_bound, known.lower_bound, "{}", row.scene);
    }
}

#[test]
fn only_a_better_tree_comes_into_the_archive_and_becomes_the_best_known() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    fs::create_dir(at.join("results")).unwrap();
    for (method, budget) in [("median_cut", "0s"), ("best", "200kwork")] {
        let out = format!("{budget}.bvh");
        let bake = ["bake", "spheres75:60", "--method", method, "--budget", budget, "--out", &out];
        said(at, &bake);
    }
    let files =
        || ["best_known.csv", "trees/trees.csv"].map(|file| fs::read(at.join("results").join(file)).unwrap());
    for file in ["0s.bvh", "200kwork.bvh"] {
        let kept = said(at, &["verify", file, "spheres75:60", "--keep", &format!("made {file}")]);
        assert!(kept.contains("kept in: results/trees/spheres75-60.bvh"), "{kept}");
        assert!(
            fs::read(at.join("results/trees/spheres75-60.bvh")).unwrap() == fs::read(at.join(file)).unwrap()
        );
        let [known, trees] = files().map(|bytes| text(&bytes));
        let scene = Scene::load("spheres75:60").unwrap();
        let cost = cost::internal_area(&load_tree(&at.join(file), &scene).unwrap()).to_string();
        assert!(trees.contains(&format!("made {file}")) && trees.lines().count() == 2, "{trees}");
        assert!([known, trees].iter().all(|rows| rows.contains(&cost)), "{cost}");
    }
    let before = files();
    for worse in ["0s.bvh", "200kwork.bvh"] {
        refused(at, &["verify", worse, "spheres75:60", "--keep", "worse"], 2, &["its cost is"]);
        assert!(files() == before);
    }
}
