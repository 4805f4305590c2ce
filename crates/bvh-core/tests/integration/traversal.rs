//! Traversals of what is next to edges, and their counts.

use crate::support::{self, Random, SHAPES, boxes, chain, tree};
use bvh_core::{
    Aabb, Bvh, Hit, PreparedRay, Ray, TestCounts, Triangle, WideBvh, any_hit_by, clip_to_box,
    nearest_hit_by,
};
use glam::Vec3;

/// Two adjacent triangles share an edge along one axis, and their boxes share a face. A ray that
/// starts close to the edge and runs nearly along it hits the sheet next to the edge. There the
/// rounding of the far corners moves the decision which triangle is hit by far more than the
/// rounding of the box test moves the boxes.
#[test]
fn no_ray_slips_between_the_boxes_beside_a_long_edge() {
    let mut random = Random(4);
    for axis in 0..3 {
        let ends = [turned(axis, 0.0, -1.0, 0.0), turned(axis, 0.0, 1.0, 0.0)];
        let triangles =
            [-1.0, 1.0].map(|x| Triangle([ends[0], ends[1], turned(axis, x, 0.0, 0.0)]));
        let tree = tree(&boxes(&triangles), SHAPES[0], &mut random);
        let wide = WideBvh::new(&tree, &triangles).unwrap();
        for _ in 0..20_000 {
            let height = random.of(&[1e-3, 1e-4, 1e-5, 1e-6]) * (1.0 + random.unit());
            let aside = random.unit() - 0.5;
            let rise = 0.3 + 0.6 * random.unit();
            let start = -aside / rise * height + (random.unit() - 0.5) * 2e-7;
            let origin = turned(axis, start, random.unit() - 0.5, -height);
            let ray = Ray::half_line(origin, turned(axis, aside, 1.0, rise)).unwrap();
            let prepared = PreparedRay::new(&ray);
            let test = |id: u32| triangles[id as usize].intersect(&prepared, ray.t_max()).is_some();
            assert!(any_hit_by(&tree, &ray, test, &mut ()), "axis {axis}: {ray:?}");
            assert!(
                wide.any_hit(&ray) && wide.any_hit_counted(&ray, &mut ()),
                "axis {axis}: {ray:?}"
            );
        }
    }
}

/// Returns the point x, y, z with its coordinates turned so that x is along `axis`.
fn turned(axis: usize, x: f32, y: f32, z: f32) -> Vec3 {
    let mut point = Vec3::ZERO;
    point[axis] = x;
    point[(axis + 1) % 3] = y;
    point[(axis + 2) % 3] = z;
    point
}

fn tests_of_nearest(tree: &Bvh, boxes: &[Aabb], ray: &Ray) -> TestCounts {
    let mut counts = TestCounts::default();
    let test = |id: u32, t_max| clip_to_box(ray, &boxes[id as usize], 0.0, t_max);
    nearest_hit_by(tree, ray, test, &mut counts);
    counts
}

/// Counts the tests of the search for any object, where every object is hit.
fn tests_of_any(tree: &Bvh, ray: &Ray) -> TestCounts {
    let mut counts = TestCounts::default();
    any_hit_by(tree, ray, |_| true, &mut counts);
    counts
}

#[test]
fn counts_include_the_root_and_stop_at_the_first_hit() {
    let boxes = [0.0, 2.0, 4.0, 6.0].map(|x| Aabb { min: Vec3::X * x, max: Vec3::X * x + 1.0 });
    let tree = chain(&boxes);
    let middle = Vec3::splat(0.5);
    let forwards = Ray::half_line(middle - Vec3::X, Vec3::X).unwrap();
    assert_eq!(tests_of_any(&tree, &forwards), TestCounts { boxes: 3, objects: 1 });
    assert_eq!(tests_of_nearest(&tree, &boxes, &forwards), TestCounts { boxes: 3, objects: 1 });
    let backwards = Ray::half_line(middle + Vec3::X * 9.0, -Vec3::X).unwrap();
    assert_eq!(tests_of_any(&tree, &backwards), TestCounts { boxes: 7, objects: 1 });
    // No object is hit: every node is visited, and none by a call of its own.
    let triangles = vec![Triangle([Vec3::ZERO, Vec3::Y * 9.0, Vec3::Z * 9.0]); 20_000];
    let deep = chain(&support::boxes(&triangles));
    let mut counts = TestCounts::default();
    assert!(!any_hit_by(&deep, &forwards, |_| false, &mut counts));
    let expected = TestCounts { boxes: 39_999, objects: 20_000 };
    assert_eq!((counts, deep.depth()), (expected, 19_999));
    let wide = WideBvh::new(&deep, &triangles).unwrap();
    assert_eq!(wide.nearest_hit(&forwards), Some(Hit { t: 0.5, object: 0 }));
    // A ray that misses the root tests only the root's box.
    let past = Ray::half_line(middle + Vec3::X * 9.0, Vec3::X).unwrap();
    assert_eq!(tests_of_nearest(&tree, &boxes, &past), TestCounts { boxes: 1, objects: 0 });
    assert_eq!(nearest_hit_by(&Bvh::default(), &past, |_, _| Some(0.0), &mut ()), None);
    // A ray with an empty range does so too.
    let empty = Ray::new(middle - Vec3::X, Vec3::X, 2.0, 1.0).unwrap();
    assert_eq!(tests_of_nearest(&tree, &boxes, &empty), TestCounts { boxes: 1, objects: 0 });
}
