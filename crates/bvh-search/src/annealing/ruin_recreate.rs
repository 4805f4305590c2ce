//! Annealed ruin and recreate: a move removes several related subtrees and inserts each where it
//! costs least. Simulated annealing accepts or rejects the result.
//!
//! Schrimpf et al. 2000 (ruin and recreate); Kirkpatrick, Gelatt & Vecchi 1983; Shaw 1998 (related
//! removal). Temperatures are relative to an area of the move, so one schedule suits nodes of all
//! sizes.

use super::layout::Layout;
use super::metropolis::Mover;
use super::node_sampler::NodeSampler;
use super::schedule::anneal_initial;
use super::side::Side;
use crate::run::{Found, Problem, Run, Stream};
use crate::tree::{ANCHOR, Metric, Node, PositionSearch, Scope, Working, search_by_metric};
use crate::tuning::{
    DEARER_BY_AREA, LAYER_THICKNESS, LAYERS, LAYOUT_HEAT, NEARBY, RUIN_LEVELS, RUINED_SUBTREES,
    SUBTREES_IN_A_LAYER,
};
use rand::RngExt;
use rand::seq::SliceRandom;

bvh_config::config! {
    /// The amount of work.
    pub struct Config {
        /// Work per object, unless the budget has less.
        work_per_object: u64 = 10_000;
    }
}

/// First and last temperature, relative to the area that the removal saves. They suit 8000 nodes of
/// work per object or more; less work needs a proportionally lower first temperature.
const HEAT: [f64; 2] = [0.1, 0.003];

/// The area that temperatures are relative to, so that one schedule suits nodes of all sizes.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Scale {
    /// The area that the removal saves.
    Saved,
    /// The area of the top of the ruined part.
    Top,
}

search_by_metric!(Config);

impl Config {
    fn search_by(&self, metric: impl Metric, problem: &Problem, seed: u64, run: &mut Run) -> Found {
        let Self { work_per_object } = *self;
        let length =
            work_per_object.min(run.left().work / problem.boxes.len().max(1) as u64) as f64;
        let mover = || RuinMover::new(Scale::Saved, length, false);
        anneal_initial(mover, HEAT, work_per_object, metric, problem, seed, run)
    }
}

/// Makes ruin-and-recreate moves. The *top* of the ruined part is some levels above a random node,
/// more often a node below a large one. The move removes either the ends of several random descents
/// from the top, or everything in a layer at one side of the top's box, without which that box
/// cannot shrink. Then every removed subtree gets the best position.
#[derive(Debug)]
pub(crate) struct RuinMover {
    scale: Scale,
    sampler: NodeSampler,
    search: PositionSearch,
    side: Side,
    removed: Removed,
    /// The layout whose cost judges the moves, unless the tree's area does.
    pub(super) layout: Option<Layout>,
    /// Nodes visited outside of the position search.
    work: u64,
}

/// The subtrees that a move has removed.
#[derive(Debug, Default)]
struct Removed {
    /// Roots of the subtrees, each with its former sibling.
    roots: Vec<(u32, u32)>,
    /// The area that their removal saves.
    saved: f64,
    /// The total area of the roots: a lower bound of the cost of their new positions.
    least: f64,
}

impl Removed {
    fn clear(&mut self) {
        self.roots.clear();
        (self.saved, self.least) = (0.0, 0.0);
    }

    /// Removes a subtree. Returns the number of nodes visited.
    #[inline(always)]
    fn take(&mut self, tree: &mut Working<impl Metric>, node: u32) -> u64 {
        let (saved, sibling, visits) = tree.detach(node);
        self.saved += saved;
        self.least += tree.nodes[node as usize].area;
        self.roots.push((node, sibling));
        visits
    }
}

impl RuinMover {
    /// Builds a mover for an annealing run of `length` work per object, judged by the cost of the
    /// wide layout or by the tree's area.
    pub fn new(scale: Scale, length: f64, by_layout: bool) -> Self {
        let (search, side, removed) = Default::default();
        let layout = by_layout.then(Layout::default);
        Self {
            scale,
            sampler: NodeSampler::for_work(length),
            search,
            side,
            removed,
            layout,
            work: 0,
        }
    }

    /// Removes scattered subtrees from the scope, up to one level further down than the move has
    /// climbed. The scope keeps a root.
    #[inline(always)]
    fn scattered(
        &mut self,
        tree: &mut Working<impl Metric>,
        scope: Scope,
        levels: u32,
        rng: &mut Stream,
    ) {
        for _ in 0..rng.random_range(1..=RUINED_SUBTREES) {
            let mut node = scope.root(tree);
            // The scope has shrunk to one leaf, which stays as its root.
            if tree.nodes[node as usize].is_leaf() {
                break;
            }
            for _ in 0..rng.random_range(1..=levels + 1) {
                if tree.nodes[node as usize].is_leaf() {
                    break;
                }
                node = tree.nodes[node as usize].children[usize::from(rng.random::<bool>())];
            }
            self.work += self.removed.take(tree, node);
        }
    }

    /// Removes a layer at one side of the scope's box. The scope keeps a root.
    #[inline(always)]
    fn layer(&mut self, tree: &mut Working<impl Metric>, scope: Scope, rng: &mut Stream) {
        let top = scope.root(tree);
        if tree.nodes[top as usize].is_leaf() {
            return;
        }
        self.work += self.side.find(tree, top, LAYER_THICKNESS, SUBTREES_IN_A_LAYER, rng);
        for &node in &self.side.roots {
            if scope.root(tree) != node {
                self.work += self.removed.take(tree, node);
            }
        }
    }
}

impl Mover for RuinMover {
    fn work(&self) -> u64 {
        self.work + self.search.visits + self.layout.as_ref().map_or(0, |layout| layout.visits)
    }

    fn begin(&mut self, tree: &Working<impl Metric>, near: Vec<u32>) {
        self.sampler.begin(tree, near);
        if let Some(layout) = &mut self.layout {
            layout.fill(tree);
        }
    }

    #[inline(always)]
    fn step(
        &mut self,
        tree: &mut Working<impl Metric>,
        temperature: f64,
        rng: &mut Stream,
    ) -> bool {
        let mut top = self.sampler.draw(rng);
        let levels = rng.random_range(1..=RUIN_LEVELS);
        let mut above = tree.nodes[top as usize].parent;
        for _ in 0..levels {
            if above == ANCHOR {
                break;
            }
            top = above;
            above = tree.nodes[top as usize].parent;
        }
        let scope = Scope::of(tree, above, top);
        let Node { aabb: top_box, area: top_area, .. } = tree.nodes[top as usize];
        tree.begin();
        self.removed.clear();
        if rng.random::<f64>() < LAYERS {
            self.layer(tree, scope, rng);
        } else {
            self.scattered(tree, scope, levels, rng);
        }
        let near = rng.random::<f64>() < NEARBY;
        // Every removed subtree is inside the top's former box, and a scope must contain the boxes
        // of its items.
        let positions = if near { scope.around(tree, &top_box) } else { Scope::ALL };
        let Removed { roots, saved, least } = &mut self.removed;
        // The order decides which subtree chooses first; a fixed order would always favour the same
        // ones.
        roots.shuffle(rng);
        // Metropolis draws its random number first, so that a move above the resulting limit need
        // not be finished.
        let chance = 1.0 - rng.random::<f64>();
        let scale = match self.scale {
            Scale::Saved => *saved,
            Scale::Top => top_area,
        };
        let worse = -temperature * scale * libm::log(chance);
        // A tree of larger area may have a cheaper layout, so the area only rejects moves that are
        // far above the limit.
        let mut limit =
            *saved + if self.layout.is_some() { DEARER_BY_AREA * worse } else { worse } - *least;
        for &(node, first) in &*roots {
            let item = &tree.nodes[node as usize];
            let aabb = item.aabb;
            let area = item.area;
            // `least` covered this subtree with its own area; its exact position replaces that
            // bound now.
            limit += area;
            let Some(position) =
                self.search.position_of_detached(tree, positions, (&aabb, area), first, limit)
            else {
                tree.undo();
                return false;
            };
            self.work += tree.attach(node, position.sibling).1;
            limit -= position.cost;
        }
        let most = LAYOUT_HEAT * worse;
        if self.layout.as_mut().is_some_and(|layout| !layout.accepts(tree, most)) {
            tree.undo();
            return false;
        }
        true
    }
}
