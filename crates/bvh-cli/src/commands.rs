//! Completions for shells and the manual page, both generated from the program's arguments.

use clap::Command;
use clap_complete::Shell;

/// Returns the file with which a shell completes the program's arguments.
pub fn completions(shell: Shell, command: &mut Command) -> Vec<u8> {
    let mut file = Vec::new();
    clap_complete::generate(shell, command, "bvh", &mut file);
    file
}

/// Returns the manual page of the program, followed by the pages of its commands, for `man -l -`.
pub fn manual(command: Command) -> std::io::Result<Vec<u8>> {
    let mut page = Vec::new();
    clap_mangen::Man::new(command.clone()).render(&mut page)?;
    // A hidden command is not documented anywhere.
    for part in command.get_subcommands().filter(|part| !part.is_hide_set()) {
        let name = format!("bvh {}", part.get_name());
        clap_mangen::Man::new(part.clone().display_name(name)).render(&mut page)?;
    }
    Ok(page)
}
