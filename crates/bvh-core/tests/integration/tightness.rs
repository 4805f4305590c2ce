//! P8: tests of boxes and triangles per ray are at most twice those in real arithmetic, wherever the
//! scene is, however large one of its triangles is, and from however far it is seen.

use crate::support::{Random, SHAPES, tree};
use bvh_core::{
    Aabb, Bvh, Hit, NodeKind, PreparedRay, Ray, TestCounts, Triangle, WideBvh, nearest_hit_by,
};
use glam::{DVec3, Vec3};

/// A scene, and rays that meet it or pass by closely.
struct Scene {
    name: String,
    triangles: Vec<Triangle>,
    rays: Vec<Ray>,
}

/// Returns small triangles in the cube of this half size around a point.
fn cloud(random: &mut Random, center: Vec3, half: f32) -> Vec<Triangle> {
    let corners = |random: &mut Random| {
        let near = center + random.point() * half;
        Triangle([near, near + random.point() * half / 20.0, near + random.point() * half / 20.0])
    };
    (0..2000).map(|_| corners(random)).collect()
}

/// Returns rays from a distance, in the given unit, towards points in the cube of this half size.
fn rays(random: &mut Random, center: Vec3, half: f32, distance: f32) -> Vec<Ray> {
    let ray = |random: &mut Random| {
        let target = center + random.point() * half;
        let mut away = random.point().normalize();
        // A quarter runs along an axis.
        if random.below(4) == 0 {
            away = random.of(&Vec3::AXES);
        }
        let origin = target + away * distance;
        // In f64 from the origin as it is rounded, so that it does meet the target.
        let towards = (target.as_dvec3() - origin.as_dvec3()).normalize().as_vec3();
        Ray::half_line(origin, towards).unwrap()
    };
    (0..300).map(|_| ray(random)).collect()
}

fn scenes() -> Vec<Scene> {
    let mut random = Random(8);
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
    let size = |k: i32| (2.0f64.powi(k)) as f32;
    let chain = |k: i32| {
        Triangle::from(
            [[2.0, 0.0, 0.0], [3.0, 1.0, 0.0], [3.0, 0.0, 1.0]]
                .map(|c| c.map(|x: f32| x * size(k))),
        )
    };
    let triangles: Vec<Triangle> = (-126..120).map(chain).collect();
    let rays = (0..300)
        .map(|i| {
            let k = -126 + i % 246;
            let origin = random.point() * size(k + random.below(4) as i32 - 1);
            let target = (Vec3::new(2.7, 0.3, 0.3) + random.point() * 0.4) * size(k);
            let towards = (target.as_dvec3() - origin.as_dvec3()).normalize().as_vec3();
            Ray::half_line(origin, towards).unwrap()
        })
        .collect();
    scenes.push(Scene { name: "chain of all sizes".to_owned(), triangles, rays });
    scenes
}

/// Returns the distances at which a ray enters and leaves a box, in f64.
fn interval(ray: &Ray, aabb: &Aabb) -> (f64, f64) {
    let (origin, direction) = (ray.origin().as_dvec3(), ray.direction().as_dvec3());
    let low = aabb.min.as_dvec3() - origin;
    let high = aabb.max.as_dvec3() - origin;
    let mut interval = (0.0f64, f64::INFINITY);
    for axis in 0..3 {
        if direction[axis] == 0.0 {
            if low[axis] > 0.0 || high[axis] < 0.0 {
                return (f64::INFINITY, 0.0);
            }
            continue;
        }
        let [a, b] = [low, high].map(|side: DVec3| side[axis] / direction[axis]);
        interval = (interval.0.max(a.min(b)), interval.1.min(a.max(b)));
    }
    interval
}

/// Counts the tests of the same traversal with boxes that are tested in f64.
fn real_counts(tree: &Bvh, triangles: &[Triangle], ray: &Ray) -> TestCounts {
    let prepared = PreparedRay::new(ray);
    let mut counts = TestCounts { boxes: 1, objects: 0 };
    let mut nearest = Hit { t: ray.t_max(), object: u32::MAX };
    let entry = |node: usize| {
        let (entry, exit) = interval(ray, &tree.nodes[node].aabb);
        if entry <= exit * (1.0 + 1e-14) { entry as f32 } else { f32::INFINITY }
    };
    let mut stack = vec![(entry(0), 0)];
    while let Some((distance, node)) = stack.pop() {
        if distance > nearest.t {
            continue;
        }
        match tree.nodes[node].kind() {
            NodeKind::Leaf { .. } => {
                for &id in &tree.prim_ids[tree.nodes[node].prims()] {
                    counts.objects += 1;
                    if let Some(t) = triangles[id as usize].intersect(&prepared, nearest.t) {
                        let hit = Hit { t, object: id };
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

#[test]
fn tests_per_ray_are_at_most_twice_those_in_real_arithmetic() {
    let mut random = Random(1);
    for Scene { name, triangles, rays } in scenes() {
        let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
        let tree = tree(&boxes, SHAPES[0], &mut random);
        let wide = WideBvh::new(&tree, &triangles).unwrap();
        let mut real = TestCounts::default();
        let mut ours = TestCounts::default();
        let mut of_layout = TestCounts::default();
        let mut hits = 0;
        for ray in &rays {
            let counts = real_counts(&tree, &triangles, ray);
            real.boxes += counts.boxes;
            real.objects += counts.objects;
            let prepared = PreparedRay::new(ray);
            let test = |id: u32, t_max| triangles[id as usize].intersect(&prepared, t_max);
            let hit = nearest_hit_by(&tree, ray, test, &mut ours);
            hits += usize::from(hit.is_some());
            assert_eq!(wide.nearest_hit_counted(ray, &mut of_layout), hit, "{name}: {ray:?}");
            assert_eq!(wide.nearest_hit(ray), hit, "{name}: {ray:?}");
        }
        assert!(hits > rays.len() / 10, "{name}: {hits}");
        let sum = |counts: TestCounts| counts.boxes + counts.objects;
        // The layout tests eight boxes and four triangles at a time, used or not.
        for counts in [ours, of_layout] {
            assert!(
                sum(counts) <= 2 * sum(real),
                "{name}: {counts:?}, in real arithmetic {real:?}"
            );
        }
    }
}
