//! Annealed ruin and recreate: take several related subtrees out, put each back where it costs least, and accept the
//! result as in simulated annealing.
//!
//! Schrimpf et al. 2000 (ruin and recreate); Kirkpatrick, Gelatt & Vecchi 1983; Shaw 1998 (related removal).
//! Temperatures are relative to the area of the ruined part, so that one schedule suits nodes of all sizes.

use crate::error::require;
use crate::incumbent::Incumbent;
use crate::place::PlaceSearch;
use crate::reinsertion;
use crate::stream::{Stream, stream};
use crate::vector::with_vector_instructions;
use crate::working::{ANCHOR, NONE, Working};
use crate::{Observer, Problem, Run, Search, SearchError};
use bvh_build::muller_fellner;
use bvh_core::Bvh;
use rand::RngExt;
use rand::seq::SliceRandom;

/// What to ruin and how to cool.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// Most levels from a random node up to the top of the ruined part, at least 1. Default 8.
    pub climb: u32,
    /// Most subtrees taken out at once, at least 1. Default 11.
    pub removed: u32,
    /// First temperature, relative to the area of the ruined part; 0 or more. Default 0.2.
    pub hot: f64,
    /// Last temperature, above 0 and not above `hot`. Default 0.003.
    pub cold: f64,
    /// Work per object, unless the budget has less. Default 20 000.
    pub work_per_object: u64,
    /// The builder of the start. Default as for reinsertion.
    pub start: muller_fellner::Config,
}

impl Default for Config {
    fn default() -> Self {
        Self { climb: 8, removed: 11, hot: 0.2, cold: 0.003, work_per_object: 20_000, start: reinsertion::start() }
    }
}

impl Config {
    pub(crate) fn check(&self) -> Result<(), SearchError> {
        require(self.climb >= 1, "climb", self.climb.into(), "1 or more")?;
        require(self.removed >= 1, "removed", self.removed.into(), "1 or more")?;
        require(self.hot.is_finite() && self.hot > 0.0, "hot", self.hot, "above 0")?;
        require(self.cold > 0.0 && self.cold <= self.hot, "cold", self.cold, "above 0, not above hot")
    }
}

impl Search for Config {
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        self.check()?;
        let (mut best, mut tree) = Incumbent::build(&self.start, problem, run)?;
        let own = self.work_per_object.saturating_mul(problem.boxes.len() as u64);
        let work = run.work_left().map_or(own, |left| left.min(own));
        anneal(self, &mut tree, work, &mut |round| (seed, round), &mut best, run);
        Ok(best.tree)
    }
}

fn env(name: &str, default: f64) -> f64 {
    std::env::var(name).ok().and_then(|v| v.parse().ok()).unwrap_or(default)
}

/// Cools `tree` from hot to cold over `work`, offering it to `best` along the way.
pub(crate) fn anneal(
    config: &Config,
    tree: &mut Working,
    work: u64,
    streams: &mut dyn FnMut(u64) -> (u64, u64),
    best: &mut Incumbent,
    run: &mut Run,
) {
    let n = tree.objects();
    if n < 3 {
        return;
    }
    let rounds = (work / (env("RPO", 64.0) as u64 * n as u64)).clamp(4, 100);
    let factor = config.cold / config.hot;
    let at = |fraction: f64| config.hot * libm::pow(factor, fraction);
    for round in 0..rounds {
        let (seed, index) = streams(round);
        let mut rng = stream(seed, index << 32);
        let share = work / rounds;
        let size = env("PIECE", 2000.0) * libm::exp2(rng.random_range(-1.0..1.0));
        let limit = (size as usize).min(n.div_ceil(env("MINP", 1.0) as usize));
        let (mut top, mut pieces) = tree.split(limit);
        let heat = [at(round as f64 / rounds as f64), at((round + 1) as f64 / rounds as f64)];
        let top_weight = env("TOPW", 4.0) * top.objects() as f64;
        let total = n as f64 + top_weight;
        let observer = run.observer();
        let one = |tree: &mut Working, weight: f64, index: u64| {
            let mut rng = stream(seed, index);
            let quota = (share as f64 * (weight / total)) as u64;
            cool(config, tree, heat, quota, &mut rng, observer)
        };
        let mut tally = Tally::default();
        if top.objects() > 2 {
            tally.add(one(&mut top, top_weight, (index << 32) + 1));
        }
        #[cfg(feature = "rayon")]
        let done: Vec<Tally> = {
            use rayon::prelude::*;
            pieces.par_iter_mut().enumerate().map(|(i, piece)| one(piece, piece.objects() as f64, (index << 32) + 2 + i as u64)).collect()
        };
        #[cfg(not(feature = "rayon"))]
        let done: Vec<Tally> = pieces.iter_mut().enumerate().map(|(i, piece)| one(piece, piece.objects() as f64, (index << 32) + 2 + i as u64)).collect();
        done.into_iter().for_each(|done| tally.add(done));
        *tree = Working::join(&top, &pieces);
        run.count(tally.moves, tally.work);
        best.offer(tree, run);
        if std::env::var("TRACE").is_ok() {
            eprintln!("round {round} heat {:.4} area {:.6e} moves {} accepted {} work {}", heat[0], tree.internal_area(), tally.moves, tally.accepted, tally.work);
        }
        if run.stopped().is_some() {
            break;
        }
    }
    let swept = reinsertion::to_local_optimum(tree, u64::MAX, run.observer());
    run.count(swept.tried, swept.work);
    best.offer(tree, run);
}

/// What was done.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    pub moves: u64,
    pub accepted: u64,
    pub work: u64,
}

impl Tally {
    fn add(&mut self, other: Self) {
        self.moves += other.moves;
        self.accepted += other.accepted;
        self.work += other.work;
    }
}

with_vector_instructions! {
    /// Moves until `quota` work is done, while the temperature falls geometrically from the first to the second.
    cool = cool_plain(config: &Config, tree: &mut Working, heat: [f64; 2], quota: u64, rng: &mut Stream,
        observer: &dyn Observer) -> Tally
}

#[inline(always)]
fn cool_plain(config: &Config, tree: &mut Working, heat: [f64; 2], quota: u64, rng: &mut Stream, observer: &dyn Observer) -> Tally {
    let mut tally = Tally::default();
    if tree.objects() < 3 {
        return tally;
    }
    let mut mover = Mover::default();
    let mut temperature = heat[0];
    loop {
        if tally.moves % 64 == 0 {
            tally.work = mover.work + mover.search.visits;
            if tally.work >= quota || observer.cancelled() {
                break;
            }
            temperature = heat[0] * libm::pow(heat[1] / heat[0], tally.work as f64 / quota as f64);
        }
        tally.accepted += u64::from(mover.step(config, tree, temperature, rng));
        tally.moves += 1;
    }
    tally
}

/// Buffers of moves.
#[derive(Debug, Default)]
struct Mover {
    search: PlaceSearch,
    /// Roots of the subtrees taken out, each with the sibling it had.
    out: Vec<(u32, u32)>,
    work: u64,
}

impl Mover {
    /// One move: ruins, recreates, and takes it back unless accepted. Returns whether it was.
    #[inline(always)]
    fn step(&mut self, config: &Config, tree: &mut Working, temperature: f64, rng: &mut Stream) -> bool {
        let mut top = rng.random_range(1..tree.nodes.len() as u32);
        let levels = rng.random_range(1..=config.climb);
        for _ in 0..levels {
            let parent = tree.nodes[top as usize].parent;
            if parent == ANCHOR {
                break;
            }
            top = parent;
        }
        if tree.nodes[top as usize].is_leaf() {
            return false;
        }
        let anchor = tree.nodes[top as usize].parent;
        let side = usize::from(tree.nodes[anchor as usize].children[0] != top);
        let scale = tree.nodes[top as usize].area;
        let threshold = -temperature * scale * libm::log(1.0 - rng.random::<f64>());
        tree.begin();
        self.out.clear();
        let mut saved = 0.0;
        let mut least = 0.0;
        for _ in 0..rng.random_range(1..=config.removed) {
            let top = tree.nodes[anchor as usize].children[side];
            if tree.nodes[top as usize].is_leaf() {
                break;
            }
            let mut node = top;
            for _ in 0..rng.random_range(1..=levels + 1) {
                let Some(children) = inner(tree, node) else { break };
                node = children[rng.random_range(0..2usize)];
            }
            let (less, sibling, visits) = tree.detach(node, anchor);
            self.work += visits;
            saved += less;
            least += tree.nodes[node as usize].area;
            self.out.push((node, sibling));
        }
        self.out.shuffle(rng);
        let mut limit = saved + threshold - least;
        for &(node, first) in &self.out {
            let item = &tree.nodes[node as usize];
            let (aabb, area) = (item.aabb, item.area);
            limit += area;
            let top = tree.nodes[anchor as usize].children[side];
            let place = self.search.detached(tree, (&aabb, area), first, (anchor, top), limit);
            let Some(place) = place else {
                tree.undo();
                return false;
            };
            self.work += tree.attach(node, place.beside, anchor).1;
            limit -= place.cost;
        }
        true
    }
}

#[inline(always)]
fn inner(tree: &Working, node: u32) -> Option<[u32; 2]> {
    Some(tree.nodes[node as usize].children).filter(|children| children[0] != NONE)
}
