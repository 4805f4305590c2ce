//! Ctrl-C and SIGTERM. They end a command at once, or in order once it has a result to save.

use crate::output::print_error;
use std::process::exit;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// True after the first signal to a command that has a result to save.
pub static INTERRUPTED: AtomicBool = AtomicBool::new(false);

static LISTENS: Once = Once::new();

const CODE: i32 = 130;

/// Lets the first signal end the command in order, because from here on there is a tree soon, which
/// the command must save. The second signal ends it at once.
pub fn hold() {
    LISTENS.call_once(|| {
        let handler = ctrlc::set_handler(|| {
            if INTERRUPTED.swap(true, Relaxed) {
                print_error("error: interrupted");
                exit(CODE);
            }
        });
        if let Err(error) = handler {
            print_error(&format!("warning: Ctrl-C will end the program at once: {error}"));
        }
    });
}

/// Returns whether the command must end in order.
pub fn is_interrupted() -> bool {
    INTERRUPTED.load(Relaxed)
}
