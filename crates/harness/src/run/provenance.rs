//! The origin of results: revision, compiler, processor, threads, date. It has a separate file, as
//! it is not reproducible.

use crate::peers;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::time::SystemTime;

/// Git revision of the program's sources, with `+` if they had uncommitted changes, or `unknown`.
pub const REVISION: &str = env!("HARNESS_REVISION");

/// Contents of `provenance.toml`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Provenance {
    /// The command line without the program's path.
    pub command: String,
    /// [`REVISION`].
    pub revision: String,
    /// Version of this program.
    pub version: String,
    /// The compiler that built it.
    pub rustc: String,
    /// The harness's profile (in the dev profile the libraries have a higher opt-level), the target
    /// features that the compiler could assume, debug assertions, and whether the program contains
    /// third-party libraries.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub build: String,
    /// Models of the processors that performed runs, and their architecture.
    pub cpu: String,
    /// Threads used.
    pub threads: usize,
    /// The time at which the results were completed, UTC.
    pub date: String,
}

impl Provenance {
    /// Collects the provenance of results that are completed now, whose runs these processors
    /// performed.
    pub fn gather(processors: BTreeSet<String>) -> Self {
        let on = |is_on| if is_on { "on" } else { "off" };
        // The program's path would reveal folders of the machine.
        let mut command = "harness".to_owned();
        for argument in std::env::args_os().skip(1) {
            // Arguments need not be UTF-8.
            command += &format!(" {}", argument.to_string_lossy());
        }
        Self {
            command,
            revision: REVISION.into(),
            version: env!("CARGO_PKG_VERSION").into(),
            rustc: env!("HARNESS_RUSTC").into(),
            build: format!(
                "{}, debug assertions {}, peers {}",
                env!("HARNESS_BUILD"),
                on(cfg!(debug_assertions)),
                on(peers::has_others())
            ),
            cpu: format!("{}, {}", Vec::from_iter(processors).join("; "), std::env::consts::ARCH),
            threads: rayon::current_num_threads(),
            date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
        }
    }
}
