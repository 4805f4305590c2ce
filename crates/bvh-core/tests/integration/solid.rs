//! Points are inside of meshes, closed or not, exactly where the sum over all triangles says so.

use crate::support::layouts::divided;
use crate::support::{
    Random, SHAPES, ball, boxes, closed_meshes, grid_box, mapped, scaled, soup, tree,
};
use InsideRule::{Auto, Parity, Winding};
use bvh_core::{Aabb, Bvh, InsideRule, Node, Solid, Triangle, WideBvh};
use glam::Vec3;
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Returns which points are inside, by a tree of some shape.
fn contains(triangles: &[Triangle], shape: usize, points: &[Vec3], rule: InsideRule) -> Vec<bool> {
    let tree = tree(&boxes(triangles), SHAPES[shape], &mut Random(5));
    contains_by(&tree, triangles, points, rule)
}

fn contains_by(tree: &Bvh, triangles: &[Triangle], points: &[Vec3], rule: InsideRule) -> Vec<bool> {
    let wide = WideBvh::new(tree, triangles).unwrap();
    let mut inside = vec![false; points.len()];
    Solid::new(tree, triangles).contains(&wide, points, rule, &mut inside);
    inside
}

fn is_watertight(triangles: &[Triangle]) -> bool {
    let tree = tree(&boxes(triangles), SHAPES[0], &mut Random(5));
    Solid::new(&tree, triangles).is_watertight()
}

/// Returns the winding number by all triangles, whose half solid angles are arguments of products
/// of unit vectors.
fn winding_number(triangles: &[Triangle], point: Vec3) -> f64 {
    let halves = triangles.iter().map(|triangle| {
        let [a, b, c] =
            triangle.0.map(|corner| (corner.as_dvec3() - point.as_dvec3()).normalize_or_zero());
        f64::atan2(a.dot(b.cross(c)), 1.0 + a.dot(b) + b.dot(c) + c.dot(a))
    });
    halves.sum::<f64>() / TAU
}

/// Compares every answer with the sum over all triangles, but for points where rounding decides.
fn compare(name: &str, triangles: &[Triangle], points: &[Vec3]) {
    for shape in [0, 3] {
        let inside = contains(triangles, shape, points, Winding);
        let mut compared = 0;
        for (&point, inside) in points.iter().zip(inside) {
            let number = winding_number(triangles, point);
            if (number.abs() - 0.5).abs() > 1e-9 {
                assert_eq!(inside, number.abs() > 0.5, "{name}: {number} at {point}");
                compared += 1;
            }
        }
        assert!(2 * compared > points.len(), "{name}: {compared}");
    }
}

/// Returns a mesh around zero whose corners run counterclockwise as seen from outside.
fn outward(triangles: Vec<Triangle>) -> Vec<Triangle> {
    let turned = |Triangle([a, b, c]): Triangle| {
        let is_outward = (b - a).cross(c - a).dot(a + b + c) > 0.0;
        Triangle(if is_outward { [a, b, c] } else { [a, c, b] })
    };
    triangles.into_iter().map(turned).collect()
}

fn inside_out(triangles: Vec<Triangle>) -> Vec<Triangle> {
    triangles.into_iter().map(|Triangle([a, b, c])| Triangle([a, c, b])).collect()
}

fn moved(triangles: &[Triangle], by: Vec3) -> Vec<Triangle> {
    mapped(triangles, |corner| corner + by)
}

/// Returns meshes with holes or overlaps, and whether they are watertight.
fn imperfect_meshes() -> Vec<(&'static str, Vec<Triangle>, bool)> {
    let closed = outward(grid_box(2));
    let open = closed[8..].to_vec();
    let sphere = outward(ball(2));
    let overlapping = [closed.clone(), moved(&closed, Vec3::new(0.7, 0.3, 0.9))].concat();
    vec![
        ("box", closed.clone(), true),
        ("inside-out box", inside_out(closed.clone()), true),
        ("open box", open.clone(), false),
        ("box with doubled faces", closed.repeat(2), true),
        ("open box with doubled faces", open.repeat(2), false),
        ("overlapping boxes", overlapping.clone(), true),
        ("overlapping boxes with a hole", overlapping[1..].to_vec(), false),
        ("nested shells", [scaled(&sphere, 1.5), sphere.clone()].concat(), true),
        ("nested shells with a hole", [scaled(&sphere, 1.5), sphere[1..].to_vec()].concat(), false),
        ("cavity", [scaled(&sphere, 1.5), inside_out(sphere.clone())].concat(), true),
        ("ball with a hole", sphere[..sphere.len() - 1].to_vec(), false),
        ("soup", soup(300, &mut Random(9)), false),
    ]
}

#[test]
fn points_are_inside_meshes_with_holes_and_overlaps_as_all_triangles_together_say() {
    let mut random = Random(1);
    for (name, triangles, is_closed) in imperfect_meshes() {
        assert_eq!(is_watertight(&triangles), is_closed, "{name}");
        let mut points: Vec<Vec3> = (0..3000).map(|_| 2.0 * random.point()).collect();
        // Points near the surface, and in the gap of a hole.
        points.extend((0..1000).map(|_| {
            let Triangle([a, b, c]) = random.of(&triangles);
            (a + b + c) / 3.0 + 1e-3 * random.point()
        }));
        compare(name, &triangles, &points);
        let [auto, winding] = [Auto, Winding].map(|rule| contains(&triangles, 1, &points, rule));
        assert_eq!(auto, winding, "{name}");
    }
}

#[test]
fn a_point_of_a_closed_mesh_is_inside_by_both_rules() {
    for (name, triangles, inside) in closed_meshes() {
        assert!(is_watertight(&triangles), "{name}");
        let points = [inside, Vec3::new(7.0, -5.5, 6.25), Vec3::NAN, Vec3::INFINITY];
        for rule in [Auto, Parity] {
            let answers = contains(&triangles, 0, &points, rule);
            assert_eq!(answers, [true, false, false, false], "{name}, {rule:?}");
        }
        let answers = contains(&triangles[1..], 0, &points, Winding);
        assert_eq!(answers[1..], [false; 3], "{name}");
    }
}

#[test]
fn a_mesh_wider_than_the_largest_f32_has_an_inside() {
    for size in [1.6e38, 1.8e38, 3.4e38] {
        let mesh = scaled(&outward(grid_box(1)), size);
        let points = [[-0.9, 0.1, 0.2], [0.9, 0.1, 0.2], [0.0, 0.1, 0.2], [-0.99, 0.5, 0.1]]
            .map(|point| size * Vec3::from(point));
        for rule in [Auto, Parity, Winding] {
            assert_eq!(contains(&mesh, 0, &points, rule), [true; 4], "{size}, {rule:?}");
            assert_eq!(contains(&mesh[1..], 0, &points, Winding), [true; 4], "{size}");
        }
    }
}

#[test]
fn a_triangle_without_area_changes_no_inside() {
    let triangle = Triangle::from([[2.0, 2.0, 0.0], [1.0, 4.0, 3.0], [3.0, 1.0, 3.0]]);
    let mut random = Random(3);
    for _ in 0..50 {
        // Whole numbers, so that the corners and the points are on one line exactly.
        let [from, step] = [(); 2].map(|()| (8.0 * random.point()).round());
        let on_line = [-3.0, 0.0, 2.0, -1.0, 1.0].map(|along| from + along * step);
        let line = Triangle([on_line[0], on_line[1], on_line[2]]);
        let [without, with] = [vec![triangle], vec![triangle, line]]
            .map(|mesh| contains(&mesh, 0, &on_line, Winding));
        assert_eq!(with, without, "{line:?}");
    }
}

#[test]
fn of_eight_boxes_with_common_faces_one_contains_each_point_of_them() {
    let middle = outward(grid_box(2));
    let at = |i: u8, n: u8| Vec3::from([i % n, i / n % n, i / n / n].map(f32::from));
    let points: Vec<Vec3> = (0..125).map(|i| 0.5 * at(i, 5) - 1.0).collect();
    for number in 0..8 {
        let center = 2.0 * at(number, 2) - 1.0;
        let mesh = moved(&middle, center);
        for rule in [Parity, Winding] {
            // Faces, edges and corners at 0 belong to the box below in x, and above in y and z.
            for (point, is_inside) in points.iter().zip(contains(&mesh, 0, &points, rule)) {
                let above = [point.x > 0.0, point.y >= 0.0, point.z >= 0.0];
                assert_eq!(is_inside, above == [0, 1, 2].map(|i| center[i] > 0.0), "{point}");
            }
        }
    }
}

#[test]
fn a_zero_with_a_sign_opens_no_mesh() {
    let mesh = moved(&outward(grid_box(1)), Vec3::ONE);
    let negated = mapped(&mesh, |p| Vec3::select(p.cmpeq(Vec3::ZERO), -Vec3::ZERO, p));
    let mixed = [&mesh[..5], &negated[5..]].concat();
    assert!(is_watertight(&mixed));
    assert!(!is_watertight(&mixed[1..]));
}

#[test]
fn a_divided_triangle_counts_once() {
    let triangles = outward(ball(2))[3..].to_vec();
    let count = triangles.len() as u32;
    let all = Aabb::union_of(&boxes(&triangles));
    let halves = Bvh::new(
        vec![Node::inner(all, 1, 2), Node::leaf(all, 0, count), Node::leaf(all, count, count)],
        (0..count).chain(0..count).collect(),
    );
    let mut random = Random(5);
    let mut parts = tree(&boxes(&triangles), SHAPES[0], &mut random);
    // So many parts that some subtrees have no triangle that is not counted elsewhere.
    while parts.prim_ids.len() < 20 * triangles.len() {
        (parts, _) = divided(&parts, &triangles, &mut random);
    }
    let points: Vec<Vec3> = (0..200).map(|i| Vec3::Y * (i as f32 / 50.0 - 2.0)).collect();
    let expected = contains(&triangles, 0, &points, Winding);
    assert!(expected.contains(&true));
    for tree in [halves, parts] {
        assert_eq!(contains_by(&tree, &triangles, &points, Winding), expected);
    }
}

#[test]
fn distances_are_negative_inside_and_infinite_without_a_closest_point() {
    let distances = |triangles: &[Triangle], points: &[Vec3]| {
        let tree = tree(&boxes(triangles), SHAPES[0], &mut Random(5));
        let wide = WideBvh::new(&tree, triangles).unwrap();
        let mut distances = vec![0.0; points.len()];
        let solid = Solid::new(&tree, triangles);
        solid.signed_distances(&wide, points, Auto, &mut distances);
        distances
    };
    let points =
        [[0.0, 0.0, 0.0], [0.5, 0.25, 0.0], [3.0, 0.0, 0.0], [4.0, 5.0, 1.0]].map(Vec3::from);
    let mesh = outward(grid_box(4));
    for mesh in [&mesh[..], &mesh[1..]] {
        assert_eq!(distances(mesh, &points), [-1.0, -0.5, 2.0, 5.0]);
    }
    assert_eq!(distances(&mesh, &[Vec3::NAN, Vec3::INFINITY]), [f64::INFINITY; 2]);
    for empty in [vec![], vec![Triangle([Vec3::ONE; 3])]] {
        assert_eq!(distances(&empty, &points[..1]), [f64::INFINITY]);
    }
}

proptest! {
    #[test]
    fn soups_at_every_scale_have_the_insides_of_their_sums(
        seed in any::<u64>(),
        count in 1usize..120,
        exponent in -120i32..120,
        spread in 0.1f32..3.0,
    ) {
        let mut random = Random(seed);
        let scale = libm::exp2f(exponent as f32);
        let triangles = scaled(&soup(count, &mut random), scale);
        // Several layers, so that some winding numbers exceed one half.
        let triangles = triangles.repeat(1 + seed as usize % 5);
        let points: Vec<Vec3> = (0..100).map(|_| spread * scale * random.point()).collect();
        compare("soup", &triangles, &points);
    }
}
