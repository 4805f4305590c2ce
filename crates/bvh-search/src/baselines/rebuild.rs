//! Rebuilding: finds nodes that look badly split, rebuilds their subtrees with other splits, and
//! keeps the better ones.
//!
//! Ng & Trifonov 2003, section 5: 'If at some node it appears that a wrong decision has been made
//! so that the two children are highly imbalance and one is contributing significantly to the
//! overall cost of the hierarchy, a different selection point can be made and this part of the
//! hierarchy resembling a subtree can be rebuilt.'
//!
//! Differs from the paper: nothing is stored at the nodes. GRASP's randomised construction chooses
//! the other splits. A rebuilt subtree is improved to a local optimum before the comparison, and
//! its nodes are then reinserted once anywhere in the tree, which makes the method an iterated
//! local search (Lourenço, Martin & Stützle 2003).

use crate::candidates::{Candidates, Randomised};
use crate::local::incumbent::Incumbent;
use crate::local::{TOLERANCE, construction, reinsertion};
use crate::parallel;
use crate::run::{
    Found, Observer, Problem, Quota, Run, SearchError, Stream, Tally, built_unless_cancelled,
    stream,
};
use crate::tree::{ANCHOR, Metric, Working, search_by_metric};
use bvh_build::Presorted;
use bvh_build::top_down::Workspace;
use bvh_core::cost::Measure;
use bvh_core::{Aabb, Bvh};
use rand::RngExt;

bvh_config::config! {
    /// The amount of work.
    pub struct Config {
        /// Work per object, unless the budget has less.
        work_per_object: u64 = 10_000;
    }
}

/// Maximum number of objects of a rebuilt subtree.
const OBJECTS: u32 = 200;

/// Maximum number of levels from a node with large children up to the root of the rebuilt subtree,
/// because a bad split shows below the split that caused it.
const CLIMB: u32 = 6;

/// The probability of taking one of the candidates other than the best.
const NOISE: f64 = 0.3;

search_by_metric!(Config);

impl Config {
    /// Rebuilds disjoint subtrees in parallel, each with a separate random stream.
    fn search_by(&self, metric: impl Metric, problem: &Problem, seed: u64, run: &mut Run) -> Found {
        let (mut best, mut tree) = Incumbent::build(problem, metric, run)?;
        let n = tree.objects() as u64;
        if n < 3 {
            return Ok(best.tree);
        }
        run.count(reinsertion::to_local_optimum(&mut tree, run.left(), run.observer()));
        best.offer(&tree, run);
        let mut rng = stream(seed, 0);
        let mut number = 0;
        let mut work_left = self.work_per_object.saturating_mul(n);
        // A batch does not begin unless the remaining work covers it.
        let enough = BATCH * WORK_PER_OBJECT * n.min(OBJECTS.into());
        while run.stopped().is_none() && work_left.min(run.left().work) >= enough {
            // Grafts scatter a subtree's nodes; the sort makes neighbours in the tree neighbours in
            // memory again.
            tree.sort_in_preorder();
            let mut round = Tally::default();
            while round.work < n * WORK_PER_OBJECT && !run.observer().cancelled() {
                let left = run.left().less(&round);
                let quota = left.at_most(work_left.saturating_sub(round.work));
                if quota.work < enough || quota.moves == 0 {
                    break;
                }
                let subtrees = select(&tree, &mut rng, quota.moves.min(BATCH), &mut round);
                // The selection draws from stream 0, so constructions begin with stream 1.
                let first = number + 1;
                // One half of the quota for the constructions, one for the reinsertions afterwards.
                // Moves are not limited: every construction counts as one.
                let share = Quota { work: quota.work / (2 * BATCH), ..Quota::ENDLESS };
                let construct = |index: usize| {
                    let rng = stream(seed, first + index as u64);
                    construct(&tree, problem.measure, &subtrees[index], share, rng, run.observer())
                };
                let found = parallel::map((0..subtrees.len()).collect(), construct)
                    .into_iter()
                    .collect::<Result<Vec<_>, _>>()?;
                number += subtrees.len() as u64;
                let limit = Quota { work: quota.work / 2, ..Quota::ENDLESS };
                round += replace(&mut tree, &subtrees, &found, limit, run.observer());
            }
            work_left = work_left.saturating_sub(round.work);
            run.count(round);
            best.offer(&tree, run);
        }
        Ok(best.tree)
    }
}

/// Number of random nodes in a tournament. The node whose children have the largest area wins. In
/// measurements, larger tournaments, or the children's area relative to the node's, found no better
/// nodes, and a tournament of 1 found hardly worse nodes.
const TOURNAMENT: u32 = 2;

/// Number of subtrees that are rebuilt together.
const BATCH: u64 = 4;

/// Work per object of the scene between two sorts of the nodes. A rebuilt subtree takes about as
/// much work per object.
const WORK_PER_OBJECT: u64 = 64;

/// A subtree: its inner nodes, root first, its leaves, and the total area of its inner nodes.
#[derive(Debug, Default)]
struct Subtree {
    inner: Vec<u32>,
    leaves: Vec<u32>,
    area: f64,
}

impl Subtree {
    /// Collects the subtree below `root`; `None` if it has more than [`OBJECTS`] leaves.
    fn below(tree: &Working<impl Metric>, root: u32) -> Option<Self> {
        let mut subtree = Self::default();
        let mut stack = vec![root];
        while let Some(index) = stack.pop() {
            let node = &tree.nodes[index as usize];
            if node.is_leaf() {
                subtree.leaves.push(index);
            } else {
                subtree.area += node.area;
                subtree.inner.push(index);
                stack.extend([node.children[1], node.children[0]]);
            }
            // A subtree has one leaf more than inner nodes.
            if subtree.inner.len() >= OBJECTS as usize {
                return None;
            }
        }
        Some(subtree)
    }

    fn overlaps(&self, other: &Self) -> bool {
        // If two subtrees share a leaf, one of them contains the root of the other.
        self.inner.contains(&other.inner[0]) || other.inner.contains(&self.inner[0])
    }
}

/// Selects `picks` subtrees and returns the disjoint ones of suitable size.
fn select(
    tree: &Working<impl Metric>,
    rng: &mut Stream,
    picks: u64,
    tally: &mut Tally,
) -> Vec<Subtree> {
    let mut subtrees: Vec<Subtree> = Vec::new();
    for _ in 0..picks {
        tally.moves += 1;
        tally.work += u64::from(TOURNAMENT);
        let mut root = (-1.0, ANCHOR);
        for _ in 0..TOURNAMENT {
            let index = rng.random_range(1..tree.nodes.len() as u32);
            let contribution = contribution(tree, index);
            if contribution > root.0 {
                root = (contribution, index);
            }
        }
        let mut found = None;
        let mut index = root.1;
        for _ in 0..=rng.random_range(0..=CLIMB) {
            let Some(subtree) = Subtree::below(tree, index) else { break };
            tally.work += subtree.inner.len() as u64;
            found = Some(subtree);
            index = tree.nodes[index as usize].parent;
            if index == ANCHOR {
                break;
            }
        }
        let Some(subtree) = found.filter(|subtree| subtree.leaves.len() >= 3) else { continue };
        if !subtrees.iter().any(|other| other.overlaps(&subtree)) {
            subtrees.push(subtree);
        }
    }
    subtrees
}

/// Constructs another tree over the leaves of a subtree. Returns it if it is better, and the
/// work.
fn construct<A: Metric>(
    tree: &Working<A>,
    measure: Option<&dyn Measure>,
    subtree: &Subtree,
    quota: Quota,
    rng: Stream,
    observer: &dyn Observer,
) -> Result<(Option<Working<A>>, Tally), SearchError> {
    let boxes: Vec<Aabb> =
        subtree.leaves.iter().map(|&leaf| Aabb::from(&tree.nodes[leaf as usize].aabb)).collect();
    let mut rule = Randomised::new(Candidates::AxisBest, Some(NOISE), rng);
    let mut other = Bvh::default();
    let scene = Presorted::new(&boxes)?;
    let workspace = &mut Workspace::default();
    let constructed = built_unless_cancelled(observer, |watch| {
        construction().construct(&scene, measure, Some(&mut rule), workspace, &mut other, watch)
    })?;
    if constructed.is_none() {
        return Ok((None, Tally::default()));
    }
    let mut other = Working::from_bvh(&other, tree.metric())?;
    let mut tally = reinsertion::to_local_optimum(&mut other, quota, observer);
    tally = Tally { moves: 0, kept: 0, work: tally.work + 2 * boxes.len() as u64 };
    let better = other.area() < subtree.area * (1.0 - TOLERANCE);
    Ok((better.then_some(other), tally))
}

/// Returns the total area of a node's children, 0 for a leaf.
fn contribution(tree: &Working<impl Metric>, index: u32) -> f64 {
    let node = &tree.nodes[index as usize];
    if node.is_leaf() {
        0.0
    } else {
        node.children.iter().map(|&child| tree.nodes[child as usize].area).sum()
    }
}

/// Replaces subtrees by better ones, then reinserts all their nodes once, anywhere in the tree.
fn replace<A: Metric>(
    tree: &mut Working<A>,
    subtrees: &[Subtree],
    found: &[(Option<Working<A>>, Tally)],
    quota: Quota,
    observer: &dyn Observer,
) -> Tally {
    let mut total = Tally::default();
    let mut order = Vec::new();
    for (subtree, (other, tally)) in subtrees.iter().zip(found) {
        total += *tally;
        if let Some(other) = other {
            tree.begin();
            graft(tree, subtree, other);
            total.kept += 1;
            total.work += 2 * subtree.leaves.len() as u64;
            order.extend(subtree.inner.iter().chain(&subtree.leaves));
        }
    }
    total.work += reinsertion::pass(tree, &order, quota, observer).work;
    total
}

/// Gives a subtree the shape of another tree over its leaves.
fn graft(tree: &mut Working<impl Metric>, subtree: &Subtree, shape: &Working<impl Metric>) {
    let order = shape.preorder();
    let mut new = vec![ANCHOR; shape.nodes.len()];
    let mut inner = subtree.inner.iter();
    for &index in &order {
        let node = &shape.nodes[index as usize];
        new[index as usize] = if node.is_leaf() {
            subtree.leaves[node.children[1] as usize]
        } else {
            inner.next().copied().unwrap_or(ANCHOR) // both trees have the same number
        };
    }
    // Children first: `join` computes a box from the boxes of the children.
    for &index in order.iter().rev() {
        let node = &shape.nodes[index as usize];
        if !node.is_leaf() {
            tree.join(new[index as usize], node.children.map(|child| new[child as usize]));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::run::{Budget, solve};
    use crate::scatter::{built, scatter};
    use bvh_build::median_cut;
    use bvh_core::validate;
    use std::collections::BTreeSet;

    #[test]
    fn grafting_changes_the_subtree_alone_and_areas_stay_exact() {
        let boxes = scatter(400);
        let mut tree = built(&median_cut::Config::default(), &boxes);
        let mut rng = stream(1, 0);
        let mut kept = 0;
        let begin = tree.area();
        for number in 0..300 {
            let mut tally = Tally::default();
            let subtrees = select(&tree, &mut rng, 4, &mut tally);
            // Every pick looks at the nodes of its tournament and of its subtree.
            let looks = subtrees.iter().map(|subtree| subtree.inner.len() as u64).sum::<u64>();
            assert!(tally.moves == 4 && tally.work >= 4 * u64::from(TOURNAMENT) + looks);
            let before = tree.area();
            for subtree in &subtrees {
                let found =
                    construct(&tree, None, subtree, Quota::ENDLESS, stream(1, number + 1), &())
                        .unwrap();
                let Some(other) = found.0 else { continue };
                tree.begin();
                graft(&mut tree, subtree, &other);
                let after = Subtree::below(&tree, subtree.inner[0]).unwrap();
                assert!((after.area - other.area()).abs() <= 1e-12 * other.area());
                let leaves: BTreeSet<u32> = after.leaves.into_iter().collect();
                assert_eq!(leaves, subtree.leaves.iter().copied().collect());
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
    fn subtrees_are_rebuilt_if_the_work_covers_a_batch_of_them() {
        // Four subtrees with 64 nodes of work per object, of 200 objects at most.
        for (objects, least) in [(50, 256), (1000, 52)] {
            let boxes = scatter(objects);
            let evaluations = |work_per_object| {
                let problem = Problem::new(&boxes);
                let search = Config { work_per_object };
                solve(&search, &problem, 1, Budget::UNLIMITED, &()).unwrap().evaluations
            };
            assert_eq!(evaluations(least - 1), evaluations(0), "{objects}");
            assert!(evaluations(least) > evaluations(0), "{objects}");
        }
    }
}
