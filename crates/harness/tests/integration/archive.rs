//! The archive of the best known trees: the committed rows are true, and only better trees are
//! added.

use crate::support::{folder_with, refused, said, save, text, top};
use bvh_build::{Builder, median_cut};
use bvh_core::{Bvh, cost};
use bvh_scenes::Scene;
use bvh_scenes::tree_file;
use bvh_search::{Budget, Problem, best, optimize};
use harness::run::{archive, reference};
use std::fs;

#[test]
fn every_tree_of_the_archive_is_valid_has_the_recorded_cost_and_is_the_best_known() {
    let results = top().join("results");
    let rows = archive::rows(&results).unwrap();
    assert_eq!(
        fs::read_dir(results.join("trees")).unwrap().count(),
        rows.len() + 1,
        "a row for every file"
    );
    for row in rows {
        let scene = Scene::load(&row.scene).unwrap();
        let (tree, _) = tree_file::load(&archive::path(&results, &row.scene), &scene).unwrap();
        assert_eq!(cost::internal_area(&tree), row.internal_area, "{}", row.scene);
        assert_eq!(
            (row.objects, row.checksum),
            (scene.boxes.len(), format!("{:016x}", scene.checksum()))
        );
        let known = reference::best_known(&results, &scene).unwrap().unwrap();
        assert!(
            row.internal_area <= known.cost * (1.0 + 1e-12),
            "{}: {} is known",
            row.scene,
            known.cost
        );
        assert_eq!(row.lower_bound, known.lower_bound, "{}", row.scene);
    }
}

/// Returns a tree of the scene and a better one.
fn trees(scene: &Scene) -> [Bvh; 2] {
    let poor = median_cut::Config::default().build(&scene.boxes).unwrap();
    let budget = Budget { max_work: Some(200_000), ..Budget::UNLIMITED };
    let config = best::Config::default();
    let found = optimize(&poor, &Problem::new(&scene.boxes), &config, 1, budget, &()).unwrap();
    [poor, found.tree]
}

#[test]
fn a_tree_from_elsewhere_is_compared_with_the_best_known() {
    let spec = "question = 'q'\nscenes = ['spheres75:60']\nmethods = [{ method = 'median_cut' }]\n";
    let folder = folder_with("spec.toml", spec);
    let dir = folder.path();
    said(dir, &["spec.toml"]);
    let scene = Scene::load("spheres75:60").unwrap();
    let [poor, good] = trees(&scene);
    save(&good, &scene, &dir.join("good.bvh"));
    let shown = said(dir, &["compare", "good.bvh", "spheres75:60"]);
    assert!(shown.contains("found by: median_cut"), "{shown}");
    let ratio = cost::internal_area(&good) / cost::internal_area(&poor);
    assert!(
        ratio < 1.0 && shown.contains(&format!("over the best known: {ratio}")),
        "{ratio}: {shown}"
    );
    // Another scene has no best known cost, and the tree does not fit it.
    let other = Scene::load("spheres75:50").unwrap();
    // The tree is valid, but over other boxes than the named scene has.
    let [tree, _] = trees(&other);
    save(&tree, &other, &dir.join("other.bvh"));
    assert!(
        said(dir, &["compare", "other.bvh", "spheres75:50"]).contains("none of this very scene")
    );
    refused(dir, &["compare", "other.bvh", "spheres75:60"], 2, &["other.bvh"]);
}

#[test]
fn only_a_better_tree_is_archived_and_becomes_the_best_known() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    fs::create_dir(dir.join("results")).unwrap();
    let scene = Scene::load("spheres75:60").unwrap();
    let [poor, good] = trees(&scene);
    save(&poor, &scene, &dir.join("poor.bvh"));
    save(&good, &scene, &dir.join("good.bvh"));
    let files = || {
        ["best_known.csv", "trees/trees.csv"]
            .map(|file| fs::read(dir.join("results").join(file)).unwrap())
    };
    for file in ["poor.bvh", "good.bvh"] {
        let kept = said(dir, &["compare", file, "spheres75:60", "--keep", &format!("made {file}")]);
        assert!(kept.contains("kept in: results/trees/spheres75-60.bvh"), "{kept}");
        assert!(
            fs::read(dir.join("results/trees/spheres75-60.bvh")).unwrap()
                == fs::read(dir.join(file)).unwrap()
        );
        let [known, trees] = files().map(|bytes| text(&bytes));
        let (tree, _) = tree_file::load(&dir.join(file), &scene).unwrap();
        let cost = cost::internal_area(&tree).to_string();
        assert!(trees.contains(&format!("made {file}")) && trees.lines().count() == 2, "{trees}");
        assert!([known, trees].iter().all(|rows| rows.contains(&cost)), "{cost}");
    }
    let before = files();
    for worse in ["poor.bvh", "good.bvh"] {
        refused(dir, &["compare", worse, "spheres75:60", "--keep", "worse"], 2, &["its cost is"]);
        assert!(files() == before);
    }
}
