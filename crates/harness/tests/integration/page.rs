//! The page of all results: the paper's numbers come first, and whatever the page leads to is there.

use crate::support::{TABLE, folder_with, refused, said};
use std::fs;

/// The texts between `before` and `after` in the page.
fn between<'a>(page: &'a str, before: &str, after: &str) -> Vec<&'a str> {
    page.split(before).skip(1).map(|text| text.split(after).next().unwrap()).collect()
}

#[test]
fn the_page_of_all_results_begins_with_the_paper_and_leads_to_files_that_are_there() {
    let folder = folder_with("spec.toml", TABLE);
    let of_lists = "question = 'Is 1 < 2?'\nscenes = ['escher:50']\nmethods = [{ method = 'muller_fellner' }]\n";
    fs::write(folder.path().join("list.toml"), of_lists).unwrap();
    said(folder.path(), &["spec.toml", "list.toml"]);
    said(folder.path(), &["spec.toml", "--quick"]);
    assert!(said(folder.path(), &["report"]).contains("2 experiments"));
    let results = folder.path().join("results");
    let page = fs::read_to_string(results.join("report.html")).unwrap();
    let (first, sections) = page.split_once("<section").unwrap();
    for part in ["best of 5, cost over base", "Do results survive?", "Is 1 &lt; 2?"] {
        assert!(first.contains(part), "{part}: {first}");
    }
    assert_eq!(between(sections, "<details>", "</details>").len(), 3);
    let links = between(&page, " href=\"", "\"");
    for link in links.iter().chain(&between(&page, " src=\"", "\"")) {
        match link.strip_prefix('#') {
            Some(id) => assert!(page.contains(&format!("id=\"{id}\"")), "{link}"),
            None => assert!(results.join(link).is_file(), "{link}"),
        }
    }
    for file in ["spec/table.csv", "spec/table.svg", "spec/paper.csv", "list/runs.csv"] {
        assert!(page.contains(&format!("{file}\"")), "{file}: {links:?}");
    }
    refused(folder.path(), &["report", "--results", "."], 2, &["no finished experiment"]);
}
