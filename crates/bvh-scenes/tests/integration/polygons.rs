//! Polygons are covered once by their triangles, whatever their shape and their first corner.

use crate::samples::read;
use bvh_core::Triangle;
use bvh_scenes::load::mesh::Mesh;
use proptest::prelude::*;
use std::f64::consts::TAU;
use std::fmt::Write;

/// Reads one polygon as an OBJ file and as a PLY file, which must agree.
fn mesh(corners: &[[f32; 3]]) -> Mesh {
    let mut obj = String::new();
    let mut ply = format!(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\nelement face 1\nproperty list int int vertex_indices\nend_header\n",
        corners.len()
    );
    for [x, y, z] in corners {
        writeln!(obj, "v {x} {y} {z}").unwrap();
        writeln!(ply, "{x} {y} {z}").unwrap();
    }
    let indices =
        |first: usize| (first..first + corners.len()).map(|i| format!(" {i}")).collect::<String>();
    writeln!(obj, "f{}", indices(1)).unwrap();
    writeln!(ply, "{}{}", corners.len(), indices(0)).unwrap();
    let obj = read(obj.as_bytes(), "a.obj").unwrap();
    assert_eq!(read(ply.as_bytes(), "a.ply").unwrap(), obj);
    obj
}

#[test]
fn a_polygon_is_the_fan_around_its_first_corner_only_if_that_covers_it() {
    let mut arrow = vec![[2.0, 1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]];
    for first in 0..4 {
        // Both corners of the only diagonal inside, at 0 and 2, begin a fan.
        let expected = match first % 2 {
            0 => [[0, 1, 2], [0, 2, 3]],
            _ => [[0, 1, 3], [1, 2, 3]],
        };
        let expected = Triangle::from_mesh(&arrow, &expected).unwrap();
        assert_eq!(mesh(&arrow).triangles, expected, "{first}");
        arrow.rotate_left(1);
    }
}

#[test]
fn a_polygon_that_crosses_itself_is_a_fan_with_a_remark() {
    let bow = [[0.0, 0.0, 0.0], [3.0, 2.0, 0.0], [3.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mesh = mesh(&bow);
    assert_eq!(mesh.triangles, Triangle::from_mesh(&bow, &[[0, 1, 2], [0, 2, 3]]).unwrap());
    assert_eq!(
        mesh.remarks,
        ["faces that cross themselves, read as the fans around their first vertices: 1"]
    );
}

#[test]
fn an_edge_that_runs_out_and_back_adds_triangles_without_area() {
    let square =
        [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [1.0, 3.0], [1.0, 2.0], [0.0, 2.0]];
    let triangles = mesh(&square.map(|[x, y]| [x, y, 0.0])).triangles;
    let area = |t: &Triangle| (t.0[1] - t.0[0]).cross(t.0[2] - t.0[0]).length() / 2.0;
    assert_eq!((triangles.len(), triangles.iter().map(area).sum::<f32>()), (5, 4.0));
}

#[test]
fn polygons_of_many_corners_are_covered_and_fans_where_they_cross_themselves_everywhere() {
    // The teeth of a comb.
    let comb = |i: u32| [(i - i % 2) as f32, -1e4 * (i % 2) as f32, 0.0];
    let teeth = 1 << 12;
    let back = [[teeth as f32, 9.0, 0.0], [0.0, 9.0, 0.0]];
    let corners: Vec<[f32; 3]> = (0..teeth).map(comb).chain(back).collect();
    let covered = mesh(&corners);
    assert_eq!((covered.triangles.len(), covered.remarks.len()), (corners.len() - 2, 0));
    // Twice round a circle, in and out.
    let twice = |i: u32| {
        let (sin, cos) = (TAU * f64::from(i) / 2047.0).sin_cos();
        [cos, sin, 0.0].map(|x| ((1.0 + 0.1 * f64::from(i % 2)) * x) as f32)
    };
    let corners: Vec<[f32; 3]> = (0..4094).map(twice).collect();
    let fan: Vec<[u32; 3]> = (2..4094).map(|i| [0, i - 1, i]).collect();
    assert_eq!(mesh(&corners).triangles, Triangle::from_mesh(&corners, &fan).unwrap());
}

type Point = [i64; 2];

fn area([a, b, c]: [Point; 3]) -> i64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

proptest! {
    #[test]
    fn a_point_in_a_star_is_in_one_of_its_triangles_and_a_point_outside_in_none(
        radii in prop::collection::vec(1.0_f64..1000.0, 4..40),
        first in any::<prop::sample::Index>(),
        is_reversed in any::<bool>(),
        axes in prop::sample::select(vec![[0, 1, 2], [2, 0, 1], [1, 2, 0], [1, 0, 2]]),
        points in prop::collection::vec([-1000i64..1000, -1000i64..1000], 100),
    ) {
        let count = radii.len();
        let mut star: Vec<Point> = radii
            .iter()
            .enumerate()
            .map(|(i, radius)| {
                let (sin, cos) = (TAU * i as f64 / count as f64).sin_cos();
                [radius * cos, radius * sin].map(|x| x.round() as i64)
            })
            .collect();
        star.rotate_left(first.index(count));
        if is_reversed {
            star.reverse();
        }
        // An oblique plane, in which the coordinates stay whole numbers.
        let corners: Vec<[f32; 3]> = star
            .iter()
            .map(|&[x, y]| {
                let point = [x, y, 2 * x - y].map(|x| x as f32);
                axes.map(|axis: usize| point[axis])
            })
            .collect();
        let flat = |corner: glam::Vec3| -> Point {
            let place = |axis| axes.iter().position(|a| *a == axis).unwrap();
            [corner[place(0)] as i64, corner[place(1)] as i64]
        };
        let mesh = mesh(&corners);
        prop_assume!(!mesh.remarks.iter().any(|remark| remark.contains("cross")));
        prop_assert_eq!(mesh.triangles.len() <= count - 2, true);
        for point in points {
            let signs = |triangle: &Triangle| {
                let corners = triangle.0.map(flat);
                [0, 1, 2].map(|i| area([corners[i], corners[(i + 1) % 3], point]).signum())
            };
            let all: Vec<[i64; 3]> = mesh.triangles.iter().map(signs).collect();
            let is_on_edge = all.iter().flatten().any(|sign| *sign == 0);
            let holding = all.iter().filter(|[a, b, c]| a == b && b == c).count();
            let is_inside = (0..count).fold(false, |inside, i| {
                let (a, b) = (star[i], star[(i + 1) % count]);
                let crosses = (a[1] > point[1]) != (b[1] > point[1])
                    && (area([a, b, point]) > 0) == (b[1] > a[1]);
                inside != crosses
            });
            if !is_on_edge {
                prop_assert_eq!(holding, usize::from(is_inside), "{:?}", point);
            }
        }
    }
}
