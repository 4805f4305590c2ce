//! Every number in the README and in `docs/` that can come from a committed CSV does: the text names file and rows in a
//! comment, and `UPDATE_DOCS=1 cargo test -p harness --test docs` writes the value behind it.
//!
//! ```text
//! <!-- value FILE | COLUMN=TEXT, … | AGGREGATE COLUMN | FORMAT -->0.988<!-- end -->
//! <!-- pivot FILE | COLUMN=TEXT, … | ROWS × COLUMNS | AGGREGATE COLUMN [(COLUMN)] | FORMAT -->
//! (a Markdown table; the column in parentheses is shown behind each value)
//! <!-- end -->
//! ```
//! `[LOW, HIGH]` after the column shows an interval behind each value. With the format `text`, all rows have one text in the
//! column, which is shown as it is, and the column in parentheses likewise. An aggregate is `only` (all rows agree), `min`, `max`, `median` or `count`; a format is a number of decimals, with
//! `below` behind it for percent below one, `above` for percent above one, `percent` for a fraction. Conditions compare
//! whole cells, a comma in which is written `\,`; `COLUMN!=TEXT` excludes, `*` stands for no condition.

mod support;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;
use support::{assert_current, experiments, top};

/// Stands for a comma within a cell while conditions are divided.
const COMMA: &str = "\u{0}";

type Row = BTreeMap<String, String>;

/// The rows of a committed CSV that meet all conditions; at least one.
fn rows(file: &str, conditions: &str) -> Vec<Row> {
    let path = top().join("results").join(file);
    let mut reader = csv::Reader::from_path(&path).unwrap_or_else(|error| panic!("{file}: {error}"));
    let meets = |row: &Row| {
        conditions == "*"
            || conditions.replace("\\, ", COMMA).split(", ").all(|condition| {
                let condition = condition.replace(COMMA, ", ");
                let (column, text, wanted) = match condition.split_once("!=") {
                    Some((column, text)) => (column, text, false),
                    None => {
                        condition.split_once('=').map(|(column, text)| (column, text, true)).expect(conditions)
                    }
                };
                let cell = row.get(column).unwrap_or_else(|| panic!("{file} has no column {column}"));
                (cell == text) == wanted
            })
    };
    let found: Vec<Row> = reader.deserialize().map(Result::unwrap).filter(meets).collect();
    assert!(!found.is_empty(), "{file}: no row with {conditions}");
    found
}

/// One number of the rows' `AGGREGATE COLUMN`; nothing if no row has one.
fn aggregate(rows: &[&Row], what: &str) -> Option<f64> {
    let (how, column) = what.split_once(' ').expect(what);
    if how == "count" {
        return Some(rows.len() as f64);
    }
    let cell = |row: &&Row| row.get(column).unwrap_or_else(|| panic!("no column {column}")).parse().ok();
    let mut values: Vec<f64> = rows.iter().filter_map(cell).collect();
    values.sort_by(f64::total_cmp);
    let (first, last) = (*values.first()?, *values.last()?);
    match how {
        "only" => {
            assert!(first == last, "{column} is from {first} to {last}, not one value");
            Some(first)
        }
        "min" => Some(first),
        "max" => Some(last),
        "median" => Some(0.5 * (values[(values.len() - 1) / 2] + values[values.len() / 2])),
        _ => panic!("{how}: accepted: only, min, max, median, count"),
    }
}

/// Writes a number as a format says.
fn write(value: f64, format: &str) -> String {
    let (digits, unit) = format.split_once(' ').unwrap_or((format, ""));
    let value = match unit {
        "" => value,
        "below" => 100.0 * (1.0 - value),
        "above" => 100.0 * (value - 1.0),
        "percent" => 100.0 * value,
        _ => panic!("{unit}: accepted: below, above, percent"),
    };
    format!("{value:.*}", digits.parse().expect(format))
}

/// The different values of a column, in their order in the file.
fn distinct(rows: &[Row], column: &str) -> Vec<String> {
    let mut found: Vec<String> = Vec::new();
    for row in rows {
        if !found.contains(&row[column]) {
            found.push(row[column].clone());
        }
    }
    found
}

/// What `AGGREGATE COLUMN [LOW, HIGH] (COLUMN)` shows of some rows, in the format; empty if they have nothing.
fn show(rows: &[&Row], what: &str, format: &str) -> String {
    let one = |what: &str| {
        if format == "text" {
            let column = what.strip_prefix("only ").expect("texts are not aggregated");
            let texts: BTreeSet<&String> = rows.iter().map(|row| &row[column]).collect();
            assert!(texts.len() <= 1, "{column} is not one text: {texts:?}");
            return texts.first().filter(|text| !text.is_empty()).map(|text| (*text).clone());
        }
        aggregate(rows, what).map(|value| write(value, format))
    };
    let (what, beside) = match what.split_once(" (") {
        Some((what, beside)) => (what, one(&format!("only {}", beside.trim_end_matches(')')))),
        None => (what, None),
    };
    let (what, ends) = match what.split_once(" [") {
        Some((what, ends)) => (what, ends.trim_end_matches(']').split_once(", ")),
        None => (what, None),
    };
    let mut text = one(what).unwrap_or_default();
    if let Some((low, high)) =
        ends.and_then(|(low, high)| Some((one(&format!("min {low}"))?, one(&format!("max {high}"))?)))
    {
        text += &format!(" [{low}, {high}]");
    }
    match beside {
        Some(beside) => format!("{text} ({beside})"),
        None => text,
    }
}

fn pivot(rows: &[Row], axes: &str, what: &str, format: &str) -> String {
    let (down, across) = axes.split_once(" × ").expect(axes);
    let escape = |text: &str| text.replace('|', "\\|");
    let columns = distinct(rows, across);
    let mut lines =
        vec![format!("| {down} | {} |", columns.iter().map(|c| escape(c)).collect::<Vec<_>>().join(" | "))];
    lines.push(format!("|---|{}", "---|".repeat(columns.len())));
    for name in distinct(rows, down) {
        let cell = |column: &String| {
            let here: Vec<&Row> =
                rows.iter().filter(|row| row[down] == name && row[across] == *column).collect();
            show(&here, what, format)
        };
        let kind = rows.iter().find(|row| row[down] == name).and_then(|row| row.get("scene_kind"));
        let note = match kind {
            Some(kind) if down == "scene" && kind != "file" => format!(" ({kind})"),
            _ => String::new(),
        };
        let cells: Vec<String> = columns.iter().map(cell).collect();
        lines.push(format!("| {}{note} | {} |", escape(&name), cells.join(" | ")));
    }
    lines.join("\n")
}

/// The text with every value and table as the committed results have it.
fn renewed(text: &str) -> String {
    let (mut out, mut rest) = (String::new(), text);
    while let Some(start) = rest.find("<!-- value ").into_iter().chain(rest.find("<!-- pivot ")).min() {
        let open = start + rest[start..].find(" -->").expect("a comment ends") + 4;
        let close = open
            + rest[open..].find("<!-- end -->").unwrap_or_else(|| panic!("no end: {}", &rest[start..open]));
        let directive = &rest[start + 5..open - 4];
        let fields: Vec<&str> = directive[6..].split(" | ").collect();
        out.push_str(&rest[..open]);
        match fields[..] {
            [file, conditions, what, format] => {
                let rows = rows(file, conditions);
                let text = show(&rows.iter().collect::<Vec<_>>(), what, format);
                assert!(!text.is_empty(), "{directive}");
                out.push_str(&text);
            }
            [file, conditions, axes, what, format] => {
                out.push_str(&format!("\n{}\n", pivot(&rows(file, conditions), axes, what, format)));
            }
            _ => panic!("{directive}"),
        }
        rest = &rest[close..];
    }
    out + rest
}

/// The README and every page of `docs/` and `results/`.
fn pages() -> Vec<PathBuf> {
    let mut pages = vec![top().join("README.md"), top().join("results/README.md")];
    pages.extend(fs::read_dir(top().join("docs")).unwrap().map(|entry| entry.unwrap().path()));
    pages.retain(|page| page.extension().is_some_and(|extension| extension == "md"));
    pages.sort();
    pages
}

#[test]
fn the_documentation_shows_the_committed_numbers() {
    for page in pages() {
        assert_current(&page, &renewed(&fs::read_to_string(&page).unwrap()), "docs");
    }
}

#[test]
fn every_link_of_the_documentation_leads_somewhere() {
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        for (link, _) in text.split("](").skip(1).filter_map(|rest| rest.split_once(')')) {
            let target = link.split('#').next().unwrap_or_default();
            if !target.is_empty() && !target.contains("://") {
                assert!(page.parent().unwrap().join(target).exists(), "{}: {link}", page.display());
            }
        }
    }
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
fn every_experiment_is_checked_on_every_commit() {
    let run = fs::read_to_string(top().join(".ci/run")).unwrap();
    let words: BTreeSet<&str> = run.split(|c: char| !c.is_alphanumeric() && c != '_').collect();
    for (name, text) in experiments() {
        // CI does not build other libraries.
        let needs_libraries = text.contains("method = \"obvhs\"");
        assert!(words.contains(name.as_str()) || needs_libraries, ".ci/run does not check {name}");
    }
}

#[test]
fn every_column_of_every_committed_table_is_on_the_page_of_columns() {
    let declared = harness::cli::columns::all();
    let unsaid: Vec<_> =
        declared.iter().filter_map(|file| Some((file.to_string(), file.unsaid()?.to_owned()))).collect();
    assert!(unsaid.is_empty(), "without a meaning: {unsaid:#?}");
    assert_current(&top().join("docs/COLUMNS.md"), &harness::cli::columns::page(), "docs");
    let (mut folders, mut found) = (vec![top().join("results")], 0);
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "csv") {
                let name = path.file_name().unwrap().to_str().unwrap();
                let header = csv::Reader::from_path(&path).unwrap().headers().unwrap().clone();
                let header: Vec<&str> = header.iter().collect();
                let of = declared.iter().filter(|file| file.are_of(name, &header)).count();
                assert_eq!(of, 1, "{}: docs/COLUMNS.md lacks {header:?}", path.display());
                found += 1;
            }
        }
    }
    assert!(found > 100, "{found} tables");
}
