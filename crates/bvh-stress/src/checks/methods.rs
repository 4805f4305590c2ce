//! Checks of methods without stiff scenes: scales, threads, budgets, extreme parameters.

use crate::Verdict;
use crate::examine::{ROUNDING, check_outcome, check_scale, on_threads, run};
use crate::methods::is_builder;
use anyhow::{Context, Result, ensure};
use bvh_build::{Builder, Watch, goldsmith_salmon, muller_fellner};
use bvh_core::{Aabb, cost};
use bvh_scenes::builtin::stiff;
use bvh_search::grasp::{self, Candidates};
use bvh_search::{
    Budget, Deadline, Method, Observer, Outcome, Problem, Search, StopReason, annealing, exact,
    genetic, solve,
};
use glam::Vec3;
use std::time::Duration;

fn boxes(n: usize) -> Vec<Aabb> {
    stiff::boxes(&stiff::uniform(n))
}

fn solved(search: &dyn Search, boxes: &[Aabb], seed: u64, budget: Budget) -> Result<Outcome> {
    Ok(solve(search, &Problem::new(boxes), seed, budget, &())?)
}

/// S21: P5 holds for every k from -120 to 120 on five scenes: uniform, flat, a line, many ties, and
/// different sizes. Coordinates are 0 or between 2^-6 and 2^7, with mantissas that make sums and
/// products round.
pub fn scales(method: &Method) -> Verdict {
    let n = if let Method::Exact(_) = method { 7 } else { 24 };
    const WORK: u64 = 60;
    let stretch = Vec3::new(1.1, 1.3, 1.7);
    let scenes: [(stiff::Generator, Vec3); 5] = [
        (stiff::uniform, stretch),
        (stiff::uniform, stretch.with_z(0.0)),
        (stiff::on_a_line, stretch),
        (stiff::planar_grid, stretch),
        (stiff::collinear_centres, stretch),
    ];
    for (scene, (make, by)) in scenes.into_iter().enumerate() {
        let mut boxes = stiff::boxes(&make(n));
        boxes.iter_mut().for_each(|b| *b = Aabb { min: b.min * by, max: b.max * by });
        let outcome = run(method, &boxes, WORK)?;
        // All scales are tried, because a fault of one exponent shows at that scale alone.
        for k in -120..=120 {
            check_scale(method, &boxes, WORK, &outcome, k)
                .with_context(|| format!("scene {scene}"))?;
        }
    }
    Ok("241 scales of 5 scenes".into())
}

/// S37: P4 holds for 1, 2, 3 and 8 threads and three seeds.
pub fn threads_and_seeds(method: &Method) -> Verdict {
    let boxes = boxes(if let Method::Exact(_) = method { 10 } else { 120 });
    // The large seed would be lost by a cast to 32 bits.
    for seed in [1, 2, 1 << 40] {
        let budget = Budget { max_evaluations: None, max_work: Some(20_000) };
        let on = |threads| on_threads(threads, || solved(method, &boxes, seed, budget));
        let one = on(1)??;
        for threads in [1, 2, 3, 8] {
            let other = on(threads)??;
            let same = (&one.tree, &one.history) == (&other.tree, &other.history);
            ensure!(same, "P4: seed {seed}: another outcome on {threads} threads");
        }
    }
    Ok("4 numbers of threads, 3 seeds".into())
}

/// S39: a method returns its best tree so far with a budget of 0, and if it is cancelled
/// immediately or after a millisecond.
pub fn budgets_end(method: &Method) -> Verdict {
    let boxes = boxes(if let Method::Exact(_) = method { 10 } else { 200 });
    let nothing = Budget { max_evaluations: Some(0), max_work: Some(0) };
    let one = Budget { max_evaluations: Some(1), max_work: None };
    let now = Deadline::after(Duration::ZERO);
    let soon = Deadline::after(Duration::from_millis(1));
    let free = Budget::UNLIMITED;
    let watchers: [(Budget, &dyn Observer, Option<StopReason>); 4] = [
        (nothing, &(), None),
        (one, &(), None),
        (free, &now, Some(StopReason::Cancelled)),
        (free, &soon, None),
    ];
    for (budget, observer, reason) in watchers {
        let outcome = solve(method, &Problem::new(&boxes), 1, budget, observer)?;
        check_outcome(&boxes, &outcome)?;
        let is_reported = reason.is_none_or(|reason| outcome.stop == reason);
        ensure!(is_reported, "cancelled, and stopped for {:?}", outcome.stop);
    }
    Ok(String::new())
}

/// S40: with populations of one and two, mutation and crossover never or always, permutations stay
/// permutations, and the best is never lost.
pub fn genetic_edges(_: &Method) -> Verdict {
    let boxes = boxes(30);
    for i in 0..8 {
        let config = genetic::Config {
            population: 1 + i % 2,
            generations: 40,
            mutation: (i / 2 % 2) as f64,
            crossover: (i / 4) as f64,
            ..Default::default()
        };
        // With only two places, cuts fall on both ends.
        for n in [0, 1, 2, 30] {
            let outcome = solved(&config, &boxes[..n], 3, Budget::UNLIMITED)?;
            // An order that is no permutation would give an invalid tree.
            check_outcome(&boxes[..n], &outcome)?;
            let mut incumbents = outcome.history.iter().map(|event| event.incumbent);
            ensure!(incumbents.clone().is_sorted_by(|a, b| a >= b), "the best was lost");
            ensure!(incumbents.next_back() == Some(outcome.cost), "the best was not returned");
        }
    }
    Ok("8 settings, scenes of 0, 1, 2 and 30".into())
}

/// S41: without noise, or with one candidate, GRASP is greedy, bit by bit. A candidate list longer
/// than the number of candidates does no harm.
pub fn grasp_edges(_: &Method) -> Verdict {
    let boxes = boxes(150);
    let greedy = muller_fellner::Config::default().build(&boxes)?;
    for (candidates, noise, equal) in [
        (Candidates::AxisBest, Some(0.0), true),
        (Candidates::KBest(5), Some(0.0), true),
        (Candidates::Within(0.1), Some(0.0), true),
        (Candidates::KBest(1), None, true),
        (Candidates::KBest(1), Some(1.0), true),
        (Candidates::Within(0.0), None, true),
        (Candidates::KBest(100_000), None, false),
    ] {
        let config = grasp::Config { trials: 3, candidates, noise, ..Default::default() };
        let outcome = solved(&config, &boxes, 5, Budget::UNLIMITED)?;
        check_outcome(&boxes, &outcome)?;
        ensure!(!equal || outcome.tree == greedy, "{candidates:?}, noise {noise:?} is not greedy");
    }
    Ok(String::new())
}

/// S42: after a million random moves, each judged by the updated cost, the updated cost is the
/// tree's.
pub fn a_million_moves(_: &Method) -> Verdict {
    const MOVES: u64 = 1_000_000;
    let boxes = boxes(60);
    // Without another end.
    let config = annealing::Config { work_per_object: MOVES };
    let budget = Budget { max_evaluations: Some(MOVES), max_work: None };
    let outcome = solved(&config, &boxes, 42, budget)?;
    let error = check_outcome(&boxes, &outcome)?;
    ensure!(outcome.evaluations == MOVES, "{} moves", outcome.evaluations);
    Ok(format!("{MOVES} moves, off by {error:.0e}"))
}

/// S42: the cost that insertion updates equals the recomputed cost.
pub fn insertion_keeps_its_cost() -> Verdict {
    let mut largest: f64 = 0.0;
    for make in
        [stiff::uniform, stiff::slivers, stiff::two_densities, stiff::enormous, stiff::denormal]
    {
        let boxes = stiff::boxes(&make(2000));
        let scene = goldsmith_salmon::Scene::new(&boxes, None)?;
        let mut workspace = goldsmith_salmon::Workspace::default();
        let mut tree = Default::default();
        let order: Vec<u32> = (0..boxes.len() as u32).collect();
        let config = goldsmith_salmon::Config::default();
        let kept = config.insert_all(&scene, &order, &mut workspace, &Watch::default())?;
        workspace.write(&mut tree);
        let recomputed = cost::goldsmith_salmon(&tree);
        largest = largest.max((kept - recomputed).abs() / recomputed);
    }
    ensure!(largest <= ROUNDING, "off by {largest:e}");
    Ok(format!("off by {largest:.0e} at most"))
}

/// S43: no method is below the exact optimum of small scenes; its largest gap is reported.
pub fn above_the_optimum(method: &Method) -> Verdict {
    let exact = exact::Config::default();
    let mut largest: f64 = 0.0;
    for make in [
        stiff::uniform,
        stiff::overlapping,
        stiff::slivers,
        stiff::planar_grid,
        stiff::two_densities,
    ] {
        for n in [3, 7, 10] {
            let boxes = stiff::boxes(&make(n));
            let optimum = solved(&exact, &boxes, 1, Budget::UNLIMITED)?.cost;
            let outcome = run(method, &boxes, 2000)?;
            check_outcome(&boxes, &outcome)?;
            if outcome.tree.nodes.iter().any(|node| node.children().len() > 2) {
                return Ok("wide nodes: another class of trees".into());
            }
            // Only binary trees are in the class over which the optimum is exact.
            let gap = outcome.cost / optimum - 1.0;
            ensure!(gap >= -ROUNDING, "{} is below the optimum {optimum}", outcome.cost);
            largest = largest.max(gap);
        }
    }
    ensure!(is_builder(method) || largest < 1.0, "a search with a gap of {largest}");
    Ok(format!("gap up to {:.2} %", 100.0 * largest.max(0.0)))
}
