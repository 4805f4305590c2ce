//! The failures of the commands, and the exit code of each.

use bvh_core::DensityError;
use bvh_scenes::SceneError;
use bvh_scenes::files::{ReadError, WriteError};
use bvh_scenes::tree_file::TreeFileError;
use bvh_search::SearchError;

/// A failure, with its file or object.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("{0}")]
    Usage(String),
    #[error(transparent)]
    Read(#[from] ReadError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("scene {scene}, method {method}: {source}")]
    Search { scene: String, method: String, source: Box<SearchError> },
    #[error("scene {scene}, tracing: {source}")]
    Tracing { scene: String, source: DensityError },
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
