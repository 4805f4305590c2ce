//! Improvement of any binary tree, for callers with their own builder.

use crate::best;
use crate::local::incumbent::Incumbent;
use crate::run::{
    Budget, Found, Kept, Observer, Outcome, Problem, Run, SearchError, Splits, solve,
};
use crate::tree::{Metric, search_by_metric};
use bvh_config::{Check, OutOfRange};
use bvh_core::cost::Objective;
use bvh_core::{Aabb, Bvh, Node, NodeKind, check_boxes, validate, validate_references};

/// Improves `tree`, over the objects of the problem, by [`best`](crate::best) without its builder,
/// until the budget is spent or the observer cancels. The result has the same leaves with the same
/// objects; a leaf of several objects moves as one. The cost is the
/// [internal area](bvh_core::cost::internal_area), or the problem's measure instead, with tight
/// boxes. The cost never exceeds the cost of `tree`.
///
/// [`improve`](crate::improve) does the same for a given time, with every parameter at its default.
///
/// Every leaf of several objects is first divided into leaves of one, if objects may be divided
/// among leaves or if the objective is the [layout](Objective::Layout), which chooses its own
/// leaves. The boxes are then the boxes of the objects or of their parts.
///
/// Rejects trees that are not [valid](validate), and inner nodes with more than two children.
///
/// ```
/// use bvh_search::prelude::*;
/// let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(|x| Aabb::from([[x; 3], [x + 1.5; 3]])).collect();
/// let tree = median_cut::Config::default().build(&boxes)?;
/// let budget = Budget { max_work: Some(100_000), ..Budget::UNLIMITED };
/// let better = optimize(&tree, &Problem::new(&boxes), &best::Config::default(), 7, budget, &())?;
/// assert!(cost::internal_area(&better.tree) <= cost::internal_area(&tree));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn optimize(
    tree: &Bvh,
    problem: &Problem,
    config: &best::Config,
    seed: u64,
    budget: Budget,
    observer: &dyn Observer,
) -> Result<Outcome, SearchError> {
    let boxes = problem.boxes;
    check_boxes(boxes).map_err(bvh_build::BuildError::from)?;
    match problem.splits {
        Some(splits) => validate_references(tree, boxes, splits.objects)?,
        None => validate(tree, boxes)?,
    }
    if problem.splits.is_some() || problem.objective == Objective::Layout {
        let tree = one_reference_per_leaf(tree, problem);
        return solve(&From { tree, config }, problem, seed, budget, observer);
    }
    // The search sees every leaf as one object with the leaf's box, so it never separates the
    // objects of a leaf.
    let mut tight = tree.clone();
    let mut leaves = Vec::new();
    // Padded boxes would make the search's areas, and so its cost, differ from the tree's.
    tight.refit(boxes);
    for node in &mut tight.nodes {
        if let NodeKind::Leaf { .. } = node.kind() {
            leaves.push((node.aabb, node.prims()));
            *node = Node::leaf(node.aabb, leaves.len() as u32 - 1, 1);
        }
    }
    tight.prim_ids = (0..leaves.len() as u32).collect();
    let leaf_boxes: Vec<Aabb> = leaves.iter().map(|(aabb, _)| *aabb).collect();
    let mut outcome = {
        let problem =
            Problem { boxes: &leaf_boxes, objective: Objective::InternalArea, ..*problem };
        solve(&From { tree: tight, config }, &problem, seed, budget, observer)?
    };
    let mut prim_ids = Vec::with_capacity(boxes.len());
    for node in &mut outcome.tree.nodes {
        if let NodeKind::Leaf { first, .. } = node.kind() {
            let (aabb, prims) = &leaves[outcome.tree.prim_ids[first as usize] as usize];
            *node = Node::leaf(*aabb, prim_ids.len() as u32, prims.len() as u32);
            prim_ids.extend_from_slice(&tree.prim_ids[prims.clone()]);
        }
    }
    outcome.tree.prim_ids = prim_ids;
    Ok(outcome)
}

/// Returns the same tree with tight boxes and one reference per leaf. Leaves of several references
/// are halved in their order.
fn one_reference_per_leaf(tree: &Bvh, problem: &Problem) -> Bvh {
    let mut single = tree.clone();
    single.halve_leaves(1);
    let split = problem.splits.filter(|_| tree.prim_ids.len() > problem.boxes.len());
    let Some(Splits { objects, .. }) = split else {
        single.refit(problem.boxes);
        return single;
    };
    // Children come after their parents, so a pass from the back makes boxes tight.
    for index in (0..single.nodes.len()).rev() {
        let node = single.nodes[index];
        single.nodes[index].aabb = if let NodeKind::Leaf { first, .. } = node.kind() {
            let part = objects.clip(single.prim_ids[first as usize], &node.aabb);
            // A degenerate object may have no part in its leaf. The leaf's box is then as tight as
            // known.
            if part == Aabb::EMPTY { node.aabb } else { part }
        } else {
            Aabb::union_of(single.nodes[node.children()].iter().map(|child| &child.aabb))
        };
    }
    single
}

/// The search `best`, started from a given tree.
struct From<'a> {
    tree: Bvh,
    config: &'a best::Config,
}

impl Check for From<'_> {
    fn check(&self) -> Result<(), OutOfRange> {
        self.config.check()
    }
}

search_by_metric!(From<'_>);

impl From<'_> {
    fn search_by(&self, metric: impl Metric, problem: &Problem, seed: u64, run: &mut Run) -> Found {
        let tree = Kept::new(self.tree.clone(), problem);
        let best = Incumbent::begin(tree, problem, run);
        self.config.improved(best, None, metric, problem, seed, run)
    }
}
