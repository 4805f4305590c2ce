//! Where results come from: revision, compiler, processor, threads, date. In a file apart from the reproducible ones.

use crate::processor::PROCESSOR;
use serde::{Deserialize, Serialize};
use std::time::SystemTime;

/// Contents of `provenance.toml`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Provenance {
    /// The command line, the program's own path left out.
    pub command: String,
    /// Git revision of the sources that the program was built from, `+` when they had uncommitted changes, or `unknown`.
    pub revision: String,
    /// Version of this program.
    pub version: String,
    /// The compiler that built it.
    pub rustc: String,
    /// The harness's own profile (in the dev profile the libraries have a higher opt-level), the target features that the compiler
    /// could take for granted, debug assertions, and whether other libraries are compiled in.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub build: String,
    /// Processor model and architecture.
    pub cpu: String,
    /// Threads used.
    pub threads: usize,
    /// When the results were completed, UTC.
    pub date: String,
    /// The provenance of every part, if the results are merged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Provenance>,
}

impl Provenance {
    /// Gathers everything now.
    pub fn gather() -> Self {
        Self {
            // Arguments need not be UTF-8.
            command: std::iter::once("harness".into())
                .chain(
                    std::env::args_os()
                        .skip(1)
                        .map(|argument| argument.to_string_lossy().into_owned()),
                )
                .collect::<Vec<_>>()
                .join(" "),
            revision: env!("HARNESS_REVISION").into(),
            version: env!("CARGO_PKG_VERSION").into(),
            rustc: env!("HARNESS_RUSTC").into(),
            build: format!(
                "{}, debug assertions {}, peers {}",
                env!("HARNESS_BUILD"),
                on(cfg!(debug_assertions)),
                on(cfg!(feature = "peers"))
            ),
            cpu: format!("{}, {}", PROCESSOR.name(), std::env::consts::ARCH),
            threads: rayon::current_num_threads(),
            date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            parts: vec![],
        }
    }
}

fn on(set: bool) -> &'static str {
    if set { "on" } else { "off" }
}
