//! Writes to the terminal, and remembers whether that failed.

use std::borrow::Cow;
use std::io::{ErrorKind, Write};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Set as soon as something could not be written to standard output.
pub static STDOUT_FAILED: AtomicBool = AtomicBool::new(false);

/// Prints text to standard output, and ends the line. A reader that closes the pipe early, as `head` does, is no error,
/// because the results are in files.
pub fn print_line(text: &str) {
    print_bytes(format!("{}\n", plain(text.trim_end())).as_bytes());
}

/// As [`print_line`], for a file of ours that another program is to read.
pub fn print_bytes(bytes: &[u8]) {
    let mut out = std::io::stdout();
    let written = out.write_all(bytes).and_then(|()| out.flush());
    if written.is_err_and(|error| error.kind() != ErrorKind::BrokenPipe) {
        STDOUT_FAILED.store(true, Relaxed);
    }
}

/// Prints a line to standard error.
pub fn print_error(line: &str) {
    let _ = writeln!(std::io::stderr(), "{}", plain(line));
}

/// Returns the exit code of a command that did what it was asked for: a failure, and a message, if some of its output was lost.
pub fn succeeded() -> ExitCode {
    if STDOUT_FAILED.load(Relaxed) {
        print_error("error: some of the output could not be written to standard output");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}

/// Prints what arguments are answered with, help and version or what is wrong with them. Returns the exit code.
pub fn answered(answer: &clap::Error) -> ExitCode {
    const USAGE: u8 = 2;
    let text = answer.render().to_string();
    if answer.use_stderr() {
        print_error(text.trim_end());
        return ExitCode::from(USAGE);
    }
    print_bytes(text.as_bytes());
    succeeded()
}

/// The text with control characters spelled out, but for the ends of lines: names of files and keys of specs are the
/// user's, and must not command the terminal.
fn plain(text: &str) -> Cow<'_, str> {
    let commands = |c: char| c.is_control() && c != '\n';
    if !text.contains(commands) {
        return text.into();
    }
    let spelled =
        |c: char| if commands(c) { c.escape_default().to_string() } else { c.to_string() };
    text.chars()
        .map(spelled)
        .collect::<String>()
        .into()
}

#[cfg(test)]
mod tests {
    #[test]
    fn control_characters_are_spelled_out() {
        assert_eq!(super::plain("key \u{1b}[2J\nis 1"), "key \\u{1b}[2J\nis 1");
        assert_eq!(super::plain("Müller–Fellner\n"), "Müller–Fellner\n");
    }
}
