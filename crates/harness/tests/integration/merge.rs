//! Runs that several processes share, and the results that are joined from them.

use crate::support::{TABLE, folder_with, refused, reproducible, run, said, text};
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
    // Two parts may have the same run, which two processors have worked on.
    let provenance = dir.join(&parts[0]).join("spec/.partial/provenance.toml");
    let recorded = fs::read_to_string(&provenance).unwrap();
    fs::write(&provenance, recorded.replace("cpu = \"", "cpu = \"another ")).unwrap();
    said(dir, &["spec.toml", "--run", ids[4], "--resume", "--out", &parts[0]]);
    let mut join = vec!["spec.toml", "--verbose", "--out=joined", "--from"];
    join.extend(parts.iter().map(String::as_str).chain([parts[0].as_str()]));
    let output = run(dir, &join);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let lines = text(&output.stderr);
    assert_eq!(lines.matches(", took ").count(), 4, "the missing runs: {lines}");
    assert!(lines.contains("unlike processors") && lines.contains("another "), "{lines}");
    assert!(whole == reproducible(&dir.join("joined/spec")));
    // `merge` needs no spec and performs nothing.
    let merge = |parts: &[String]| -> Vec<String> {
        let fixed = ["merge", "--out", "merged"].map(String::from);
        fixed.into_iter().chain(parts.iter().cloned()).collect()
    };
    let arguments = merge(&parts);
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    refused(dir, &arguments, 2, &["4 of 18 runs are missing", "repetition 0"]);
    // No part is lost, whatever is asked for.
    let part = parts[0].as_str();
    for flag in ["--force", "--resume"] {
        let join = ["spec.toml", flag, "--out", part, "--from", part];
        refused(dir, &join, 2, &["--out", part, "one of the parts"]);
    }
    refused(dir, &["merge", part, "--force", "--out", part], 2, &["--out", part]);
    let rest: Vec<String> = ids[..4].iter().map(|id| format!("rest/{id}")).collect();
    for (id, part) in ids[..4].iter().zip(&rest) {
        said(dir, &["spec.toml", "--run", id, "--out", part]);
    }
    let arguments = merge(&rest);
    said(dir, &arguments.iter().map(String::as_str).collect::<Vec<_>>());
    assert!(whole == reproducible(&dir.join("merged/spec")));
    let resolved = dir.join(part).join("spec/.partial/resolved.toml");
    let edited = fs::read_to_string(&resolved).unwrap();
    fs::write(&resolved, edited.replace("repetitions = 3", "repetitions = 4294967295")).unwrap();
    refused(dir, &["merge", part, "--out=huge"], 2, &["spec/.partial/resolved.toml: ", "runs"]);
    let figures =
        ["whole", "joined"].map(|out| fs::read(dir.join(out).join("spec/table.svg")).unwrap());
    assert!(figures[0] == figures[1]);
}

#[test]
fn what_is_no_part_of_the_same_spec_is_named() {
    let folder = folder_with("spec.toml", TABLE);
    let dir = folder.path();
    let other = said(dir, &["jobs", "spec.toml", "--seed", "9"]);
    let run = other.split(' ').next().unwrap();
    said(dir, &["spec.toml", "--seed=9", "--run", run, "--out", "other"]);
    let join = |part| ["spec.toml", "--from", part, "--out", "joined"];
    refused(dir, &join("other"), 2, &["--from", "other/spec", "another spec"]);
    refused(dir, &join("nowhere"), 2, &["--from", "nowhere"]);
    let unknown = ["spec.toml", "--run", "0123456789abcdef", "--out", "unknown"];
    refused(dir, &unknown, 2, &["0123456789abcdef", "no such run", "harness jobs"]);
    assert!(!dir.join("unknown").exists());
    refused(dir, &["jobs", "spec.toml", "--scene", "sofa"], 2, &["sofa"]);
}
