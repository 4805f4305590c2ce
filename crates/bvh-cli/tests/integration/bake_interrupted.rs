//! Ctrl-C while `bvh bake` searches: the best tree so far is written, and it is a good one.
use crate::support::{begin, bvh, cost, ended, names, send, words};
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

/// Bakes a scene into `a.bvh`, and interrupts the search this long after it has begun.
fn interrupted(folder: &Path, bake: &str, after: Duration) {
    let before = fs::read_dir(folder).unwrap().count();
    let child = begin(folder, &words(&format!("bake --out=a.bvh {bake}")));
    // The file is reserved before the search begins.
    while fs::read_dir(folder).unwrap().count() == before {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(after);
    send("-INT", &child);
    ended(&child.wait_with_output().unwrap(), 130, &["`--from a.bvh` continues"]);
}

#[test]
fn ctrl_c_keeps_the_best_tree_so_far_also_while_a_bake_decides() {
    for bake in ["konistil --budget=1h", "konistil"] {
        let folder = tempfile::tempdir().unwrap();
        interrupted(folder.path(), bake, Duration::ZERO);
        bvh(folder.path(), "verify a.bvh konistil");
        assert_eq!(names(folder.path()), ["a.bvh"]);
    }
}

#[test]
fn a_bake_that_is_interrupted_early_is_not_behind_plain_reinsertion() {
    let folder = tempfile::tempdir().unwrap();
    let cost = |file: &str| cost(folder.path(), file);
    let begin = Instant::now();
    bvh(folder.path(), "bake escher --method=reinsertion --budget=1000Gwork --out=plain.bvh");
    // The time suffices for reinsertion and the trees built before it, also on a busy machine. The
    // heat of a long search has not paid by then.
    let plain = cost("plain.bvh");
    let after = Duration::from_secs(1) + 8 * begin.elapsed();
    for more in ["--budget=1h", "--budget=1000Gwork", "--budget=1h --references=1.2"] {
        interrupted(folder.path(), &format!("escher {more}"), after);
        // If leaves may be divided, they are part of the measure, and moves with equal gains come
        // in a different order.
        let most = if more.contains("--references") { 1.0001 } else { 1.0 };
        let found = cost("a.bvh");
        assert!(found <= most * plain, "{more:?}: {found} is above {plain}");
        fs::remove_file(folder.path().join("a.bvh")).unwrap();
    }
}
