//! Every case of the suite holds for every method, every traversal and every other part.

use crate::hard_rays;
use bvh_core::{Primitives, Triangle};
use bvh_scenes::builtin::stiff::{self, STIFF};
use bvh_scenes::trace::{Accelerator, Structure};
use bvh_search::Method;
use bvh_stress::transform::scaled_triangles;
use bvh_stress::{CASES, Cell, Check, Class, Effort, KINDS, Size, scenes, tracing};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::iter;

/// As in the quick variant of `experiments/stability.toml`.
const QUICK: Effort =
    Effort { builders: Size::Few, work_per_object: 60, larger_searches: None, rays: 200 };

fn assert_kept(broken: Vec<String>) {
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}

#[test]
fn every_case_from_s01_to_s45_exists_and_is_checked() {
    let expected = (1..=45).map(|number| format!("S{number:02}"));
    assert!(CASES.iter().map(|case| case.id).eq(expected));
    assert_eq!(CASES.iter().filter(|case| case.sizes.is_some()).count(), STIFF.len());
    let mut with_kind: Vec<&str> = KINDS.iter().flat_map(|(_, ids)| *ids).copied().collect();
    with_kind.sort_unstable();
    assert!(with_kind.into_iter().eq(CASES.iter().map(|case| case.id)), "one kind each");
    for case in &CASES {
        assert!(case.sizes.is_some() || !case.checks.is_empty(), "{} has no check", case.id);
        if let Some(sizes) = case.sizes {
            assert_eq!(case.triangles(sizes[0]).len(), sizes[0], "{}", case.id);
            assert!(sizes.is_sorted(), "{}", case.id);
        }
        for check in case.checks {
            // A check of a method that does not exist would never be performed.
            if let Check::Method(name, _) = check {
                assert!(name.is_empty() || Method::NAMES.contains(name), "{}: {name}", case.id);
            }
        }
    }
}

#[test]
fn every_case_holds_for_every_method_every_traversal_and_every_other_part() {
    let methods = bvh_stress::methods();
    let cells = CASES.par_iter().flat_map_iter(|case| case.cells(&methods, &QUICK));
    let broken = cells.filter(|cell| cell.outcome == Class::Broken);
    let text = |Cell { scene, method, note, .. }| format!("{scene}, {method}: {note}");
    assert_kept(broken.map(text).collect());
}

/// The powers of two that scale scenes, each for an equal part of the rays. Most of them keep
/// vector kernels on their fast path, the others lead to nearly the largest, nearly the smallest
/// and to denormal coordinates.
const SCALES: [i32; 8] = [0, 0, 1, 20, -20, 120, -120, -140];

/// The maximum number of triangles of a scene that a million rays test one by one; enough for a few
/// nodes.
const TESTED: usize = 40;

/// Checks `pieces` times this number of rays, which are answered together, in the scene of every
/// case, at every scale at which the scene is finite.
fn check_kernels(pieces: usize, count: usize) {
    let mut jobs = Vec::new();
    for (case, triangles) in scenes(TESTED) {
        for scale in SCALES {
            let triangles = scaled_triangles(&triangles, scale);
            if triangles.iter().all(|triangle| triangle.aabb().check().is_ok()) {
                let name = format!("{} * 2^{scale}", case.id);
                jobs.extend(iter::repeat_n((name, triangles), pieces));
            }
        }
    }
    let rays = count * jobs.len();
    let check = |(seed, (name, triangles)): (usize, (String, Vec<Triangle>))| {
        let rays = hard_rays::rays(&triangles, count, seed as u64);
        tracing::check(tracing::by_every_kernel, &Primitives::Triangles(triangles), &rays)
            .map_err(|broken| format!("{name}, seed {seed}, {broken:#}"))
    };
    let checked: Vec<Result<usize, String>> = jobs.into_par_iter().enumerate().map(check).collect();
    let hits: usize = checked.iter().flatten().sum();
    assert_kept(checked.into_iter().filter_map(Result::err).collect());
    // Rays that miss everything would prove little.
    assert!(hits > rays / 10, "{hits} of {rays} rays hit");
}

#[test]
fn every_kernel_answers_as_brute_force_on_every_scene_at_every_scale() {
    check_kernels(1, 300);
}

#[test]
#[ignore = "nightly: minutes, a million rays per scene"]
fn every_kernel_answers_a_million_rays_of_every_scene_as_brute_force() {
    // Answers of more rays at once take too much memory. Every scene is finite at five scales or
    // more.
    check_kernels(8, 25_000);
}

#[test]
fn the_rays_of_the_suite_hit_miss_and_cover_every_kind() {
    let triangles = stiff::closed_box(192);
    let rays = tracing::rays(&triangles, 1500, 1);
    let objects = Primitives::Triangles(triangles);
    let brute_force = Accelerator::new(&objects, Structure::Brute);
    let hits = rays.iter().filter(|ray| brute_force.any_hit(ray)).count();
    assert!((300..1200).contains(&hits), "{hits}");
    let zeros = rays.iter().flat_map(|ray| ray.direction().to_array()).filter(|&d| d == 0.0);
    let signs: BTreeSet<u32> = zeros.map(f32::to_bits).collect();
    assert_eq!(signs.len(), 2, "zeros of both signs");
    assert!(rays.iter().any(|ray| ray.t_min() > ray.t_max()));
    assert!(rays.iter().any(|ray| ray.t_min() == ray.t_max()));
}
