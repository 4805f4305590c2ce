//! Numbers in running prose come from committed CSV files: `docs/numbers.toml` names the sentences
//! and the queries.
//!
//! `UPDATE_DOCS=1 cargo test -p harness --test numbers` writes the values into the pages.

mod queries;
mod support;

use queries::answer;
use std::fs;
use std::ops::Range;
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

/// Returns the length of the beginning of `page` that reads as `fixed`. White space equals any
/// other.
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

/// A text as it is looked for on a page.
struct Pattern<'a> {
    fixed: Vec<&'a str>,
    names: Vec<&'a str>,
    /// True for each name that is for words; all others are for numbers.
    are_words: Vec<bool>,
}

impl<'a> Pattern<'a> {
    fn new(text: &'a str, is_for_words: impl Fn(&str) -> bool) -> Self {
        let (fixed, names) = split(text);
        let are_words = names
            .iter()
            .map(|name| is_for_words(name))
            .collect();
        Self { fixed, names, are_words }
    }

    /// Returns where the values are on the page; nothing if the text is not there.
    fn find(&self, page: &str) -> Option<Vec<Range<usize>>> {
        let mut starts = page.char_indices().map(|(start, _)| start);
        starts.find_map(|start| self.values_at(page, start))
    }

    fn values_at(&self, page: &str, start: usize) -> Option<Vec<Range<usize>>> {
        let mut at = start + length_of_match(&page[start..], self.fixed[0])?;
        let mut found = Vec::new();
        for (part, are_words) in self.fixed[1..].iter().zip(&self.are_words) {
            let length = match are_words {
                true => length_of_words(&page[at..], part)?,
                false => length_of_number(&page[at..])?,
            };
            found.push(at..at + length);
            at += length;
            at += length_of_match(&page[at..], part)?;
        }
        Some(found)
    }
}

fn length_of_number(page: &str) -> Option<usize> {
    let is_of_number = |character: char| character.is_ascii_digit() || ".-−".contains(character);
    let length = page
        .find(|character| !is_of_number(character))
        .unwrap_or(page.len());
    // A full stop behind the number belongs to the sentence.
    let number = page[..length].trim_end_matches('.');
    (!number.is_empty()).then_some(number.len())
}

/// Returns the length of the words in front of the fixed part `behind`. Without one, they go on to
/// the end of their paragraph or of their item in a list, which they never cross.
fn length_of_words(page: &str, behind: &str) -> Option<usize> {
    let ends = ["\n\n", "\n- "].map(|end| page.find(end).unwrap_or(page.len()));
    let longest = ends.into_iter().min()?;
    if behind.is_empty() {
        return Some(longest);
    }
    let mut lengths = page[..longest]
        .char_indices()
        .map(|(length, _)| length);
    lengths.find(|length| length_of_match(&page[*length..], behind).is_some())
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
        let pattern = Pattern::new(&text, |name| query(name).ends_with(" | text"));
        let places = pattern
            .find(&shown)
            .unwrap_or_else(|| panic!("{page} lacks: {text}"));
        let mut made = shown.clone();
        // From the back, because a replacement moves everything behind it.
        for (place, name) in places.into_iter().zip(&pattern.names).rev() {
            let value = answer(query(name));
            if !reads_alike(&shown[place.clone()], &value) {
                made.replace_range(place, &value);
            }
        }
        let unused: Vec<_> = queries
            .keys()
            .filter(|key| !pattern.names.contains(&key.as_str()))
            .collect();
        assert!(unused.is_empty(), "docs/numbers.toml: {text}: nobody needs {unused:?}");
        assert_current(&path, &made, "numbers");
    }
}

#[test]
fn a_text_is_found_across_lines() {
    let page = "Trees are 8 to\n25 % cheaper. So are 7.5.\n\nIn words: Nothing.\n\nIn words: None\nof two. That is all.\n\nEnd.";
    let values = |text: &'static str| {
        let places = Pattern::new(text, |name| name == "answer").find(page)?;
        let texts = places.into_iter().map(|place| &page[place]);
        Some(texts.collect::<Vec<_>>())
    };
    assert_eq!(values("are {low} to {high} % cheaper"), Some(vec!["8", "25"]));
    assert_eq!(values("So are {more}."), Some(vec!["7.5"]));
    assert_eq!(values("In words: {answer} That is"), Some(vec!["None\nof two."]));
    assert_eq!(values("of two. {answer}"), Some(vec!["That is all."]));
    assert_eq!(values("are {low} to {high} % dearer"), None);
    assert_eq!(values("cheaper{none} So"), None);
}
