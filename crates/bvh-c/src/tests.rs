//! Wrong arguments from C are rejected by name, and the results of right ones agree with the Rust
//! crates.

use crate::failure::{BvhStatus, bvh_last_error, status};
use crate::{tracer::*, tree::*};
use bvh_search::bvh_core::Primitives;
use bvh_search::bvh_core::export::Target;
use bvh_search::{Frames, Objects, Options, OwnedTree, prelude::*};
use std::ffi::{CStr, CString, c_void};
use std::ptr::{null, null_mut};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Returns the corners of a staircase of right triangles.
fn corners(count: usize) -> Vec<f32> {
    (0..count).map(|i| i as f32).flat_map(|x| [x, 0.0, x, x + 1.5, 0.0, x, x, 1.5, x]).collect()
}

/// Returns rays that run upwards from a line below the staircase, and beyond its end.
fn rays(slope: f32) -> Vec<BvhRay> {
    let origin = |i: u16| [f32::from(i) * 0.03, 0.2, -1.0];
    let direction = [slope, 0.0, 1.0];
    (0..1500)
        .map(|i| BvhRay { origin: origin(i), t_min: 0.0, direction, t_max: f32::INFINITY })
        .collect()
}

/// A search without objects, and every choice at its default.
const NO_BAKE: BvhBake = BvhBake {
    boxes: null(),
    corners: null(),
    count: 0,
    rays: null(),
    ray_count: 0,
    references: 0.0,
    seconds: 0.0,
    work: 0,
    seed: 0,
    frame: 0,
};

fn last_error() -> String {
    // SAFETY: the message ends with a zero, and no call of this thread fails before the copy is
    // made.
    let message = unsafe { CStr::from_ptr(bvh_last_error()) };
    message.to_str().unwrap().to_owned()
}

#[track_caller]
fn ok(status: BvhStatus) {
    assert_eq!(status, BvhStatus::Ok, "{}", last_error());
}

#[track_caller]
fn rejected(has_failed: bool, part: &str) {
    assert!(has_failed && last_error().contains(part), "{part}: {}", last_error());
}

#[track_caller]
fn invalid(status: BvhStatus, part: &str) {
    rejected(status == BvhStatus::Invalid, part);
}

fn tree(corners: &[f32]) -> *mut BvhTree {
    // SAFETY: `corners` has nine floats for each of the triangles.
    unsafe { bvh_tree_from_triangles(corners.as_ptr(), corners.len() / 9, 0.02, 1.0) }
}

#[test]
fn trees_and_hits_equal_the_results_of_the_rust_crates() {
    let corners = corners(40);
    let triangles: Vec<Triangle> = bytes_as_triangles(&corners);
    let tree = tree(&corners);
    let rays = rays(0.0);
    let mut count = 0;
    let mut ids = 0;
    let mut cost = 0.0;
    let mut hits = vec![BvhHit { t: 0.0, object: 0 }; rays.len()];
    let mut any = vec![9u8; rays.len()];
    // SAFETY: every pointer comes with its array's length, and the nodes are copied before the tree
    // is improved.
    unsafe {
        let nodes = std::slice::from_raw_parts(bvh_tree_nodes(tree, &mut count), count).to_vec();
        let ids = std::slice::from_raw_parts(bvh_tree_object_ids(tree, &mut ids), ids);
        assert_eq!((nodes.len(), ids.len(), nodes[0].first, nodes[0].min), (80, 40, 2, [0.0; 3]));
        ok(bvh_tree_cost(tree, BvhCost::InternalArea as u32, &mut cost));
        assert_eq!(cost, cost::internal_area((*tree).owned.tree()));
        let before = cost;
        ok(bvh_tree_improve(tree, 0.02));
        ok(bvh_tree_cost(tree, BvhCost::InternalArea as u32, &mut cost));
        assert!(cost <= before);
        let tracer = bvh_tracer_new(tree);
        for coherent in [0, 1] {
            let count = rays.len();
            let rays = rays.as_ptr();
            ok(bvh_tracer_nearest_hits(tracer, rays, count, coherent, hits.as_mut_ptr()));
            ok(bvh_tracer_any_hits(tracer, rays, count, coherent, any.as_mut_ptr()));
            for (index, (hit, any)) in hits.iter().zip(&any).enumerate() {
                let ray = Ray::half_line((*rays.add(index)).origin, [0.0, 0.0, 1.0]).unwrap();
                let expected = nearest_hit((*tree).owned.tree(), &triangles, &ray);
                let Hit { t, object } = expected.unwrap_or(Hit::MISS);
                assert_eq!((*hit, *any), (BvhHit { t, object }, u8::from(expected.is_some())));
            }
        }
        assert!(any.contains(&0) && any.contains(&1));
        bvh_tracer_free(tracer);
        bvh_tree_free(tree);
    }
}

#[test]
fn surfaces_all_hits_closest_points_and_insides_equal_the_results_of_the_rust_crates() {
    let corners = corners(40);
    let triangles = bytes_as_triangles(&corners);
    let segments: Vec<f32> =
        (0..60).flat_map(|i| [i as f32 * 0.5, 0.2, -1.0, i as f32 * 0.5, 0.2, 30.0]).collect();
    let rays = rays(0.1);
    let none = BvhSurfaceHit { t: 0.0, object: 0, u: 0.0, v: 0.0, normal: [0.0; 3] };
    let mut surfaces = vec![none; rays.len()];
    let mut hits = vec![BvhHit { t: 0.0, object: 0 }; 9000];
    let mut counts = vec![9; rays.len()];
    let mut total = 0;
    let points: Vec<f32> = rays.iter().flat_map(|ray| ray.origin).collect();
    let far = BvhClosest { point: [0.0; 3], distance: 0.0, object: 0 };
    let mut closest = vec![far; rays.len()];
    let mut inside = vec![9u8; rays.len()];
    // SAFETY: every pointer comes with its array's length.
    unsafe {
        let (corners, rays_of_last_frame) = (corners.as_ptr(), segments.as_ptr());
        let tree = bvh_tree_bake(&BvhBake {
            corners,
            count: 40,
            rays: rays_of_last_frame,
            ray_count: 60,
            seconds: 0.02,
            ..NO_BAKE
        });
        let tracer = bvh_tracer_new(tree);
        let count = rays.len();
        ok(bvh_tracer_surface_hits(tracer, rays.as_ptr(), count, 0, surfaces.as_mut_ptr()));
        ok(bvh_tracer_closest_points(tracer, points.as_ptr(), count, closest.as_mut_ptr()));
        ok(bvh_tracer_contains(tracer, points.as_ptr(), count, inside.as_mut_ptr()));
        // Without room for all hits, their number is written nevertheless.
        for capacity in [10, 9000] {
            ok(bvh_tracer_all_hits(
                tracer,
                rays.as_ptr(),
                count,
                hits.as_mut_ptr(),
                capacity,
                counts.as_mut_ptr(),
                &mut total,
            ));
        }
        bvh_tracer_free(tracer);
        bvh_tree_free(tree);
    }
    let mut first = 0;
    for (index, ray) in rays.iter().enumerate() {
        let ray = Ray::half_line(ray.origin, ray.direction).unwrap();
        let crossed = triangles.iter().filter(|triangle| triangle.crossing(&ray).is_some()).count();
        assert_eq!(counts[index] as usize, crossed);
        let nearest = &hits[first..first + crossed];
        assert!(nearest.is_sorted_by(|a, b| a.t <= b.t));
        first += crossed;
        let surface = surfaces[index];
        if let Some(triangle) = triangles.get(surface.object as usize) {
            let [a, b, c] = triangle.0;
            let point = a + surface.u * (b - a) + surface.v * (c - a);
            assert!(point.distance(ray.at(surface.t)) < 1e-4);
            assert_eq!(Some(Vec3::from(surface.normal)), triangle.normal());
        } else {
            assert_eq!(surface, BvhSurfaceHit { t: f32::INFINITY, object: u32::MAX, ..none });
        }
        let found = triangles[closest[index].object as usize].closest_point(ray.origin());
        assert_eq!(closest[index].point, found.to_array());
        assert_eq!(inside[index], 0);
    }
    assert_eq!(total, first);
    assert!(total > 100);
}

fn bytes_as_triangles(corners: &[f32]) -> Vec<Triangle> {
    let (points, _) = corners.as_chunks::<3>();
    let (triangles, _) = points.as_chunks::<3>();
    triangles.iter().map(|&corners| Triangle::from(corners)).collect()
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
    let tree = unsafe { bvh_tree_from_triangles(corners.as_ptr(), 3000, 0.0, 1.0) };
    let mut asked = AtomicU64::new(0);
    let mut before = 0.0;
    let mut after = 0.0;
    let start = std::time::Instant::now();
    // SAFETY: the tree is not freed before the last call, no other thread uses it, and any thread
    // may call the function, which only counts atomically.
    unsafe {
        bvh_tree_cost(tree, BvhCost::InternalArea as u32, &mut before);
        let context = (&raw mut asked).cast();
        ok(bvh_tree_improve_until(tree, 36_000.0, Some(asked_enough), context));
        bvh_tree_cost(tree, BvhCost::InternalArea as u32, &mut after);
        bvh_tree_free(tree);
    }
    assert!(asked.into_inner() > 1000 && start.elapsed().as_secs() < 600);
    assert!(after < before, "{after} of {before}");
}

#[test]
fn files_are_those_of_the_library_and_a_wrong_one_is_named() {
    let corners = corners(9);
    let tree = tree(&corners);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("tree.bvh");
    let named = CString::new(path.to_str().unwrap()).unwrap();
    // SAFETY: `corners` has nine floats for each triangle, the strings end with a zero, and the
    // trees are freed last.
    unsafe {
        for target in Target::ALL {
            let tracer = CString::new(target.name).unwrap();
            ok(bvh_tree_export(tree, tracer.as_ptr(), named.as_ptr()));
            assert_eq!(std::fs::read(&path).unwrap(), (*tree).owned.export(&target).unwrap());
        }
        let status = bvh_tree_export(tree, c"embree".as_ptr(), named.as_ptr());
        invalid(status, "tracer is \"embree\"; accepted: three-mesh-bvh, ");
        ok(bvh_tree_save(tree, named.as_ptr()));
        let loaded = bvh_tree_load_triangles(named.as_ptr(), corners.as_ptr(), 9);
        assert_eq!((*loaded).owned.tree(), (*tree).owned.tree());
        let other = bvh_tree_load_triangles(named.as_ptr(), corners.as_ptr(), 8);
        rejected(other.is_null(), "9 objects; this one has 8");
        std::fs::remove_file(&path).unwrap();
        let removed = bvh_tree_load_triangles(named.as_ptr(), corners.as_ptr(), 9);
        rejected(removed.is_null(), path.to_str().unwrap());
        assert_eq!(bvh_tree_save(tree, c"/nowhere/at/all".as_ptr()), BvhStatus::File);
        invalid(bvh_tree_save(tree, c"\xff".as_ptr()), "path is not UTF-8");
        bvh_tree_free(loaded);
        bvh_tree_free(tree);
    }
}

#[test]
fn invalid_arguments_are_rejected_by_name() {
    let mut wrong = corners(5);
    let tree = tree(&wrong);
    wrong[9 * 3] = f32::NAN;
    let boxes = [0.0f32, 0.0, 0.0, 1.0, 1.0, 1.0];
    let ray = BvhRay { origin: [0.0; 3], t_min: 0.0, direction: [0.0; 3], t_max: 1.0 };
    // SAFETY: every pointer that a call dereferences comes with its array's length; null, unaligned
    // and oversized arrays are rejected before.
    unsafe {
        for (corners, count, seconds, references, message) in [
            (wrong.as_ptr(), 5, 0.0, 1.0, "3"),
            (null(), 5, 0.0, 1.0, "corners is null"),
            (wrong.as_ptr().byte_add(1), 5, 0.0, 1.0, "corners is not aligned to a multiple of 4"),
            (wrong.as_ptr(), usize::MAX, 0.0, 1.0, "more than memory has"),
            (wrong.as_ptr(), 5, 0.0, f64::NAN, "references is NaN; accepted: 1 to 16"),
            (wrong.as_ptr(), 5, -1.0, 1.0, "seconds is -1.0; accepted: 0 to 1e19"),
            (wrong.as_ptr(), 0, f64::INFINITY, 1.0, "seconds is inf"),
        ] {
            let tree = bvh_tree_from_triangles(corners, count, seconds, references);
            rejected(tree.is_null(), message);
        }
        let timeless = bvh_tree_from_boxes(boxes.as_ptr(), 1, -1.0);
        rejected(timeless.is_null(), "seconds is -1.0; accepted: 0 to 1e19");
        let boxed = bvh_tree_from_boxes(boxes.as_ptr(), 1, 0.0);
        rejected(bvh_tracer_new(boxed).is_null(), "tree is over boxes");
        rejected(bvh_tree_load_boxes(null(), boxes.as_ptr(), 1).is_null(), "path is null");
        let mut cost = 7.0;
        invalid(bvh_tree_cost(tree, 4, &mut cost), "kind is 4; accepted: 0 to 3");
        invalid(bvh_tree_cost(null(), 0, &mut cost), "tree is null");
        assert_eq!(cost, 7.0);
        invalid(bvh_tree_cost(tree, 0, null_mut()), "cost is null");
        let misaligned = (&raw mut cost).byte_add(1);
        invalid(bvh_tree_cost(tree, 0, misaligned), "cost is not aligned to a multiple of 8");
        let both = BvhBake { boxes: wrong.as_ptr(), corners: wrong.as_ptr(), count: 3, ..NO_BAKE };
        rejected(bvh_tree_bake(&both).is_null(), "boxes and corners; accepted: one of the two");
        let many = BvhBake { boxes: null(), references: 17.0, count: 0, ..both };
        rejected(bvh_tree_bake(&many).is_null(), "references is 17; accepted: 1 to 16");
        rejected(bvh_tree_bake(null()).is_null(), "bake is null");
        rejected(bvh_tree_nodes(tree, null_mut()).is_null(), "count is null");
        rejected(bvh_tree_nodes(null(), &mut 0).is_null(), "tree is null");
        invalid(bvh_tree_improve(null_mut(), 1.0), "tree is null");
        let tracer = bvh_tracer_new(tree);
        let mut hit = BvhHit { t: 5.0, object: 5 };
        let status = bvh_tracer_nearest_hits(tracer, &ray, 1, 0, &mut hit);
        invalid(status, "rays[0]: the ray's direction");
        ok(bvh_tracer_nearest_hits(tracer, null(), 0, 0, null_mut()));
        invalid(bvh_tracer_any_hits(tracer, null(), 1, 0, null_mut()), "rays is null");
        assert_eq!(hit.object, 5);
        for freed in [tree, boxed, null_mut()] {
            bvh_tree_free(freed);
        }
        bvh_tracer_free(tracer);
        bvh_tracer_free(null_mut());
    }
}

#[test]
fn a_budget_of_work_gives_the_file_of_the_rust_crates() {
    let corners = corners(40);
    let triangles = bytes_as_triangles(&corners);
    let segments: Vec<Segment> = (0..60u8)
        .map(|i| Segment {
            from: [f32::from(i), 9.0, 0.5],
            to: [f32::from(i) + 0.5, 0.5, f32::from(i)],
        })
        .collect();
    let floats: Vec<f32> =
        segments.iter().flat_map(|segment| [segment.from, segment.to]).flatten().collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.bvh");
    let name = CString::new(path.to_str().unwrap()).unwrap();
    for (references, rays) in [(1.0, &[][..]), (1.5, &[]), (1.0, &segments), (1.5, &segments)] {
        let work = 50_000;
        let bake = BvhBake {
            corners: corners.as_ptr(),
            count: triangles.len(),
            rays: floats.as_ptr(),
            ray_count: rays.len(),
            references,
            work,
            seed: 3,
            frame: 1,
            ..NO_BAKE
        };
        // SAFETY: every pointer comes with its array's length, and the tree is freed once.
        unsafe {
            let tree = bvh_tree_bake(&bake);
            ok(bvh_tree_save(tree, name.as_ptr()));
            bvh_tree_free(tree);
        }
        let objects = Objects::Shapes(Primitives::Triangles(triangles.clone()));
        let budget = Budget { max_work: Some(work), ..Budget::UNLIMITED };
        let options = Options { references, seed: 3, budget, rays, frame: Frames::Auto };
        let expected = OwnedTree::find(objects, &options, &()).unwrap().save().unwrap();
        assert!(std::fs::read(&path).unwrap() == expected, "{references}, {} rays", rays.len());
    }
}

#[test]
fn a_panic_becomes_a_status_and_a_message_for_its_thread() {
    assert_eq!(status(|| panic!("node {} is missing", 3)), BvhStatus::Fault);
    assert_eq!(last_error(), "a fault of the library: node 3 is missing");
    assert_eq!(std::thread::spawn(last_error).join().unwrap(), "");
    // A success does not clear the message.
    assert_eq!(status(|| Ok(())), BvhStatus::Ok);
    assert_eq!(last_error(), "a fault of the library: node 3 is missing");
}
