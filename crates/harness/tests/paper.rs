//! The committed comparisons with the paper: every difference has a reason.

use harness::report::paper::{PaperRow, Verdict};
use harness::run::rows::read;
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
        // Rows without a value of the paper only add to the others.
        for row in read::<PaperRow>(&path).unwrap().iter().filter(|row| !row.paper.is_empty()) {
            let needs_none = matches!(row.verdict, Verdict::Agrees | Verdict::CannotBeTold);
            let explained = !row.rule.is_empty() && (needs_none || !row.reason.is_empty());
            assert!(explained, "{}: {row:?}", path.display());
            compared += 1;
        }
    }
    assert!(compared > 60, "{compared} rows");
}
