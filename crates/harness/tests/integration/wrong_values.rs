//! A wrong value under any key of a spec, or of any flag of the program, is rejected with exit code
//! 2 and its name.
//!
//! The parser lists the keys, and `--help` the flags, so that new ones are tested too.

use crate::support::{experiments, folder_with, wrong_flags};
use bvh_search::Method;
use harness::peers::Peer;
use harness::report::Report;
use harness::spec::{Experiment, Overrides};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::Path;
use toml::{Table, Value};

/// The way from a spec to a value in it: keys and indices.
type Steps = Vec<String>;

fn follow<'a>(value: &'a mut Value, step: &str) -> &'a mut Value {
    match value {
        Value::Array(values) => &mut values[step.parse::<usize>().unwrap()],
        table => &mut table[step],
    }
}

/// A table of a spec: the way to it, its place and its keys. Places name elements of arrays by their
/// method or kind instead of their index, so that each method and kind is tested once.
struct Place {
    path: Steps,
    name: String,
    keys: Vec<String>,
}

/// Collects all tables in a value.
fn tables(value: &Value, path: &[String], name: &str, found: &mut Vec<Place>) {
    match value {
        Value::Table(table) => {
            let keys = table.keys().cloned().collect();
            found.push(Place { path: path.to_vec(), name: name.into(), keys });
            for (key, value) in table {
                tables(
                    value,
                    &[path, std::slice::from_ref(key)].concat(),
                    &format!("{name}.{key}"),
                    found,
                );
            }
        }
        Value::Array(values) => {
            for (index, value) in values.iter().enumerate() {
                let tag = ["kind", "method"].iter().find_map(|tag| value.get(tag)?.as_str());
                let name = format!("{name}[{}]", tag.unwrap_or_default());
                tables(value, &[path, &[index.to_string()]].concat(), &name, found);
            }
        }
        _ => {}
    }
}

/// Returns a spec with the value under a key of the table at `path`.
fn with(spec: &Value, path: &[String], key: &str, value: Value) -> Value {
    let mut spec = spec.clone();
    path.iter()
        .fold(&mut spec, |value, step| follow(value, step))
        .as_table_mut()
        .unwrap()
        .insert(key.into(), value);
    spec
}

/// Parses a spec. An error is an exit code and a message.
fn read(spec: &Value) -> Result<Experiment, (u8, String)> {
    let text = toml::to_string(spec).unwrap();
    Experiment::parse(Path::new("folder/some.toml"), &text, &Overrides::default())
        .map_err(|error| (error.exit_code(), error.to_string()))
}

/// Returns the names that a message lists as accepted.
fn accepted(message: &str) -> Vec<String> {
    let Some((_, names)) = message.split_once("expected ") else { return Vec::new() };
    names.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

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

#[test]
fn a_wrong_value_under_any_key_of_a_spec_is_rejected_by_name() {
    // No key accepts a date, so a date is wrong under any key.
    let wrong = Value::Datetime("1979-05-27".parse().unwrap());
    let [nan, infinite] = [f64::NAN, f64::NEG_INFINITY].map(Value::from);
    let doubtful = [
        Value::from(-1),
        Value::from(0),
        Value::from(i64::MAX),
        Value::from(-0.5),
        Value::from(1e300),
        Value::from(true),
        Value::from("no such thing"),
        Value::Array(vec![]),
        Value::Array(vec![Value::from(-1)]),
        Value::Array(vec![Value::from("no such thing")]),
        Value::Table(Table::new()),
        Value::Table(Table::from_iter([("unheard_of".into(), Value::from(1))])),
    ];
    let mut seen = BTreeSet::new();
    let mut listed = BTreeSet::new();
    let found = RefCell::new(BTreeSet::new());
    let complain = |message: String| found.borrow_mut().insert(message);
    for spec in specs() {
        assert!(read(&spec).is_ok(), "{:?}", read(&spec));
        let mut places = Vec::new();
        tables(&spec, &[], "", &mut places);
        for Place { path, name: place, keys: own } in places {
            if listed.contains(&place) {
                continue;
            }
            // An unknown key makes the parser list the keys that it accepts. Where it does not, the
            // keys are names, and other specs may have others.
            let unknown = read(&with(&spec, &path, "unheard_of", 1.into()));
            let keys = unknown.map_or_else(|(_, message)| accepted(&message), |_| Vec::new());
            if !keys.is_empty() {
                listed.insert(place.clone());
            }
            for key in own.into_iter().chain(keys) {
                if key == "unheard_of" || !seen.insert(format!("{place}.{key}")) {
                    continue;
                }
                let try_value = |value: &Value| match read(&with(&spec, &path, &key, value.clone()))
                {
                    Ok(_) => true,
                    Err((code, message)) => {
                        // The message names the key or one within it. A label is only wrong because
                        // a report names another one. For a table, the key above may be named.
                        let other = key == "label" && message.contains("names method");
                        let keys_above = path.iter().filter(|step| step.parse::<usize>().is_err());
                        let above = value.is_table()
                            && keys_above.into_iter().any(|above| message.contains(above));
                        let named = message.starts_with("folder/some.toml: ")
                            && (message.contains(&key) || above || other)
                            && ["accepted", "expected", "missing", "wanted", " to "]
                                .iter()
                                .any(|word| message.contains(word))
                            && code == 2;
                        if !named {
                            complain(format!("{place}.{key} = {value}: code {code}, {message}"));
                        }
                        false
                    }
                };
                for value in [&wrong, &nan, &infinite] {
                    if try_value(value) {
                        complain(format!("{place}.{key} = {value} is accepted"));
                    }
                }
                // These values are right under some keys; under the others the message must name
                // them.
                let taken: Vec<bool> = doubtful.iter().map(try_value).collect();
                // All numbers are counts or measures, except percentages above or below a value.
                if (taken[0] || taken[3] || taken[8]) && key != "percent" {
                    complain(format!("{place}.{key}: -1, -0.5 or [-1] is accepted"));
                }
            }
        }
    }
    eprintln!("{} keys", seen.len());
    for method in Method::NAMES {
        let is_seen = seen.contains(&format!(".methods[{method}].label"));
        assert!(is_seen, "{method} is in no spec of experiments/; add it to one");
    }
    for kind in Report::NAMES {
        if !seen.contains(&format!(".reports[{kind}].kind")) {
            complain(format!("{kind} is in no spec of experiments/; add a report of this kind"));
        }
    }
    let found = found.take();
    assert!(found.is_empty(), "\n{}", found.into_iter().collect::<Vec<_>>().join("\n"));
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
