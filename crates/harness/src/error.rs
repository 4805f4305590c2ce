//! What can go wrong in the harness, and the exit code of each failure.

use crate::peers::command;
use bvh_search::SearchError;
use std::io;
use std::path::{Path, PathBuf};

/// A failure, with the file or object it concerns.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "each message says what its fields are")]
pub enum Error {
    /// A spec that cannot be run: file, key, what was found, what would be accepted.
    #[error("{}: {message}", .file.display())]
    Spec { file: PathBuf, message: String },
    /// A scene that is neither built in, nor fetched, nor a readable mesh file.
    #[error("scene {name}: {message}")]
    Scene { name: String, message: String },
    /// A command line that asks for something contradictory.
    #[error("{0}")]
    Usage(String),
    /// A file or folder that could not be read or written.
    #[error("{}: cannot {action}: {source}", .path.display())]
    Io { path: PathBuf, action: &'static str, source: io::Error },
    /// A CSV file whose content is not what the harness writes.
    #[error("{}: {source}", .path.display())]
    Csv { path: PathBuf, source: csv::Error },
    /// A TOML file among the results whose content is not what the harness writes.
    #[error("{}: {source}", .path.display())]
    Toml { path: PathBuf, source: toml::de::Error },
    /// Another harness is writing to the same folder.
    #[error("{} is in use by another harness; wait for it or choose another --out", .0.display())]
    Busy(PathBuf),
    /// A run failed.
    #[error("scene {scene}, method {method}: {source}")]
    Search { scene: String, method: String, source: Box<SearchError> },
    /// Another library refused a scene.
    #[error("scene {scene}, library {library}: {message}")]
    Library { scene: String, library: &'static str, message: String },
    /// An external program did not do its part.
    #[error("scene {scene}, method {method}, command `{command}`: {source}")]
    External { scene: String, method: String, command: String, source: command::Fault },
    /// Rays cannot be traced through this scene.
    #[error("scene {scene}, tracing: {message}")]
    Tracing { scene: String, message: String },
    /// What was left out as not needed has changed a cost: a defect of the method.
    #[error("scene {scene}: {message}; please report this")]
    Ablation { scene: String, message: String },
    /// A method returned something that is not a tree over the scene: a defect of the method.
    #[error("scene {scene}, method {method} returned an invalid tree: {source}; please report this")]
    InvalidTree { scene: String, method: String, source: bvh_core::InvalidBvh },
    /// A tree file that is damaged, or for another scene.
    #[error("{}: {source}", .path.display())]
    TreeFile { path: PathBuf, source: bvh_core::file::FileError },
    /// A figure could not be drawn.
    #[error(transparent)]
    Figure(#[from] crate::figures::FigureError),
    /// `--check` found other numbers than the committed ones.
    #[error(
        "{differences} difference(s) from the committed results; if they are meant, run again without --check"
    )]
    Differs { differences: usize },
    /// A finished run whose files are not what was written.
    #[error("{}: {file} is damaged or missing", .part.display())]
    Damaged { part: PathBuf, file: String },
    /// Parts of an experiment that cannot be joined.
    #[error("{experiment}: {message}")]
    Merge { experiment: String, message: String },
    /// Ctrl-C.
    #[error("interrupted; {finished} of {runs} runs are kept, `--resume` does the rest")]
    Interrupted { finished: usize, runs: usize },
    /// Ctrl-C during a picture.
    #[error("interrupted; no picture was written")]
    Abandoned,
    /// Ctrl-C during a bake.
    #[error("interrupted; the best tree so far, of cost {cost}, is in {0}; `--from {0}` goes on", .path.display())]
    Stopped { path: PathBuf, cost: f64 },
    /// Ctrl-C during a bake of instances.
    #[error("interrupted; the best trees so far, of all meshes and over the instances, are in {}", .path.display())]
    StoppedInstances { path: PathBuf },
}

impl Error {
    /// 2 for what the user can mend in a spec or a command line, 130 after Ctrl-C, otherwise 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Spec { .. } | Self::Scene { .. } | Self::Usage(_) | Self::TreeFile { .. } => 2,
            Self::Interrupted { .. }
            | Self::Stopped { .. }
            | Self::StoppedInstances { .. }
            | Self::Abandoned => 130,
            _ => 1,
        }
    }

    /// For `map_err` on file operations: names the path and what was tried.
    pub fn io(path: &Path, action: &'static str) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { path: path.to_owned(), action, source }
    }

    /// For `map_err` on builders and searches: names the scene and the method.
    pub fn search<E: Into<SearchError>>(scene: &str, method: &str) -> impl FnOnce(E) -> Self {
        let (scene, method) = (scene.to_owned(), method.to_owned());
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
