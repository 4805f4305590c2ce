//! The JSON schema of specs, which editors complete and check them by. It comes from the
//! declarations that also read and check the keys.

use super::{Contestant, Experiment, Labelled};
use crate::contestant::EntryOptions;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Map, Value, json};
use std::borrow::Cow;

impl JsonSchema for Labelled {
    fn schema_name() -> Cow<'static, str> {
        "Labelled".into()
    }

    /// Describes one table per method, with its parameters and the keys that every entry has.
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut tables = Vec::new();
        let options = properties(EntryOptions::json_schema(generator).as_value());
        flatten(Contestant::json_schema(generator).as_value(), &mut tables);
        for table in &mut tables {
            let mut keys = properties(table);
            keys.extend(options.clone());
            table["properties"] = keys.into();
        }
        json!({ "oneOf": tables }).try_into().unwrap_or_default()
    }
}

/// Returns the alternatives that a schema accepts, if it has any.
fn choices(schema: &Value) -> Option<&Vec<Value>> {
    schema.get("oneOf").or(schema.get("anyOf"))?.as_array()
}

/// Collects the tables that a schema accepts, however nested the alternatives are.
fn flatten(schema: &Value, tables: &mut Vec<Value>) {
    match choices(schema) {
        Some(choices) => choices.iter().for_each(|choice| flatten(choice, tables)),
        None => tables.push(schema.clone()),
    }
}

fn properties(schema: &Value) -> Map<String, Value> {
    schema.get("properties").and_then(Value::as_object).cloned().unwrap_or_default()
}

/// Returns the JSON schema of specs.
pub fn schema() -> Value {
    let settings = SchemaSettings::draft07().with(|settings| settings.inline_subschemas = true);
    let mut schema = settings.into_generator().into_root_schema_for::<Experiment>().to_value();
    tidy(&mut schema);
    let mut keys = properties(&schema);
    // The name comes from the file, and the command line selects the quick variant.
    keys.remove("name");
    keys.remove("quick");
    let replaceable: Map<String, Value> = keys
        .keys()
        .map(|key| (key.clone(), json!({ "$ref": format!("#/properties/{key}") })))
        .collect();
    let quick = json!({
        "type": "object",
        "description": "Keys that replace others under `--quick`.",
        "properties": replaceable,
        "additionalProperties": false,
    });
    keys.insert("quick".into(), quick);
    schema["properties"] = keys.into();
    schema
}

/// Turns a schema of Rust types into one of TOML: without `null`, and without the parts of
/// descriptions that are about Rust.
fn tidy(schema: &mut Value) {
    match schema {
        Value::Array(all) => all.iter_mut().for_each(tidy),
        Value::Object(map) => {
            if map.get("default").is_some_and(Value::is_null) {
                map.remove("default");
            }
            if let Some(Value::Array(types)) = map.get_mut("type") {
                // TOML has no null: an optional key is omitted.
                types.retain(|kind| kind != "null");
                if let [one] = &types[..] {
                    let one = one.clone();
                    map.insert("type".into(), one);
                }
            }
            if let Some(Value::Array(any)) = map.get_mut("anyOf") {
                any.retain(|choice| choice.get("type").is_none_or(|kind| kind != "null"));
                if let [Value::Object(one)] = &mut any[..] {
                    let one = std::mem::take(one);
                    map.remove("anyOf");
                    // The description of the key takes precedence over the description of its type.
                    one.into_iter().for_each(|(key, value)| {
                        map.entry(key).or_insert(value);
                    });
                }
            }
            if let Some(Value::String(text)) = map.get_mut("description") {
                *text = described(text);
            }
            map.values_mut().for_each(tidy);
        }
        _ => {}
    }
}

/// Returns a description without links, and without the lines that repeat default and range as Rust
/// expressions.
fn described(text: &str) -> String {
    let lines: Vec<&str> = text
        .lines()
        .filter(|line| !line.is_empty())
        .filter(|line| !line.starts_with("Default `") && !line.starts_with("Accepted: `"))
        .collect();
    let joined = lines.join(" ");
    let mut plain = String::new();
    let mut rest = joined.trim();
    while let Some((before, after)) = rest.split_once('[') {
        let Some((name, after)) = after
            .split_once(']')
            .filter(|(name, after)| name.starts_with('`') || after.starts_with('('))
        else {
            plain += &format!("{before}[");
            rest = after;
            continue;
        };
        plain += &format!("{before}{name}");
        let target = after.strip_prefix('(').and_then(|after| after.split_once(')'));
        rest = target.map_or(after, |(_, after)| after);
    }
    plain + rest
}
