//! No search returns a tree that costs more than one it built on its way or got from its caller.
//! `best` never costs more than its start with the smallest budgets, and from 25 nodes per object on
//! never more than any builder.
//!
//! The tests cover small versions of all built-in and stiff scenes, all methods, and budgets from
//! nothing to several hundred nodes per object.

use bvh_build::{Builder, muller_fellner, ploc};
use bvh_core::{Aabb, Triangle, cost, validate};
use bvh_scenes::Scene;
use bvh_scenes::builtin::stiff::{self, STIFF};
use bvh_search::{Budget, Kept, Method, Observer, Outcome, Problem, best, solve, solve_or_keep};
use bvh_stress::EXACT_OBJECTS;
use bvh_stress::examine::ROUNDING;
use rand::{RngExt, SeedableRng};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// Returns triangles with corners anywhere in the unit cube; most are as large as the scene.
fn soup(n: usize) -> Vec<Aabb> {
    let mut random = bvh_search::Stream::seed_from_u64(1);
    let mut corner = || [random.random::<f32>(), random.random(), random.random()];
    (0..n).map(|_| Triangle::from([corner(), corner(), corner()]).aabb()).collect()
}

/// Returns all scenes with several hundred objects, and a few that are stiff only at larger sizes.
fn scenes() -> Vec<(String, Vec<Aabb>)> {
    let built_in = ["bijou", "cloister", "escher", "konistil", "pinecon2", "spheres7500"];
    let larger = ["S06:2000", "S17:2000", "S30:2000"].map(str::to_owned);
    let named = built_in.map(|name| format!("{name}:300")).into_iter().chain(larger);
    let loaded = named.map(|name| {
        let boxes = Scene::load(&name).unwrap().boxes;
        (name, boxes)
    });
    let stiff = STIFF.iter().map(|(id, make)| ((*id).to_owned(), stiff::boxes(&make(300))));
    let soups = [300, 3000].map(|n| (format!("soup of {n}"), soup(n)));
    loaded.chain(stiff).chain(soups).collect()
}

/// Work per object: near the border between small and large budgets, and beyond.
const WORK: [u64; 7] = [0, 3, 19, 20, 25, 60, 300];

/// Work per object from which `best` is compared with every builder. Smaller budgets pay for the
/// fastest one alone.
const PAYS_FOR_EVERY_BUILDER: u64 = 25;

fn solved(method: &Method, problem: &Problem, work: u64, observer: &dyn Observer) -> Outcome {
    let max_work = Some(work * problem.boxes.len() as u64);
    let outcome =
        solve(method, problem, 1, Budget { max_work, ..Budget::UNLIMITED }, observer).unwrap();
    validate(&outcome.tree, problem.boxes).unwrap();
    outcome
}

/// Returns true if a cost is at most `limit`, except for the rounding of a sum updated by
/// increments.
fn at_most(cost: f64, limit: f64) -> bool {
    cost <= limit * (1.0 + ROUNDING)
}

#[test]
fn no_method_ends_above_a_tree_that_it_has_evaluated_or_that_its_caller_has() {
    for (name, boxes) in scenes().into_iter().filter(|(_, boxes)| boxes.len() <= 600) {
        for method in Method::all() {
            let few = &boxes[..boxes.len().min(EXACT_OBJECTS)];
            let boxes = if let Method::Exact(_) = method { few } else { &boxes };
            let known = muller_fellner::Config::default().build(boxes).unwrap();
            for work in [0, 20, 60] {
                let here = format!("{name}, {}, {work} per object", method.name());
                let found = solved(&method, &Problem::new(boxes), work, &());
                let least =
                    found.history.iter().map(|event| event.cost).fold(f64::INFINITY, f64::min);
                assert!(at_most(found.cost, least), "{here}: {} after {least}", found.cost);
                assert!(at_most(cost::internal_area(&found.tree), found.cost), "{here}");
                let max_work = Some(work * boxes.len() as u64);
                let budget = Budget { max_work, ..Budget::UNLIMITED };
                let problem = Problem::new(boxes);
                let kept = Kept::new(known.clone(), &problem);
                let limit = kept.cost;
                let informed =
                    solve_or_keep(&method, &problem, Some(kept), 1, budget, &()).unwrap();
                assert!(informed.cost <= limit, "{here}: {} above {limit}", informed.cost);
                if work == 0 && ["reinsertion", "annealing"].contains(&method.name()) {
                    // Local searches begin a little above the greedy tree at most.
                    assert!(found.cost <= 1.15 * limit, "{here}: {} above {limit}", found.cost);
                }
            }
        }
    }
}

#[test]
fn no_budget_of_the_best_ends_above_the_builders_that_it_pays_for() {
    let method = Method::Best(best::Config::default());
    for (name, boxes) in scenes() {
        let of_fastest = cost::internal_area(&FASTEST.build(&boxes).unwrap());
        let of_cheapest = cheapest_build(&boxes);
        for work in WORK {
            let limit = if work < PAYS_FOR_EVERY_BUILDER { of_fastest } else { of_cheapest };
            let found = solved(&method, &Problem::new(&boxes), work, &());
            assert!(
                at_most(found.cost, limit),
                "{name}, {work} per object: {} above {limit}",
                found.cost
            );
        }
    }
}

/// Returns the least cost of the builders that a user would try instead of a search.
fn cheapest_build(boxes: &[Aabb]) -> f64 {
    let builders: [&dyn Builder; 3] =
        [&muller_fellner::Config::default(), &ploc::Config::default(), &FASTEST];
    let costs = builders.map(|builder| cost::internal_area(&builder.build(boxes).unwrap()));
    costs.into_iter().fold(f64::INFINITY, f64::min)
}

const FASTEST: ploc::Config = ploc::Config { radius: 5, near_rounds: 1 };

#[test]
fn more_work_on_objects_as_large_as_the_scene_gives_no_worse_tree() {
    for objects in [500, 1000, 8000] {
        let boxes = soup(objects);
        let cheapest = cheapest_build(&boxes);
        for method in Method::all()
            .iter()
            .filter(|method| ["best", "reinsertion", "annealing"].contains(&method.name()))
        {
            let mut before = f64::INFINITY;
            for work in [0, 5, 25, 50, 100, 200, 625] {
                let cost = solved(method, &Problem::new(&boxes), work, &()).cost;
                let here = format!("{objects} objects, {}, {work} per object", method.name());
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

struct Questions {
    asked: AtomicU64,
    most: u64,
}

impl Observer for Questions {
    fn cancelled(&self) -> bool {
        self.asked.fetch_add(1, Relaxed) >= self.most
    }

    fn progress(&self) -> Option<f64> {
        let asked = self.asked.fetch_add(1, Relaxed);
        Some((asked as f64 / self.most as f64).min(1.0))
    }
}

#[test]
fn a_clock_ends_no_search_above_the_tree_that_its_caller_has() {
    let boxes = soup(1000);
    let known = muller_fellner::Config::default().build(&boxes).unwrap();
    let limit = cost::internal_area(&known);
    for method in Method::all().iter().filter(|method| method.name() != "exact") {
        for most in [1, 3, 10, 100, 1000] {
            let clock = Questions { asked: AtomicU64::new(0), most };
            let problem = Problem::new(&boxes);
            let kept = Some(Kept::new(known.clone(), &problem));
            let found =
                solve_or_keep(method, &problem, kept, 1, Budget::UNLIMITED, &clock).unwrap();
            validate(&found.tree, &boxes).unwrap();
            assert!(found.cost <= limit, "{}, {most}: {} above {limit}", method.name(), found.cost);
        }
    }
}

#[test]
fn a_clock_ends_the_best_above_no_tree_that_it_has_evaluated_nor_above_its_fast_builds() {
    // A clock that ends at once leaves time for the first only.
    let fast = [(1, 0), (5, 1)].map(|(radius, near_rounds)| ploc::Config { radius, near_rounds });
    let method = Method::Best(best::Config::default());
    for (name, boxes) in scenes() {
        let limit = fast
            .iter()
            .map(|build| cost::internal_area(&build.build(&boxes).unwrap()))
            .fold(0.0, f64::max);
        for most in [1, 3, 10, 100, 1000] {
            let clock = Questions { asked: AtomicU64::new(0), most };
            let found =
                solve(&method, &Problem::new(&boxes), 1, Budget::UNLIMITED, &clock).unwrap();
            validate(&found.tree, &boxes).unwrap();
            let least = found.history.iter().map(|event| event.cost).fold(limit, f64::min);
            assert!(
                at_most(found.cost, least),
                "{name}, {most} questions: {} above {least}",
                found.cost
            );
        }
    }
}
