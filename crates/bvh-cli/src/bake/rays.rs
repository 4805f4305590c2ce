//! The rays of `bake --rays`, from a renderer or any through the scene, and their density.

use crate::Error;
use bvh_config::fault;
use bvh_core::{Bvh, RayDensity};
use bvh_scenes::rays::{RenderedRays, TRAINED, density, of_anything, of_renderer};
use bvh_scenes::{Scene, read_text};
use bvh_terminal::arguments::input_file;
use std::path::Path;

/// The rays that train a tree.
#[derive(Clone)]
pub enum Rays {
    /// Rays that need no camera.
    Default,
    /// The rays of a renderer.
    Rendered(RenderedRays),
}

impl Rays {
    /// Returns the rays named `default`, or reads the file with this name.
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

    /// Returns the rays' density in a scene; `tree` is any valid tree over the scene.
    pub fn density(&self, scene: &Scene, tree: &Bvh, seed: u64) -> Result<RayDensity, Error> {
        let rays = match self {
            Self::Default => of_anything(TRAINED, scene, tree, seed),
            Self::Rendered(config) => of_renderer(config, scene, tree),
        };
        density(&rays, tree).map_err(|source| Error::Tracing { scene: scene.name.clone(), source })
    }
}
