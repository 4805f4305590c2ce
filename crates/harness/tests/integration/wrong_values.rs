//! A wrong value under any key of a spec, or of any flag of the program, is rejected with exit code
//! 2 and its name.
//!
//! The parser lists the keys, and `--help` the flags, so that new ones are tested too.

use crate::support::{experiments, folder_with, wrong_flags};
use bvh_search::Method;
use harness::peers::Peer;
use harness::report::Report;
use harness::spec::{Experiment, Overrides};
use std::collections::BTreeSet;
use std::path::Path;
use toml::{Table, Value};

/// A table of a spec. Its name has the methods and kinds of elements of arrays instead of their
/// indices, so that each method and kind is tested once.
struct Place {
    /// The way to it: keys and indices.
    way: Vec<String>,
    name: String,
    keys: Vec<String>,
}

/// Collects the tables in a value.
fn tables(value: &Value, way: &[String], name: &str, found: &mut Vec<Place>) {
    let mut below = |step: &str, value, name: String| {
        tables(value, &[way, &[step.to_owned()]].concat(), &name, found);
    };
    match value {
        Value::Table(table) => {
            for (key, value) in table {
                below(key, value, format!("{name}.{key}"));
            }
            let keys = table.keys().cloned().collect();
            found.push(Place { way: way.to_vec(), name: name.into(), keys });
        }
        Value::Array(values) => {
            for (index, value) in values.iter().enumerate() {
                let tag = ["kind", "method"].iter().find_map(|tag| value.get(tag)?.as_str());
                below(&index.to_string(), value, format!("{name}[{}]", tag.unwrap_or_default()));
            }
        }
        _ => {}
    }
}

/// Reads a spec with another value under a key of the table at the end of a way. Returns the error,
/// if it is rejected.
fn error_with(spec: &Value, way: &[String], key: &str, value: &Value) -> Option<harness::Error> {
    let mut spec = spec.clone();
    let table = way.iter().fold(&mut spec, |value, step| match value {
        Value::Array(values) => &mut values[step.parse::<usize>().unwrap()],
        table => &mut table[step],
    });
    table.as_table_mut().unwrap().insert(key.into(), value.clone());
    read(&spec).err()
}

fn read(spec: &Value) -> Result<Experiment, harness::Error> {
    let text = toml::to_string(spec).unwrap();
    Experiment::parse(Path::new("folder/some.toml"), &text, &Overrides::default())
}

/// Returns the keys of a table, and those that the parser accepts there: it lists them if it finds
/// an unknown one. Where it does not, the keys are names.
fn keys_of(spec: &Value, place: &Place) -> Vec<String> {
    let message = error_with(spec, &place.way, UNKNOWN, &1.into()).map(|error| error.to_string());
    let accepted = message.iter().filter_map(|message| message.split_once("expected "));
    let accepted = accepted.flat_map(|(_, names)| names.split('`').skip(1).step_by(2));
    place.keys.iter().cloned().chain(accepted.map(str::to_owned)).collect()
}

const UNKNOWN: &str = "unheard_of";

/// Returns the committed experiments with every default spelled out, and one with every method.
fn specs() -> Vec<Value> {
    let mut specs = Vec::new();
    for (_, text) in experiments() {
        let mut spec: Table = text.parse().unwrap();
        spec.remove("quick");
        // The program in `attic/` contains the times of rays and other libraries. A method of ours replaces
        // them.
        spec.remove("tracing");
        for method in spec.get_mut("methods").and_then(Value::as_array_mut).into_iter().flatten() {
            if Peer::NAMES.contains(&method["method"].as_str().unwrap()) {
                let label = method.get("label").unwrap_or(&method["method"]).clone();
                *method = Value::Table(Table::from_iter([
                    ("label".into(), label),
                    ("method".into(), "median_cut".into()),
                ]));
            }
        }
        let experiment: Experiment = Value::Table(spec).try_into().unwrap();
        specs.push(Value::try_from(&experiment).unwrap());
    }
    // A key is tried in the shortest experiment that has it.
    specs.sort_by_key(|spec: &Value| spec.to_string().len());
    let methods: Vec<Table> =
        Method::all().iter().map(|method| Table::try_from(method).unwrap()).collect();
    let question = Value::from("Which keys does every method have?");
    let all =
        [("question", question), ("scenes", vec!["escher"].into()), ("methods", methods.into())];
    let mut all: Table = all.map(|(key, value)| (key.to_owned(), value)).into_iter().collect();
    let text = "
budget = { max_work = 5 }
objective = { sah = { traversal = 1.0, intersection = 2.0 } }
rays = [{ family = 'lines', query = 'any', count = 7 }]
render = { width = 8, height = 8, samples = 2 }
reports = [{ kind = 'generations', source = 's', title = 't', method = 'genetic', baseline = 'grasp', reason = 'r' }]
";
    all.extend(text.parse::<Table>().unwrap());
    specs.push(Value::Table(all));
    specs
}

/// Returns the complaints about wrong values under a key: those that are accepted, and messages that
/// do not name the key and what would be accepted.
fn complaints(spec: &Value, place: &Place, key: &str) -> Vec<String> {
    let [one, below] = [Value::from(-1), Value::from(-0.5)];
    // No key accepts a date, and all numbers are finite counts or measures.
    let wrong = [
        Value::Datetime("1979-05-27".parse().unwrap()),
        Value::from(f64::NAN),
        Value::from(f64::NEG_INFINITY),
        one.clone(),
        below,
        Value::Array(vec![one]),
    ];
    // Right under some keys.
    let doubtful = [
        Value::from(0),
        Value::from(i64::MAX),
        Value::from(1e300),
        Value::from(true),
        Value::from("no such thing"),
        Value::Array(vec![]),
        Value::Array(vec![Value::from("no such thing")]),
        Value::Table(Table::new()),
        Value::Table(Table::from_iter([(UNKNOWN.into(), Value::from(1))])),
    ];
    let mut complaints = Vec::new();
    for (at, value) in wrong.iter().chain(&doubtful).enumerate() {
        let Some(error) = error_with(spec, &place.way, key, value) else {
            if at < wrong.len() {
                complaints.push(format!("{}.{key} = {value} is accepted", place.name));
            }
            continue;
        };
        let message = error.to_string();
        // A label is only wrong because a report names another one. For a table, the key above may
        // be named.
        let is_named = message.contains(key)
            || key == "label" && message.contains("names method")
            || value.is_table() && place.way.iter().any(|above| message.contains(above));
        let words = ["accepted", "expected", "missing", "wanted", " to "];
        let says_what = words.iter().any(|word| message.contains(word));
        let begins = message.starts_with("folder/some.toml: ");
        if !(begins && is_named && says_what && error.exit_code() == 2) {
            complaints.push(format!("{}.{key} = {value}: {message}", place.name));
        }
    }
    complaints
}

#[test]
fn a_wrong_value_under_any_key_of_a_spec_is_rejected_by_name() {
    let mut seen = BTreeSet::new();
    let mut found = Vec::new();
    for spec in specs() {
        assert!(read(&spec).is_ok(), "{:?}", read(&spec));
        let mut places = Vec::new();
        tables(&spec, &[], "", &mut places);
        for place in places {
            for key in keys_of(&spec, &place) {
                if seen.insert(format!("{}.{key}", place.name)) {
                    found.extend(complaints(&spec, &place, &key));
                }
            }
        }
    }
    assert!(found.is_empty(), "\n{}", found.join("\n"));
    assert!(seen.len() > 300, "{} keys", seen.len());
    let methods = Method::NAMES.iter().map(|name| format!(".methods[{name}].label"));
    let kinds = Report::NAMES.iter().map(|name| format!(".reports[{name}].kind"));
    for key in methods.chain(kinds) {
        assert!(seen.contains(&key), "no spec of experiments/ has {key}; add it to one");
    }
}

#[test]
fn a_wrong_value_of_any_flag_is_rejected_by_name() {
    let spec = "question = 'q'\nscenes = ['spheres75']\nmethods = [{ method = 'median_cut' }]\n";
    let folder = folder_with("spec.toml", spec);
    // Every command with its required arguments.
    let flags = wrong_flags(
        folder.path(),
        &[("", &["spec.toml"]), ("jobs", &["spec.toml"]), ("merge", &["folder", "--out=x"])],
    );
    assert!(flags > 14, "{flags} flags");
}
