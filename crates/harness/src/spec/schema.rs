//! The JSON schema of specs, which editors complete and check them by, and the page of all keys.
//!
//! Both come from the declarations that also read and check the keys.

use super::{Contestant, Experiment, Labelled};
use crate::contestant::EntryOptions;
use bvh_config::Keys;
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

/// Returns the page of all keys, in Markdown.
pub fn page() -> String {
    let schema = schema();
    let mut page = "# Keys of specs\n\n\
        Every key that a spec may have, as `harness schema` describes it to editors; generated from\n\
        the declarations that read the keys by `UPDATE_DOCS=1 cargo test -p harness --test schema`.\n\
        [How specs are written and run](EXPERIMENTS.md).\n"
        .to_owned();
    page += &section("## An experiment", &schema, &["methods", "reports", "quick"]);
    let methods = entries(&schema, "methods");
    let options: Map<String, Value> = properties(&methods[0])
        .into_iter()
        .filter(|(key, _)| EntryOptions::KEYS.contains(&key.as_str()))
        .collect();
    let description = "Further keys of an entry, next to `method`, its name.";
    let options = json!({ "properties": options, "description": description });
    page += &section("## Every entry of `methods`", &options, &[]);
    for (tag, tables) in [("method", methods), ("kind", entries(&schema, "reports"))] {
        for table in &tables {
            let name = table["properties"][tag]["const"].as_str().unwrap_or_default();
            let hidden = [EntryOptions::KEYS, &[tag]].concat();
            page += &section(&format!("## `{tag} = \"{name}\"`"), table, &hidden);
        }
    }
    page
}

/// Returns the tables that the list under `key` of an experiment may hold.
fn entries(schema: &Value, key: &str) -> Vec<Value> {
    let tables = schema["properties"][key]["items"]["oneOf"].as_array();
    tables.cloned().unwrap_or_default()
}

fn section(heading: &str, table: &Value, hidden: &[&str]) -> String {
    let description = text(table, "description");
    let mut section = format!("\n{heading}\n\n{description}\n\n");
    let mut rows = Vec::new();
    keys_of(table, "", hidden, &mut rows);
    if !rows.is_empty() {
        section += "| key | value | default | meaning |\n|---|---|---|---|\n";
        section += &rows.concat();
    }
    section
}

fn text<'a>(schema: &'a Value, key: &str) -> &'a str {
    let text = schema.get(key).and_then(Value::as_str);
    text.unwrap_or_default()
}

/// Adds a row for every key of a table, including the keys of nested tables.
fn keys_of(table: &Value, above: &str, hidden: &[&str], rows: &mut Vec<String>) {
    for (key, schema) in properties(table).iter().filter(|(key, _)| !hidden.contains(&key.as_str()))
    {
        // A long default would widen the table, and repeats the rows of its keys.
        let default = schema.get("default").map(Value::to_string).filter(|text| text.len() <= 40);
        let cells = [
            format!("`{above}{key}`"),
            format!("`{}`", value(schema)),
            default.map_or_else(String::new, |text| format!("`{text}`")),
            text(schema, "description").to_owned(),
        ];
        let cells = cells.map(|cell| cell.replace('|', "\\|"));
        rows.push(format!("| {} |\n", cells.join(" | ")));
        // Keys of nested tables, of elements of lists, and of alternatives have separate rows.
        keys_of(schema, &format!("{above}{key}."), &[], rows);
        keys_of(
            schema.get("items").unwrap_or(&Value::Null),
            &format!("{above}{key}[]."),
            &[],
            rows,
        );
        for (name, inner) in choices(schema).into_iter().flatten().flat_map(properties) {
            keys_of(&inner, &format!("{above}{key}.{name}."), &[], rows);
        }
    }
}

/// Describes the values that a schema accepts, in the notation of TOML.
fn value(schema: &Value) -> String {
    if let Some(constant) = schema.get("const") {
        return constant.to_string();
    }
    if let Some(constants) = schema.get("enum").and_then(Value::as_array) {
        let words: Vec<String> = constants.iter().map(Value::to_string).collect();
        return words.join(" or ");
    }
    if let Some(choices) = choices(schema) {
        let words: Vec<String> = choices.iter().map(value).collect();
        return words.join(" or ");
    }
    let values_of_names = schema.get("additionalProperties").filter(|values| values.is_object());
    match schema.get("type").and_then(Value::as_str) {
        Some("array") => format!("[{}, …]", value(schema.get("items").unwrap_or(&Value::Null))),
        Some("object") => match (values_of_names, schema.get("required")) {
            (Some(values), _) => format!("{{ NAME = {}, … }}", value(values)),
            (None, None) => "{ … }".into(),
            (None, Some(_)) => {
                let fields: Vec<String> = properties(schema)
                    .iter()
                    .map(|(key, field)| format!("{key} = {}", value(field)))
                    .collect();
                format!("{{ {} }}", fields.join(", "))
            }
        },
        Some(kind) => kind.into(),
        None => "any".into(),
    }
}
