//! The schema of specs accepts and rejects the same specs as the harness; the spec of `harness new`
//! runs.

mod support;

use serde_json::{Map, Value};
use std::fs;
use std::path::Path;
use support::{experiments, refused, said};

/// Returns the first place where a schema rejects a value. It knows the part of draft 7 that
/// schemas of specs use.
fn fault(root: &Value, schema: &Value, value: &Value, at: &str) -> Option<String> {
    if let Some(path) = schema.get("$ref") {
        let target = root.pointer(&path.as_str().unwrap()[1..]);
        return fault(root, target.unwrap(), value, at);
    }
    let list = |key: &str| schema.get(key).and_then(Value::as_array);
    if let Some(choices) = list("oneOf").or(list("anyOf")) {
        let faults: Vec<_> = choices.iter().map(|choice| fault(root, choice, value, at)).collect();
        let right = faults.iter().filter(|fault| fault.is_none()).count();
        // `oneOf` accepts exactly one alternative, `anyOf` at least one.
        let exact = right == 1 || schema.get("anyOf").is_some() && right > 1;
        return (!exact).then(|| format!("{at}: {right} choices accept it: {faults:?}"));
    }
    let kinds =
        schema.get("type").map(|kind| kind.as_array().cloned().unwrap_or(vec![kind.clone()]));
    let is_of = |kind: &Value| is_of_type(value, kind.as_str().unwrap());
    let is_accepted = kinds.is_none_or(|kinds| kinds.iter().any(is_of))
        && schema.get("const").is_none_or(|one| one == value)
        && list("enum").is_none_or(|all| all.contains(value));
    if !is_accepted {
        return Some(format!("{at}: {value} is not {schema:.80}"));
    }
    let none = Map::new();
    let properties = schema.get("properties").and_then(Value::as_object).unwrap_or(&none);
    let fields = value.as_object().unwrap_or(&none);
    let items = schema.get("items");
    let missing = list("required")
        .into_iter()
        .flatten()
        .find(|key| !fields.contains_key(key.as_str().unwrap()));
    missing.map(|key| format!("{at}: {key} is missing")).or_else(|| {
        let field = |(key, value): (&String, &Value)| match (
            properties.get(key),
            schema.get("additionalProperties"),
        ) {
            (Some(schema), _) => fault(root, schema, value, &format!("{at}.{key}")),
            (None, Some(Value::Bool(false))) => Some(format!("{at}.{key} is no key")),
            (None, Some(schema)) => fault(root, schema, value, &format!("{at}.{key}")),
            (None, None) => None,
        };
        let elements = value.as_array().into_iter().flatten();
        fields.iter().find_map(field).or_else(|| {
            elements.zip(items.into_iter().cycle()).find_map(|(v, s)| fault(root, s, v, at))
        })
    })
}

fn is_of_type(value: &Value, kind: &str) -> bool {
    match kind {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "null" => value.is_null(),
        _ => panic!("{kind}"),
    }
}

fn parsed(spec: &str) -> Value {
    let table: toml::Table = spec.parse().unwrap();
    serde_json::to_value(table).unwrap()
}

#[test]
fn the_schema_accepts_every_committed_spec_and_rejects_a_mistyped_key_anywhere() {
    let schema: Value = serde_json::from_str(&said(Path::new("."), &["schema"])).unwrap();
    for (name, text) in experiments() {
        let spec = parsed(&text);
        assert_eq!(fault(&schema, &schema, &spec, ""), None, "{name}");
        // The spec must be rejected with one more letter in any key that is not a name.
        for key in ["question", "methods", "trials", "kind", "title", "max_work", "quick", "label"]
        {
            let mistyped =
                spec.to_string().replace(&format!("\"{key}\":"), &format!("\"{key}z\":"));
            let mistyped: Value = serde_json::from_str(&mistyped).unwrap();
            let accepted = fault(&schema, &schema, &mistyped, "").is_none();
            assert!(mistyped == spec || !accepted, "{name}: {key}");
        }
    }
    for (wrong, part) in [
        ("repetitions = 'x'", ".repetitions"),
        ("name = 'x'", ".name is no key"),
        ("quick = { quick = true }", ".quick.quick is no key"),
        ("quick = { repetitions = true }", ".quick.repetitions"),
        ("methods = [{ method = 'grep' }]", "grep"),
        ("methods = [{ method = 'grasp', candidates = 'all' }]", "candidates"),
        ("methods = [{ method = 'external' , command = 'sh' }]", "command"),
    ] {
        let found = fault(&schema, &schema, &parsed(wrong), "")
            .unwrap_or_else(|| panic!("{wrong} is accepted"));
        assert!(found.contains(part), "{wrong}: {found}");
    }
}

#[test]
fn a_new_spec_runs_unchanged_and_replaces_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    said(at, &["new", "mine.toml"]);
    assert!(said(at, &["mine.toml", "--quick"]).contains("best"));
    // The full spec takes too long on its own scenes.
    said(at, &["mine.toml", "--scene", "spheres75"]);
    fs::write(at.join("mine.toml"), "mine").unwrap();
    for (file, part) in [("mine.toml", "exists already"), ("mine", "ends with .toml")] {
        refused(at, &["new", file], 2, &[part]);
    }
    assert_eq!(fs::read(at.join("mine.toml")).unwrap(), b"mine");
}
