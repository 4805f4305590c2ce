//! The structures that a picture can be traced with, by name.

use crate::Error;
use crate::files::load_tree;
use crate::scenes::Scene;
use bvh_build::{BuildError, Builder, Structure, kd_tree, muller_fellner};
use bvh_core::WideBvh;
use std::borrow::Cow;
use std::path::Path;

/// What [`by_name`] accepts.
pub const ACCEPTED: &str = "brute, kdtree, bvh, wide, or the path of a .bvh file";

/// The structure that `--accel` names, built over the scene; trees by greedy Müller–Fellner division.
pub fn by_name(name: &str, scene: &Scene) -> Result<Structure<'static>, Error> {
    let refused = |source: BuildError| Error::search(&scene.name, name)(source);
    let greedy = || muller_fellner::Config::default().build(&scene.boxes).map_err(refused);
    match name {
        "brute" => Ok(Structure::Brute),
        "kdtree" => Ok(Structure::KdTree(kd_tree::Config::default().build(&scene.boxes).map_err(refused)?)),
        "bvh" => Ok(Structure::Tree(Cow::Owned(greedy()?))),
        "wide" => {
            let triangles = scene.triangles().map_err(|error| {
                Error::Usage(format!("--accel wide: {error}, or --accel brute, kdtree, bvh"))
            })?;
            let wide = WideBvh::new(&greedy()?, triangles).map_err(|source| Error::InvalidTree {
                scene: scene.name.clone(),
                method: name.into(),
                source,
            })?;
            Ok(Structure::Wide(wide))
        }
        _ if name.ends_with(".bvh") => Ok(Structure::Tree(Cow::Owned(load_tree(Path::new(name), scene)?))),
        _ => Err(Error::Usage(format!("--accel is {name:?}; accepted: {ACCEPTED}"))),
    }
}
