//! The rays of `bake --rays`: a renderer's, or any through the scene, and their density.

use crate::Error;
use crate::cli::arguments::input_file;
use crate::measure::ray_cost;
use crate::measure::segments::{RenderedRays, of_anything, of_renderer};
use crate::scenes::Scene;
use crate::spec::configuration;
use bvh_core::{Bvh, RayDensity};
use std::path::Path;

/// The rays that a tree is baked for.
pub(super) enum Rays {
    /// Any, without a camera.
    Default,
    /// A renderer's.
    Rendered(RenderedRays),
}

impl Rays {
    /// `default`, or the file of this name.
    pub(super) fn read(named: &str) -> Result<Self, Error> {
        if named == "default" {
            return Ok(Self::Default);
        }
        let path = Path::new(named);
        input_file("--rays", path)?;
        configuration(path).map(Self::Rendered)
    }

    /// Their density in a scene, of which `tree` is any tree.
    pub(super) fn density(&self, scene: &Scene, tree: &Bvh, seed: u64) -> Result<RayDensity, Error> {
        let rays = match self {
            Self::Default => of_anything(ray_cost::Config::default().trained, scene, tree, seed),
            Self::Rendered(config) => of_renderer(config, scene, tree),
        };
        let density = ray_cost::density(&rays, tree);
        density.map_err(|error| Error::Tracing { scene: scene.name.clone(), message: error.to_string() })
    }
}
