//! Every case of the suite holds for every method, every traversal and every other part.

use bvh_build::{Builder, muller_fellner, spatial};
use bvh_core::cost::{Objective, total_area};
use bvh_core::{
    Aabb, Primitives, RayDensity, Segment, Triangle, WideBvh, file, validate, validate_references,
};
use bvh_scenes::builtin::stiff::{self, STIFF};
use bvh_scenes::trace::{Accelerator, Structure};
use bvh_search::{Budget, Method, Problem, Splits, StopReason, optimize, solve};
use bvh_stress::{
    CASES, Case, Cell, Check, EXACT_OBJECTS, Effort, LargerScenes, Part, Size, examine, is_builder,
    kernels,
    tracing::{self, TRAVERSALS},
    transform::{same_topology, scale_range, scaled, scaled_area},
};
use glam::Vec3;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Nodes per object that a search may make or visit here.
const WORK: u64 = 150;

/// The effort for every method in the quick tier.
const QUICK: Effort = Effort { builders: Size::Few, work_per_object: WORK, larger: None };

/// Panics with all broken promises at once.
fn assert_kept(broken: Vec<String>) {
    assert!(broken.is_empty(), "\n{}", broken.join("\n"));
}

fn broken(case: &Case, subject: &str, cell: Option<Cell>) -> Option<String> {
    match cell {
        Some(Cell::Broken(promise)) => {
            Some(format!("{} ({}), {subject}: {promise}", case.id, case.name))
        }
        _ => None,
    }
}

#[test]
fn every_case_from_s01_to_s45_exists_and_is_checked() {
    let expected = (1..=45).map(|number| format!("S{number:02}"));
    assert!(CASES.iter().map(|case| case.id).eq(expected));
    for case in &CASES {
        assert!(!case.checks.is_empty(), "{} has no check", case.id);
        // A check of a method that does not exist would never be performed.
        for check in case.checks {
            match check {
                Check::Method(Some(name), _) => {
                    assert!(Method::NAMES.contains(name), "{}: {name}", case.id)
                }
                Check::Scene(_) => {
                    assert!(stiff::by_id(case.id).is_some(), "{} has no scene", case.id)
                }
                _ => {}
            }
        }
    }
}

#[test]
fn every_scene_has_the_requested_size() {
    let mut scenes = 0;
    for case in &CASES {
        if let Some(scene) = case.scene() {
            let few = scene.sizes[0];
            assert_eq!(case.triangles(few).len(), few, "{}", case.id);
            assert!(scene.sizes.is_sorted(), "{}", case.id);
            scenes += 1;
        }
    }
    assert_eq!(scenes, STIFF.len());
}

/// Checks every case with each of these methods.
fn check_methods(methods: &[(String, Method)], effort: Effort) {
    let found = methods
        .par_iter()
        .flat_map_iter(|(label, method)| {
            CASES
                .iter()
                .filter_map(move |case| broken(case, label, case.of_method(method, &effort)))
        });
    assert_kept(found.collect());
}

#[test]
fn every_case_holds_for_every_method() {
    check_methods(&bvh_stress::methods(), QUICK);
}

#[test]
#[ignore = "slow: thousands of objects for builders and searches alike"]
fn every_case_holds_for_every_method_at_a_larger_size() {
    let larger = Some(LargerScenes { objects: 2000, work_per_object: 60 });
    check_methods(
        &bvh_stress::methods(),
        Effort { builders: Size::Many, work_per_object: WORK, larger },
    );
}

#[test]
#[ignore = "by hand: minutes and gigabytes, S36 has ten million triangles"]
fn every_scene_holds_for_every_builder_at_its_full_size() {
    let builders = Method::all().into_iter().filter(is_builder);
    for builder in builders.map(|method| (method.name().to_owned(), method)) {
        check_methods(&[builder], Effort { builders: Size::All, ..QUICK });
    }
}

#[test]
fn every_traversal_answers_as_brute_force_on_every_scene() {
    let mut found = Vec::new();
    for case in &CASES {
        for (name, traversal) in TRAVERSALS {
            found.extend(broken(case, name, case.of_traversal(*traversal, 1500)));
        }
    }
    assert_kept(found);
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

/// The scene of a case, scaled by two to this power.
type Scaled = (&'static Case, i32, Vec<Triangle>);

/// Returns the scene of every case that has one, in its smallest size and with at most `most`
/// triangles.
fn scenes(most: usize) -> impl Iterator<Item = (&'static Case, Vec<Triangle>)> {
    CASES.iter().filter_map(move |case| {
        let few = case.scene()?.sizes[Size::Few as usize];
        Some((case, case.triangles(few.min(most))))
    })
}

/// Checks at least these numbers of rays in the scene of every case, at every scale at which the
/// scene is finite.
fn check_kernels(random: usize, adversarial: usize) {
    let mut jobs = Vec::new();
    for (case, triangles) in scenes(TESTED) {
        let scaled = SCALES
            .into_iter()
            .filter_map(|by| Some((case, by, kernels::scaled(&triangles, by)?)));
        let scaled: Vec<Scaled> = scaled.collect();
        let pieces = random.div_ceil(PIECE * scaled.len()) * scaled.len();
        jobs.extend((0..pieces).map(|piece| (pieces, scaled[piece % scaled.len()].clone())));
    }
    let checked: Vec<Result<usize, String>> = jobs
        .into_par_iter()
        .enumerate()
        .map(|(seed, (pieces, (case, scale, triangles)))| {
            let random = random.div_ceil(pieces);
            let adversarial = adversarial.div_ceil(pieces);
            let mut rays = kernels::random(&triangles, random, seed as u64);
            rays.extend(kernels::adversarial(&triangles, adversarial, seed as u64));
            let name = format!("{} ({}) * 2^{scale}, seed {seed}", case.id, case.name);
            assert_eq!(rays.len(), random + adversarial, "{name}");
            kernels::check(&triangles, &rays).map_err(|broken| format!("{name}, {broken}"))
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
    check_kernels(10_000, 1_000);
}

#[test]
#[ignore = "nightly: minutes, a million rays per scene"]
fn every_kernel_answers_a_million_rays_of_every_scene_as_brute_force() {
    check_kernels(1_000_000, 100_000);
}

#[test]
fn every_other_part_keeps_its_promises() {
    let parts = CASES
        .iter()
        .flat_map(|case| Part::ALL.map(|part| broken(case, part.name(), case.of_part(part))));
    assert_kept(parts.flatten().collect());
}

#[test]
fn the_rays_of_the_suite_hit_miss_and_cover_every_kind() {
    let triangles = stiff::closed_box(192);
    let rays = tracing::rays(&triangles, 1500, 1);
    assert_eq!(rays.len(), 1500);
    let objects = Primitives::Triangles(triangles);
    let brute_force = Accelerator::new(&objects, Structure::Brute);
    let hits = rays
        .iter()
        .filter(|ray| brute_force.any_hit(ray))
        .count();
    assert!((300..1200).contains(&hits), "{hits}");
    let zeros = rays
        .iter()
        .flat_map(|ray| ray.direction().to_array())
        .filter(|&d| d == 0.0);
    let signs: BTreeSet<u32> = zeros.map(f32::to_bits).collect();
    assert_eq!(signs.len(), 2, "zeros of both signs");
    assert!(
        rays.iter().any(|ray| ray.t_min() > ray.t_max())
            && rays.iter().any(|ray| ray.t_min() == ray.t_max())
    );
}

fn best() -> Method {
    Method::Best(bvh_search::best::Config::default())
}

/// Asserts that the reported cost of a tree is its cost.
fn assert_reported(who: &str, reported: f64, cost: f64) {
    assert!(
        (reported - cost).abs() <= examine::ROUNDING * cost,
        "{who}: {reported} reported, {cost}"
    );
}

/// Asserts that two layouts give the same answers to rays through the triangles.
fn assert_same_answers(case: &Case, wide: &WideBvh, plain: &WideBvh, triangles: &[Triangle]) {
    for ray in tracing::rays(triangles, 300, 2) {
        assert_eq!(wide.nearest_hit(&ray), plain.nearest_hit(&ray), "{}: {ray:?}", case.id);
        assert_eq!(wide.any_hit(&ray), plain.any_hit(&ray), "{}: {ray:?}", case.id);
    }
}

#[test]
fn every_objective_is_what_its_method_reports() {
    for (label, method) in bvh_stress::methods() {
        let n = if let Method::Exact(_) = method { EXACT_OBJECTS } else { 60 };
        for make in [stiff::uniform, stiff::identical_points, stiff::giant_over_small] {
            let boxes = stiff::boxes(&make(n));
            for objective in [Objective::GoldsmithSalmon, Objective::Sah(Default::default())] {
                let budget = examine::budget(&method, n, WORK);
                let outcome =
                    solve(&method, &Problem { objective, ..Problem::new(&boxes) }, 1, budget, &())
                        .unwrap();
                validate(&outcome.tree, &boxes).unwrap();
                let cost = objective.cost(&outcome.tree);
                assert_reported(&format!("{label}, {objective:?}"), outcome.cost, cost);
            }
        }
    }
}

#[test]
fn every_case_holds_with_the_visits_of_rays_instead_of_area() {
    let method = best();
    let mut searched = 0;
    let mut without_density = 0;
    for (case, triangles) in scenes(2000) {
        let boxes = stiff::boxes(&triangles);
        let bounds = boxes
            .iter()
            .fold(Aabb::EMPTY, |all, aabb| all.union(aabb));
        let segments: Vec<Segment> = tracing::rays(&triangles, 3000, 1)
            .iter()
            .map(|ray| Segment {
                from: ray.origin().to_array(),
                to: ray.at(ray.t_max().min(1e30)).to_array(),
            })
            .filter(|segment| {
                segment
                    .from
                    .iter()
                    .chain(&segment.to)
                    .all(|c| c.is_finite())
            })
            .collect();
        let Ok(density) = RayDensity::of_rays(&bounds, &segments, 0.1) else {
            without_density += 1;
            continue;
        };
        searched += 1;
        let problem = Problem { measure: Some(&density), ..Problem::new(&boxes) };
        let start = muller_fellner::Config::default()
            .build(&boxes)
            .unwrap();
        let budget = examine::budget(&method, boxes.len(), WORK);
        let outcome = optimize(&start, &problem, &Default::default(), 1, budget, &()).unwrap();
        validate(&outcome.tree, &boxes).unwrap();
        assert!(outcome.cost <= problem.cost(&start), "{}: a worse tree", case.id);
        assert_reported(case.id, outcome.cost, problem.cost(&outcome.tree));
        // A saved tree can be loaded, and every ray has its right answer in the layout for these
        // rays.
        let visits = density.visits(&outcome.tree);
        let bytes = file::save(
            &outcome.tree,
            &boxes,
            &file::Origin { visits: &visits, ..Default::default() },
        );
        let bytes = bytes.unwrap_or_else(|error| panic!("{}: {error}", case.id));
        assert_eq!(
            file::TreeFile::open(&bytes)
                .unwrap()
                .visits()
                .unwrap()
                .unwrap(),
            visits
        );
        let wide = WideBvh::for_rays(&outcome.tree, &triangles, &visits).unwrap();
        let plain = WideBvh::new(&start, &triangles).unwrap();
        assert_same_answers(case, &wide, &plain, &triangles);
    }
    assert!(searched > 25 && without_density < 10, "{searched}, {without_density}");
}

#[test]
fn every_case_holds_with_divided_objects_and_with_the_cost_of_the_layout() {
    let method = best();
    let mut divided = 0;
    for (case, triangles) in scenes(2000) {
        let boxes = stiff::boxes(&triangles);
        let objects = Primitives::Triangles(triangles.clone());
        let budget = examine::budget(&method, boxes.len(), WORK);
        for objective in [Objective::Layout, Objective::InternalArea] {
            for references in [1.0, 1.5] {
                let most = (references * boxes.len() as f64) as usize;
                let splits = Splits::at_most(most, &boxes, &objects);
                let problem = Problem { objective, splits, ..Problem::new(&boxes) };
                let solved = || solve(&method, &problem, 1, budget, &()).unwrap();
                let outcome = solved();
                assert_eq!(
                    outcome.tree,
                    solved().tree,
                    "{}: another tree for the same seed",
                    case.id
                );
                validate_references(&outcome.tree, &boxes, &objects).unwrap_or_else(|fault| {
                    panic!("{}, {objective:?}, {references}: {fault}", case.id)
                });
                assert!(outcome.tree.prim_ids.len() <= most.max(boxes.len()), "{}", case.id);
                divided += usize::from(outcome.tree.prim_ids.len() > boxes.len());
                assert_reported(case.id, outcome.cost, problem.cost(&outcome.tree));
                let greedy = muller_fellner::Config::default()
                    .build(&boxes)
                    .unwrap();
                let bytes = file::save_references(
                    &outcome.tree,
                    &boxes,
                    &objects,
                    &file::Origin::default(),
                );
                assert_eq!(
                    file::load(&bytes.unwrap(), &boxes),
                    Ok(outcome.tree.clone()),
                    "{}",
                    case.id
                );
                let wide = WideBvh::new(&outcome.tree, &triangles).unwrap();
                let plain = WideBvh::new(&greedy, &triangles).unwrap();
                assert_same_answers(case, &wide, &plain, &triangles);
            }
        }
    }
    assert!(divided > 5, "{divided}");
}

#[test]
fn divided_trees_are_the_same_on_any_number_of_threads_and_at_any_scale() {
    let method = best();
    let mut divided = 0;
    for (case, few) in scenes(300) {
        // Only long triangles, from one part of the scene to another, are worth dividing.
        let others = few.iter().cycle().skip(few.len() / 2);
        let triangles: Vec<Triangle> = few
            .iter()
            .zip(others)
            .map(|(near, far)| Triangle([near.0[0], near.0[1], far.0[2]]))
            .collect();
        // The parts of triangles have new coordinates, as small as 2^-100 times the triangle's.
        // They must be normal numbers too.
        let range = scale_range(&stiff::boxes(&triangles));
        let range = range.start() + 100..=*range.end();
        if triangles.is_empty() || !range.contains(&0) {
            continue;
        }
        // By spatial splits, and searched by both costs.
        let trees = |k: i32| {
            let scale = |p: Vec3| (p.as_dvec3() * libm::exp2(k.into())).as_vec3();
            let scaled: Vec<Triangle> = triangles
                .iter()
                .map(|t| Triangle(t.0.map(scale)))
                .collect();
            let boxes = stiff::boxes(&scaled);
            let objects = Primitives::Triangles(scaled);
            let most = boxes.len() * 3 / 2;
            let built = spatial::Config::default()
                .build_at_most(most, &boxes, &objects)
                .unwrap();
            let searched = [Objective::Layout, Objective::InternalArea].map(|objective| {
                let splits = Splits::at_most(most, &boxes, &objects);
                let problem = Problem { objective, splits, ..Problem::new(&boxes) };
                let budget = examine::budget(&method, boxes.len(), WORK);
                let outcome = solve(&method, &problem, 1, budget, &()).unwrap();
                (outcome.cost, outcome.tree)
            });
            searched
                .into_iter()
                .chain([(total_area(&built), built)])
                .collect::<Vec<_>>()
        };
        let expected = trees(0);
        divided += expected
            .iter()
            .filter(|(_, tree)| tree.prim_ids.len() > triangles.len())
            .count();
        for threads in [1, 3] {
            let others = examine::on_threads(threads, || Ok(trees(0))).unwrap();
            assert!(others == expected, "{}: another tree on {threads} threads", case.id);
        }
        for k in [*range.start(), range.start() / 7, range.end() / 7, *range.end()] {
            for ((expected_cost, expected), (cost, tree)) in expected.iter().zip(trees(k)) {
                let same = same_topology(&tree, expected);
                assert!(same, "{}: another tree at scale 2^{k}", case.id);
                let [parts, others] = [expected, &tree].map(|tree| {
                    tree.nodes
                        .iter()
                        .map(|node| node.aabb)
                        .collect::<Vec<Aabb>>()
                });
                assert_eq!(others, scaled(&parts, k), "{}: other parts at scale 2^{k}", case.id);
                assert_eq!(cost, scaled_area(*expected_cost, k), "{}: scale 2^{k}", case.id);
            }
        }
    }
    assert!(divided > 20, "{divided}");
}

#[test]
fn a_cancelled_method_reports_it() {
    struct Impatient;
    impl bvh_search::Observer for Impatient {
        fn cancelled(&self) -> bool {
            true
        }
    }
    let boxes = stiff::boxes(&stiff::uniform(EXACT_OBJECTS));
    for (label, method) in bvh_stress::methods() {
        let cancelled =
            solve(&method, &Problem::new(&boxes), 1, Budget::UNLIMITED, &Impatient).unwrap();
        assert_eq!(cancelled.stop, StopReason::Cancelled, "{label}");
    }
}
