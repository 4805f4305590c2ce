//! Ctrl-C and SIGTERM: the first one ends a command in order, soon; the second one at once.

use crate::cli::output::print_error;
use bvh_search::Observer;
use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// Set by the first signal.
pub static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Set while what was found so far is not on the disk yet, so that the command must be waited for.
static HELD: AtomicBool = AtomicBool::new(false);

/// The exit code after a signal.
const CODE: u8 = 130;

/// How long a command has to end in order. After that it is ended: at no moment does this damage a file or lose a
/// finished run.
const GRACE: Duration = Duration::from_millis(800);

/// Begins to listen to signals.
pub fn listen() {
    let handler = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Relaxed) {
            exit(CODE.into());
        }
        std::thread::spawn(|| {
            std::thread::sleep(GRACE);
            if !HELD.load(Relaxed) {
                print_error("error: interrupted; finished runs are kept, and `--resume` does the rest");
                exit(CODE.into());
            }
        });
    });
    if let Err(error) = handler {
        print_error(&format!("warning: Ctrl-C will end the program at once: {error}"));
    }
}

/// Cancels a search once it is set.
pub struct Interrupted<'a>(pub &'a AtomicBool);

impl Observer for Interrupted<'_> {
    fn cancelled(&self) -> bool {
        self.0.load(Relaxed)
    }
}

/// From now on the first signal never ends the program by force, because its result is kept at the end.
pub fn hold() {
    HELD.store(true, Relaxed);
}
