//! What a search is asked for, and what it may skip on the way because the answer stays the same.

use bvh_build::{BuildError, Watch, spatial};
use bvh_core::cost::{self, Measure, Objective};
use bvh_core::{Aabb, Bvh, Clip};
use std::fmt::Debug;

/// What judges whole trees in place of the cost, such as rays that are sent through them.
pub trait Judge: Sync + Debug {
    /// Lower is better: finite and not negative, and always the same for the same tree.
    fn judge(&self, tree: &Bvh) -> f64;
}

/// Leave to divide objects among several leaves, each with the part of the object in its box.
#[derive(Clone, Copy, Debug)]
pub struct Splits<'a> {
    /// The objects whose boxes the problem has.
    pub objects: &'a dyn Clip,
    /// Maximum number of references: leaves, for trees with one reference per leaf. At least the number of objects.
    pub most: usize,
    /// The [division](Self::divide) of these objects, if it has been made: the search then does not make it again.
    pub division: Option<&'a Bvh>,
}

impl<'a> Splits<'a> {
    /// Leave for so many references, if they are more than the objects of these `boxes`: with no more, nothing can be divided, and
    /// the problem without splits is the same, with more ways to solve it.
    pub fn at_most(most: usize, boxes: &[Aabb], objects: &'a dyn Clip) -> Option<Self> {
        (most > boxes.len()).then_some(Self { objects, most, division: None })
    }

    /// The top-down division of the objects of these `boxes` with [spatial splits](spatial), unless the `watch` ends it. Where it has
    /// no more references than objects, no plane was found at which dividing them saves something: a search is taken to find none
    /// either, and would pay for looking.
    pub fn divide(&self, boxes: &[Aabb], watch: &Watch) -> Result<Bvh, BuildError> {
        spatial::Config::default().build_watched(self.most, boxes, self.objects, watch)
    }
}

/// What is searched for: the tree over `boxes` of least cost.
#[derive(Clone, Copy, Debug)]
pub struct Problem<'a> {
    /// One box per object.
    pub boxes: &'a [Aabb],
    /// The cost to minimise.
    pub objective: Objective,
    /// The measure of boxes that takes the place of the half area, in the objective as in every decision of builders and searches. Only
    /// the initial trees of searches are by area, and by median cut boxes are not compared.
    pub measure: Option<&'a dyn Measure>,
    /// Whether and how objects may be divided among leaves. [`best`](crate::best) and [`optimize`](crate::optimize()) do so; the
    /// others take no notice. The cost is then the total size of *all* nodes, leaves included, by area or by the measure: what
    /// leaves cost is no longer the same for all trees.
    pub splits: Option<Splits<'a>>,
    /// What judges trees in place of both, for searches that make every tree anew: builders, GRASP without local search,
    /// insertion orders. The others change trees by the parts of a cost, and take no notice.
    pub judge: Option<&'a dyn Judge>,
    /// A valid tree over these objects that the caller has already. The outcome never costs more.
    pub known: Option<&'a Bvh>,
    /// Shortcuts that must not be taken, so that their savings can be measured. Empty in production.
    pub disabled: &'a [Shortcut],
}

impl<'a> Problem<'a> {
    /// The paper's problem: least total area of inner nodes.
    pub fn new(boxes: &'a [Aabb]) -> Self {
        Self {
            boxes,
            objective: Objective::default(),
            measure: None,
            splits: None,
            judge: None,
            known: None,
            disabled: &[],
        }
    }

    /// The cost of a tree. O(nodes), unless there is a judge.
    pub fn cost(&self, tree: &Bvh) -> f64 {
        match (self.judge, self.splits, self.measure) {
            (Some(judge), ..) => judge.judge(tree),
            (None, Some(_), Some(measure)) if self.objective != Objective::Layout => {
                cost::total_measure(tree, measure)
            }
            (None, Some(_), None) if self.objective != Objective::Layout => cost::total_area(tree),
            (None, _, Some(measure)) => self.objective.cost_by(tree, measure),
            (None, _, None) => self.objective.cost(tree),
        }
    }

    /// Whether this shortcut may be taken where the scene allows it.
    pub fn allows(&self, shortcut: Shortcut) -> bool {
        !self.disabled.contains(&shortcut)
    }
}

/// Work that some scenes do not need. No shortcut changes the cost of a tree that is built; a search that is ended early
/// or replaced by the exact solver never returns a more expensive tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "snake_case")
)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Shortcut {
    /// An axis that orders the objects as a lower axis does is neither scanned nor divided: its split candidates are
    /// the same, and it loses ties. See
    /// [`skip_same_order`](bvh_build::muller_fellner::Config::skip_same_order).
    SameOrder,
    /// Objects that come in order along an axis are not sorted along it, for example where all centres coincide. See
    /// [`skip_sorted`](bvh_build::muller_fellner::Config::skip_sorted).
    Sorted,
    /// A scene without area is divided along x only. See
    /// [`skip_flat`](bvh_build::muller_fellner::Config::skip_flat).
    Flat,
    /// A search ends when its incumbent meets [a lower bound](crate::lower_bound::of_largest).
    BoundMet,
    /// The search `best` is replaced by the [exact solver](crate::exact) where that takes less work.
    Tiny,
}
