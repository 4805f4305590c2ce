//! Every case of the suite holds for every method, every traversal and every other part.

use bvh_core::{Primitives, Triangle};
use bvh_scenes::builtin::stiff::{self, STIFF};
use bvh_scenes::trace::{Accelerator, Structure};
use bvh_search::Method;
use bvh_stress::{
    CASES, Case, Cell, Check, Class, Effort, KINDS, Size, hard_rays, scenes, tracing,
};
use rayon::prelude::*;
use std::collections::BTreeSet;

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
    assert_kept(
        broken
            .map(|Cell { scene, method, note, .. }| format!("{scene}, {method}: {note}"))
            .collect(),
    );
}

/// The powers of two that scale scenes, each for an equal part of the rays. Most of them keep
/// vector kernels on their fast path, the others lead to nearly the largest, nearly the smallest
/// and to denormal coordinates.
const SCALES: [i32; 8] = [0, 0, 1, 20, -20, 120, -120, -140];

/// The number of rays that are answered together, which limits the memory for their answers.
const PIECE: usize = 25_000;

/// The maximum number of triangles of a scene that a million rays test one by one; enough for a few
/// nodes.
const TESTED: usize = 40;

type Scaled = (&'static Case, i32, Vec<Triangle>);

/// Checks at least these numbers of rays in the scene of every case, at every scale at which the
/// scene is finite.
fn check_kernels(random: usize, adversarial: usize) {
    let mut jobs = Vec::new();
    for (case, triangles) in scenes(TESTED) {
        let scaled = SCALES
            .into_iter()
            .filter_map(|by| Some((case, by, hard_rays::scaled(&triangles, by)?)));
        let scaled: Vec<Scaled> = scaled.collect();
        // Every scale gets the same number of pieces, and each piece fits in memory.
        let pieces = random.div_ceil(PIECE * scaled.len()) * scaled.len();
        jobs.extend((0..pieces).map(|piece| (pieces, scaled[piece % scaled.len()].clone())));
    }
    let checked: Vec<Result<usize, String>> = jobs
        .into_par_iter()
        .enumerate()
        .map(|(seed, (pieces, (case, scale, triangles)))| {
            let random = random.div_ceil(pieces);
            let adversarial = adversarial.div_ceil(pieces);
            let mut rays = hard_rays::random(&triangles, random, seed as u64);
            rays.extend(hard_rays::adversarial(&triangles, adversarial, seed as u64));
            let name = format!("{} ({}) * 2^{scale}, seed {seed}", case.id, case.name);
            // A scene that allows fewer rays would be tested less than the others without notice.
            assert_eq!(rays.len(), random + adversarial, "{name}");
            tracing::check(tracing::by_every_kernel, &Primitives::Triangles(triangles), &rays)
                .map_err(|broken| format!("{name}, {broken:#}"))
        })
        .collect();
    let hits: usize = checked.iter().flatten().sum();
    let broken = checked.into_iter().filter_map(Result::err);
    assert_kept(broken.collect());
    // Rays that miss everything would prove little.
    let rays = STIFF.len() * (random + adversarial);
    assert!(hits > rays / 10, "{hits} of {rays} rays hit");
}

#[test]
fn every_kernel_answers_as_brute_force_on_every_scene_at_every_scale() {
    check_kernels(4_000, 500);
}

#[test]
#[ignore = "nightly: minutes, a million rays per scene"]
fn every_kernel_answers_a_million_rays_of_every_scene_as_brute_force() {
    check_kernels(1_000_000, 100_000);
}

#[test]
fn the_rays_of_the_suite_hit_miss_and_cover_every_kind() {
    let triangles = stiff::closed_box(192);
    let rays = tracing::rays(&triangles, 1500, 1);
    assert_eq!(rays.len(), 1500);
    let objects = Primitives::Triangles(triangles);
    let brute_force = Accelerator::new(&objects, Structure::Brute);
    let hits = rays.iter().filter(|ray| brute_force.any_hit(ray)).count();
    assert!((300..1200).contains(&hits), "{hits}");
    let zeros = rays.iter().flat_map(|ray| ray.direction().to_array()).filter(|&d| d == 0.0);
    let signs: BTreeSet<u32> = zeros.map(f32::to_bits).collect();
    assert_eq!(signs.len(), 2, "zeros of both signs");
    assert!(
        rays.iter().any(|ray| ray.t_min() > ray.t_max())
            && rays.iter().any(|ray| ray.t_min() == ray.t_max())
    );
}
