//! Top-down object division: carries out the splits that a [`SplitRule`] chooses, from the root to single objects.
//!
//! Three sorted lists are partitioned stably, so that nothing is sorted twice (Ng & Trifonov 2003, Table 1). The
//! layout follows from the counts alone: a node over m objects has its 2m − 2 descendants in one block, children
//! first, then the left child's block, then the right's. So subtrees can be built in any order, or in parallel,
//! into the same bytes.

use crate::Presorted;
use crate::evaluation::Evaluation;
use crate::sweep::{Block, SplitRule, Sweep, union_of};
use bvh_core::{Aabb, Bvh, Node, PackedAabb, with_vector_instructions};
#[cfg(feature = "rayon")]
use std::sync::Mutex;

/// Subtrees of at least this many objects are built by parallel tasks: large enough that a task's start is lost
/// in its work.
pub const PARALLEL_OBJECTS: usize = 4096;

/// Buffers of a build, reusable for builds over the same number of objects without allocating again.
#[derive(Debug, Default)]
pub struct Workspace {
    orders: [Vec<u32>; 2],
    scratch: Scratch,
}

/// Buffers of one thread.
#[derive(Debug, Default)]
struct Scratch {
    /// Per object of the scene: 1 while it goes to the left. Not shared between threads, though their objects are
    /// disjoint: neighbouring objects in different subtrees would fight for cache lines.
    goes_left: Vec<u8>,
    goes_right: Vec<u32>,
    blocks: [Vec<Block>; 3],
    stack: Vec<Frame>,
}

/// A node still to be divided: its objects, its place in the tree, and its descendants' block.
#[derive(Clone, Copy, Debug)]
struct Frame {
    /// First object, relative to the task.
    start: u32,
    /// Number of objects, at least 2.
    len: u32,
    /// First of the two children's nodes, relative to the task's block.
    below: u32,
    known: Known,
}

/// What is known of a node before it is divided.
#[derive(Clone, Copy, Debug)]
struct Known {
    aabb: PackedAabb,
    /// Per axis, the lowest axis known to order the objects identically, usually itself.
    same_as: [u8; 3],
}

/// A subtree that can be built on its own, below a node already written: exclusive parts of all arrays.
struct Task<'a> {
    /// The descendants' block, 2·objects − 2 nodes, and its place in the whole tree.
    below: &'a mut [Node],
    below_at: u32,
    objects_at: u32,
    orders: [&'a mut [u32]; 3],
    known: Known,
}

/// What all tasks of a build share.
struct Shared<'a, E> {
    boxes: &'a [PackedAabb],
    evaluation: &'a E,
    /// Whether to look for axes that order a node's objects identically.
    skip_same_order: bool,
}

/// Divides the scene by `rule` into `tree`, reusing the tree's and the workspace's memory. Expected O(n log n);
/// O(n²) when every split peels off one object. One thread.
pub fn divide<E: Evaluation, R: SplitRule>(
    scene: &Presorted,
    evaluation: &E,
    rule: &mut R,
    skip_same_order: bool,
    workspace: &mut Workspace,
    tree: &mut Bvh,
) {
    if let Some((shared, task, scratch)) = prepare(scene, evaluation, skip_same_order, workspace, tree) {
        build(&shared, task, rule, scratch);
    }
}

/// As [`divide`], on the threads of the current rayon pool, into the same bytes: `rule` must have no memory.
#[cfg(feature = "rayon")]
pub fn divide_parallel<E: Evaluation, R: SplitRule + Copy + Send + Sync>(
    scene: &Presorted,
    evaluation: &E,
    rule: R,
    skip_same_order: bool,
    workspace: &mut Workspace,
    tree: &mut Bvh,
) {
    fn spawn<'s, E: Evaluation, R: SplitRule + Copy + Send + Sync + 's>(
        scope: &rayon::Scope<'s>,
        shared: &'s Shared<'s, E>,
        scratches: &'s Mutex<Vec<Scratch>>,
        mut task: Task<'s>,
        mut rule: R,
    ) {
        // At most one per thread is ever made. A poisoned lock is taken all the same: buffers have no invariant.
        let pooled = || scratches.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        let mut scratch = pooled().pop().unwrap_or_default();
        scratch.goes_left.resize(shared.boxes.len(), 0);
        // A loop, not a recursion: one side goes to the pool, the other stays, however unbalanced the splits.
        while task.objects() >= PARALLEL_OBJECTS {
            let (left, right) = split_task(shared, task, &mut rule, &mut scratch);
            let (larger, smaller) =
                if left.objects() > right.objects() { (left, right) } else { (right, left) };
            if smaller.objects() >= PARALLEL_OBJECTS {
                scope.spawn(move |scope| spawn(scope, shared, scratches, smaller, rule));
            } else {
                build(shared, smaller, &mut rule, &mut scratch);
            }
            task = larger;
        }
        build(shared, task, &mut rule, &mut scratch);
        pooled().push(scratch);
    }
    if let Some((shared, task, scratch)) = prepare(scene, evaluation, skip_same_order, workspace, tree) {
        let shared = &shared;
        let scratches = &Mutex::new(vec![std::mem::take(scratch)]);
        rayon::scope(|scope| spawn(scope, shared, scratches, task, rule));
    }
}

/// Sizes all arrays, writes the root, and cuts the arrays into its task; `None` for the scene without objects.
fn prepare<'a, E>(
    scene: &'a Presorted,
    evaluation: &'a E,
    skip_same_order: bool,
    workspace: &'a mut Workspace,
    tree: &'a mut Bvh,
) -> Option<(Shared<'a, E>, Task<'a>, &'a mut Scratch)> {
    let n = scene.len();
    let Workspace { orders: [y, z], scratch } = workspace;
    tree.prim_ids.clone_from(&scene.orders[0]);
    y.clone_from(&scene.orders[1]);
    z.clone_from(&scene.orders[2]);
    scratch.goes_left.resize(n, 0);
    tree.nodes.resize((2 * n).saturating_sub(1), Node::leaf(Aabb::EMPTY, 0, 0));
    let (root, below) = tree.nodes.split_first_mut()?;
    let aabb = union_of(&scene.boxes, &tree.prim_ids);
    *root = if n == 1 { Node::leaf((&aabb).into(), 0, 1) } else { Node::inner((&aabb).into(), 1, 2) };
    let shared = Shared { boxes: &scene.boxes, evaluation, skip_same_order };
    let known = Known { aabb, same_as: [0, 1, 2] };
    Some((
        shared,
        Task { below, below_at: 1, objects_at: 0, orders: [&mut tree.prim_ids, y, z], known },
        scratch,
    ))
}

#[cfg(feature = "rayon")]
impl Task<'_> {
    fn objects(&self) -> usize {
        self.orders[0].len()
    }
}

/// Divides the task's node, of two or more objects, writes its children and returns them as tasks.
#[cfg(feature = "rayon")]
fn split_task<'a, E: Evaluation, R: SplitRule>(
    shared: &Shared<'_, E>,
    task: Task<'a>,
    rule: &mut R,
    scratch: &mut Scratch,
) -> (Task<'a>, Task<'a>) {
    let Task { below, below_at, objects_at, orders: [x, y, z], known } = task;
    let (left, [known_left, known_right]) = split_node_fast(shared, [x, y, z], known, rule, scratch);
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
    sides.into()
}

with_vector_instructions! {
    /// [`build_plain`], with the vector instructions that the processor has.
    build = build_plain<E: Evaluation, R: SplitRule>(
        shared: &Shared<'_, E>, task: Task<'_>, rule: &mut R, scratch: &mut Scratch)
}

with_vector_instructions! {
    /// [`split_node`], likewise.
    #[cfg(feature = "rayon")]
    split_node_fast = split_node<E: Evaluation, R: SplitRule>(
        shared: &Shared<'_, E>, orders: [&mut [u32]; 3], known: Known, rule: &mut R, scratch: &mut Scratch)
        -> (usize, [Known; 2])
}

/// Builds everything below a task's node with an explicit stack, the left child first.
#[inline(always)]
fn build_plain<E: Evaluation, R: SplitRule>(
    shared: &Shared<'_, E>,
    task: Task<'_>,
    rule: &mut R,
    scratch: &mut Scratch,
) {
    let Task { below: nodes, below_at, objects_at, orders: [x, y, z], known } = task;
    let mut stack = std::mem::take(&mut scratch.stack);
    if x.len() > 1 {
        stack.push(Frame { start: 0, len: x.len() as u32, below: 0, known });
    }
    while let Some(Frame { start, len, below, known }) = stack.pop() {
        let range = start as usize..(start + len) as usize;
        if len == 2 {
            for (at, &object) in x[range].iter().enumerate() {
                let aabb = (&shared.boxes[object as usize]).into();
                nodes[below as usize + at] = Node::leaf(aabb, objects_at + start + at as u32, 1);
            }
            continue;
        }
        let orders = [&mut x[range.clone()], &mut y[range.clone()], &mut z[range]];
        let (left, known) = split_node(shared, orders, known, rule, scratch);
        let left = left as u32;
        let sides = [
            Frame { start, len: left, below: below + 2, known: known[0] },
            Frame { start: start + left, len: len - left, below: below + 2 * left, known: known[1] },
        ];
        for (at, side) in sides.into_iter().enumerate().rev() {
            let aabb = (&side.known.aabb).into();
            nodes[below as usize + at] = if side.len == 1 {
                Node::leaf(aabb, objects_at + side.start, 1)
            } else {
                stack.push(side);
                Node::inner(aabb, below_at + side.below, 2)
            };
        }
    }
    scratch.stack = stack;
}

/// Lets the rule split a node of two or more objects and partitions its lists. Returns the number of objects on
/// the left and what is known of both sides.
#[inline(always)]
fn split_node<E: Evaluation, R: SplitRule>(
    shared: &Shared<'_, E>,
    orders: [&mut [u32]; 3],
    Known { aabb, mut same_as }: Known,
    rule: &mut R,
    scratch: &mut Scratch,
) -> (usize, [Known; 2]) {
    if shared.skip_same_order {
        note_same_orders(orders.each_ref().map(|order| &**order), &mut same_as);
    }
    let [x, y, z] = orders;
    let mut sweep = Sweep {
        boxes: shared.boxes,
        evaluation: shared.evaluation,
        orders: [&*x, &*y, &*z],
        same_as,
        aabb,
        blocks: &mut scratch.blocks,
    };
    let split = rule.choose(&mut sweep);
    let known = sweep.side_boxes(&split).map(|aabb| Known { aabb, same_as });
    let (axis, left) = (split.axis as usize, split.left as usize);
    let orders = [x, y, z];
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

/// Finds axes whose orders have become identical. Once they are, they are in the whole subtree.
///
/// Source: Ng & Trifonov 2003, section 3.2.
#[inline(always)]
pub(crate) fn note_same_orders(orders: [&[u32]; 3], same_as: &mut [u8; 3]) {
    for (low, high) in [(0u8, 1u8), (0, 2), (1, 2)] {
        let (a, b) = (low as usize, high as usize);
        // The first elements usually differ, which saves the call that compares the rest.
        if same_as[a] == low
            && same_as[b] == high
            && orders[a].first() == orders[b].first()
            && orders[a] == orders[b]
        {
            for axis in same_as.iter_mut().filter(|axis| **axis == high) {
                *axis = low;
            }
        }
    }
}

/// Moves the objects that go left to the front, keeping the order on both sides. Without branches.
#[inline(always)]
fn partition(order: &mut [u32], goes_right: &mut Vec<u32>, goes_left: &[u8]) {
    if goes_right.len() < order.len() {
        goes_right.resize(order.len(), 0);
    }
    let goes_right = &mut goes_right[..order.len()];
    let (mut left, mut right) = (0, 0);
    for at in 0..order.len() {
        let object = order[at];
        let side = usize::from(goes_left[object as usize]);
        order[left] = object;
        goes_right[right] = object;
        left += side;
        right += 1 - side;
    }
    order[left..].copy_from_slice(&goes_right[..right]);
}
