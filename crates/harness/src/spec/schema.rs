//! The JSON schema of specs, by which editors complete and check them, and the page of all keys. Both are made from the
//! declarations that read and check the keys.

use super::{Contestant, Experiment, Labelled};
use crate::contestant::Own;
use bvh_config::Keys;
use schemars::generate::SchemaSettings;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use serde_json::{Map, Value, json};
use std::borrow::Cow;

impl JsonSchema for Labelled {
    fn schema_name() -> Cow<'static, str> {
        "Labelled".into()
    }

    /// One table per method, with its parameters and the keys that every entry has.
    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        let mut tables = Vec::new();
        let own = properties(Own::json_schema(generator).as_value());
        flatten(Contestant::json_schema(generator).as_value(), &mut tables);
        for table in &mut tables {
            let mut all = properties(table);
            all.extend(own.clone());
            table["properties"] = all.into();
        }
        json!({ "oneOf": tables })
            .try_into()
            .unwrap_or_default()
    }
}

/// What a schema lets one choose from, if it does.
fn choices(schema: &Value) -> Option<&Vec<Value>> {
    schema
        .get("oneOf")
        .or(schema.get("anyOf"))?
        .as_array()
}

/// The tables among which a schema lets one choose, however nested the choice is.
fn flatten(schema: &Value, tables: &mut Vec<Value>) {
    match choices(schema) {
        Some(choices) => choices
            .iter()
            .for_each(|choice| flatten(choice, tables)),
        None => tables.push(schema.clone()),
    }
}

fn properties(schema: &Value) -> Map<String, Value> {
    schema
        .get("properties")
        .and_then(Value::as_object)
        .cloned()
        .unwrap_or_default()
}

/// The JSON schema of specs.
pub fn schema() -> Value {
    let settings = SchemaSettings::draft07().with(|settings| settings.inline_subschemas = true);
    let mut schema = settings
        .into_generator()
        .into_root_schema_for::<Experiment>()
        .to_value();
    tidy(&mut schema);
    let mut keys = properties(&schema);
    // The file has the name, and what says that it is the quick variant is the command line.
    keys.remove("name");
    keys.remove("quick");
    let same = |key: &String| (key.clone(), json!({ "$ref": format!("#/properties/{key}") }));
    let same: Map<String, Value> = keys.keys().map(same).collect();
    let description = "Keys that replace others under `--quick`.";
    let quick = json!({ "type": "object", "description": description, "properties": same, "additionalProperties": false });
    keys.insert("quick".into(), quick);
    schema["properties"] = keys.into();
    schema
}

/// Makes a schema of Rust's types one of TOML: without `null`, and without what descriptions say to Rust alone.
fn tidy(schema: &mut Value) {
    match schema {
        Value::Array(all) => all.iter_mut().for_each(tidy),
        Value::Object(map) => {
            if map.get("default").is_some_and(Value::is_null) {
                map.remove("default");
            }
            if let Some(Value::Array(types)) = map.get_mut("type") {
                types.retain(|kind| kind != "null");
                if let [one] = &types[..] {
                    let one = one.clone();
                    map.insert("type".into(), one);
                }
            }
            if let Some(Value::Array(any)) = map.get_mut("anyOf") {
                any.retain(|choice| {
                    choice
                        .get("type")
                        .is_none_or(|kind| kind != "null")
                });
                if let [Value::Object(one)] = &mut any[..] {
                    let one = std::mem::take(one);
                    map.remove("anyOf");
                    // What is said of the key goes before what is said of its type.
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

/// A description without links, and without the line in which rustdoc says default and range as they stand in the code.
fn described(text: &str) -> String {
    let of_code = |line: &str| line.starts_with("Default `") || line.starts_with("Accepted: `");
    let lines: Vec<&str> = text
        .lines()
        .filter(|line| !line.is_empty() && !of_code(line))
        .collect();
    let text = lines.join(" ");
    let mut plain = String::new();
    let mut rest = text.trim();
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
        let target = after
            .strip_prefix('(')
            .and_then(|after| after.split_once(')'));
        rest = target.map_or(after, |(_, after)| after);
    }
    plain + rest
}

/// The page of all keys, in Markdown.
pub fn page() -> String {
    let schema = schema();
    let mut text =
        "# Keys of specs\n\nEvery key that a spec may have, as `harness schema` tells editors; made by \
                    `UPDATE_DOCS=1 cargo test -p harness --test schema` from what reads the keys.\n\
                    [How specs are written and run](EXPERIMENTS.md).\n"
            .to_owned();
    let mut section = |heading: &str, table: &Value, hidden: &[&str]| {
        let description = table
            .get("description")
            .and_then(Value::as_str)
            .unwrap_or_default();
        text += &format!("\n{heading}\n\n{description}\n\n");
        let mut rows = Vec::new();
        keys_of(table, "", hidden, &mut rows);
        if !rows.is_empty() {
            text += &format!(
                "| key | value | default | meaning |\n|---|---|---|---|\n{}",
                rows.concat()
            );
        }
    };
    section("## An experiment", &schema, &["methods", "reports", "quick"]);
    let entries = |key: &str| {
        schema["properties"][key]["items"]["oneOf"]
            .as_array()
            .cloned()
            .unwrap_or_default()
    };
    let methods = entries("methods");
    let reports = entries("reports");
    let own = properties(&methods[0])
        .into_iter()
        .filter(|(key, _)| Own::KEYS.contains(&key.as_str()));
    let own = json!({ "properties": own.collect::<Map<_, _>>(), "description": "Beside `method`, its name." });
    section("## Every entry of `methods`", &own, &[]);
    for (tag, tables) in [("method", methods), ("kind", reports)] {
        for table in &tables {
            let name = table["properties"][tag]["const"]
                .as_str()
                .unwrap_or_default();
            section(&format!("## `{tag} = \"{name}\"`"), table, &[Own::KEYS, &[tag]].concat());
        }
    }
    text
}

/// A row for every key of a table, those of tables within it included.
fn keys_of(table: &Value, above: &str, hidden: &[&str], rows: &mut Vec<String>) {
    for (key, schema) in properties(table)
        .iter()
        .filter(|(key, _)| !hidden.contains(&key.as_str()))
    {
        let text = |key: &str| {
            schema
                .get(key)
                .and_then(Value::as_str)
                .unwrap_or_default()
                .to_owned()
        };
        let default = schema
            .get("default")
            .map(Value::to_string)
            .filter(|text| text.len() <= 40);
        let default = default.map_or_else(String::new, |text| format!("`{text}`"));
        let cells = [
            format!("`{above}{key}`"),
            format!("`{}`", value(schema)),
            default,
            text("description"),
        ];
        rows.push(format!(
            "| {} |\n",
            cells
                .map(|cell| cell.replace('|', "\\|"))
                .join(" | ")
        ));
        keys_of(schema, &format!("{above}{key}."), &[], rows);
        keys_of(
            schema.get("items").unwrap_or(&Value::Null),
            &format!("{above}{key}[]."),
            &[],
            rows,
        );
        for (name, inner) in choices(schema)
            .into_iter()
            .flatten()
            .flat_map(properties)
        {
            keys_of(&inner, &format!("{above}{key}.{name}."), &[], rows);
        }
    }
}

/// What values a schema accepts, as in TOML.
fn value(schema: &Value) -> String {
    let choice = |all: &Vec<Value>, word: &dyn Fn(&Value) -> String| {
        all.iter()
            .map(word)
            .collect::<Vec<_>>()
            .join(" or ")
    };
    if let Some(one) = schema.get("const") {
        return one.to_string();
    }
    if let Some(all) = schema.get("enum").and_then(Value::as_array) {
        return choice(all, &Value::to_string);
    }
    if let Some(all) = choices(schema) {
        return choice(all, &value);
    }
    let named = schema
        .get("additionalProperties")
        .filter(|of| of.is_object());
    match schema.get("type").and_then(Value::as_str) {
        Some("array") => format!("[{}, …]", value(schema.get("items").unwrap_or(&Value::Null))),
        Some("object") => match (named, schema.get("required")) {
            (Some(of), _) => format!("{{ NAME = {}, … }}", value(of)),
            (None, None) => "{ … }".into(),
            (None, Some(_)) => {
                let field = |(key, of): (&String, &Value)| format!("{key} = {}", value(of));
                let fields: Vec<String> = properties(schema).iter().map(field).collect();
                format!("{{ {} }}", fields.join(", "))
            }
        },
        Some(kind) => kind.into(),
        None => "any".into(),
    }
}
