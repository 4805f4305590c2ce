//! The arguments about files that a scene's file refers to.

use crate::output::print_error;
use bvh_scenes::load::OutsideFiles;
use bvh_scenes::{Scene, SceneError};

/// The permission to read files outside a scene's folder.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct SceneFiles {
    /// Let a glTF file name buffers outside its own folder. The author of the file then decides
    /// which files are read.
    #[arg(long)]
    pub outside_files: bool,
}

impl SceneFiles {
    /// Loads a scene by name or path, and prints the remark on it, if it has one.
    pub fn load(self, name: &str) -> Result<Scene, SceneError> {
        let scene = Scene::load_with(name, self.outside())?;
        if let Some(remark) = &scene.remark {
            print_error(remark);
        }
        Ok(scene)
    }

    /// Returns the permission to read buffers outside the scene's folder.
    pub fn outside(self) -> OutsideFiles {
        self.outside_files.into()
    }
}
