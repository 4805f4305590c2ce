//! Inspecting and verifying tree files from the command line and from other languages.

use crate::support::{bvh, facts, text};
use bvh_core::NodeKind;
use bvh_scenes::{Scene, tree_file};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output};

#[test]
fn the_facts_begin_with_the_validity_and_are_the_same_in_json_and_from_verify() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake spheres75 --budget=0s --out=x.bvh");
    let said = bvh(at, "verify x.bvh spheres75");
    assert_eq!(bvh(at, "inspect x.bvh spheres75"), said);
    assert!(said.starts_with("valid: yes, over this scene's objects\n"), "{said}");
    let names = said.lines().map(|line| line.split_once(": ").unwrap().0);
    let mut names: Vec<String> =
        names.map(|name| name.to_lowercase().replace([' ', '–'], "_")).collect();
    names.sort_unstable();
    let json = facts(at, "verify x.bvh spheres75");
    assert!(
        json["objects"] == 75
            && json["precision"] == "single"
            && json["method"] == "best"
            && json["depth"].is_u64()
    );
    assert!(json["valid"] == true && json["saved"] == 0.0 && json["greedy_area"] == json["area"]);
    assert!(json.keys().eq(&names), "{json:?}");
    // Without a scene nobody knows whether the boxes contain their objects.
    let alone = facts(at, "inspect x.bvh");
    assert!(alone["valid"] == true && alone["scene"].is_null() && !json["scene"].is_null());
}

#[test]
fn the_nodes_are_written_in_full_precision() {
    let folder = tempfile::tempdir().unwrap();
    bvh(folder.path(), "bake spheres75 --budget=0s --out=a.bvh");
    bvh(folder.path(), "inspect a.bvh --nodes=nodes.csv");
    let scene = Scene::load("spheres75").unwrap();
    let (tree, _) = tree_file::load(&folder.path().join("a.bvh"), &scene).unwrap();
    let mut reader = csv::Reader::from_path(folder.path().join("nodes.csv")).unwrap();
    let columns = "node,parent,kind,first,count,min_x,min_y,min_z,max_x,max_y,max_z";
    let headers: Vec<&str> = reader.headers().unwrap().iter().collect();
    assert_eq!(headers.join(","), columns);
    type Row = (usize, Option<usize>, String, u32, u32, [f32; 6]);
    let rows: Vec<Row> = reader.deserialize().map(Result::unwrap).collect();
    assert_eq!(rows.len(), tree.nodes.len());
    for (index, (row, node)) in rows.iter().zip(&tree.nodes).enumerate() {
        let (number, parent, kind, first, count, corners) = row;
        assert_eq!(corners[..], [node.aabb.min.to_array(), node.aabb.max.to_array()].concat());
        let expected = match node.kind() {
            NodeKind::Inner { first, count } => ("inner", first, count),
            NodeKind::Leaf { first, count } => ("leaf", first, count),
        };
        assert_eq!((*number, (kind.as_str(), *first, *count)), (index, expected));
        // Only the root has an empty cell instead of a parent.
        assert_eq!(parent.is_none(), index == 0);
        assert!(parent.is_none_or(|parent| tree.nodes[parent].children().contains(&index)));
    }
}

/// Compares the facts of another reader with the facts of `inspect`.
fn agree(reader: &str, output: &Output, inspected: &Map<String, Value>) {
    assert!(output.status.success(), "{reader}: {}", text(&output.stderr));
    let said = text(&output.stdout);
    let read: BTreeMap<&str, &str> =
        said.lines().filter_map(|line| line.split_once(": ")).collect();
    for name in ["method", "seed", "work", "objects", "nodes", "inner nodes", "leaves", "depth"] {
        assert_eq!(
            read[name],
            inspected[&name.replace(' ', "_")].to_string().trim_matches('"'),
            "{reader}: {name}"
        );
    }
    // Another order of additions changes the last digits of a sum of areas.
    for (name, key) in [("cost when saved", "cost_when_saved"), ("internal area", "area")] {
        let expected = inspected[key].as_f64().unwrap();
        let found: f64 = read[name].parse().unwrap();
        let error = (found - expected).abs();
        assert!(error <= 1e-12 * expected, "{reader}: {name}: {found}, not {expected}");
    }
}

#[test]
fn readers_in_python_and_cpp_agree_with_inspect_and_reject_damage() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let scripts = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scripts");
    let bake = "bake spheres750 --budget=1Mwork --seed=18446744073709551615 --out=x.bvh";
    bvh(at, &format!("{bake} --method=goldsmith_salmon"));
    let inspected = facts(at, "inspect x.bvh");
    // One flipped bit must not go unnoticed.
    let mut bytes = fs::read(at.join("x.bvh")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(at.join("damaged.bvh"), bytes).unwrap();
    let mut compiler = Command::new("c++");
    compiler.args(["-std=c++17", "-O1", "-o", "read_tree"]).arg(scripts.join("read_tree.cpp"));
    if let Ok(output) = compiler.current_dir(at).output() {
        assert!(output.status.success(), "read_tree.cpp: {}", text(&output.stderr));
    }
    let script = scripts.join("read_tree.py");
    for (program, script) in [("python3".into(), Some(script)), (at.join("read_tree"), None)] {
        let read = |file| Command::new(&program).args(&script).arg(at.join(file)).output();
        let Ok(output) = read("x.bvh") else {
            eprintln!("not tried: {} is not installed", program.display());
            continue;
        };
        agree(&program.to_string_lossy(), &output, &inspected);
        assert!(!read("damaged.bvh").unwrap().status.success(), "{}", program.display());
    }
}
