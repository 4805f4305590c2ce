//! Ctrl-C and SIGTERM. The first signal lets a command end in order; the second ends it at once.

use crate::output::print_error;
use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::Duration;

/// True after the first signal.
pub static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// True while the result is not on the disk yet, so that the command must not be ended by force.
static HELD: AtomicBool = AtomicBool::new(false);

const CODE: u8 = 130;

/// The time that a command has to end in order. The end by force after that time damages no file
/// and loses no finished run.
const GRACE: Duration = Duration::from_millis(800);

/// Begins to listen to signals.
pub fn listen() {
    let handler = ctrlc::set_handler(move || {
        if INTERRUPTED.swap(true, Relaxed) {
            exit(CODE.into());
        }
        // The handler must return at once, so that a second signal is heard.
        std::thread::spawn(move || {
            std::thread::sleep(GRACE);
            if !HELD.load(Relaxed) {
                print_error("error: interrupted");
                exit(CODE.into());
            }
        });
    });
    if let Err(error) = handler {
        print_error(&format!("warning: Ctrl-C will end the program at once: {error}"));
    }
}

/// Forbids the end by force after the first signal, because the command saves its result at the
/// end.
pub fn hold() {
    HELD.store(true, Relaxed);
}
