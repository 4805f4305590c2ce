//! Checks of one method on one scene: P1, P2, P5 and P7.

use crate::Verdict;
use crate::exact::{internal_area, relative_error};
use crate::methods::{EXACT_OBJECTS, is_builder};
use crate::transform::{same_topology, scaled, scaled_area};
use anyhow::{Context, Result, bail, ensure};
use bvh_core::{Aabb, cost, validate};
use bvh_scenes::builtin::stiff;
use bvh_search::{Budget, Method, Outcome, Problem, SearchError, solve};

/// The largest accepted relative error of a cost.
pub const ROUNDING: f64 = 1e-12;

/// Returns the budget of a method on a scene with this number of objects; builders have none.
pub fn budget(method: &Method, objects: usize, work_per_object: u64) -> Budget {
    let work = work_per_object.saturating_mul(objects as u64 + 1);
    Budget { max_evaluations: None, max_work: (!is_builder(method)).then_some(work) }
}

/// Runs a method with seed 1.
pub fn run(method: &Method, boxes: &[Aabb], work_per_object: u64) -> Result<Outcome> {
    let budget = budget(method, boxes.len(), work_per_object);
    solve(method, &Problem::new(boxes), 1, budget, &()).context("P1: refused")
}

/// Checks P2 and P7: the tree is valid and tight; its cost is finite, exact except for rounding,
/// the best of the history, and not above the start's. Returns the relative error of the cost.
pub fn check_outcome(boxes: &[Aabb], outcome: &Outcome) -> Result<f64> {
    let Outcome { tree, cost, history, .. } = outcome;
    validate(tree, boxes).context("P2")?;
    ensure!(tree.is_tight(boxes), "P2: boxes are not tight");
    let costs = [*cost, cost::internal_area(tree), cost::goldsmith_salmon(tree)];
    ensure!(costs.iter().all(|cost| cost.is_finite() && *cost >= 0.0), "P7: costs {costs:?}");
    let error = relative_error(*cost, &internal_area(tree));
    ensure!(error <= ROUNDING, "P7: the cost {cost} is off by {error:e} of the exact one");
    let best = history.iter().map(|event| event.cost).fold(f64::INFINITY, f64::min);
    // The incumbent must never be lost on the way.
    ensure!(best == *cost, "P7: the cost is {cost}, the best of the history {best}");
    Ok(error)
}

/// Runs `work` on this many threads.
pub fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T> {
    Ok(rayon::ThreadPoolBuilder::new().num_threads(threads).build()?.install(work))
}

/// Checks P5: the scene scaled by 2^k gives the same tree and 4^k times the cost, bit by bit.
pub fn check_scale(
    method: &Method,
    boxes: &[Aabb],
    work_per_object: u64,
    outcome: &Outcome,
    k: i32,
) -> Result<()> {
    let other = run(method, &scaled(boxes, k), work_per_object)?;
    ensure!(same_topology(&other.tree, &outcome.tree), "P5: another tree at scale 2^{k}");
    let expected = scaled_area(outcome.cost, k);
    let found = other.cost;
    ensure!(found == expected, "P5: the cost at scale 2^{k} is {found}, not {expected}");
    Ok(())
}

/// Checks that the method rejects the uniform scene with one damaged box, and names its object.
/// Returns the error's text.
pub fn refuses(method: &Method, damage: fn(&mut Aabb)) -> Verdict {
    const DAMAGED: usize = 7;
    // The exact method rejects larger scenes for their size first.
    let objects = if let Method::Exact(_) = method { EXACT_OBJECTS } else { 100 };
    let mut boxes = stiff::boxes(&stiff::uniform(objects));
    damage(&mut boxes[DAMAGED]);
    let error = match solve(method, &Problem::new(&boxes), 1, Budget::UNLIMITED, &()) {
        Err(SearchError::Build(error)) => error.to_string(),
        Err(error) => bail!("P1: not rejected as a scene: {error}"),
        Ok(_) => bail!("P1: built a tree over object {DAMAGED}"),
    };
    let is_named = error.contains(&format!("object {DAMAGED}, ["));
    ensure!(is_named, "P1: the error names no object {DAMAGED}: {error}");
    Ok(error)
}
