//! Reinsertion: take a subtree out and put it where it costs least, over and over, to a local optimum.
//!
//! Bittner, Hapala & Havran 2013; the search of Meister & Bittner 2018.
//!
//! Differs from them: the search is exact and sequential, every node is tried, and a sweep ends only when a whole pass
//! finds nothing.

use crate::error::require;
use crate::incumbent::{Incumbent, until_still};
use crate::place::{Linked, PlaceSearch};
use crate::run::Tally;
use crate::start::Start;
use crate::stream::stream;
use crate::working::Working;
use crate::{Observer, Problem, Quota, Run, Search, SearchError};
use bvh_core::Bvh;
use bvh_core::with_vector_instructions;
use rand::seq::SliceRandom;

/// In which order to try the nodes, how often, and from where.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// The order of a sweep. Default `by_area`.
    pub order: Order,
    /// The most sweeps over all nodes, at least 1; ends earlier at a local optimum. Default 1000.
    pub sweeps: u32,
    /// The builder of the start.
    pub start: Start,
}

impl Default for Config {
    fn default() -> Self {
        Self { order: Order::ByArea, sweeps: 1000, start: Start::default() }
    }
}

/// The order of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Order {
    /// The largest node first, equal ones by index.
    ByArea,
    /// Another random order every time.
    Random,
}

impl Search for Config {
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        require(self.sweeps >= 1, "sweeps", self.sweeps.into(), "1 or more")?;
        let (mut best, mut tree) = Incumbent::build(&self.start, problem, run)?;
        best.descend(&mut tree, self.sweeps, run, |tree, number, quota, observer| {
            let mut order = tree.preorder();
            match self.order {
                Order::ByArea => sort_by_area(tree, &mut order),
                Order::Random => order.shuffle(&mut stream(seed, number.into())),
            }
            sweep(tree, &order, quota, observer)
        });
        Ok(best.tree)
    }
}

/// The largest first, equal ones in the order given.
pub(crate) fn sort_by_area(tree: &Working, order: &mut [u32]) {
    order.sort_by(|&a, &b| tree.nodes[b as usize].area.total_cmp(&tree.nodes[a as usize].area));
}

/// Tries every node once, the largest first.
pub(crate) fn sweep_by_area(tree: &mut Working, quota: Quota, observer: &dyn Observer) -> Tally {
    let mut order = tree.preorder();
    sort_by_area(tree, &mut order);
    sweep(tree, &order, quota, observer)
}

/// Sweeps by area until nothing moves.
pub(crate) fn to_local_optimum(tree: &mut Working, quota: Quota, observer: &dyn Observer) -> Tally {
    until_still(quota, observer, |quota| sweep_by_area(tree, quota, observer))
}

with_vector_instructions! {
    /// Tries to improve the place of every node of `order` once. Stops early when the quota is reached or
    /// the observer says so.
    pub(crate) sweep = sweep_plain<T: Linked>(
        tree: &mut T, order: &[u32], quota: Quota, observer: &dyn Observer) -> Tally
}

/// A place must be better by this part of its cost: above rounding, so that no two places take turns.
pub(crate) const TOLERANCE: f64 = 1e-12;

#[inline(always)]
fn sweep_plain<T: Linked>(tree: &mut T, order: &[u32], quota: Quota, observer: &dyn Observer) -> Tally {
    let mut swept = Tally::default();
    let mut search = PlaceSearch::default();
    for &node in order {
        let done = Tally { work: swept.work + search.visits, ..swept };
        if quota.is_reached(&done) || swept.moves % 256 == 255 && observer.cancelled() {
            break;
        }
        if tree.parent(node) == T::ABOVE {
            continue;
        }
        swept.moves += 1;
        if let (Some(place), _) = search.attached(tree, node, TOLERANCE) {
            swept.work += tree.reinsert(node, place.beside);
            swept.kept += 1;
        }
    }
    swept.work += search.visits;
    swept
}
