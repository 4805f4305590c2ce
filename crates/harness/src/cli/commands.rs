//! What the program knows of its own commands: completions for shells, the manual page, and which command a mistyped word
//! means.

use clap::Command;
use clap_complete::Shell;
use std::ffi::OsStr;
use std::path::Path;

/// How alike two words must be for one to be a mistyped other, between 0 and 1; as clap has it.
const ALIKE: f64 = 0.7;

/// The file by which a shell completes the program's arguments.
pub fn completions(shell: Shell, command: &mut Command) -> Vec<u8> {
    let mut file = Vec::new();
    clap_complete::generate(shell, command, "harness", &mut file);
    file
}

/// The manual page of the program, its commands' pages behind it, for `man -l -`.
pub fn manual(command: Command) -> std::io::Result<Vec<u8>> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut page)?;
    for part in command.get_subcommands().filter(|part| !part.is_hide_set()) {
        let name = format!("harness {}", part.get_name());
        clap_mangen::Man::new(part.clone().display_name(name)).render(&mut page)?;
    }
    Ok(page)
}

/// What to say about a first argument that is neither a command nor a flag, nor looks like a file, but is close to a command.
pub fn mistyped(first: Option<&OsStr>, command: &Command) -> Option<String> {
    let is_file = |word: &str| word.contains(['.', '/', '\\']) || Path::new(word).exists();
    let word = first.and_then(OsStr::to_str).filter(|word| !word.starts_with('-') && !is_file(word))?;
    let names = command.get_subcommands().filter(|known| !known.is_hide_set()).map(Command::get_name);
    let closest = names.map(|name| (strsim::jaro(word, name), name)).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let (likeness, name) = closest;
    (ALIKE..1.0).contains(&likeness).then(|| format!("{word:?}: no such file or command; is `{name}` meant?"))
}
