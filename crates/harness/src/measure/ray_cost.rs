//! Trees for the rays that are traced: the density of the rays that a tree is searched for, and the tests that other rays of the
//! same kind, or of another camera, take in it.

use super::contender::timed;
use crate::statistics::minimum;
use bvh_build::{Builder, muller_fellner};
use bvh_config::{OutOfRange, config};
use bvh_core::{Bvh, Hit, Ray, RayDensity, TestCounts, WideBvh};
use bvh_scenes::Scene;
use bvh_scenes::rays::{
    Family, Kind, OF_ANYTHING, Pose, RenderedRays, TRAINED, TracedRay, Viewpoint, check_count,
    density, in_box, of_anything, of_inside, of_renderer, random_ray,
};
use bvh_search::Stream;
use rand::SeedableRng;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The rays that a tree is searched for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum TrainedOn {
    /// Rays that need no camera.
    Default,
    /// Rays from the scene's first path of cameras.
    Camera,
    /// The paper's random rays: from anywhere inside.
    Inside,
}

impl TrainedOn {
    /// The name in results; trees that are searched by area are trained on `none`.
    pub fn name(trained: Option<Self>) -> &'static str {
        match trained {
            None => "none",
            Some(Self::Default) => "default",
            Some(Self::Camera) => "camera",
            Some(Self::Inside) => "inside",
        }
    }
}

config! {
    serde;
    /// How trees are trained on rays, and judged by others.
    pub struct Config {
        /// Primary rays of each path that judge trees; without a camera, rays of each family. 0 to train trees and judge none.
        count: u32 = 50_000, in 0..=10_000_000;
        /// Primary rays that trees are trained on; without a camera, rays of each family.
        trained: u32 = TRAINED, in 1..;
        /// Turns in which rays are timed; 0 for counting only.
        rounds: u32 = 3;
        /// Cameras by scene; scenes without an entry are seen from outside.
        cameras: BTreeMap<String, Cameras>;
        /// Rays by whose visits every tree is costed, and tested one by one, for reports of `correlation`. Default none.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        costs: Vec<TrainedOn>;
    }
    check Self::check_rays;
}

/// Two paths of a camera through a scene, and its lights, in fractions of the root's box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cameras {
    /// The path that trees are trained on; other rays from it judge them.
    pub same: Vec<Viewpoint>,
    /// A path that trees are only judged by; needless where none are.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub other: Vec<Viewpoint>,
    /// Positions of lights.
    pub lights: Vec<[f64; 3]>,
}

impl Default for Cameras {
    /// Two arcs around the scene, and a light above it.
    fn default() -> Self {
        let around = |eyes: [[f64; 3]; 3]| {
            eyes.map(|eye| Viewpoint { eye, target: [0.5; 3] })
                .to_vec()
        };
        Self {
            same: around([[1.9, 1.3, 2.2], [2.4, 1.0, 0.9], [2.0, 1.5, -0.5]]),
            other: around([[-0.9, 1.2, -1.0], [-1.4, 0.8, 0.3], [-0.8, 0.6, 1.7]]),
            lights: vec![[0.8, 2.0, 1.3]],
        }
    }
}

impl Config {
    fn check_rays(&self) -> impl Iterator<Item = OutOfRange> {
        // A primary ray, one that it reflects, and one to every light.
        let rendered = self
            .cameras
            .values()
            .map(|cameras| 2 + cameras.lights.len());
        let too_many = check_count("trained", self.trained, rendered.fold(OF_ANYTHING, usize::max));
        let paths = |(scene, cameras): (&String, &Cameras)| {
            [("same", &cameras.same, true), ("other", &cameras.other, self.count > 0)]
                .map(|(name, path, is_used)| (scene.clone(), name, is_used && path.is_empty()))
        };
        let empty = self
            .cameras
            .iter()
            .flat_map(paths)
            .filter(|(.., is_empty)| *is_empty);
        too_many
            .into_iter()
            .chain(empty.map(|(scene, name, _)| {
                OutOfRange::new(
                    format!("cameras.{scene}.{name}"),
                    "empty",
                    "at least one viewpoint",
                )
            }))
    }

    /// A renderer's rays from one of the paths through a scene.
    fn rendered(
        &self,
        scene: &Scene,
        tree: &Bvh,
        other: bool,
        count: u32,
        seed: u64,
    ) -> Vec<TracedRay> {
        let cameras = self
            .cameras
            .get(&scene.name)
            .cloned()
            .unwrap_or_default();
        let Some(root) = tree.root_aabb() else { return Vec::new() };
        let place = |at: [f64; 3]| in_box(&root, at).to_array();
        let path = if other { &cameras.other } else { &cameras.same };
        let pose = |view: &Viewpoint| Pose { eye: place(view.eye), target: place(view.target) };
        let lights = cameras
            .lights
            .iter()
            .map(|&light| place(light))
            .collect();
        let rays = RenderedRays {
            cameras: path.iter().map(pose).collect(),
            lights,
            count,
            seed,
            ..Default::default()
        };
        of_renderer(&rays, scene, tree)
    }

    /// The density of the rays that a tree is trained on; `seed` draws them.
    pub fn density(
        &self,
        trained: TrainedOn,
        scene: &Scene,
        seed: u64,
    ) -> Result<RayDensity, String> {
        let tree = muller_fellner::Config::default()
            .build(&scene.boxes)
            .map_err(|error| error.to_string())?;
        let rays = match trained {
            TrainedOn::Default => of_anything(self.trained, scene, &tree, seed),
            TrainedOn::Camera => self.rendered(scene, &tree, false, self.trained, seed),
            TrainedOn::Inside => of_inside(self.trained, scene, &tree, seed),
        };
        density(&rays, &tree).map_err(|error| error.to_string())
    }
}

/// Rays that judge trees.
pub struct TestRays {
    /// Their kind.
    pub kind: Kind,
    /// Which path of cameras they come from: `same` as the training's, `other`, or `none`.
    pub camera: &'static str,
    rays: Vec<Ray>,
}

/// All rays that judge the trees of a scene, of which `tree` is one.
pub fn test_rays(config: &Config, scene: &Scene, tree: &Bvh, seed: u64) -> Vec<TestRays> {
    let mut test_rays = Vec::new();
    for (camera, other) in [("same", false), ("other", true)] {
        let traced = config.rendered(scene, tree, other, config.count, seed);
        for kind in [Kind::Primary, Kind::Bounce, Kind::Shadow] {
            let own = traced.iter().filter(|traced| traced.kind == kind);
            test_rays.push(TestRays { kind, camera, rays: own.map(|traced| traced.ray).collect() });
        }
    }
    let mut rng = Stream::seed_from_u64(seed);
    let root = tree.root_aabb();
    let random = |_| random_ray(Family::Inside, root.as_ref()?, &mut rng);
    test_rays.push(TestRays {
        kind: Kind::Incoherent,
        camera: "none",
        rays: (0..config.count).filter_map(random).collect(),
    });
    test_rays.retain(|test_rays| !test_rays.rays.is_empty());
    test_rays
}

impl TestRays {
    /// Number of rays.
    pub fn count(&self) -> u64 {
        self.rays.len() as u64
    }

    /// Tests of nodes and of blocks of triangles per ray in a layout, the same on every machine.
    pub fn tests(&self, wide: &WideBvh) -> [f64; 2] {
        let mut counts = TestCounts::default();
        for ray in &self.rays {
            if self.kind == Kind::Shadow {
                wide.any_hit_counted(ray, &mut counts);
            } else {
                wide.nearest_hit_counted(ray, &mut counts);
            }
        }
        let per_ray =
            |tests: u64, of_each: u64| tests as f64 / (of_each as f64 * self.rays.len() as f64);
        [
            per_ray(counts.boxes, WideBvh::BOXES_OF_NODE),
            per_ray(counts.objects, WideBvh::OBJECTS_OF_BLOCK),
        ]
    }

    /// Million rays per second through each of the layouts, which take turns, each part of the rays by its fastest turn.
    pub fn speeds(&self, layouts: &[&WideBvh], rounds: u32) -> Vec<f64> {
        let mut hits: Vec<Option<Hit>> = vec![None; self.rays.len()];
        let mut turns: Vec<Vec<Vec<f64>>> = vec![Vec::new(); layouts.len()];
        for _ in 0..rounds {
            for (wide, turns) in layouts.iter().zip(&mut turns) {
                turns.push(if self.kind == Kind::Shadow {
                    timed(&self.rays, &mut hits, |ray| {
                        wide.any_hit(ray)
                            .then_some(super::answers::SOME_HIT)
                    })
                } else {
                    timed(&self.rays, &mut hits, |ray| wide.nearest_hit(ray))
                });
            }
        }
        let fastest = |turns: &Vec<Vec<f64>>| {
            let parts = turns.first().map_or(0, Vec::len);
            let seconds: f64 = (0..parts)
                .filter_map(|part| minimum(turns.iter().map(|turn| turn[part])))
                .sum();
            self.rays.len() as f64 / seconds / 1e6
        };
        turns.iter().map(fastest).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_that_judge_are_others_than_those_of_the_training_and_a_layout_for_them_needs_fewer_tests()
     {
        let scene = Scene::load("escher:3000").unwrap();
        let tree = muller_fellner::Config::default()
            .build(&scene.boxes)
            .unwrap();
        let config = Config { count: 5000, trained: 20_000, ..Config::default() };
        let density = config
            .density(TrainedOn::Camera, &scene, 1)
            .unwrap();
        let triangles = scene.triangles().unwrap();
        let plain = WideBvh::new(&tree, triangles).unwrap();
        let trained = WideBvh::for_rays(&tree, triangles, &density.visits(&tree)).unwrap();
        let test_rays = test_rays(&config, &scene, &tree, 2);
        let kinds: Vec<_> = test_rays
            .iter()
            .map(|test_rays| (test_rays.kind, test_rays.camera))
            .collect();
        assert_eq!((kinds.len(), kinds[6]), (7, (Kind::Incoherent, "none")));
        let sum = |wide: &WideBvh| {
            test_rays[..3]
                .iter()
                .map(|test_rays| test_rays.tests(wide).iter().sum::<f64>())
                .sum::<f64>()
        };
        assert!(sum(&trained) < sum(&plain), "{} {}", sum(&trained), sum(&plain));
        assert!(
            test_rays[0]
                .speeds(&[&plain, &trained], 2)
                .into_iter()
                .all(|speed| speed > 0.0)
        );
    }
}
