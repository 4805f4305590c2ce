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
