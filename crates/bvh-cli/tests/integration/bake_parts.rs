//! Baking a scene in parts, in one process and in several, of which one is killed.

use crate::support::{begin, bvh, cost, names, number, send, words};
use std::fs;

#[test]
fn joined_parts_cost_at_most_a_percent_more_than_a_whole_bake_of_the_same_work() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    bvh(at, "bake escher --budget=30Mwork --parts=4 --out=parts.bvh");
    bvh(at, "bake escher --budget=30Mwork --out=whole.bvh");
    bvh(at, "verify parts.bvh escher");
    let [parts, whole] = ["parts.bvh", "whole.bvh"].map(|file| cost(at, file));
    assert!(parts <= 1.01 * whole, "{parts} is more than 1 % above {whole}");
}

#[test]
fn parts_baked_apart_give_the_same_file_although_one_process_is_killed() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let bake = "bake escher:2000 --budget=6Mwork --parts=4 --references=1.2";
    bvh(at, &format!("{bake} --out=one.bvh"));
    let several = format!("{bake} --out=several.bvh");
    let list = bvh(at, &format!("{several} --list"));
    let ids: Vec<&str> = list.lines().map(|line| words(line)[0]).collect();
    assert_eq!(ids.len(), 4);
    let killed = begin(at, &words(&format!("{several} --part={}", ids[2])));
    while !at.join("several.parts").exists() {
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    send("-KILL", &killed);
    killed.wait_with_output().unwrap();
    for id in &ids {
        bvh(at, &format!("{several} --part={id}"));
    }
    // The killed process may have left a file under another name, which nothing reads.
    let found = names(&at.join("several.parts"));
    assert!(ids.iter().all(|id| found.contains(&format!("{id}.bvh"))), "{found:?}");
    assert!(!at.join("several.bvh").exists());
    bvh(at, &several);
    let references = number(at, "verify several.bvh escher:2000", "references");
    assert!(references > 2000.0 && references <= 2400.0, "{references}");
    let [one, several] = ["one.bvh", "several.bvh"].map(|file| fs::read(at.join(file)).unwrap());
    assert!(one == several);
}
