//! The choices of a bake without `--budget`: the work, the cost, the rays and the split references
//! that suit the scene.
//!
//! Short searches try the combinations of the choices that are open. Rays that trained no tree
//! judge the trees. Chosen is the simplest combination that is within [`TOLERANCE`] of the best
//! one.

use super::plan::{Plan, Prepared};
use super::watch::Interrupted;
use crate::Error;
use crate::answer::Answer;
use crate::interrupt;
use crate::output::{self, print_error};
use crate::rays::Rays;
use bvh_core::cost::Objective;
use bvh_core::{Bvh, RayDensity};
use bvh_scenes::Scene;
use bvh_search::{Bake, Budget};
use indicatif::ProgressBar;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

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

/// Returns the work of a bake of `objects` without a budget, in visited nodes.
pub fn work(objects: usize) -> u64 {
    let objects = objects as u64;
    (WORK_PER_OBJECT * objects).min(MOST_WORK).max(LEAST_WORK_PER_OBJECT * objects)
}

/// Explains the [`work`] of a bake of `objects`.
pub fn reason_of_work(objects: usize) -> String {
    let work = work(objects);
    let per_object = work / objects.max(1) as u64;
    let why = if per_object == WORK_PER_OBJECT {
        "more would hardly pay"
    } else {
        "because the scene is large; more would pay (--budget)"
    };
    let millions = work as f64 / 1e6;
    format!("budget: {millions:.0} Mwork, {per_object} nodes per object; {why}")
}

/// The choices that the arguments leave open. A given choice is not tried.
#[derive(Clone, Copy)]
pub struct Open {
    /// Whether to choose between area and the cost of the layout.
    pub cost: bool,
    /// Whether to choose between area and default rays.
    pub rays: bool,
    /// Whether to choose between whole and divided objects.
    pub references: bool,
}

/// Tries the combinations of the open choices, and explains each choice in one line. Returns the plan
/// with the choices that pay, and the parts of the decision that the bake needs too. Keeps the plan
/// as it is if `interrupted` becomes true.
pub fn decide(
    open: Open,
    plan: Plan,
    scene: &Scene,
    interrupted: &AtomicBool,
    answer: &mut Answer,
) -> Result<(Plan, Prepared), Error> {
    let costs = open.costs(&plan);
    let references = open.references(&plan);
    if costs.len() * references.len() == 1 {
        return Ok((plan, Prepared::default()));
    }
    // From here on there is a tree soon, which Ctrl-C must save instead of ending the program.
    interrupt::hold();
    let Some(mut trials) = Trials::begin(&open, &plan, scene, interrupted)? else {
        return Ok((plan, Prepared::default()));
    };
    let mut table = Table { columns: costs.len(), tests: Vec::new() };
    let bar = bar(costs.len() * references.len());
    for &references in &references {
        for (objective, rays) in &costs {
            let choices =
                Plan { objective: *objective, rays: rays.clone(), references, ..plan.clone() };
            table.tests.push(trials.expected_tests(&choices)?);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    // An interrupted search says nothing about the choices.
    if interrupted.load(Relaxed) {
        let prepared = Prepared { greedy: Some(trials.greedy), ..Prepared::default() };
        return Ok((plan, prepared));
    }
    let (row, column) = table.simplest();
    let (objective, rays) = costs[column].clone();
    let plan = Plan { objective, rays, references: references[row], ..plan };
    let prepared = Prepared {
        greedy: Some(trials.greedy),
        density: trials.trained.take_if(|_| plan.rays.is_some()),
        division: trials.division.take_if(|_| plan.references > 1.0),
    };
    for reason in table.reasons(&open, row, column) {
        answer.choice(reason);
    }
    Ok((plan, prepared))
}

impl Open {
    /// Returns the costs to try, with their rays: the simpler ones first.
    fn costs(&self, given: &Plan) -> Vec<(Objective, Option<Rays>)> {
        let mut costs = vec![(given.objective, given.rays.clone())];
        let objective = if self.cost { Objective::Layout } else { given.objective };
        if self.cost {
            costs.push((objective, None));
        }
        if self.rays {
            costs.push((objective, Some(Rays::Default)));
        }
        costs
    }

    /// Returns the numbers of references per object to try: the smaller one first.
    fn references(&self, given: &Plan) -> Vec<f64> {
        if self.references { vec![1.0, REFERENCES] } else { vec![given.references] }
    }
}

/// The expected tests of the judging rays: a row for each number of references, a column for each
/// cost, with the simplest combination first.
struct Table {
    columns: usize,
    tests: Vec<f64>,
}

impl Table {
    /// Returns the row and the column of the simplest combination near the best one.
    fn simplest(&self) -> (usize, usize) {
        let best = self.tests.iter().copied().fold(f64::INFINITY, f64::min);
        let index = self.tests.iter().position(|&tests| tests <= best * (1.0 + TOLERANCE));
        let index = index.unwrap_or(0);
        (index / self.columns, index % self.columns)
    }

    /// Explains the choice of a row and a column: each open choice is compared with its
    /// alternative, other things being equal.
    fn reasons(&self, open: &Open, row: usize, column: usize) -> Vec<String> {
        let tests = |row: usize, column: usize| self.tests[row * self.columns + column];
        let last = self.columns - 1;
        let mut reasons = Vec::new();
        if open.cost {
            let saved = 1.0 - tests(row, column.max(1)) / tests(row, 0);
            reasons.push(reason("cost: the wide layout's", column > 0, saved));
        }
        if open.rays {
            let saved = 1.0 - tests(row, last) / tests(row, last - 1);
            reasons.push(reason("rays: default", column == last, saved));
        }
        if open.references {
            let saved = 1.0 - tests(1, column) / tests(0, column);
            reasons.push(reason("references: 1.2 per object", row > 0, saved));
        }
        reasons
    }
}

fn reason(name: &str, is_chosen: bool, saved: f64) -> String {
    let verdict = if is_chosen { "yes" } else { "no" };
    let percent = 100.0 * saved.abs();
    let direction = if saved < 0.0 { "more" } else { "fewer" };
    format!("{name}: {verdict}, {percent:.1} % {direction} expected tests of untrained rays")
}

/// Returns a bar over the trials, or without a terminal prints that they begin.
fn bar(trials: usize) -> ProgressBar {
    let bar = output::bar(trials as u64, "{bar:10} {msg}, {pos} of {len}");
    bar.set_message("trying the choices");
    if bar.is_hidden() {
        print_error(&format!("trying {trials} combinations of the choices"));
    } else {
        bar.tick();
    }
    bar
}

struct Trials<'a> {
    scene: &'a Scene,
    interrupted: &'a AtomicBool,
    greedy: Bvh,
    /// The rays that judge.
    judging: RayDensity,
    /// The rays that train trees.
    trained: Option<RayDensity>,
    /// The division of the objects.
    division: Option<Bvh>,
}

impl<'a> Trials<'a> {
    /// Returns `None` after an interruption.
    fn begin(
        open: &Open,
        given: &Plan,
        scene: &'a Scene,
        interrupted: &'a AtomicBool,
    ) -> Result<Option<Self>, Error> {
        let failed = |error| Error::search(&scene.name, given.method.name())(error);
        let references = if open.references { REFERENCES } else { given.references };
        let bake = Bake { references, ..given.bake(scene, None) };
        let observer = Interrupted(interrupted);
        let Some(greedy) = bake.greedy(&observer).map_err(failed)? else { return Ok(None) };
        let judging = Rays::Default.density(scene, &greedy, Rays::JUDGING, interrupted)?;
        let Some(judging) = judging else { return Ok(None) };
        let default = open.rays.then_some(Rays::Default);
        let trained = match given.rays.as_ref().or(default.as_ref()) {
            Some(rays) => rays.density(scene, &greedy, given.seed, interrupted)?,
            None => None,
        };
        let division = bake.divided(&observer).map_err(failed)?;
        Ok(Some(Self { scene, interrupted, greedy, judging, trained, division }))
    }

    /// Returns the expected tests of the judging rays in the tree of a short search; infinitely
    /// many after an interruption.
    fn expected_tests(&self, choices: &Plan) -> Result<f64, Error> {
        let Self { scene, interrupted, greedy, .. } = self;
        // A trial of no work takes seconds in large scenes.
        if interrupted.load(Relaxed) {
            return Ok(f64::INFINITY);
        }
        let work = work(scene.boxes.len()) as f64;
        let tried = (TRIED * work).max(LEAST_TRIED.min(MOST_TRIED * work));
        let rays = self.trained.as_ref().filter(|_| choices.rays.is_some());
        let bake = Bake {
            division: self.division.as_ref(),
            budget: Budget { max_work: Some(tried as u64), ..Budget::UNLIMITED },
            ..choices.bake(scene, rays)
        };
        let baked = bake
            .search(Some(greedy.clone()), &Interrupted(interrupted))
            .map_err(Error::search(&scene.name, choices.method.name()))?;
        if interrupted.load(Relaxed) {
            return Ok(f64::INFINITY);
        }
        Ok(Objective::Layout.cost_by(&baked.outcome.tree, &self.judging))
    }
}
