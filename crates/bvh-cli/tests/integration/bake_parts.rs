//! Baking a scene in parts, in one process and in several, of which one is killed.

use crate::support::{begin, cost, facts, names, refused, said, send};
use std::fs;
use std::path::Path;

/// Bakes escher in four parts into `out`.
const BAKE: [&str; 6] = ["bake", "escher", "--budget", "30Mwork", "--parts", "4"];

fn bake(folder: &Path, out: &str, more: &[&str]) -> String {
    said(folder, &[&BAKE[..], &["--out", out], more].concat())
}

/// Returns the identifiers of the parts.
fn listed(folder: &Path) -> Vec<String> {
    bake(folder, "x.bvh", &["--list"])
        .lines()
        .map(|line| line.split(' ').next().unwrap().to_owned())
        .collect()
}

#[test]
fn joined_parts_cost_at_most_a_percent_more_than_a_whole_bake_of_the_same_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bake(at, "parts.bvh", &[]);
    said(at, &[&BAKE[..4], &["--out", "whole.bvh"]].concat());
    said(at, &["verify", "parts.bvh", "escher"]);
    let [parts, whole] = ["parts.bvh", "whole.bvh"].map(|file| cost(at, file));
    assert!(parts <= 1.01 * whole, "{parts} is more than 1 % above {whole}");
}

#[test]
fn joined_parts_may_have_divided_objects() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bake(at, "parts.bvh", &["--references", "1.2"]);
    let facts = facts(&said(at, &["verify", "parts.bvh", "escher"]));
    let [references, objects] =
        ["references", "objects"].map(|name| facts[name].parse::<f64>().unwrap());
    assert!(references > objects && references <= 1.2 * objects, "{references} of {objects}");
}

#[test]
fn parts_baked_apart_give_the_same_file_although_one_process_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bake(at, "one.bvh", &[]);
    let ids = listed(at);
    assert_eq!(ids.len(), 4);
    let killed = begin(at, &[&BAKE[..], &["--out", "several.bvh", "--part", &ids[2]]].concat());
    while !at.join("several.parts").exists() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    send("-KILL", &killed);
    killed.wait_with_output().unwrap();
    for id in &ids {
        bake(at, "several.bvh", &["--part", id]);
    }
    let mut files: Vec<String> = ids.iter().map(|id| format!("{id}.bvh")).collect();
    files.sort();
    // The killed process may have left a file under another name, which nothing reads.
    let found = names(&at.join("several.parts"));
    assert!(files.iter().all(|file| found.contains(file)), "{found:?}");
    assert!(!at.join("several.bvh").exists());
    bake(at, "several.bvh", &[]);
    let [one, several] = ["one.bvh", "several.bvh"].map(|file| fs::read(at.join(file)).unwrap());
    assert!(one == several);
}

#[test]
fn wrong_parts_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    for (more, parts) in [
        (["--part", "0123"], ["--part 0123", "no such part", "--list"]),
        (["--rays", "default"], ["--parts", "--rays", "cannot be used with"]),
    ] {
        refused(at, &[&BAKE[..], &more].concat(), 2, &parts);
    }
    refused(
        at,
        &["bake", "spheres75", "--parts", "76", "--budget", "1Mwork"],
        2,
        &["--parts 76", "75 objects", "2 to 75"],
    );
    // No number of parts suits a scene of one object.
    refused(
        at,
        &["bake", "escher:1", "--parts", "2", "--budget", "1Mwork"],
        2,
        &["--parts 2", "accepted: no parts"],
    );
    refused(at, &["bake", "escher", "--parts", "4"], 2, &["--budget"]);
    assert!(names(at).is_empty());
}
