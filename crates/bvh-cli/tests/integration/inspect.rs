//! Inspecting and verifying tree files from the command line and from other languages.

use crate::support::{facts, number, refused, said, text};
use bvh_scenes::{Scene, tree_file};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

#[test]
fn the_facts_are_the_same_in_json() {
    let folder = tempfile::tempdir().unwrap();
    said(folder.path(), &["bake", "spheres75", "--budget=0s", "--out=x.bvh"]);
    let plain = facts(&said(folder.path(), &["inspect", "x.bvh", "spheres75"]));
    let json = said(folder.path(), &["inspect", "x.bvh", "spheres75", "--json"]);
    let json: BTreeMap<String, serde_json::Value> = serde_json::from_str(&json).unwrap();
    assert!(
        json["objects"] == 75 && json["method"] == "best" && json["depth"].is_u64(),
        "{json:?}"
    );
    assert!(json.keys().eq(plain.keys()));
    for name in ["internal area", "surface area heuristic", "internal area over Müller–Fellner's"]
    {
        assert_eq!(json[name].as_f64(), plain[name].parse().ok(), "{name}");
    }
}

#[test]
fn a_tree_from_elsewhere_is_verified_for_its_own_scene_only() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    said(at, &["bake", "spheres75", "--budget=0s", "--out=x.bvh"]);
    let inspected = said(at, &["inspect", "x.bvh", "spheres75"]);
    assert_eq!(said(at, &["verify", "x.bvh", "spheres75"]), inspected);
    refused(at, &["verify", "x.bvh", "spheres750"], 2, &["75 objects", "750"]);
}

#[test]
fn the_nodes_are_written_in_full_precision() {
    let folder = tempfile::tempdir().unwrap();
    said(folder.path(), &["bake", "spheres75", "--budget", "0s", "--out", "a.bvh"]);
    said(folder.path(), &["inspect", "a.bvh", "--nodes", "nodes.csv"]);
    let scene = Scene::load("spheres75").unwrap();
    let (tree, _) = tree_file::load(&folder.path().join("a.bvh"), &scene).unwrap();
    let mut reader = csv::Reader::from_path(folder.path().join("nodes.csv")).unwrap();
    let columns = "node,parent,kind,first,count,min_x,min_y,min_z,max_x,max_y,max_z";
    let headers: Vec<&str> = reader.headers().unwrap().iter().collect();
    assert_eq!(headers.join(","), columns);
    let mut rows = 0;
    for (index, row) in reader.records().enumerate() {
        let row = row.unwrap();
        let node = &tree.nodes[index];
        let corners = [node.aabb.min.to_array(), node.aabb.max.to_array()].concat();
        let written: Vec<f32> = (5..11).map(|column| row[column].parse().unwrap()).collect();
        assert_eq!(written, corners);
        let kind = if node.is_leaf() { "leaf" } else { "inner" };
        assert_eq!((&row[0], &row[2]), (index.to_string().as_str(), kind));
        // Only the root has an empty cell instead of a parent.
        match row[1].parse::<usize>() {
            Ok(parent) => assert!(tree.nodes[parent].children().contains(&index)),
            Err(_) => assert_eq!((&row[1], index), ("", 0)),
        }
        rows += 1;
    }
    assert_eq!(rows, tree.nodes.len());
}

/// Compares the facts of another reader with the facts of `inspect`.
fn agree(reader: &str, output: &Output, inspected: &BTreeMap<String, String>) {
    assert!(output.status.success(), "{reader}: {}", text(&output.stderr));
    let read = facts(&text(&output.stdout));
    for name in ["method", "seed", "work", "objects", "nodes", "inner nodes", "leaves", "depth"] {
        assert_eq!(read[name], inspected[name], "{reader}: {name}");
    }
    // Another order of additions changes the last digits of a sum of areas.
    for name in ["cost when saved", "internal area"] {
        let expected = number(inspected, name);
        let found = number(&read, name);
        let error = (found - expected).abs();
        assert!(error <= 1e-12 * expected, "{reader}: {name}: {found}, not {expected}");
    }
}

#[test]
fn readers_in_python_and_cpp_agree_with_inspect_and_reject_damage() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts");
    let trees = [("best", "escher"), ("goldsmith_salmon", "spheres750"), ("best", "spheres75:1")];
    for (index, (method, scene)) in trees.iter().enumerate() {
        let out = format!("{index}.bvh");
        let bake = ["bake", scene, "--budget=1Mwork", "--seed=18446744073709551615"];
        said(at, &[&bake[..], &["--method", method, "--out", &out]].concat());
        // One flipped bit must not go unnoticed.
        let mut bytes = fs::read(at.join(&out)).unwrap();
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(at.join(format!("{index}.damaged")), bytes).unwrap();
    }
    let mut readers = Vec::new();
    let python = Command::new("python3").arg("--version").output();
    if python.is_ok_and(|output| output.status.success()) {
        readers.push(("python3", vec![scripts.join("read_tree.py")]));
    }
    let built = Command::new("c++")
        .args(["-std=c++17", "-O1", "-o"])
        .args([at.join("read_tree"), scripts.join("read_tree.cpp")])
        .output();
    match built {
        Ok(output) if output.status.success() => readers.push(("read_tree", vec![])),
        Ok(output) => panic!("read_tree.cpp: {}", text(&output.stderr)),
        Err(_) => {}
    }
    for (name, args) in &readers {
        let program = if args.is_empty() { at.join(name).into_os_string() } else { name.into() };
        let read =
            |file: String| Command::new(&program).args(args).arg(at.join(file)).output().unwrap();
        for index in 0..trees.len() {
            let inspected = facts(&said(at, &["inspect", &format!("{index}.bvh")]));
            agree(name, &read(format!("{index}.bvh")), &inspected);
            let damaged = read(format!("{index}.damaged"));
            assert!(!damaged.status.success(), "{name} accepted a damaged file");
        }
    }
    let tried: Vec<&str> = readers.iter().map(|reader| reader.0).collect();
    eprintln!("readers tried: {tried:?}; the other programs are not installed");
}

#[test]
fn an_inspection_with_rays_measures_their_expected_tests() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let measured = |method: &str| {
        let bake = ["bake", "escher", "--budget=2Mwork", "--out=a.bvh", "--method", method];
        said(at, &bake);
        let facts = facts(&said(at, &["inspect", "a.bvh", "escher", "--rays", "default"]));
        number(&facts, "expected tests of a ray")
    };
    let searched = measured("best");
    assert!(0.0 < searched && searched < measured("muller_fellner"), "{searched}");
    refused(at, &["inspect", "a.bvh", "--rays", "default"], 2, &["--rays", "SCENE"]);
}
