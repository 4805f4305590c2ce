//! The origin of results: revision, compiler, processor, threads, date. It has a separate file, as
//! it is not reproducible.

use super::resolved::{read_toml, to_toml};
use crate::Error;
use crate::files;
use crate::peers;
use crate::processor::PROCESSOR;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Contents of `provenance.toml`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Provenance {
    /// The command line without the program's path.
    pub command: String,
    /// Git revision of the program's sources, with `+` if they had uncommitted changes, or
    /// `unknown`.
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
    /// Processor model and architecture.
    pub cpu: String,
    /// Threads used.
    pub threads: usize,
    /// The time at which the results were completed, UTC.
    pub date: String,
    /// The provenance of every part, if the results are merged; of a part, earlier processes on
    /// other processors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub parts: Vec<Provenance>,
}

impl Provenance {
    /// Collects the provenance of results that are completed now.
    pub fn gather() -> Self {
        // The program's path would reveal folders of the machine.
        let mut command = "harness".to_owned();
        for argument in std::env::args_os().skip(1) {
            // Arguments need not be UTF-8.
            command += &format!(" {}", argument.to_string_lossy());
        }
        Self {
            command,
            revision: env!("HARNESS_REVISION").into(),
            version: env!("CARGO_PKG_VERSION").into(),
            rustc: env!("HARNESS_RUSTC").into(),
            build: format!(
                "{}, debug assertions {}, peers {}",
                env!("HARNESS_BUILD"),
                on(cfg!(debug_assertions)),
                on(peers::has_others())
            ),
            cpu: format!("{}, {}", PROCESSOR.name(), std::env::consts::ARCH),
            threads: rayon::current_num_threads(),
            date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
            parts: vec![],
        }
    }

    /// Records in the file of a part that this process adds runs to it.
    pub fn add_to_part(folder: &Path) -> Result<(), Error> {
        let mut provenance = Self::gather();
        if let Some(mut earlier) = Self::of_part(folder)? {
            provenance.parts = std::mem::take(&mut earlier.parts);
            provenance.parts.push(earlier);
            provenance.parts.retain(|part| part.cpu != provenance.cpu);
        }
        files::write(&file_of_part(folder), to_toml(&provenance)?.as_bytes())?;
        Ok(())
    }

    /// Reads the file of a part, if there is one.
    pub fn of_part(folder: &Path) -> Result<Option<Self>, Error> {
        let path = file_of_part(folder);
        if path.is_file() { read_toml(&path).map(Some) } else { Ok(None) }
    }

    /// Returns a remark if the seconds of the parts come from processors of several models.
    pub fn unlike_processors(&self) -> Option<String> {
        let parts = self.parts.iter().flat_map(|part| part.parts.iter().chain([part]));
        let processors: BTreeSet<&str> = parts.map(|part| part.cpu.as_str()).collect();
        let names = Vec::from_iter(processors).join("; ");
        names.contains("; ").then(|| format!("the seconds come from unlike processors: {names}"))
    }
}

/// The file of a part: on which machines its runs were performed.
fn file_of_part(folder: &Path) -> PathBuf {
    folder.join(".partial/provenance.toml")
}

fn on(set: bool) -> &'static str {
    if set { "on" } else { "off" }
}
