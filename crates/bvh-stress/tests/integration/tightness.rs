//! P8: every traversal tests at most twice as many boxes and objects as in real arithmetic, on every
//! scene of the suite, wherever a scene is, however large one of its triangles is, and from however
//! far it is seen.

use bvh_build::{Builder, goldsmith_salmon, muller_fellner};
use bvh_core::{
    Aabb, Bvh, Kernel, NodeTest, PreparedRay, Ray, TestCounts, Triangle, WideBvh, nearest_hit_by,
};
use bvh_search::Stream;
use bvh_stress::transform::scaled_triangles;
use bvh_stress::{scenes, tracing};
use glam::Vec3;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use std::iter;

/// A scene, and rays that meet it or pass by closely.
struct Scene {
    name: String,
    triangles: Vec<Triangle>,
    rays: Vec<Ray>,
}

/// Returns a uniform point in the cube from -1 to 1.
fn point(random: &mut Stream) -> Vec3 {
    Vec3::from([(); 3].map(|()| random.random_range(-1.0..1.0)))
}

/// Returns small triangles in the cube of this half size around a point.
fn cloud(random: &mut Stream, center: Vec3, half: f32) -> Vec<Triangle> {
    let corners = |random: &mut Stream| {
        let near = center + point(random) * half;
        let edge = half / 20.0;
        Triangle([near, near + point(random) * edge, near + point(random) * edge])
    };
    (0..2000).map(|_| corners(random)).collect()
}

/// Returns the ray from one point towards another. Its direction is computed in f64 from the origin
/// as it is rounded, so that it does meet the target.
fn towards(origin: Vec3, target: Vec3) -> Ray {
    let direction = (target.as_dvec3() - origin.as_dvec3()).normalize().as_vec3();
    Ray::half_line(origin, direction).unwrap()
}

/// Returns rays from a distance, in the given unit, towards points in the cube of this half size.
fn rays(random: &mut Stream, center: Vec3, half: f32, distance: f32) -> Vec<Ray> {
    let ray = |random: &mut Stream| {
        let target = center + point(random) * half;
        let mut away = point(random).normalize();
        // A quarter runs along an axis.
        if random.random_range(0..4) == 0 {
            away = *Vec3::AXES.choose(random).unwrap();
        }
        towards(target + away * distance, target)
    };
    (0..300).map(|_| ray(random)).collect()
}

/// S46 to S49: a large ground, offsets, far cameras, and a chain of triangles of all sizes.
fn stretched() -> Vec<Scene> {
    let mut random = Stream::seed_from_u64(8);
    let mut scenes = Vec::new();
    for power in 0..=7 {
        let size = 10.0f32.powi(power);
        let mut scene = |name: &str, center: Vec3, half: f32, distance: f32| Scene {
            name: format!("{name} 1e{power}"),
            triangles: cloud(&mut random, center, half),
            rays: rays(&mut random, center, half, distance),
        };
        let mut grounded = scene("ground of", Vec3::ZERO, 0.1, 1.0);
        let ground = [[-size, -0.2, -size], [size, -0.2, -size], [0.0, -0.2, size]];
        grounded.triangles.push(Triangle::from(ground));
        scenes.push(grounded);
        // Details that vanish are no test.
        if power < 7 {
            scenes.push(scene("offset of", Vec3::new(1.0, -0.3, 0.7) * size, 1.0, 5.0));
            scenes.push(scene("camera at", Vec3::ZERO, 1.0, size));
        }
    }
    let size = |k: i32| 2.0f64.powi(k) as f32;
    let link = Triangle::from([[2.0, 0.0, 0.0], [3.0, 1.0, 0.0], [3.0, 0.0, 1.0]]);
    let ray = |i: i32| {
        let k = -126 + i % 246;
        let origin = point(&mut random) * size(k + random.random_range(-1..3));
        towards(origin, (Vec3::new(2.7, 0.3, 0.3) + point(&mut random) * 0.4) * size(k))
    };
    let rays = (0..300).map(ray).collect();
    let triangles = (-126..120).flat_map(|k| scaled_triangles(&[link], k)).collect();
    scenes.push(Scene { name: "chain of all sizes".to_owned(), triangles, rays });
    scenes
}

/// Returns whether a ray meets a box, in f64; false if it misses the box by more than the rounding of
/// f64.
fn meets(ray: &Ray, aabb: &Aabb) -> bool {
    let origin = ray.origin().as_dvec3();
    let direction = ray.direction().as_dvec3();
    let [low, high] = [aabb.min, aabb.max].map(|corner| corner.as_dvec3() - origin);
    let [mut entry, mut exit] = [f64::from(ray.t_min()), f64::INFINITY];
    for axis in 0..3 {
        if direction[axis] != 0.0 {
            let [a, b] = [low, high].map(|side| side[axis] / direction[axis]);
            entry = entry.max(a.min(b));
            exit = exit.min(a.max(b));
        } else if low[axis] > 0.0 || high[axis] < 0.0 {
            return false;
        }
    }
    entry <= exit * (1.0 + 1e-14) && entry as f32 <= ray.t_max().min(f32::MAX)
}

/// Counts the tests of a ray that ends at its hit in a tree with boxes that are tested in f64.
fn real_counts(tree: &Bvh, is_entered: impl Fn(&Aabb) -> bool) -> TestCounts {
    let mut counts = TestCounts { boxes: 1, objects: 0 };
    let mut stack = vec![0];
    while let Some(at) = stack.pop() {
        let node = &tree.nodes[at];
        if is_entered(&node.aabb) {
            counts.objects += node.prims().len() as u64;
            counts.boxes += node.children().len() as u64;
            stack.extend(node.children());
        }
    }
    counts
}

/// Counts the tests of all rays by the traversal of a tree, and of its wide layout by every kernel.
/// Returns the tests in real arithmetic and ours for each way.
fn sums(name: &str, tree: &Bvh, triangles: &[Triangle], rays: &[Ray]) -> Vec<(String, [u64; 2])> {
    let wide = WideBvh::new(tree, triangles).unwrap();
    let mut sums =
        ["tree", "portable kernel"].map(|way| (format!("{name}, {way}"), [0; 2])).to_vec();
    let tests = [NodeTest::Alone, NodeTest::InFlight, NodeTest::Packet];
    let ways = ["a ray by itself", "rays in flight", "a packet"];
    let mut vectors = Vec::new();
    for kernel in Kernel::ALL.into_iter().filter(|&kernel| kernel != Kernel::Portable) {
        // The processor may lack the kernel's instructions.
        let Some(wide) = wide.clone().with_kernel(kernel) else { continue };
        vectors.extend(tests.map(|test| (wide.clone(), test)));
        sums.extend(ways.map(|way| (format!("{name}, {kernel:?}, {way}"), [0; 2])));
    }
    for ray in rays {
        let prepared = PreparedRay::new(ray);
        let test = |id: u32, t_max| triangles[id as usize].intersect(&prepared, t_max);
        let hit = nearest_hit_by(tree, ray, test, &mut ());
        // A ray that ends at its hit enters the same nodes in any order.
        let t_max = hit.map_or(ray.t_max(), |hit| hit.t);
        let ray = Ray::new(ray.origin(), ray.direction(), ray.t_min(), t_max).unwrap();
        let is_entered = |aabb: &Aabb| meets(&ray, aabb);
        let mut ours = vec![TestCounts::default(); 2];
        assert_eq!(nearest_hit_by(tree, &ray, test, &mut ours[0]), hit, "{name}: {ray:?}");
        assert_eq!(wide.nearest_hit_counted(&ray, &mut ours[1]), hit, "{name}: {ray:?}");
        ours.extend(vectors.iter().map(|(wide, test)| wide.tests_without_hits(&ray, *test)));
        let real = wide.tests_without_hits(&ray, NodeTest::Given(&is_entered));
        let real = iter::once(real_counts(tree, is_entered)).chain(iter::repeat(real));
        for ((_, sum), (real, ours)) in sums.iter_mut().zip(real.zip(ours)) {
            sum[0] += real.boxes + real.objects;
            sum[1] += ours.boxes + ours.objects;
        }
    }
    sums
}

/// Returns the greatest ratio of our tests to those in real arithmetic.
///
/// S24 has details of a hundred-millionth of its size. Rays that begin in the scene test boxes in
/// f32, which tells boxes at their distance from the origin of the ray no better apart than by 2⁻²⁰
/// of that distance.
fn limit(name: &str) -> u64 {
    if name == "S24" { 4 } else { 2 }
}

#[test]
fn tests_per_ray_are_at_most_twice_those_in_real_arithmetic() {
    let suite = scenes(300).filter(|(_, triangles)| !triangles.is_empty());
    let suite = suite.map(|(case, triangles)| {
        let rays = tracing::rays(&triangles, 1000, 8);
        Scene { name: case.id.to_owned(), triangles, rays }
    });
    let builders: [&dyn Builder; 2] =
        [&muller_fellner::Config::default(), &goldsmith_salmon::Config::default()];
    let mut broken = Vec::new();
    for Scene { name, triangles, rays } in suite.chain(stretched()) {
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
        for (builder, arity) in builders.into_iter().zip(["binary", "n-ary"]) {
            let tree = builder.build(&boxes).unwrap();
            let name_of_tree = format!("{name}, {arity}");
            for (way, [real, ours]) in sums(&name_of_tree, &tree, &triangles, &rays) {
                if ours > limit(&name) * real {
                    broken.push(format!("{way}: {ours} tests, in real arithmetic {real}"));
                }
            }
        }
    }
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}
