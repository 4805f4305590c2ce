//! Runs that several processes share, and the results that are joined from them.

use crate::support::{TABLE, folder_with, names, refused, reproducible, run, said, text};
use bvh_scenes::fnv1a;
use std::fs;

#[test]
fn runs_performed_apart_are_joined_to_the_bytes_of_one_process_and_missing_ones_performed() {
    let folder = folder_with("spec.toml", TABLE);
    let dir = folder.path();
    said(dir, &["spec.toml", "--out", "whole"]);
    let whole = reproducible(&dir.join("whole/spec"));
    let list = said(dir, &["jobs", "spec.toml"]);
    let ids: Vec<&str> = list.lines().map(|line| line.split(' ').next().unwrap()).collect();
    assert_eq!(ids.len(), 18);
    let parts: Vec<String> = ids[4..].iter().map(|id| format!("parts/{id}")).collect();
    for (id, part) in ids[4..].iter().zip(&parts) {
        said(dir, &["spec.toml", "--run", id, "--resume", "--out", part]);
    }
    // Another processor has performed one of them.
    let partial = dir.join(&parts[0]).join("spec/.partial");
    let kept = names(&partial).into_iter().find(|name| name.ends_with(".run")).unwrap();
    let recorded = fs::read_to_string(partial.join(&kept)).unwrap();
    let (_, recorded) = recorded.split_once('\n').unwrap();
    let recorded = recorded.replace("\"processor\":\"", "\"processor\":\"another ");
    let checksum = fnv1a(recorded.bytes());
    fs::write(partial.join(&kept), format!("{checksum:016x}\n{recorded}")).unwrap();
    // Two parts may have the same run. No part is lost, whatever is asked for.
    let part = parts[0].as_str();
    for more in [&["--force"][..], &[]] {
        let args = [&["merge", part, "--out", part], more].concat();
        refused(dir, &args, 2, &["--out", part, "one of the parts"]);
    }
    let mut join = vec!["merge", "--out=joined"];
    join.extend(parts.iter().map(String::as_str).chain([part]));
    let output = run(dir, &join);
    let lines = text(&output.stderr);
    assert!(output.status.success(), "{lines}");
    assert!(lines.contains("unlike processors") && lines.contains("another "), "{lines}");
    assert!(whole == reproducible(&dir.join("joined/spec")));
    let figures =
        ["whole", "joined"].map(|out| fs::read(dir.join(out).join("spec/table.svg")).unwrap());
    assert!(figures[0] == figures[1]);
    let resolved = dir.join(part).join("spec/.partial/resolved.toml");
    let edited = fs::read_to_string(&resolved).unwrap();
    let repetitions = edited.lines().find(|line| line.starts_with("repetitions = ")).unwrap();
    fs::write(&resolved, edited.replace(repetitions, "repetitions = 4294967295")).unwrap();
    refused(dir, &["merge", part, "--out=huge"], 2, &["spec/.partial/resolved.toml: ", "runs"]);
}

#[test]
fn what_is_no_part_of_the_same_spec_is_named() {
    let folder = folder_with("spec.toml", TABLE);
    let dir = folder.path();
    for (seed, out) in [("1", "own"), ("9", "other")] {
        let list = said(dir, &["jobs", "spec.toml", "--seed", seed]);
        let run = list.split(' ').next().unwrap();
        said(dir, &["spec.toml", "--seed", seed, "--run", run, "--out", out]);
    }
    let parts = ["other/spec", "another spec"];
    refused(dir, &["merge", "own", "other", "--out=joined"], 2, &parts);
    refused(dir, &["merge", "nowhere", "--out=joined"], 2, &["DIR", "nowhere"]);
    let unknown = ["spec.toml", "--run", "0123456789abcdef", "--out", "unknown"];
    refused(dir, &unknown, 2, &["0123456789abcdef", "no such run", "harness jobs"]);
    assert!(!dir.join("unknown").exists());
    refused(dir, &["jobs", "spec.toml", "--scene", "sofa"], 2, &["sofa"]);
}
