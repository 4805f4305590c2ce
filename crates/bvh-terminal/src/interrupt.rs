//! Ctrl-C and SIGTERM: the first one ends a command in order, soon; the second one at once.

use crate::output::print_error;
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

/// Begins to listen to signals. Prints `message` where the first one ends the program by force.
pub fn listen(message: &'static str) {
    let handler = ctrlc::set_handler(move || {
        if INTERRUPTED.swap(true, Relaxed) {
            exit(CODE.into());
        }
        std::thread::spawn(move || {
            std::thread::sleep(GRACE);
            if !HELD.load(Relaxed) {
                print_error(message);
                exit(CODE.into());
            }
        });
    });
    if let Err(error) = handler {
        print_error(&format!("warning: Ctrl-C will end the program at once: {error}"));
    }
}

/// Returns whether the command must be waited for.
pub fn holds() -> bool {
    HELD.load(Relaxed)
}

/// From now on the first signal never ends the program by force, because its result is kept at the end.
pub fn hold() {
    HELD.store(true, Relaxed);
}
