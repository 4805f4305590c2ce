//! Every way to trace a scene gives the same nearest distance and the same any-hit answer, bit by bit.

#[path = "../../bvh-core/tests/support/mod.rs"]
mod support;

use bvh_build::kd_tree::{self, KdTree};
use bvh_build::{Builder, goldsmith_salmon, median_cut, muller_fellner};
use bvh_core::{
    Aabb, Bvh, Hit, Ray, Shear, Sphere, Triangle, WideBvh, any_hit, any_hit_of_all, collapse_leaves,
    cost::SahConstants, nearest_hit, nearest_hit_of_all,
};
use glam::Vec3;
use harness::scenes::{Primitives, Scene};
use rayon::prelude::*;
use support::{Random, ball, grid_box, rays, soup};

/// Every structure over one set of boxes.
struct Structures {
    trees: Vec<(&'static str, Bvh)>,
    kd_tree: KdTree,
}

impl Structures {
    fn new(boxes: &[Aabb]) -> Self {
        let greedy = muller_fellner::Config::default().build(boxes).unwrap();
        let tenth = median_cut::Config { axis: median_cut::CutAxis::Longest, leaf_fraction: 0.1 };
        let trees = vec![
            ("binary", greedy.clone()),
            ("n-ary", goldsmith_salmon::Config::default().build(boxes).unwrap()),
            ("leaves of a tenth", tenth.build(boxes).unwrap()),
            ("collapsed", collapse_leaves(&greedy, &SahConstants::default())),
        ];
        Self { trees, kd_tree: kd_tree::Config::default().build(boxes).unwrap() }
    }

    /// The answer of testing each of `count` objects, after all others have given it too.
    fn answer(&self, ray: &Ray, count: usize, test: impl Fn(u32, f32) -> Option<f32>) -> Option<Hit> {
        let any = |id: u32| test(id, ray.t_max()).is_some();
        let expected = nearest_hit_of_all(count as u32, ray, &test, &mut ());
        assert_eq!(any_hit_of_all(count as u32, any, &mut ()), expected.is_some(), "brute force: {ray:?}");
        for (name, tree) in &self.trees {
            assert_eq!(bits(nearest_hit(tree, ray, &test, &mut ())), bits(expected), "{name}: {ray:?}");
            assert_eq!(any_hit(tree, ray, any, &mut ()), expected.is_some(), "{name}: {ray:?}");
        }
        assert_eq!(bits(self.kd_tree.nearest_hit(ray, &test, &mut ())), bits(expected), "KD-tree: {ray:?}");
        assert_eq!(self.kd_tree.any_hit(ray, any, &mut ()), expected.is_some(), "KD-tree: {ray:?}");
        expected
    }
}

fn bits(hit: Option<Hit>) -> Option<(u32, u32)> {
    hit.map(|hit| (hit.t.to_bits(), hit.object))
}

/// Triangles with every structure, the wide layout's included.
struct Mesh {
    triangles: Vec<Triangle>,
    structures: Structures,
    wide: Vec<WideBvh>,
}

impl Mesh {
    fn new(triangles: Vec<Triangle>) -> Self {
        let structures = Structures::new(&support::boxes(&triangles));
        let wide = structures.trees.iter().map(|(_, tree)| WideBvh::new(tree, &triangles).unwrap()).collect();
        Self { triangles, structures, wide }
    }

    fn answer(&self, ray: &Ray) -> Option<Hit> {
        let shear = Shear::new(ray);
        let test = |id: u32, t_max| self.triangles[id as usize].intersect(&shear, t_max);
        let expected = self.structures.answer(ray, self.triangles.len(), test);
        for wide in &self.wide {
            assert_eq!(bits(wide.nearest_hit(ray)), bits(expected), "wide: {ray:?}");
            assert_eq!(bits(wide.view().nearest_hit_portable(ray)), bits(expected), "wide, portable: {ray:?}");
            assert_eq!(wide.any_hit(ray), expected.is_some(), "wide: {ray:?}");
            assert_eq!(wide.view().any_hit_portable(ray), expected.is_some(), "wide, portable: {ray:?}");
        }
        expected
    }

    /// The number of rays that hit something.
    fn hits(&self, rays: &[Ray]) -> usize {
        rays.par_iter().filter(|ray| self.answer(ray).is_some()).count()
    }
}

fn meshes() -> Vec<(&'static str, Mesh)> {
    let parts =
        ["escher:cluster:200:1", "bijou:cluster:200:1", "konistil:cluster:200:1", "pinecon2:cluster:200:1"];
    let part = |name: &'static str| match Scene::load(name).unwrap().primitives {
        Primitives::Triangles(triangles) => (name, Mesh::new(triangles.into_iter().map(Triangle).collect())),
        Primitives::Spheres(_) => unreachable!("{name} is made of triangles"),
    };
    let mut random = Random(11);
    let made = [("soup", soup(150, &mut random)), ("box", grid_box(4)), ("ball", ball(2))];
    parts.into_iter().map(part).chain(made.map(|(name, own)| (name, Mesh::new(own)))).collect()
}

/// Rays with origins uniform in the box and directions to points uniform in a cube.
fn random_rays(bounds: &Aabb, count: usize, random: &mut Random) -> Vec<Ray> {
    let mut ray = || {
        let origin = bounds.min + (bounds.max - bounds.min) * ((random.point() + 1.0) * 0.5);
        Ray::half_line(origin, random.point())
    };
    (0..count).filter_map(|_| ray().ok()).collect()
}

#[test]
fn all_structures_agree_on_a_million_random_and_a_hundred_thousand_awkward_rays() {
    let meshes = meshes();
    let mut random = Random(12);
    for (name, mesh) in &meshes {
        let bounds = support::boxes(&mesh.triangles).iter().fold(Aabb::EMPTY, |a, b| a.union(b));
        let uniform = random_rays(&bounds, 1_000_000 / meshes.len() + 1, &mut random);
        let awkward = rays(&mesh.triangles, 100_000 / meshes.len() + 1, &mut random);
        for rays in [uniform, awkward] {
            let hits = mesh.hits(&rays);
            assert!(hits * 50 > rays.len(), "{name}: {hits} of {} hit", rays.len());
        }
    }
}

#[test]
fn all_structures_agree_on_whole_scenes() {
    let mut random = Random(13);
    for name in ["escher", "bijou"] {
        let Primitives::Triangles(triangles) = Scene::load(name).unwrap().primitives else { unreachable!() };
        let mesh = Mesh::new(triangles.into_iter().map(Triangle).collect());
        let awkward = rays(&mesh.triangles, 1000, &mut random);
        assert!(mesh.hits(&awkward) > 100, "{name}");
    }
}

#[test]
fn all_structures_agree_on_spheres_and_boxes_touched_grazed_and_left() {
    let Primitives::Spheres(spheres) = Scene::load("spheres75").unwrap().primitives else { unreachable!() };
    let boxes: Vec<Aabb> = spheres.iter().map(Sphere::aabb).collect();
    let structures = Structures::new(&boxes);
    let mut random = Random(14);
    let mut hits = 0;
    for _ in 0..20_000 {
        let (a, b) = (random.of(&spheres), random.of(&spheres));
        let on = |s: Sphere, random: &mut Random| s.center + random.point().normalize_or(Vec3::X) * s.radius;
        let origin = on(a, &mut random);
        let origin = random.of(&[a.center, origin, origin * 3.0]);
        let mut direction = on(b, &mut random) - origin;
        if random.below(4) == 0 {
            direction[random.below(3)] = random.of(&[0.0, -0.0]);
        }
        let Ok(ray) = Ray::half_line(origin, direction) else { continue };
        let test = |id: u32, t_max| spheres[id as usize].intersect(&ray, t_max);
        hits += usize::from(structures.answer(&ray, spheres.len(), test).is_some());
        let solid = |id: u32, t_max| bvh_core::clip_to_box(&ray, &boxes[id as usize], ray.t_min(), t_max);
        structures.answer(&ray, boxes.len(), solid);
    }
    assert!(hits > 5000, "{hits}");
}

#[test]
fn no_ray_leaves_a_closed_mesh_through_an_edge_or_a_vertex() {
    let mut random = Random(15);
    for (name, triangles) in [("ball", ball(2)), ("box", grid_box(4)), ("plain box", grid_box(1))] {
        let mesh = Mesh::new(triangles);
        for _ in 0..3000 {
            let Triangle([a, b, _]) = random.of(&mesh.triangles);
            let target = a + (b - a) * random.of(&[0.0, 0.5, 1.0, 1.0 / 3.0]);
            let close = target * (1.0 - random.of(&[1e-2, 1e-4, 1e-6]));
            for origin in [random.point() * 0.5, Vec3::ZERO, close] {
                let ray = Ray::half_line(origin, target - origin).unwrap();
                assert!(mesh.answer(&ray).is_some(), "{name} leaks {ray:?}");
            }
        }
    }
}
