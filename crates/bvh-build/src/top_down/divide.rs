//! The division of a scene, from the root down to single objects, by the splits that a
//! [`SplitRule`] chooses.
//!
//! The objects' orders along the three axes are partitioned stably, so nothing is sorted twice (Ng
//! & Trifonov 2003, Table 1). A node's place follows from the numbers of objects: the 2m − 2
//! descendants of a node over m objects are one block, which holds the two children, then the left
//! child's block, then the right child's block. Subtrees can therefore be built in any order, or in
//! parallel, into the same bytes.

#[cfg(feature = "rayon")]
use super::presort::PARALLEL_OBJECTS;
use super::presort::{Presorted, note_same_orders};
use super::rule::{Split, SplitRule, TakeBest};
use super::split_cost::{ByMeasure, SplitCost};
use super::stall::{LEAST_STALLED, is_stall};
use super::sweep::{Block, Sweep, union_of};
use crate::watch::Pace;
use crate::{BuildError, Watch};
use bvh_core::cost::Measure;
use bvh_core::{Aabb, Bvh, Node, PackedAabb, with_vector_instructions};
#[cfg(feature = "rayon")]
use std::sync::Mutex;

/// Buffers of a build, which further builds over the same number of objects reuse.
#[derive(Debug, Default)]
pub struct Workspace {
    orders: [Vec<u32>; 2],
    scratch: Scratch,
}

/// Buffers of one thread.
#[derive(Debug, Default)]
struct Scratch {
    /// Per object of the scene, 1 if it goes to the left. Each thread has a separate array,
    /// although the threads' objects are disjoint, because objects of different subtrees would
    /// share cache lines.
    goes_left: Vec<u8>,
    goes_right: Vec<u32>,
    blocks: [Vec<Block>; 3],
    shortlist: Vec<Split>,
}

/// Facts about a node that are known before it is divided.
#[derive(Clone, Copy, Debug)]
struct Known {
    aabb: PackedAabb,
    /// Per axis, the lowest axis known to order the objects identically, usually the same axis.
    same_as: [u8; 3],
    /// Number of [stalls](stalls) from the root down to the node.
    stalls: u8,
}

/// A subtree below a node that is already written, with exclusive parts of all arrays, so it can be
/// built independently.
struct Task<'a> {
    /// The descendants' block, 2·objects − 2 nodes, and its position in the whole tree.
    below: &'a mut [Node],
    below_at: u32,
    objects_at: u32,
    orders: [&'a mut [u32]; 3],
    known: Known,
}

/// A division of a scene into a tree, ready to be made.
pub(super) struct Division<'a, C> {
    pub scene: &'a Presorted,
    pub split_cost: &'a C,
    pub skip_same_order: bool,
    pub watch: &'a Watch<'a>,
}

/// Returns whether a split of the node into sides with these boxes [stalls](is_stall).
#[inline(always)]
fn stalls<C: SplitCost>(node: &Sweep<C>, split: &Split, side_boxes: &[PackedAabb; 2]) -> bool {
    let counts = [split.left as usize, node.len() - split.left as usize];
    let larger = usize::from(counts[1] > counts[0]);
    is_stall(counts, node.split_cost.size(&side_boxes[larger]), node.split_cost.size(&node.aabb))
}

impl<C: SplitCost> Division<'_, C> {
    /// Divides by `rule` into `tree` on one thread, or without a rule by the best splits, on the
    /// threads of the current rayon pool if the scene is large enough, into the same bytes. Reuses
    /// the memory of tree and workspace. O(n log n); for split costs without a
    /// [limit](SplitCost::most_stalls) on stalls O(n²), if every split separates a single object.
    /// Clears the tree if the watch cancels.
    pub fn divide(
        &self,
        measure: Option<&dyn Measure>,
        rule: Option<&mut dyn SplitRule>,
        workspace: &mut Workspace,
        tree: &mut Bvh,
    ) -> Result<(), BuildError> {
        let &Self { scene, split_cost: cost, skip_same_order, watch } = self;
        let Some(measure) = measure else { return self.divide_by_cost(rule, workspace, tree) };
        let split_cost = &ByMeasure { cost, measure };
        let by_measure = Division { scene, split_cost, skip_same_order, watch };
        by_measure.divide_by_cost(rule, workspace, tree)
    }

    fn divide_by_cost(
        &self,
        rule: Option<&mut dyn SplitRule>,
        workspace: &mut Workspace,
        tree: &mut Bvh,
    ) -> Result<(), BuildError> {
        if let Some((task, scratch)) = prepare(self.scene, workspace, tree) {
            match rule {
                Some(rule) => build(self, task, rule, scratch),
                #[cfg(feature = "rayon")]
                None if task.objects() >= PARALLEL_OBJECTS && rayon::current_num_threads() > 1 => {
                    let scratches = &Mutex::new(vec![std::mem::take(scratch)]);
                    rayon::scope(|scope| spawn(scope, self, scratches, task));
                }
                None => build(self, task, &mut TakeBest, scratch),
            }
        }
        let finished = self.watch.ensure_wanted();
        if finished.is_err() {
            tree.nodes.clear();
            tree.prim_ids.clear();
        }
        finished
    }
}

/// Builds a task's subtree, parts of it in separate tasks.
#[cfg(feature = "rayon")]
fn spawn<'s, C: SplitCost>(
    scope: &rayon::Scope<'s>,
    division: &'s Division<'s, C>,
    scratches: &'s Mutex<Vec<Scratch>>,
    mut task: Task<'s>,
) {
    // The pool allocates at most one set of buffers per thread. Buffers have no invariant, so a
    // poisoned lock does no harm.
    let pooled = || scratches.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let mut scratch = pooled().pop().unwrap_or_default();
    // Marks need no reset: every object of a node is marked before the node is partitioned.
    scratch.goes_left.resize(division.scene.boxes.len(), 0);
    let mut pace = Pace::new(division.watch);
    // A loop instead of a recursion: one side goes to the pool and the other stays, so unbalanced
    // splits need no deep stack.
    while task.objects() >= PARALLEL_OBJECTS {
        if pace.ends_after(task.objects()) {
            return;
        }
        let [left, right] = split_task(division, task, &mut TakeBest, &mut scratch);
        let (larger, smaller) =
            if left.objects() > right.objects() { (left, right) } else { (right, left) };
        if smaller.objects() >= PARALLEL_OBJECTS {
            scope.spawn(move |scope| spawn(scope, division, scratches, smaller));
        } else {
            build(division, smaller, &mut TakeBest, &mut scratch);
        }
        task = larger;
    }
    build(division, task, &mut TakeBest, &mut scratch);
    pooled().push(scratch);
}

/// Resizes all arrays, writes the root, and returns the root's task; `None` for a scene without
/// objects.
fn prepare<'a>(
    scene: &Presorted,
    workspace: &'a mut Workspace,
    tree: &'a mut Bvh,
) -> Option<(Task<'a>, &'a mut Scratch)> {
    let n = scene.boxes.len();
    let Workspace { orders: [y, z], scratch } = workspace;
    tree.prim_ids.clone_from(&scene.orders[0]);
    y.clone_from(&scene.orders[1]);
    z.clone_from(&scene.orders[2]);
    scratch.goes_left.resize(n, 0);
    tree.nodes.resize((2 * n).saturating_sub(1), Node::leaf(Aabb::EMPTY, 0, 0));
    let (root, below) = tree.nodes.split_first_mut()?;
    let aabb = union_of(&scene.boxes, &tree.prim_ids);
    *root =
        if n == 1 { Node::leaf((&aabb).into(), 0, 1) } else { Node::inner((&aabb).into(), 1, 2) };
    let known = Known { aabb, same_as: [0, 1, 2], stalls: 0 };
    let task =
        Task { below, below_at: 1, objects_at: 0, orders: [&mut tree.prim_ids, y, z], known };
    Some((task, scratch))
}

impl Task<'_> {
    #[inline(always)]
    fn objects(&self) -> usize {
        self.orders[0].len()
    }
}

/// Divides the task's node, of two or more objects, writes its children and returns them as tasks,
/// left before right.
#[inline(always)]
fn split_task<'a, C: SplitCost>(
    division: &Division<'_, C>,
    task: Task<'a>,
    rule: &mut dyn SplitRule,
    scratch: &mut Scratch,
) -> [Task<'a>; 2] {
    let Task { below, below_at, objects_at, orders: [x, y, z], known } = task;
    let (left, [known_left, known_right]) = split_node(division, [x, y, z], known, rule, scratch);
    let (children, below) = below.split_at_mut(2);
    let (below_left, below_right) = below.split_at_mut(2 * left - 2);
    let [x, y, z] = [x, y, z].map(|order| order.split_at_mut(left));
    let sides = [
        Task {
            below: below_left,
            below_at: below_at + 2,
            objects_at,
            orders: [x.0, y.0, z.0],
            known: known_left,
        },
        Task {
            below: below_right,
            below_at: below_at + 2 * left as u32,
            objects_at: objects_at + left as u32,
            orders: [x.1, y.1, z.1],
            known: known_right,
        },
    ];
    for (child, side) in children.iter_mut().zip(&sides) {
        let aabb = (&side.known.aabb).into();
        *child = match side.objects() {
            1 => Node::leaf(aabb, side.objects_at, 1),
            _ => Node::inner(aabb, side.below_at, 2),
        };
    }
    sides
}

with_vector_instructions! {
    /// Runs [`split_node_plain`] with the processor's vector instructions.
    split_node = split_node_plain<C: SplitCost>(
        division: &Division<'_, C>, orders: [&mut [u32]; 3], known: Known, rule: &mut dyn SplitRule,
        scratch: &mut Scratch)
        -> (usize, [Known; 2])
}

/// Builds everything below a task's node, left subtrees first, with an explicit stack.
fn build<C: SplitCost>(
    division: &Division<'_, C>,
    task: Task<'_>,
    rule: &mut dyn SplitRule,
    scratch: &mut Scratch,
) {
    let mut pace = Pace::new(division.watch);
    let mut stack = vec![task];
    while let Some(task) = stack.pop() {
        if pace.ends_after(task.objects()) {
            // The tree is incomplete, and `divide_by_cost` clears it.
            return;
        }
        // Two objects have one split, and the order along x decides which is left.
        if task.objects() == 2 {
            for ((leaf, &object), at) in task.below.iter_mut().zip(&*task.orders[0]).zip(0..) {
                let aabb = (&division.scene.boxes[object as usize]).into();
                *leaf = Node::leaf(aabb, task.objects_at + at, 1);
            }
        } else if task.objects() > 2 {
            let [left, right] = split_task(division, task, rule, scratch);
            stack.extend([right, left]);
        }
    }
}

/// Lets the rule split a node of two or more objects and partitions its orders. Returns the number
/// of objects on the left and the facts about both sides.
#[inline(always)]
fn split_node_plain<C: SplitCost>(
    division: &Division<'_, C>,
    orders: [&mut [u32]; 3],
    Known { aabb, mut same_as, stalls: mut known_stalls }: Known,
    rule: &mut dyn SplitRule,
    scratch: &mut Scratch,
) -> (usize, [Known; 2]) {
    if division.skip_same_order {
        note_same_orders(orders.each_ref().map(|order| &**order), &mut same_as);
    }
    let [x, y, z] = orders;
    let mut sweep = Sweep {
        boxes: &division.scene.boxes,
        split_cost: division.split_cost,
        orders: [&*x, &*y, &*z],
        same_as,
        aabb,
        blocks: &mut scratch.blocks,
    };
    let mut split = sweep.choose(rule, &mut scratch.shortlist);
    let mut side_boxes = sweep.side_boxes(&split);
    if let Some(most) = division.split_cost.most_stalls() {
        let is_last = known_stalls >= most;
        if (is_last || sweep.len() >= LEAST_STALLED) && stalls(&sweep, &split, &side_boxes) {
            if is_last {
                split = sweep.best_balanced();
                side_boxes = sweep.side_boxes(&split);
            } else {
                known_stalls += 1;
            }
        }
    }
    let known = side_boxes.map(|aabb| Known { aabb, same_as, stalls: known_stalls });
    let axis = split.axis as usize;
    let left = split.left as usize;
    let orders = [x, y, z];
    // If all other axes have the same order, no partition is needed, and no marks.
    if (0..3).any(|other| other != axis && same_as[other] as usize == other) {
        let (to_left, to_right) = orders[axis].split_at(left);
        to_left.iter().for_each(|&object| scratch.goes_left[object as usize] = 1);
        to_right.iter().for_each(|&object| scratch.goes_left[object as usize] = 0);
    }
    for (other, order) in orders.into_iter().enumerate() {
        if other != axis && same_as[other] as usize == other {
            partition(order, &mut scratch.goes_right, &scratch.goes_left);
        }
    }
    (left, known)
}

/// Moves the objects that go left to the front and keeps the order on both sides. It has no
/// branches, because the side of an object is unpredictable.
#[inline(always)]
fn partition(order: &mut [u32], goes_right: &mut Vec<u32>, goes_left: &[u8]) {
    if goes_right.len() < order.len() {
        goes_right.resize(order.len(), 0);
    }
    let goes_right = &mut goes_right[..order.len()];
    let mut left = 0;
    let mut right = 0;
    for index in 0..order.len() {
        let object = order[index];
        let side = usize::from(goes_left[object as usize]);
        // Written always; the counter decides whether the entry is kept.
        order[left] = object;
        goes_right[right] = object;
        left += side;
        right += 1 - side;
    }
    order[left..].copy_from_slice(&goes_right[..right]);
}
