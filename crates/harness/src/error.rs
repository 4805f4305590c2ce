//! What can go wrong in the harness, and the exit code of each failure.

use bvh_core::file::FileError;
use bvh_scenes::render::StructureError;
use bvh_scenes::tree_file::TreeFileError;
use bvh_scenes::{ReadError, SceneError};
use bvh_search::SearchError;
use std::io;
use std::path::{Path, PathBuf};
use std::process::ExitStatus;

/// A failure, with the file or object it concerns.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "each message says what its fields are")]
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
    External { scene: String, method: String, command: String, source: CommandFault },
    /// Rays cannot be traced through this scene.
    #[error("scene {scene}, tracing: {message}")]
    Tracing { scene: String, message: String },
    /// What was left out as not needed has changed a cost: a defect of the method.
    #[error("scene {scene}: {message}; please report this")]
    Ablation { scene: String, message: String },
    /// A method returned something that is not a tree over the scene: a defect of the method.
    #[error(
        "scene {scene}, method {method} returned an invalid tree: {source}; please report this"
    )]
    InvalidTree { scene: String, method: String, source: bvh_core::InvalidBvh },
    /// A tree file that is damaged, or for another scene.
    #[error(transparent)]
    TreeFile(#[from] TreeFileError),
    /// A structure that a picture cannot be traced with.
    #[error(transparent)]
    Structure(#[from] StructureError),
    /// A figure could not be drawn.
    #[error(transparent)]
    Figure(#[from] figures::FigureError),
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
}

/// The failure of a program that is a method.
#[derive(Debug, thiserror::Error)]
pub enum CommandFault {
    /// There is no such program, or it may not be run.
    #[error("it cannot be started: {0}")]
    NotStarted(io::Error),
    /// It reports a failure, with the last line on standard error.
    #[error("{status}: {last_line}")]
    Failed {
        /// How it ended.
        status: ExitStatus,
        /// Its last words.
        last_line: String,
    },
    /// It ended without a tree.
    #[error("it left no file at the path that is its last argument")]
    NoTree,
    /// Its tree is damaged, or none over these boxes.
    #[error("its tree is refused: {0}")]
    Refused(#[from] FileError),
    /// It took too long.
    #[error("it did not end within {0} s")]
    TimedOut(f64),
    /// The run was interrupted, and so it was ended.
    #[error("it was interrupted")]
    Interrupted,
    /// Files could not be exchanged with it.
    #[error("the files that it is given cannot be written or read: {0}")]
    Exchange(#[from] io::Error),
}

impl Error {
    /// 2 for what the user can mend in a spec or a command line, 130 after Ctrl-C, otherwise 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Read(error) | Self::TreeFile(TreeFileError::Read(error))
                if !error.is_of_the_path() =>
            {
                1
            }
            Self::Read(_) => 2,
            Self::Spec { .. } | Self::Scene(_) | Self::Usage(_) | Self::TreeFile(_) => 2,
            Self::Interrupted { .. } => 130,
            _ => 1,
        }
    }

    /// For `map_err` on file operations: names the path and what was tried.
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

impl From<bvh_terminal::Error> for Error {
    fn from(error: bvh_terminal::Error) -> Self {
        match error {
            bvh_terminal::Error::Usage(message) => Self::Usage(message),
            bvh_terminal::Error::Io { path, action, source } => Self::Io { path, action, source },
        }
    }
}

impl From<bvh_terminal::files::WriteError> for Error {
    fn from(error: bvh_terminal::files::WriteError) -> Self {
        let bvh_terminal::files::WriteError { path, action, source } = error;
        Self::Io { path, action, source }
    }
}
