//! Every number in the README and in `docs/` that can come from a committed CSV does. Tables have
//! their query in a comment; the module `numbers` is for running prose. `UPDATE_DOCS=1 cargo test -p harness --test docs` writes the tables.
//!
//! ```text
//! <!-- pivot QUERY -->
//! (a Markdown table)
//! <!-- end -->
//! ```
//! The queries are described in `queries/mod.rs`. Here is also what holds of all pages: widths,
//! links, and the length of the README.

mod columns;
mod numbers;
mod queries;
mod support;

use bvh_core::export::Target;
use harness::report::Report;
use queries::table;
use regex_lite::{Captures, Regex};
use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use support::{assert_current, experiments, pages, top};

/// The beginning of a table's comment.
const OPENING: &str = "<!-- pivot ";

/// Returns the text with every table as the committed results have it.
fn renewed(text: &str) -> String {
    let tables = Regex::new(r"(?s)(<!-- pivot (.*?) -->).*?<!-- end -->").unwrap();
    let ends = tables.find_iter(text).count();
    assert_eq!(ends, text.matches(OPENING).count(), "every table has an end");
    let renew = |found: &Captures| {
        // A long query goes on in the next line.
        let query: Vec<&str> = found[2].split_whitespace().collect();
        format!("{}{}<!-- end -->", &found[1], table(&query.join(" ")))
    };
    tables.replace_all(text, renew).into_owned()
}

#[test]
fn the_documentation_shows_the_committed_numbers() {
    for page in pages() {
        assert_current(&page, &renewed(&fs::read_to_string(&page).unwrap()), "docs");
    }
}

/// The greatest width of a line of prose, in characters.
const WIDTH: usize = 100;

#[test]
fn the_prose_of_the_documentation_is_wrapped() {
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        let mut is_example = false;
        for (number, line) in text.lines().enumerate() {
            // Commands and drawings in blocks cannot be wrapped.
            is_example ^= line.starts_with("```");
            let is_free = is_example || ["|", "!["].iter().any(|start| line.starts_with(start));
            let width = line.chars().count();
            let place = format!("{}:{}", page.display(), number + 1);
            assert!(is_free || width <= WIDTH, "{place}: {width} characters; accepted: {WIDTH}");
        }
    }
}

/// The anchors of the headings of a page.
fn anchors(page: &Path) -> BTreeSet<String> {
    let kept = |c: char| match c {
        ' ' => Some('-'),
        _ => (c.is_alphanumeric() || c == '-' || c == '_').then_some(c),
    };
    let text = fs::read_to_string(page).unwrap_or_default();
    let headings = text.lines().filter(|line| line.starts_with('#'));
    let titles = headings.map(|line| line.trim_start_matches('#').trim().to_lowercase());
    titles.map(|title| title.chars().filter_map(kept).collect()).collect()
}

#[test]
fn every_link_of_the_documentation_leads_somewhere() {
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for (link, _) in text.split("](").skip(1).filter_map(|rest| rest.split_once(')')) {
            if link.contains("://") {
                continue;
            }
            let (target, anchor) = link.split_once('#').unwrap_or((link, ""));
            let path = match target {
                "" => page.clone(),
                _ => page.parent().unwrap().join(target),
            };
            assert!(path.exists(), "{}: {link}", page.display());
            assert!(
                anchor.is_empty() || anchors(&path).contains(anchor),
                "{}: {link}: no such heading",
                page.display()
            );
        }
    }
}

/// Puts something else in the place of what is no prose: code, generated tables, and the targets of
/// links.
fn without_code(text: &str) -> String {
    let parts = [
        (r"(?s)```.*?```", "\n\n"),
        (r"(?s)<!-- pivot .*?<!-- end -->", "\n\n"),
        (r"`[^`]*`", "code"),
        (r"\]\([^)]*\)", "]"),
    ];
    parts.iter().fold(text.into(), |text, (part, other)| {
        Regex::new(part).unwrap().replace_all(&text, *other).into_owned()
    })
}

/// The numbers before %, × or s that no comment of `numbers.toml` follows.
fn unbound(text: &str) -> Vec<String> {
    let number = Regex::new(r"([\d.]*\d)(<!-- =[^>]*-->)? ?(%|×|s\b)(\s*<!-- =)?").unwrap();
    let text = without_code(text);
    let all = number.captures_iter(&text);
    all.filter(|found| found.get(2).or(found.get(4)).is_none())
        .map(|found| format!("{} {}", &found[1], &found[3]))
        .collect()
}

#[test]
fn what_readers_begin_with_is_short_and_its_numbers_are_bound() {
    for name in ["README.md", "docs/use/CHOOSING.md", "docs/use/COOKBOOK.md"] {
        let text = fs::read_to_string(top().join(name)).unwrap();
        assert_eq!(unbound(&text), [""; 0], "{name}: numbers without an id of docs/numbers.toml");
    }
    let readme = fs::read_to_string(top().join("README.md")).unwrap();
    let lines = readme.lines().count();
    // Nobody reads the comments.
    let words = Regex::new("(?s)<!--.*?-->").unwrap().replace_all(&readme, "");
    let words = words.split_whitespace().count();
    assert!(lines <= 100 && words <= 900, "{lines} lines, {words} words; accepted: 100, 900");
    let text = "8 to 25<!-- =a b --> %, 3 s, `4 %`, 1.5×, 6 %<!-- =c -->, 7 scenes";
    assert_eq!(unbound(text), ["3 s", "1.5 ×"]);
}

#[test]
fn the_index_of_results_has_every_experiment_with_its_question() {
    let index = fs::read_to_string(top().join("results/README.md")).unwrap();
    for (name, text) in experiments() {
        let spec: toml::Table = toml::from_str(&text).unwrap();
        let question = spec["question"].as_str().unwrap();
        let line = format!("| [{name}]({name}) | {question} |");
        assert!(index.contains(&line), "results/README.md lacks: {line}");
    }
}

#[test]
fn the_page_of_tracers_has_every_target_and_whether_its_trees_divide_triangles() {
    let page = fs::read_to_string(top().join("docs/use/INTEROP.md")).unwrap();
    let rows = page.lines().skip_while(|line| !line.starts_with("| `--for` |")).skip(2);
    let rows = rows.map_while(|line| {
        let columns: Vec<&str> = line.split('|').map(str::trim).collect();
        Some((*columns.get(1)?, *columns.get(3)? == "yes"))
    });
    let targets = Target::ALL.map(|target| (target.name, target.references > 1.0));
    assert_eq!(rows.collect::<Vec<_>>(), targets);
}

#[test]
fn the_page_of_experiments_lists_every_kind_of_report() {
    let page = fs::read_to_string(top().join("docs/evidence/EXPERIMENTS.md")).unwrap();
    let rows = page.lines().skip_while(|line| !line.starts_with("| `kind` |")).skip(2);
    let rows = rows.map_while(|line| line.split('|').nth(1)).map(|name| name.trim());
    let kinds = Report::NAMES.iter().map(|name| format!("`{name}`"));
    assert_eq!(rows.collect::<Vec<_>>(), kinds.collect::<Vec<_>>());
}

/// Collects the CSV files in a folder and its subfolders.
fn tables(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            tables(&path, found);
        } else if path.extension() == Some(OsStr::new("csv")) {
            found.push(path);
        }
    }
}

#[test]
fn a_file_name_means_the_same_columns_in_every_experiment_and_a_page_describes_them() {
    let mut paths = Vec::new();
    tables(&top().join("results"), &mut paths);
    assert!(paths.len() > 100, "{} tables", paths.len());
    let mut headers = BTreeMap::new();
    for path in paths {
        let header = csv::Reader::from_path(&path).unwrap().headers().unwrap().clone();
        let header: Vec<String> = header.iter().map(String::from).collect();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let known = headers.entry(name).or_insert_with(|| header.clone());
        assert_eq!(*known, header, "{}", path.display());
    }
    assert_current(&top().join("docs/evidence/COLUMNS.md"), &columns::page(&headers), "docs");
}
