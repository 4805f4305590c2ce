//! The descent of an object, the choice of the node where it stops, and its insertion there.

use super::block::{Block, LANES, NONE, Size, family, place};
use super::{Object, Scene, Workspace};
use crate::watch::Pace;
use bvh_core::cost::Sum;
use std::ops::Range;

/// Number of objects that descend together. A single descent would wait for memory at every node.
const BATCH: usize = 4;

/// The upper parts of a batch's paths: the nodes that contain the object.
#[derive(Debug, Default)]
pub(super) struct Walk {
    /// One row per step of the search: for each object the node found there, if any. Objects that
    /// find the same node find it in the same row.
    trail: Vec<[u32; BATCH]>,
    /// For each object the row of its last node. Later rows have no meaning for the object.
    last: [usize; BATCH],
}

impl Walk {
    #[inline(always)]
    fn descend(
        &mut self,
        blocks: &[Block],
        objects: &[Object; BATCH],
        walkers: Range<usize>,
        from: usize,
    ) {
        // Per object, the range of blocks to search next.
        let mut ahead = [(0, 0); BATCH];
        for walker in walkers {
            let (first, count) = family(blocks, self.trail[from][walker]);
            ahead[walker] = (first, first + count.div_ceil(LANES));
            self.last[walker] = from;
        }
        let mut row = from;
        // One step of all objects per turn, so that their memory accesses overlap.
        while ahead.iter().any(|(index, end)| index < end) {
            row += 1;
            if row == self.trail.len() {
                self.trail.push([NONE; BATCH]);
            }
            for walker in 0..BATCH {
                let (index, end) = ahead[walker];
                if index < end {
                    let block = &blocks[index];
                    let mut found = NONE;
                    // Inner nodes are in front of leaves: a block that ends with a leaf is the last
                    // that can contain the object.
                    ahead[walker] = (index + 1, if block.is_leaf(LANES - 1) { index } else { end });
                    if let Some(lane) = block.first_containing(&objects[walker].bounds) {
                        found = (index * LANES + lane) as u32;
                        self.last[walker] = row;
                        let (first, count) = block.family(lane);
                        ahead[walker] = (first, first + count.div_ceil(LANES));
                    }
                    self.trail[row][walker] = found;
                }
            }
        }
    }
}

/// A node on the path that does not contain the object, with the half area of their union.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grown {
    node: u32,
    area: f64,
}

/// A place where an object can be attached.
struct Stop {
    /// The increase of Σ S · children.
    increase: f64,
    node: u32,
    /// The first block of the node and its siblings, if the object is paired with the node.
    pair_among: Option<usize>,
    /// Number of nodes in `grown` that the insertion enlarges.
    grown: usize,
}

/// Inserts the objects of a valid order and returns the tree's cost; `None` if the construction is
/// cancelled. The upper parts of the paths are found for a batch of objects at once. If an earlier
/// insertion of the batch has changed the tree below a node of a path, the path is found again from
/// that node.
// The rules are constants, so that the inner loop has no branch on them.
#[inline(always)]
pub(super) fn insert_each<const BY_AREA: bool, const PAIR_INNER: bool>(
    scene: &Scene,
    size: impl Size,
    order: &[u32],
    workspace: &mut Workspace,
    mut pace: Pace,
) -> Option<f64> {
    let Workspace { blocks, walk, grown, .. } = workspace;
    blocks.clear();
    let Some((&first, rest)) = order.split_first() else { return Some(0.0) };
    let root = &scene.objects[first as usize];
    blocks.push(Block::EMPTY);
    blocks[0].put_leaf(0, root, first, leaf_area::<BY_AREA>(root));
    let mut cost = Sum::default();
    for batch in rest.chunks(BATCH) {
        let objects =
            std::array::from_fn(|i| scene.objects[batch[i.min(batch.len() - 1)] as usize]);
        // Paths of the previous batch are stale, because its insertions have changed the tree.
        walk.trail.clear();
        walk.trail.push([NONE; BATCH]);
        walk.descend(blocks, &objects, 0..batch.len(), 0);
        let mut examined = walk.trail.len();
        let mut changes = [(0, NONE); BATCH];
        for (i, (&id, object)) in batch.iter().zip(&objects).enumerate() {
            let passed = |&&(row, node): &&(usize, u32)| walk.trail[row][i] == node;
            if let Some(&(row, _)) = changes[..i].iter().filter(passed).min() {
                walk.descend(blocks, &objects, i..i + 1, row);
            }
            let row = walk.last[i];
            changes[i] = (row, walk.trail[row][i]);
            let last = walk.trail[row][i];
            let (stop, count) = find_stop::<BY_AREA, PAIR_INNER>(blocks, size, object, last, grown);
            examined += count;
            let attached_to = attach::<BY_AREA>(blocks, &stop, object, id);
            // Only the nodes down to the stop grow; the search went further.
            grown.truncate(stop.grown);
            if let Some(last) = grown.last_mut() {
                last.node = attached_to;
            }
            for &Grown { node, area } in grown.iter() {
                let (block, lane) = place(node);
                blocks[block].grow(lane, &object.bounds, area);
            }
            cost.add(stop.increase);
        }
        if pace.ends_after(examined) {
            return None;
        }
    }
    let root_area = blocks[0].area[0];
    Some(if rest.is_empty() || root_area <= 0.0 { 0.0 } else { cost.value() / root_area })
}

/// Returns the stop of least increase on the path, and the number of blocks examined. `last` is the
/// last node of the path that contains the object. Fills `grown` with the rest of the path.
#[inline(always)]
fn find_stop<const BY_AREA: bool, const PAIR_INNER: bool>(
    blocks: &[Block],
    size: impl Size,
    object: &Object,
    last: u32,
    grown: &mut Vec<Grown>,
) -> (Stop, usize) {
    grown.clear();
    // A stop at a node that contains the object adds only the node's area, and the nodes above are
    // no smaller. The last such node is therefore the best of them.
    let (block, lane) = place(last);
    let increase = if last == NONE { f64::INFINITY } else { blocks[block].area[lane] };
    let mut stop = Stop { increase, node: last, pair_among: None, grown: 0 };
    let (mut first, mut count) = family(blocks, last);
    let mut inherited = 0.0;
    let mut examined = 0;
    // Every stop further down adds at least the growth of the nodes above it and the object's area.
    while inherited + object.area < stop.increase {
        let mut least = f64::INFINITY;
        let mut next = Grown { node: NONE, area: 0.0 };
        examined += count.div_ceil(LANES);
        for (index, block) in blocks.iter().enumerate().skip(first).take(count.div_ceil(LANES)) {
            // Only leaves follow. Each adds at least twice the object's area.
            if block.is_leaf(0) {
                let beaten = !BY_AREA && least <= 2.0 * object.area;
                let useless = inherited + 2.0 * object.area >= stop.increase
                    && inherited + least + object.area >= stop.increase;
                if beaten || useless {
                    break;
                }
            }
            for lane in 0..LANES.min(count - (index - first) * LANES) {
                let area = block.union_size(lane, &object.bounds, size);
                let growth = area - block.area[lane];
                let growth = if BY_AREA { growth } else { growth * f64::from(block.count[lane]) };
                if growth < least {
                    (least, next) = (growth, Grown { node: (index * LANES + lane) as u32, area });
                }
            }
        }
        let Grown { node, area } = next;
        // The scan ended before any child, because no stop further down can be cheaper.
        if node == NONE {
            break;
        }
        grown.push(next);
        let (block, lane) = place(node);
        let is_leaf = blocks[block].is_leaf(lane);
        let depth = grown.len();
        let above = inherited;
        if !is_leaf {
            inherited += if BY_AREA { least * f64::from(blocks[block].count[lane]) } else { least };
            if inherited + area < stop.increase {
                let increase = inherited + area;
                stop = Stop { increase, node, pair_among: None, grown: depth };
            }
        }
        if (is_leaf || PAIR_INNER) && above + 2.0 * area < stop.increase {
            let increase = above + 2.0 * area;
            stop = Stop { increase, node, pair_among: Some(first), grown: depth };
        }
        if is_leaf {
            break;
        }
        (first, count) = family(blocks, node);
    }
    (stop, examined)
}

/// Returns the area from which the growth of a leaf counts.
#[inline(always)]
fn leaf_area<const BY_AREA: bool>(object: &Object) -> f64 {
    if BY_AREA { object.area } else { 0.0 }
}

/// Makes the object a child of the stop, or of a new inner node that replaces the stop. Returns the
/// grown node.
#[inline(always)]
fn attach<const BY_AREA: bool>(
    blocks: &mut Vec<Block>,
    stop: &Stop,
    object: &Object,
    id: u32,
) -> u32 {
    let (mut block, mut lane) = place(stop.node);
    if let Some(among) = stop.pair_among {
        if blocks[block].is_leaf(lane) {
            // Swap the leaf with the first leaf, so that inner nodes stay in front.
            let mut front = among;
            while !blocks[front].is_leaf(LANES - 1) {
                front += 1;
            }
            let mut front_lane = 0;
            while !blocks[front].is_leaf(front_lane) {
                front_lane += 1;
            }
            let leaf = blocks[block];
            let other = blocks[front];
            blocks[block].copy(lane, &other, front_lane);
            blocks[front].copy(front_lane, &leaf, lane);
            (block, lane) = (front, front_lane);
        }
        let mut pair = Block::EMPTY;
        pair.copy(0, &blocks[block], lane);
        pair.put_leaf(1, object, id, leaf_area::<BY_AREA>(object));
        blocks[block].link[lane] = blocks.len() as u32;
        blocks[block].count[lane] = 2;
        blocks.push(pair);
    } else {
        let (mut first, count) = family(blocks, stop.node);
        let full = count / LANES;
        // Doubling the space keeps the copies O(1) per object on average.
        if count % LANES == 0 && full.is_power_of_two() {
            let moved = blocks.len();
            blocks.extend_from_within(first..first + full);
            blocks.resize(moved + 2 * full, Block::EMPTY);
            blocks[block].link[lane] = moved as u32;
            first = moved;
        }
        blocks[first + full].put_leaf(count % LANES, object, id, leaf_area::<BY_AREA>(object));
        blocks[block].count[lane] += 1;
    }
    (block * LANES + lane) as u32
}
