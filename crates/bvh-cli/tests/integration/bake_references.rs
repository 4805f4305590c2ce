//! Baking with divided objects, in scenes where it pays and in scenes where it does not.

use crate::support::{facts, refused, said};
use bvh_scenes::Scene;
use bvh_scenes::tree_file;
use std::collections::BTreeMap;
use std::fs;

#[test]
fn a_bake_divides_objects_where_it_pays_and_minimises_the_cost_of_the_layout() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let bake = |out: &str, more: &[&str]| {
        let args = ["bake", "pinecon2", "--budget", "1Mwork", "--out", out];
        let said = said(at, &[&args, more].concat());
        (said, facts(&self::said(at, &["inspect", out, "pinecon2"])))
    };
    let (_, whole) = bake("whole.bvh", &[]);
    let (said_split, split) = bake("split.bvh", &["--references", "1.3"]);
    assert!(
        said_split.contains("area of all nodes") && said_split.contains(" references to "),
        "{said_split}"
    );
    let objects = number(&split, "objects");
    let references = number(&split, "references");
    assert_eq!(number(&whole, "references"), objects);
    assert!(references > objects && references <= 1.3 * objects, "{references} of {objects}");
    // The heuristic counts leaves, which the internal area does not.
    assert!(number(&split, "surface area heuristic") < number(&whole, "surface area heuristic"));
    let (said_layout, layout) = bake("layout.bvh", &["--cost", "layout"]);
    assert!(said_layout.contains("cost of the wide layout"), "{said_layout}");
    assert_eq!(layout["objective"], "cost of the wide layout, by area");
    let scene = Scene::load("pinecon2").unwrap();
    let costs = ["layout.bvh", "whole.bvh"].map(|file| {
        let (tree, header) = tree_file::load(&at.join(file), &scene).unwrap();
        assert_eq!(header.cost.to_bits(), header.objective.cost(&tree).to_bits(), "{file}");
        bvh_core::cost::layout_area(&tree)
    });
    assert!(costs[0] < costs[1], "{costs:?}");
    // A tree for rays is recorded with its cost for random lines.
    bake("rays.bvh", &["--rays", "default"]);
    let (tree, header) = tree_file::load(&at.join("rays.bvh"), &scene).unwrap();
    assert_eq!(header.cost.to_bits(), bvh_core::cost::layout_area(&tree).to_bits());
    bake("further.bvh", &["--references", "1.3", "--from", "split.bvh"]);
    let accepted = (100.0 * references / objects).ceil() / 100.0;
    let args = ["bake", "pinecon2", "--budget", "1Mwork", "--out", "no.bvh", "--from", "split.bvh"];
    let words = format!(
        "--from split.bvh: the tree has {references} references to {objects} objects; accepted: \
         --references {accepted:.2} or more"
    );
    refused(at, &args, 2, &[&words]);
    said(at, &["render", "pinecon2", "--accel", "split.bvh", "--out", "a.png", "--size", "16x16"]);
    let args = ["bake", "pinecon2", "--budget", "1Mwork", "--out", "no.bvh", "--references", "nan"];
    refused(at, &args, 2, &["--references NaN; accepted: 1 to 16"]);
}

fn number(facts: &BTreeMap<String, String>, name: &str) -> f64 {
    facts[name].parse().unwrap()
}

#[test]
fn a_scene_that_needs_no_divided_objects_gives_the_same_tree_and_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let bake = |scene: &str, cost: &str, references: &str| {
        let args = ["bake", scene, "--budget", "300kwork", "--out", "x.bvh", "--cost", cost];
        let said = said(at, &[&args[..], &["--references", references]].concat());
        (said, fs::read(at.join("x.bvh")).unwrap())
    };
    for scene in ["spheres75", "S04:3000"] {
        for cost in ["area", "layout"] {
            let [(_, whole), (said, allowed)] =
                ["1", "1.5"].map(|references| bake(scene, cost, references));
            assert!(said.contains("no object is divided"), "{said}");
            assert!(whole == allowed, "{scene}, {cost}: a different tree");
        }
    }
    let [(_, whole), (said, allowed)] =
        ["1", "1.5"].map(|references| bake("pinecon2", "layout", references));
    assert!(!said.contains("no object is divided") && whole != allowed, "{said}");
}
