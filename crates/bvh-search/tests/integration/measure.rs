//! Measures of boxes instead of the area: every builder and search uses them, and the area as a
//! measure equals the area.

use bvh_build::{Builder, Watch, muller_fellner};
use bvh_core::cost::{self, Measure, Objective};
use bvh_core::{Aabb, PackedAabb, RayDensity, Segment, glam, validate};
use bvh_search::{Budget, Method, Outcome, Problem, Shortcut, best, exact, reinsertion, solve};

/// The measure for rays nearly parallel to the x axis: the face across it counts most. It is
/// monotone, like every sum of products of extents.
#[derive(Debug)]
struct AlongX;

impl Measure for AlongX {
    fn of(&self, aabb: &PackedAabb) -> f64 {
        let [negated_min, max] = aabb.planes();
        let [x, y, z] = [0, 1, 2].map(|axis| f64::from(max[axis]) + f64::from(negated_min[axis]));
        x * y + 50.0 * y * z + z * x
    }
}

/// Scattered coordinates below 2¹⁶.
fn coordinate(i: u32, salt: u32) -> f32 {
    (i.wrapping_mul(2_654_435_761).rotate_left(salt) >> 16) as f32
}

fn boxes(n: u32) -> Vec<Aabb> {
    (0..n)
        .map(|i| {
            let low = [3, 11, 19].map(|salt| coordinate(i, salt));
            Aabb::from((low, low.map(|c| c + coordinate(i, 25) / 16.0)))
        })
        .collect()
}

fn methods() -> impl Iterator<Item = Method> {
    Method::all().into_iter().filter(|method| method.name() != "exact")
}

fn run(method: &Method, boxes: &[Aabb], measure: Option<&dyn Measure>) -> Outcome {
    let budget = Budget { max_work: Some(500_000), ..Budget::UNLIMITED };
    let disabled = &[Shortcut::BoundMet, Shortcut::Tiny];
    let problem = Problem { measure, disabled, ..Problem::new(boxes) };
    let outcome = solve(method, &problem, 1, budget, &()).unwrap();
    validate(&outcome.tree, boxes).unwrap();
    outcome
}

#[test]
fn the_area_as_a_measure_gives_the_same_history_as_the_area() {
    let boxes = boxes(700);
    for method in methods() {
        let area = run(&method, &boxes, None);
        let measure = run(&method, &boxes, Some(&cost::Area));
        assert_eq!(area.tree, measure.tree, "{}", method.name());
        assert_eq!(area.history, measure.history, "{}", method.name());
    }
}

#[test]
fn builders_and_searches_use_the_measure_and_report_every_objective_by_it() {
    let boxes = boxes(700);
    let objectives =
        [Objective::GoldsmithSalmon, Objective::Sah(Default::default()), Objective::Layout];
    for method in methods() {
        let name = method.name();
        let by_area = run(&method, &boxes, None);
        let found = run(&method, &boxes, Some(&AlongX));
        assert_eq!(found.cost, cost::internal_measure(&found.tree, &AlongX), "{name}");
        let before = cost::internal_measure(&by_area.tree, &AlongX);
        // Median cut does not compare boxes.
        let ratio = if name == "median_cut" { 1.0..=1.0 } else { 0.0..=0.99 };
        assert!(ratio.contains(&(found.cost / before)), "{name}: {} {before}", found.cost);
        for objective in objectives {
            let [area, found] = [&cost::Area as &dyn Measure, &AlongX].map(|measure| {
                let problem = Problem { measure: Some(measure), objective, ..Problem::new(&boxes) };
                let budget = Budget { max_work: Some(50_000), ..Budget::UNLIMITED };
                let found = solve(&method, &problem, 1, budget, &()).unwrap();
                let cost = objective.cost_by(&found.tree, measure);
                assert!(
                    (found.cost - cost).abs() <= 1e-12 * cost,
                    "{name} {objective:?}: {} {cost}",
                    found.cost
                );
                found
            });
            assert_eq!(area.cost, objective.cost(&area.tree), "{name} {objective:?}");
            assert!(name == "median_cut" || area.tree != found.tree, "{name} {objective:?}");
        }
    }
}

#[test]
fn a_local_search_begins_with_a_tree_by_the_measure() {
    let boxes = boxes(700);
    let heuristic = muller_fellner::Heuristic::AreaTimesPower(0.9);
    let builder = muller_fellner::Config { heuristic, ..Default::default() };
    let begun = builder.build_watched(&boxes, Some(&AlongX), &Watch::default()).unwrap();
    let by_area = builder.build(&boxes).unwrap();
    let [begun, by_area] = [begun, by_area].map(|tree| cost::internal_measure(&tree, &AlongX));
    assert!(begun < 0.99 * by_area, "{begun} {by_area}");
    let problem = Problem { measure: Some(&AlongX), ..Problem::new(&boxes) };
    let budget = Budget { max_evaluations: Some(1), ..Budget::UNLIMITED };
    let outcome = solve(&reinsertion::Config::default(), &problem, 1, budget, &()).unwrap();
    assert_eq!(outcome.cost, begun);
}

#[test]
fn no_search_goes_below_the_exact_optimum_and_best_reaches_it() {
    // Goldsmith–Salmon trees are not binary: their wider nodes have fewer terms.
    const NOT_BINARY: [&str; 3] = ["goldsmith_salmon", "random_orders", "genetic"];
    for n in 3..13 {
        let boxes = boxes(10 * n)[9 * n as usize..].to_vec();
        for measure in [None, Some(&AlongX as &dyn Measure)] {
            let optimum = run(&Method::Exact(exact::Config::default()), &boxes, measure).cost;
            for method in methods().filter(|method| !NOT_BINARY.contains(&method.name())) {
                let cost = run(&method, &boxes, measure).cost;
                assert!(cost >= optimum * (1.0 - 1e-12), "{} {n}: {cost} {optimum}", method.name());
                let is_reached = cost <= optimum * (1.0 + 1e-12);
                assert!(method.name() != "best" || is_reached, "{n}: {cost} {optimum}");
            }
        }
    }
}

#[test]
fn trees_for_a_sample_of_rays_are_entered_less_often_than_trees_by_area() {
    let boxes = boxes(2000);
    let bounds = Aabb::union_of(&boxes);
    let size = bounds.max - bounds.min;
    // A camera in one corner: no ray has a uniform direction.
    let segments: Vec<Segment> = (0..20_000)
        .map(|i| {
            let part = [1, 9, 17].map(|salt| {
                let hash = u32::wrapping_mul(i, 2_246_822_519).rotate_left(salt);
                (hash >> 8) as f32 / (1 << 24) as f32
            });
            let to = bounds.min + size * glam::Vec3::from(part);
            Segment { from: bounds.min.to_array(), to: to.to_array() }
        })
        .collect();
    let density = RayDensity::of_rays(&bounds, &segments, 0.1).unwrap();
    let method = Method::Best(best::Config::default());
    let area = run(&method, &boxes, None);
    let rays = run(&method, &boxes, Some(&density));
    assert!(rays.cost < 0.97 * cost::internal_measure(&area.tree, &density), "{}", rays.cost);
    assert!(cost::internal_area(&rays.tree) >= cost::internal_area(&area.tree));
}
