//! The failures of the commands, and the exit code of each.

use bvh_core::DensityError;
use bvh_scenes::SceneError;
use bvh_scenes::files::{ReadError, WriteError};
use bvh_scenes::tree_file::TreeFileError;
use bvh_search::SearchError;

/// A failure, with its file or object.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "each message describes its fields")]
pub enum Error {
    /// The scene is neither built in, nor fetched, nor a readable mesh file.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The command line has an invalid value or contradicts itself.
    #[error("{0}")]
    Usage(String),
    /// An input cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file or folder cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A search failed.
    #[error("scene {scene}, method {method}: {source}")]
    Search { scene: String, method: String, source: Box<SearchError> },
    /// Rays cannot be traced through this scene.
    #[error("scene {scene}, tracing: {source}")]
    Tracing { scene: String, source: DensityError },
    /// A tree file is damaged or belongs to a different scene.
    #[error(transparent)]
    TreeFile(#[from] TreeFileError),
    /// Ctrl-C ended the command, which left this on the disk.
    #[error("interrupted; {0}")]
    Interrupted(String),
}

impl Error {
    /// Returns 2 for faults of the command line or its inputs, 130 after Ctrl-C, otherwise 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Scene(_) | Self::Usage(_) => 2,
            // A wrong path is a fault of the command line, a failing disk is not.
            Self::Read(error) | Self::TreeFile(TreeFileError::Read(error)) => {
                if error.is_of_the_path() { 2 } else { 1 }
            }
            Self::TreeFile(_) => 2,
            Self::Interrupted(_) => 130,
            Self::Write(_) | Self::Search { .. } | Self::Tracing { .. } => 1,
        }
    }

    /// Returns a function for `map_err` on builders and searches that names the scene and the
    /// method.
    pub fn search<E: Into<SearchError>>(scene: &str, method: &str) -> impl FnOnce(E) -> Self {
        let scene = scene.to_owned();
        let method = method.to_owned();
        move |source| Self::Search { scene, method, source: Box::new(source.into()) }
    }
}
