//! Checks the promises P1, P2 and P4 to P7 for one method on one scene, and collects its numbers.

use crate::case::{Case, SceneCase, is_builder};
use crate::exact_area::{internal_area, relative_error};
use crate::promise::Promise::{P1, P2};
use crate::promise::{Broken, Verdict, ensure};
use crate::transform::{same_topology, scale_range, scaled, scaled_area};
use bvh_core::cost;
use bvh_core::{Aabb, validate};
use bvh_scenes::builtin::stiff;
use bvh_search::{Budget, Method, Outcome, Problem, SearchError, solve};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

/// The largest accepted relative error of a cost.
pub const ROUNDING: f64 = 1e-12;

/// The maximum number of objects of a scene that is built again for other numbers of threads and at
/// other scales.
const REPEATED: usize = 20_000;

/// The findings about one method on one scene.
#[derive(Clone, Debug, Default)]
pub struct Examined {
    /// Number of objects.
    pub objects: usize,
    /// Edges from the root to the deepest leaf.
    pub depth: usize,
    /// The internal area.
    pub cost: f64,
    /// The cost's relative error against exact arithmetic.
    pub relative_error: f64,
    /// The method's wall time.
    pub seconds: f64,
    /// Further findings.
    pub note: String,
}

/// Returns the budget of a method on a scene with this number of objects; builders have none.
pub fn budget(method: &Method, objects: usize, work_per_object: u64) -> Budget {
    let work = work_per_object.saturating_mul(objects as u64 + 1);
    Budget { max_evaluations: None, max_work: (!is_builder(method)).then_some(work) }
}

/// Runs a method with seed 1. A panic breaks a promise.
pub fn run(method: &Method, boxes: &[Aabb], work_per_object: u64) -> Result<Outcome, Broken> {
    let budget = budget(method, boxes.len(), work_per_object);
    solved(method, boxes, budget)?.map_err(|error| P1.broken(format!("refused: {error}")))
}

fn solved(
    method: &Method,
    boxes: &[Aabb],
    budget: Budget,
) -> Result<Result<Outcome, SearchError>, Broken> {
    let solved =
        // Nothing that the closure borrows is used after a panic.
        catch_unwind(AssertUnwindSafe(|| solve(method, &Problem::new(boxes), 1, budget, &())));
    solved.map_err(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|&text| text.into()));
        P1.broken(format!("panicked: {}", text.unwrap_or_default()))
    })
}

/// Checks a method on the scene of a case with this number of objects.
pub fn examine(
    case: &Case,
    scene: &SceneCase,
    method: &Method,
    objects: usize,
    work_per_object: u64,
) -> Result<Examined, Broken> {
    let boxes = stiff::boxes(&case.triangles(objects));
    let start = Instant::now();
    let outcome = run(method, &boxes, work_per_object)?;
    let seconds = start.elapsed().as_secs_f64();
    let relative_error = check_outcome(&boxes, &outcome)?;
    // Repetitions take several times as long, so large scenes are built once.
    if boxes.len() <= REPEATED {
        check_threads(method, &boxes, work_per_object, &outcome)?;
        let range = scale_range(&boxes);
        let low = *range.start().max(&-120);
        let high = *range.end().min(&120);
        // The ends of the range are where exponents overflow; two scales in between cover the rest.
        for k in [low, low / 7, high / 7, high] {
            check_scale(method, &boxes, work_per_object, &outcome, k)?;
        }
    }
    let note = scene.also.map_or(Ok(String::new()), |also| also(method, &boxes, &outcome))?;
    let depth = outcome.tree.depth();
    let cost = outcome.cost;
    Ok(Examined { objects: boxes.len(), depth, cost, relative_error, seconds, note })
}

/// Checks P2 and P7: the tree is valid and tight; its cost is finite, exact except for rounding,
/// the best of the history, and not above the start's. Returns the relative error of the cost.
pub fn check_outcome(boxes: &[Aabb], outcome: &Outcome) -> Result<f64, Broken> {
    let Outcome { tree, cost, history, .. } = outcome;
    validate(tree, boxes).map_err(|error| P2.broken(error))?;
    ensure!(tree.is_tight(boxes), P2: "boxes are not tight");
    let costs = [*cost, cost::internal_area(tree), cost::goldsmith_salmon(tree)];
    ensure!(costs.iter().all(|cost| cost.is_finite() && *cost >= 0.0), P7: "costs {costs:?}");
    let error = relative_error(*cost, &internal_area(tree));
    ensure!(error <= ROUNDING, P7: "the cost {cost} is off by {error:e} of the exact one");
    let best = history.iter().map(|event| event.cost).fold(f64::INFINITY, f64::min);
    // The incumbent must never be lost on the way.
    ensure!(best == *cost, P7: "the cost is {cost}, the best of the history {best}");
    Ok(error)
}

/// Runs `work` on this many threads.
pub fn on_threads<T: Send>(
    threads: usize,
    work: impl FnOnce() -> Result<T, Broken> + Send,
) -> Result<T, Broken> {
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(Broken::case)?
        .install(work)
}

/// Checks P4: the same tree and history on one thread and on three.
fn check_threads(
    method: &Method,
    boxes: &[Aabb],
    work_per_object: u64,
    outcome: &Outcome,
) -> Result<(), Broken> {
    for threads in [1, 3] {
        let other = on_threads(threads, || run(method, boxes, work_per_object))?;
        let same = (&other.tree, &other.history) == (&outcome.tree, &outcome.history);
        ensure!(same, P4: "another outcome on {threads} threads");
    }
    Ok(())
}

/// Checks P5: the scene scaled by 2^k gives the same tree and 4^k times the cost, bit by bit.
pub fn check_scale(
    method: &Method,
    boxes: &[Aabb],
    work_per_object: u64,
    outcome: &Outcome,
    k: i32,
) -> Result<(), Broken> {
    let other = run(method, &scaled(boxes, k), work_per_object)?;
    ensure!(same_topology(&other.tree, &outcome.tree), P5: "another tree at scale 2^{k}");
    let expected = scaled_area(outcome.cost, k);
    let found = other.cost;
    ensure!(found == expected, P5: "the cost at scale 2^{k} is {found}, not {expected}");
    Ok(())
}

/// Checks that the method rejects the boxes and names the object.
pub fn refuses(method: &Method, boxes: &[Aabb], object: usize) -> Verdict {
    match solved(method, boxes, Budget::UNLIMITED)? {
        Err(error @ SearchError::Build(_))
            if error.to_string().contains(&format!("object {object} ")) =>
        {
            Ok(error.to_string())
        }
        Err(error) => Err(P1.broken(format!("the error names no object {object}: {error}"))),
        Ok(_) => Err(P1.broken(format!("built a tree over object {object}"))),
    }
}
