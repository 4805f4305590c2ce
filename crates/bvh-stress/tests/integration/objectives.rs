//! Every scene of the suite holds with other objectives: costs other than the area, the visits of
//! rays, and objects that are divided among leaves.

use bvh_build::{Builder, Watch, muller_fellner, spatial};
use bvh_core::cost::{Objective, total_area};
use bvh_core::{Aabb, Primitives, RayDensity, Segment, Triangle, WideBvh, file};
use bvh_scenes::builtin::stiff;
use bvh_search::{Bake, Budget, Method, Outcome, Problem, Splits, best, optimize, solve};
use bvh_stress::transform::{same_topology, scale_range, scaled, scaled_area, scaled_triangles};
use bvh_stress::{examine, scenes, tracing};

fn budget(problem: &Problem) -> Budget {
    Budget { max_work: Some(60 * problem.boxes.len() as u64), ..Budget::UNLIMITED }
}

fn solved(problem: &Problem) -> Outcome {
    let method = Method::Best(best::Config::default());
    solve(&method, problem, 1, budget(problem), &()).unwrap()
}

/// Checks that a search reports the cost of its tree, that the tree is loaded as it is saved by
/// `bake`, and that rays have the answers of the greedy tree in its layout. By the visits of rays,
/// the search starts from the greedy tree, and never ends above it. Returns the number of
/// references. Failures name `here`.
fn check(here: &str, triangles: &[Triangle], bake: &Bake, problem: &Problem) -> usize {
    let greedy = muller_fellner::Config::default().build(problem.boxes).unwrap();
    let outcome = if problem.measure.is_some() {
        let config = best::Config::default();
        let better = optimize(&greedy, problem, &config, 1, budget(problem), &()).unwrap();
        let limit = problem.cost(&greedy);
        assert!(better.cost <= limit, "{here}: {} above {limit}", better.cost);
        better
    } else {
        solved(problem)
    };
    let Outcome { tree, cost, .. } = outcome;
    let expected = problem.cost(&tree);
    let is_reported = (cost - expected).abs() <= examine::ROUNDING * expected;
    assert!(is_reported, "{here}: {cost} reported, {expected}");
    // An invalid tree is not saved.
    let bytes = bake.write(&tree, 0, |sections| sections.concat());
    let bytes = bytes.unwrap_or_else(|fault| panic!("{here}: {fault}"));
    assert_eq!(file::load(&bytes, problem.boxes).as_ref(), Ok(&tree), "{here}");
    let visits = file::TreeFile::open(&bytes).unwrap().visits().unwrap();
    assert_eq!(visits, bake.rays.map(|density| density.visits(&tree)), "{here}");
    let wide = match visits {
        Some(visits) => WideBvh::for_rays(&tree, triangles, &visits),
        None => WideBvh::new(&tree, triangles),
    };
    let wide = wide.unwrap();
    let plain = WideBvh::new(&greedy, triangles).unwrap();
    for ray in tracing::rays(triangles, 300, 2) {
        assert_eq!(wide.nearest_hit(&ray), plain.nearest_hit(&ray), "{here}: {ray:?}");
        assert_eq!(wide.any_hit(&ray), plain.any_hit(&ray), "{here}: {ray:?}");
    }
    tree.prim_ids.len()
}

#[test]
fn every_case_holds_with_the_visits_of_rays_instead_of_area() {
    let mut searched = 0;
    let mut without_density = 0;
    for (case, triangles) in scenes(2000) {
        let boxes = stiff::boxes(&triangles);
        let segments: Vec<Segment> = tracing::rays(&triangles, 1000, 1)
            .iter()
            .map(|ray| Segment {
                from: ray.origin().to_array(),
                to: ray.at(ray.t_max().min(1e30)).to_array(),
            })
            .filter(|segment| segment.from.iter().chain(&segment.to).all(|c| c.is_finite()))
            .collect();
        // Scenes without extent have no density; their number is bounded at the end.
        let Ok(density) = RayDensity::of_rays(&Aabb::union_of(&boxes), &segments, 0.1) else {
            without_density += 1;
            continue;
        };
        searched += 1;
        let problem = Problem { measure: Some(&density), ..Problem::new(&boxes) };
        let bake = Bake { rays: Some(&density), ..Bake::new(&boxes) };
        check(case.id, &triangles, &bake, &problem);
    }
    // Skipping most scenes would make the test pass without testing anything.
    assert!(searched > 25 && without_density < 10, "{searched}, {without_density}");
}

#[test]
fn every_case_holds_with_divided_objects_and_with_the_cost_of_the_layout() {
    let mut divided = 0;
    for (case, triangles) in scenes(2000) {
        let boxes = stiff::boxes(&triangles);
        let objects = Primitives::Triangles(triangles.clone());
        let bake = Bake { shapes: Some(&objects), ..Bake::new(&boxes) };
        for objective in [Objective::Layout, Objective::InternalArea] {
            // The first permits no division, and the second some.
            for most in [boxes.len(), boxes.len() * 3 / 2] {
                let splits = Splits::at_most(most, &boxes, &objects);
                let problem = Problem { objective, splits, ..Problem::new(&boxes) };
                let here = format!("{}, {objective:?}, up to {most} references", case.id);
                let references = check(&here, &triangles, &bake, &problem);
                assert!(references <= most, "{here}: {references}");
                divided += usize::from(references > boxes.len());
            }
        }
    }
    assert!(divided > 5, "{divided}");
}

#[test]
fn divided_trees_are_the_same_on_any_number_of_threads_and_at_any_scale() {
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
        // A scene without normal parts at its own scale has no scales to compare.
        if triangles.is_empty() || !range.contains(&0) {
            continue;
        }
        // By spatial splits, and searched by both costs.
        let trees = |k: i32| {
            let objects = Primitives::Triangles(scaled_triangles(&triangles, k));
            let boxes = objects.boxes();
            let most = boxes.len() * 3 / 2;
            let built = spatial::build(most, &boxes, &objects, &Watch::default()).unwrap();
            let searched = [Objective::Layout, Objective::InternalArea].map(|objective| {
                let splits = Splits::at_most(most, &boxes, &objects);
                let problem = Problem { objective, splits, ..Problem::new(&boxes) };
                let outcome = solved(&problem);
                (outcome.cost, outcome.tree)
            });
            searched.into_iter().chain([(total_area(&built), built)]).collect::<Vec<_>>()
        };
        let expected = trees(0);
        divided +=
            expected.iter().filter(|(_, tree)| tree.prim_ids.len() > triangles.len()).count();
        for threads in [1, 3] {
            let others = examine::on_threads(threads, || trees(0)).unwrap();
            assert!(others == expected, "{}: another tree on {threads} threads", case.id);
        }
        for k in [*range.start(), range.start() / 7, range.end() / 7, *range.end()] {
            for ((expected_cost, expected), (cost, tree)) in expected.iter().zip(trees(k)) {
                let same = same_topology(&tree, expected);
                assert!(same, "{}: another tree at scale 2^{k}", case.id);
                let [parts, others] = [expected, &tree]
                    .map(|tree| tree.nodes.iter().map(|node| node.aabb).collect::<Vec<Aabb>>());
                assert_eq!(others, scaled(&parts, k), "{}: other parts at scale 2^{k}", case.id);
                assert_eq!(cost, scaled_area(*expected_cost, k), "{}: scale 2^{k}", case.id);
            }
        }
    }
    assert!(divided > 20, "{divided}");
}
