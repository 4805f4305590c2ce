//! The candidate splits of one node: every position along every axis, evaluated by two scans per
//! axis.

use super::rule::{Shortlist, Split, SplitRule};
use super::split_cost::{Linear, SplitCost};
use bvh_core::PackedAabb;

/// Objects per block of a scan; nodes with up to twice this number form one block. Blocks of 8 and
/// of 32 were slower.
const BLOCK: usize = 16;

/// In a balanced split, either side has at least one in `BALANCED` objects.
const BALANCED: u32 = 8;

/// The surroundings of one block of consecutive objects in a node's order.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    /// The box of all objects before the block, their load, and their value as a left side.
    left: PackedAabb,
    left_load: f64,
    left_value: f64,
    /// The box of all objects after the block, their load, and their value as a right side.
    right: PackedAabb,
    right_load: f64,
    right_value: f64,
}

impl Block {
    const NONE: Self = Self {
        left: PackedAabb::EMPTY,
        left_load: 0.0,
        left_value: 0.0,
        right: PackedAabb::EMPTY,
        right_load: 0.0,
        right_value: 0.0,
    };
}

/// The objects of one node in the order of each axis, ready to be scanned. At least two objects.
#[derive(Debug)]
pub(super) struct Sweep<'a, C> {
    pub(super) boxes: &'a [PackedAabb],
    pub(super) split_cost: &'a C,
    pub(super) orders: [&'a [u32]; 3],
    /// Per axis, the lowest axis known to order the node's objects identically, usually the same
    /// axis.
    pub(super) same_as: [u8; 3],
    pub(super) aabb: PackedAabb,
    /// Per axis, the blocks of its last scan.
    pub(super) blocks: &'a mut [Vec<Block>; 3],
}

impl<C: SplitCost> Sweep<'_, C> {
    /// Returns the split that the rule chooses from its shortlist. `list` is a buffer. O(n) unless
    /// the shortlist is long.
    #[inline(always)]
    pub fn choose(&mut self, rule: &mut dyn SplitRule, list: &mut Vec<Split>) -> Split {
        let shortlist = rule.shortlist();
        list.clear();
        if let Shortlist::KBest(k) = shortlist {
            self.collect(k, f64::INFINITY, list);
        } else {
            let best = self.bests(shortlist, list);
            match shortlist {
                Shortlist::Within(alpha) => {
                    self.collect(usize::MAX, best.cost * (1.0 + alpha), list);
                    // A best cost of 0, or a rounded limit, excludes the best candidate itself.
                    if !list.contains(&best) {
                        list.push(best);
                    }
                }
                Shortlist::AxisBests => {}
                _ => return best,
            }
            list.sort_unstable_by(Split::rank);
        }
        list[rule.choose(list)]
    }

    /// Returns the best candidate, of one axis if the shortlist is about one. If it is about each
    /// axis, adds the best candidate of each axis to `list` instead.
    #[inline(always)]
    fn bests(&mut self, shortlist: Shortlist, list: &mut Vec<Split>) -> Split {
        let is_of_each = matches!(shortlist, Shortlist::AxisBests);
        let only = match shortlist {
            Shortlist::AxisBest(axis) => Some(self.same_as[axis as usize]),
            _ => None,
        };
        let mut best = Split::NONE;
        for axis in 0..3 {
            // Identical orders have identical candidates, and ties prefer the lower axis.
            let same = self.same_as[axis as usize];
            if only.map_or(same == axis, |only| only == axis) {
                // The loop calls the scan once, whatever the shortlist, because the scan is large
                // and inlined.
                best = self.improve(axis, if is_of_each { Split::NONE } else { best });
            }
            if is_of_each {
                list.push(if same == axis { best } else { list[same as usize] });
            }
        }
        best
    }

    /// Adds the `k` best candidates of all axes to `list`, best first. If `k` is `usize::MAX`, adds
    /// all that cost less than `limit` instead, in any order. Expected O(n) for small `k`, O(n·k)
    /// at worst.
    #[inline(always)]
    fn collect(&mut self, k: usize, limit: f64, list: &mut Vec<Split>) {
        let bound = |list: &[Split]| if list.len() < k { limit } else { list[k - 1].cost };
        for axis in self.distinct_axes() {
            self.scan::<false>(axis, bound(list), |candidate| {
                if k == usize::MAX {
                    if candidate.cost < limit {
                        list.push(candidate);
                    }
                } else if candidate.cost <= bound(list) {
                    let mut index = list.len();
                    while index > 0 && candidate.rank(&list[index - 1]).is_lt() {
                        index -= 1;
                    }
                    // Insertion keeps the list sorted; k is small.
                    list.insert(index, candidate);
                    list.truncate(k);
                }
                bound(list)
            });
        }
    }

    /// Returns the balanced split, with at least one in [`BALANCED`] objects on either side, of
    /// least size times load. O(n).
    #[inline(never)]
    pub(super) fn best_balanced(&mut self) -> Split {
        let split_cost = &Linear(self.split_cost);
        let &mut Sweep { boxes, orders, same_as, aabb, ref mut blocks, .. } = self;
        let mut linear = Sweep { boxes, split_cost, orders, same_as, aabb, blocks };
        let all = linear.len() as u32;
        let mut best = Split::NONE;
        for axis in linear.distinct_axes() {
            linear.scan::<false>(axis, best.cost, |candidate| {
                let least = candidate.left.min(all - candidate.left);
                if least >= all / BALANCED && candidate.rank(&best).is_lt() {
                    best = candidate;
                }
                best.cost
            });
        }
        best
    }

    #[inline(always)]
    fn improve(&mut self, axis: u8, mut best: Split) -> Split {
        self.scan::<true>(axis, best.cost, |candidate| {
            if candidate.cost <= best.cost && candidate.rank(&best).is_lt() {
                best = candidate;
            }
            best.cost
        });
        best
    }

    /// Returns the number of objects in the node.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.orders[0].len()
    }

    /// Returns the axes to scan. Identical orders have identical candidates, and ties prefer the
    /// lower axis.
    #[inline(always)]
    fn distinct_axes(&self) -> impl Iterator<Item = u8> + use<C> {
        let same_as = self.same_as;
        (0..3).filter(move |&axis| same_as[axis as usize] == axis)
    }

    /// Calls `visit` once for every candidate of `axis` that costs at most `bound`, and for some
    /// others, in any order. `visit` returns the new bound. With `BEST`, the scan may skip a
    /// candidate if it visits a cheaper one later.
    ///
    /// The scan processes objects in blocks. One pass gathers each block's box, and scans over the
    /// blocks from both ends evaluate the candidates between blocks. A side's value only grows as
    /// it gains objects, so the left side at a block's start and the right side at its end bound
    /// the cost of every candidate inside. Most blocks need no further examination.
    ///
    /// Source: Ng & Trifonov 2003, section 3.2. Differs from the paper: the blocks, which change no
    /// result.
    #[inline(always)]
    fn scan<const BEST: bool>(
        &mut self,
        axis: u8,
        mut bound: f64,
        mut visit: impl FnMut(Split) -> f64,
    ) {
        let Self { boxes, split_cost, .. } = self;
        let order = self.orders[axis as usize];
        let n = order.len();
        let candidate = |cost, left: usize| Split {
            cost,
            axis,
            left: left as u32,
            imbalance: n.abs_diff(2 * left) as u32,
        };

        if boxes[order[0] as usize] == self.aabb && boxes[order[n - 1] as usize] == self.aabb {
            // The first and the last object fill the node's box, so every side of every candidate
            // has that box, and all candidates cost the same except for rounding. Halve the node.
            let area = split_cost.size(&self.aabb);
            let (left, right) = order.split_at(n / 2);
            let [left, right] =
                [left, right].map(|side| split_cost.side(area, split_cost.total_load(side)));
            // `side_boxes` must not use the blocks of another node.
            self.blocks[axis as usize].clear();
            visit(candidate(split_cost.join(left, right), n / 2));
            return;
        }
        // A small node is a single block without surroundings.
        let (size, blocks) = if n <= 2 * BLOCK {
            (n, &[Block::NONE][..])
        } else {
            let blocks = &mut self.blocks[axis as usize];
            gather_blocks(boxes, *split_cost, order, blocks);
            for (index, pair) in blocks.windows(2).enumerate() {
                let cost = split_cost.join(pair[1].left_value, pair[0].right_value);
                bound = visit(candidate(cost, (index + 1) * BLOCK));
            }
            (BLOCK, &blocks[..])
        };
        let mut costs = [0.0; 2 * BLOCK];
        for (index, (block, objects)) in blocks.iter().zip(order.chunks(size)).enumerate() {
            // Equal costs must be visited, because ties are decided by rank.
            if split_cost.bound(block.left_value, block.right_value) > bound {
                continue;
            }
            let lowest = value_block(boxes, *split_cost, objects, block, &mut costs);
            bound = if BEST { bound.min(lowest) } else { bound };
            if lowest <= bound {
                let first = index * size + 1;
                for (left, &cost) in (first..).zip(&costs[1..objects.len()]) {
                    if cost <= bound {
                        bound = visit(candidate(cost, left));
                    }
                }
            }
        }
    }

    /// Returns the boxes of both sides of a candidate that a method of this sweep returned. O(1)
    /// except for small nodes.
    #[inline(always)]
    pub(super) fn side_boxes(&self, split: &Split) -> [PackedAabb; 2] {
        let axis = split.axis as usize;
        let left = split.left as usize;
        let order = self.orders[axis];
        if order.len() <= 2 * BLOCK {
            let (left, right) = order.split_at(left);
            return [union_of(self.boxes, left), union_of(self.boxes, right)];
        }
        let Some(block) = self.blocks[axis].get(left / BLOCK) else { return [self.aabb; 2] };
        let start = left / BLOCK * BLOCK;
        let end = order.len().min(start + BLOCK);
        [
            block.left.union(&union_of(self.boxes, &order[start..left])),
            block.right.union(&union_of(self.boxes, &order[left..end])),
        ]
    }
}

/// Computes the surroundings of every block of `order`.
#[inline(always)]
fn gather_blocks<C: SplitCost>(
    boxes: &[PackedAabb],
    split_cost: &C,
    order: &[u32],
    blocks: &mut Vec<Block>,
) {
    blocks.clear();
    // `left` first stores the block's box, and later the box of all objects before the block.
    blocks.extend(
        order.chunks(BLOCK).map(|objects| Block { left: union_of(boxes, objects), ..Block::NONE }),
    );
    let mut aabb = PackedAabb::EMPTY;
    let mut load = 0.0;
    for (block, objects) in blocks.iter_mut().zip(order.chunks(BLOCK)).rev() {
        // An empty side has no value; its candidates do not exist.
        if aabb != PackedAabb::EMPTY {
            block.right_value = split_cost.side(split_cost.size(&aabb), load);
        }
        (block.right, block.right_load) = (aabb, load);
        aabb.grow(&block.left);
        load += split_cost.total_load(objects);
    }
    let mut aabb = PackedAabb::EMPTY;
    let mut load = 0.0;
    for (block, objects) in blocks.iter_mut().zip(order.chunks(BLOCK)) {
        if aabb != PackedAabb::EMPTY {
            block.left_value = split_cost.side(split_cost.size(&aabb), load);
        }
        let of_block = std::mem::replace(&mut block.left, aabb);
        block.left_load = load;
        aabb.grow(&of_block);
        load += split_cost.total_load(objects);
    }
}

/// Computes the costs of the candidates inside one block and returns the lowest: `costs[i]` for i
/// of the block's objects on the left, 1 ≤ i < objects. It has no branches, because a build spends
/// most of its time in small nodes, where they are unpredictable.
#[inline(always)]
fn value_block<C: SplitCost>(
    boxes: &[PackedAabb],
    split_cost: &C,
    objects: &[u32],
    block: &Block,
    costs: &mut [f64; 2 * BLOCK],
) -> f64 {
    let mut aabb = block.right;
    let mut load = block.right_load;
    for (&object, value) in objects[1..].iter().zip(&mut costs[1..objects.len()]).rev() {
        aabb.grow(&boxes[object as usize]);
        load += split_cost.load(object);
        *value = split_cost.side(split_cost.size(&aabb), load);
    }
    let mut aabb = block.left;
    let mut load = block.left_load;
    let mut lowest = f64::INFINITY;
    for (&object, cost) in objects[..objects.len() - 1].iter().zip(&mut costs[1..]) {
        aabb.grow(&boxes[object as usize]);
        load += split_cost.load(object);
        *cost = split_cost.join(split_cost.side(split_cost.size(&aabb), load), *cost);
        lowest = if *cost < lowest { *cost } else { lowest };
    }
    lowest
}

#[inline(always)]
pub(super) fn union_of(boxes: &[PackedAabb], objects: &[u32]) -> PackedAabb {
    let mut aabb = PackedAabb::EMPTY;
    for &object in objects {
        aabb.grow(&boxes[object as usize]);
    }
    aabb
}
