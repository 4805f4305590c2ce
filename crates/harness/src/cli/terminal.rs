//! The terminal: lines, Ctrl-C, and arguments that several commands share.

use crate::Error;
use std::io::{ErrorKind, Write, stdout};
use std::path::Path;
use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The exit code after Ctrl-C.
const INTERRUPTED_CODE: i32 = 130;

/// True after the first Ctrl-C or SIGTERM.
pub static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Begins to listen to signals. The first one lets a command end in order, the second ends it at
/// once, which loses no finished run.
pub fn listen() {
    let handler = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Relaxed) {
            exit(INTERRUPTED_CODE);
        }
    });
    if let Err(error) = handler {
        print_error(&format!("warning: Ctrl-C will end the program at once: {error}"));
    }
}

/// Prints text to standard output, and ends the line. Ends the program if that fails, unless the
/// reader has closed the pipe early, like `head`: results are in files.
pub fn print_line(text: &str) {
    let mut out = stdout().lock();
    let written = writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush());
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        print_error(&format!("error: the output could not be written to standard output: {error}"));
        exit(1);
    }
}

/// Prints a line to standard error.
pub fn print_error(line: &str) {
    // Without standard error there is no place to report the failure.
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// The limit on the program's threads.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct Threads {
    /// Number of threads; the default is one per processor. It changes only times, and the results
    /// of budgets of time.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub jobs: Option<u16>,
}

impl Threads {
    /// Limits the program to this number of threads. Call it once.
    pub fn apply(self) -> Result<(), Error> {
        // By default rayon starts one thread per processor when it is first used.
        let Some(jobs) = self.jobs else { return Ok(()) };
        rayon::ThreadPoolBuilder::new()
            .num_threads(jobs.into())
            .build_global()
            .map_err(|error| Error::Usage(format!("--jobs {jobs}: {error}")))
    }
}

/// Checks the path of a folder to write into: an existing folder, or one that can be created
/// because no part of its path is a file.
pub fn output_folder(flag: &str, path: &Path) -> Result<(), Error> {
    // The nearest existing ancestor decides whether the other folders can be created.
    match path.ancestors().find(|above| above.exists()) {
        _ if path.as_os_str().is_empty() => reject(flag, path, "empty; accepted: a folder"),
        Some(above) if !above.is_dir() => reject(flag, above, "a file; accepted: a folder"),
        _ => Ok(()),
    }
}

/// Checks the path of a folder to read.
pub fn input_folder(flag: &str, path: &Path) -> Result<(), Error> {
    match path.is_dir() {
        true => Ok(()),
        false => reject(flag, path, "no folder; accepted: a folder that is there"),
    }
}

fn reject(flag: &str, path: &Path, fault: &str) -> Result<(), Error> {
    Err(Error::Usage(format!("{flag}: {} is {fault}", path.display())))
}
