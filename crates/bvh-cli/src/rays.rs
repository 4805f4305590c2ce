//! The rays of `--rays`, from a file, from a renderer or any through the scene, and their density.

use crate::arguments::input_file;
use crate::interrupt::INTERRUPTED;
use crate::{Error, recorded};
use bvh_config::fault;
use bvh_core::cost::Objective;
use bvh_core::query::Region;
use bvh_core::{Aabb, Bvh, Ray, RayDensity, Segment, Slabs};
use bvh_scenes::Scene;
use bvh_scenes::files::{read, read_text};
use bvh_scenes::rays::{RenderedRays, TRAINED, density, of_anything, of_renderer};
use bvh_search::ray_density;
use glam::Vec3;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The rays that train a tree.
#[derive(Clone)]
pub enum Rays {
    /// Rays that need no camera.
    Default,
    /// The rays of a renderer.
    Rendered(RenderedRays),
    /// The segments of a file.
    Recorded(Vec<Segment>),
}

impl Rays {
    /// The name of [`Rays::Default`].
    pub const DEFAULT: &str = "default";
    /// The seed of rays that judge trees. A bake trains on other rays, unless its `--seed` is this
    /// number.
    pub const JUDGING: u64 = u64::MAX;

    /// Returns the rays named `default`, or reads the file with this name.
    pub fn read(named: &str) -> Result<Self, Error> {
        if named == Self::DEFAULT {
            return Ok(Self::Default);
        }
        let path = Path::new(named);
        input_file("--rays", path)?;
        let extension = path.extension().and_then(|extension| extension.to_str());
        let invalid = |message| Error::Rays { file: path.to_owned(), message };
        match extension {
            Some("toml") => fault::parse(&read_text(path)?).map(Self::Rendered).map_err(invalid),
            Some(format @ ("csv" | "bin")) => {
                recorded::read(format, &read(path)?).map(Self::Recorded).map_err(invalid)
            }
            _ => Err(invalid("--rays accepts files that end with .toml, .csv or .bin".into())),
        }
    }

    /// Rejects recorded rays of the file `named` if no ray meets the scene. The search could not
    /// find that out: it adds rays from anywhere in the scene.
    pub fn check(&self, named: &str, scene: &Scene) -> Result<(), Error> {
        let Self::Recorded(segments) = self else { return Ok(()) };
        let bounds = Aabb::union_of(&scene.boxes);
        let meets = |&Segment { from, to }: &Segment| {
            let from = Vec3::from(from);
            let ray = Ray::new(from, Vec3::from(to) - from, 0.0, 1.0);
            from.may_meet(&bounds)
                || ray.is_ok_and(|ray| Slabs::new(&ray, &bounds).entry(&bounds) <= 1.0)
        };
        // A search rejects a scene without objects, with a better message.
        if scene.boxes.is_empty() || segments.iter().any(meets) {
            return Ok(());
        }
        let message = format!(
            "none of the {} segments meets the box of scene {}, {} to {}; accepted: one or more \
             segments that do",
            segments.len(),
            scene.name,
            bounds.min,
            bounds.max
        );
        Err(Error::Rays { file: PathBuf::from(named), message })
    }

    /// Returns the rays' density in a scene, or `None` soon after `interrupted` becomes true;
    /// `tree` is any valid tree over the scene.
    pub fn density(
        &self,
        scene: &Scene,
        tree: &Bvh,
        seed: u64,
        interrupted: &AtomicBool,
    ) -> Result<Option<RayDensity>, Error> {
        let is_over = || interrupted.load(Relaxed);
        let density = match self {
            Self::Default => {
                let rays = of_anything(TRAINED, scene, tree, seed, &is_over);
                density(&rays, tree).map(Some)
            }
            Self::Rendered(config) => {
                let rays = of_renderer(config, scene, tree, &is_over);
                density(&rays, tree).map(Some)
            }
            Self::Recorded(segments) => {
                ray_density(tree, Some(&scene.primitives), segments, &is_over)
            }
        };
        // After an interruption some rays are missing, or all of them, which is an error otherwise.
        if is_over() {
            return Ok(None);
        }
        density.map_err(|source| Error::Tracing { scene: scene.name.clone(), source })
    }

    /// Returns the expected number of tests of a ray that enters the scene, in the wide layout of a
    /// tree. No bake trains on the same default rays.
    pub fn expected_tests(&self, tree: &Bvh, scene: &Scene) -> Result<f64, Error> {
        let density = self.density(scene, tree, Self::JUDGING, &INTERRUPTED)?;
        let density = density.ok_or_else(|| Error::Interrupted("nothing was written".into()))?;
        let tests = Objective::Layout.cost_by(tree, &density);
        let root = tree.root_aabb().map_or(0.0, |root| density.measure(&root));
        Ok(if root > 0.0 { tests / root } else { 0.0 })
    }
}
