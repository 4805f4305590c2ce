//! The walk down the tree and the choice of the place where an object is attached.

use super::block::{Block, LANES, NONE, family, place};
use super::{Object, Scene, Workspace};
use bvh_core::cost::Sum;
use std::ops::Range;

/// A [`Config`](super::Config) that the compiler knows.
pub(super) trait Rule {
    const BY_AREA: bool;
    const PAIR_INNER: bool;

    /// What the growth of a leaf is counted from.
    #[inline(always)]
    fn leaf_area(object: &Object) -> f64 {
        if Self::BY_AREA { object.area } else { 0.0 }
    }
}

/// `Rules<BY_AREA, PAIR_INNER>`
pub(super) struct Rules<const BY_AREA: bool, const PAIR_INNER: bool>;

impl<const BY_AREA: bool, const PAIR_INNER: bool> Rule for Rules<BY_AREA, PAIR_INNER> {
    const BY_AREA: bool = BY_AREA;
    const PAIR_INNER: bool = PAIR_INNER;
}

/// Objects that walk down together. On its own a walk waits for memory at every node.
const BATCH: usize = 4;

/// The first part of the paths of a batch: the nodes that contain the object, which the others below do not.
#[derive(Debug, Default)]
pub(super) struct Walk {
    /// One row per block looked at: for each object the node found there, if any. A node is found in the same row
    /// whoever looks for it.
    trail: Vec<[u32; BATCH]>,
    /// For each object the row in which its last node was found; its later rows mean nothing.
    last: [usize; BATCH],
}

impl Walk {
    /// Walks down from the nodes in row `from`.
    #[inline(always)]
    fn descend(&mut self, blocks: &[Block], objects: &[Object; BATCH], walkers: Range<usize>, from: usize) {
        // The blocks still to be looked at.
        let mut ahead = [(0, 0); BATCH];
        for walker in walkers {
            let (first, count) = family(blocks, self.trail[from][walker]);
            ahead[walker] = (first, first + count.div_ceil(LANES));
            self.last[walker] = from;
        }
        let mut row = from;
        while ahead.iter().any(|(at, end)| at < end) {
            row += 1;
            if row == self.trail.len() {
                self.trail.push([NONE; BATCH]);
            }
            for walker in 0..BATCH {
                let (at, end) = ahead[walker];
                if at < end {
                    let block = &blocks[at];
                    let mut found = NONE;
                    ahead[walker] = (at + 1, if block.is_leaf(LANES - 1) { at } else { end });
                    if let Some(lane) = block.first_containing(&objects[walker].bounds) {
                        found = (at * LANES + lane) as u32;
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

/// A node of the path that does not contain the object, with the half area it would have.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grown {
    node: u32,
    area: f64,
}

/// Where to attach an object.
struct Stop {
    /// The increase of Σ S · children.
    increase: f64,
    node: u32,
    /// The first block of the node and its siblings, when it is to be paired.
    pair_among: Option<usize>,
    /// How many of the nodes in `grown` are enlarged.
    grown: usize,
}

/// Inserts the objects of a valid order. The containing part of the path is looked up for a batch of objects at once
/// and, where an insertion of the batch changed the tree below one of its nodes, again from there.
#[inline(always)]
pub(super) fn insert_each<R: Rule>(scene: &Scene, order: &[u32], workspace: &mut Workspace) -> f64 {
    let Workspace { blocks, walk, grown, .. } = workspace;
    blocks.clear();
    let Some((&first, rest)) = order.split_first() else { return 0.0 };
    let root = &scene.objects[first as usize];
    blocks.push(Block::EMPTY);
    blocks[0].put_leaf(0, root, first, R::leaf_area(root));
    let mut cost = Sum::default();
    for batch in rest.chunks(BATCH) {
        let objects = std::array::from_fn(|i| scene.objects[batch[i.min(batch.len() - 1)] as usize]);
        walk.trail.clear();
        walk.trail.push([NONE; BATCH]);
        walk.descend(blocks, &objects, 0..batch.len(), 0);
        let mut changes = [(0, NONE); BATCH];
        for (i, (&id, object)) in batch.iter().zip(&objects).enumerate() {
            let passed = |&&(row, node): &&(usize, u32)| walk.trail[row][i] == node;
            if let Some(&(row, _)) = changes[..i].iter().filter(passed).min() {
                walk.descend(blocks, &objects, i..i + 1, row);
            }
            let row = walk.last[i];
            changes[i] = (row, walk.trail[row][i]);
            let stop = find_stop::<R>(blocks, object, walk.trail[row][i], grown);
            let attached_to = attach::<R>(blocks, &stop, object, id);
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
    }
    let root_area = blocks[0].area[0];
    if rest.is_empty() || root_area <= 0.0 { 0.0 } else { cost.value() / root_area }
}

/// The stop of least increase on the path, of which `last` is the last node that contains the object. Leaves the rest
/// of the path in `grown`.
#[inline(always)]
fn find_stop<R: Rule>(blocks: &[Block], object: &Object, last: u32, grown: &mut Vec<Grown>) -> Stop {
    grown.clear();
    // A node that contains the object asks for its own area and nothing else: no node above asks for less.
    let (block, lane) = place(last);
    let increase = if last == NONE { f64::INFINITY } else { blocks[block].area[lane] };
    let mut stop = Stop { increase, node: last, pair_among: None, grown: 0 };
    let (mut first, mut count) = family(blocks, last);
    let mut inherited = 0.0;
    // Every stop further down asks for at least what is inherited and the object's own area.
    while inherited + object.area < stop.increase {
        let (mut least, mut next) = (f64::INFINITY, Grown { node: NONE, area: 0.0 });
        for (at, block) in blocks.iter().enumerate().skip(first).take(count.div_ceil(LANES)) {
            // Only leaves from here on: each asks for at least twice the object's area.
            if block.is_leaf(0) {
                let beaten = !R::BY_AREA && least <= 2.0 * object.area;
                let useless = inherited + 2.0 * object.area >= stop.increase
                    && inherited + least + object.area >= stop.increase;
                if beaten || useless {
                    break;
                }
            }
            for lane in 0..LANES.min(count - (at - first) * LANES) {
                let area = block.union_area(lane, &object.bounds);
                let growth = area - block.area[lane];
                let growth = if R::BY_AREA { growth } else { growth * f64::from(block.count[lane]) };
                if growth < least {
                    (least, next) = (growth, Grown { node: (at * LANES + lane) as u32, area });
                }
            }
        }
        let Grown { node, area } = next;
        if node == NONE {
            break;
        }
        grown.push(next);
        let (block, lane) = place(node);
        let (is_leaf, above) = (blocks[block].is_leaf(lane), inherited);
        if !is_leaf {
            inherited += if R::BY_AREA { least * f64::from(blocks[block].count[lane]) } else { least };
            if inherited + area < stop.increase {
                stop = Stop { increase: inherited + area, node, pair_among: None, grown: grown.len() };
            }
        }
        if (is_leaf || R::PAIR_INNER) && above + 2.0 * area < stop.increase {
            let increase = above + 2.0 * area;
            stop = Stop { increase, node, pair_among: Some(first), grown: grown.len() };
        }
        if is_leaf {
            break;
        }
        (first, count) = family(blocks, node);
    }
    stop
}

/// Makes the object a child of the stop, or of a new inner node in its stead. Returns the place of the grown node.
#[inline(always)]
fn attach<R: Rule>(blocks: &mut Vec<Block>, stop: &Stop, object: &Object, id: u32) -> u32 {
    let (mut block, mut lane) = place(stop.node);
    if let Some(among) = stop.pair_among {
        if blocks[block].is_leaf(lane) {
            // It changes places with the first leaf, so that inner nodes stay in front.
            let mut front = among;
            while !blocks[front].is_leaf(LANES - 1) {
                front += 1;
            }
            let mut front_lane = 0;
            while !blocks[front].is_leaf(front_lane) {
                front_lane += 1;
            }
            let (leaf, other) = (blocks[block], blocks[front]);
            blocks[block].copy(lane, &other, front_lane);
            blocks[front].copy(front_lane, &leaf, lane);
            (block, lane) = (front, front_lane);
        }
        let mut pair = Block::EMPTY;
        pair.copy(0, &blocks[block], lane);
        pair.put_leaf(1, object, id, R::leaf_area(object));
        blocks[block].link[lane] = blocks.len() as u32;
        blocks[block].count[lane] = 2;
        blocks.push(pair);
    } else {
        let (mut first, count) = family(blocks, stop.node);
        let full = count / LANES;
        if count % LANES == 0 && full.is_power_of_two() {
            let moved = blocks.len();
            blocks.extend_from_within(first..first + full);
            blocks.resize(moved + 2 * full, Block::EMPTY);
            blocks[block].link[lane] = moved as u32;
            first = moved;
        }
        blocks[first + full].put_leaf(count % LANES, object, id, R::leaf_area(object));
        blocks[block].count[lane] += 1;
    }
    (block * LANES + lane) as u32
}
