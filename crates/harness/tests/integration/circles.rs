//! Imports lead only downwards between the layers of a crate, in the order of ARCHITECTURE.md, and
//! files import each other in no circle.
//!
//! A layer consists of *top modules*, the files and folders at the top of a crate's sources. The
//! test follows paths that begin with `crate`, `super`, or the name of a child module, through
//! re-exports, to the file that defines the item. It ignores re-exports themselves, unit tests, and
//! items that a module defines for the files of its folder.

use crate::support::top;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

type Module = Vec<String>;

/// Collects the code of every module of a crate, without comments and unit tests.
fn modules(folder: &Path, at: &Module, found: &mut BTreeMap<Module, String>) {
    let mut entries: Vec<PathBuf> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let module = match name.as_str() {
            "lib" | "main" | "mod" => at.clone(),
            _ => [&at[..], &[name]].concat(),
        };
        if path.is_dir() {
            modules(&path, &module, found);
        } else if is_source(&path) {
            let text = fs::read_to_string(&path).unwrap();
            let lines = text.lines().take_while(|line| *line != "#[cfg(test)]");
            let code = lines
                .map(|line| line.split("//").next().unwrap_or_default())
                .collect::<Vec<_>>()
                .join("\n");
            found.insert(module, code);
        }
    }
}

/// Returns true if a file is code of its crate, not unit tests, and not a program next to a
/// library.
fn is_source(path: &Path) -> bool {
    let is_beside_a_library = path.ends_with("main.rs") && path.with_file_name("lib.rs").exists();
    let is_rust = path.extension().is_some_and(|extension| extension == "rs");
    is_rust && !path.ends_with("tests.rs") && !is_beside_a_library
}

/// Returns all paths of a use tree such as `a::{b, c::{d as e, self}}`.
fn paths(tree: &str) -> Vec<Module> {
    let tree = tree.trim();
    let (head, rest) = tree.split_once('{').unwrap_or((tree, ""));
    let head: Module = head
        .split("::")
        .map(|name| name.split_whitespace().next().unwrap_or(""))
        .map(Into::into)
        .collect();
    let head: Module =
        head.into_iter().filter(|name| !name.is_empty() && name != "self" && name != "*").collect();
    let mut depth = 0;
    let mut start = 0;
    let mut found = Vec::new();
    for (at, character) in rest.char_indices() {
        match character {
            '{' => depth += 1,
            ',' | '}' if depth == 0 => {
                found.push(&rest[start..at]);
                start = at + 1;
            }
            '}' => depth -= 1,
            _ => {}
        }
    }
    let below: Vec<Module> =
        found.into_iter().filter(|tree| !tree.trim().is_empty()).flat_map(paths).collect();
    match below.is_empty() {
        true => vec![head],
        false => below.into_iter().map(|tail| [&head[..], &tail].concat()).collect(),
    }
}

/// Returns the paths that a module re-exports, and all other paths in its code that lead to modules
/// of its crate.
fn used(module: &Module, code: &str, known: &BTreeMap<Module, String>) -> [Vec<Module>; 2] {
    let mut found = [Vec::new(), Vec::new()];
    for statement in code.split(';') {
        let (code, tree) = statement.rsplit_once("use ").unwrap_or((statement, ""));
        let inline = code
            .split(|c: char| !c.is_alphanumeric() && !"_:".contains(c))
            .filter(|word| word.starts_with("crate::") || word.starts_with("super::"));
        let exported = code.trim_end().ends_with("pub") || code.trim_end().ends_with("pub(crate)");
        let inline = inline.flat_map(paths).map(|path| (false, path));
        for (exported, path) in paths(tree).into_iter().map(|path| (exported, path)).chain(inline) {
            let ups = path.iter().take_while(|name| *name == "super").count();
            let whole = match path.first().map(String::as_str) {
                Some("crate") => path[1..].to_vec(),
                _ => [&module[..module.len() - ups.min(module.len())], &path[ups..]].concat(),
            };
            let is_child = || {
                (1..=path.len())
                    .any(|length| known.contains_key(&[&module[..], &path[..length]].concat()))
            };
            if ups > 0 || path.first().is_some_and(|name| name == "crate") || is_child() {
                found[usize::from(!exported)].push(whole);
            }
        }
    }
    found
}

/// Returns the module that defines the item of a path.
fn resolve(path: &Module, exports: &BTreeMap<Module, Vec<Module>>, depth: usize) -> Module {
    let length =
        (0..=path.len()).rev().find(|&length| exports.contains_key(&path[..length])).unwrap_or(0);
    let module = path[..length].to_vec();
    let Some(name) = path.get(length).filter(|_| depth < 9) else { return module };
    match exports[&module].iter().find(|exported| exported.last() == Some(name)) {
        Some(exported) => resolve(exported, exports, depth + 1),
        None => module,
    }
}

/// Returns, for every file of a crate's sources, the files that define the items it uses, without
/// the modules above it.
fn edges(folder: &Path) -> BTreeSet<(Module, Module)> {
    let mut known = BTreeMap::new();
    modules(folder, &Module::new(), &mut known);
    let found: BTreeMap<_, _> =
        known.iter().map(|(module, code)| (module, used(module, code, &known))).collect();
    let exports =
        found.iter().map(|(module, [exports, _])| ((*module).clone(), exports.clone())).collect();
    let mut edges = BTreeSet::new();
    for (module, [_, paths]) in &found {
        let targets = paths.iter().map(|path| resolve(path, &exports, 0));
        // The items of a module are open to the files of its folder.
        let others = targets.filter(|target| !module.starts_with(target));
        edges.extend(others.map(|target| ((*module).clone(), target)));
    }
    edges
}

/// Returns the crates of ARCHITECTURE.md, each with the top modules of its layers from the top down.
fn layers(page: &str) -> Vec<(String, Vec<Vec<String>>)> {
    let block = page.split("```layers\n").nth(1).unwrap().split("```").next().unwrap();
    // An indented line continues the crate above.
    let lines = block.replace("\n ", " ");
    let layer = |names: &str| {
        names.split_whitespace().map(|name| name.trim_end_matches(',').to_owned()).collect()
    };
    let crates = lines.lines().map(|line| line.split_once(' ').unwrap());
    crates
        .map(|(name, layers)| (name.to_owned(), layers.split(" → ").map(layer).collect()))
        .collect()
}

/// Returns the top modules of a crate.
fn top_modules(folder: &Path) -> BTreeSet<String> {
    let mut found = BTreeMap::new();
    modules(folder, &Module::new(), &mut found);
    found.into_keys().filter_map(|module| module.first().cloned()).collect()
}

/// Returns all imports from a top module to one that is not in a lower layer.
fn rising(edges: &BTreeSet<(Module, Module)>, layers: &[Vec<String>]) -> Vec<String> {
    let layer = |module: &String| layers.iter().position(|modules| modules.contains(module));
    let mut rising = Vec::new();
    for (from, to) in edges {
        // The root of a crate is in no layer.
        let ([from_top, ..], [to_top, ..]) = (&from[..], &to[..]) else { continue };
        if from_top != to_top && layer(to_top) <= layer(from_top) {
            rising.push(format!("{} uses {}", from.join("/"), to.join("/")));
        }
    }
    rising
}

#[test]
fn top_modules_import_only_from_lower_layers() {
    let page = fs::read_to_string(top().join("ARCHITECTURE.md")).unwrap();
    let listed = layers(&page);
    for (name, layers) in &listed {
        let folder = top().join("crates").join(name).join("src");
        let known: BTreeSet<String> = layers.iter().flatten().cloned().collect();
        assert_eq!(
            known,
            top_modules(&folder),
            "{name}: the top modules of ARCHITECTURE.md, and of the sources"
        );
        let rising = rising(&edges(&folder), layers);
        assert!(rising.is_empty(), "{name}:\n{}", rising.join("\n"));
    }
    // Every crate of the workspace is listed.
    let manifest = fs::read_to_string(top().join("Cargo.toml")).unwrap();
    let manifest: toml::Table = manifest.parse().unwrap();
    let members = manifest["workspace"]["members"].as_array().unwrap();
    let members =
        members.iter().map(|member| member.as_str().unwrap().trim_start_matches("crates/"));
    assert_eq!(
        listed.iter().map(|(name, _)| name.as_str()).collect::<BTreeSet<_>>(),
        members.collect()
    );
}

#[test]
fn an_import_from_a_layer_above_is_found() {
    let folder = tempfile::tempdir().unwrap();
    let write = |file: &str, text: &str| fs::write(folder.path().join(file), text).unwrap();
    write("lib.rs", "pub mod above;\nmod below;\npub use below::Low;\n");
    write("above.rs", "use crate::Low;\npub struct High(Low);\n");
    write("below.rs", "pub struct Low;\n");
    let layers = [vec!["above".to_owned()], vec!["below".to_owned()]];
    assert_eq!(rising(&edges(folder.path()), &layers), [""; 0]);
    write("below.rs", "use crate::above::High;\npub struct Low;\nfn f(_: High) {}\n");
    assert_eq!(rising(&edges(folder.path()), &layers), ["below uses above"]);
}

#[test]
fn no_file_uses_a_file_that_uses_it() {
    for crate_folder in fs::read_dir(top().join("crates")).unwrap() {
        let folder = crate_folder.unwrap().path();
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let mut edges = edges(&folder.join("src"));
        // A file that nothing uses, or that uses nothing, is in no circle.
        loop {
            let (uses, used): (BTreeSet<_>, BTreeSet<_>) = edges.iter().cloned().unzip();
            let before = edges.len();
            // What is left when nothing changes any more is a circle.
            edges.retain(|(from, to)| used.contains(from) && uses.contains(to));
            if edges.len() == before {
                break;
            }
        }
        let circle: Vec<String> =
            edges.iter().map(|(a, b)| format!("{} uses {}", a.join("/"), b.join("/"))).collect();
        assert!(circle.is_empty(), "{name}:\n{}", circle.join("\n"));
    }
}
