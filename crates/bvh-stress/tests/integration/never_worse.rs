//! No search returns a tree that costs more than one it built on its way or got from its caller.
//! `best` never costs more than its start with the smallest budgets, and from 25 nodes per object on
//! never more than any builder.
//!
//! The tests cover small versions of all built-in and stiff scenes, all methods, budgets from
//! nothing to several hundred nodes per object, and clocks.

use bvh_build::{Builder, muller_fellner, ploc};
use bvh_core::{Aabb, Bvh, cost, validate};
use bvh_scenes::Scene;
use bvh_scenes::builtin::stiff::{self, STIFF};
use bvh_search::{Budget, Kept, Method, Observer, Problem, best, solve_or_keep};
use bvh_stress::EXACT_OBJECTS;
use bvh_stress::examine::ROUNDING;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Returns all scenes with several hundred objects, and a few that are stiff only at larger sizes.
fn scenes() -> Vec<(String, Vec<Aabb>)> {
    let built_in = ["bijou", "cloister", "escher", "konistil", "pinecon2", "spheres7500"];
    let larger = ["S06:2000", "S17:2000", "S30:3000"].map(str::to_owned);
    let named = built_in.map(|name| format!("{name}:300")).into_iter().chain(larger);
    let loaded = named.map(|name| {
        let boxes = Scene::load(&name).unwrap().boxes;
        (name, boxes)
    });
    let stiff = STIFF.iter().map(|(id, make)| ((*id).to_owned(), stiff::boxes(&make(300))));
    loaded.chain(stiff).collect()
}

/// Returns boxes of which most are as large as the scene.
fn large(objects: usize) -> Vec<Aabb> {
    stiff::boxes(&stiff::overlapping(objects))
}

/// Work per object from which `best` is compared with every builder. Smaller budgets pay for the
/// fastest one alone.
const PAYS_FOR_EVERY_BUILDER: u64 = 25;

/// A clock that advances with every question.
struct Clock {
    asked: AtomicU64,
    most: u64,
}

/// The times at which clocks end a search, in questions.
const TIMES: [u64; 8] = [1, 2, 3, 5, 10, 30, 100, 1000];

impl Clock {
    fn of(most: u64) -> Self {
        Self { asked: AtomicU64::new(0), most }
    }
}

impl Observer for Clock {
    fn cancelled(&self) -> bool {
        self.asked.fetch_add(1, Relaxed) >= self.most
    }

    fn progress(&self) -> Option<f64> {
        let asked = self.asked.fetch_add(1, Relaxed);
        Some((asked as f64 / self.most as f64).min(1.0))
    }
}

/// Returns the budget of this work per object; unlike that of the suite, it limits builders too.
fn budget(boxes: &[Aabb], work: u64) -> Budget {
    Budget { max_work: Some(work * boxes.len() as u64), ..Budget::UNLIMITED }
}

/// Searches, from a tree of its caller's if there is one. Returns the cost, which is at most that
/// of every tree that the search had or evaluated, except for the rounding of updates. Failures
/// name `here`, the scene with the budget or the clock.
fn cost_of(
    here: &str,
    method: &Method,
    boxes: &[Aabb],
    known: Option<&Bvh>,
    budget: Budget,
    observer: &dyn Observer,
) -> f64 {
    let name = method.name();
    let problem = Problem::new(boxes);
    let kept = known.map(|tree| Kept::new(tree.clone(), &problem));
    let limit = kept.as_ref().map_or(f64::INFINITY, |kept| kept.cost);
    let outcome = solve_or_keep(method, &problem, kept, 1, budget, observer).unwrap();
    validate(&outcome.tree, boxes).unwrap();
    assert!(outcome.cost <= limit, "{here}, {name}: {} above {limit}", outcome.cost);
    let least = outcome.history.iter().map(|event| event.cost).fold(limit, f64::min);
    assert!(at_most(outcome.cost, least), "{here}, {name}: {} after {least}", outcome.cost);
    let area = cost::internal_area(&outcome.tree);
    assert!(at_most(area, outcome.cost), "{here}, {name}: {} reported, {area}", outcome.cost);
    outcome.cost
}

fn at_most(cost: f64, limit: f64) -> bool {
    cost <= limit * (1.0 + ROUNDING)
}

fn greedy(boxes: &[Aabb]) -> Bvh {
    muller_fellner::Config::default().build(boxes).unwrap()
}

#[test]
fn no_search_ends_above_a_tree_that_it_has_evaluated_or_that_its_caller_has() {
    for (name, boxes) in scenes().into_iter().filter(|(_, boxes)| boxes.len() <= 600) {
        for method in Method::all() {
            let few = &boxes[..boxes.len().min(EXACT_OBJECTS)];
            let boxes = if let Method::Exact(_) = method { few } else { &boxes };
            let known = greedy(boxes);
            let limit = cost::internal_area(&known);
            for work in [0, 20, 60] {
                let here = format!("{name}, {work} per object");
                let budget = budget(boxes, work);
                let cost = cost_of(&here, &method, boxes, None, budget, &());
                cost_of(&here, &method, boxes, Some(&known), budget, &());
                // Local searches begin a little above the greedy tree at most.
                let is_local = ["reinsertion", "annealing"].contains(&method.name());
                let is_near = work > 0 || !is_local || cost <= 1.15 * limit;
                assert!(is_near, "{here}, {}: {cost} above {limit}", method.name());
            }
        }
    }
    let boxes = large(1000);
    let known = greedy(&boxes);
    for method in Method::all().iter().filter(|method| method.name() != "exact") {
        for most in TIMES {
            let here = format!("overlapping objects, {most} questions");
            cost_of(&here, method, &boxes, Some(&known), Budget::UNLIMITED, &Clock::of(most));
        }
    }
}

/// Returns the costs of the builders that a user would try instead of a search, the fastest first.
fn builds(boxes: &[Aabb]) -> [f64; 4] {
    let fast = |radius, near_rounds| ploc::Config { radius, near_rounds };
    let builders: [&dyn Builder; 4] =
        [&fast(1, 0), &fast(5, 1), &muller_fellner::Config::default(), &ploc::Config::default()];
    builders.map(|builder| cost::internal_area(&builder.build(boxes).unwrap()))
}

#[test]
fn neither_budget_nor_clock_ends_the_best_above_the_builders_that_it_pays_for() {
    let method = Method::Best(best::Config::default());
    for (name, boxes) in scenes() {
        let [fastest, fast, others @ ..] = builds(&boxes);
        let cheapest = others.into_iter().fold(fast, f64::min);
        for work in [0, 3, 19, 20, 25, 60, 300] {
            let limit = if work < PAYS_FOR_EVERY_BUILDER { fast } else { cheapest };
            let here = format!("{name}, {work} per object");
            let cost = cost_of(&here, &method, &boxes, None, budget(&boxes, work), &());
            assert!(at_most(cost, limit), "{here}: {cost} above {limit}");
        }
        // A clock that ends at once leaves time for the fastest only.
        let limit = fastest.max(fast);
        for most in TIMES {
            let here = format!("{name}, {most} questions");
            let clock = Clock::of(most);
            let cost = cost_of(&here, &method, &boxes, None, Budget::UNLIMITED, &clock);
            assert!(at_most(cost, limit), "{here}: {cost} above {limit}");
        }
    }
}

#[test]
fn more_work_on_objects_as_large_as_the_scene_gives_no_worse_tree() {
    for objects in [500, 1000, 8000] {
        let boxes = large(objects);
        let [_, builds @ ..] = builds(&boxes);
        let cheapest = builds.into_iter().fold(f64::INFINITY, f64::min);
        for method in Method::all()
            .iter()
            .filter(|method| ["best", "reinsertion", "annealing"].contains(&method.name()))
        {
            let mut before = f64::INFINITY;
            for work in [0, 5, 12, 25, 50, 100, 200, 625] {
                let here = format!("{objects} objects, {}, {work} per object", method.name());
                let cost = cost_of(&here, method, &boxes, None, budget(&boxes, work), &());
                assert!(cost <= before, "{here}: {cost} after {before}");
                // Other methods pay for one builder only.
                if method.name() == "best" && work >= PAYS_FOR_EVERY_BUILDER {
                    assert!(cost <= cheapest, "{here}: {cost} above {cheapest}");
                }
                before = cost;
            }
        }
    }
}
