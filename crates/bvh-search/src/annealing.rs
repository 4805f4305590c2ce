//! Simulated annealing on single reinsertions: move one subtree to another place nearby, for better or for worse.
//!
//! Kirkpatrick, Gelatt & Vecchi 1983; Kensler 2008 anneals rotations, which are reinsertions over one or two levels.
//! Temperatures are relative to the area that taking the subtree out saves, so that one schedule suits nodes of all
//! sizes.

use crate::cooling::{self, Descent};
use crate::error::require;
use crate::start::Start;
use crate::starts::Starts;
use crate::stream::Stream;
use crate::working::{ANCHOR, Working};
use crate::{Problem, Run, Search, SearchError};
use bvh_core::{Bvh, PackedAabb};
use rand::RngExt;

/// What to move where, how to cool, and for how long.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// The move; `move` in specs.
    #[cfg_attr(feature = "serde", serde(rename = "move"))]
    pub step: Move,
    /// First temperature, relative to the area saved by the removal, above 0. Default 0.3.
    pub hot: f64,
    /// Last temperature, above 0 and not above `hot`. Default 0.003.
    pub cold: f64,
    /// Work per object, unless the budget has less. Default 10 000.
    pub work_per_object: u64,
    /// The builder of the start.
    pub start: Start,
}

impl Default for Config {
    fn default() -> Self {
        let start = Start::default();
        Self { step: Move::default(), hot: 0.3, cold: 0.003, work_per_object: 10_000, start }
    }
}

/// A move: a random subtree, more often one below a large node, is taken out; from its place some levels up, to the top
/// of the part in which it gets another place.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Move {
    /// Most levels up, at least 1. Default 12.
    pub climb: u32,
    /// Which place below the top. Default `best`.
    pub target: Target,
}

impl Default for Move {
    fn default() -> Self {
        Self { climb: 12, target: Target::Best }
    }
}

/// Which place a subtree gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Target {
    /// Where a random descent from the top ends, after as many levels as the climb at most.
    Random,
    /// The best of all but the one it had.
    Best,
}

impl Search for Config {
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        let climb = self.step.climb;
        require((1..u32::MAX).contains(&climb), "climb", climb.into(), "1 to 4294967294")?;
        let Self { hot, cold, work_per_object, .. } = *self;
        let descent = Descent { heat: [hot, cold], work_per_object, start: &self.start };
        descent.search(|| Mover::new(&self.step), problem, seed, run)
    }
}

/// Moves one subtree at a time.
#[derive(Debug)]
pub(crate) struct Mover<'a> {
    config: &'a Move,
    starts: Starts,
    /// Inner nodes whose children are to be looked at, with the growth of everything from the top down to and with them.
    stack: Vec<(u32, f64)>,
    work: u64,
}

impl<'a> Mover<'a> {
    pub fn new(config: &'a Move) -> Self {
        Self { config, starts: Starts::default(), stack: Vec::new(), work: 0 }
    }

    /// The cheapest place below `top`, itself included, for a detached item, but for that beside `sibling`; if any costs
    /// less than `limit`, not counting what grows above the top. Exact branch and bound, as [`crate::place`].
    #[inline(always)]
    fn best(
        &mut self,
        tree: &Working,
        (aabb, area): (&PackedAabb, f64),
        [top, sibling]: [u32; 2],
        limit: f64,
    ) -> Option<u32> {
        let (mut best, mut least) = (None, limit);
        let mut visits = 1;
        let mut look = |at: u32, growth: f64, least: &mut f64, stack: &mut Vec<(u32, f64)>| {
            let node = &tree.nodes[at as usize];
            let cost = growth + node.aabb.union(aabb).half_area();
            if cost < *least && at != sibling {
                *least = cost;
                best = Some(at);
            }
            let growth = cost - node.area;
            if !node.is_leaf() && growth + area < *least {
                stack.push((at, growth));
            }
        };
        look(top, 0.0, &mut least, &mut self.stack);
        while let Some((at, growth)) = self.stack.pop() {
            if growth + area < least {
                visits += 2;
                for child in tree.nodes[at as usize].children {
                    look(child, growth, &mut least, &mut self.stack);
                }
            }
        }
        self.work += visits;
        best
    }
}

impl cooling::Move for Mover<'_> {
    fn work(&self) -> u64 {
        self.work
    }

    fn starts(&mut self) -> &mut Starts {
        &mut self.starts
    }

    #[inline(always)]
    fn step(&mut self, tree: &mut Working, temperature: f64, rng: &mut Stream) -> bool {
        self.work += 1;
        let node = self.starts.draw(tree, rng);
        if tree.nodes[node as usize].parent == ANCHOR {
            return false;
        }
        tree.begin();
        let (saved, sibling, visits) = tree.detach(node);
        self.work += visits;
        let levels = rng.random_range(1..=self.config.climb);
        let mut top = sibling;
        for _ in 0..levels {
            let above = tree.nodes[top as usize].parent;
            if above == ANCHOR {
                break;
            }
            top = above;
        }
        // The dice of Metropolis are cast first: what would lead above the limit need not be looked at.
        let chance = 1.0 - rng.random::<f64>();
        let limit = saved * (1.0 - temperature * libm::log(chance));
        let target = match self.config.target {
            Target::Random => {
                let mut at = top;
                for _ in 0..rng.random_range(0..=levels + 1) {
                    if tree.nodes[at as usize].is_leaf() {
                        break;
                    }
                    at = tree.nodes[at as usize].children[usize::from(rng.random::<bool>())];
                    self.work += 1;
                }
                Some(at).filter(|&at| at != sibling)
            }
            Target::Best => {
                let item = &tree.nodes[node as usize];
                let (aabb, area) = (item.aabb, item.area);
                self.best(tree, (&aabb, area), [top, sibling], limit)
            }
        };
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
