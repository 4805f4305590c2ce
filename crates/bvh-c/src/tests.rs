//! Wrong arguments from C are rejected by name, and the results of right ones agree with the Rust
//! crates. The programs in `examples/` call every function from C, and know their answers.

use crate::failure::{BvsStatus, bvs_last_error, status};
use crate::{double::*, instances::*, sky::*, tracer::*, tree::*};
use bvh_search::bvh_core::export::Target;
use bvh_search::bvh_core::{DRay, DTriangle, DWideBvh, Orientation, Primitives, Select};
use bvh_search::{Objects, Options, OwnedTree, prelude::*};
use std::ffi::{CStr, CString, c_void};
use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Returns the corners of a staircase of right triangles.
fn corners(count: usize) -> Vec<f32> {
    (0..count).map(|i| i as f32).flat_map(|x| [x, 0.0, x, x + 1.5, 0.0, x, x, 1.5, x]).collect()
}

/// Returns rays that run upwards from a line below the staircase, and beyond its end.
fn rays(slope: f32) -> Vec<BvsRay> {
    let origin = |i: u16| [f32::from(i) * 0.03, 0.2, -1.0];
    let direction = [slope, 0.0, 1.0];
    (0..1500)
        .map(|i| BvsRay { origin: origin(i), t_min: 0.0, direction, t_max: f32::INFINITY })
        .collect()
}

/// A search without objects, and every choice at its default.
const NO_BAKE: BvsBake = BvsBake {
    objects: BvsObjects::NONE,
    rays: null(),
    ray_count: 0,
    references: 0.0,
    seconds: 0.0,
    work: 0,
    seed: 0,
    frame: 0,
};

/// A sky without directions.
const NO_SKY: BvsSky = BvsSky {
    directions: null(),
    count: 0,
    t_min: 0.0,
    t_max: f64::INFINITY,
    weights: null(),
    columns: 0,
    cosine: 0,
};

const NO_HIT: BvsHit = BvsHit { t: 0.0, object: 7 };

/// Triangles of nine numbers each.
fn soup(corners: &[f32]) -> BvsObjects {
    BvsObjects { vertices: corners.as_ptr(), count: corners.len() / 9, ..BvsObjects::NONE }
}

fn last_error() -> String {
    // SAFETY: the message ends with a zero, and no call of this thread fails before the copy is
    // made.
    let message = unsafe { CStr::from_ptr(bvs_last_error()) };
    message.to_str().unwrap().to_owned()
}

#[track_caller]
fn ok(status: BvsStatus) {
    assert_eq!(status, BvsStatus::Ok, "{}", last_error());
}

#[track_caller]
fn rejected(has_failed: bool, part: &str) {
    assert!(has_failed && last_error().contains(part), "{part}: {}", last_error());
}

#[track_caller]
fn invalid(status: BvsStatus, part: &str) {
    rejected(status == BvsStatus::Invalid, part);
}

fn triangles(corners: &[f32]) -> Vec<Triangle> {
    let (points, _) = corners.as_chunks::<3>();
    let (triangles, _) = points.as_chunks::<3>();
    triangles.iter().map(|&corners| Triangle::from(corners)).collect()
}

fn tree(corners: &[f32]) -> *mut BvsTree {
    // SAFETY: `corners` has nine floats for each of the triangles.
    unsafe { bvs_tree_from_triangles(corners.as_ptr(), corners.len() / 9, 0.02, 1.0) }
}

#[test]
fn a_tree_that_is_improved_has_the_nodes_and_the_cost_of_the_rust_crates() {
    let tree = tree(&corners(40));
    let [mut count, mut id_count] = [0; 2];
    let [mut before, mut after] = [0.0; 2];
    // SAFETY: both arrays are read before the tree is improved.
    unsafe {
        let nodes = std::slice::from_raw_parts(bvs_tree_nodes(tree, &mut count), count);
        let ids = std::slice::from_raw_parts(bvs_tree_object_ids(tree, &mut id_count), id_count);
        assert_eq!((nodes.len(), ids.len(), nodes[0].first, nodes[0].min), (80, 40, 2, [0.0; 3]));
        ok(bvs_tree_cost(tree, BvsCost::InternalArea as u32, &mut before));
        assert_eq!(before, cost::internal_area((*tree).owned.tree()));
        ok(bvs_tree_improve(tree, 0.02));
        ok(bvs_tree_cost(tree, BvsCost::InternalArea as u32, &mut after));
        assert!(after <= before);
        bvs_tree_free(tree);
    }
}

#[test]
fn every_answer_of_a_tracer_is_that_of_the_rust_crates() {
    let corners = corners(40);
    let triangles = triangles(&corners);
    let segments: Vec<f32> =
        (0..60).flat_map(|i| [i as f32 * 0.5, 0.2, -1.0, i as f32 * 0.5, 0.2, 30.0]).collect();
    let rays = rays(0.1);
    let (first, count) = (rays.as_ptr(), rays.len());
    let points: Vec<f32> = rays.iter().flat_map(|ray| ray.origin).collect();
    let no_surface =
        BvsSurfaceHit { t: f32::INFINITY, object: u32::MAX, u: 0.0, v: 0.0, normal: [0.0; 3] };
    let mut hits = vec![NO_HIT; count];
    let mut any = vec![9u8; count];
    let mut surfaces = vec![BvsSurfaceHit { u: 7.0, ..no_surface }; count];
    let mut all = vec![NO_HIT; 9000];
    let mut counts = vec![9; count];
    let mut total = 0;
    let mut closest = vec![BvsClosest::from(None); count];
    let mut inside = vec![9u8; count];
    // SAFETY: every pointer comes with its array's length.
    unsafe {
        let bake = BvsBake { objects: soup(&corners), rays: segments.as_ptr(), ..NO_BAKE };
        let tree = bvs_tree_bake(&BvsBake { ray_count: 60, seconds: 0.02, ..bake });
        let tracer = bvs_tracer_new(tree);
        ok(bvs_tracer_surface_hits(tracer, first, count, 0, surfaces.as_mut_ptr()));
        ok(bvs_tracer_closest_points(tracer, points.as_ptr(), count, closest.as_mut_ptr()));
        ok(bvs_tracer_contains(tracer, points.as_ptr(), count, inside.as_mut_ptr()));
        // Without room for all hits, their number is written nevertheless.
        for capacity in [10, 9000] {
            let (hits, counts) = (all.as_mut_ptr(), counts.as_mut_ptr());
            ok(bvs_tracer_all_hits(tracer, first, count, hits, capacity, counts, &mut total));
        }
        for coherent in [0, 1] {
            ok(bvs_tracer_nearest_hits(tracer, first, count, coherent, hits.as_mut_ptr()));
            ok(bvs_tracer_any_hits(tracer, first, count, coherent, any.as_mut_ptr()));
            for (ray, (hit, any)) in rays.iter().zip(hits.iter().zip(&any)) {
                let exact = Ray::half_line(ray.origin, ray.direction).unwrap();
                let expected = nearest_hit((*tree).owned.tree(), &triangles, &exact);
                let Hit { t, object } = expected.unwrap_or(Hit::MISS);
                let expected = (BvsHit { t, object }, u8::from(expected.is_some()));
                assert_eq!((*hit, *any), expected);
                let mut alone = (NO_HIT, 9);
                ok(bvs_nearest(tracer, ray, &mut alone.0));
                ok(bvs_any(tracer, ray, &mut alone.1));
                assert_eq!(alone, expected);
            }
        }
        bvs_tracer_free(tracer);
        bvs_tree_free(tree);
    }
    assert!(any.contains(&0) && any.contains(&1));
    let mut first = 0;
    for (index, ray) in rays.iter().enumerate() {
        let ray = Ray::half_line(ray.origin, ray.direction).unwrap();
        let crossed = triangles.iter().filter(|triangle| triangle.crossing(&ray).is_some()).count();
        assert_eq!(counts[index] as usize, crossed);
        assert!(all[first..first + crossed].is_sorted_by(|a, b| a.t <= b.t));
        first += crossed;
        let surface = surfaces[index];
        assert_eq!((surface.t, surface.object), (hits[index].t, hits[index].object));
        if let Some(triangle) = triangles.get(surface.object as usize) {
            let [a, b, c] = triangle.0;
            let point = a + surface.u * (b - a) + surface.v * (c - a);
            assert!(point.distance(ray.at(surface.t)) < 1e-4);
            assert_eq!(Some(Vec3::from(surface.normal)), triangle.normal());
        } else {
            assert_eq!(surface, no_surface);
        }
        let found = triangles[closest[index].object as usize].closest_point(ray.origin());
        assert_eq!((closest[index].point, inside[index]), (found.to_array(), 0));
    }
    assert!(total == first && total > 100);
}

#[test]
fn indexed_and_strided_vertices_are_baked_and_moved_as_the_corners_themselves() {
    let before = corners(40);
    let after: Vec<f32> = before.iter().map(|number| number * 0.5 + 3.0).collect();
    // Vertices in reverse order, with a normal behind each, and a material behind the indices.
    let [vertices, moved_vertices] = [&before, &after].map(|corners| {
        let vertices = corners.chunks(3).rev();
        vertices.flat_map(|vertex| [vertex, &[f32::NAN; 3]].concat()).collect::<Vec<f32>>()
    });
    let ids: Vec<u32> =
        (0..40).flat_map(|i| [119 - 3 * i, 118 - 3 * i, 117 - 3 * i, 999]).collect();
    let objects = BvsObjects {
        count: 40,
        vertices: vertices.as_ptr(),
        vertex_count: 120,
        vertex_stride: 24,
        indices: ids.as_ptr(),
        index_stride: 16,
        ..BvsObjects::NONE
    };
    let moved = BvsObjects { vertices: moved_vertices.as_ptr(), ..objects };
    // SAFETY: every array has the promised length, and everything is freed once.
    unsafe {
        let [tree, of_corners] = [objects, soup(&before)]
            .map(|objects| bvs_tree_bake(&BvsBake { objects, work: 3000, ..NO_BAKE }));
        assert_eq!((*tree).owned.save(), (*of_corners).owned.save());
        let tracer = bvs_tracer_new(tree);
        ok(bvs_tree_update(tree, &moved));
        ok(bvs_tree_update(of_corners, &soup(&after)));
        assert_eq!((*tree).owned.save(), (*of_corners).owned.save());
        // A scene keeps the triangles that the tracer had.
        let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let here = BvsInstance { part: 0, transform: identity };
        let scene = bvs_instances_new(&tracer.cast_const(), 1, &here, 1, 0.0);
        let ray = BvsRay { t_max: 100.0, ..rays(0.0)[0] };
        let mut hits = [NO_HIT; 2];
        let mut hit = BvsInstanceHit { t: 0.0, instance: 9, triangle: 9 };
        ok(bvs_nearest(tracer, &ray, &mut hits[0]));
        ok(bvs_tracer_update(tracer, &moved));
        ok(bvs_nearest(tracer, &ray, &mut hits[1]));
        ok(bvs_instances_nearest_hits(scene, &ray, 1, &mut hit));
        let BvsHit { t, object: triangle } = hits[0];
        assert_eq!(hit, BvsInstanceHit { t, instance: 0, triangle });
        assert_ne!(hits[0], hits[1]);
        invalid(bvs_instances_update(scene, &here, 2), "count is 2; accepted: 1");
        bvs_instances_free(scene);
        bvs_instances_free(null_mut());
        bvs_tracer_free(tracer);
        bvs_tree_free(tree);
        bvs_tree_free(of_corners);
    }
}

/// A ray between other numbers, as programs have them.
#[repr(C)]
#[derive(Clone, Copy)]
struct Particle {
    energy: f64,
    ray: BvsRayF64,
    hit: BvsHitF64,
    material: u64,
}

#[test]
fn batches_in_f64_have_strides_sides_and_excluded_ids_of_each_ray() {
    const FAR: f64 = 5_412_345.678;
    let numbers: Vec<f64> = corners(40).into_iter().map(|x| f64::from(x) / 3.0 + FAR).collect();
    let (points, _) = numbers.as_chunks::<3>();
    let (corners, _) = points.as_chunks::<3>();
    let triangles: Vec<DTriangle> = corners.iter().map(|&corners| corners.into()).collect();
    let mut vertices: Vec<f64> =
        numbers.chunks(3).flat_map(|xyz| [xyz, &[f64::NAN]].concat()).collect();
    let vertices_f64 = vertices.as_mut_ptr();
    let objects = BvsObjects { count: 40, vertices_f64, vertex_stride: 32, ..BvsObjects::NONE };
    let missing = BvsHitF64 { t: 0.0, object: 7 };
    let mut particles: Vec<Particle> = (0..1500u16)
        .map(|i| {
            let up = f64::from(i % 2) * 2.0 - 1.0;
            let origin = [FAR + f64::from(i) * 0.01, FAR + 0.1, FAR + 7.0 - up * 9.0];
            let ray = BvsRayF64 { origin, t_min: 0.5, direction: [0.01, 0.0, up], t_max: 13.0 };
            Particle { energy: 1.0, ray, hit: missing, material: 5 }
        })
        .collect();
    let excluded: Vec<u32> = (0..1500u32).flat_map(|i| [i / 38, u32::MAX]).collect();
    // SAFETY: every array has the promised length, and everything is freed once.
    unsafe {
        let tree = bvs_tree_bake(&BvsBake { objects, work: 3000, frame: 1, ..NO_BAKE });
        let single = BvsObjects { count: 40, ..BvsObjects::NONE };
        let accepted = "objects are 40 triangles; accepted: 40 triangles in f64";
        invalid(bvs_tree_update(tree, &single), accepted);
        rejected(bvs_tracer_new(tree).is_null(), "tree is over triangles in f64");
        let wide = DWideBvh::new((*tree).owned.tree(), &triangles).unwrap();
        let tracer = bvs_tracer_f64_new(tree);
        bvs_tree_free(tree);
        let sides = [Orientation::Any, Orientation::Exiting, Orientation::Entering];
        for (side, excluded_count) in [(0, 0), (1, 2), (2, 2), (0, 2)] {
            let orientation = side as u32;
            let select = BvsSelect { orientation, excluded_count, excluded: excluded.as_ptr() };
            let select = if orientation + excluded_count == 0 { null() } else { &raw const select };
            let (first, count) = (particles.as_mut_ptr(), particles.len());
            let (rays, hits) = (&raw const (*first).ray, &raw mut (*first).hit);
            let stride = size_of::<Particle>();
            let mut any = vec![9; 2 * count];
            let flags = any.as_mut_ptr();
            ok(bvs_tracer_any_hits_f64(tracer, rays, stride, count, 1, select, flags, 2));
            ok(bvs_tracer_nearest_hits_f64(tracer, rays, stride, count, 0, select, hits, stride));
            let mut found = 0;
            for (number, Particle { energy, ray, hit, material }) in particles.iter().enumerate() {
                let exclude = &excluded[2 * number..][..excluded_count as usize];
                let ray = DRay::new(ray.origin, ray.direction, ray.t_min, ray.t_max).unwrap();
                let expected = wide.nearest_hit(&ray, Select { orientation: sides[side], exclude });
                assert_eq!((*hit, *energy, *material), (expected.into(), 1.0, 5));
                assert_eq!(any[2 * number..][..2], [u8::from(expected.is_some()), 9]);
                found += usize::from(expected.is_some());
            }
            assert!((200..1400).contains(&found), "{found}");
        }
        let ray = particles[0].ray;
        let mut hit = missing;
        let wrong = BvsSelect { orientation: 3, excluded_count: 0, excluded: null() };
        let status = bvs_nearest_f64(tracer, &ray, &wrong, &mut hit);
        invalid(status, "orientation is 3; accepted: 0 to 2");
        let wrong = BvsSelect { orientation: 0, excluded_count: 1, excluded: null() };
        invalid(bvs_nearest_f64(tracer, &ray, &wrong, &mut hit), "excluded is null");
        let rays = [ray, BvsRayF64 { origin: [0.0, 1e300, 0.0], ..ray }];
        let batch = |rays, stride, hits| {
            bvs_tracer_nearest_hits_f64(tracer, rays, stride, 2, 0, null(), hits, 0)
        };
        invalid(batch(rays.as_ptr(), 0, &mut hit), "rays[1]: the ray's origin");
        invalid(batch(rays.as_ptr(), 60, &mut hit), "rays has a stride of 60 bytes");
        invalid(batch(rays.as_ptr(), 0, null_mut()), "hits is null");
        invalid(bvs_any_f64(tracer, null(), null(), null_mut()), "ray is null");
        assert_eq!(hit, missing);
        let (sky, up, far) = (NO_SKY, null(), [0.0, 1e37, 0.0]);
        let status =
            bvs_tracer_visible_f64(tracer, &sky, far.as_ptr(), up, 1, null_mut(), null_mut());
        invalid(status, "points[0] is [0, 1000");
        bvs_tracer_f64_free(tracer);
        bvs_tracer_f64_free(null_mut());
        *vertices_f64.add(4 * 5 + 1) = -1e37;
        let refused = bvs_tree_bake(&BvsBake { objects, ..NO_BAKE });
        rejected(refused.is_null(), "vertex 5 of triangle 1 is [");
        let single = self::tree(&[0.0; 9]);
        rejected(bvs_tracer_f64_new(single).is_null(), "vertices_f64");
        bvs_tree_free(single);
    }
}

#[test]
fn points_see_past_a_wall_what_it_does_not_hide() {
    let wall = [1.0f32, -9.0, 0.0, 1.0, 9.0, 0.0, 1.0, 0.0, 9.0];
    let points = [0.0f32, 0.0, 1.0, 2.0, 0.0, 1.0];
    let normals = [3.0f32, 0.0, 4.0].repeat(2);
    // To the wall, along it up and down, and again, so that there is a second word of bits.
    let directions = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, -1.0].repeat(22);
    let weights = [1.0, 10.0, 2.0, 20.0, 4.0, 40.0].repeat(22);
    let (directions, weights) = (directions.as_ptr(), weights.as_ptr());
    let sky = BvsSky { directions, count: 66, weights, columns: 2, ..NO_SKY };
    // SAFETY: every array has the promised length, and everything is freed once.
    unsafe {
        let tree = tree(&wall);
        let tracer = bvs_tracer_new(tree);
        bvs_tree_free(tree);
        let see = |sky: &BvsSky, has_normals: bool, has_bits: bool, has_sums: bool| {
            let (mut bits, mut sums) = ([9u64; 4], [9.0; 4]);
            let normals = if has_normals { normals.as_ptr() } else { null() };
            let to_bits = if has_bits { bits.as_mut_ptr() } else { null_mut() };
            let to = if has_sums { sums.as_mut_ptr() } else { null_mut() };
            ok(bvs_tracer_visible(tracer, sky, points.as_ptr(), normals, 2, to_bits, to));
            (bits, sums)
        };
        // The directions that are free, of each three, and the sums of one column.
        let cosine = BvsSky { cosine: 1, ..sky };
        let plain = BvsSky { weights: null(), ..sky };
        for (sky, has_normals, free, sums) in [
            (sky, false, [0b110, 0b111], [6.0, 7.0]),
            (BvsSky { t_max: 0.0, ..sky }, false, [0b110, 0b111], [6.0, 7.0]),
            (sky, true, [0b010, 0b011], [2.0, 3.0]),
            (cosine, true, [0b010, 0b011], [1.6, 2.2]),
            (BvsSky { t_max: 0.5, ..sky }, false, [0b111; 2], [7.0; 2]),
            (BvsSky { t_min: 1.5, ..sky }, false, [0b111; 2], [7.0; 2]),
            (plain, false, [0b110, 0b111], [2.0, 3.0]),
        ] {
            let (bits, found) = see(&sky, has_normals, true, true);
            for (point, free) in free.into_iter().enumerate() {
                let all = (0..22).fold(0u128, |all, three| all | free << (3 * three));
                assert_eq!(bits[2 * point..][..2], [all as u64, (all >> 64) as u64]);
                let expected = match sky.weights.is_null() {
                    true => 22.0 * sums[point] - found[point],
                    false => 220.0 * sums[point] - found[2 * point + 1],
                };
                assert!(expected.abs() < 1e-9, "{found:?} {sums:?}");
            }
        }
        // Either result alone, and directions of which there are none.
        let (bits, sums) = see(&sky, false, true, true);
        assert_eq!(see(&sky, false, true, false), (bits, [9.0; 4]));
        assert_eq!(see(&sky, false, false, true), ([9; 4], sums));
        assert_eq!(see(&BvsSky { count: 0, ..plain }, false, false, true).1, [0.0, 0.0, 9.0, 9.0]);
        let nan = [0.0, 0.0, 0.0, 0.0, f32::NAN, 0.0];
        let [none, infinite] =
            [[0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [1.0, f64::INFINITY, 0.0, 0.0, 0.0, 0.0]];
        let mut sums = [9.0; 4];
        for (sky, points, normals, message) in [
            (&raw const cosine, &nan, null(), "cosine is not 0 and normals is null"),
            (&plain, &nan, null(), "points[1] is [0, NaN, 0]; accepted: up to 3.4"),
            (&plain, &points, nan.as_ptr(), "normals[1] is [0, NaN, 0]"),
            (null(), &points, null(), "sky is null"),
            (&BvsSky { t_min: -1.0, ..plain }, &points, null(), "the range -1..=inf"),
            (&BvsSky { directions: null(), ..plain }, &points, null(), "directions is null"),
            (
                &BvsSky { directions: none.as_ptr(), count: 2, ..plain },
                &points,
                null(),
                "direction 1 is [0, 0, 0]",
            ),
            (
                &BvsSky { weights: infinite.as_ptr(), columns: 1, count: 2, ..sky },
                &points,
                null(),
                "weight 1 is inf",
            ),
            (&BvsSky { columns: 0, ..sky }, &points, null(), "0 weights for 66 directions"),
        ] {
            let to = sums.as_mut_ptr();
            let status =
                bvs_tracer_visible(tracer, sky, points.as_ptr(), normals, 2, null_mut(), to);
            invalid(status, message);
        }
        assert_eq!(sums, [9.0; 4]);
        bvs_tracer_free(tracer);
    }
}

/// Cancels at the thousandth call.
unsafe extern "C" fn asked_enough(context: *mut c_void) -> u8 {
    // SAFETY: the context is the test's counter, which outlives the search and is changed
    // atomically.
    let asked = unsafe { &*context.cast::<AtomicU64>() };
    u8::from(asked.fetch_add(1, Relaxed) >= 1000)
}

#[test]
fn a_search_of_hours_ends_when_the_caller_cancels_it_and_keeps_its_tree() {
    let corners: Vec<f32> =
        (0..9 * 3000u32).map(|i| (i.wrapping_mul(2_654_435_761) >> 16) as f32).collect();
    // SAFETY: `corners` has nine floats for each of the 3000 triangles.
    let tree = unsafe { bvs_tree_from_triangles(corners.as_ptr(), 3000, 0.0, 1.0) };
    let mut asked = AtomicU64::new(0);
    let mut before = 0.0;
    let mut after = 0.0;
    let start = std::time::Instant::now();
    // SAFETY: the tree is not freed before the last call, no other thread uses it, and any thread
    // may call the function, which only counts atomically.
    unsafe {
        bvs_tree_cost(tree, BvsCost::InternalArea as u32, &mut before);
        let context = (&raw mut asked).cast();
        ok(bvs_tree_improve_until(tree, 36_000.0, Some(asked_enough), context));
        bvs_tree_cost(tree, BvsCost::InternalArea as u32, &mut after);
        bvs_tree_free(tree);
    }
    assert!(asked.into_inner() > 1000 && start.elapsed().as_secs() < 600);
    assert!(after < before, "{after} of {before}");
}

#[test]
fn files_are_those_of_the_library_and_a_wrong_one_is_named() {
    let corners = corners(9);
    let objects = soup(&corners);
    let tree = tree(&corners);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree.bvh");
    let named = CString::new(path.to_str().unwrap()).unwrap();
    // SAFETY: `corners` has nine floats for each triangle, the strings end with a zero, and the
    // trees are freed last.
    unsafe {
        for target in Target::ALL {
            let tracer = CString::new(target.name).unwrap();
            ok(bvs_tree_export(tree, tracer.as_ptr(), 0, named.as_ptr()));
            let exported = (*tree).owned.export(&target, false).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), exported);
        }
        let status = bvs_tree_export(tree, c"embree".as_ptr(), 0, named.as_ptr());
        invalid(status, "tracer is \"embree\"; accepted: three-mesh-bvh, ");
        ok(bvs_tree_save(tree, named.as_ptr()));
        let loaded = bvs_tree_load(named.as_ptr(), &objects);
        assert_eq!((*loaded).owned.tree(), (*tree).owned.tree());
        let mut size = 0;
        let bytes = bvs_tree_to_bytes(tree, &mut size);
        let saved = std::slice::from_raw_parts(bytes, size);
        assert!(saved == std::fs::read(&path).unwrap());
        let from_bytes = bvs_tree_from_bytes(bytes, size, &objects);
        assert_eq!((*from_bytes).owned.tree(), (*tree).owned.tree());
        bvs_tree_free(from_bytes);
        let fewer = BvsObjects { count: 8, ..objects };
        rejected(bvs_tree_load(named.as_ptr(), &fewer).is_null(), "9 objects; this one has 8");
        rejected(bvs_tree_from_bytes(bytes, size, &fewer).is_null(), "this one has 8");
        rejected(bvs_tree_from_bytes(bytes, size - 1, &objects).is_null(), "");
        bvs_bytes_free(bytes, size);
        bvs_bytes_free(null_mut(), 0);
        std::fs::remove_file(&path).unwrap();
        rejected(bvs_tree_load(named.as_ptr(), &objects).is_null(), path.to_str().unwrap());
        assert_eq!(bvs_tree_save(tree, c"/nowhere/at/all".as_ptr()), BvsStatus::File);
        invalid(bvs_tree_save(tree, c"\xff".as_ptr()), "path is not UTF-8");
        bvs_tree_free(loaded);
        bvs_tree_free(tree);
    }
}

#[test]
fn invalid_arguments_are_rejected_by_name() {
    let right = corners(5);
    let mut wrong = right.clone();
    let tree = tree(&wrong);
    wrong[9 * 3] = f32::NAN;
    let boxes = [0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0];
    let ray = BvsRay { origin: [0.0; 3], t_min: 0.0, direction: [0.0; 3], t_max: 1.0 };
    // SAFETY: every pointer that a call dereferences comes with its array's length; null, unaligned
    // and oversized arrays are rejected before.
    unsafe {
        for (corners, count, seconds, references, message) in [
            (wrong.as_ptr(), 5, 0.0, 1.0, "vertex 9 of triangle 3 is [NaN, "),
            (null(), 5, 0.0, 1.0, "boxes, vertices and vertices_f64 are null"),
            (wrong.as_ptr().byte_add(1), 5, 0.0, 1.0, "vertices is not aligned to a multiple of 4"),
            (wrong.as_ptr(), usize::MAX, 0.0, 1.0, "more than memory has"),
            (right.as_ptr(), 5, 0.0, f64::NAN, "references is NaN; accepted: 1 to 16"),
            (right.as_ptr(), 5, -1.0, 1.0, "seconds is -1.0; accepted: 0 to 1e19"),
            (wrong.as_ptr(), 0, f64::INFINITY, 1.0, "seconds is inf"),
        ] {
            let tree = bvs_tree_from_triangles(corners, count, seconds, references);
            rejected(tree.is_null(), message);
        }
        let timeless = bvs_tree_from_boxes(boxes.as_ptr(), 1, -1.0);
        rejected(timeless.is_null(), "seconds is -1.0; accepted: 0 to 1e19");
        let inverted = [[0.0f32; 6], [2.0, 0.0, 0.0, 1.0, 1.0, 1.0]];
        let inverted = bvs_tree_from_boxes(inverted.as_ptr().cast(), 2, 0.0);
        rejected(inverted.is_null(), "object 1, [2, 0, 0] to [1, 1, 1], has min above max");
        let boxed = bvs_tree_from_boxes(boxes.as_ptr(), 1, 0.0);
        rejected(bvs_tracer_new(boxed).is_null(), "tree is over boxes");
        rejected(bvs_tree_load(null(), &BvsObjects::NONE).is_null(), "path is null");
        rejected(bvs_tree_load(c"none".as_ptr(), null()).is_null(), "objects is null");
        rejected(bvs_tree_to_bytes(tree, null_mut()).is_null(), "size is null");
        let mut cost = 7.0;
        invalid(bvs_tree_cost(tree, 4, &mut cost), "kind is 4; accepted: 0 to 3");
        invalid(bvs_tree_cost(null(), 0, &mut cost), "tree is null");
        assert_eq!(cost, 7.0);
        invalid(bvs_tree_cost(tree, 0, null_mut()), "cost is null");
        let misaligned = (&raw mut cost).byte_add(1);
        invalid(bvs_tree_cost(tree, 0, misaligned), "cost is not aligned to a multiple of 8");
        let ids = [0u32, 1, 2, 0, 2, 15];
        let indexed =
            BvsObjects { count: 2, vertex_count: 15, indices: ids.as_ptr(), ..soup(&wrong) };
        for (objects, message) in [
            (BvsObjects { boxes: wrong.as_ptr(), ..indexed }, "several of boxes, vertices and "),
            (
                BvsObjects { vertices: null(), ..indexed },
                "boxes, vertices and vertices_f64 are null",
            ),
            (indexed, "triangle 1 has vertex 15 of 15, counted from 0"),
            (BvsObjects { vertex_stride: 8, ..indexed }, "vertices has a stride of 8 bytes"),
            (BvsObjects { index_stride: 14, ..indexed }, "indices has a stride of 14 bytes"),
            (BvsObjects { index_stride: usize::MAX - 3, ..indexed }, "more than memory has"),
            (BvsObjects { indices: null(), ..indexed }, "accepted: 0, or 3 * count = 6"),
        ] {
            rejected(bvs_tree_bake(&BvsBake { objects, ..NO_BAKE }).is_null(), message);
            invalid(bvs_tree_update(tree, &BvsObjects { count: 5, ..objects }), "");
        }
        let fewer = BvsObjects { count: 4, ..soup(&wrong) };
        invalid(bvs_tree_update(tree, &fewer), "objects are 4 triangles; accepted: 5 triangles");
        let boxes_now = BvsObjects { count: 5, boxes: wrong.as_ptr(), ..BvsObjects::NONE };
        invalid(bvs_tree_update(tree, &boxes_now), "objects are 5 boxes; accepted: 5 triangles");
        invalid(bvs_tree_update(tree, &soup(&wrong)), "vertex 9 of triangle 3 is [NaN, ");
        let many = BvsBake { references: 17.0, work: 1, ..NO_BAKE };
        rejected(bvs_tree_bake(&many).is_null(), "references is 17; accepted: 1 to 16");
        rejected(bvs_tree_bake(null()).is_null(), "bake is null");
        rejected(bvs_tree_nodes(tree, null_mut()).is_null(), "count is null");
        rejected(bvs_tree_nodes(null(), &mut 0).is_null(), "tree is null");
        invalid(bvs_tree_improve(null_mut(), 1.0), "tree is null");
        let tracer = bvs_tracer_new(tree);
        let mut hit = BvsHit { t: 5.0, object: 5 };
        let status = bvs_tracer_nearest_hits(tracer, &ray, 1, 0, &mut hit);
        invalid(status, "rays[0]: the ray's direction");
        invalid(bvs_nearest(tracer, &ray, &mut hit), "the ray's direction");
        invalid(bvs_any(tracer, &ray, null_mut()), "the ray's direction");
        let up = BvsRay { direction: [0.0, 0.0, 1.0], ..ray };
        invalid(bvs_nearest(tracer, &up, null_mut()), "hit is null");
        invalid(bvs_any(null(), &up, null_mut()), "tracer is null");
        invalid(bvs_tracer_update(tracer, &fewer), "objects are 4 triangles; accepted: 5");
        let flat = [0.0; 45];
        invalid(bvs_tracer_update(tracer, &soup(&flat)), "had an area, and is missing");
        let parts = [tracer.cast_const(), null()];
        let instance = BvsInstance { part: 0, transform: [0.0; 12] };
        let no_scene = bvs_instances_new(parts.as_ptr(), 2, &instance, 1, 0.0);
        rejected(no_scene.is_null(), "parts[1] is null");
        let no_scene = bvs_instances_new(parts.as_ptr(), 1, &instance, 1, 0.0);
        rejected(no_scene.is_null(), "transform of instance 0");
        ok(bvs_tracer_nearest_hits(tracer, null(), 0, 0, null_mut()));
        invalid(bvs_tracer_any_hits(tracer, null(), 1, 0, null_mut()), "rays is null");
        assert_eq!(hit.object, 5);
        for freed in [tree, boxed, null_mut()] {
            bvs_tree_free(freed);
        }
        bvs_tracer_free(tracer);
        bvs_tracer_free(null_mut());
    }
}

#[test]
fn a_budget_of_work_and_none_at_all_give_the_file_of_the_rust_crates() {
    let corners = corners(40);
    let triangles = triangles(&corners);
    let ends = |i: f32| [[i, 9.0, 0.5], [i + 0.5, 0.5, i]];
    let floats: Vec<[[f32; 3]; 2]> = (0..60u8).map(|i| ends(i.into())).collect();
    let segments: Vec<Segment> = floats.iter().map(|&[from, to]| Segment { from, to }).collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.bvh");
    let name = CString::new(path.to_str().unwrap()).unwrap();
    for (references, work, rays) in
        [(1.5, 50_000, &[][..]), (1.0, 50_000, &segments), (0.0, 0, &[])]
    {
        let bake = BvsBake {
            objects: soup(&corners),
            rays: floats.as_ptr().cast(),
            ray_count: rays.len(),
            references,
            work,
            seed: 3,
            frame: 1,
            ..NO_BAKE
        };
        // SAFETY: every pointer comes with its array's length, and the tree is freed once.
        unsafe {
            let tree = bvs_tree_bake(&bake);
            if (*tree).owned.tree().prim_ids.len() > triangles.len() {
                let tracer = c"three-mesh-bvh".as_ptr();
                let status = bvs_tree_export(tree, tracer, 0, name.as_ptr());
                invalid(status, "a query of three-mesh-bvh for all hits");
                ok(bvs_tree_export(tree, tracer, 1, name.as_ptr()));
            }
            ok(bvs_tree_save(tree, name.as_ptr()));
            bvs_tree_free(tree);
        }
        let objects = Objects::Shapes(Primitives::Triangles(triangles.clone()));
        let given = |number: f64| (number > 0.0).then_some(number);
        let max_work = given(work as f64).map(|work| work as u64);
        let options = Options {
            references: given(references),
            seed: 3,
            budget: Budget { max_work, ..Budget::UNLIMITED },
            rays,
            anywhere: Some(bvh_scenes::rays::anywhere),
            ..Options::default()
        };
        let expected = OwnedTree::find(objects, &options, &()).unwrap();
        assert_eq!(expected.reasons().len() > 1, work == 0);
        let expected = expected.save().unwrap();
        assert!(std::fs::read(&path).unwrap() == expected, "{references}, {} rays", rays.len());
    }
}

#[test]
fn a_bake_over_nothing_gives_an_empty_tree_within_a_budget_and_without() {
    for work in [0, 1000] {
        // SAFETY: there are no arrays, and the tree is freed once.
        unsafe {
            let tree = bvs_tree_bake(&BvsBake { work, ..NO_BAKE });
            assert!(!tree.is_null(), "{}", last_error());
            bvs_tree_free(tree);
        }
    }
}

#[test]
fn a_panic_becomes_a_status_and_a_message_for_its_thread() {
    assert_eq!(status(|| panic!("node {} is missing", 3)), BvsStatus::Fault);
    assert_eq!(last_error(), "a fault of the library: node 3 is missing");
    assert_eq!(std::thread::spawn(last_error).join().unwrap(), "");
    // A success does not clear the message.
    assert_eq!(status(|| Ok(())), BvsStatus::Ok);
    assert_eq!(last_error(), "a fault of the library: node 3 is missing");
}
