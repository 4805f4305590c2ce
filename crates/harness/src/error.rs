//! The failures of the harness and their exit codes.

use bvh_scenes::SceneError;
use bvh_scenes::files::{ReadError, WriteError};
use bvh_search::SearchError;
use std::io;
use std::path::{Path, PathBuf};

/// A failure, with the file or object it concerns.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "each message names its fields")]
pub enum Error {
    /// A spec that cannot be run: file, key, what was found, what would be accepted.
    #[error("{}: {message}", .file.display())]
    Spec { file: PathBuf, message: String },
    /// A scene that is neither built in, nor fetched, nor a readable mesh file.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// An input that could not be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A command line that asks for something contradictory.
    #[error("{0}")]
    Usage(String),
    /// A file or folder that could not be read or written.
    #[error("{}: cannot {action}: {source}", .path.display())]
    Io { path: PathBuf, action: &'static str, source: io::Error },
    /// A file that could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A CSV file that the harness cannot have written.
    #[error("{}: {source}", .path.display())]
    Csv { path: PathBuf, source: csv::Error },
    /// A TOML file in the results that the harness cannot have written.
    #[error("{}: {source}", .path.display())]
    Toml { path: PathBuf, source: toml::de::Error },
    /// Another harness is writing to the same folder.
    #[error("{} is in use by another harness; wait for it or choose another --out", .0.display())]
    Busy(PathBuf),
    /// A run failed.
    #[error("scene {scene}, method {method}: {source}")]
    Search { scene: String, method: String, source: Box<SearchError> },
    /// Another library or a program built no tree.
    #[error("scene {scene}, method {method}, {source}")]
    Library { scene: String, method: String, source: Box<dyn std::error::Error + Send + Sync> },
    /// Rays cannot be traced through this scene.
    #[error("scene {scene}, tracing: {message}")]
    Tracing { scene: String, message: String },
    /// A query of a report that the rows of a file cannot answer.
    #[error("{}: {message}; the runs are kept, --redraw makes the reports again", .path.display())]
    Query { path: PathBuf, message: String },
    /// A method returned something that is not a tree over the scene: a defect of the method.
    #[error(
        "scene {scene}, method {method} returned an invalid tree: {source}; please report this"
    )]
    InvalidTree { scene: String, method: String, source: bvh_core::InvalidBvh },
    /// A repetition has numbers that differ from the committed ones.
    #[error(
        "{differences} difference(s) from the committed results; \
         if they are intended, --force replaces the results, another --out keeps both"
    )]
    Differs { differences: usize },
    /// A file of a finished run that no longer matches its checksum.
    #[error("{} is damaged", .0.display())]
    Damaged(PathBuf),
    /// A file of a finished run with the name of another run.
    #[error("{} has the rows of {found}; accepted: those of {accepted}", .path.display())]
    OtherRun { path: PathBuf, found: String, accepted: String },
    /// Ctrl-C.
    #[error("interrupted; {}", kept(*finished, *runs))]
    Interrupted { finished: usize, runs: usize },
}

fn kept(finished: usize, runs: usize) -> String {
    match finished {
        0 => "no run is kept".into(),
        _ => format!("{finished} of {runs} runs are kept, `--resume` does the rest"),
    }
}

impl Error {
    /// Says after an interruption of a repetition that no run is kept, and places a failing report
    /// in the committed results, because the folder of the repetition is temporary.
    pub(crate) fn without_kept_runs(self, committed: &Path) -> Self {
        match self {
            Self::Query { path, message } => {
                let path = committed.join(path.file_name().unwrap_or_default());
                Self::Query { path, message }
            }
            Self::Interrupted { runs, .. } => Self::Interrupted { finished: 0, runs },
            error => error,
        }
    }

    /// Returns an error if there are differences from earlier results.
    pub(crate) fn differs(differences: usize) -> Result<(), Self> {
        if differences > 0 { Err(Self::Differs { differences }) } else { Ok(()) }
    }

    /// Returns 2 for mistakes in a spec or a command line, 130 after Ctrl-C, otherwise 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            // A wrong path is the user's mistake; a failing disk is not.
            Self::Read(error) if !error.is_of_the_path() => 1,
            Self::Read(_) | Self::Spec { .. } | Self::Scene(_) | Self::Usage(_) => 2,
            Self::Interrupted { .. } => 130,
            _ => 1,
        }
    }

    /// For `map_err` on file operations: names the path and the attempted action.
    pub fn io(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), action, source }
    }

    /// For `map_err` on builders and searches: names the scene and the method.
    pub fn search<E: Into<SearchError>>(scene: &str, method: &str) -> impl FnOnce(E) -> Self {
        let scene = scene.to_owned();
        let method = method.to_owned();
        move |source| Self::Search { scene, method, source: Box::new(source.into()) }
    }

    /// For `map_err` on TOML that a harness has written: names the path.
    pub fn toml(path: &Path) -> impl FnOnce(toml::de::Error) -> Self {
        move |source| Self::Toml { path: path.to_owned(), source }
    }

    /// For `map_err` on CSV operations: names the path.
    pub fn csv(path: &Path) -> impl FnOnce(csv::Error) -> Self {
        move |source| Self::Csv { path: path.to_owned(), source }
    }
}
