//! The results of a command: text for people, or one JSON object with all digits.

use crate::output::print_line;
use bvh_core::Frame;
use indicatif::HumanCount;
use serde_json::{Map, Value, json};

pub struct Answer {
    facts: Option<Map<String, Value>>,
}

impl Answer {
    /// Collects facts for JSON, or prints lines for people.
    pub fn new(is_json: bool) -> Self {
        Self { facts: is_json.then(Map::new) }
    }

    pub fn is_json(&self) -> bool {
        self.facts.is_some()
    }

    /// Prints a line for people.
    pub fn say(&self, line: &str) {
        if self.facts.is_none() {
            print_line(line);
        }
    }

    /// Adds a fact that a line for people contains.
    pub fn record(&mut self, name: &str, value: impl Into<Value>) {
        if let Some(facts) = &mut self.facts {
            facts.insert(name.into(), value.into());
        }
    }

    /// Adds a fact to a list.
    pub fn list(&mut self, name: &str, value: impl Into<Value>) {
        let list = self.facts.as_mut().map(|facts| facts.entry(name).or_insert(json!([])));
        if let Some(Value::Array(values)) = list {
            values.push(value.into());
        }
    }

    /// Prints a line for people, and adds it to a list.
    pub fn line(&mut self, list: &str, line: String) {
        self.say(&line);
        self.list(list, line);
    }

    /// Adds a fact, whose key is the name with underscores, and prints it as a line, `name: value`.
    pub fn fact(&mut self, name: &str, value: impl Into<Value>) {
        let value = value.into();
        let text = match &value {
            Value::String(text) => text.clone(),
            Value::Number(number) => match (number.as_u64(), number.as_f64()) {
                (Some(number), _) => whole(number),
                (None, number) => short(number.unwrap_or(f64::NAN)),
            },
            other => other.to_string(),
        };
        self.say(&format!("{name}: {text}"));
        self.record(&snake(name), value);
    }

    /// Prints the facts as JSON, if that is the form.
    pub fn end(self) {
        if let Some(facts) = self.facts {
            print_line(&format!("{:#}", Value::Object(facts)));
        }
    }
}

/// Returns a name in words as a key: `depth of leaves` as `depth_of_leaves`.
pub fn snake(name: &str) -> String {
    let words = name.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty());
    words.collect::<Vec<_>>().join("_").to_lowercase()
}

/// Writes a whole number with its digits in groups of three.
pub fn whole(number: impl TryInto<u64>) -> String {
    HumanCount(number.try_into().unwrap_or(u64::MAX)).to_string().replace(',', " ")
}

/// Writes a number with four significant digits.
pub fn short(number: f64) -> String {
    let scientific = format!("{number:.3e}");
    let exponent = scientific.split_once('e').and_then(|(_, exponent)| exponent.parse().ok());
    let rounded: f64 = scientific.parse().unwrap_or(number);
    match exponent {
        _ if number == 0.0 => "0".into(),
        Some(3..12) if number > 0.0 => whole(rounded as u64),
        Some(exponent @ -3..3) => format!("{rounded:.*}", (3 - exponent) as usize),
        _ => scientific,
    }
}

/// Says by how many per cent `cost` is below or above `base`: `−12.4 %`.
pub fn gain(cost: f64, base: f64) -> String {
    let percent = 0.0 - 100.0 * saved(cost, base);
    let digits = if percent.abs() < 10.0 { 2 } else { 1 };
    // A hyphen would be shorter than the plus.
    format!("{percent:+.digits$} %").replace('-', "−")
}

/// Returns the fraction by which `cost` is below `base`.
pub fn saved(cost: f64, base: f64) -> f64 {
    if base > 0.0 { 1.0 - cost / base } else { 0.0 }
}

/// Returns a frame as facts: `null`, or the rows of its rotation and its centre.
pub fn frame_facts(frame: Option<&Frame>) -> Value {
    frame.map_or(Value::Null, |frame| {
        let columns = frame.rotation().transpose().to_cols_array_2d();
        json!({ "rotation": columns, "centre": frame.centre().to_array() })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_four_digits_and_groups_of_three() {
        for (number, text) in [
            (0.0, "0"),
            (385_362.090_813_482_94, "385 400"),
            (9.9996, "10.00"),
            (999.96, "1 000"),
            (0.798_84, "0.7988"),
            (0.001_234_56, "0.001235"),
            (0.000_123_456, "1.235e-4"),
            (-2.5, "-2.500"),
            (1e30, "1.000e30"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(short(number), text);
        }
        let numbers = [0, 7, 999, 1000, 149_089_272].map(whole);
        assert_eq!(numbers, ["0", "7", "999", "1 000", "149 089 272"]);
        let gains = [(0.5, 1.0), (1.0, 1.0), (1.0, 0.0), (1.034, 1.0)].map(|(a, b)| gain(a, b));
        assert_eq!(gains, ["−50.0 %", "+0.00 %", "+0.00 %", "+3.40 %"]);
    }
}
