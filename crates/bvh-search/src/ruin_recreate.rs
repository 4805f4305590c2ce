//! Annealed ruin and recreate: take several related subtrees out, put each back where it costs least, and accept the
//! result as in simulated annealing.
//!
//! Schrimpf et al. 2000 (ruin and recreate); Kirkpatrick, Gelatt & Vecchi 1983; Shaw 1998 (related removal).
//! Temperatures are relative to an area of the move, so that one schedule suits nodes of all sizes.

use crate::cooling::{Descent, Move};
use crate::error::require;
use crate::place::{PlaceSearch, Region};
use crate::slab::Slab;
use crate::start::Start;
use crate::starts::Starts;
use crate::stream::Stream;
use crate::working::{ANCHOR, Node, Working};
use crate::{Problem, Run, Search, SearchError};
use bvh_core::Bvh;
use rand::RngExt;
use rand::seq::SliceRandom;

/// What to ruin, how to cool, and for how long.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// The move.
    pub ruin: Ruin,
    /// First temperature, relative to the move's `scale`, above 0. Default 0.1, which suits 8000 nodes of
    /// work per object or more; less work wants a lower one, in proportion.
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
        Self { ruin: Ruin::default(), hot: 0.1, cold: 0.003, work_per_object: 10_000, start: Start::default() }
    }
}

/// A move: from a random node, more often one below a large node, some levels up, and from there several random descents,
/// each to a subtree taken out; or all that lies in a slab at one side of the box there, which alone lets the box shrink.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Ruin {
    /// Most levels from the random node up to the top of the ruined part, at least 1. Default 8.
    pub climb: u32,
    /// Most subtrees taken out by random descents, at least 1. Default 14.
    pub removed: u32,
    /// The part of the moves that take a slab out, 0 to 1. Default 0.2.
    pub slabs: f64,
    /// The thickest slab, as a part of the box, 0 to 1. Default 0.6.
    pub thickness: f64,
    /// Most subtrees of a slab: there is no move if it has more. At least 1. Default 24.
    pub most: u32,
    /// The part of the moves that look for places only near, 0 to 1: in the smallest subtree with the ruined part and
    /// more whose box holds what that has held. Further up they seldom find any, and there are a quarter more moves in
    /// the same work. Default 0.6.
    pub near: f64,
    /// What temperatures are relative to. Default `saved`.
    pub scale: Scale,
}

/// What the temperature of a move is relative to, so that one schedule suits nodes of all sizes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum Scale {
    /// The area that the removal saves.
    #[default]
    Saved,
    /// The area of the top of the ruined part.
    Top,
}

impl Default for Ruin {
    fn default() -> Self {
        Self { climb: 8, removed: 14, slabs: 0.2, thickness: 0.6, most: 24, near: 0.6, scale: Scale::Saved }
    }
}

impl Ruin {
    pub(crate) fn check(&self) -> Result<(), SearchError> {
        require(self.climb >= 1 && self.climb < u32::MAX, "climb", self.climb.into(), "1 to 4294967294")?;
        require(self.removed >= 1, "removed", self.removed.into(), "1 or more")?;
        require((0.0..=1.0).contains(&self.slabs), "slabs", self.slabs, "0 to 1")?;
        require((0.0..=1.0).contains(&self.thickness), "thickness", self.thickness, "0 to 1")?;
        require((0.0..=1.0).contains(&self.near), "near", self.near, "0 to 1")?;
        require(self.most >= 1, "most", self.most.into(), "1 or more")
    }
}

impl Search for Config {
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        self.ruin.check()?;
        let Self { hot, cold, work_per_object, .. } = *self;
        let descent = Descent { heat: [hot, cold], work_per_object, start: &self.start };
        let length = work_per_object.min(run.left().work / problem.boxes.len().max(1) as u64) as f64;
        descent.search(|| Mover::new(&self.ruin, length), problem, seed, run)
    }
}

/// Ruins, recreates, accepts or not.
#[derive(Debug)]
pub(crate) struct Mover<'a> {
    ruin: &'a Ruin,
    starts: Starts,
    search: PlaceSearch,
    slab: Slab,
    out: Out,
    /// Nodes visited outside of the search.
    work: u64,
}

/// What a move has taken out.
#[derive(Debug, Default)]
struct Out {
    /// Roots of the subtrees, each with the sibling it had.
    roots: Vec<(u32, u32)>,
    /// The area that this saves.
    saved: f64,
    /// The area of the roots: what they will cost at least.
    least: f64,
}

impl Out {
    fn clear(&mut self) {
        self.roots.clear();
        (self.saved, self.least) = (0.0, 0.0);
    }

    /// Takes a subtree out. Returns the nodes visited.
    #[inline(always)]
    fn take(&mut self, tree: &mut Working, node: u32) -> u64 {
        let (saved, sibling, visits) = tree.detach(node);
        self.saved += saved;
        self.least += tree.nodes[node as usize].area;
        self.roots.push((node, sibling));
        visits
    }
}

impl<'a> Mover<'a> {
    /// Of a descent of so much work per object.
    pub fn new(ruin: &'a Ruin, length: f64) -> Self {
        let (search, slab, out) = Default::default();
        Self { ruin, starts: Starts::of_work(length), search, slab, out, work: 0 }
    }

    /// Takes subtrees of the region out, up to one level further down than the move has climbed. It always has a root.
    #[inline(always)]
    fn scattered(&mut self, tree: &mut Working, region: Region, levels: u32, rng: &mut Stream) {
        for _ in 0..rng.random_range(1..=self.ruin.removed) {
            let mut node = region.root(tree);
            if tree.nodes[node as usize].is_leaf() {
                break;
            }
            for _ in 0..rng.random_range(1..=levels + 1) {
                if tree.nodes[node as usize].is_leaf() {
                    break;
                }
                node = tree.nodes[node as usize].children[usize::from(rng.random::<bool>())];
            }
            self.work += self.out.take(tree, node);
        }
    }

    /// Takes a slab of the region's box out, but leaves the region something.
    #[inline(always)]
    fn slab(&mut self, tree: &mut Working, region: Region, rng: &mut Stream) {
        let Ruin { thickness, most, .. } = *self.ruin;
        let top = region.root(tree);
        if tree.nodes[top as usize].is_leaf() {
            return;
        }
        self.work += self.slab.find(tree, top, thickness, most as usize, rng);
        for &node in &self.slab.roots {
            if region.root(tree) != node {
                self.work += self.out.take(tree, node);
            }
        }
    }
}

impl Move for Mover<'_> {
    fn work(&self) -> u64 {
        self.work + self.search.visits
    }

    fn starts(&mut self) -> &mut Starts {
        &mut self.starts
    }

    #[inline(always)]
    fn step(&mut self, tree: &mut Working, temperature: f64, rng: &mut Stream) -> bool {
        let ruin = self.ruin;
        let mut top = self.starts.draw(tree, rng);
        let levels = rng.random_range(1..=ruin.climb);
        let mut above = tree.nodes[top as usize].parent;
        for _ in 0..levels {
            if above == ANCHOR {
                break;
            }
            top = above;
            above = tree.nodes[top as usize].parent;
        }
        let region = Region::of(tree, above, top);
        let Node { aabb: top_box, area: top_area, .. } = tree.nodes[top as usize];
        tree.begin();
        self.out.clear();
        if rng.random::<f64>() < ruin.slabs {
            self.slab(tree, region, rng);
        } else {
            self.scattered(tree, region, levels, rng);
        }
        let places = if rng.random::<f64>() < ruin.near { region.around(tree, &top_box) } else { Region::ALL };
        let Out { roots, saved, least } = &mut self.out;
        roots.shuffle(rng);
        // The dice of Metropolis are cast first: what would lead above the limit need not be finished.
        let chance = 1.0 - rng.random::<f64>();
        let scale = match ruin.scale {
            Scale::Saved => *saved,
            Scale::Top => top_area,
        };
        let mut limit = *saved - temperature * scale * libm::log(chance) - *least;
        for &(node, first) in &*roots {
            let item = &tree.nodes[node as usize];
            let (aabb, area) = (item.aabb, item.area);
            limit += area;
            let Some(place) = self.search.detached(tree, places, (&aabb, area), first, limit) else {
                tree.undo();
                return false;
            };
            self.work += tree.attach(node, place.beside).1;
            limit -= place.cost;
        }
        true
    }
}
