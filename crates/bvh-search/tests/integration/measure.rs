//! Measures of boxes instead of the area: every builder and search uses them, and the area as a
//! measure equals the area.

use crate::{scatter, work};
use bvh_core::cost::{self, Measure, Objective};
use bvh_core::{Aabb, Bvh, PackedAabb, RayDensity, Segment, validate};
use bvh_search::{
    Budget, Judge, Method, Outcome, Problem, Shortcut, StopReason, best, exact, reinsertion, solve,
};

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

fn methods() -> impl Iterator<Item = Method> {
    Method::all().into_iter().filter(|method| method.name() != "exact")
}

fn run(method: &Method, boxes: &[Aabb], measure: Option<&dyn Measure>) -> Outcome {
    let disabled = &[Shortcut::BoundMet, Shortcut::Tiny];
    let problem = Problem { measure, disabled, ..Problem::new(boxes) };
    let outcome = solve(method, &problem, 1, work(500_000), &()).unwrap();
    validate(&outcome.tree, boxes).unwrap();
    outcome
}

#[test]
fn the_area_as_a_measure_gives_the_same_history_as_the_area() {
    let boxes = scatter(700, 1);
    for method in methods() {
        let area = run(&method, &boxes, None);
        let measure = run(&method, &boxes, Some(&cost::Area));
        assert_eq!(area.tree, measure.tree, "{}", method.name());
        assert_eq!(area.history, measure.history, "{}", method.name());
    }
}

#[test]
fn builders_and_searches_use_the_measure_and_report_every_objective_by_it() {
    let boxes = scatter(700, 1);
    // A camera in one corner: no ray has a uniform direction.
    let bounds = Aabb::union_of(&boxes);
    let to = boxes.iter().flat_map(|aabb| [aabb.min, aabb.max]);
    let rays = to.map(|to| Segment { from: bounds.min.to_array(), to: to.to_array() });
    let density = RayDensity::of_rays(&bounds, &rays.collect::<Vec<_>>(), 0.1).unwrap();
    let objectives =
        [Objective::GoldsmithSalmon, Objective::Sah(Default::default()), Objective::Layout];
    for method in methods() {
        let name = method.name();
        let by_area = run(&method, &boxes, None);
        for measure in [&AlongX as &dyn Measure, &density] {
            let found = run(&method, &boxes, Some(measure));
            assert_eq!(found.cost, cost::internal_measure(&found.tree, measure), "{name}");
            let ratio = found.cost / cost::internal_measure(&by_area.tree, measure);
            let accepted = match name {
                // Does not compare boxes.
                "median_cut" => 1.0..=1.0,
                "muller_fellner" => 0.0..=0.995,
                _ => 0.0..=0.97,
            };
            assert!(accepted.contains(&ratio), "{name}: {ratio}, accepted: {accepted:?}");
        }
        for objective in objectives {
            let [area, found] = [&cost::Area as &dyn Measure, &AlongX].map(|measure| {
                let problem = Problem { measure: Some(measure), objective, ..Problem::new(&boxes) };
                let found = solve(&method, &problem, 1, work(50_000), &()).unwrap();
                let off = found.cost / objective.cost_by(&found.tree, measure) - 1.0;
                assert!(off.abs() <= 1e-12, "{name} {objective:?}: {off}");
                found
            });
            assert_eq!(area.cost, objective.cost(&area.tree), "{name} {objective:?}");
            assert!(name == "median_cut" || area.tree != found.tree, "{name} {objective:?}");
        }
    }
}

/// Judges a tree by a small fraction of its area.
#[derive(Debug)]
struct Fraction;

impl Judge for Fraction {
    fn judge(&self, tree: &Bvh) -> f64 {
        1e-3 * cost::internal_area(tree)
    }
}

#[test]
fn neither_the_bound_nor_the_optimum_of_areas_ends_a_search_with_a_judge() {
    for boxes in [scatter(7, 1), vec![scatter(1, 1)[0]; 60]] {
        let problem = Problem { judge: Some(&Fraction), ..Problem::new(&boxes) };
        let stop = solve(&best::Config::default(), &problem, 1, work(90_000), &()).unwrap().stop;
        assert_ne!(stop, StopReason::Optimal, "{} objects", boxes.len());
    }
    let boxes = scatter(300, 1);
    let tree = |judge| {
        let problem = Problem { judge, ..Problem::new(&boxes) };
        solve(&reinsertion::Config::default(), &problem, 1, Budget::UNLIMITED, &()).unwrap().tree
    };
    assert!(tree(Some(&Fraction as &dyn Judge)) == tree(None), "another tree");
}

#[test]
fn no_search_goes_below_the_exact_optimum_and_best_reaches_it() {
    // Goldsmith–Salmon trees are not binary: their wider nodes have fewer terms.
    const NOT_BINARY: [&str; 3] = ["goldsmith_salmon", "random_orders", "genetic"];
    for n in 3..13 {
        let boxes = scatter(n, n);
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
