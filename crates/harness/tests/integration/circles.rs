//! Imports lead only downwards between the layers of a crate, in the order of ARCHITECTURE.md.
//!
//! A layer consists of *top modules*, the files and folders at the top of a crate's sources. The
//! test reads words, not syntax: an import is a path that begins at the root of the crate, and an
//! item that the root re-exports counts as an import of the module that it comes from.

use crate::support::top;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// The code of every top module, without comments and unit tests, each `super` that leads to the
/// root replaced by `crate`. The root is the module with the empty name.
fn modules(folder: &Path, module: &[String], code: &mut BTreeMap<String, String>) {
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = path.file_stem().unwrap().to_str().unwrap();
        let inside = match name {
            "lib" | "main" | "mod" => module.to_vec(),
            _ => [module, &[name.to_owned()]].concat(),
        };
        if path.is_dir() {
            modules(&path, &inside, code);
        } else if path.extension().is_some_and(|end| end == "rs") && name != "tests" {
            let text = fs::read_to_string(&path).unwrap();
            let lines = text.lines().take_while(|line| *line != "#[cfg(test)]");
            let plain: String =
                lines.map(|line| line.split("//").next().unwrap().to_owned() + " ").collect();
            let to_root = "super::".repeat(inside.len().max(1));
            let top = inside.first().cloned().unwrap_or_default();
            *code.entry(top).or_default() += &plain.replace(&to_root, "crate::");
        }
    }
}

fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|word| !word.is_empty())
}

/// Every import of a top module by another, as importer and imported.
fn imports(code: &BTreeMap<String, String>) -> BTreeSet<(String, String)> {
    let mut origins: BTreeMap<&str, &str> = BTreeMap::new();
    for statement in code[""].split("pub use ").skip(1) {
        let mut path = words(statement.split(';').next().unwrap());
        let Some((module, _)) = path.next().and_then(|module| code.get_key_value(module)) else {
            continue;
        };
        origins.extend(path.map(|item| (item, module.as_str())));
    }
    // A module's own name is no item of another, as in `cost::Cost as cost`.
    origins.extend(code.keys().map(|module| (module.as_str(), module.as_str())));
    let mut imports = BTreeSet::new();
    for (importer, text) in code.iter().filter(|(importer, _)| !importer.is_empty()) {
        // Re-exports do not count.
        let text = text.replace("pub use crate::", "").replace("pub(crate) use crate::", "");
        for path in text.split("crate::").skip(1) {
            // Of a group of paths, all words; this can only find too many imports.
            let group = if path.starts_with('{') { path.split(';').next().unwrap() } else { "" };
            let imported = words(group).chain(words(path).take(1));
            imports.extend(
                imported
                    .filter_map(|word| Some((importer.clone(), (*origins.get(word)?).to_owned()))),
            );
        }
    }
    imports
}

/// The crates of ARCHITECTURE.md, each with the top modules of its layers from the top down.
fn layers(page: &str) -> BTreeMap<String, Vec<Vec<String>>> {
    let block = page.split("```layers\n").nth(1).unwrap().split("```").next().unwrap();
    // An indented line continues the crate above.
    let lines = block.replace("\n ", " ");
    let layer = |names: &str| words(names).map(str::to_owned).collect();
    let crates = lines.lines().map(|line| line.split_once(' ').unwrap());
    crates.map(|(name, all)| (name.into(), all.split(" → ").map(layer).collect())).collect()
}

#[test]
fn top_modules_import_only_from_lower_layers() {
    let listed = layers(&fs::read_to_string(top().join("ARCHITECTURE.md")).unwrap());
    let mut seen = 0;
    for (name, layers) in &listed {
        let mut code = BTreeMap::new();
        modules(&top().join("crates").join(name).join("src"), &[], &mut code);
        let sources: BTreeSet<&String> = code.keys().filter(|name| !name.is_empty()).collect();
        assert_eq!(layers.iter().flatten().collect::<BTreeSet<_>>(), sources, "{name}");
        let layer = |module: &String| layers.iter().position(|layer| layer.contains(module));
        let mut imports = imports(&code);
        imports.retain(|(importer, imported)| importer != imported);
        seen += imports.len();
        imports.retain(|(importer, imported)| layer(importer) >= layer(imported));
        assert!(imports.is_empty(), "{name}, importers and imported: {imports:?}");
    }
    assert!(seen > 100, "only {seen} imports are seen");
    let manifest: toml::Table =
        fs::read_to_string(top().join("Cargo.toml")).unwrap().parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap().iter();
    let members = members.map(|member| member.as_str().unwrap().trim_start_matches("crates/"));
    assert!(members.collect::<BTreeSet<_>>().into_iter().eq(listed.keys()));
}
