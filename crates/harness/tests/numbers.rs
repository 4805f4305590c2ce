//! Numbers in running prose come from committed CSV files: `docs/numbers.toml` names the sentences and the queries.
//!
//! `UPDATE_DOCS=1 cargo test -p harness --test numbers` writes the values into the pages.

mod support;

use std::fs;
use std::ops::Range;
use support::query::value;
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

/// The fixed parts of a text, and the names in braces between them.
fn split(text: &str) -> (Vec<&str>, Vec<&str>) {
    let mut fixed = Vec::new();
    let mut names = Vec::new();
    let mut rest = text;
    while let Some((before, after)) = rest.split_once('{') {
        let (name, behind) = after
            .split_once('}')
            .unwrap_or_else(|| panic!("{text}: a brace is not closed"));
        fixed.push(before);
        names.push(name);
        rest = behind;
    }
    fixed.push(rest);
    (fixed, names)
}

/// The length of the beginning of `page` that reads as `fixed`, where any white space is like any other.
fn length_of_match(page: &str, fixed: &str) -> Option<usize> {
    let mut at = 0;
    let mut characters = fixed.chars().peekable();
    while let Some(character) = characters.next() {
        let rest = &page[at..];
        if character.is_whitespace() {
            while characters
                .next_if(|next| next.is_whitespace())
                .is_some()
            {}
            let space = rest.len() - rest.trim_start().len();
            if space == 0 {
                return None;
            }
            at += space;
        } else {
            at += rest
                .strip_prefix(character)
                .map(|_| character.len_utf8())?;
        }
    }
    Some(at)
}

/// Where the numbers between the fixed parts are on the page; nothing if the text is not there.
fn find(page: &str, fixed: &[&str]) -> Option<Vec<Range<usize>>> {
    let starts = page.char_indices().map(|(start, _)| start);
    starts
        .filter_map(|start| numbers_at(page, fixed, start))
        .next()
}

fn numbers_at(page: &str, fixed: &[&str], start: usize) -> Option<Vec<Range<usize>>> {
    let mut at = start + length_of_match(&page[start..], fixed[0])?;
    let mut found = Vec::new();
    for part in &fixed[1..] {
        let is_of_number =
            |character: char| character.is_ascii_digit() || ".-−".contains(character);
        let length = page[at..]
            .find(|character| !is_of_number(character))
            .unwrap_or(page.len() - at);
        // A full stop behind the number belongs to the sentence.
        let number = page[at..at + length].trim_end_matches('.');
        if number.is_empty() {
            return None;
        }
        found.push(at..at + number.len());
        at += number.len();
        at += length_of_match(&page[at..], part)?;
    }
    Some(found)
}

#[test]
fn the_prose_shows_the_committed_numbers() {
    for Prose { page, text, queries } in all_prose() {
        let path = top().join(&page);
        let shown = fs::read_to_string(&path).unwrap();
        let (fixed, names) = split(&text);
        let places = find(&shown, &fixed).unwrap_or_else(|| panic!("{page} does not say: {text}"));
        let mut made = shown.clone();
        for (place, name) in places.into_iter().zip(&names).rev() {
            let query = queries.get(*name).and_then(toml::Value::as_str);
            let query =
                query.unwrap_or_else(|| panic!("docs/numbers.toml: {text}: no query for {name}"));
            made.replace_range(place, &value(query));
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
fn a_text_is_found_across_lines_and_its_numbers_are_told_from_its_full_stops() {
    let page = "Trees are 8 to\n25 % cheaper. So are 7.5.";
    let numbers = |text: &str| {
        let places = find(page, &split(text).0)?;
        Some(
            places
                .into_iter()
                .map(|place| &page[place])
                .collect::<Vec<_>>(),
        )
    };
    assert_eq!(numbers("are {low} to {high} % cheaper"), Some(vec!["8", "25"]));
    assert_eq!(numbers("So are {more}."), Some(vec!["7.5"]));
    assert_eq!(numbers("are {low} to {high} % dearer"), None);
    assert_eq!(numbers("cheaper{none} So"), None);
}
