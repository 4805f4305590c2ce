//! Top-down object division: carries out the splits that a [`SplitRule`] chooses, from the root to single objects.
//!
//! Three sorted lists are partitioned stably, so that nothing is sorted twice (Ng & Trifonov 2003, Table 1). The
//! layout follows from the counts alone: a node over m objects has its 2m − 2 descendants in one block, children
//! first, then the left child's block, then the right's. So subtrees can be built in any order, or in parallel,
//! into the same bytes.

use crate::Presorted;
use crate::evaluation::Evaluation;
use crate::sweep::{Split, SplitRule, Sweep};
use bvh_core::{Aabb, Bvh, Node, PackedAabb};
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

/// Subtrees of at least this many objects are built by parallel tasks: large enough that a task's start is lost
/// in its work.
pub const PARALLEL_OBJECTS: usize = 4096;

/// Buffers of a build, reusable for builds over the same number of objects without allocating again.
#[derive(Debug, Default)]
pub struct Workspace {
    orders: [Vec<u32>; 2],
    scratch: Vec<u32>,
    right: Vec<f64>,
    /// Per object: 1 while it goes to the left. Atomic because parallel subtrees share the array, if no entry;
    /// relaxed accesses compile to plain ones.
    goes_left: Vec<AtomicU8>,
    stack: Vec<Frame>,
}

/// A node still to be divided: its objects, its place in the tree, and its descendants' block.
#[derive(Clone, Copy, Debug)]
struct Frame {
    /// First object, relative to the task.
    start: u32,
    /// Number of objects, at least 2.
    len: u32,
    /// The node's own index in the task's block.
    node: u32,
    /// First node of the descendants' block, relative to the task's.
    below: u32,
    same_as: [u8; 3],
}

/// A subtree that can be built on its own: exclusive parts of all arrays.
struct Task<'a> {
    node: &'a mut Node,
    /// The descendants' block, 2·objects − 2 nodes, and its place in the whole tree.
    below: &'a mut [Node],
    below_at: u32,
    objects_at: u32,
    orders: [&'a mut [u32]; 3],
    scratch: &'a mut [u32],
    right: &'a mut [f64],
    same_as: [u8; 3],
}

/// What all tasks of a build share.
struct Shared<'a, E> {
    boxes: &'a [PackedAabb],
    evaluation: &'a E,
    goes_left: &'a [AtomicU8],
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
    let Workspace { stack, .. } = workspace;
    let mut stack = std::mem::take(stack);
    if let Some((shared, task)) = prepare(scene, evaluation, skip_same_order, workspace, tree) {
        build(&shared, task, rule, &mut stack);
    }
    workspace.stack = stack;
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
        mut task: Task<'s>,
        mut rule: R,
    ) {
        // A loop, not a recursion: one side goes to the pool, the other stays, however unbalanced the splits.
        while task.orders[0].len() >= PARALLEL_OBJECTS {
            let (left, right) = split_task(shared, task, &mut rule);
            let (larger, smaller) =
                if left.orders[0].len() > right.orders[0].len() { (left, right) } else { (right, left) };
            if smaller.orders[0].len() >= PARALLEL_OBJECTS {
                scope.spawn(move |scope| spawn(scope, shared, smaller, rule));
            } else {
                build(shared, smaller, &mut rule, &mut Vec::new());
            }
            task = larger;
        }
        build(shared, task, &mut rule, &mut Vec::new());
    }
    if let Some((shared, task)) = prepare(scene, evaluation, skip_same_order, workspace, tree) {
        let shared = &shared;
        rayon::scope(|scope| spawn(scope, shared, task, rule));
    }
}

/// Sizes all arrays and cuts them into the root's task; `None` for the scene without objects.
fn prepare<'a, E>(
    scene: &'a Presorted,
    evaluation: &'a E,
    skip_same_order: bool,
    workspace: &'a mut Workspace,
    tree: &'a mut Bvh,
) -> Option<(Shared<'a, E>, Task<'a>)> {
    let n = scene.len();
    tree.prim_ids.clone_from(&scene.orders[0]);
    tree.nodes.resize((2 * n).saturating_sub(1), Node::leaf(Aabb::EMPTY, 0, 0));
    let [y, z] = &mut workspace.orders;
    y.clone_from(&scene.orders[1]);
    z.clone_from(&scene.orders[2]);
    workspace.scratch.resize(n, 0);
    workspace.right.resize(n, 0.0);
    workspace.goes_left.resize_with(n, AtomicU8::default);
    let (node, below) = tree.nodes.split_first_mut()?;
    let shared =
        Shared { boxes: &scene.boxes, evaluation, goes_left: &workspace.goes_left[..n], skip_same_order };
    let task = Task {
        node,
        below,
        below_at: 1,
        objects_at: 0,
        orders: [&mut tree.prim_ids, y, z],
        scratch: &mut workspace.scratch[..n],
        right: &mut workspace.right[..n],
        same_as: [0, 1, 2],
    };
    Some((shared, task))
}

/// Divides the task's root and returns both sides as tasks.
#[cfg(feature = "rayon")]
fn split_task<'a, E: Evaluation, R: SplitRule>(
    shared: &Shared<'_, E>,
    mut task: Task<'a>,
    rule: &mut R,
) -> (Task<'a>, Task<'a>) {
    let [x, y, z] = &mut task.orders;
    let (aabb, left, same_as) =
        split_node_fast(shared, [x, y, z], task.same_as, task.scratch, task.right, rule);
    *task.node = Node::inner((&aabb).into(), task.below_at, 2);
    let (children, below) = task.below.split_at_mut(2);
    let (first, second) = children.split_at_mut(1);
    let (below_left, below_right) = below.split_at_mut(2 * left - 2);
    let [x, y, z] = task.orders.map(|order| order.split_at_mut(left));
    let (scratch_left, scratch_right) = task.scratch.split_at_mut(left);
    let (right_left, right_right) = task.right.split_at_mut(left);
    (
        Task {
            node: &mut first[0],
            below: below_left,
            below_at: task.below_at + 2,
            objects_at: task.objects_at,
            orders: [x.0, y.0, z.0],
            scratch: scratch_left,
            right: right_left,
            same_as,
        },
        Task {
            node: &mut second[0],
            below: below_right,
            below_at: task.below_at + 2 * left as u32,
            objects_at: task.objects_at + left as u32,
            orders: [x.1, y.1, z.1],
            scratch: scratch_right,
            right: right_right,
            same_as,
        },
    )
}

macro_rules! with_vector_instructions {
    ($(#[$doc:meta])* $fast:ident = $plain:ident <$($generic:ident: $bound:ident),*>
        ($($name:ident: $type:ty),* $(,)?) $(-> $result:ty)?) => {
        $(#[$doc])*
        fn $fast<$($generic: $bound),*>($($name: $type),*) $(-> $result)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn vectorised<$($generic: $bound),*>($($name: $type),*) $(-> $result)? {
                    $plain($($name),*)
                }
                if is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has AVX2, checked on the line above.
                    return unsafe { vectorised($($name),*) };
                }
            }
            $plain($($name),*)
        }
    };
}

with_vector_instructions! {
    /// [`build_plain`], compiled a second time for processors with AVX2, where a box is one register: about a third
    /// off the time of a build. Same operations in the same order, none fused, hence the same bits.
    build = build_plain<E: Evaluation, R: SplitRule>(
        shared: &Shared<'_, E>, task: Task<'_>, rule: &mut R, stack: &mut Vec<Frame>)
}

#[cfg(feature = "rayon")]
with_vector_instructions! {
    /// [`split_node`], likewise.
    split_node_fast = split_node<E: Evaluation, R: SplitRule>(
        shared: &Shared<'_, E>, orders: [&mut [u32]; 3], same_as: [u8; 3], scratch: &mut [u32], right: &mut [f64],
        rule: &mut R) -> (PackedAabb, usize, [u8; 3])
}

/// Builds a task's whole subtree with an explicit stack, the left child first.
#[inline(always)]
fn build_plain<E: Evaluation, R: SplitRule>(
    shared: &Shared<'_, E>,
    task: Task<'_>,
    rule: &mut R,
    stack: &mut Vec<Frame>,
) {
    let Task { node: root, below, below_at, objects_at, orders: [x, y, z], scratch, right, same_as } = task;
    let leaf =
        |x: &[u32], at: u32| Node::leaf((&shared.boxes[x[at as usize] as usize]).into(), objects_at + at, 1);
    if x.len() == 1 {
        *root = leaf(x, 0);
        return;
    }
    const ROOT: u32 = u32::MAX;
    stack.clear();
    stack.push(Frame { start: 0, len: x.len() as u32, node: ROOT, below: 0, same_as });
    while let Some(Frame { start, len, node, below: block, same_as }) = stack.pop() {
        let range = start as usize..(start + len) as usize;
        let (aabb, left, same_as) = if len == 2 {
            let pair = &x[range];
            (shared.boxes[pair[0] as usize].union(&shared.boxes[pair[1] as usize]), 1, same_as)
        } else {
            let orders = [&mut x[range.clone()], &mut y[range.clone()], &mut z[range.clone()]];
            split_node(shared, orders, same_as, &mut scratch[range.clone()], &mut right[range], rule)
        };
        let inner = Node::inner((&aabb).into(), below_at + block, 2);
        if node == ROOT {
            *root = inner
        } else {
            below[node as usize] = inner
        }
        let left = left as u32;
        let sides = [
            Frame { start, len: left, node: block, below: block + 2, same_as },
            Frame { start: start + left, len: len - left, node: block + 1, below: block + 2 * left, same_as },
        ];
        for side in sides.into_iter().rev() {
            if side.len == 1 {
                below[side.node as usize] = leaf(x, side.start);
            } else {
                stack.push(side);
            }
        }
    }
}

/// Lets the rule split a node of two or more objects and partitions its lists. Returns the node's box, the number
/// of objects on the left, and what is known of identical orders.
#[inline(always)]
fn split_node<E: Evaluation, R: SplitRule>(
    shared: &Shared<'_, E>,
    orders: [&mut [u32]; 3],
    mut same_as: [u8; 3],
    scratch: &mut [u32],
    right: &mut [f64],
    rule: &mut R,
) -> (PackedAabb, usize, [u8; 3]) {
    if shared.skip_same_order {
        note_same_orders(&orders, &mut same_as);
    }
    let [x, y, z] = orders;
    let mut sweep = Sweep {
        boxes: shared.boxes,
        evaluation: shared.evaluation,
        orders: [&*x, &*y, &*z],
        same_as,
        right,
        aabb: None,
    };
    let Split { axis, left, .. } = rule.choose(&mut sweep);
    let left = left as usize;
    let aabb = sweep.aabb.unwrap_or(PackedAabb::EMPTY);
    let orders = [x, y, z];
    let others = [1, 2, 3].map(|step| (axis as usize + step) % 3);
    if others[..2].iter().any(|&other| same_as[other] as usize == other) {
        for (at, &object) in orders[axis as usize].iter().enumerate() {
            shared.goes_left[object as usize].store(u8::from(at < left), Relaxed);
        }
    }
    for (other, order) in orders.into_iter().enumerate() {
        if other != axis as usize && same_as[other] as usize == other {
            partition(order, scratch, shared.goes_left);
        }
    }
    (aabb, left, same_as)
}

/// Finds axes whose orders have become identical. Once they are, they are in the whole subtree.
///
/// Source: Ng & Trifonov 2003, section 3.2.
#[inline(always)]
fn note_same_orders(orders: &[&mut [u32]; 3], same_as: &mut [u8; 3]) {
    for (low, high) in [(0u8, 1u8), (0, 2), (1, 2)] {
        let (a, b) = (low as usize, high as usize);
        // The first elements usually differ, which saves the call that compares the rest.
        if same_as[a] == low && same_as[b] == high && orders[a][0] == orders[b][0] && orders[a] == orders[b] {
            for axis in same_as.iter_mut().filter(|axis| **axis == high) {
                *axis = low;
            }
        }
    }
}

/// Moves the objects that go left to the front, keeping the order on both sides. Without branches.
#[inline(always)]
fn partition(order: &mut [u32], scratch: &mut [u32], goes_left: &[AtomicU8]) {
    let (mut left, mut right) = (0, 0);
    for at in 0..order.len() {
        let object = order[at];
        let side = usize::from(goes_left[object as usize].load(Relaxed));
        order[left] = object;
        scratch[right] = object;
        left += side;
        right += 1 - side;
    }
    order[left..].copy_from_slice(&scratch[..right]);
}
