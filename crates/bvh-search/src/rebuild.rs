//! Rebuilding: find nodes that look badly split, build the hierarchy below them anew with other splits, keep what is
//! better.
//!
//! Ng & Trifonov 2003, section 5: 'If at some node it appears that a wrong decision has been made so that the two
//! children are highly imbalance and one is contributing significantly to the overall cost of the hierarchy, a
//! different selection point can be made and this part of the hierarchy resembling a subtree can be rebuilt.'
//!
//! Differs from the paper: nothing is stored at the nodes; the other splits are those of GRASP's randomised
//! construction; what is rebuilt is led to a local optimum before it is compared, and its nodes once more among all
//! others after, which makes the whole an iterated local search (Lourenço, Martin & Stützle 2003).

use crate::error::require;
use crate::grasp::{Candidates, Randomised};
use crate::incumbent::Incumbent;
use crate::reinsertion::{self, TOLERANCE};
use crate::start::{Start, construction};
use crate::stream::{Stream, stream};
use crate::working::{ANCHOR, Working};
use crate::{LocalSearch, Observer, Problem, Quota, Run, Search, SearchError, Tally};
use bvh_build::top_down::Workspace;
use bvh_build::{Check, Presorted, muller_fellner};
use bvh_core::{Aabb, Bvh};
use rand::RngExt;

/// Which subtrees to rebuild, how, and for how long.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Config {
    /// Most objects of a rebuilt subtree, 3 to 1 000 000. Default 200.
    pub objects: u32,
    /// Of how many random nodes that is taken whose children have the most area, at least 1. Default 2. More, or their
    /// area relative to the node's, found no better nodes in measurements, and 1 hardly worse ones.
    pub tournament: u32,
    /// Most levels from there up to the root of what is rebuilt, since a bad split shows below the one that caused it.
    /// Default 6.
    pub climb: u32,
    /// The splits that may be chosen, as in [`grasp`](crate::grasp). Default `axis_best`.
    pub candidates: Candidates,
    /// The probability, 0 to 1, of taking one of them other than the best. Default 0.3.
    pub noise: f64,
    /// The heuristic that ranks splits. Default as for the start.
    pub construction: muller_fellner::Config,
    /// What is done to a rebuilt subtree before it is compared. Default `reinsertion`.
    pub local_search: LocalSearch,
    /// Work per object, unless the budget has less. Default 10 000.
    pub work_per_object: u64,
    /// The builder of the start, which is first led to a local optimum.
    pub start: Start,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            objects: 200,
            tournament: 2,
            climb: 6,
            candidates: Candidates::AxisBest,
            noise: 0.3,
            construction: construction(),
            local_search: LocalSearch::Reinsertion,
            work_per_object: 10_000,
            start: Start::default(),
        }
    }
}

impl Search for Config {
    /// Disjoint subtrees are rebuilt in parallel, each with a stream of its own.
    fn search(&self, problem: &Problem, seed: u64, run: &mut Run) -> Result<Bvh, SearchError> {
        require((3..=1_000_000).contains(&self.objects), "objects", self.objects.into(), "3 to 1000000")?;
        require(self.tournament >= 1, "tournament", self.tournament.into(), "1 or more")?;
        require((0.0..=1.0).contains(&self.noise), "noise", self.noise, "0 to 1")?;
        self.candidates.check()?;
        self.construction.check()?;
        let (mut best, mut tree) = Incumbent::build(&self.start, problem, run)?;
        let n = tree.objects() as u64;
        if n < 3 {
            return Ok(best.tree);
        }
        run.count(reinsertion::to_local_optimum(&mut tree, run.left(), run.observer()));
        best.offer(&tree, run);
        let (mut rng, mut number) = (stream(seed, 0), 0);
        let mut own = self.work_per_object.saturating_mul(n);
        // What a batch may take; it is not begun with less.
        let enough = BATCH * WORK_PER_OBJECT * n.min(self.objects.into());
        while run.stopped().is_none() && own.min(run.left().work) >= enough {
            tree.sort_in_preorder();
            let mut round = Tally::default();
            while round.work < n * WORK_PER_OBJECT && !run.observer().cancelled() {
                let left = run.left().less(&round);
                let quota = left.at_most(own.saturating_sub(round.work));
                if quota.work < enough || quota.moves == 0 {
                    break;
                }
                let parts = self.select(&tree, &mut rng, quota.moves.min(BATCH), &mut round);
                // The selection draws from stream 0.
                let first = number + 1;
                let share = Quota { work: quota.work / (2 * BATCH), ..Quota::ENDLESS };
                let construct = |at: usize| {
                    self.construct(&tree, &parts[at], share, stream(seed, first + at as u64), run.observer())
                };
                let found = each(parts.len(), construct)?;
                number += parts.len() as u64;
                let limit = Quota { work: quota.work / 2, ..Quota::ENDLESS };
                round += replace(&mut tree, &parts, &found, limit, run.observer());
            }
            own = own.saturating_sub(round.work);
            run.count(round);
            best.offer(&tree, run);
        }
        Ok(best.tree)
    }
}

/// Subtrees rebuilt at once.
const BATCH: u64 = 4;

/// Work per object after which nodes are laid out anew, and about what a rebuilding takes per object of it.
const WORK_PER_OBJECT: u64 = 64;

/// A subtree: its inner nodes, the root first, and their total area; its leaves.
#[derive(Debug, Default)]
struct Part {
    inner: Vec<u32>,
    leaves: Vec<u32>,
    area: f64,
}

impl Part {
    /// The subtree below `root`, unless it has more than `most` leaves.
    fn below(tree: &Working, root: u32, most: u32) -> Option<Self> {
        let mut part = Self::default();
        let mut stack = vec![root];
        while let Some(at) = stack.pop() {
            let node = &tree.nodes[at as usize];
            if node.is_leaf() {
                part.leaves.push(at);
            } else {
                part.area += node.area;
                part.inner.push(at);
                stack.extend([node.children[1], node.children[0]]);
            }
            // There will be one leaf more than inner nodes.
            if part.inner.len() >= most as usize {
                return None;
            }
        }
        Some(part)
    }
}

impl Config {
    /// Picks `picks` times and returns the disjoint ones of suitable size.
    fn select(&self, tree: &Working, rng: &mut Stream, picks: u64, tally: &mut Tally) -> Vec<Part> {
        let mut parts: Vec<Part> = Vec::new();
        for _ in 0..picks {
            tally.moves += 1;
            tally.work += u64::from(self.tournament);
            let mut root = (-1.0, ANCHOR);
            for _ in 0..self.tournament {
                let at = rng.random_range(1..tree.nodes.len() as u32);
                let contribution = contribution(tree, at);
                if contribution > root.0 {
                    root = (contribution, at);
                }
            }
            let mut found = None;
            let mut at = root.1;
            for _ in 0..=rng.random_range(0..=self.climb) {
                let Some(part) = Part::below(tree, at, self.objects) else { break };
                tally.work += part.inner.len() as u64;
                found = Some(part);
                at = tree.nodes[at as usize].parent;
                if at == ANCHOR {
                    break;
                }
            }
            let Some(part) = found.filter(|part| part.leaves.len() >= 3) else { continue };
            // Of two subtrees that have a leaf in common, one has the other's root.
            let holds = |one: &Part, other: &Part| one.inner.contains(&other.inner[0]);
            if !parts.iter().any(|other| holds(other, &part) || holds(&part, other)) {
                parts.push(part);
            }
        }
        parts
    }

    /// Another tree over the leaves of a part, if it is better, and what that took.
    fn construct(
        &self,
        tree: &Working,
        part: &Part,
        quota: Quota,
        rng: Stream,
        observer: &dyn Observer,
    ) -> Result<(Option<Working>, Tally), SearchError> {
        let boxes: Vec<Aabb> =
            part.leaves.iter().map(|&leaf| Aabb::from(&tree.nodes[leaf as usize].aabb)).collect();
        let mut rule = Randomised::new(self.candidates, Some(self.noise), rng);
        let mut other = Bvh::default();
        let scene = Presorted::new(&boxes)?;
        self.construction.construct(&scene, &mut rule, &mut Workspace::default(), &mut other);
        let mut other = Working::from_bvh(&other, &boxes)?;
        let mut tally = self.local_search.descend(&mut other, quota, observer);
        tally = Tally { moves: 0, kept: 0, work: tally.work + 2 * boxes.len() as u64 };
        let better = other.area() < part.area * (1.0 - TOLERANCE);
        Ok((better.then_some(other), tally))
    }
}

/// How much the children of a node contribute to the total area. Leaves have none.
fn contribution(tree: &Working, at: u32) -> f64 {
    let node = &tree.nodes[at as usize];
    if node.is_leaf() { 0.0 } else { node.children.iter().map(|&child| tree.nodes[child as usize].area).sum() }
}

/// What `construct` finds for each of so many parts.
fn each<T: Send>(
    parts: usize,
    construct: impl Fn(usize) -> Result<T, SearchError> + Send + Sync,
) -> Result<Vec<T>, SearchError> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        (0..parts).into_par_iter().map(construct).collect()
    }
    #[cfg(not(feature = "rayon"))]
    (0..parts).map(construct).collect()
}

/// Puts in what was found, then tries all its nodes in all places once.
fn replace(
    tree: &mut Working,
    parts: &[Part],
    found: &[(Option<Working>, Tally)],
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    let (mut total, mut order) = (Tally::default(), Vec::new());
    for (part, (other, tally)) in parts.iter().zip(found) {
        total += *tally;
        if let Some(other) = other {
            tree.begin();
            graft(tree, part, other);
            total.kept += 1;
            total.work += 2 * part.leaves.len() as u64;
            order.extend(part.inner.iter().chain(&part.leaves));
        }
    }
    total.work += reinsertion::sweep(tree, &order, quota, observer).work;
    total
}

/// Gives a part the shape of a tree over its leaves.
fn graft(tree: &mut Working, part: &Part, shape: &Working) {
    let order = shape.preorder();
    let mut new = vec![ANCHOR; shape.nodes.len()];
    let mut inner = part.inner.iter();
    for &at in &order {
        let node = &shape.nodes[at as usize];
        new[at as usize] = if node.is_leaf() {
            part.leaves[node.children[1] as usize]
        } else {
            inner.next().copied().unwrap_or(ANCHOR) // there are as many
        };
    }
    for &at in order.iter().rev() {
        let node = &shape.nodes[at as usize];
        if !node.is_leaf() {
            tree.join(new[at as usize], node.children.map(|child| new[child as usize]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scatter::{built, scatter};
    use bvh_build::median_cut;
    use bvh_core::validate;

    #[test]
    fn grafting_changes_the_part_alone_and_areas_stay_exact() {
        let boxes = scatter(400);
        let mut tree = built(&median_cut::Config::default(), &boxes);
        let (config, mut rng) = (Config { objects: 50, ..Config::default() }, stream(1, 0));
        let (mut kept, begin) = (0, tree.area());
        for number in 0..300 {
            let parts = config.select(&tree, &mut rng, 4, &mut Tally::default());
            let before = tree.area();
            for part in &parts {
                let found = config.construct(&tree, part, Quota::ENDLESS, stream(1, number + 1), &()).unwrap();
                let Some(other) = found.0 else { continue };
                tree.begin();
                graft(&mut tree, part, &other);
                let after = Part::below(&tree, part.inner[0], 50).unwrap();
                assert!((after.area - other.area()).abs() <= 1e-12 * other.area());
                let sorted = |leaves: &[u32]| {
                    let mut leaves = leaves.to_vec();
                    leaves.sort_unstable();
                    leaves
                };
                assert_eq!(sorted(&after.leaves), sorted(&part.leaves));
                kept += 1;
            }
            let area = tree.internal_area();
            assert!((tree.area() - area).abs() <= 1e-12 * area && tree.area() <= before);
        }
        assert!(kept > 1 && tree.area() < begin, "{kept}");
        let found = tree.to_bvh();
        validate(&found, &boxes).unwrap();
        assert!(found.is_tight(&boxes));
    }

    #[test]
    fn parts_of_one_batch_have_no_leaf_in_common() {
        let boxes = scatter(100);
        let tree = built(&Config::default().start, &boxes);
        let (config, mut rng) = (Config { objects: 30, ..Config::default() }, stream(1, 0));
        let mut several = 0;
        for _ in 0..200 {
            let parts = config.select(&tree, &mut rng, 8, &mut Tally::default());
            let mut leaves: Vec<u32> = parts.iter().flat_map(|part| part.leaves.iter().copied()).collect();
            let count = leaves.len();
            leaves.sort_unstable();
            leaves.dedup();
            assert_eq!(leaves.len(), count);
            assert!(parts.iter().all(|part| (3..=30).contains(&part.leaves.len())));
            several += usize::from(parts.len() > 1);
        }
        assert!(several > 100);
    }
}
