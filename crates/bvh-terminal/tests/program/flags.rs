//! Wrong values of every flag that a program's help lists.

use super::{names, refused, run, said, text};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The exit code, and all that is said.
fn outcome(folder: &Path, args: &[&str]) -> (Option<i32>, String) {
    let output = run(folder, args);
    (output.status.code(), text(&[output.stdout, output.stderr].concat()))
}

/// The arguments of a command; the one without a name runs specs.
fn call<'a>(command: &'a str, args: &[&'a str]) -> Vec<&'a str> {
    let name: &[&str] = if command.is_empty() { &[] } else { &[command] };
    [name, args].concat()
}

/// The flags of a command with the name of their value, as its help lists them.
fn flags(folder: &Path, command: &str) -> Vec<(String, Option<String>)> {
    let help = said(folder, &call(command, &["--help"]));
    let flag = |line: &str| {
        let mut words = line
            .split_whitespace()
            .skip_while(|word| !word.starts_with("--"));
        let name = words.next()?.trim_end_matches(',').to_owned();
        Some((
            name,
            words
                .next()
                .filter(|word| word.starts_with('<'))
                .map(str::to_owned),
        ))
    };
    let lines = help
        .lines()
        .filter(|line| line.trim_start().starts_with('-'));
    lines
        .filter_map(flag)
        .filter(|(name, _)| !["--help", "--version"].contains(&name.as_str()))
        .collect()
}

/// Gives every flag of the commands values that it cannot take, each command with the arguments that it needs; each must be rejected
/// by name, and nothing written. Returns the number of flags.
pub fn wrong_flags(at: &Path, commands: &[(&str, &[&str])]) -> usize {
    fs::create_dir(at.join("folder")).unwrap();
    fs::write(at.join("file"), "").unwrap();
    let before = names(at);
    let help = said(at, &["--help"]);
    let listed = help
        .split_once("Commands:")
        .unwrap()
        .1
        .lines()
        .skip(1)
        .take_while(|line| !line.trim().is_empty());
    let listed: BTreeSet<&str> = listed
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    let tried: BTreeSet<&str> = commands
        .iter()
        .map(|(name, _)| *name)
        .chain(["help"])
        .filter(|n| !n.is_empty())
        .collect();
    assert_eq!(listed, tried);
    let mut count = 0;
    let mut found = Vec::new();
    for &(command, needed) in commands {
        for (flag, value) in flags(at, command) {
            count += 1;
            let wrong: &[&str] = match value.as_deref() {
                None => &["3"],
                Some("<DIR>") => &["file", "file/below", ""],
                Some(file) if file.starts_with("<FILE") || file.ends_with(".csv>") => {
                    &["folder", ""]
                }
                Some(_) => &["no such thing", "-1", "nan", "99999999999999999999999", ""],
            };
            for wrong in wrong {
                // A seed may be any number, and work may be much.
                let given = format!("{flag}={wrong}");
                let mut args = call(command, needed);
                args.retain(|arg| !arg.starts_with(&format!("{flag}=")));
                args.push(&given);
                let (code, said) = outcome(at, &args);
                let named = said.contains(&flag)
                    || (flag == "--scene" && said.contains(&format!("scene {wrong}")));
                if code != Some(2) || !named {
                    found.push(format!("{args:?}: code {code:?}: {said}"));
                }
            }
        }
        refused(at, &call(command, &["--unheard-of"]), 2, &["--unheard-of"]);
    }
    assert!(found.is_empty(), "\n{}", found.join("\n"));
    assert_eq!(names(at), before, "nothing was written");
    count
}
