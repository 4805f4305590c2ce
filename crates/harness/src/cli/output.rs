//! Writes to the terminal, and remembers whether that failed.

use std::io::{ErrorKind, Write};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// Set as soon as something could not be written to standard output.
pub static STDOUT_FAILED: AtomicBool = AtomicBool::new(false);

/// Prints text to standard output, and ends the line. A reader that closes the pipe early, as `head` does, is no error,
/// because the results are in files.
pub fn print_line(text: &str) {
    let mut out = std::io::stdout();
    let written = writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush());
    if written.is_err_and(|error| error.kind() != ErrorKind::BrokenPipe) {
        STDOUT_FAILED.store(true, Relaxed);
    }
}

/// Prints a line to standard error.
pub fn print_error(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}
