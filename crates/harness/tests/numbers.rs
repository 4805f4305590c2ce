//! Numbers in running prose are those of committed CSV files. A number has a comment behind it with
//! the id of its query in `docs/numbers.toml`, or several numbers have one comment:
//!
//! ```text
//! trees are 8 to 25<!-- =gain.least gain.most --> % cheaper
//! ```
//!
//! Any correct rounding at the digits shown is accepted, and the words are free. A word that judges
//! has the id of a fact behind it, `<!-- ?table3 -->`, which [`facts`] tests.

mod queries;
mod support;

use harness::report::query::{Row, number_in};
use queries::{rows, value};
use regex_lite::Regex;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use support::{pages, top};

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

/// The number of rows of which all of the columns are below 1, above 1, and neither.
fn sides(rows: &[Row], low: &[&str], high: &[&str]) -> [usize; 3] {
    let one = |row: &Row, columns: &[&str], is_side: fn(&f64) -> bool| {
        columns.iter().all(|column| number_in(row, column).is_some_and(|n| is_side(&n)))
    };
    let below = rows.iter().filter(|row| one(row, high, |n| *n < 1.0)).count();
    let above = rows.iter().filter(|row| one(row, low, |n| *n > 1.0)).count();
    [below, above, rows.len() - below - above]
}

/// The sides of 1 on which our speeds over others' are, as means over the scenes.
fn speeds(processor: &str, conditions: &str) -> [usize; 3] {
    let file = format!("peers/{processor}/timing_ratios.csv");
    let mut rows = rows(&file, &format!("scene=geometric mean, {conditions}"));
    rows.retain(|row| {
        let of_batches = row["mode"].ends_with("batches");
        !row["mode"].ends_with("again") && of_batches == (row["against"] == "any mode")
    });
    sides(&rows, &["ratio", "least_turn"], &["ratio", "greatest_turn"])
}

/// What words on the pages judge, by their ids.
fn facts() -> BTreeMap<&'static str, bool> {
    let costs =
        |file, conditions| sides(&rows(file, conditions), &["low_over_base"], &["high_over_base"]);
    let tests = |scene| {
        let rows = rows("rays/paper.csv", &format!("scene={scene} (stand-in)"));
        sides(&rows, &["ours_low"], &["ours_high"])
    };
    // Open is also what a second measurement of the same layout puts on the other side.
    let is_open = |tree: &str| {
        ["incoherent", "primary", "bounce", "shadow"].map(|rays| {
            let mode = format!("{tree}: wide\\, batches");
            let both = format!(
                "scene=geometric mean, against=any mode, rays={rays}, mode={mode} or {mode}\\, again"
            );
            let both = rows("peers/amd-epyc-25-1/timing_ratios.csv", &both);
            assert_eq!(both.len(), 2, "{tree}, {rays}");
            let sides = sides(&both, &["ratio", "least_turn"], &["ratio", "greatest_turn"]);
            sides[0] < 2 && sides[1] < 2
        })
    };
    let others_win = |processor, conditions, most| {
        let [slower, faster, open] = speeds(processor, conditions);
        faster == 0 && slower > most * open
    };
    let best_lists = rows("figure1/paper.csv", "*");
    let best_lists: Vec<&str> = best_lists.iter().map(|row| row["ours"].as_str()).collect();
    let no_list_helps =
        sides(&rows("figure1/trials.csv", "trials=100"), &["expected_low"], &["expected_high"])[0]
            == 0;
    let on_512 = "processor=AMD EPYC (family 25\\, model 17)\\, AVX-512, against=any mode, \
                  rays=primary or shadow";
    let all =
        |file, conditions, holds: &dyn Fn(&Row) -> bool| rows(file, conditions).iter().all(holds);
    let costs_no_more = |row: &Row| number_in(row, "cost_ratio") <= Some(1.0);
    let noisy = costs("table4/table.csv", "column=best of 100");
    let less_noisy = costs("noise/table.csv", "column=1 %");
    // The rays in batches after which the search for the last tree of the table has paid.
    let per_ray = |mode: &str| {
        let query = format!(
            "peers/amd-epyc-25-1/timing_rays.csv | scene=geometric mean, library=ours, \
             rays=incoherent, mode={mode}: wide\\, batches | only million_per_s"
        );
        1e-6 / value(&query)
    };
    let in_three_mesh = |scenes| {
        let conditions = format!(
            "tracer=three-mesh-bvh, scene={scenes}, rays=primary or incoherent, tree=searched, \
             over=best"
        );
        sides(&rows("interop/timing_tracers.csv", &conditions), &["ratio_low"], &["ratio_high"])
    };
    let searched = r"best for any rays\, 1.2";
    let seconds = value(&format!(
        "peers/amd-epyc-25-1/timing_ratios.csv | scene=geometric mean, against=any mode, \
         mode={searched}: wide\\, batches, rays=incoherent | only build_seconds"
    ));
    let pays_after = seconds / (per_ray("Müller–Fellner") - per_ray(searched));
    BTreeMap::from([
        (
            "interop",
            in_three_mesh("sponza or kitchen or cloister") == [0, 6, 0]
                && in_three_mesh("spot or knot or pebble")[1] == 0,
        ),
        ("pays", (1e8..1e9).contains(&pays_after)),
        ("table3", costs("table3/table.csv", "column!=base") == [0, 16, 0]),
        ("table4", noisy == [1, 4, 3] && less_noisy == [7, 0, 1]),
        ("figure1", best_lists == ["k = 2 or k = 30", "k = 2", "k = 2"] && no_list_helps),
        ("rays", tests("pinecon2") == [0, 1, 0] && tests("escher") == [1, 0, 0]),
        ("stability", all("stability/cells.csv", "*", &|r| r["outcome"].ends_with("as promised"))),
        (
            "leave_out",
            all("leave_out/omissions.csv", "*", &costs_no_more)
                && all("leave_out/omissions_tiny.csv", "*", &costs_no_more),
        ),
        (
            "optimality",
            value("optimality/gaps.csv | method=ruin and recreate | min solved_fraction") == 1.0,
        ),
        (
            "speed",
            is_open("Müller–Fellner") == [false; 4]
                && is_open(r"best\, 6.5 M") == [true, false, false, false]
                && is_open(r"best for any rays\, 1.2") == [false, false, true, false],
        ),
        (
            "peers",
            others_win("amd-epyc-25-1", "against=any mode, rays=bounce", 1)
                && others_win("amd-epyc-25-17", on_512, 4)
                && others_win("amd-epyc-25-1", "against=single calls, rays=primary or bounce", 4)
                && speeds("amd-epyc-25-1", "against=single calls, rays=incoherent")[1] == 0,
        ),
    ])
}

#[test]
fn what_the_prose_judges_is_a_fact() {
    let facts = facts();
    let mut used = BTreeSet::new();
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for found in Regex::new(r"<!-- \?(\w+) -->").unwrap().captures_iter(&text) {
            let fact = facts.get(&found[1]);
            assert_eq!(fact, Some(&true), "{}: {}", page.display(), &found[0]);
            used.insert(found[1].to_owned());
        }
    }
    let all: BTreeSet<_> = facts.keys().map(|id| (*id).to_owned()).collect();
    assert_eq!(used, all, "facts that no page states");
}

#[test]
fn numbers_are_bound_to_the_ids_behind_them() {
    let pairs = |text: &str| {
        let bound = bound_numbers(text).unwrap();
        bound.into_iter().map(|(number, id)| format!("{number} {id}")).collect::<Vec<_>>()
    };
    let text = "In 3 runs 8 to 25<!-- =a.least a.most --> % and −0.5<!-- =b -->, then 7.";
    assert_eq!(pairs(text), ["8 a.least", "25 a.most", "−0.5 b"]);
    assert_eq!(pairs("As in `8<!-- =a -->`, 9<!-- =b -->."), ["9 b"]);
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
