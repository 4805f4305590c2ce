//! The committed comparisons with the paper: every difference has a reason.

use harness::record::{PaperRow, read};
use std::path::Path;

#[test]
fn every_difference_from_the_paper_has_a_reason() {
    let results = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../results");
    let mut compared = 0;
    for folder in std::fs::read_dir(results).unwrap() {
        let path = folder.unwrap().path().join("paper.csv");
        if !path.is_file() {
            continue;
        }
        for PaperRow { source, scene, quantity, verdict, reason, .. } in read(&path).unwrap() {
            let row = format!("{}: {source}, {scene}, {quantity}: {verdict}", path.display());
            assert!(!verdict.is_empty() && (verdict == "agrees" || !reason.is_empty()), "{row}");
            compared += 1;
        }
    }
    assert!(compared > 100, "{compared} rows");
}
