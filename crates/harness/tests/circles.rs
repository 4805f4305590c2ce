//! Files import each other one way only: no file of a crate uses a file that, by whatever way round, uses it.
//!
//! Paths that begin with `crate`, `super`, or the name of a child module are followed, through re-exports, to the file
//! that defines the item. Re-exports themselves and unit tests do not count, nor does what a module defines for the files
//! of its own folder.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

type Module = Vec<String>;

/// The code of every module of a crate, without comments and unit tests.
fn modules(folder: &Path, at: &Module, found: &mut BTreeMap<Module, String>) {
    let mut entries: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let module = match name.as_str() {
            "lib" | "main" | "mod" => at.clone(),
            _ => [&at[..], &[name]].concat(),
        };
        if path.is_dir() {
            modules(&path, &module, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") && !path.ends_with("main.rs") {
            let text = fs::read_to_string(&path).unwrap();
            let lines = text.lines().take_while(|line| *line != "#[cfg(test)]");
            let code =
                lines.map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n");
            found.insert(module, code);
        }
    }
}

/// All paths of a use tree such as `a::{b, c::{d as e, self}}`.
fn paths(tree: &str) -> Vec<Module> {
    let tree = tree.trim();
    let (head, rest) = tree.split_once('{').unwrap_or((tree, ""));
    let head: Module =
        head.split("::").map(|name| name.split_whitespace().next().unwrap_or("")).map(Into::into).collect();
    let head: Module =
        head.into_iter().filter(|name| !name.is_empty() && name != "self" && name != "*").collect();
    let (mut depth, mut start, mut found) = (0, 0, Vec::new());
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
    let below: Vec<Module> = found.into_iter().filter(|tree| !tree.trim().is_empty()).flat_map(paths).collect();
    match below.is_empty() {
        true => vec![head],
        false => below.into_iter().map(|tail| [&head[..], &tail].concat()).collect(),
    }
}

/// The paths that a module re-exports, and all other paths in its code that lead to modules of its crate.
fn used(module: &Module, code: &str, known: &BTreeMap<Module, String>) -> [Vec<Module>; 2] {
    let mut found = [Vec::new(), Vec::new()];
    for statement in code.split(';') {
        let (code, tree) = statement.rsplit_once("use ").unwrap_or((statement, ""));
        let is_path = |c: char| c.is_alphanumeric() || "_:".contains(c);
        let inline = code
            .split(|c| !is_path(c))
            .filter(|word| word.starts_with("crate::") || word.starts_with("super::"));
        let exported = code.trim_end().ends_with("pub") || code.trim_end().ends_with("pub(crate)");
        let inline = inline.flat_map(paths).map(|path| (false, path));
        for (exported, path) in paths(tree).into_iter().map(|path| (exported, path)).chain(inline) {
            let ups = path.iter().take_while(|name| *name == "super").count();
            let whole = match path.first().map(String::as_str) {
                Some("crate") => path[1..].to_vec(),
                _ => [&module[..module.len() - ups.min(module.len())], &path[ups..]].concat(),
            };
            let is_child =
                || (1..=path.len()).any(|length| known.contains_key(&[&module[..], &path[..length]].concat()));
            if ups > 0 || path.first().is_some_and(|name| name == "crate") || is_child() {
                found[usize::from(!exported)].push(whole);
            }
        }
    }
    found
}

/// The module that defines what a path names.
fn resolve(path: &Module, exports: &BTreeMap<Module, Vec<Module>>, depth: usize) -> Module {
    let length = (0..=path.len()).rev().find(|&length| exports.contains_key(&path[..length])).unwrap_or(0);
    let module = path[..length].to_vec();
    let Some(name) = path.get(length).filter(|_| depth < 9) else { return module };
    match exports[&module].iter().find(|exported| exported.last() == Some(name)) {
        Some(exported) => resolve(exported, exports, depth + 1),
        None => module,
    }
}

#[test]
fn no_file_uses_a_file_that_uses_it() {
    let crates = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for name in ["bvh-core", "bvh-build", "bvh-search", "harness"] {
        let mut known = BTreeMap::new();
        modules(&crates.join(name).join("src"), &Module::new(), &mut known);
        let found: BTreeMap<_, _> =
            known.iter().map(|(module, code)| (module, used(module, code, &known))).collect();
        let exports = found.iter().map(|(module, [exports, _])| ((*module).clone(), exports.clone())).collect();
        let mut edges = BTreeSet::new();
        for (module, [_, paths]) in &found {
            let targets = paths.iter().map(|path| resolve(path, &exports, 0));
            // What a module defines is open to the files of its own folder.
            let others = targets.filter(|target| !module.starts_with(target));
            edges.extend(others.map(|target| ((*module).clone(), target)));
        }
        assert!(edges.len() > 5, "{name}: {edges:?}");
        // What nothing uses, or what uses nothing, is in no circle.
        loop {
            let (uses, used): (BTreeSet<_>, BTreeSet<_>) = edges.iter().cloned().unzip();
            let before = edges.len();
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
