//! The page of all results: what each experiment answers comes first, and whatever the page leads
//! to is there.

use crate::support::{TABLE, folder_with, refused, said};
use std::fs;
use std::path::Path;

/// The texts between `before` and `after` in the page.
fn between<'a>(page: &'a str, before: &str, after: &str) -> Vec<&'a str> {
    page.split(before).skip(1).map(|rest| rest.split(after).next().unwrap()).collect()
}

#[test]
fn the_page_of_all_results_answers_first_and_leads_to_files_that_are_there_but_needs_none() {
    let folder = folder_with("spec.toml", TABLE);
    let of_lists = "question = 'What is listed?'\nscenes = ['escher:50']\nmethods = [{ method = 'muller_fellner' }]\n";
    fs::write(folder.path().join("list.toml"), of_lists).unwrap();
    said(folder.path(), &["spec.toml", "list.toml"]);
    said(folder.path(), &["spec.toml", "--quick"]);
    fs::create_dir(folder.path().join("a folder")).unwrap();
    for out in ["results/report.html", "a folder/page.html"] {
        let said = said(folder.path(), &["report", "--out", out]);
        assert!(said.contains("2 experiments"), "{said}");
        let page = fs::read_to_string(folder.path().join(out)).unwrap();
        let (answers, sections) = page.split_once("<section").unwrap();
        let answers = between(answers, "<li id=\"answer-", "</li>");
        let [spec, list] = answers[..] else { panic!("{answers:?}") };
        for part in ["Do results survive?", "<svg", "<strong class=\"", "best of 5 costs "] {
            assert!(spec.contains(part), "{part}: {spec}");
        }
        for part in ["What is listed?", "no figure", "No verdict is stated."] {
            assert!(list.contains(part), "{part}: {list}");
        }
        assert_eq!(sections.matches("<figure>").count(), 1);
        let tables = between(sections, "<table>", "</table>");
        assert_eq!(tables.len(), 3);
        for table in tables {
            for part in ["<caption>", "<th scope=\"col\">scene", "<th scope=\"row\">escher"] {
                assert!(table.contains(part), "{part}: {table}");
            }
        }
        let at = folder.path().join(out);
        let links = between(&page, "<a href=\"", "\"");
        for link in &links {
            match link.strip_prefix('#') {
                Some(id) => assert!(page.contains(&format!("id=\"{id}\"")), "{link}"),
                None => assert!(at.parent().unwrap().join(link).is_file(), "{link}"),
            }
        }
        for file in [
            "spec.toml",
            "spec/resolved.toml",
            "spec/table.csv",
            "spec/table.svg",
            "spec/paper.csv",
        ] {
            assert!(links.iter().any(|link| link.ends_with(file)), "{file}: {links:?}");
        }
        for other in ["<script", "<img", "<link", "src=", "url(http"] {
            assert!(!page.contains(other), "{other}");
        }
    }
    refused(folder.path(), &["report", "--results", "."], 2, &["no finished experiment"]);
}

#[test]
fn every_committed_experiment_answers_in_words() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("page.html");
    said(&top, &["report", "--out", out.to_str().unwrap()]);
    let page = fs::read_to_string(out).unwrap();
    let answers = between(&page, "<li id=\"answer-", "</li>");
    assert!(answers.len() > 30, "{}", answers.len());
    for answer in answers {
        assert!(!answer.contains("No verdict is stated."), "{answer}");
        // Checksums distinguish rows, and tell a reader nothing.
        let text = answer.rsplit("</svg>").next().unwrap();
        let is_checksum = |word: &&str| {
            word.len() >= 8
                && word.bytes().all(|byte| byte.is_ascii_hexdigit())
                && word.bytes().any(|byte| byte.is_ascii_lowercase())
        };
        let checksum = text.split(|c: char| !c.is_ascii_alphanumeric()).find(is_checksum);
        assert_eq!(checksum, None, "{answer}");
    }
}
