//! The acceleration structures of pictures, by name.

use crate::trace::{Structure, kd_tree};
use crate::tree_file::{self, TreeFileError};
use crate::{NoTriangles, Scene};
use bvh_build::{BuildError, Builder, muller_fellner};
use bvh_core::{Bvh, InvalidBvh, WideBvh};
use std::borrow::Cow;
use std::path::Path;

/// The names that [`by_name`] accepts.
pub const ACCEPTED: &str = "brute, kdtree, bvh, wide, or the path of a .bvh file";

/// The reason why a scene has no structure of a name.
#[derive(Debug, thiserror::Error)]
pub enum StructureError {
    /// No structure has this name.
    #[error("--accel is {0:?}; accepted: {ACCEPTED}")]
    Unknown(String),
    /// The wide layout contains triangles only.
    #[error("--accel wide: {0}, or --accel brute, kdtree, bvh")]
    Spheres(NoTriangles),
    /// The tree cannot be built over the scene.
    #[error("scene {scene}, method {name}: {source}")]
    Build {
        /// The scene.
        scene: String,
        /// The structure.
        name: String,
        /// The builder's reason.
        source: BuildError,
    },
    /// The tree has no wide layout, which is a defect of the builder.
    #[error("scene {scene}, method {name} returned an invalid tree: {source}; please report this")]
    Layout {
        /// The scene.
        scene: String,
        /// The structure.
        name: String,
        /// The fault of the tree.
        source: InvalidBvh,
    },
    /// The file contains no tree over the scene.
    #[error(transparent)]
    File(#[from] TreeFileError),
}

/// Builds the structure that `--accel` names over the scene. Trees are built by greedy
/// Müller–Fellner division.
pub fn by_name(name: &str, scene: &Scene) -> Result<Structure<'static>, StructureError> {
    match name {
        "brute" => Ok(Structure::Brute),
        "kdtree" => {
            let tree = kd_tree::Config::default().build(&scene.boxes);
            tree.map(Structure::KdTree).map_err(|source| build_error(scene, name, source))
        }
        "bvh" => {
            let tree = greedy(scene).map_err(|source| build_error(scene, name, source))?;
            Ok(Structure::Tree(Cow::Owned(tree)))
        }
        "wide" => {
            let triangles = scene.triangles().map_err(StructureError::Spheres)?;
            let tree = greedy(scene).map_err(|source| build_error(scene, name, source))?;
            let layout = WideBvh::new(&tree, triangles);
            layout.map(Structure::Wide).map_err(|source| StructureError::Layout {
                scene: scene.name.clone(),
                name: name.into(),
                source,
            })
        }
        _ if name.ends_with(".bvh") => {
            let (tree, _) = tree_file::load(Path::new(name), scene)?;
            Ok(Structure::Tree(Cow::Owned(tree)))
        }
        _ => Err(StructureError::Unknown(name.into())),
    }
}

fn build_error(scene: &Scene, name: &str, source: BuildError) -> StructureError {
    StructureError::Build { scene: scene.name.clone(), name: name.into(), source }
}

fn greedy(scene: &Scene) -> Result<Bvh, BuildError> {
    muller_fellner::Config::default().build(&scene.boxes)
}
