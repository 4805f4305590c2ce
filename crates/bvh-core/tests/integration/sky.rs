//! What points see of a sky: every pair of a point and a direction as one ray, on every kernel.

use crate::support::{Random, SHAPES, ball, chain, grid_box, junction, soup, tree};
use bvh_core::{
    Bvh, DRay, DTriangle, DWideBvh, Frame, InFrame, InvalidSky, Kernel, Ray, Select, Sky, Traced,
    Triangle, View, WideBvh, neighbours,
};
use core::num::NonZeroU32;
use glam::{DMat3, DQuat, DVec3, Vec3};

/// Returns points in general places, on faces, edges and corners, beside them, and far away.
fn points(triangles: &[[DVec3; 3]], count: usize, random: &mut Random) -> Vec<DVec3> {
    let corners = || triangles.iter().flatten().copied();
    let min = corners().fold(DVec3::INFINITY, DVec3::min);
    let size = (corners().fold(DVec3::NEG_INFINITY, DVec3::max) - min).max_element();
    let mut points = Vec::new();
    for number in 0..count {
        if number < 64 {
            // So close together that they look as beams; others look as fans.
            points.push(triangles[0][0] + random.point().as_dvec3() * size * 1e-3);
            continue;
        }
        let [a, b, c] = random.of(triangles);
        let u = f64::from(random.unit());
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let far = if number % 64 == 63 { 1e4 } else { 1.0 };
        points.push(match random.below(7) {
            0 => a,
            1 => a + (b - a) * u,
            2 => (a + b + c) / 3.0,
            3 => (a + b + c) / 3.0 + normal * size * 1e-6,
            4 => a + normal * size * 0.01,
            _ => min + (random.point().as_dvec3() + 0.5) * size * far,
        });
    }
    points
}

/// Returns directions along axes, edges and normals, from points to corners, and any others.
fn directions(triangles: &[[DVec3; 3]], points: &[DVec3], random: &mut Random) -> Vec<DVec3> {
    let mut directions = vec![DVec3::X, -DVec3::Y, DVec3::Z * 1e-3, DVec3::new(1.0, -1.0, 1e-12)];
    while directions.len() < 70 {
        let [a, b, c] = random.of(triangles);
        let direction = match random.below(5) {
            0 => b - a,
            1 => (b - a).cross(c - a),
            2 => a - random.of(points),
            3 => (a + b) * 0.5 - random.of(points),
            _ => random.point().as_dvec3(),
        };
        let length = direction.length();
        if length.is_normal() {
            directions.push(direction / length);
        }
    }
    directions
}

/// A frame of a random rotation around a point.
fn frame(centre: DVec3, random: &mut Random) -> Frame {
    let turn = DQuat::from_axis_angle(random.point().as_dvec3().normalize(), 1.1);
    Frame::new(DMat3::from_quat(turn), centre).unwrap()
}

fn shapes(random: &mut Random) -> [Vec<Triangle>; 4] {
    [soup(200, random), ball(3), grid_box(5), junction()]
}

/// The tree over boxes in a frame: a chain now and then, which is as deep as it can be.
fn any_tree(boxes: &[bvh_core::Aabb], frame: Option<Frame>, random: &mut Random) -> Bvh {
    let bvh = match random.below(4) {
        0 => chain(boxes),
        _ => tree(boxes, random.of(&SHAPES), random),
    };
    Bvh { frame, ..bvh }
}

/// Compares what points see with whether the ray of a point, by its number, hits anything along a
/// direction. Returns how many directions are hidden, and how many are free.
fn compared<L: Traced>(
    layout: &L,
    sky: &Sky,
    points: &[L::Point],
    is_hit: impl Fn(usize, DVec3) -> bool,
) -> [usize; 2] {
    let mut counts = [0; 2];
    let mut seen = Vec::new();
    let order: Vec<u32> = (0..points.len() as u32).collect();
    sky.visible(layout, View { points, normals: None }, &order, |point, row| {
        seen.push(point);
        for (number, &direction) in sky.directions().iter().enumerate() {
            let is_free = row[number / 64] >> (number % 64) & 1 != 0;
            assert_eq!(
                is_free,
                !is_hit(point, direction),
                "{:?}: {direction:?}",
                points[point].into()
            );
            counts[usize::from(is_free)] += 1;
        }
    });
    seen.sort_unstable();
    assert!(seen.into_iter().eq(0..points.len()));
    counts
}

#[test]
fn a_direction_is_free_where_a_ray_along_it_hits_nothing_on_every_kernel() {
    let mut random = Random(70);
    let mut counts = [0; 2];
    for triangles in shapes(&mut random) {
        for (size, offset) in [(1.0, 0.0), (1.0, 1e5), (1e-30, 0.0), (1e30, 0.0), (3e-42, 0.0)] {
            let moved = |p: Vec3| (p * size) + Vec3::new(offset, -offset, 0.3 * offset);
            let triangles: Vec<Triangle> =
                triangles.iter().map(|t| Triangle(t.0.map(moved))).collect();
            let corners: Vec<[DVec3; 3]> =
                triangles.iter().map(|t| t.0.map(Vec3::as_dvec3)).collect();
            let points = points(&corners, 192, &mut random);
            let directions = directions(&corners, &points, &mut random);
            let points: Vec<Vec3> = points.iter().map(|p| p.as_vec3()).collect();
            let frames = [None, Some(frame(points[0].as_dvec3(), &mut random))];
            for frame in frames {
                let objects = InFrame { triangles: &triangles, frame: frame.as_ref() };
                let tree = any_tree(&objects.boxes(), frame, &mut random);
                let wide = WideBvh::new(&tree, &triangles).unwrap();
                let t = f64::from(size * random.unit());
                let range = random.of(&[[0.0, f64::INFINITY], [0.0, t], [t * 0.1, t], [t, 1e38]]);
                let sky = Sky::new(directions.clone(), range).unwrap();
                for kernel in Kernel::ALL {
                    let Some(wide) = wide.clone().with_kernel(kernel) else { continue };
                    let [t_min, t_max] = range.map(|t| t as f32);
                    let found = compared(&wide, &sky, &points, |point, direction| {
                        let ray = Ray::new(points[point], direction.as_vec3(), t_min, t_max);
                        wide.any_hit(&ray.unwrap())
                    });
                    counts = [counts[0] + found[0], counts[1] + found[1]];
                }
            }
        }
    }
    assert!(counts[0] > 100_000 && counts[1] > 100_000, "{counts:?}");
}

#[test]
fn a_direction_is_free_in_f64_where_a_ray_along_it_hits_nothing_on_every_kernel() {
    let mut random = Random(71);
    let mut counts = [0; 2];
    for triangles in shapes(&mut random) {
        for (size, offset) in [(1.0, 0.0), (1.0, 1e7), (1e-30, 0.0), (1e30, 0.0)] {
            let moved =
                |p: Vec3| p.as_dvec3() * 1.1 * size + DVec3::new(offset, -offset, 0.3 * offset);
            let triangles: Vec<DTriangle> =
                triangles.iter().map(|t| DTriangle(t.0.map(moved))).collect();
            let corners: Vec<[DVec3; 3]> = triangles.iter().map(|t| t.0).collect();
            let points = points(&corners, 192, &mut random);
            let mut directions = directions(&corners, &points, &mut random);
            // The second component counts as 0.
            directions.push(DVec3::new(2.0f64.powi(-99), 2.0f64.powi(-151), 2.0f64.powi(-101)));
            let frame = match random.below(2) {
                0 => frame(points[0], &mut random),
                _ => DWideBvh::centred(&triangles),
            };
            let tree = any_tree(&DWideBvh::boxes(&triangles, &frame), Some(frame), &mut random);
            let wide = DWideBvh::new(&tree, &triangles).unwrap();
            let t = size * f64::from(random.unit());
            let range = random.of(&[[0.0, f64::INFINITY], [0.0, t], [t * 0.1, t]]);
            let sky = Sky::new(directions.clone(), range).unwrap();
            for kernel in Kernel::ALL {
                let Some(wide) = wide.clone().with_kernel(kernel) else { continue };
                let found = compared(&wide, &sky, &points, |point, direction| {
                    let ray = DRay::new(points[point], direction, range[0], range[1]).unwrap();
                    wide.any_hit(&ray, Select::default())
                });
                counts = [counts[0] + found[0], counts[1] + found[1]];
            }
        }
    }
    assert!(counts[0] > 100_000 && counts[1] > 100_000, "{counts:?}");
}

#[test]
fn a_layout_in_f32_looks_along_directions_rounded_to_f32() {
    let mut random = Random(72);
    // Small triangles far away, that a rounded direction often misses where the given one hits.
    let place = Vec3::new(3000.0, 7000.0, 5000.0);
    let moved = |to: Vec3| move |t: &Triangle| Triangle(t.0.map(|p| p + to));
    let mut triangles: Vec<Triangle> = soup(50, &mut random).iter().map(moved(place)).collect();
    // A scene so large that the points are not far from it.
    triangles.extend(triangles.clone().iter().map(moved(-3.0 * place)));
    let wide = laid(&triangles);
    let points: Vec<Vec3> = (0..64).map(|_| random.point()).collect();
    let mut edge = || {
        let Triangle([a, b, _]) = random.of(&triangles[..50]);
        let to = a.as_dvec3().lerp(b.as_dvec3(), random.unit().into());
        (to - points[random.below(64)].as_dvec3()).normalize()
    };
    let directions: Vec<DVec3> = (0..500).map(|_| edge()).collect();
    let sky = Sky::new(directions, [0.0, f64::INFINITY]).unwrap();
    compared(&wide, &sky, &points, |point, direction| {
        wide.any_hit(&Ray::half_line(points[point], direction.as_vec3()).unwrap())
    });
}

#[test]
fn a_triangle_farther_away_than_any_number_stops_nothing() {
    let z = 2.0f32.powi(29);
    let wide = laid(&[Triangle::from([[-z, -z, z], [z, -z, z], [0.0, z, z]])]);
    let directions = vec![DVec3::Z * 2.0f64.powi(-100), DVec3::Z];
    let sky = Sky::new(directions, [0.0, f64::INFINITY]).unwrap();
    let counts = compared(&wide, &sky, &[Vec3::ZERO; 8], |_, direction| {
        wide.any_hit(&Ray::half_line(Vec3::ZERO, direction.as_vec3()).unwrap())
    });
    assert_eq!(counts, [8, 8]);
}

#[test]
fn a_normal_of_any_length_counts_in_f64() {
    let triangles = [DTriangle([DVec3::X, DVec3::Y, DVec3::ONE].map(|p| p + DVec3::splat(9.0)))];
    let frame = DWideBvh::centred(&triangles);
    let tree = tree(&DWideBvh::boxes(&triangles, &frame), SHAPES[1], &mut Random(1));
    let wide = DWideBvh::new(&Bvh { frame: Some(frame), ..tree }, &triangles).unwrap();
    let sky = Sky::new(vec![DVec3::Z], [0.0, f64::INFINITY]).unwrap();
    let view =
        View { points: &[DVec3::ZERO; 2], normals: Some(&[1e-46, -1e-46].map(|z| DVec3::Z * z)) };
    sky.visible(&wide, view, &[0, 1], |point, row| assert_eq!(row, [[1], [0]][point]));
}

/// A layout of triangles along the axes of the file.
fn laid(triangles: &[Triangle]) -> WideBvh {
    let boxes = bvh_core::boxes(triangles);
    WideBvh::new(&tree(&boxes, SHAPES[1], &mut Random(1)), triangles).unwrap()
}

#[test]
fn with_normals_directions_below_the_surface_are_not_free_and_cosines_weigh() {
    let triangles = [Triangle::from([[0.0, 0.0, 9.0], [1.0, 0.0, 9.0], [0.0, 1.0, 9.0]])];
    let wide = laid(&triangles);
    let down = DVec3::new(0.0, 3.0, -4.0);
    let up = DVec3::new(3.0, 0.0, 4.0);
    let sky = Sky::new(vec![up, down, DVec3::X], [0.0, f64::INFINITY]).unwrap();
    let sky = sky.with_weights(vec![1.0, 10.0, 2.0, 20.0, 4.0, 40.0]).unwrap();
    let points = [Vec3::ZERO; 2];
    let normals = [Vec3::Z * 5.0, -Vec3::Z];
    let seen = |normals, order: &[u32]| {
        let mut free = Vec::new();
        sky.visible(&wide, View { points: &points, normals }, order, |point, row| {
            free.push((point, row[0]));
        });
        free
    };
    assert_eq!(seen(Some(&normals[..]), &[1, 0]), [(1, 0b010), (0, 0b001)]);
    assert_eq!(sky.sums(&[0b010], None), [2.0, 20.0]);
    assert_eq!(sky.sums(&[0b001], Some(normals[0].as_dvec3())), [0.8, 8.0]);
    assert_eq!(sky.sums(&[0b001], Some(DVec3::Z * 1e200)), [0.8, 8.0]);
    assert_eq!(seen(None, &[0, 1]), [(0, 0b111), (1, 0b111)]);
    assert_eq!(sky.sums(&[0b111], None), [7.0, 70.0]);
}

#[test]
fn the_view_of_the_sky_from_a_street_and_before_a_wall_is_that_of_its_formula() {
    // Long walls of height 1: one, or two at a distance of 2. A point on the ground sees the angle
    // from the upper edge of one wall to that of the other, or to the horizon.
    let length = 1e4;
    let wall = |x: f32| {
        let [a, b] = [-length, length];
        [[[x, a, 0.0], [x, b, 0.0], [x, b, 1.0]], [[x, a, 0.0], [x, b, 1.0], [x, a, 1.0]]]
    };
    for (places, far) in [(&[-1.0, 1.0][..], 1.0), (&[-1.0], f64::INFINITY)] {
        let walls: Vec<Triangle> =
            places.iter().copied().flat_map(wall).map(Triangle::from).collect();
        let xs = [-0.9, -0.5, 0.0, 0.7f32];
        let points = xs.map(|x| Vec3::new(x, 0.0, 0.0));
        let view = View { points: &points, normals: Some(&[Vec3::Z; 4]) };
        let sky = Sky::uniform(100_000);
        sky.visible(&laid(&walls), view, &neighbours(&points), |point, row| {
            let x = f64::from(xs[point]);
            // Of the angle that an edge of this distance has with the vertical.
            let sine = |distance: f64| distance.min(1e9) / distance.min(1e9).hypot(1.0);
            let formula = (sine(far - x) + sine(1.0 + x)) / 2.0;
            let seen = sky.sums(row, Some(DVec3::Z))[0];
            assert!((seen - formula).abs() < 0.002, "{far} {x}: {seen} {formula}");
        });
    }
}

#[test]
fn every_point_of_a_hemispherical_hole_sees_half_of_the_sky() {
    // A sphere sends the same share of light from each of its points to equal areas of it.
    let at = |turn: usize, up: usize| {
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 / 40.0 * turn as f64).sin_cos();
        let (height, width) = (std::f64::consts::FRAC_PI_2 / 40.0 * up as f64).sin_cos();
        DVec3::new(width * cos, width * sin, -height)
    };
    let quads = (0..160).flat_map(|turn| (0..40).map(move |up| (turn, up)));
    let faces = quads.flat_map(|(turn, up)| {
        let [a, b, c, d] = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(i, j)| at(turn + i, up + j));
        [[a, b, c], [a, c, d]]
    });
    let faces: Vec<[Vec3; 3]> = faces.map(|face| face.map(|p| p.as_vec3())).collect();
    let points: Vec<Vec3> = faces.iter().step_by(97).map(|&[a, b, c]| (a + b + c) / 3.0).collect();
    let inwards: Vec<Vec3> = points.iter().map(|&point| -point).collect();
    let hole: Vec<Triangle> = faces.into_iter().map(Triangle).collect();
    let sky = Sky::uniform(20_000).with_range([1e-3, f64::INFINITY]).unwrap();
    let view = View { points: &points, normals: Some(&inwards) };
    sky.visible(&laid(&hole), view, &neighbours(&points), |point, row| {
        let seen = sky.sums(row, Some(inwards[point].as_dvec3()))[0];
        assert!((seen - 0.5).abs() < 0.01, "{}: {seen}", points[point]);
    });
}

#[test]
fn built_in_skies_cover_the_hemisphere_and_weigh_a_free_view_as_one() {
    let patches = |division| Sky::patches(NonZeroU32::new(division).unwrap());
    for (sky, count, error) in [
        (patches(1), 145, 1e-2),
        (patches(2), 577, 3e-3),
        (patches(4), 2305, 1e-3),
        (Sky::uniform(1000), 1000, 1e-6),
    ] {
        assert_eq!(sky.directions().len(), count);
        let all = vec![u64::MAX; sky.words()];
        let solid_angle = sky.sums(&all, None)[0];
        assert!((solid_angle - 2.0).abs() < 1e-12, "{count}: {solid_angle}");
        let view = sky.sums(&all, Some(DVec3::Z))[0];
        assert!((view - 1.0).abs() < error, "{count}: {view}");
        let middle: DVec3 = sky.directions().iter().sum();
        assert!(middle.truncate().length() < 1e-2 * middle.z, "{count}: {middle}");
    }
}

#[test]
fn neighbours_are_a_permutation_of_any_points() {
    let mut random = Random(7);
    for count in [0, 1, 15, 16, 17, 63, 64, 65, 1000] {
        for is_one_place in [false, true] {
            let place = |_| if is_one_place { Vec3::ONE } else { random.point() };
            let points: Vec<Vec3> = (0..count).map(place).collect();
            let mut order = neighbours(&points);
            order.sort_unstable();
            assert!(order.into_iter().eq(0..count as u32));
        }
    }
}

#[test]
fn invalid_skies_are_rejected_with_their_fault() {
    let up = || vec![DVec3::Z];
    for bad in [DVec3::ZERO, DVec3::NAN, DVec3::X * 1e40] {
        let rejected = Sky::new(vec![DVec3::Z, bad], [0.0, 1.0]);
        assert!(matches!(rejected, Err(InvalidSky::Direction { index: 1, .. })), "{bad}");
    }
    for range in [[-1.0, 1.0], [f64::NAN, 1.0], [0.0, f64::NAN]] {
        assert!(matches!(Sky::new(up(), range), Err(InvalidSky::Range(..))), "{range:?}");
    }
    let sky = Sky::new(vec![DVec3::Z; 2], [0.0, 1.0]).unwrap();
    for count in [0, 1, 3] {
        let rejected = sky.clone().with_weights(vec![1.0; count]);
        assert!(matches!(rejected, Err(InvalidSky::Weights { .. })), "{count}");
    }
    let rejected = sky.with_weights(vec![1.0, f64::NAN]);
    assert!(matches!(rejected, Err(InvalidSky::Weight(1, _))));
}

/// Long directions make every distance tiny, so that rounding decides whether a hit is in the range.
#[test]
fn long_directions_hit_just_in_front_of_a_point_and_within_a_tiny_range() {
    let grows = |k: i32| (f64::from(k)).exp2();
    for (size, length, end) in
        [(grows(-110), grows(30), grows(-137)), (grows(-25), grows(100), grows(-100))]
    {
        let corners = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]]
            .map(|corner| DVec3::from(corner) * size);
        let triangle = Triangle(corners.map(DVec3::as_vec3));
        let bvh = tree(&bvh_core::boxes(&[triangle]), SHAPES[0], &mut Random(1));
        for height in (20..60).map(|k| grows(-k)) {
            let point = DVec3::Z * height * size;
            let along = DVec3::new(1.0, 0.0, -2.0 * height) * length;
            let sky = Sky::new(vec![along; 100], [0.0, end]).unwrap();
            for kernel in Kernel::ALL {
                let wide = WideBvh::new(&bvh, &[triangle]).unwrap();
                let Some(wide) = wide.with_kernel(kernel) else { continue };
                let hits = |_, direction: DVec3| {
                    let ray = Ray::new(point.as_vec3(), direction.as_vec3(), 0.0, end as f32);
                    wide.any_hit(&ray.unwrap())
                };
                compared(&wide, &sky, &[point.as_vec3()], hits);
            }
        }
    }
}
