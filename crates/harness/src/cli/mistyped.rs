//! Which command a mistyped word means.

use clap::Command;
use std::ffi::OsStr;
use std::path::Path;

/// How alike two words must be for one to be a mistyped other, between 0 and 1; as clap has it.
const ALIKE: f64 = 0.7;

/// What to say about a first argument that is neither a command nor a flag, nor looks like a file, but is close to a command.
pub fn mistyped(first: Option<&OsStr>, command: &Command) -> Option<String> {
    let is_file = |word: &str| word.contains(['.', '/', '\\']) || Path::new(word).exists();
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
        .then(|| format!("{word:?}: no such file or command; is `{name}` meant?"))
}
