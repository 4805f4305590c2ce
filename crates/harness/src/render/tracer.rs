//! The structures a picture can be traced with, behind two questions: what is hit first, and is anything hit.

use crate::Error;
use crate::files::load_tree;
use crate::scenes::{Primitives, Scene};
use bvh_build::kd_tree::KdTree;
use bvh_build::{BuildError, Builder, kd_tree, muller_fellner};
use bvh_core::{
    Bvh, Hit, Ray, Shear, TestCounts, Triangle, WideBvh, any_hit, any_hit_of_all, nearest_hit,
    nearest_hit_of_all,
};
use std::path::Path;

/// What finds the objects that a ray meets.
#[derive(Clone, Debug)]
pub enum Structure {
    /// Nothing: every object is tested.
    Brute,
    /// A KD-tree.
    KdTree(KdTree),
    /// A hierarchy.
    Tree(Bvh),
    /// A hierarchy of triangles in the wide layout, which counts no tests.
    Wide(WideBvh),
}

impl Structure {
    /// What `--accel` accepts.
    pub const ACCEPTED: &str = "brute, kdtree, bvh, wide, or the path of a .bvh file";

    /// The structure that `--accel` names, built over the scene; trees by greedy Müller–Fellner division.
    pub fn by_name(name: &str, scene: &Scene) -> Result<Self, Error> {
        let refused = |source: BuildError| Error::Search {
            scene: scene.name.clone(),
            method: name.into(),
            source: source.into(),
        };
        let greedy = || muller_fellner::Config::default().build(&scene.boxes).map_err(refused);
        match name {
            "brute" => Ok(Self::Brute),
            "kdtree" => Ok(Self::KdTree(kd_tree::Config::default().build(&scene.boxes).map_err(refused)?)),
            "bvh" => Ok(Self::Tree(greedy()?)),
            "wide" => {
                let triangles = scene.triangles().map_err(|error| {
                    Error::Usage(format!("--accel wide: {error}, or --accel brute, kdtree, bvh"))
                })?;
                let wide = WideBvh::new(&greedy()?, &triangles).map_err(|source| Error::InvalidTree {
                    scene: scene.name.clone(),
                    method: name.into(),
                    source,
                })?;
                Ok(Self::Wide(wide))
            }
            _ if name.ends_with(".bvh") => load_tree(Path::new(name), &scene.boxes).map(Self::Tree),
            _ => Err(Error::Usage(format!("--accel is {name:?}; accepted: {}", Self::ACCEPTED))),
        }
    }
}

/// A scene's objects with a structure over them.
#[derive(Clone, Debug)]
pub struct Tracer<'a> {
    /// The objects.
    pub objects: &'a Primitives,
    structure: Structure,
}

impl<'a> Tracer<'a> {
    /// `structure` must have been built over this scene.
    pub fn new(scene: &'a Scene, structure: Structure) -> Self {
        Self { objects: &scene.primitives, structure }
    }

    /// The nearest object in the ray's range, the same whatever the structure is.
    pub fn nearest_hit(&self, ray: &Ray, counts: &mut TestCounts) -> Option<Hit> {
        match self.objects {
            Primitives::Triangles(triangles) => {
                if let Structure::Wide(wide) = &self.structure {
                    return wide.nearest_hit(ray);
                }
                let shear = Shear::new(ray);
                self.nearest_of(
                    ray,
                    |id, t_max| Triangle(triangles[id as usize]).intersect(&shear, t_max),
                    counts,
                )
            }
            Primitives::Spheres(spheres) => {
                self.nearest_of(ray, |id, t_max| spheres[id as usize].intersect(ray, t_max), counts)
            }
        }
    }

    /// Whether anything is in the ray's range.
    pub fn any_hit(&self, ray: &Ray, counts: &mut TestCounts) -> bool {
        let t_max = ray.t_max();
        match self.objects {
            Primitives::Triangles(triangles) => {
                if let Structure::Wide(wide) = &self.structure {
                    return wide.any_hit(ray);
                }
                let shear = Shear::new(ray);
                let test = |id: u32| Triangle(triangles[id as usize]).intersect(&shear, t_max).is_some();
                self.any_of(ray, test, counts)
            }
            Primitives::Spheres(spheres) => {
                self.any_of(ray, |id| spheres[id as usize].intersect(ray, t_max).is_some(), counts)
            }
        }
    }

    fn nearest_of(
        &self,
        ray: &Ray,
        test: impl FnMut(u32, f32) -> Option<f32>,
        counts: &mut TestCounts,
    ) -> Option<Hit> {
        match &self.structure {
            Structure::KdTree(tree) => tree.nearest_hit(ray, test, counts),
            Structure::Tree(tree) => nearest_hit(tree, ray, test, counts),
            Structure::Brute | Structure::Wide(_) => nearest_hit_of_all(self.count(), ray, test, counts),
        }
    }

    fn any_of(&self, ray: &Ray, test: impl FnMut(u32) -> bool, counts: &mut TestCounts) -> bool {
        match &self.structure {
            Structure::KdTree(tree) => tree.any_hit(ray, test, counts),
            Structure::Tree(tree) => any_hit(tree, ray, test, counts),
            Structure::Brute | Structure::Wide(_) => any_hit_of_all(self.count(), test, counts),
        }
    }

    fn count(&self) -> u32 {
        match self.objects {
            Primitives::Triangles(triangles) => triangles.len() as u32,
            Primitives::Spheres(spheres) => spheres.len() as u32,
        }
    }
}
