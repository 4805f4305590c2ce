//! Wrong values of every flag that a program's help lists.

use super::{names, refused, run, said, text};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Returns the arguments of a command. The command that runs specs has no name.
fn call<'a>(command: &'a str, args: &[&'a str]) -> Vec<&'a str> {
    let name: &[&str] = if command.is_empty() { &[] } else { &[command] };
    [name, args].concat()
}

/// Lists the flags in the help of a command, each with the name of its value.
fn flags(folder: &Path, command: &str) -> Vec<(String, Option<String>)> {
    let help = said(folder, &call(command, &["--help"]));
    let mut flags = Vec::new();
    // Other lines explain a flag, and may mention further ones.
    for line in help.lines().filter(|line| line.trim_start().starts_with('-')) {
        let mut words = line.split_whitespace().skip_while(|word| !word.starts_with("--"));
        let Some(name) = words.next() else { continue };
        let value = words.next().filter(|word| word.starts_with('<')).map(str::to_owned);
        if !["--help", "--version"].contains(&name) {
            flags.push((name.to_owned(), value));
        }
    }
    flags
}

/// Gives every flag of the commands invalid values, together with the arguments that the command
/// needs. Asserts that the message names the flag and that no file is written. Returns the number
/// of flags.
pub fn wrong_flags(at: &Path, commands: &[(&str, &[&str])]) -> usize {
    fs::create_dir(at.join("folder")).unwrap();
    fs::write(at.join("file"), "").unwrap();
    let before = names(at);
    let help = said(at, &["--help"]);
    let (_, list) = help.split_once("Commands:").unwrap();
    let lines = list.lines().skip(1).take_while(|line| !line.trim().is_empty());
    let listed: BTreeSet<&str> = lines.filter_map(|line| line.split_whitespace().next()).collect();
    let mut tried: BTreeSet<&str> = commands.iter().map(|(name, _)| *name).collect();
    tried.insert("help");
    tried.remove("");
    // A new command must be added to the caller's list.
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
                let given = format!("{flag}={wrong}");
                let mut args = call(command, needed);
                // A flag may not be given twice.
                args.retain(|arg| !arg.starts_with(&format!("{flag}=")));
                args.push(&given);
                let output = run(at, &args);
                let code = output.status.code();
                let said = text(&output.stderr);
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
