//! The committed comparisons with the paper: one row for each number, a reason for every
//! difference, and verdicts that follow from the committed rows.

use crate::support::top;
use harness::report::paper::{PaperRow, Verdict};
use harness::rows::read;
use harness::run::finish::remade;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

/// The folders of committed results that compare something with the paper.
fn compared_folders() -> Vec<PathBuf> {
    let folders = fs::read_dir(top().join("results")).unwrap().map(|folder| folder.unwrap().path());
    folders.filter(|folder| folder.join("paper.csv").is_file()).collect()
}

#[test]
fn every_number_that_the_paper_prints_has_one_row_and_every_difference_a_reason() {
    let mut compared: BTreeMap<String, usize> = BTreeMap::new();
    for folder in compared_folders() {
        let mut seen = BTreeSet::new();
        for row in &read::<PaperRow>(&folder.join("paper.csv")).unwrap() {
            let place = format!("{}: {row:?}", folder.display());
            let first = seen.insert(format!("{}, {}, {}", row.source, row.scene, row.quantity));
            assert!(first, "twice: {place}");
            // The base over itself is 1 whatever is built.
            assert_ne!(row.paper_over_base, Some(1.0), "{place}");
            let needs_none = matches!(row.verdict, Verdict::Agrees | Verdict::Inconclusive);
            assert!(!row.rule.is_empty() && (needs_none || !row.reason.is_empty()), "{place}");
            let source = row.source.split(':').next().unwrap();
            *compared.entry(source.to_owned()).or_default() += 1;
        }
    }
    let expected = [
        ("Figure 1", 3),
        ("Figure 2", 2),
        ("Figure 3", 2),
        ("Figure 4", 1),
        ("Section 3.4", 5),
        ("Section 4", 8),
        ("Table 2", 5),
        ("Table 3", 10),
        ("Table 4", 10),
    ];
    let expected = expected.map(|(source, rows)| (source.to_owned(), rows));
    assert_eq!(compared, BTreeMap::from(expected));
}

#[test]
fn the_committed_verdicts_are_those_that_the_rules_give_on_the_committed_rows() {
    for folder in compared_folders() {
        let (_, made) = remade(&folder).unwrap();
        let mut written = made.iter().flat_map(|output| &output.csv);
        let paper = written.find(|(name, _)| name == "paper").map(|(_, bytes)| bytes.clone());
        let committed = fs::read(folder.join("paper.csv")).ok();
        assert!(paper == committed, "{}: renew it with --redraw", folder.display());
    }
    assert!(compared_folders().len() > 9);
}
