//! The name of an experiment, which is also the name of its folder.

use serde::{Deserialize, Deserializer, de};

/// The accepted names, for error messages.
const ACCEPTED: &str = "names that do not begin with a dot, are not `quick`, and have \
     no /, \\, : or control characters";

/// Rejects a name that is not safe for a folder in the results: one that leads outside, or that the
/// harness gives to one of its files.
pub fn check(name: &str) -> Result<(), String> {
    let is_reserved = name.starts_with('.') || name == "quick";
    // Separators of paths, on any system, and characters that terminals obey.
    let is_forbidden = |c: char| c.is_control() || ['/', '\\', ':'].contains(&c);
    if is_reserved || name.contains(is_forbidden) {
        return Err(format!("{name:?} is not the name of an experiment; accepted: {ACCEPTED}"));
    }
    Ok(())
}

/// Reads a checked name.
pub fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let name = String::deserialize(deserializer)?;
    check(&name).map_err(de::Error::custom)?;
    Ok(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_or_are_reserved_are_rejected() {
        for good in ["table4", "two words", "größe", "v1.2", "a..b"] {
            assert_eq!(check(good), Ok(()));
        }
        let leading_elsewhere = [".", "..", "a/b", "..\\x", "c:x"];
        let reserved = [".lock", ".partial", "quick"];
        let control = ["a\u{1b}[2J", "a\0"];
        for wrong in leading_elsewhere.iter().chain(&reserved).chain(&control) {
            assert!(check(wrong).is_err(), "{wrong:?}");
        }
    }
}
