//! P8: every traversal tests at most twice as many boxes and objects as in real arithmetic, on every
//! scene of the suite, wherever a scene is, however large one of its triangles is, and from however
//! far it is seen.

use bvh_build::{Builder, goldsmith_salmon, muller_fellner};
use bvh_core::{
    Aabb, Bvh, Hit, Kernel, NodeKind, NodeTest, PreparedRay, Ray, TestCounts, Triangle, WideBvh,
    nearest_hit_by,
};
use bvh_search::Stream;
use bvh_stress::{scenes, tracing};
use glam::Vec3;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};

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
    for power in [0, 3, 4, 5, 6, 7] {
        let mut triangles = cloud(&mut random, Vec3::ZERO, 0.1);
        let g = 10.0f32.powi(power);
        triangles.push(Triangle::from([[-g, -0.2, -g], [g, -0.2, -g], [0.0, -0.2, g]]));
        let rays = rays(&mut random, Vec3::ZERO, 0.1, 1.0);
        scenes.push(Scene { name: format!("ground of 1e{power}"), triangles, rays });
    }
    for power in [3, 4, 5, 6] {
        let center = Vec3::new(1.0, -0.3, 0.7) * 10.0f32.powi(power);
        let triangles = cloud(&mut random, center, 1.0);
        let rays = rays(&mut random, center, 1.0, 5.0);
        scenes.push(Scene { name: format!("offset of 1e{power}"), triangles, rays });
    }
    for power in [1, 2, 3, 4, 5, 6] {
        let triangles = cloud(&mut random, Vec3::ZERO, 1.0);
        let rays = rays(&mut random, Vec3::ZERO, 1.0, 10.0f32.powi(power));
        scenes.push(Scene { name: format!("camera at 1e{power}"), triangles, rays });
    }
    let size = |k: i32| 2.0f64.powi(k) as f32;
    let chain = |k: i32| {
        Triangle(
            [[2.0, 0.0, 0.0], [3.0, 1.0, 0.0], [3.0, 0.0, 1.0]].map(|c| Vec3::from(c) * size(k)),
        )
    };
    let ray = |i: i32| {
        let k = -126 + i % 246;
        let origin = point(&mut random) * size(k + random.random_range(-1..3));
        towards(origin, (Vec3::new(2.7, 0.3, 0.3) + point(&mut random) * 0.4) * size(k))
    };
    let rays = (0..300).map(ray).collect();
    let triangles = (-126..120).map(chain).collect();
    scenes.push(Scene { name: "chain of all sizes".to_owned(), triangles, rays });
    scenes
}

/// Returns the distances at which a ray enters and leaves a box, in f64. The first exceeds the
/// second if it misses the box.
fn interval(ray: &Ray, aabb: &Aabb) -> [f64; 2] {
    let origin = ray.origin().as_dvec3();
    let direction = ray.direction().as_dvec3();
    let low = aabb.min.as_dvec3() - origin;
    let high = aabb.max.as_dvec3() - origin;
    let mut interval = [f64::from(ray.t_min()), f64::INFINITY];
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if low[axis] > 0.0 || high[axis] < 0.0 {
                return [f64::INFINITY, 0.0];
            }
            continue;
        }
        let [a, b] = [low, high].map(|side| side[axis] / direction[axis]);
        interval = [interval[0].max(a.min(b)), interval[1].min(a.max(b))];
    }
    interval
}

/// Returns the distance at which a ray enters a box; infinite if it misses the box by more than
/// the rounding of f64.
fn entry(ray: &Ray, aabb: &Aabb) -> f32 {
    let [entry, exit] = interval(ray, aabb);
    if entry <= exit * (1.0 + 1e-14) { entry as f32 } else { f32::INFINITY }
}

/// Counts the tests of the traversal of a tree with boxes that are tested in f64.
fn real_counts(tree: &Bvh, triangles: &[Triangle], ray: &Ray) -> TestCounts {
    let prepared = PreparedRay::new(ray);
    let mut counts = TestCounts { boxes: 1, objects: 0 };
    let mut nearest = Hit { t: ray.t_max(), object: u32::MAX };
    let entry = |node: usize| entry(ray, &tree.nodes[node].aabb);
    let mut stack = vec![(entry(0), 0)];
    while let Some((distance, node)) = stack.pop() {
        if distance > nearest.t || distance == f32::INFINITY {
            continue;
        }
        match tree.nodes[node].kind() {
            NodeKind::Leaf { .. } => {
                for &object in &tree.prim_ids[tree.nodes[node].prims()] {
                    counts.objects += 1;
                    if let Some(t) = triangles[object as usize].intersect(&prepared, nearest.t) {
                        let hit = Hit { t, object };
                        if hit.precedes(&nearest) {
                            nearest = hit;
                        }
                    }
                }
            }
            NodeKind::Inner { .. } => {
                let mut children: Vec<(f32, usize)> =
                    tree.nodes[node].children().map(|child| (entry(child), child)).collect();
                counts.boxes += children.len() as u64;
                children.sort_by(|a, b| b.0.total_cmp(&a.0));
                stack.extend(children);
            }
        }
    }
    counts
}

/// The tests of all rays of a scene, in real arithmetic and ours.
#[derive(Default)]
struct Sums {
    way: String,
    real: u64,
    ours: u64,
}

impl Sums {
    fn new(way: String) -> Self {
        Self { way, ..Self::default() }
    }

    fn add(&mut self, real: TestCounts, ours: TestCounts) {
        self.real += real.boxes + real.objects;
        self.ours += ours.boxes + ours.objects;
    }
}

/// Counts the tests of all rays by the traversal of a tree, and of its wide layout by every kernel.
fn sums(name: &str, tree: &Bvh, triangles: &[Triangle], rays: &[Ray]) -> Vec<Sums> {
    let wide = WideBvh::new(tree, triangles).unwrap();
    let mut plain = Sums::new(format!("{name}, tree"));
    let mut portable = Sums::new(format!("{name}, portable kernel"));
    let ways = [
        ("a ray by itself", NodeTest::Alone),
        ("rays in flight", NodeTest::InFlight),
        ("a packet", NodeTest::Packet),
    ];
    let mut vectors = Vec::new();
    for kernel in Kernel::ALL.into_iter().filter(|&kernel| kernel != Kernel::Portable) {
        // The processor may lack the kernel's instructions.
        let Some(wide) = wide.clone().with_kernel(kernel) else { continue };
        vectors.extend(ways.map(|(way, test)| {
            (Sums::new(format!("{name}, {kernel:?}, {way}")), wide.clone(), test)
        }));
    }
    for ray in rays {
        let prepared = PreparedRay::new(ray);
        let test = |id: u32, t_max| triangles[id as usize].intersect(&prepared, t_max);
        let mut counts = TestCounts::default();
        let hit = nearest_hit_by(tree, ray, test, &mut counts);
        plain.add(real_counts(tree, triangles, ray), counts);
        // A ray that ends at its hit enters the same nodes in any order.
        let t_max = hit.map_or(ray.t_max(), |hit| hit.t);
        let ray = Ray::new(ray.origin(), ray.direction(), ray.t_min(), t_max).unwrap();
        let is_entered = |aabb: &Aabb| {
            let entry = entry(&ray, aabb);
            entry <= ray.t_max() && entry < f32::INFINITY
        };
        let real = wide.tests_without_hits(&ray, NodeTest::Given(&is_entered));
        let mut counts = TestCounts::default();
        assert_eq!(wide.nearest_hit_counted(&ray, &mut counts), hit, "{name}: {ray:?}");
        portable.add(real, counts);
        for (sums, wide, test) in &mut vectors {
            sums.add(real, wide.tests_without_hits(&ray, *test));
        }
    }
    [plain, portable].into_iter().chain(vectors.into_iter().map(|(sums, ..)| sums)).collect()
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
            for Sums { way, real, ours } in
                sums(&format!("{name}, {arity}"), &tree, &triangles, &rays)
            {
                if ours > limit(&name) * real {
                    broken.push(format!("{way}: {ours} tests, in real arithmetic {real}"));
                }
            }
        }
    }
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}
