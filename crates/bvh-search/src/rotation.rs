//! Tree rotations: let subtrees one and two levels below a node change places, over and over, to a local optimum.
//!
//! Kensler 2008, 'Tree rotations for improving bounding volume hierarchies': a child with a grandchild on the other
//! side (four ways), or two grandchildren of different sides (two ways).
//!
//! Differs from the paper: hill climbing only; its annealing is [annealing](crate::annealing) on reinsertion moves, of
//! which every rotation is one or two.

use crate::error::require;
use crate::incumbent::{Incumbent, until_still};
use crate::reinsertion::{TOLERANCE, sort_by_area};
use crate::start::Start;
use crate::working::Working;
use crate::{Observer, Problem, Quota, Run, Search, SearchError, Tally};
use bvh_core::{Bvh, with_vector_instructions};

/// In which order to try the nodes, how often, and from where.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// The order of a sweep. Default `bottom_up`.
    pub order: Order,
    /// The most sweeps over all nodes, at least 1; ends earlier at a local optimum. Default 1000.
    pub sweeps: u32,
    /// The builder of the start.
    pub start: Start,
}

impl Default for Config {
    fn default() -> Self {
        Self { order: Order::BottomUp, sweeps: 1000, start: Start::default() }
    }
}

/// The order of a sweep.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Order {
    /// Children before their parents.
    BottomUp,
    /// The largest node first, equal ones parents first.
    ByArea,
}

impl Search for Config {
    fn search(&self, problem: &Problem, _seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        require(self.sweeps >= 1, "sweeps", self.sweeps.into(), "1 or more")?;
        let (mut best, mut tree) = Incumbent::build(&self.start, problem, run)?;
        best.descend(&mut tree, self.sweeps, run, |tree, _, quota, observer| {
            sweep(tree, &self.order.of(tree), quota, observer)
        });
        Ok(best.tree)
    }
}

impl Order {
    /// The nodes of a sweep.
    fn of(self, tree: &Working) -> Vec<u32> {
        let mut order = tree.preorder();
        match self {
            Self::BottomUp => order.reverse(),
            Self::ByArea => sort_by_area(tree, &mut order),
        }
        order
    }
}

/// Sweeps bottom-up until nothing moves.
pub(crate) fn to_local_optimum(tree: &mut Working, quota: Quota, observer: &dyn Observer) -> Tally {
    until_still(quota, observer, |quota| {
        let order = Order::BottomUp.of(tree);
        sweep(tree, &order, quota, observer)
    })
}

with_vector_instructions! {
    /// Does the best rotation at every node of `order`, where one pays. Stops early when the quota is reached or the
    /// observer says so.
    sweep = sweep_plain(tree: &mut Working, order: &[u32], quota: Quota, observer: &dyn Observer) -> Tally
}

#[inline(always)]
fn sweep_plain(tree: &mut Working, order: &[u32], quota: Quota, observer: &dyn Observer) -> Tally {
    let mut swept = Tally::default();
    for &node in order {
        if tree.nodes[node as usize].is_leaf() {
            continue;
        }
        if quota.is_reached(&swept) || swept.moves % 1024 == 1023 && observer.cancelled() {
            break;
        }
        swept.moves += 1;
        // The node, its children and grandchildren.
        swept.work += 7;
        if let Some(rotation) = best(tree, node) {
            tree.begin();
            rotation.carry_out(tree);
            swept.kept += 1;
        }
    }
    swept
}

/// The children that two nodes will have, the lowest first.
#[derive(Clone, Copy, Debug)]
struct Rotation([(u32, [u32; 2]); 2]);

impl Rotation {
    fn carry_out(self, tree: &mut Working) {
        self.0.into_iter().for_each(|(node, children)| tree.join(node, children));
    }
}

/// The rotation at an inner node that saves most, if one saves anything. The node's own box is the same after all of
/// them.
#[inline(always)]
fn best(tree: &Working, top: u32) -> Option<Rotation> {
    let area = |children| tree.union_of(children).half_area();
    let node = |at: u32| &tree.nodes[at as usize];
    let sides = node(top).children;
    let (mut most, mut best) = (TOLERANCE * node(top).area, None);
    for [from, other] in [sides, [sides[1], sides[0]]] {
        if node(from).is_leaf() {
            continue;
        }
        let pair = node(from).children;
        for [leaves, stays] in [pair, [pair[1], pair[0]]] {
            let saved = node(from).area - area([other, stays]);
            if saved > most {
                most = saved;
                best = Some(Rotation([(from, [other, stays]), (top, [from, leaves])]));
            }
        }
    }
    let [left, right] = sides;
    if !node(left).is_leaf() && !node(right).is_leaf() {
        let ([a, b], pair) = (node(left).children, node(right).children);
        for [c, d] in [pair, [pair[1], pair[0]]] {
            let saved = node(left).area + node(right).area - area([a, c]) - area([b, d]);
            if saved > most {
                most = saved;
                best = Some(Rotation([(left, [a, c]), (right, [b, d])]));
            }
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::{built, scatter};
    use bvh_build::median_cut;
    use bvh_core::validate;

    /// The total areas of every tree that one rotation makes of this one, boxes recomputed from nothing.
    fn neighbours(tree: &Working, tops: &[u32]) -> Vec<f64> {
        let mut found = vec![];
        for &top in tops {
            let below = |at: u32| {
                let node = &tree.nodes[at as usize];
                if node.is_leaf() { vec![] } else { node.children.to_vec() }
            };
            let [Some(left), Some(right)] = [0, 1].map(|side| below(top).get(side).copied()) else {
                continue;
            };
            let mut pairs: Vec<(u32, u32)> = below(left).into_iter().map(|below| (below, right)).collect();
            pairs.extend(below(right).into_iter().map(|below| (below, left)));
            pairs.extend(below(left).iter().flat_map(|&a| below(right).into_iter().map(move |b| (a, b))));
            for (a, b) in pairs {
                let mut other = tree.clone();
                for (old, new) in [(a, b), (b, a)] {
                    let parent = tree.nodes[old as usize].parent;
                    let children = &mut other.nodes[parent as usize].children;
                    children[usize::from(tree.nodes[parent as usize].children[0] != old)] = new;
                    other.nodes[new as usize].parent = parent;
                }
                for at in other.preorder().into_iter().rev() {
                    if !other.nodes[at as usize].is_leaf() {
                        let aabb = other.union_of(other.nodes[at as usize].children);
                        other.nodes[at as usize].area = aabb.half_area();
                        other.nodes[at as usize].aabb = aabb;
                    }
                }
                found.push(other.internal_area());
            }
        }
        found
    }

    #[test]
    fn a_local_optimum_is_better_than_every_neighbour_and_areas_stay_exact() {
        for (n, order) in [(40, Order::BottomUp), (60, Order::ByArea), (2, Order::ByArea), (3, Order::BottomUp)]
        {
            let boxes = scatter(n);
            let mut tree = built(&median_cut::Config::default(), &boxes);
            until_still(Quota::ENDLESS, &(), |quota| {
                let nodes = order.of(&tree);
                let swept = sweep(&mut tree, &nodes, quota, &());
                let area = tree.internal_area();
                assert!((tree.area() - area).abs() <= 1e-12 * area);
                swept
            });
            let found = tree.to_bvh();
            validate(&found, &boxes).unwrap();
            assert!(found.is_tight(&boxes));
            let least = neighbours(&tree, &tree.preorder()).into_iter().fold(f64::INFINITY, f64::min);
            assert!(tree.area() <= least * (1.0 + 1e-11), "{} {least}", tree.area());
        }
    }

    #[test]
    fn the_rotation_chosen_is_the_best_of_all_at_its_node() {
        let tree = built(&median_cut::Config::default(), &scatter(64));
        for top in tree.preorder() {
            if tree.nodes[top as usize].is_leaf() {
                continue;
            }
            let least = neighbours(&tree, &[top]).into_iter().fold(tree.area(), f64::min);
            let mut rotated = tree.clone();
            if let Some(rotation) = best(&tree, top) {
                rotation.carry_out(&mut rotated);
            }
            assert!((rotated.area() - least).abs() <= 1e-12 * least, "{} {least}", rotated.area());
        }
    }
}
