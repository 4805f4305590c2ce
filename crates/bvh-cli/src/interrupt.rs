//! Ctrl-C and SIGTERM. They end a command at once, or in order if it has a result to save.

use crate::output::print_error;
use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// True after the first signal.
pub static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// True from the moment from which the command soon has a result to save.
static HELD: AtomicBool = AtomicBool::new(false);

const CODE: i32 = 130;

/// Begins to listen to signals. While a command is held, the first one lets it end in order, and
/// the second one ends it at once.
pub fn listen() {
    let handler = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Relaxed) || !HELD.load(Relaxed) {
            print_error("error: interrupted");
            exit(CODE);
        }
    });
    if let Err(error) = handler {
        print_error(&format!("warning: Ctrl-C will end the program at once: {error}"));
    }
}

/// Lets the command end in order after a signal, because from here on there is a tree soon, which
/// the command must save.
pub fn hold() {
    HELD.store(true, Relaxed);
}

/// Returns whether the command must end in order.
pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Relaxed)
}
