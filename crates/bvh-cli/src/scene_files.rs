//! What the files of scenes may refer to.

use bvh_scenes::load::OutsideFiles;
use bvh_scenes::{Scene, SceneError};

/// What the files of scenes may refer to.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct SceneFiles {
    /// Let a glTF file name buffers outside its own folder. Whoever made the file then says which files are read.
    #[arg(long)]
    pub outside_files: bool,
}

impl SceneFiles {
    /// Loads a scene by name or path.
    pub fn load(self, name: &str) -> Result<Scene, SceneError> {
        Scene::load_with(name, self.outside())
    }

    /// Whether such buffers are read.
    pub fn outside(self) -> OutsideFiles {
        self.outside_files.into()
    }
}
