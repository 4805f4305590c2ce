//! Everything that a release publishes has one version, and the oldest Rust is declared once.

use crate::support::top;
use std::fs;

/// Returns the value of the first line of `file` that begins with `key`, without quotes and comma.
fn value(file: &str, key: &str) -> String {
    let text = fs::read_to_string(top().join(file)).unwrap();
    let line = text.lines().find_map(|line| line.strip_prefix(key));
    let line = line.unwrap_or_else(|| panic!("{file} has no line that begins with `{key}`"));
    line.trim_matches([' ', '"', ',']).to_owned()
}

#[test]
fn whatever_is_published_has_the_version_of_the_workspace() {
    let version = value("Cargo.toml", "version = ");
    for file in [
        "crates/bvh-c/Cargo.toml",
        "crates/bvh-js/Cargo.toml",
        "crates/bvh-python/Cargo.toml",
        "crates/bvh-python/pyproject.toml",
    ] {
        assert_eq!(value(file, "version = "), version, "{file}");
    }
    assert_eq!(value("crates/bvh-js/package.json", "  \"version\":"), version);
    assert_eq!(value("CITATION.cff", "version: "), version);
    let heading = format!("## {version} - {}", value("CITATION.cff", "date-released: "));
    let changes = fs::read_to_string(top().join("CHANGELOG.md")).unwrap();
    assert!(changes.lines().any(|line| line == heading), "CHANGELOG.md lacks `{heading}`");
    let workspace = fs::read_to_string(top().join("Cargo.toml")).unwrap();
    for line in workspace.lines().filter(|line| line.contains("path = \"crates/bvh-")) {
        assert!(line.contains(&format!("version = \"{version}\"")), "{line}");
    }
}

#[test]
fn the_bindings_need_no_newer_rust_than_the_workspace() {
    let oldest = value("Cargo.toml", "rust-version = ");
    for language in ["c", "js", "python"] {
        let file = &format!("crates/bvh-{language}/Cargo.toml");
        assert_eq!(value(file, "rust-version = "), oldest, "{file}");
    }
}
