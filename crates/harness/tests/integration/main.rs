//! The harness, run as users run it, and the documents and results of the repository.

mod archive;
mod circles;
mod command_line;
mod examples;
#[cfg(unix)]
mod external;
mod faults;
mod merge;
mod paper;
mod protection;
mod release;
#[path = "../support/mod.rs"]
mod support;
mod wrong_values;
