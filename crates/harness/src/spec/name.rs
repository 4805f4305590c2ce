//! The name of an experiment, which is also the name of its folder.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A name that is safe for a folder in the results: it cannot lead outside, and the harness gives
/// it to none of its files. Empty until a spec gets the name of its file.
#[derive(
    Clone,
    Debug,
    Default,
    PartialEq,
    Eq,
    PartialOrd,
    Ord,
    Serialize,
    Deserialize,
    schemars::JsonSchema,
)]
#[serde(try_from = "String")]
pub struct Name(String);

/// The accepted names, for error messages.
pub const ACCEPTED: &str = "names that do not begin with a dot, are not `quick`, and have \
     no /, \\, : or control characters";

impl Name {
    /// Returns the name as text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        let is_reserved = name.starts_with('.') || name == "quick";
        if is_reserved || name.contains(is_forbidden) {
            return Err(format!("{name:?} is not the name of an experiment; accepted: {ACCEPTED}"));
        }
        Ok(Self(name))
    }
}

/// Returns true for separators of paths, on any system, and characters that terminals obey.
fn is_forbidden(character: char) -> bool {
    character.is_control() || ['/', '\\', ':'].contains(&character)
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_or_are_reserved_are_rejected() {
        for good in ["table4", "two words", "größe", "v1.2", "a..b"] {
            assert_eq!(Name::try_from(good.to_owned()).unwrap().as_str(), good);
        }
        let leading_elsewhere = [".", "..", "a/b", "..\\x", "c:x"];
        let reserved = [".lock", ".partial", "quick"];
        let control = ["a\u{1b}[2J", "a\0"];
        for wrong in leading_elsewhere.iter().chain(&reserved).chain(&control) {
            assert!(Name::try_from((*wrong).to_owned()).is_err(), "{wrong:?}");
        }
    }
}
