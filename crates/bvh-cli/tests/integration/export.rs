//! Exporting trees to other tracers from the command line.

use crate::support::{bvh, facts};
use bvh_build::{Builder, goldsmith_salmon, muller_fellner};
use bvh_core::cost::Objective;
use bvh_core::export::{Layout, Target};
use bvh_core::file::{self, Origin};
use bvh_scenes::{Scene, tree_file};
use std::fs;

#[test]
fn an_export_is_the_fitted_tree_and_says_how_it_compares() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake escher:900 --budget=1Mwork --for=three-mesh-bvh --out=x.bvh");
    let scene = Scene::load("escher:900").unwrap();
    let (tree, _) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
    for target in Target::ALL {
        let file = if target.layout == Layout::Json { "x.json" } else { "x.bin" };
        let line = bvh(at, &format!("export x.bvh escher:900 --for={} --out={file}", target.name));
        assert!(line.contains("nodes of this tree; "), "{line}");
        assert!(line.contains(" % below a greedy tree's, "), "{line}");
        let bytes = fs::read(at.join(file)).unwrap();
        assert_eq!(bytes, target.bytes(&target.fit(&tree), &scene.boxes));
    }
}

#[test]
fn a_bake_for_a_tracer_has_the_cost_and_the_references_that_pay_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = Scene::load("escher:900").unwrap();
    for target in Target::ALL {
        // Without a budget, other bakes choose the cost and the references themselves.
        for budget in ["", " --budget=1Mwork"] {
            let said =
                bvh(at, &format!("bake escher:900 --for={}{budget} --out=x.bvh", target.name));
            let expected = format!("for {}, export writes", target.name);
            assert!(said.contains(&expected), "{said}");
            let (tree, header) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
            let is_divided = tree.prim_ids.len() > 900;
            assert_eq!(is_divided, target.references > 1.0, "{target:?}{budget}");
            assert_eq!(header.objective, Objective::InternalArea);
        }
    }
    let json = facts(at, "bake escher:900 --for=obvhs --references=1 --budget=1Mwork --out=x.bvh");
    assert!(json["gain inside"].is_f64() && json["is searched"] == true, "{json:?}");
    let (tree, _) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
    assert_eq!(tree.prim_ids.len(), 900);
}

#[test]
fn a_greedy_tree_is_exported_where_its_rays_take_fewer_tests() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = Scene::load("escher:900").unwrap();
    let poor = goldsmith_salmon::Config::default().build(&scene.boxes).unwrap();
    let file = file::save(&poor, &scene.boxes, &Origin::default()).unwrap();
    fs::write(at.join("poor.bvh"), file).unwrap();
    let line = bvh(at, "export poor.bvh escher:900 --for=obvhs --out=y.bin");
    assert!(line.contains("nodes of a greedy tree instead"), "{line}");
    let greedy = muller_fellner::Config::default().build(&scene.boxes).unwrap();
    let kept = Target::OBVHS.bytes(&Target::OBVHS.fit(&greedy), &scene.boxes);
    assert_eq!(fs::read(at.join("y.bin")).unwrap(), kept);
}
