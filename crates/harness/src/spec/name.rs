//! The name of an experiment, which is also the name of a folder.

use serde::{Deserialize, Serialize};
use std::fmt;

/// A name that is safe as that of a folder among the results: it cannot lead elsewhere, and it is none of the names that
/// the harness gives to files of its own there. Empty by default, in a spec that has not been given its file's name.
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

/// What names may be.
pub const ACCEPTED: &str = "names that do not begin with a dot, are not `quick`, do not end with `.new`, and have no /, \\, : or control \
     characters";

impl Name {
    /// The name as a text.
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl TryFrom<String> for Name {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        let forbidden = |c: char| c.is_control() || ['/', '\\', ':'].contains(&c);
        let reserved = name.starts_with('.') || name.ends_with(".new") || name == "quick";
        if reserved || name.contains(forbidden) {
            return Err(format!("{name:?} is not the name of an experiment; accepted: {ACCEPTED}"));
        }
        Ok(Self(name))
    }
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
    fn names_that_lead_elsewhere_or_are_the_harnesss_own_are_refused() {
        for good in ["table4", "two words", "größe", "v1.2", "a..b"] {
            assert_eq!(Name::try_from(good.to_owned()).unwrap().as_str(), good);
        }
        for wrong in [
            ".",
            "..",
            ".lock",
            ".partial",
            "a/b",
            "..\\x",
            "c:x",
            "x.new",
            "quick",
            "a\u{1b}[2J",
            "a\0",
        ] {
            assert!(Name::try_from(wrong.to_owned()).is_err(), "{wrong:?}");
        }
    }
}
