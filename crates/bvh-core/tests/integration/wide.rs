//! Trees, also of divided triangles, and every kernel of the wide layout, ray by ray and in batches,
//! give the answers of testing every triangle, bit by bit.

use crate::support::layouts::{Traced, bundles, rays_on_planes};
use crate::support::{
    Random, SHAPES, all_of, ball, bits, boxes, brute_force, chain, grid_box, junction, mapped,
    rays, scaled, soup, tree,
};
use bvh_core::{
    Aabb, Bvh, Coherence, Hit, InFrame, Node, Orientation, PreparedRay, Ray, RefitError, Select,
    TestCounts, Triangle, WideBvh, any_hit, nearest_hit,
};
use glam::{DMat3, DVec3, Vec3};

/// Checks all rays by all trees and layouts, one by one and in batches. Returns the number of rays
/// that hit.
fn check(name: &str, triangles: &[Triangle], traced: &[Traced], rays: &[Ray]) -> usize {
    let expected: Vec<Option<Hit>> = rays.iter().map(|ray| brute_force(triangles, ray)).collect();
    let all: Vec<Vec<Hit>> = rays.iter().map(|ray| all_of(triangles, ray)).collect();
    let lengths: Vec<u32> = all.iter().map(|hits| hits.len() as u32).collect();
    for Traced { tree, layouts } in traced {
        for (ray, &expected) in rays.iter().zip(&expected) {
            let nearest = nearest_hit(tree, triangles, ray);
            assert_eq!(bits(nearest), bits(expected), "{name}: {ray:?}");
            assert_eq!(any_hit(tree, triangles, ray), expected.is_some(), "{name}: {ray:?}");
        }
        for (kernel, wide) in layouts {
            for ((ray, &expected), all) in rays.iter().zip(&expected).zip(&all) {
                let nearest = bits(wide.nearest_hit(ray));
                assert_eq!(nearest, bits(expected), "{name}, {kernel:?}, {ray:?}");
                assert_eq!(wide.any_hit(ray), expected.is_some(), "{name}, {kernel:?}, {ray:?}");
                assert_eq!(&wide.all_hits(ray), all, "{name}, {kernel:?}, {ray:?}");
            }
            let mut hits = Vec::new();
            let mut counts = vec![0; rays.len()];
            wide.all_hits_of(rays, &mut hits, &mut counts);
            assert!(hits == all.concat() && counts == lengths, "{name}, {kernel:?}");
            for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                let mut nearest = vec![Hit::MISS; rays.len()];
                let mut any = vec![false; rays.len()];
                wide.nearest_hits(rays, &mut nearest, coherence);
                wide.any_hits(rays, &mut any, coherence);
                for (i, (ray, &expected)) in rays.iter().zip(&expected).enumerate() {
                    let found = bits((!nearest[i].is_miss()).then_some(nearest[i]));
                    assert!(
                        found == bits(expected) && any[i] == expected.is_some(),
                        "{name}, {kernel:?}, {coherence:?}, {ray:?}: {:?} and {}",
                        nearest[i],
                        any[i]
                    );
                }
            }
        }
    }
    expected.iter().flatten().count()
}

#[test]
fn every_traversal_answers_as_brute_force_at_every_scale() {
    let mut random = Random(1);
    let (mut hits, mut divisions) = (0, 0);
    for (name, scene) in [
        ("soup", soup(150, &mut random)),
        ("grid", grid_box(4)),
        ("ball", ball(2)),
        ("junction", junction()),
    ] {
        // Down to the least denormal number.
        for exponent in [-149, -140, -127, -120, -110, -91, -88, -60, -20, 0, 20, 60, 71, 120] {
            let triangles = scaled(&scene, libm::exp2f(exponent as f32));
            let (traced, planes) = Traced::all_and_planes(&triangles, &mut random);
            divisions += planes.len();
            let mut rays = rays(&triangles, 60, &mut random);
            rays.extend(bundles(&triangles, 4, &mut random));
            rays.extend(rays_on_planes(&triangles, &planes, 20, &mut random));
            hits += check(&format!("{name} * 2^{exponent}"), &triangles, &traced, &rays);
        }
    }
    assert!(hits > 2000, "the rays should hit something: {hits}");
    assert!(divisions > 1000, "triangles should be divided: {divisions}");
}

/// Rays from one origin through the neighbourhoods of corners, edges and centres, exactly and
/// nearly: as many as a packet takes for each target, mostly in the same octant.
fn pinhole(triangles: &[Triangle], origin: Vec3, length: f32, random: &mut Random) -> Vec<Ray> {
    let mut rays = Vec::new();
    for _ in 0..4 {
        let Triangle([a, b, c]) = random.of(triangles);
        let spread = random.of(&[0.0, 1e-7, 1e-3, 0.1]) * a.distance(b).max(a.distance(c));
        for i in 0..128 {
            let target = [a, b, c, (a + b) * 0.5, (a + b + c) / 3.0][i % 5];
            let to = target + random.point() * spread - origin;
            let to = to / to.abs().max_element() * length;
            let t_max = random.of(&[f32::MAX, f32::MAX, 1.0]);
            rays.extend(Ray::new(origin, to, 0.0, t_max));
        }
    }
    rays
}

#[test]
fn packets_from_one_origin_answer_as_brute_force() {
    let mut random = Random(11);
    let lengths: &[f32] = &[0.0, -25.0, 25.0, -19.9, 19.9];
    // The last ones are too small, as seen from afar, to have sides in f64, too far away for
    // products in f32, and such that only the products with long directions exceed f32.
    let cases = [
        ("soup", soup(80, &mut random), 1.0, 3.0, lengths),
        ("grid", grid_box(3), 1.0, 3.0, lengths),
        ("ball", ball(2), 1.0, 0.5, lengths),
        ("small", soup(40, &mut random), 1e-16, 1.0, lengths),
        ("tiny", soup(40, &mut random), 1e-30, 1.0, lengths),
        ("large", soup(40, &mut random), 1e12, 1e13, lengths),
        ("huge", soup(40, &mut random), 1e30, 1e31, lengths),
        ("long", soup(40, &mut random), 1e11, 1e11, &[55.0, 56.0, 57.0, 58.0]),
    ];
    let mut hits = 0;
    for (name, scene, scale, distance, lengths) in cases {
        let triangles = scaled(&scene, scale);
        let traced = Traced::all(&triangles, &mut random);
        for &exponent in lengths {
            let origin = random.point() * distance;
            let rays = pinhole(&triangles, origin, libm::exp2f(exponent), &mut random);
            hits += check(name, &triangles, &traced, &rays);
        }
    }
    assert!(hits > 2_000, "the rays should hit something: {hits}");
}

#[test]
fn packets_of_a_frame_whose_directions_run_to_both_sides_and_are_long_answer_as_brute_force() {
    let mut random = Random(3);
    let [half, root] = [0.5, 0.5f64.sqrt()];
    let rotation = DMat3::from_cols(
        DVec3::new(root, root, 0.0),
        DVec3::new(-half, half, root),
        DVec3::new(half, -half, root),
    )
    .transpose();
    let long = Vec3::new(1.0, 1.0, libm::exp2f(-41.0)) * libm::exp2f(60.0);
    let directions = [Vec3::new(-1.0, 1.1, 2.0), Vec3::new(1.1, -1.0, 2.0), long];
    let ray = |direction: &Vec3| [Ray::half_line(Vec3::ZERO, *direction).unwrap(); 16];
    let rays: Vec<Ray> = directions.iter().flat_map(ray).collect();
    let mut hits = 0;
    for _ in 0..300 {
        let mut corner =
            || Vec3::from([0; 3].map(|_| random.below(9) as f32 - 4.0)) * libm::exp2f(37.0);
        let triangles = [Triangle([corner(), corner(), corner()])];
        let traced = [Traced::framed(&triangles, rotation, &mut random)];
        hits += check("one triangle", &triangles, &traced, &rays);
    }
    assert!(hits > 100, "{hits}");
}

#[test]
fn ranges_that_end_at_a_hit_or_next_to_it_are_answered_alike_from_near_and_from_afar() {
    let mut random = Random(12);
    let mut hits = 0;
    for scale in [1.0, 1e-20, 1e11, 1e14, 1e-38] {
        let triangles = scaled(&[soup(80, &mut random), grid_box(2)].concat(), scale);
        let traced = Traced::all(&triangles, &mut random);
        let mut whole = rays(&triangles, 100, &mut random);
        for distance in [10.0, 1e3, 1e5, 1e7] {
            for _ in 0..20 {
                let origin = random.point() * distance * scale;
                let towards = (random.of(&triangles).0[0] - origin) / scale;
                whole.extend(Ray::half_line(origin, towards * random.of(&[1.0, 0.01, 37.0])));
            }
        }
        let mut ends = Vec::new();
        for ray in whole {
            let Some(Hit { t, .. }) = brute_force(&triangles, &ray) else { continue };
            let ranges = [
                (0.0, t),
                (0.0, t.next_down()),
                (0.0, t.next_up()),
                (t, t),
                (t.next_up(), f32::MAX),
                (t.next_down(), f32::MAX),
                (t, f32::MAX),
            ];
            let ranged = |(t_min, t_max)| Ray::new(ray.origin(), ray.direction(), t_min, t_max);
            ends.extend(ranges.into_iter().flat_map(ranged));
        }
        hits += check(&format!("soup * {scale}"), &triangles, &traced, &ends);
    }
    assert!(hits > 1000, "the rays should hit something: {hits}");
}

#[test]
fn the_bytes_of_a_layout_are_those_of_its_nodes_and_of_its_triangles_with_their_ids() {
    let leaves = 64;
    let triangles = soup(4 * leaves, &mut Random(13));
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    let bytes = WideBvh::new(&chain(&boxes), &triangles).unwrap().bytes();
    let of_triangles = triangles.len() * (size_of::<Triangle>() + size_of::<u32>());
    // A node has eight boxes, and not every place in it has one.
    let of_nodes = 8 * size_of::<Aabb>();
    let most = 2 * of_triangles + 2 * leaves * of_nodes;
    assert!((of_triangles + of_nodes..most).contains(&bytes), "{bytes}");
}

#[test]
fn rays_that_meet_a_triangle_at_the_limits_of_the_numbers_hit_it() {
    let step =
        |[x, y, z]: [u32; 3]| Vec3::new(f32::from_bits(x), -f32::from_bits(y), f32::from_bits(z));
    let of_denormal_steps = [[6379, 1, 1], [5789, 1, 1], [7357, 2, 1]].map(step);
    let slow = Vec3::new(-1.1368684e-13, 4.6157873e-17, -2.3078936e-17);
    let near = [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]].map(|[x, y]| Vec3::new(x, y, 0.5) * 1e-15);
    // The area rounds to zero in f64: the first corner is 2⁻³¹ beside the line of the others.
    let long = 1.0 + f32::EPSILON;
    let beside = -1.0 / (1_u32 << 31) as f32;
    let thin = [[beside, 0.0], [1.0, 1.0], [long, long]].map(|[x, y]| Vec3::new(x, y, 0.0));
    let down = Ray::half_line([1.0, 1.0, 1.0], [0.0, 0.0, -1.0]);
    for (corners, ray) in [
        (of_denormal_steps, Ray::half_line(step([10976, 3, 2]), slow)),
        // The distance rounds to zero, where the range ends.
        (near, Ray::new(Vec3::ZERO, Vec3::new(1e27, 0.0, 1.2e30), 0.0, 0.0)),
        (thin, down),
    ] {
        let triangle = [Triangle(corners)];
        assert!(!triangle[0].is_degenerate());
        let traced = Traced::all(&triangle, &mut Random(14));
        assert_eq!(check("one triangle", &triangle, &traced, &[ray.unwrap(); 40]), 40);
    }
}

#[test]
fn batches_of_any_length_answer_as_brute_force() {
    let mut random = Random(9);
    let triangles = [soup(60, &mut random), ball(2)].concat();
    let traced = Traced::all(&triangles, &mut random);
    for count in (0..50).chain([63, 64, 65, 100, 257]) {
        let mut difficult = rays(&triangles, count, &mut random);
        difficult.truncate(count);
        check("difficult", &triangles, &traced, &difficult);
        let along = |i| Vec3::new(i as f32 * 0.03 - 1.5, 0.1, -3.0);
        let in_line: Vec<Ray> =
            (0..count).map(|i| Ray::half_line(along(i), Vec3::Z).unwrap()).collect();
        check("in line", &triangles, &traced, &in_line);
    }
}

/// Distances that f32 represents badly. Answers were once lost because corners beyond the rounded
/// product of `t_max` and the direction's length counted as beyond every hit.
#[test]
fn distances_that_underflow_are_answered_alike() {
    let mut random = Random(2);
    let at = |z: f32| {
        Triangle([Vec3::new(-1.0, -1.0, z), Vec3::new(3.0, -1.0, z), Vec3::new(-1.0, 3.0, z)])
    };
    let depths = [1e-30, 2e-30, 0.0, 1e-45, -1e-30, 3e-38, 1.5e-20, 1e-30];
    let triangles: Vec<Triangle> = depths.into_iter().map(at).collect();
    let traced = Traced::all(&triangles, &mut random);
    let mut rays = Vec::new();
    for length in [1e20, 1e25, 1e15, 1.0, 1e8, 1e-20] {
        for (t_min, t_max) in [
            (0.0, 0.0),
            (0.0, -0.0),
            (0.0, f32::MAX),
            (0.0, 1e-45),
            (1e-45, 1e-45),
            (0.0, 1e-40),
            (1e-44, 1e-38),
        ] {
            for side in [1.0, -1.0] {
                for z in [0.0, -1e-30, 1e-45, 2e-38, 1e-20] {
                    for slope in [0.0, 0.1, 1e-30] {
                        let direction = Vec3::new(slope, slope, side) * length;
                        let origin = Vec3::new(0.1, 0.2, -side * z);
                        rays.push(Ray::new(origin, direction, t_min, t_max).unwrap());
                    }
                }
            }
        }
    }
    let hits = check("thin sheets", &triangles, &traced, &rays);
    assert!(hits > 300, "{hits} of {}", rays.len());
}

#[test]
fn a_refitted_layout_answers_as_brute_force_at_the_new_places() {
    let mut random = Random(6);
    let triangles = soup(150, &mut random);
    let moved: Vec<Triangle> = (triangles.iter())
        .map(|t| match t.is_degenerate() {
            true => Triangle([Vec3::splat(9.0); 3]),
            false => {
                let by = random.point();
                Triangle(t.0.map(|p| p * 1.5 + by))
            }
        })
        .collect();
    let mut traced = Traced::all(&triangles, &mut random);
    for Traced { tree, layouts } in &mut traced {
        tree.refit(&InFrame { triangles: &moved, frame: tree.frame.as_ref() }.boxes());
        for (_, layout) in layouts {
            layout.refit(&moved).unwrap();
            let after = layout.expected_visits();
            // Back and forth changes nothing.
            let mut again = layout.clone();
            again.refit(&triangles).unwrap();
            assert_ne!(again.expected_visits(), after);
            again.refit(&moved).unwrap();
            assert_eq!(again.expected_visits(), after);
        }
    }
    assert!(check("moved", &moved, &traced, &rays(&moved, 3000, &mut random)) > 500);
}

#[test]
fn a_refitted_layout_costs_no_less_than_a_new_one_of_the_refitted_tree() {
    let mut random = Random(8);
    let triangles = ball(3);
    let moved = mapped(&triangles, |p| Vec3::new(p.x * 4.0, p.y + p.x * p.z, p.z * 0.1));
    let mut tree = tree(&boxes(&triangles), SHAPES[0], &mut random);
    let mut layout = WideBvh::new(&tree, &triangles).unwrap();
    layout.refit(&moved).unwrap();
    tree.refit(&boxes(&moved));
    let new = WideBvh::new(&tree, &moved).unwrap().expected_visits();
    let refitted = layout.expected_visits();
    assert!(refitted > new && refitted < 2.0 * new, "{refitted} {new}");
}

#[test]
fn a_layout_whose_triangles_cannot_be_followed_says_so_and_stays_as_it_was() {
    let mut random = Random(7);
    let triangles = soup(40, &mut random);
    let mut traced = Traced::all(&triangles, &mut random);
    let with = |at: usize, triangle: Triangle| {
        let mut changed = triangles.clone();
        changed[at] = triangle;
        changed
    };
    let flat = Triangle([Vec3::ONE; 3]);
    let new = Triangle([Vec3::X, Vec3::Y, Vec3::Z]);
    let infinite = Triangle([Vec3::X, Vec3::Y, Vec3::INFINITY]);
    // Beyond f32 along the axes of a turned frame.
    let mut turned = Traced::framed(&triangles, DMat3::from_rotation_z(-0.785), &mut random);
    let far = mapped(&triangles, |p| 2.9e38 * (Vec3::X + Vec3::Y) + p * 5e36);
    for (_, layout) in &mut turned.layouts {
        assert_eq!(layout.refit(&far), Err(RefitError::NotFinite(0)));
    }
    for (_, layout) in traced.iter_mut().flat_map(|traced| &mut traced.layouts) {
        assert_eq!(layout.refit(&with(3, flat)), Err(RefitError::Lost(3)));
        assert_eq!(layout.refit(&with(7, new)), Err(RefitError::Gained(7)));
        assert_eq!(layout.refit(&with(4, infinite)), Err(RefitError::NotFinite(4)));
        assert!(matches!(layout.refit(&triangles[..20]), Err(RefitError::Lost(20..))));
    }
    check("rejected", &triangles, &traced, &rays(&triangles, 500, &mut random));
}

#[test]
fn triangles_without_area_are_left_out_and_never_hit() {
    let mut random = Random(4);
    let flat = |p: Vec3, q: Vec3| Triangle([p, q, (p + q) * 0.5]);
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE];
    let mut triangles: Vec<Triangle> =
        corners.iter().flat_map(|&p| corners.iter().map(move |&q| flat(p, q))).collect();
    let empty = Traced::all(&triangles, &mut random);
    assert_eq!(check("empty", &triangles, &empty, &rays(&triangles, 500, &mut random)), 0);
    for (_, wide) in empty.iter().flat_map(|traced| &traced.layouts) {
        assert_eq!(wide.closest_point(Vec3::splat(3.5)), None);
    }
    triangles.push(Triangle([Vec3::ZERO, Vec3::X, Vec3::Y]));
    let traced = Traced::all(&triangles, &mut random);
    assert!(check("flat", &triangles, &traced, &rays(&triangles, 500, &mut random)) > 0);
}

#[test]
fn rays_whose_distances_from_planes_overflow_are_answered_alike() {
    let mut random = Random(23);
    let size = libm::exp2f(127.0);
    let mut hits = 0;
    let aside = mapped(&grid_box(3), |p| p * 0.25 - 1.5);
    for (name, scene) in [("grid", grid_box(3)), ("ball", ball(2)), ("aside", aside)] {
        let triangles = scaled(&scene, size);
        let traced = Traced::all(&triangles, &mut random);
        let mut rays = Vec::new();
        for _ in 0..400 {
            // Outside of the scene, on any side of it, and in it.
            let mut origin = random.point() * size;
            origin[random.below(3)] *= random.of(&[1.0, 1.9, -1.9]);
            let Triangle([a, b, c]) = random.of(&triangles);
            let target = random.of(&[a, a * 0.5 + b * 0.5, a * 0.25 + b * 0.5 + c * 0.25]);
            let towards = (target.as_dvec3() - origin.as_dvec3()) / f64::from(size);
            // The target is at `size`; what is in front of it hides most of the far side.
            let t_min = random.of(&[0.0, 0.75 * size]);
            rays.extend(Ray::new(origin, towards.as_vec3(), t_min, f32::MAX));
        }
        hits += check(name, &triangles, &traced, &rays);
    }
    assert!(hits > 500, "the rays should hit something: {hits}");
}

#[test]
fn every_kernel_traces_trees_of_any_depth() {
    let mut random = Random(21);
    // Boxes inside boxes, so that a ray enters all of them and the stack is as full as can be; and
    // boxes one behind the other.
    let nested = [Vec3::NEG_ONE, Vec3::X, Vec3::new(0.0, 1.0, 0.25)];
    let row = [Vec3::ZERO, Vec3::X, Vec3::Y];
    for (name, first, step) in [("nested", nested, Vec3::ZERO), ("in a row", row, Vec3::Z)] {
        let grown = |i: usize| Triangle(first.map(|p| p * (i + 1) as f32 + step * i as f32));
        let triangles: Vec<Triangle> = (0..3000).map(grown).collect();
        let traced = [Traced::new(chain(&boxes(&triangles)), &triangles)];
        let mut rays: Vec<Ray> = (0..150)
            .map(|_| {
                let origin = random.point() * random.of(&[0.1, 10.0, 5000.0]);
                Ray::half_line(origin, random.point() - origin.normalize_or_zero()).unwrap()
            })
            .collect();
        rays.extend(bundles(&triangles, 8, &mut random));
        assert!(check(name, &triangles, &traced, &rays) > 30);
        let [Traced { layouts, .. }] = traced;
        let distances = |wide: &WideBvh| -> Vec<_> {
            let closest = rays.iter().map(|ray| wide.closest_point(ray.origin()));
            closest.map(|closest| closest.map(|closest| closest.distance.to_bits())).collect()
        };
        let expected = distances(&layouts[0].1);
        for (kernel, wide) in &layouts {
            assert_eq!(distances(wide), expected, "{name}, {kernel:?}");
        }
    }
}

#[test]
fn a_filter_passes_over_hits_and_sees_all_of_them_if_it_accepts_none() {
    let mut random = Random(9);
    let triangles = soup(150, &mut random);
    let traced = Traced::all(&triangles, &mut random);
    let mut found = 0;
    let mut several = 0;
    for ray in rays(&triangles, 2000, &mut random) {
        let prepared = PreparedRay::new(&ray);
        let hit = |(object, triangle): (u32, &Triangle)| {
            Some(Hit { t: triangle.intersect(&prepared, ray.t_max())?, object })
        };
        let all: Vec<Hit> = (0..).zip(&triangles).filter_map(hit).collect();
        let first = |a: Hit, b: Hit| if b.precedes(&a) { b } else { a };
        let kept = all.iter().copied().filter(|hit| hit.object % 3 > 0);
        let nearest = kept.reduce(first);
        let excluded = all.first().map_or([7, 8], |hit| [7, hit.object]);
        let sides = [Orientation::Any, Orientation::Exiting, Orientation::Entering];
        let selected = sides.map(|orientation| {
            let kept = all.iter().copied().filter(|hit| {
                let [a, b, c] = triangles[hit.object as usize].0.map(Vec3::as_dvec3);
                let along = (b - a).cross(c - a).dot(ray.direction().as_dvec3());
                let is_crossed = triangles[hit.object as usize].crossing(&ray).is_some();
                let sides = [true, is_crossed && along > 0.0, is_crossed && along < 0.0];
                let counts = sides[orientation as usize];
                counts && !excluded.contains(&hit.object)
            });
            (Select { orientation, exclude: &excluded }, kept.reduce(first))
        });
        for (_, layout) in traced.iter().flat_map(|traced| &traced.layouts) {
            assert_eq!(layout.nearest_hit_where(&ray, |hit| hit.object % 3 > 0), nearest);
            assert_eq!(layout.any_hit_where(&ray, |hit| hit.object % 3 > 0), nearest.is_some());
            for (select, nearest) in &selected {
                let filter = || select.filter(&ray, &triangles);
                assert_eq!(layout.nearest_hit_where(&ray, filter()), *nearest);
                assert_eq!(layout.any_hit_where(&ray, filter()), nearest.is_some());
            }
            let mut seen = Vec::new();
            let sees = |hit| {
                seen.push(hit);
                false
            };
            assert_eq!(layout.nearest_hit_where(&ray, sees), None);
            seen.sort_by_key(|hit| hit.object);
            // A divided triangle is in several leaves.
            seen.dedup();
            assert_eq!(seen, all);
        }
        found += usize::from(nearest.is_some());
        several += usize::from(all.len() > 1);
    }
    assert!(found > 300 && several > 100, "{found} {several}");
}

#[test]
fn rays_that_are_not_finite_end_and_meet_only_triangles_that_exist() {
    // Five children leave three lanes of the node unused.
    let triangles: Vec<Triangle> = (0..5u8)
        .map(|i| f32::from(i) * 100.0)
        .map(|x| Triangle::from([[x, 0.0, 0.0], [x + 1.0, 0.0, 1.0], [x, 1.0, 0.0]]))
        .collect();
    let boxes = boxes(&triangles);
    let root = Node::inner(Aabb::union_of(&boxes), 1, 5);
    let leaves = (0..).zip(&boxes).map(|(i, &aabb)| Node::leaf(aabb, i, 1));
    let tree = Bvh::new([root].into_iter().chain(leaves).collect(), (0..5).collect());
    let traced = Traced::new(tree, &triangles);
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    for (origin, direction) in [
        ([nan; 3], [0.0, 0.0, 1.0]),
        ([1e30, 0.0, 0.0], [nan; 3]),
        ([1e30, 0.0, 0.0], [inf; 3]),
        ([nan, 0.0, 0.0], [0.0, inf, inf]),
        ([0.1; 3], [inf; 3]),
        ([0.1; 3], [-inf, 1.0, 0.0]),
        ([inf, 0.0, -inf], [0.0, 1.0, 0.0]),
    ] {
        let ray = Ray::assume_valid(origin, direction, 0.0, 1.0);
        for (_, wide) in &traced.layouts {
            wide.nearest_hit(&ray);
            wide.any_hit(&ray);
            wide.all_hits(&ray);
            wide.all_hits_of(&[ray; 40], &mut Vec::new(), &mut [0; 40]);
            for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                let mut hits = [Hit::MISS; 40];
                wide.nearest_hits(&[ray; 40], &mut hits, coherence);
                wide.any_hits(&[ray; 40], &mut [false; 40], coherence);
                assert!(hits.iter().all(|hit| hit.is_miss() || hit.object < 5));
            }
        }
    }
}

#[test]
fn visits_whose_sums_are_infinite_or_no_numbers_give_a_layout() {
    let mut random = Random(15);
    let triangles = soup(40, &mut random);
    let tree = tree(&boxes(&triangles), SHAPES[0], &mut random);
    let rays = rays(&triangles, 100, &mut random);
    for visits in [3e38, f32::INFINITY, f32::NAN] {
        let wide = WideBvh::for_rays(&tree, &triangles, &vec![visits; tree.nodes.len()]).unwrap();
        for ray in &rays {
            assert_eq!(wide.nearest_hit(ray), brute_force(&triangles, ray), "{visits}: {ray:?}");
        }
    }
}

#[test]
fn rays_that_ask_for_any_hit_come_to_a_wall_before_what_is_scattered_whether_it_is_divided_or_not()
{
    let wall = Triangle::from([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
    let speck = |i: u8| {
        let at = f32::from(i % 3);
        Triangle::from([[at, at, 1.0 + at], [at + 0.1, at, 1.0 + at], [at, at + 0.1, 1.0 + at]])
    };
    let triangles: Vec<Triangle> = [wall].into_iter().chain((0..24).map(speck)).collect();
    let halves = [[[0.0; 3], [1.1, 2.0, 0.0]], [[1.0, 0.0, 0.0], [2.0, 1.1, 0.0]]].map(Aabb::from);
    let scattered = Aabb::from([[0.0, 0.0, 1.0], [2.1, 2.1, 3.0]]);
    for walls in [&[wall.aabb()][..], &halves] {
        let parts = walls.len() as u32;
        let root = Aabb::from([[0.0; 3], [2.1, 2.1, 3.0]]);
        let mut nodes = vec![Node::inner(root, 1, parts + 1)];
        nodes.extend((0..).zip(walls).map(|(i, &aabb)| Node::leaf(aabb, i, 1)));
        nodes.push(Node::leaf(scattered, parts, 24));
        let prim_ids = walls.iter().map(|_| 0).chain(1..25).collect();
        let wide = WideBvh::new(&Bvh::new(nodes, prim_ids), &triangles).unwrap();
        let ray = Ray::half_line([0.1, 0.1, -1.0], [0.0, 0.0, 1.0]).unwrap();
        let mut counts = TestCounts::default();
        assert!(wide.any_hit_counted(&ray, &mut counts));
        assert_eq!(counts.objects, WideBvh::OBJECTS_OF_BLOCK, "{parts}");
    }
}
