//! The choices of a bake without `--budget`: the work, the cost, the rays and the split references
//! that suit the scene.
//!
//! ```text
//!   area ── pays? ──► layout ── pays? ──► default rays ── pays? ──► divided objects
//! ```
//!
//! Each step is tried with a short search on top of the steps that have paid. Its tree is judged by
//! rays that did not train it, and the step pays if it saves [`WORTHWHILE`] of their expected tests.

use super::starts::{Division, greedy};
use super::watch::Interrupted;
use crate::Error;
use crate::rays::Rays;
use bvh_core::cost::{Measure, Objective};
use bvh_core::{Bvh, RayDensity};
use bvh_scenes::Scene;
use bvh_search::{Budget, Method, Problem, solve};
use bvh_terminal::interrupt;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};

/// The work per object of a bake that chooses its own budget. On the 7 scenes of
/// `results/anytime`, `best` ends within 0.3 % of the best known cost after this work; six times
/// the work saves at most 0.3 % (`results/anytime_long`).
const WORK_PER_OBJECT: u64 = 8000;
/// The work up to which a bake chooses [`WORK_PER_OBJECT`]: about a minute on one core.
const MOST_WORK: u64 = 4_000_000_000;
/// The work per object of the largest scenes. `best` ends within 1.3 % of the best known cost.
const LEAST_WORK_PER_OBJECT: u64 = 800;
/// The share of the work that the short search of each step spends.
const TRIED: f64 = 0.02;
/// The fraction of the expected tests of rays that a step must save.
const WORTHWHILE: f64 = 0.01;
/// The number of references per object where divided objects pay.
const REFERENCES: f64 = 1.2;

/// Returns the work of a bake of `objects` without a budget, in visited nodes.
pub fn work(objects: usize) -> u64 {
    let objects = objects as u64;
    (WORK_PER_OBJECT * objects)
        .min(MOST_WORK)
        .max(LEAST_WORK_PER_OBJECT * objects)
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

/// The choices of a bake.
#[derive(Clone)]
pub struct Choices {
    /// The cost to minimise.
    pub objective: Objective,
    /// The rays whose visits replace areas.
    pub rays: Option<Rays>,
    /// The largest number of references per object; 1 for whole objects.
    pub references: f64,
}

/// The outcome of a decision.
pub struct Decided {
    /// The choices that pay.
    pub choices: Choices,
    /// The explanation of each choice, in one line.
    pub reasons: Vec<String>,
    /// The greedy tree, which the bake needs too.
    pub greedy: Bvh,
}

/// Tries the open choices one after the other, and keeps those that pay. Begins with the `given`
/// ones, and also ends with them if `interrupted` becomes true.
pub fn decide(
    open: Open,
    given: Choices,
    method: &Method,
    scene: &Scene,
    seed: u64,
    interrupted: &AtomicBool,
) -> Result<Decided, Error> {
    let mut decision = Decision::begin(given, method, scene, seed, interrupted)?;
    if open.cost {
        let layout = Choices { objective: Objective::Layout, ..decision.chosen.clone() };
        decision.consider("cost: the wide layout's", layout)?;
    }
    if open.rays {
        let mut with_rays = Choices { rays: Some(Rays::Default), ..decision.chosen.clone() };
        if open.cost {
            with_rays.objective = Objective::Layout;
        }
        decision.consider("rays: default", with_rays)?;
    }
    if open.references {
        let divided = Choices { references: REFERENCES, ..decision.chosen.clone() };
        decision.consider("references: 1.2 per object", divided)?;
    }
    let Decision { chosen, reasons, greedy, .. } = decision;
    Ok(Decided { choices: chosen, reasons, greedy })
}

/// The choices so far, and what the trial of the next one needs.
struct Decision<'a> {
    method: &'a Method,
    scene: &'a Scene,
    seed: u64,
    interrupted: &'a AtomicBool,
    greedy: Bvh,
    /// The rays that judge; `None` after an interruption.
    judging: Option<RayDensity>,
    chosen: Choices,
    /// The expected tests of the judging rays in the tree of the chosen candidate.
    tests: f64,
    reasons: Vec<String>,
}

impl<'a> Decision<'a> {
    /// Tries the given choices, with which all others are compared.
    fn begin(
        given: Choices,
        method: &'a Method,
        scene: &'a Scene,
        seed: u64,
        interrupted: &'a AtomicBool,
    ) -> Result<Self, Error> {
        let greedy = greedy(method.name(), scene, interrupted)?;
        // There is a tree now, which Ctrl-C must save instead of ending the program.
        interrupt::hold();
        let judging = Rays::Default.density(scene, &greedy, Rays::JUDGING, interrupted)?;
        let mut decision = Self {
            method,
            scene,
            seed,
            interrupted,
            greedy,
            judging,
            chosen: given.clone(),
            tests: f64::INFINITY,
            reasons: Vec::new(),
        };
        decision.tests = decision.tests_after(&given)?;
        Ok(decision)
    }

    /// Tries other choices, and keeps them if they pay.
    fn consider(&mut self, name: &str, choices: Choices) -> Result<(), Error> {
        let tests = self.tests_after(&choices)?;
        // An interrupted search says nothing about the choices.
        if self.interrupted.load(Relaxed) {
            return Ok(());
        }
        let saved = 1.0 - tests / self.tests;
        let pays = saved >= WORTHWHILE;
        let verdict = if pays { "yes" } else { "no" };
        let percent = 100.0 * saved.abs();
        let direction = if saved < 0.0 { "more" } else { "fewer" };
        self.reasons.push(format!(
            "{name}: {verdict}, {percent:.1} % {direction} expected tests of untrained rays"
        ));
        if pays {
            self.chosen = choices;
            self.tests = tests;
        }
        Ok(())
    }

    /// Returns the expected tests of the judging rays in the tree of a short search; infinitely many
    /// after an interruption.
    fn tests_after(&self, choices: &Choices) -> Result<f64, Error> {
        let Self { method, scene, seed, interrupted, greedy, .. } = self;
        // A trial of no work takes seconds in large scenes.
        if interrupted.load(Relaxed) {
            return Ok(f64::INFINITY);
        }
        let name = method.name();
        let density = match &choices.rays {
            Some(rays) => rays.density(scene, greedy, *seed, interrupted)?,
            None => None,
        };
        let most_references = (choices.references * scene.boxes.len() as f64) as usize;
        let is_over = || interrupted.load(Relaxed);
        let division = Division::decide(most_references, scene, None, &is_over)?;
        let problem = Problem {
            objective: choices.objective,
            splits: division.splits(),
            measure: density
                .as_ref()
                .map(|density| density as &dyn Measure),
            known: Some(greedy),
            ..Problem::new(&scene.boxes)
        };
        let share = TRIED * work(scene.boxes.len()) as f64;
        let budget = Budget { max_work: Some(share as u64), ..Budget::UNLIMITED };
        let found = solve(*method, &problem, *seed, budget, &Interrupted(interrupted))
            .map_err(Error::search(&scene.name, name))?;
        match &self.judging {
            Some(judging) if !interrupted.load(Relaxed) => {
                Ok(Objective::Layout.cost_by(&found.tree, judging))
            }
            _ => Ok(f64::INFINITY),
        }
    }
}
