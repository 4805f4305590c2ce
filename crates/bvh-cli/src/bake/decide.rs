//! The choices of a bake without `--budget`: the work, the cost, the rays and the split references
//! that suit the scene.
//!
//! Short searches try the combinations of the choices that are open. Rays that trained no tree
//! judge the trees. Chosen is the simplest combination that is within [`TOLERANCE`] of the best
//! one.

use super::plan::{Plan, Prepared};
use super::{BakeArgs, Effort};
use crate::Error;
use crate::answer::Answer;
use crate::interrupt::{INTERRUPTED, is_interrupted};
use crate::output::{bar, print_error};
use crate::rays::Rays;
use bvh_core::cost::Objective;
use bvh_scenes::Scene;
use bvh_search::{Bake, Budget, Method};

/// The work per object of a bake that chooses its own budget. On the 7 scenes of
/// `results/anytime`, `best` ends within 0.3 % of the best known cost after this work; six times
/// the work saves at most 0.3 % (`results/anytime_long`).
const WORK_PER_OBJECT: u64 = 8000;
/// The work up to which a bake chooses [`WORK_PER_OBJECT`]: about a minute on one core.
const MOST_WORK: u64 = 4_000_000_000;
/// The work per object of the largest scenes. `best` ends within 1.3 % of the best known cost.
const LEAST_WORK_PER_OBJECT: u64 = 800;
/// The share of the work that each short search of a large scene spends.
const TRIED: f64 = 0.02;
/// The work of the short searches of smaller scenes: a fraction of a second each.
const LEAST_TRIED: f64 = 1e7;
/// The largest share of the work that a short search spends. Five times less chose wrongly on small
/// scenes, where dividing objects pays late in the search.
const MOST_TRIED: f64 = 0.1;
/// The fraction of the expected tests of rays that a simpler combination may lose. Two searches
/// with other seeds differ by as much.
const TOLERANCE: f64 = 0.005;
/// The number of references per object where divided objects pay.
pub const REFERENCES: f64 = 1.2;

/// Chooses the work of a bake of `objects`, in visited nodes, and explains it.
pub fn work(objects: usize, answer: &mut Answer) -> Effort {
    let objects = objects as u64;
    let work = (WORK_PER_OBJECT * objects).min(MOST_WORK).max(LEAST_WORK_PER_OBJECT * objects);
    let per_object = work / objects.max(1);
    let why = if per_object == WORK_PER_OBJECT {
        "more would hardly pay"
    } else {
        "because the scene is large; more would pay (--budget)"
    };
    let millions = work as f64 / 1e6;
    let line = format!("budget: {millions:.0} Mwork, {per_object} nodes per object; {why}");
    answer.line("choices", line);
    Effort::Work(work)
}

/// Tries the combinations of the choices that the arguments leave open, and explains each choice in
/// one line. Returns the plan with the choices that pay, and the parts of the decision that the
/// bake needs too. If the user interrupts, the best tree so far is among these parts, with its plan.
pub fn decide(
    args: &BakeArgs,
    plan: Plan,
    scene: &Scene,
    answer: &mut Answer,
) -> Result<(Plan, Prepared), Error> {
    let mut prepared = Prepared::default();
    // Only `best` offers the choices, and only triangles have a wide layout. A search from an
    // earlier tree minimises the cost that is given.
    let has_choices = matches!(plan.method, Method::Best(_)) && scene.triangles().is_ok();
    let is_given = args.budget.is_some() || args.from.is_some() || args.tracer.is_some();
    let Some(work) = plan.effort.work().filter(|_| has_choices && !is_given) else {
        return Ok((plan, prepared));
    };
    // The simpler choices come first.
    let chooses_cost = args.cost.is_none() && args.rays.is_none();
    let mut costs = vec![(plan.objective, plan.rays.clone())];
    if chooses_cost {
        costs.push((Objective::Layout, None));
    }
    if args.rays.is_none() {
        costs.push((costs[costs.len() - 1].0, Some(Rays::Default)));
    }
    let last = costs.len() - 1;
    let references = args.references.map_or(vec![1.0, REFERENCES], |given| vec![given]);
    let mut plans = Vec::new();
    for &references in &references {
        for (objective, rays) in costs.iter().cloned() {
            plans.push(Plan { objective, rays, references, ..plan.clone() });
        }
    }
    if plans.len() < 2 {
        return Ok((plan, prepared));
    }
    // The last combination has all choices, so that it needs all that the others need.
    let most = &plans[plans.len() - 1];
    let failed = |error| Error::search(&scene.name, plan.method.name())(error);
    prepared.greedy = most.bake(scene, None).greedy(&INTERRUPTED).map_err(failed)?;
    let Some(greedy) = &prepared.greedy else { return Ok((plan, prepared)) };
    let judging = Rays::Default.density(scene, greedy, Rays::JUDGING)?;
    if let Some(rays) = &most.rays {
        prepared.density = rays.density(scene, greedy, plan.seed)?;
    }
    prepared.division = most.bake(scene, None).divided(&INTERRUPTED).map_err(failed)?;
    let tried = (TRIED * work as f64).max(LEAST_TRIED.min(MOST_TRIED * work as f64));
    let budget = Budget { max_work: Some(tried as u64), ..Budget::UNLIMITED };
    // The expected tests of the judging rays, by references and then by costs.
    let mut tests = Vec::new();
    let mut best_tried = None;
    let bar = bar(plans.len() as u64, "{bar:10} trying the choices, {pos} of {len}");
    bar.tick();
    if bar.is_hidden() {
        print_error(&format!("trying {} combinations of the choices", plans.len()));
    }
    for (index, plan) in plans.iter().enumerate() {
        // A trial of no work takes seconds in large scenes.
        let Some(judging) = judging.as_ref().filter(|_| !is_interrupted()) else { break };
        let density = prepared.density.as_ref().filter(|_| plan.rays.is_some());
        let division = prepared.division.as_ref();
        let bake = Bake { division, budget, ..plan.bake(scene, density) };
        let baked = bake.search(Some(greedy.clone()), &INTERRUPTED).map_err(failed)?;
        let found = Objective::Layout.cost_by(&baked.outcome.tree, judging);
        if tests.iter().all(|&other| found < other) {
            best_tried = Some((index, baked));
        }
        tests.push(found);
        bar.inc(1);
    }
    bar.finish_and_clear();
    // An interrupted search says nothing about the choices, but it has found trees.
    if is_interrupted() {
        prepared.division = None;
        let (Some((index, baked)), Some(judging)) = (best_tried, judging) else {
            return Ok((plan, Prepared { density: None, ..prepared }));
        };
        let plan = plans.swap_remove(index);
        prepared.density.take_if(|_| plan.rays.is_none());
        return Ok((plan, Prepared { tried: Some((baked, judging)), ..prepared }));
    }
    let best = tests.iter().copied().fold(f64::INFINITY, f64::min);
    let chosen = tests.iter().position(|&tests| tests <= best * (1.0 + TOLERANCE)).unwrap_or(0);
    let column = chosen % costs.len();
    let row = chosen - column;
    // Each choice is compared with its alternative, other things being equal.
    let mut explain = |name: &str, is_chosen: bool, with: usize, without: usize| {
        let saved = 1.0 - tests[with] / tests[without];
        let verdict = if is_chosen { "yes" } else { "no" };
        let percent = 100.0 * saved.abs();
        let direction = if saved < 0.0 { "more" } else { "fewer" };
        let line = format!(
            "{name}: {verdict}, {percent:.1} % {direction} expected tests of untrained rays"
        );
        answer.line("choices", line);
    };
    if chooses_cost {
        explain("cost: the wide layout's", column > 0, row + column.max(1), row);
    }
    if args.rays.is_none() {
        explain("rays: default", column == last, row + last, row + last - 1);
    }
    if args.references.is_none() {
        explain("references: 1.2 per object", row > 0, costs.len() + column, column);
    }
    let plan = plans.swap_remove(chosen);
    prepared.density.take_if(|_| plan.rays.is_none());
    prepared.division.take_if(|_| plan.references == 1.0);
    Ok((plan, prepared))
}
