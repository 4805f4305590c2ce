//! Runs that several processes share, and the merge of their results.

use crate::support::{TABLE, folder_with, part, refused, reproducible, said};
use std::fs;

#[test]
fn parts_made_apart_are_merged_to_the_bytes_of_one_run_and_what_is_missing_or_differs_is_named() {
    let folder = folder_with("spec.toml", TABLE);
    let part =
        |number: usize, out: &str| part(folder.path(), "spec.toml", number, 3, &["--out", out]);
    let refused = |args: &[&str], code: i32, parts: &[&str]| {
        refused(folder.path(), args, code, parts);
        assert!(!folder.path().join("merged").exists());
    };
    said(folder.path(), &["spec.toml", "--out", "whole"]);
    part(0, "one");
    part(2, "three");
    let missing = ["spec: 6 of 18 runs are missing", "scene escher, method greedy, repetition 1"];
    refused(&["merge", "one", "three", "--out", "merged"], 1, &missing);
    refused(&["merge", "one", "whole", "--out", "merged"], 2, &["whole", "--run"]);
    refused(&["merge", "one", "nowhere", "--out", "merged"], 1, &["nowhere"]);

    // Two parts may hold the same run, as long as its results agree.
    part(1, "two");
    // The second copy of the same part stands for a machine that was started twice.
    part(1, "again");
    let folders = ["merge", "one", "two", "three", "again", "--out"];
    said(folder.path(), &[&folders[..], &["merged"]].concat());
    let whole = reproducible(&folder.path().join("whole/spec"));
    assert!(whole == reproducible(&folder.path().join("merged/spec")));
    let [figure, merged_figure] = ["whole", "merged"]
        .map(|out| fs::read(folder.path().join(out).join("spec/table.svg")).unwrap());
    assert!(figure == merged_figure);
    let provenance = fs::read_to_string(folder.path().join("merged/spec/provenance.toml")).unwrap();
    assert_eq!(provenance.matches("[[parts]]").count(), 4);
    fs::remove_dir_all(folder.path().join("merged")).unwrap();

    let kept = folder.path().join("again/spec/.partial/000001/runs.csv");
    fs::write(&kept, fs::read_to_string(&kept).unwrap().replace("escher", "esther")).unwrap();
    let differs = ["again/spec/.partial/000001", "runs.csv is damaged"];
    refused(&[&folders[..], &["merged"]].concat(), 1, &differs);
    let other = said(folder.path(), &["jobs", "spec.toml", "--seed", "9"]);
    let run = other.split(' ').next().unwrap();
    said(folder.path(), &["spec.toml", "--seed=9", "--run", run, "--out", "two", "--force"]);
    refused(&["merge", "one", "two", "three", "--out", "merged"], 1, &["different specs"]);
    refused(&["merge", "one", "--out", "one"], 2, &["--out one"]);

    let resolved = folder.path().join("one/spec/.partial/resolved.toml");
    let edited = fs::read_to_string(&resolved)
        .unwrap()
        .replace("repetitions = 3", "repetitions = 4294967295");
    fs::write(&resolved, edited).unwrap();
    refused(
        &["merge", "one", "--out", "merged"],
        1,
        &["one/spec/.partial/resolved.toml: ", "runs; accepted"],
    );
}

#[test]
fn listed_runs_performed_one_by_one_are_merged_to_the_bytes_of_one_process() {
    let folder = folder_with("spec.toml", TABLE);
    let dir = folder.path();
    said(dir, &["spec.toml", "--out", "whole"]);
    let list = said(dir, &["jobs", "spec.toml"]);
    let ids: Vec<&str> = list.lines().map(|line| line.split(' ').next().unwrap()).collect();
    assert_eq!(ids.len(), 18);
    let parts: Vec<String> = ids.iter().map(|id| format!("parts/{id}")).collect();
    for (id, part) in ids.iter().zip(&parts) {
        said(dir, &["spec.toml", "--run", id, "--resume", "--out", part]);
    }
    let merge: Vec<&str> = ["merge"]
        .into_iter()
        .chain(parts.iter().map(String::as_str))
        .chain(["--out", "merged"])
        .collect();
    refused(dir, &[&merge[..5], &["--out", "merged"]].concat(), 1, &["14 of 18 runs are missing"]);

    // A part that two processors have worked on.
    let provenance = dir.join(&parts[0]).join("spec/.partial/provenance.toml");
    let recorded = fs::read_to_string(&provenance).unwrap();
    fs::write(&provenance, recorded.replace("cpu = \"", "cpu = \"another ")).unwrap();
    let resumed = ["spec.toml", "--run", ids[0], "--resume", "--out", parts[0].as_str()];
    said(dir, &resumed);
    refused(dir, &merge, 1, &["unlike processors", "another ", "--unlike-processors"]);
    assert!(!dir.join("merged").exists());
    said(dir, &[&merge[..], &["--unlike-processors"]].concat());
    assert!(reproducible(&dir.join("whole/spec")) == reproducible(&dir.join("merged/spec")));

    let unknown = ["spec.toml", "--run", "0123456789abcdef", "--out", "unknown"];
    refused(dir, &unknown, 2, &["0123456789abcdef", "no such run", "harness jobs"]);
    assert!(!dir.join("unknown").exists());
    refused(dir, &["jobs", "spec.toml", "--scene", "sofa"], 2, &["sofa"]);
}
