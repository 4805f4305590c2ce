//! Numbers in running prose come from committed CSV files: `docs/numbers.toml` names the sentences
//! and the queries.
//!
//! `UPDATE_DOCS=1 cargo test -p harness --test numbers` writes the values into the pages.

mod queries;
mod support;

use queries::answer;
use regex_lite::Regex;
use std::fs;
use support::{assert_current, top};

/// A piece of prose: its text with a name in braces for every number, and a query for every name.
struct Prose {
    page: String,
    text: String,
    queries: toml::Table,
}

fn all_prose() -> Vec<Prose> {
    let path = top().join("docs/numbers.toml");
    let mut table: toml::Table = fs::read_to_string(path).unwrap().parse().unwrap();
    let Some(toml::Value::Array(entries)) = table.remove("prose") else {
        panic!("docs/numbers.toml has no [[prose]]")
    };
    let prose = |entry: toml::Value| {
        let toml::Value::Table(mut queries) = entry else { panic!("{entry} is no table") };
        let mut text_of = |key: &str| match queries.remove(key) {
            Some(toml::Value::String(text)) => text,
            other => panic!("docs/numbers.toml: {key} is {other:?}; expected a string"),
        };
        let page = text_of("page");
        let text = text_of("text");
        Prose { page, text, queries }
    };
    entries.into_iter().map(prose).collect()
}

/// What a name for a number stands for. A full stop behind the number belongs to the sentence.
const NUMBER: &str = r"([\d.−-]*[\d−-])";

/// What a name for words stands for: they never cross the end of a paragraph or of an item of a
/// list.
const WORDS: &str = r"((?:[^\n]|\n[^\n-])+?)";

/// The end of a paragraph or of an item, to which words go on if nothing fixed is behind them.
const END: &str = r"(?:\n\n|\n- |\n?\z)";

/// Returns the expression that finds a text on a page, with a group for each name in braces, and
/// these names.
fn pattern(text: &str, is_for_words: impl Fn(&str) -> bool) -> (Regex, Vec<&str>) {
    let mut parts = text.split('{');
    let mut expression = fixed(parts.next().unwrap_or_default());
    let mut names = Vec::new();
    for part in parts {
        let (name, behind) = part
            .split_once('}')
            .unwrap_or_else(|| panic!("{text}: a brace is not closed"));
        names.push(name);
        if is_for_words(name) {
            expression += WORDS;
            expression += if behind.is_empty() { END } else { "" };
        } else {
            expression += NUMBER;
        }
        expression += &fixed(behind);
    }
    (Regex::new(&expression).unwrap(), names)
}

/// Returns the expression for a fixed part of a text. White space equals any other.
fn fixed(text: &str) -> String {
    let white_space = Regex::new(r"\s+").unwrap();
    white_space
        .replace_all(&regex_lite::escape(text), r"\s+")
        .into_owned()
}

fn reads_alike(shown: &str, made: &str) -> bool {
    shown
        .split_whitespace()
        .eq(made.split_whitespace())
}

#[test]
fn the_prose_shows_the_committed_numbers() {
    for Prose { page, text, queries } in all_prose() {
        let path = top().join(&page);
        let shown = fs::read_to_string(&path).unwrap();
        let query = |name: &str| {
            queries
                .get(name)
                .and_then(toml::Value::as_str)
                .unwrap_or_else(|| panic!("docs/numbers.toml: {text}: no query for {name}"))
        };
        let (pattern, names) = pattern(&text, |name| query(name).ends_with(" | text"));
        let found = pattern
            .captures(&shown)
            .unwrap_or_else(|| panic!("{page} lacks: {text}"));
        let mut made = shown.clone();
        // From the back, because a replacement moves everything behind it.
        for (index, name) in names.iter().enumerate().rev() {
            let place = found.get(index + 1).unwrap();
            let value = answer(query(name));
            if !reads_alike(place.as_str(), &value) {
                made.replace_range(place.range(), &value);
            }
        }
        let unused: Vec<_> = queries
            .keys()
            .filter(|key| !names.contains(&key.as_str()))
            .collect();
        assert!(unused.is_empty(), "docs/numbers.toml: {text}: nobody needs {unused:?}");
        assert_current(&path, &made, "numbers");
    }
}

#[test]
fn a_text_is_found_across_lines() {
    let page = "Trees are 8 to\n25 % cheaper. So are 7.5.\n\nIn words: Nothing.\n\nIn words: None\nof two. That is all.\n\nEnd.";
    let values = |text: &'static str| {
        let (pattern, _) = pattern(text, |name| name == "answer");
        let found = pattern.captures(page)?;
        let places = found.iter().skip(1).flatten();
        Some(
            places
                .map(|place| place.as_str())
                .collect::<Vec<_>>(),
        )
    };
    assert_eq!(values("are {low} to {high} % cheaper"), Some(vec!["8", "25"]));
    assert_eq!(values("So are {more}."), Some(vec!["7.5"]));
    assert_eq!(values("In words: {answer} That is"), Some(vec!["None\nof two."]));
    assert_eq!(values("of two. {answer}"), Some(vec!["That is all."]));
    assert_eq!(values("are {low} to {high} % dearer"), None);
    assert_eq!(values("cheaper{none} So"), None);
}
