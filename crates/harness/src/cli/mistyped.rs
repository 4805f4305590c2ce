//! The suggestion for a mistyped command.

use clap::Command;
use std::ffi::OsStr;
use std::path::Path;

/// The least Jaro similarity, between 0 and 1, at which a word counts as a mistyped command; clap
/// uses the same threshold.
const ALIKE: f64 = 0.7;

/// Returns the message about a first argument that resembles a command, unless it is one, or a
/// flag, or looks like a file.
pub fn mistyped(first: Option<&OsStr>, command: &Command) -> Option<String> {
    // Specs are positional, so clap itself accepts any word here and suggests nothing.
    let word = first
        .and_then(OsStr::to_str)
        .filter(|word| !word.starts_with('-') && !is_file(word))?;
    let names = command
        .get_subcommands()
        .filter(|known| !known.is_hide_set())
        .map(Command::get_name);
    let closest = names
        .map(|name| (strsim::jaro(word, name), name))
        .max_by(|a, b| a.0.total_cmp(&b.0))?;
    let (likeness, name) = closest;
    (ALIKE..1.0)
        .contains(&likeness)
        .then(|| format!("{word:?}: no such file or command; did you mean `{name}`?"))
}

fn is_file(word: &str) -> bool {
    word.contains(['.', '/', '\\']) || Path::new(word).exists()
}
