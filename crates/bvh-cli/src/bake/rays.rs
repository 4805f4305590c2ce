//! The rays of `bake --rays`: a renderer's, or any through the scene, and their density.

use crate::Error;
use bvh_config::fault;
use bvh_core::{Bvh, RayDensity};
use bvh_scenes::rays::{RenderedRays, TRAINED, density, of_anything, of_renderer};
use bvh_scenes::{Scene, read_text};
use bvh_terminal::arguments::input_file;
use std::path::Path;

/// The rays that a tree is baked for.
#[derive(Clone)]
pub enum Rays {
    /// Any, without a camera.
    Default,
    /// A renderer's.
    Rendered(RenderedRays),
}

impl Rays {
    /// `default`, or the file of this name.
    pub fn read(named: &str) -> Result<Self, Error> {
        if named == "default" {
            return Ok(Self::Default);
        }
        let path = Path::new(named);
        input_file("--rays", path)?;
        let text = read_text(path)?;
        fault::parse(&text, &path.to_string_lossy())
            .map(Self::Rendered)
            .map_err(|message| Error::Rays { file: path.to_owned(), message })
    }

    /// Their density in a scene, of which `tree` is any tree.
    pub fn density(&self, scene: &Scene, tree: &Bvh, seed: u64) -> Result<RayDensity, Error> {
        let rays = match self {
            Self::Default => of_anything(TRAINED, scene, tree, seed),
            Self::Rendered(config) => of_renderer(config, scene, tree),
        };
        density(&rays, tree).map_err(|source| Error::Tracing { scene: scene.name.clone(), source })
    }
}
