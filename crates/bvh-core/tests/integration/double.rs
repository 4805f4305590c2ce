//! Rays and triangles in f64: hits as in exact rationals, and every kernel as a test of every
//! triangle.

use crate::support::rational::{distance, dot, exactly, is_rounded_to, normal, zero};
use crate::support::{Random, SHAPES, ball, chain, grid_box, junction, soup, tree};
use bvh_core::{
    Bvh, Coherence, DHit, DRay, DTriangle, DWideBvh, Frame, InsideRule, Kernel, Orientation,
    OutOfExactRange, Select, Solid,
};
use glam::{DMat3, DQuat, DVec3};
use std::slice;

/// Sizes and offsets of scenes.
const PLACES: [(f64, f64); 6] =
    [(1.0, 0.0), (1.0, 1e7), (1e-30, 0.0), (1e30, 0.0), (1e-3, 5e5), (3.0, 1e-5)];

/// Returns scenes in f64 at many places and sizes, turned, with what f32 could not hold.
fn scenes(random: &mut Random) -> Vec<(String, Vec<DTriangle>)> {
    let shapes = [
        ("soup", soup(60, random)),
        ("ball", ball(2)),
        ("grid", grid_box(3)),
        ("junction", junction()),
    ];
    let mut scenes = Vec::new();
    for (name, triangles) in shapes {
        for (size, offset) in PLACES {
            let turn = DQuat::from_xyzw(0.1, 0.7, -0.3, 0.5).normalize();
            let turn = if random.below(2) == 0 { turn } else { DQuat::IDENTITY };
            let moved = |p: glam::Vec3| {
                turn * (p.as_dvec3() * 1.1) * size + DVec3::new(offset, -offset, 0.3 * offset)
            };
            let triangles = triangles.iter().map(|t| DTriangle(t.0.map(moved))).collect();
            scenes.push((format!("{name} * {size} + {offset}"), triangles));
        }
    }
    scenes
}

/// Returns rays through corners, edges and insides, along axes and edges, and of any range.
fn rays(triangles: &[DTriangle], count: usize, random: &mut Random) -> Vec<DRay> {
    let corners = || triangles.iter().flat_map(|triangle| triangle.0);
    let min = corners().fold(DVec3::INFINITY, DVec3::min);
    let max = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
    let size = (max - min).max_element();
    let middle = (min + max) * 0.5;
    let mut rays = Vec::new();
    while rays.len() < count {
        let DTriangle([a, b, c]) = random.of(triangles);
        let u = f64::from(random.unit());
        let target = match random.below(5) {
            0 => a,
            1 => (a + b) * 0.5,
            2 => a + (b - a) * u,
            3 => (a + b + c) / 3.0,
            _ => middle + random.point().as_dvec3() * size,
        };
        let from = match random.below(6) {
            0 => target + random.point().as_dvec3() * size * 1e4,
            1 => a - (b - a),
            2 => target - DVec3::AXES[random.below(3)] * size,
            3 => target,
            _ => middle + random.point().as_dvec3() * size,
        };
        let mut direction = (target - from) / size;
        match random.below(6) {
            0 => direction = random.point().as_dvec3(),
            1 => direction = DVec3::AXES[random.below(3)] * 1e-3,
            2 => direction *= 3e7,
            _ => (),
        }
        let length = f64::from(random.unit());
        let (t_min, t_max) = random.of(&[
            (0.0, f64::INFINITY),
            (0.0, f64::INFINITY),
            (0.0, size * length),
            (size * length, f64::INFINITY),
        ]);
        rays.extend(DRay::new(from, direction, t_min, t_max));
    }
    rays
}

/// Compares a hit with exact rationals. Returns whether there is one.
fn check_pair(ray: &DRay, triangle: &DTriangle) -> bool {
    let found = triangle.intersect(ray);
    let real = distance([ray.origin(), ray.direction()], triangle.0);
    let is_right = match &real {
        Some(real) => found.is_some_and(|t| {
            let is_even = t.to_bits() & 1 == 0;
            is_rounded_to(real, [t.next_down(), t, t.next_up()], is_even)
        }),
        None => found.is_none(),
    };
    assert!(is_right, "{found:?} {real:?} {ray:?} {triangle:?}");
    found.is_some()
}

#[test]
fn hits_and_distances_are_those_of_real_arithmetic_rounded_once() {
    let mut random = Random(31);
    let mut hits = 0;
    for (_, triangles) in scenes(&mut random) {
        for ray in rays(&triangles, 60, &mut random) {
            let ray = DRay::half_line(ray.origin(), ray.direction()).unwrap();
            let triangles: [DTriangle; 12] = std::array::from_fn(|_| random.of(&triangles));
            hits += triangles.iter().filter(|triangle| check_pair(&ray, triangle)).count();
        }
    }
    assert!(hits > 500, "{hits}");
}

/// Returns the nearest hit that counts, by testing every triangle.
fn brute_force(triangles: &[DTriangle], ray: &DRay, select: Select) -> Option<DHit> {
    let hit = |(object, triangle): (u32, &DTriangle)| {
        let t = match select.orientation {
            Orientation::Any => triangle.intersect(ray)?,
            _ => triangle.crossing(ray)?,
        };
        let is_exiting = dot(&exactly(ray.direction()), &normal(triangle.0)) > zero();
        let counts = match select.orientation {
            Orientation::Any => true,
            Orientation::Exiting => is_exiting,
            Orientation::Entering => !is_exiting,
        };
        (counts && !select.exclude.contains(&object)).then_some(DHit { t, object })
    };
    let hits = (0..).zip(triangles).filter_map(hit);
    hits.reduce(|a, b| if b.t < a.t { b } else { a })
}

fn trees(triangles: &[DTriangle], random: &mut Random) -> Vec<Bvh> {
    let centred = DWideBvh::centred(triangles);
    let turn = DMat3::from_quat(DQuat::from_xyzw(0.3, -0.2, 0.4, 0.7).normalize());
    let turned = Frame::new(turn, centred.centre()).unwrap();
    let aside = Frame::new(turn, triangles[0].0[0]).unwrap();
    let mut trees = Vec::new();
    for frame in [Some(centred), Some(turned), Some(aside), None] {
        let boxes = match &frame {
            Some(frame) => DWideBvh::boxes(triangles, frame),
            None => {
                let file = Frame::new(DMat3::IDENTITY, DVec3::ZERO).unwrap();
                DWideBvh::boxes(triangles, &file)
            }
        };
        let built = [tree(&boxes, random.of(&SHAPES), random), chain(&boxes)];
        trees.extend(built.into_iter().map(|tree| Bvh { frame, ..tree }));
    }
    trees
}

/// The side from which hits count, and whether the nearest hit of each ray is excluded.
const SELECTIONS: [(Orientation, bool); 4] = [
    (Orientation::Any, false),
    (Orientation::Any, true),
    (Orientation::Exiting, false),
    (Orientation::Entering, true),
];

/// Compares every kernel's nearest and any hits, of single rays, batches and packets, with a test of
/// every triangle. Returns the nearest hits.
fn check_kernels(
    triangles: &[DTriangle],
    trees: &[Bvh],
    (orientation, excludes): (Orientation, bool),
    rays: &[DRay],
) -> Vec<Option<DHit>> {
    let nearest = |ray| brute_force(triangles, ray, Select::default());
    let excluded: Vec<u32> = match excludes {
        true => rays.iter().map(|ray| nearest(ray).map_or(0, |hit| hit.object)).collect(),
        false => vec![],
    };
    let all = Select { orientation, exclude: &excluded };
    let of = |i: usize| Select { orientation, exclude: excluded.get(i..=i).unwrap_or_default() };
    let expected: Vec<Option<DHit>> =
        rays.iter().enumerate().map(|(i, ray)| brute_force(triangles, ray, of(i))).collect();
    // Packets take sixteen rays that cohere.
    let coherent: Vec<DRay> = rays.iter().flat_map(|&ray| [ray; 16]).collect();
    let exclude: Vec<u32> = excluded.iter().flat_map(|&id| [id; 16]).collect();
    let all_coherent = Select { orientation, exclude: &exclude };
    for tree in trees {
        let layout = DWideBvh::new(tree, triangles).unwrap();
        for kernel in Kernel::ALL {
            let Some(layout) = layout.clone().with_kernel(kernel) else { continue };
            let mut nearest = vec![None; rays.len()];
            let mut any = vec![false; rays.len()];
            layout.nearest_hits(rays, all, &mut nearest, Coherence::Incoherent);
            layout.any_hits(rays, all, &mut any, Coherence::Incoherent);
            let mut nearest_of_packets = vec![None; coherent.len()];
            let mut any_of_packets = vec![false; coherent.len()];
            let (nearest_to, any_to) = (&mut nearest_of_packets, &mut any_of_packets);
            layout.nearest_hits(&coherent, all_coherent, nearest_to, Coherence::Coherent);
            layout.any_hits(&coherent, all_coherent, any_to, Coherence::Coherent);
            for (i, (ray, &expected)) in rays.iter().zip(&expected).enumerate() {
                let case = || format!("{kernel:?}, {orientation:?}, {ray:?}");
                let is_hit = expected.is_some();
                assert_eq!(layout.nearest_hit(ray, of(i)), expected, "{}", case());
                assert_eq!(layout.any_hit(ray, of(i)), is_hit, "{}", case());
                assert_eq!((nearest[i], any[i]), (expected, is_hit), "{}", case());
                let packet = 16 * i..16 * (i + 1);
                assert_eq!(nearest_of_packets[packet.clone()], [expected; 16], "{}", case());
                assert_eq!(any_of_packets[packet], [is_hit; 16], "{}", case());
            }
        }
    }
    expected
}

#[test]
fn every_kernel_answers_as_a_test_of_every_triangle() {
    let mut random = Random(32);
    let mut hits = 0;
    for (_, triangles) in scenes(&mut random) {
        let rays = rays(&triangles, 24, &mut random);
        let trees = trees(&triangles, &mut random);
        for selection in SELECTIONS {
            hits += check_kernels(&triangles, &trees, selection, &rays).iter().flatten().count();
        }
    }
    assert!(hits > 400, "{hits}");
}

/// `RAYS` sets how many rays go through every shape, at all its places together.
#[test]
#[ignore = "nightly: minutes, a million rays through every shape"]
fn a_million_rays_of_every_shape_answer_as_real_arithmetic() {
    let count = std::env::var("RAYS").map_or(1_000_000, |rays| rays.parse().expect("a number"));
    let count = count / PLACES.len();
    let mut random = Random(34);
    for (name, triangles) in &scenes(&mut random) {
        let trees = trees(triangles, &mut random);
        let parts = trees.iter().flat_map(|tree| SELECTIONS.map(|selection| (tree, selection)));
        let mut hits = 0;
        for (tree, selection) in parts {
            let rays = rays(triangles, count / (SELECTIONS.len() * trees.len()), &mut random);
            let nearest = check_kernels(triangles, slice::from_ref(tree), selection, &rays);
            for (ray, nearest) in rays.iter().zip(nearest) {
                let other = random.of(triangles);
                let half_line = DRay::half_line(ray.origin(), ray.direction()).unwrap();
                check_pair(&half_line, &other);
                if let Some(hit) = nearest {
                    check_pair(&half_line, &triangles[hit.object as usize]);
                    hits += 1;
                }
            }
        }
        println!("{name}: {hits} hits");
        assert!(hits > count / 20, "{name}: {hits} hits");
    }
}

#[test]
fn every_kernel_finds_all_hits_closest_points_and_insides_as_all_triangles_together_have_them() {
    let mut random = Random(33);
    let (mut hits, mut insides) = (0, 0);
    for (name, triangles) in scenes(&mut random) {
        let rays = rays(&triangles, 40, &mut random);
        let points: Vec<DVec3> = rays.iter().map(DRay::origin).collect();
        let with_area = || triangles.iter().filter(|triangle| !triangle.is_degenerate());
        let all_hits = |ray: &DRay| {
            let of = |(object, triangle): (u32, &DTriangle)| {
                Some(DHit { t: triangle.crossing(ray)?, object })
            };
            let mut hits: Vec<DHit> = (0..).zip(&triangles).filter_map(of).collect();
            hits.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.object.cmp(&b.object)));
            hits
        };
        let along = |point: &DVec3| DRay::half_line(*point, DVec3::X).unwrap();
        let expected: Vec<Vec<DHit>> = rays.iter().map(all_hits).collect();
        let parities: Vec<bool> =
            points.iter().map(|point| all_hits(&along(point)).len() % 2 == 1).collect();
        hits += expected.iter().flatten().count();
        insides += parities.iter().filter(|&&inside| inside).count();
        for tree in &trees(&triangles, &mut random) {
            let layout = DWideBvh::new(tree, &triangles).unwrap();
            let solid = Solid::new(tree, &triangles);
            for kernel in Kernel::ALL {
                let Some(layout) = layout.clone().with_kernel(kernel) else { continue };
                let mut inside = vec![false; points.len()];
                solid.contains(&layout, &points, InsideRule::Parity, &mut inside);
                assert_eq!(inside, parities, "{name}, {kernel:?}");
                if solid.is_watertight() {
                    solid.contains(&layout, &points, InsideRule::Auto, &mut inside);
                    assert_eq!(inside, parities, "{name}, {kernel:?}");
                }
                let (mut found, mut counts) = (vec![], vec![0; rays.len()]);
                layout.all_hits_of(&rays, &mut found, &mut counts);
                assert_eq!(found, expected.concat(), "{name}, {kernel:?}");
                assert!(counts.iter().zip(&expected).all(|(&n, all)| n as usize == all.len()));
                for ((ray, all), &point) in rays.iter().zip(&expected).zip(&points) {
                    assert_eq!(&layout.all_hits(ray), all, "{name}, {kernel:?}, {ray:?}");
                    let found = layout.closest_point(point).unwrap();
                    let of = |triangle: &DTriangle| triangle.closest_point(point);
                    let distance = |triangle| of(triangle).distance(point);
                    assert_eq!(found.point, of(&triangles[found.object as usize]));
                    let least = with_area().map(distance).fold(f64::INFINITY, f64::min);
                    let rounding = 1e-9 * least + 1e-15 * point.abs().max_element();
                    assert!((found.distance - least).abs() <= rounding, "{name}, {kernel:?}");
                }
            }
        }
    }
    assert!(hits > 400 && insides > 25, "{hits} {insides}");
}

#[test]
fn no_distance_is_minus_zero() {
    let triangles = [DTriangle::from([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])];
    let ray = DRay::half_line([0.1, 0.1, 0.0], [0.0, 0.0, -1.0]).unwrap();
    let frame = DWideBvh::centred(&triangles);
    let tree = chain(&DWideBvh::boxes(&triangles, &frame));
    let layout = DWideBvh::new(&Bvh { frame: Some(frame), ..tree }, &triangles).unwrap();
    for kernel in Kernel::ALL {
        let Some(layout) = layout.clone().with_kernel(kernel) else { continue };
        let hit = layout.nearest_hit(&ray, Select::default()).unwrap();
        assert_eq!(hit.t.to_bits(), 0.0f64.to_bits(), "{kernel:?}");
    }
}

#[test]
fn numbers_beyond_the_exact_range_are_rejected() {
    let up = DVec3::Z;
    let tiny = DRay::half_line([1.0, 1e-50, -5e-324], [1e-60, 0.0, 1.0]);
    assert_eq!(tiny, DRay::half_line(DVec3::X, up));
    let tiny = DTriangle::from([[1.0, 2.4e-47, 0.0], [0.0, 1.0, -1e-60], [0.0, 5e-324, 1.0]]);
    assert_eq!((tiny, DTriangle::check(&[tiny])), (DTriangle([DVec3::X, DVec3::Y, up]), Ok(())));
    for bad in [f64::NAN, f64::INFINITY, 1e40] {
        let vector = DVec3::new(1.0, bad, 0.0);
        assert!(matches!(DRay::half_line(vector, up), Err(OutOfExactRange::Origin(_))), "{bad}");
        let rejected = DRay::half_line(up, vector);
        assert!(matches!(rejected, Err(OutOfExactRange::Direction(_))), "{bad}");
    }
    assert!(matches!(DRay::half_line(up, DVec3::ZERO), Err(OutOfExactRange::Direction(_))));
    for (t_min, t_max) in [(f64::NAN, 1.0), (0.0, f64::NAN), (-1.0, 1.0)] {
        let rejected = DRay::new(up, up, t_min, t_max);
        assert!(matches!(rejected, Err(OutOfExactRange::Range(..))));
    }
}

#[test]
fn a_point_beyond_f32_has_a_closest_point_unless_its_square_overflows() {
    let mut random = Random(9);
    for (name, triangles) in scenes(&mut random) {
        let frame = DWideBvh::centred(&triangles);
        let boxes = DWideBvh::boxes(&triangles, &frame);
        let tree = Bvh { frame: Some(frame), ..tree(&boxes, SHAPES[1], &mut random) };
        let wide = DWideBvh::new(&tree, &triangles).unwrap();
        for kernel in Kernel::ALL {
            let Some(wide) = wide.clone().with_kernel(kernel) else { continue };
            for far in [1e39, 1e153, 1e160, f64::MAX] {
                let closest = wide.closest_point(DVec3::new(-far, 0.5 * far, far));
                assert_eq!(closest.is_some(), far * far < f64::MAX, "{name}, {kernel:?}, {far}");
                let is_near = |distance: f64| (1.49 * far..1.51 * far).contains(&distance);
                assert!(closest.is_none_or(|closest| is_near(closest.distance)), "{name}");
            }
        }
    }
}

/// A cube around 0 between −1 and 1, whose sides are divided along one of the two diagonals.
fn cube(is_other: bool) -> Vec<DTriangle> {
    let mut triangles = Vec::new();
    for (axis, sign) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, 1.0), (axis, -1.0)]) {
        let [normal, right] = [DVec3::AXES[axis] * sign, DVec3::AXES[(axis + 1) % 3]];
        let up = normal.cross(right);
        let [a, b, c, d] =
            [-right - up, right - up, right + up, up - right].map(|corner| normal + corner);
        let halves = if is_other { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
        triangles.extend(halves.map(DTriangle));
    }
    triangles
}

#[test]
fn flights_through_corners_and_edges_of_a_solid_enter_it_as_often_as_they_leave_it() {
    let mut random = Random(71);
    let [mut touched, mut crossed] = [0; 2];
    for triangles in [cube(false), cube(true)] {
        for tree in trees(&triangles, &mut random) {
            let layout = DWideBvh::new(&tree, &triangles).unwrap();
            for _ in 0..2000 {
                // All numbers are small whole ones, and the ray meets its aim exactly.
                let mut whole = |most: usize| {
                    let mut number = || random.below(2 * most + 1) as f64 - most as f64;
                    DVec3::new(number(), number(), number())
                };
                let (aim, origin) = (whole(1), whole(7));
                if origin.abs().max_element() <= 1.0 {
                    continue;
                }
                let (mut is_inside, mut t, mut passed) = (false, 0.0, Vec::new());
                let mut faces = 0;
                loop {
                    let ray = DRay::new(origin, aim - origin, t, f64::MAX).unwrap();
                    let orientation =
                        if is_inside { Orientation::Exiting } else { Orientation::Entering };
                    let select = Select { orientation, exclude: &passed };
                    let Some(hit) = layout.nearest_hit(&ray, select) else { break };
                    if hit.t > t {
                        passed.clear();
                    }
                    passed.push(hit.object);
                    (is_inside, t) = (!is_inside, hit.t);
                    faces += 1;
                }
                assert!(!is_inside, "from {origin} to {aim}");
                touched += usize::from(faces == 0);
                crossed += usize::from(faces > 0);
            }
        }
    }
    assert!(touched > 1000 && crossed > 1000, "{touched} {crossed}");
}
