//! Trees for the rays that will be traced: the density of the rays that a tree is trained on, and
//! the tests of other rays, of the same kind or of another camera, in it.

use bvh_build::{Builder, muller_fellner};
use bvh_config::{OutOfRange, config};
use bvh_core::{Bvh, Ray, RayDensity, Segment};
use bvh_scenes::Scene;
use bvh_scenes::rays::{
    Family, Kind, OF_ANYTHING, RenderedRays, TRAINED, TracedRay, Viewpoint, check_count, density,
    in_box, of_anything, of_inside, of_renderer, random_ray,
};
use bvh_search::{Stream, ray_density};
use rand::SeedableRng;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The rays that a tree is trained on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrainedOn {
    /// Rays that need no camera.
    Default,
    /// Rays from the scene's first path of cameras.
    Camera,
    /// The same rays as `camera`, recorded for `bake_for_rays`, which adds rays from anywhere.
    Recorded,
    /// The paper's random rays, which start anywhere inside.
    Inside,
}

impl TrainedOn {
    /// Returns the name in results; trees for areas are trained on `none`.
    pub fn name(trained: Option<Self>) -> &'static str {
        match trained {
            None => "none",
            Some(Self::Default) => "default",
            Some(Self::Camera) => "camera",
            Some(Self::Recorded) => "recorded",
            Some(Self::Inside) => "inside",
        }
    }
}

config! {
    serde;
    /// The rays that trees are trained on, and the different rays that judge them.
    pub struct Config {
        /// Primary rays of each path that judge trees; without a camera, rays of each family. With
        /// 0, trees are trained but not judged.
        count: u32 = 50_000, in 0..=10_000_000;
        /// Primary rays that trees are trained on; without a camera, rays of each family.
        trained: u32 = TRAINED, in 1..;
        /// Cameras by scene; scenes without an entry are seen from outside.
        cameras: BTreeMap<String, Cameras>;
        /// Rays whose visits cost every tree, which is then also tested singly, for reports of
        /// `correlation`. Default none.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        costs: Vec<TrainedOn>;
    }
    check Self::check_rays;
}

/// Two paths of a camera through a scene, and its lights, in fractions of the root's box.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cameras {
    /// The path that trees are trained on; other rays from it judge them.
    pub same: Vec<Viewpoint>,
    /// The path that judges trees instead of `same`: the next frame.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub next: Vec<Viewpoint>,
    /// A path that only judges trees; unnecessary if none are judged.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub other: Vec<Viewpoint>,
    /// Positions of lights.
    pub lights: Vec<[f64; 3]>,
}

impl Default for Cameras {
    /// Two arcs around the scene, and a light above it.
    fn default() -> Self {
        Self {
            same: towards_centre([[1.9, 1.3, 2.2], [2.4, 1.0, 0.9], [2.0, 1.5, -0.5]]),
            next: vec![],
            other: towards_centre([[-0.9, 1.2, -1.0], [-1.4, 0.8, 0.3], [-0.8, 0.6, 1.7]]),
            lights: vec![[0.8, 2.0, 1.3]],
        }
    }
}

fn towards_centre(eyes: [[f64; 3]; 3]) -> Vec<Viewpoint> {
    eyes.map(|eye| Viewpoint { eye, target: [0.5; 3] }).to_vec()
}

impl Config {
    fn check_rays(&self) -> Result<(), OutOfRange> {
        // A primary ray, one that it reflects, and one to every light.
        let rays_per_pixel = self.cameras.values().map(|cameras| 2 + cameras.lights.len());
        let most_rays = rays_per_pixel.fold(OF_ANYTHING, usize::max);
        check_count("trained", self.trained, most_rays)?;
        for (scene, cameras) in &self.cameras {
            let paths = [("same", &cameras.same, true), ("other", &cameras.other, self.count > 0)];
            for (name, path, is_used) in paths {
                if is_used && path.is_empty() {
                    let key = format!("cameras.{scene}.{name}");
                    return Err(OutOfRange::new(key, "empty", "at least one viewpoint"));
                }
            }
        }
        Ok(())
    }

    fn cameras_of(&self, scene: &Scene) -> Cameras {
        self.cameras.get(&scene.name).cloned().unwrap_or_default()
    }

    /// Returns the density of the rays that a tree is trained on; `seed` draws the rays.
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
            TrainedOn::Default => {
                of_anything(self.trained, &scene.primitives, &tree, seed, &|| false)
            }
            TrainedOn::Camera | TrainedOn::Recorded => {
                let Cameras { same, lights, .. } = self.cameras_of(scene);
                rendered(&same, &lights, scene, &tree, self.trained, seed)
            }
            TrainedOn::Inside => of_inside(self.trained, scene, &tree, seed),
        };
        if trained == TrainedOn::Recorded {
            let segments: Vec<Segment> = rays.iter().map(|traced| traced.segment).collect();
            let density = ray_density(&tree, Some(&scene.primitives), &segments, &|| false)
                .map_err(|error| error.to_string())?;
            return density.ok_or_else(|| "nobody cancels a density".into());
        }
        density(&rays, &tree).map_err(|error| error.to_string())
    }
}

/// Returns a renderer's rays from a path through a scene.
fn rendered(
    path: &[Viewpoint],
    lights: &[[f64; 3]],
    scene: &Scene,
    tree: &Bvh,
    count: u32,
    seed: u64,
) -> Vec<TracedRay> {
    // Viewpoints are fractions of the root's box, which an empty tree lacks.
    let Some(root) = tree.root_aabb() else { return Vec::new() };
    let place = |place| in_box(&root, place).to_array();
    let rays = RenderedRays {
        cameras: path.iter().map(|view| view.in_box(&root)).collect(),
        lights: lights.iter().copied().map(place).collect(),
        count,
        seed,
        ..Default::default()
    };
    of_renderer(&rays, scene, tree, &|| false)
}

/// Rays that judge trees.
pub struct TestRays {
    /// The kind of the rays.
    pub kind: Kind,
    /// The path of cameras that they come from: `same` as in the training, `other`, or `none`.
    pub camera: &'static str,
    /// The rays.
    pub rays: Vec<Ray>,
}

/// Returns all rays that judge the trees of a scene. `tree` is any of these trees.
pub fn test_rays(config: &Config, scene: &Scene, tree: &Bvh, seed: u64) -> Vec<TestRays> {
    let mut test_rays = Vec::new();
    let Cameras { same, next, other, lights } = config.cameras_of(scene);
    for (camera, path) in [("same", if next.is_empty() { same } else { next }), ("other", other)] {
        let traced = rendered(&path, &lights, scene, tree, config.count, seed);
        for kind in [Kind::Primary, Kind::Bounce, Kind::Shadow] {
            let rays_of_kind =
                traced.iter().filter(|traced| traced.kind == kind).map(|traced| traced.ray);
            test_rays.push(TestRays { kind, camera, rays: rays_of_kind.collect() });
        }
    }
    let mut rng = Stream::seed_from_u64(seed);
    let root = tree.root_aabb();
    let rays = (0..config.count)
        .filter_map(|_| random_ray(Family::Inside, root.as_ref()?, &mut rng))
        .collect();
    test_rays.push(TestRays { kind: Kind::Incoherent, camera: "none", rays });
    // A scene without reflections has no bounced rays.
    test_rays.retain(|test_rays| !test_rays.rays.is_empty());
    test_rays
}

#[cfg(test)]
mod tests {
    use super::*;
    use bvh_core::WideBvh;
    use bvh_scenes::rays::tests_per_ray;

    #[test]
    fn a_layout_for_rays_needs_fewer_tests_of_other_rays_of_the_same_camera() {
        let scene = Scene::load("escher:3000").unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let config = Config { count: 5000, trained: 20_000, ..Config::default() };
        let density = config.density(TrainedOn::Camera, &scene, 1).unwrap();
        let triangles = scene.triangles().unwrap();
        let plain = WideBvh::new(&tree, triangles).unwrap();
        let trained = WideBvh::for_rays(&tree, triangles, &density.visits(&tree)).unwrap();
        let test_rays = test_rays(&config, &scene, &tree, 2);
        let kinds: Vec<_> =
            test_rays.iter().map(|test_rays| (test_rays.kind, test_rays.camera)).collect();
        assert_eq!((kinds.len(), kinds[6]), (7, (Kind::Incoherent, "none")));
        let [plain_tests, trained_tests] = [&plain, &trained].map(|wide| {
            let same_camera = test_rays[..3].iter();
            same_camera.flat_map(|rays| tests_per_ray(wide, rays.kind, &rays.rays)).sum::<f64>()
        });
        assert!(trained_tests < plain_tests, "{trained_tests} {plain_tests}");
    }

    #[test]
    fn no_tree_is_trained_on_the_paths_that_judge_it() {
        let scene = Scene::load("escher:300").unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let visits = |cameras: Cameras| {
            let cameras = BTreeMap::from([(scene.name.clone(), cameras)]);
            let config = Config { count: 100, trained: 1000, cameras, ..Config::default() };
            let density = config.density(TrainedOn::Camera, &scene, 1).unwrap();
            density.visits(&tree)
        };
        let known = Cameras::default();
        let elsewhere = towards_centre([[0.2, 0.3, 3.0], [0.1, 0.3, 2.0], [0.2, 0.6, 2.5]]);
        let judged =
            Cameras { next: elsewhere.clone(), other: elsewhere.clone(), ..Cameras::default() };
        let trained = Cameras { same: elsewhere, ..Cameras::default() };
        assert_eq!(visits(judged), visits(known.clone()));
        assert_ne!(visits(trained), visits(known));
    }
}
