//! The problem that a search solves, and the shortcuts that keep its answer.

use crate::parallel;
use bvh_core::cost::{self, Measure, Objective};
use bvh_core::{Aabb, Bvh, Clip};
use std::fmt::Debug;

/// Judges whole trees instead of the cost, for example by tracing rays.
pub trait Judge: Sync + Debug {
    /// Returns a value for a tree, where lower is better: finite, not negative, and always the same
    /// for the same tree.
    fn judge(&self, tree: &Bvh) -> f64;
}

/// Permission to divide objects among several leaves, each with the part of the object in its box.
#[derive(Clone, Copy, Debug)]
pub struct Splits<'a> {
    /// The objects whose boxes the problem has.
    pub objects: &'a dyn Clip,
    /// Maximum number of references: leaves, for trees with one reference per leaf. At least the
    /// number of objects.
    pub most: usize,
    /// The division of these objects by [`spatial`](bvh_build::spatial), if the caller has it, so
    /// that the search need not repeat it.
    pub divided: Option<&'a Bvh>,
}

impl<'a> Splits<'a> {
    /// Permits up to `most` references; `None` if these are not more than the `boxes`. Nothing can
    /// then be divided, and more methods solve the problem without splits.
    pub fn at_most(most: usize, boxes: &[Aabb], objects: &'a dyn Clip) -> Option<Self> {
        (most > boxes.len()).then_some(Self { objects, most, divided: None })
    }
}

/// The problem: find the tree of least cost over `boxes`.
///
/// ```
/// use bvh_search::{exact, prelude::*};
/// let boxes: Vec<Aabb> = (0..9u8).map(f32::from).map(|x| Aabb::from([[x; 3], [x + 1.5; 3]])).collect();
/// let problem = Problem { objective: Objective::InternalArea, ..Problem::new(&boxes) };
/// let optimum = solve(&exact::Config {}, &problem, 0, Budget::UNLIMITED, &())?;
/// let greedy = muller_fellner::Config::default().build(&boxes)?;
/// assert!(cost::internal_area(&optimum.tree) <= cost::internal_area(&greedy));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// One box per object.
    pub boxes: &'a [Aabb],
    /// The cost to minimise.
    pub objective: Objective,
    /// The measure of boxes that replaces the half area, in the objective and in every decision of
    /// builders and searches. Median cut compares no boxes.
    pub measure: Option<&'a dyn Measure>,
    /// The permission to divide objects among leaves, if any. [`best`](crate::best) and
    /// [`optimize`](crate::optimize()) support it; the other methods ignore it. The cost is then
    /// the total size of *all* nodes, leaves included, by area or by the measure, because the cost
    /// of leaves is no longer the same for all trees.
    pub splits: Option<Splits<'a>>,
    /// Judges trees instead of the objective and the measure, for searches that construct every
    /// tree: builders, GRASP without local search, insertion orders. The other searches add up
    /// parts of a cost and ignore the judge.
    pub judge: Option<&'a dyn Judge>,
    /// Shortcuts to disable, so that their savings can be measured. Empty in production.
    pub disabled: &'a [Shortcut],
}

impl<'a> Problem<'a> {
    /// Returns the paper's problem: the least total area of inner nodes.
    pub fn new(boxes: &'a [Aabb]) -> Self {
        Self {
            boxes,
            objective: Objective::default(),
            measure: None,
            splits: None,
            judge: None,
            disabled: &[],
        }
    }

    /// Returns the cost of a tree. O(nodes), unless there is a judge.
    pub fn cost(&self, tree: &Bvh) -> f64 {
        match (self.judge, self.splits, self.measure) {
            (Some(judge), ..) => judge.judge(tree),
            // The costs of a large layout take half a second, which a caller who has cancelled may
            // wait for.
            _ if self.objective == Objective::Layout => {
                cost::layout_cost(tree, self.measure, &parallel::call_both)
            }
            (None, Some(_), measure) => cost::total_measure(tree, measure.unwrap_or(&cost::Area)),
            (None, None, measure) => self.objective.cost_by(tree, measure.unwrap_or(&cost::Area)),
        }
    }

    /// Returns whether the search may use this shortcut. With a judge it may use none: they end a
    /// search by areas.
    pub fn allows(&self, shortcut: Shortcut) -> bool {
        self.judge.is_none() && !self.disabled.contains(&shortcut)
    }
}

bvh_config::config! {
    /// A kind of work that some scenes do not need. No shortcut changes the cost of a built tree. A
    /// search that ends early, or that the exact solver replaces, never returns a more expensive
    /// tree.
    #[derive(Copy, Eq)]
    pub enum Shortcut {
        /// An axis that orders the objects like a lower axis is neither scanned nor divided: its
        /// split candidates are the same, and it loses ties. See
        /// [`skip_same_order`](bvh_build::muller_fellner::Config::skip_same_order).
        SameOrder,
        /// Objects that are already in order along an axis are not sorted along it, for example if
        /// all centres coincide. See
        /// [`skip_sorted`](bvh_build::muller_fellner::Config::skip_sorted).
        Sorted,
        /// A scene without area is divided along x only. See
        /// [`skip_flat`](bvh_build::muller_fellner::Config::skip_flat).
        Flat,
        /// A search ends when its incumbent meets [a lower bound](crate::lower_bound::of_largest).
        BoundMet,
        /// The [exact solver](crate::exact) replaces the search `best` if it takes less work.
        Tiny,
    }
}
