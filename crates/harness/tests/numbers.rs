//! Numbers in running prose come from committed CSV files: `docs/numbers.toml` names the sentences
//! and the queries.
//!
//! `UPDATE_DOCS=1 cargo test -p harness --test numbers` writes the values into the pages.

mod claims;
mod queries;
mod support;

use harness::report::query;
use queries::answer;
use regex_lite::Regex;
use std::collections::BTreeMap;
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
        let (name, behind) =
            part.split_once('}').unwrap_or_else(|| panic!("{text}: a brace is not closed"));
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
    white_space.replace_all(&regex_lite::escape(text), r"\s+").into_owned()
}

fn reads_alike(shown: &str, made: &str) -> bool {
    shown.split_whitespace().eq(made.split_whitespace())
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
        let found = pattern.captures(&shown).unwrap_or_else(|| panic!("{page} lacks: {text}"));
        let mut made = shown.clone();
        // From the back, because a replacement moves everything behind it.
        for (index, name) in names.iter().enumerate().rev() {
            let place = found.get(index + 1).unwrap();
            let value = answer(query(name));
            if !reads_alike(place.as_str(), &value) {
                made.replace_range(place.range(), &value);
            }
        }
        let unused: Vec<_> = queries.keys().filter(|key| !names.contains(&key.as_str())).collect();
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
        Some(places.map(|place| place.as_str()).collect::<Vec<_>>())
    };
    assert_eq!(values("are {low} to {high} % cheaper"), Some(vec!["8", "25"]));
    assert_eq!(values("So are {more}."), Some(vec!["7.5"]));
    assert_eq!(values("In words: {answer} That is"), Some(vec!["None\nof two."]));
    assert_eq!(values("of two. {answer}"), Some(vec!["That is all."]));
    assert_eq!(values("are {low} to {high} % dearer"), None);
    assert_eq!(values("cheaper{none} So"), None);
}

/// Our trees whose comparisons with the fastest rival have the verdict, by the extremes of all
/// turns: greedy first, in the order of the file.
fn trees_by_verdict(file: &str, instructions: &str, against: &str, rays: &str) -> [Vec<String>; 3] {
    let rows = query::read(&top().join("results/peers").join(file)).unwrap();
    let calls = if against == "single calls" { ": wide" } else { ": wide, batches" };
    let mut by_verdict = [Vec::new(), Vec::new(), Vec::new()];
    for row in rows {
        let is_asked = row["scene"] == "geometric mean"
            && row["processor"].ends_with(&format!(", {instructions}"))
            && row["against"] == against
            && row["rays"] == rays;
        let Some(tree) = row["mode"].strip_suffix(calls).filter(|_| is_asked) else {
            continue;
        };
        let least: f64 = row["least_turn"].parse().unwrap();
        let greatest: f64 = row["greatest_turn"].parse().unwrap();
        let verdict = if greatest < 1.0 { 0 } else { 1 + usize::from(least > 1.0) };
        by_verdict[verdict].push(tree.to_owned());
    }
    assert_eq!(by_verdict.iter().map(Vec::len).sum::<usize>(), 12, "{file}, {against}, {rays}");
    by_verdict
}

const CAMERA: &str = "best for the camera, 1.2";
const ANY_RAYS: &str = "best for any rays, 1.2";
const GREEDY: [&str; 2] = ["Müller–Fellner", "agglomerative"];

/// Asserts that the README has a sentence, line breaks aside.
fn readme_says(sentence: &str) {
    page_says("README.md", sentence);
}

fn page_says(page: &str, sentence: &str) {
    let text = fs::read_to_string(top().join(page)).unwrap();
    let words: Vec<&str> = text.split_whitespace().collect();
    assert!(words.join(" ").contains(sentence), "{page}: {sentence}");
}

#[test]
fn the_readme_says_which_rays_embree_traces_faster_with_avx_512() {
    let file = "amd-epyc-25-17/timing_ratios.csv";
    let of = |rays: &str| trees_by_verdict(file, "AVX-512", "any mode", rays);
    readme_says(
        "Embree's packets trace primary and shadow rays faster than our batches in the mean over \
         four scenes in nearly all of our trees. In the tree for the camera both comparisons are \
         inconclusive, and so are shadow rays in `best, 2 M` and in one of two measurements of \
         `best, 6.5 M`.",
    );
    let [slower, inconclusive, _] = of("primary");
    assert_eq!(inconclusive, [CAMERA]);
    assert_eq!(slower.len(), 11);
    let [slower, inconclusive, _] = of("shadow");
    assert_eq!(inconclusive, ["best, 2 M", CAMERA]);
    assert_eq!(slower.len(), 10);
    let again = claims::rows(
        &format!("peers/{file}"),
        "scene=geometric mean, against=any mode, rays=shadow, mode=best\\, 6.5 M: wide\\, \
         batches\\, again, processor=AMD EPYC (family 25\\, model 17)\\, AVX-512",
    );
    assert_eq!(again.len(), 1);
    assert!(query::number_in(&again[0], "greatest_turn").unwrap() > 1.0);
}

#[test]
fn the_readme_says_in_which_trees_bounce_rays_are_slower() {
    readme_says(
        "On our greedy trees and clusterings they are slower than Embree's in the mean. On the \
         processor without AVX-512 (older kernels) they are slower in the mean on all our trees but \
         the one for the camera, where the comparison is inconclusive, and incoherent rays are \
         slower on greedy trees and clusterings.",
    );
    let with = "amd-epyc-25-17/timing_ratios.csv";
    let without = "amd-epyc-25-1/timing_ratios.csv";
    assert_eq!(trees_by_verdict(with, "AVX-512", "any mode", "bounce")[0], GREEDY);
    let [slower, inconclusive, _] = trees_by_verdict(without, "AVX2", "any mode", "bounce");
    assert_eq!(inconclusive, [CAMERA]);
    assert_eq!(slower.len(), 11);
    assert_eq!(trees_by_verdict(without, "AVX2", "any mode", "incoherent")[0], GREEDY);
}

#[test]
fn the_readme_says_where_single_calls_are_slower() {
    readme_says(
        "One call per ray, other libraries are as fast or faster with most of our trees, and on \
         the processor without AVX-512 faster in the mean with all of them, except that shadow \
         rays in the trees for the camera and for any rays are inconclusive.",
    );
    for rays in ["incoherent", "primary", "bounce", "shadow"] {
        let file = "amd-epyc-25-17/timing_ratios.csv";
        let [.., faster] = trees_by_verdict(file, "AVX-512", "single calls", rays);
        assert!(faster.len() <= 2, "{rays}: {faster:?}");
        let file = "amd-epyc-25-1/timing_ratios.csv";
        let [_, inconclusive, faster] = trees_by_verdict(file, "AVX2", "single calls", rays);
        let expected: &[&str] = if rays == "shadow" { &[ANY_RAYS, CAMERA] } else { &[] };
        assert_eq!(inconclusive, expected, "{rays}");
        assert!(faster.is_empty(), "{rays}: {faster:?}");
    }
}

#[test]
fn the_benchmarks_say_what_a_second_thread_is_worth() {
    let path = top().join("results/threads/timing_threads.csv");
    // The costs of all seeds by row of the table and run.
    let mut costs: BTreeMap<(String, String), Vec<f64>> = BTreeMap::new();
    for row in query::read(&path).unwrap() {
        let limit = format!("{} {}", row["scene"], row["limit_seconds"]);
        let cost = row["cost_over_base"].parse().unwrap();
        costs.entry((row["run"].clone(), limit)).or_default().push(cost);
    }
    let median = |costs: &[f64]| {
        let mut sorted = costs.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    };
    // The numbers of rows and of pairs in which two threads end below another run, and of all.
    let compared = |other: &str| {
        let mut counts = [0; 4];
        for ((run, limit), two) in &costs {
            if run == "2 threads" {
                let other = &costs[&(other.to_owned(), limit.clone())];
                counts[0] += usize::from(median(two) < median(other));
                counts[1] += 1;
                counts[2] += two.iter().zip(other).filter(|(two, other)| two < other).count();
                counts[3] += two.len();
            }
        }
        counts
    };
    let [rows_one, rows, pairs_one, pairs] = compared("1 thread");
    let [rows_longer, _, pairs_longer, _] = compared("1 thread, 1.8 times the time");
    page_says(
        "docs/BENCHMARKS.md",
        &format!(
            "The median of two threads is below the median of one thread in {rows_one} of {rows} \
             rows, and below the median of one thread with 1.8 times the time in {rows_longer}. Of \
             {pairs} pairs of one seed, two threads end below one in {pairs_one}, and below 1.8 \
             times the time in {pairs_longer}."
        ),
    );
}
