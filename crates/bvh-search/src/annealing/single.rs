//! Simulated annealing on single reinsertions: a move takes one subtree to another position nearby,
//! better or worse.
//!
//! Kirkpatrick, Gelatt & Vecchi 1983; Kensler 2008 anneals rotations, which are reinsertions over
//! one or two levels. Temperatures are relative to the area that the removal of the subtree saves,
//! so one schedule suits nodes of all sizes.

use super::metropolis::Mover;
use super::node_sampler::NodeSampler;
use super::schedule::anneal_initial;
use crate::run::{Found, Problem, Run, Stream};
use crate::tree::{ANCHOR, Metric, Working, search_by_metric};
use bvh_core::PackedAabb;
use rand::RngExt;

bvh_config::config! {
    /// The amount of work. A move removes a random subtree, more often below a large node, and
    /// inserts it again at the best other position at most some levels above its old one.
    pub struct Config {
        /// Work per object, unless the budget has less.
        work_per_object: u64 = 10_000;
    }
}

/// Maximum number of levels up.
const CLIMB: u32 = 12;

/// First and last temperature, relative to the area saved by the removal.
const HEAT: [f64; 2] = [0.3, 0.003];

search_by_metric!(Config);

impl Config {
    fn search_by(&self, metric: impl Metric, problem: &Problem, seed: u64, run: &mut Run) -> Found {
        anneal_initial(SingleMover::default, HEAT, self.work_per_object, metric, problem, seed, run)
    }
}

#[derive(Debug, Default)]
pub(crate) struct SingleMover {
    sampler: NodeSampler,
    /// Inner nodes whose children remain to be examined, each with the growth of the node and of
    /// all its ancestors up to the top.
    stack: Vec<(u32, f64)>,
    work: u64,
}

impl SingleMover {
    /// Returns the cheapest position for a detached item, next to `top` or below it, but not next
    /// to `sibling`; `None` if none costs less than `limit`. The growth above the top is not
    /// counted.
    ///
    /// This is an exact branch and bound like [`PositionSearch`](crate::tree::PositionSearch). That
    /// search cannot replace it: it begins at the sibling and visits nodes in another order, so its
    /// work, and with it every result, would differ.
    #[inline(always)]
    fn best(
        &mut self,
        tree: &Working<impl Metric>,
        (aabb, area): (&PackedAabb, f64),
        [top, sibling]: [u32; 2],
        limit: f64,
    ) -> Option<u32> {
        let mut best = None;
        let mut least = limit;
        let mut visits = 1;
        let mut look = |index: u32, growth: f64, least: &mut f64, stack: &mut Vec<(u32, f64)>| {
            let node = &tree.nodes[index as usize];
            let cost = growth + tree.metric().of(&node.aabb.union(aabb));
            if cost < *least && index != sibling {
                *least = cost;
                best = Some(index);
            }
            let growth = cost - node.area;
            if !node.is_leaf() && growth + area < *least {
                stack.push((index, growth));
            }
        };
        look(top, 0.0, &mut least, &mut self.stack);
        while let Some((index, growth)) = self.stack.pop() {
            if growth + area < least {
                visits += 2;
                for child in tree.nodes[index as usize].children {
                    look(child, growth, &mut least, &mut self.stack);
                }
            }
        }
        self.work += visits;
        best
    }
}

impl Mover for SingleMover {
    fn work(&self) -> u64 {
        self.work
    }

    fn begin(&mut self, tree: &Working<impl Metric>, near: Vec<u32>) {
        self.sampler.begin(tree, near);
    }

    #[inline(always)]
    fn step(
        &mut self,
        tree: &mut Working<impl Metric>,
        temperature: f64,
        rng: &mut Stream,
    ) -> bool {
        self.work += 1;
        let node = self.sampler.draw(rng);
        // The root has no other position.
        if tree.nodes[node as usize].parent == ANCHOR {
            return false;
        }
        tree.begin();
        // The journal makes a rejected move cheap to undo, so the tree is changed before the
        // decision.
        let (saved, sibling, visits) = tree.detach(node);
        self.work += visits;
        let levels = rng.random_range(1..=CLIMB);
        // The sibling has replaced the parent, so the climb starts there.
        let mut top = sibling;
        for _ in 0..levels {
            let above = tree.nodes[top as usize].parent;
            if above == ANCHOR {
                break;
            }
            top = above;
        }
        // Metropolis draws its random number first, so that positions above the resulting limit
        // need not be examined.
        let chance = 1.0 - rng.random::<f64>();
        let limit = saved * (1.0 - temperature * libm::log(chance));
        let item = &tree.nodes[node as usize];
        let aabb = item.aabb;
        let area = item.area;
        let target = self.best(tree, (&aabb, area), [top, sibling], limit);
        let accepted = target.is_some_and(|target| {
            let (added, visits) = tree.attach(node, target);
            self.work += visits;
            added < limit
        });
        if !accepted {
            tree.undo();
        }
        accepted
    }
}
