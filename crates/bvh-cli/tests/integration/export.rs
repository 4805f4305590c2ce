//! Exporting trees to other tracers from the command line.

use crate::support::{bvh, facts, wrong};
use bvh_build::{Builder, muller_fellner};
use bvh_core::cost::Objective;
use bvh_core::export::{Layout, Target};
use bvh_scenes::{Scene, tree_file};
use std::fs;

fn file_for(target: &Target) -> &'static str {
    if target.layout == Layout::Json { "x.json" } else { "x.bin" }
}

#[test]
fn an_export_is_the_fitted_tree_and_says_how_it_compares() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake escher:900 --budget=1Mwork --for=three-mesh-bvh --out=x.bvh");
    let scene = Scene::load("escher:900").unwrap();
    let (tree, _) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
    for target in Target::ALL {
        let file = file_for(&target);
        let line = bvh(at, &format!("export x.bvh escher:900 --for={} --out={file}", target.name));
        assert!(line.contains("nodes of this tree; "), "{line}");
        assert_eq!(line.matches('−').count(), 2, "{line}");
        let bytes = fs::read(at.join(file)).unwrap();
        assert_eq!(bytes, target.bytes(&target.fit(&tree), &scene.boxes));
    }
    // A tree for another layout is worth another bake.
    bvh(at, "bake escher:900 --budget=100kwork --cost=layout --out=wide.bvh");
    for (tree, tracer, is_told) in [
        ("x.bvh", "three-mesh-bvh", false),
        ("wide.bvh", "three-mesh-bvh", true),
        // That tracer takes divided triangles.
        ("x.bvh", "obvhs", true),
    ] {
        let said = bvh(at, &format!("export {tree} escher:900 --for={tracer} --out=x.bin"));
        let hint = format!("`bvh bake escher:900 --for {tracer}`");
        assert_eq!(said.contains(&hint), is_told, "{said}");
    }
    let json = facts(at, "export wide.bvh escher:900 --for=obvhs --out=x.bin");
    assert!(json["is_searched_for_tracer"] == false && json["file"] == "x.bin", "{json:?}");
    let json = facts(at, "export x.bvh escher:900 --for=obvhs --out=x.bin");
    assert!(json["gain_inside"].is_f64() && json["is_greedy"] == false, "{json:?}");
    // A greedy tree is exported where its rays take fewer tests.
    bvh(at, "bake escher:900 --budget=1Mwork --method=goldsmith_salmon --out=poor.bvh");
    let line = bvh(at, "export poor.bvh escher:900 --for=obvhs --out=x.bin");
    assert!(line.contains("nodes of a greedy tree instead"), "{line}");
    let greedy = muller_fellner::Config::default().build(&scene.boxes).unwrap();
    let expected = Target::OBVHS.bytes(&Target::OBVHS.fit(&greedy), &scene.boxes);
    assert_eq!(fs::read(at.join("x.bin")).unwrap(), expected);
}

#[test]
fn a_bake_for_a_tracer_keeps_the_greedy_tree_where_its_rays_take_fewer_tests() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    // A ball of 24 by twelve quads.
    let angle = |part: usize| std::f64::consts::TAU / 24.0 * part as f64;
    let mut obj = String::new();
    for (up, round) in (0..13).flat_map(|up| (0..24).map(move |round| (up, round))) {
        let [(width, z), (y, x)] = [angle(up), angle(round)].map(f64::sin_cos);
        obj += &format!("v {} {} {z}\n", width * x, width * y);
    }
    for (up, round) in (0..12).flat_map(|up| (0..24).map(move |round| (up, round))) {
        let at = |up: usize, round: usize| 24 * up + round % 24 + 1;
        let [a, b] = [at(up, round), at(up, round + 1)];
        let [c, d] = [at(up + 1, round + 1), at(up + 1, round)];
        obj += &format!("f {a} {b} {c} {d}\n");
    }
    fs::write(at.join("ball.obj"), obj).unwrap();
    let scene = Scene::load(at.join("ball.obj").to_str().unwrap()).unwrap();
    let greedy = muller_fellner::Config::default().build(&scene.boxes).unwrap();
    for budget in ["", "--budget=4Mwork"] {
        let bake = format!("bake ball.obj --for=three-mesh-bvh {budget} --out=x.bvh");
        let said = bvh(at, &bake);
        assert!(said.contains("tree: greedy, because rays take fewer tests"), "{said}");
        let (tree, _) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
        assert_eq!(tree, greedy, "{budget}");
    }
    // What was searched for, continued or asked for by name is as it was found.
    bvh(at, "bake ball.obj --budget=1Mwork --out=best.bvh");
    for asked in ["--from=best.bvh", "--method=goldsmith_salmon"] {
        let said = bvh(at, &format!("bake ball.obj --for=bvh {asked} --budget=1kwork --out=y.bvh"));
        assert!(!said.contains("tree: greedy"), "{said}");
    }
}

#[test]
fn an_export_says_in_one_line_what_was_measured_over_the_own_trees_of_the_library() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake escher:900 --budget=1kwork --out=x.bvh");
    let results = concat!(env!("CARGO_MANIFEST_DIR"), "/../../results/interop/timing_tracers.csv");
    let results = fs::read_to_string(results).unwrap().replace('"', "").replace(", ", "; ");
    let mut rows = results.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let [tracer, scene, rays, tree, over, ratio] =
        ["tracer", "scene", "rays", "tree", "over", "ratio_median"]
            .map(|name| header.iter().position(|column| *column == name).unwrap());
    let rows: Vec<Vec<&str>> = rows.collect();
    for target in Target::ALL {
        let file = file_for(&target);
        let said = bvh(at, &format!("export x.bvh escher:900 --for={} --out={file}", target.name));
        let made = if target.references > 1.0 { "divided" } else { "searched" };
        let found = |row: &&Vec<&str>| {
            row[tracer].split(' ').next() == Some(target.name)
                && ["primary", "incoherent"].contains(&row[rays])
                && [row[tree], row[over]] == [made, "best"]
                && !row[scene].contains(" and ")
        };
        let ratios = rows.iter().filter(found).map(|row| row[ratio].parse().unwrap());
        let ratios: Vec<f64> = ratios.collect();
        assert!(ratios.len().is_multiple_of(14));
        assert_eq!(ratios.is_empty(), target == Target::PLAIN);
        let [least, most] = [f64::min, f64::max]
            .map(|pick: fn(f64, f64) -> f64| ratios.iter().copied().reduce(pick).unwrap_or(0.0));
        let range = format!("{least:.2} to {most:.2} times the speed");
        assert_eq!(said.contains(&range), !ratios.is_empty(), "{range}: {said}");
        assert_eq!(said.matches(" times the speed").count(), usize::from(!ratios.is_empty()));
    }
}

#[test]
fn a_tree_that_divides_triangles_is_for_tracers_that_count_hits_only_if_one_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake escher:900 --budget=1Mwork --references=1.3 --out=x.bvh");
    let export = "export x.bvh escher:900 --out=x.bin --for";
    bvh(at, &format!("{export}=obvhs"));
    wrong(at, &format!("{export}=bvh"), &["x.bvh", "900 objects", "--for bvh`", "--divided"]);
    bvh(at, &format!("{export}=bvh --divided"));
}

#[test]
fn a_bake_for_a_tracer_has_the_cost_and_the_references_that_pay_there() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scene = Scene::load("escher:900").unwrap();
    for target in Target::ALL {
        // Without a budget, other bakes choose the cost and the references themselves.
        for budget in ["", " --budget=1Mwork"] {
            bvh(at, &format!("bake escher:900 --for={}{budget} --out=x.bvh", target.name));
            let (tree, header) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
            let is_divided = tree.prim_ids.len() > 900;
            assert_eq!(is_divided, target.references > 1.0, "{target:?}{budget}");
            assert_eq!(header.objective, Objective::InternalArea);
        }
    }
    bvh(at, "bake escher:900 --for=obvhs --references=1 --budget=1Mwork --out=x.bvh");
    let (tree, _) = tree_file::load(&at.join("x.bvh"), &scene).unwrap();
    assert_eq!(tree.prim_ids.len(), 900);
}
