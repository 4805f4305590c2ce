//! Rejects references of 2³² and more, which `gltf-json` would take modulo 2³².

use serde::de::{Deserialize, DeserializeSeed, Deserializer, Error, IgnoredAny};
use serde::de::{MapAccess, SeqAccess, Visitor};
use std::borrow::Cow;
use std::fmt;

/// The keys of the numbers that the loader follows or compares.
const REFERENCES: [&str; 10] = [
    "attributes",
    "buffer",
    "bufferView",
    "children",
    "componentType",
    "indices",
    "mesh",
    "mode",
    "nodes",
    "scene",
];

/// The keys of values that belong to the author of the file or of an extension.
const FREE: [&str; 2] = ["extensions", "extras"];

/// A JSON document whose references are all below 2³².
#[derive(Debug)]
pub struct References;

impl<'de> Deserialize<'de> for References {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Value { key: "" }.deserialize(deserializer).map(|()| Self)
    }
}

/// A value of the document, and the key of the nearest object around it.
#[derive(Clone, Copy)]
struct Value<'k> {
    key: &'k str,
}

impl<'de> DeserializeSeed<'de> for Value<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Value<'_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("JSON")
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<(), E> {
        if number > u64::from(u32::MAX) && REFERENCES.contains(&self.key) {
            return Err(E::custom(format!(
                "{number}; expected at most {} as `{}`",
                u32::MAX,
                self.key
            )));
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<(), A::Error> {
        while elements.next_element_seed(self)?.is_some() {}
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut entries: A) -> Result<(), A::Error> {
        while let Some(key) = entries.next_key::<Cow<str>>()? {
            if FREE.contains(&key.as_ref()) {
                entries.next_value::<IgnoredAny>()?;
                continue;
            }
            // The keys of attributes are names, such as POSITION.
            let is_name = self.key == "attributes";
            let key = if is_name { self.key } else { key.as_ref() };
            entries.next_value_seed(Value { key })?;
        }
        Ok(())
    }

    // Other values contain no reference.
    fn visit_bool<E: Error>(self, _: bool) -> Result<(), E> {
        Ok(())
    }

    fn visit_i64<E: Error>(self, _: i64) -> Result<(), E> {
        Ok(())
    }

    fn visit_f64<E: Error>(self, _: f64) -> Result<(), E> {
        Ok(())
    }

    fn visit_str<E: Error>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    fn visit_unit<E: Error>(self) -> Result<(), E> {
        Ok(())
    }
}
