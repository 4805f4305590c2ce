//! Numbers in running prose are those of committed CSV files. A number has a comment behind it with
//! the id of its query in `docs/numbers.toml`, or several numbers have one comment:
//!
//! ```text
//! trees are 8 to 25<!-- =gain.least gain.most --> % cheaper
//! ```
//!
//! Any correct rounding at the digits shown is accepted, and the words are free. A word that judges
//! has the id of a fact of `docs/facts.toml` behind it, `<!-- ?table3 -->`.

use crate::queries::value;
use crate::support::{pages, top};
use regex_lite::Regex;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;

/// Returns the numbers that a text shows with a comment behind them, each with its id.
fn bound_numbers(text: &str) -> Result<Vec<(String, String)>, String> {
    // Code shows comments, and is none.
    let text = Regex::new("`[^`\n]*`").unwrap().replace_all(text, "`");
    let comment = Regex::new(r"<!-- =([^>]*?) -->").unwrap();
    let number = Regex::new(r"−?\d(?:[\d.]*\d)?").unwrap();
    let mut bound = Vec::new();
    let mut end = 0;
    for found in comment.captures_iter(&text) {
        let whole = found.get(0).unwrap();
        let ids: Vec<&str> = found[1].split_whitespace().collect();
        let before: Vec<&str> =
            number.find_iter(&text[end..whole.start()]).map(|number| number.as_str()).collect();
        end = whole.end();
        let Some(first) = before.len().checked_sub(ids.len()) else {
            return Err(format!("{}: fewer numbers before it than ids", whole.as_str()));
        };
        bound.extend(
            ids.iter().zip(&before[first..]).map(|(id, n)| (n.to_string(), id.to_string())),
        );
    }
    Ok(bound)
}

/// Returns whether the shown number is a correct rounding of the value.
fn is_rounded(shown: &str, value: f64) -> bool {
    let decimals = shown.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let number: f64 = shown.replace('−', "-").parse().unwrap();
    let unit = 0.1_f64.powi(decimals as i32);
    (number - value).abs() <= 0.5 * unit * (1.0 + 1e-9)
}

#[test]
fn the_prose_shows_the_committed_numbers() {
    let path = top().join("docs/numbers.toml");
    let queries: BTreeMap<String, String> =
        toml::from_str(&fs::read_to_string(path).unwrap()).unwrap();
    let mut used = BTreeSet::new();
    let mut faults = Vec::new();
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        let bound =
            bound_numbers(&text).unwrap_or_else(|fault| panic!("{}: {fault}", page.display()));
        for (shown, id) in bound {
            let query = queries
                .get(&id)
                .unwrap_or_else(|| panic!("{}: docs/numbers.toml has no {id:?}", page.display()));
            let value = value(query);
            if !is_rounded(&shown, value) {
                faults.push(format!("{}: {shown} is {value} ({id})", page.display()));
            }
            used.insert(id);
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    let unused: Vec<_> = queries.keys().filter(|id| !used.contains(*id)).collect();
    assert!(unused.is_empty(), "docs/numbers.toml: no page shows {unused:?}");
}

/// Whether a claim holds: a query, a sign and a number.
fn holds(claim: &str) -> bool {
    let mut parts = claim.rsplitn(3, ' ');
    let [number, sign, query] = [(); 3].map(|()| parts.next().unwrap());
    let (value, number) = (value(query), number.parse().unwrap());
    match sign {
        "=" => value == number,
        "<" => value < number,
        ">" => value > number,
        _ => panic!("{claim}: {sign:?} is no sign; accepted: =, <, >"),
    }
}

#[test]
fn what_the_prose_judges_is_a_fact() {
    let text = fs::read_to_string(top().join("docs/facts.toml")).unwrap();
    let facts: BTreeMap<String, Vec<String>> = toml::from_str(&text).unwrap();
    let false_claims: Vec<_> = facts.values().flatten().filter(|claim| !holds(claim)).collect();
    assert!(false_claims.is_empty(), "{false_claims:#?}");
    let mut used = BTreeSet::new();
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for found in Regex::new(r"<!-- \?(\w+) -->").unwrap().captures_iter(&text) {
            used.insert(found[1].to_owned());
        }
    }
    assert_eq!(used, facts.into_keys().collect(), "ids of pages, and those of docs/facts.toml");
}

#[test]
fn numbers_are_bound_to_as_many_ids_and_code_is_not() {
    let bound = bound_numbers("As in `8<!-- =a -->`, 9<!-- =b -->.").unwrap();
    assert_eq!(bound, [("9".to_owned(), "b".to_owned())]);
    assert!(bound_numbers("only 1<!-- =a b -->").is_err());
}

#[test]
fn a_correct_rounding_at_the_digits_shown_is_accepted() {
    for (shown, value) in
        [("8", 7.5), ("8", 8.49), ("0.07", 0.0651), ("−1.2", -1.16), ("1.50", 1.5)]
    {
        assert!(is_rounded(shown, value), "{shown} for {value}");
    }
    for (shown, value) in [("8", 7.4), ("0.07", 0.064), ("1.2", -1.2), ("1.50", 1.51)] {
        assert!(!is_rounded(shown, value), "{shown} for {value}");
    }
}
