//! The portable kernel: traversal of the wide layout by safe code for any machine, which can count
//! its tests.

use super::layout::{Child, WideBvh, WideNode};
use super::triangles::TriangleBlock;
use crate::{Counter, Hit, PreparedRay, Ray, Slabs};
use smallvec::SmallVec;

/// A child that the ray enters at `entry`, to be visited later.
#[derive(Clone, Copy)]
struct Pending {
    entry: f32,
    child: Child,
}

/// Returns the distances at which the ray enters and leaves the boxes of a node. The first exceeds
/// the second for a box that it misses.
#[inline(always)]
pub(super) fn intervals(slabs: &Slabs, node: &WideNode) -> ([f32; 8], [f32; 8]) {
    let mut entry = [slabs.ray.t_min(); 8];
    let mut exit = [f32::INFINITY; 8];
    if slabs.is_far() {
        for lane in 0..8 {
            let miss = (f32::INFINITY, f32::NEG_INFINITY);
            (entry[lane], exit[lane]) =
                node.lane_box(lane).map_or(miss, |aabb| slabs.interval(&aabb));
        }
        return (entry, exit);
    }
    for axis in 0..3 {
        let lower = (&node.planes[axis], slabs.lower[axis]);
        let upper = (&node.planes[axis + 3], slabs.upper[axis]);
        let is_backwards = slabs.near[axis] < 0.0;
        let (near, far) = if is_backwards { (upper, lower) } else { (lower, upper) };
        for lane in 0..8 {
            let t = (near.0[lane] - near.1) * slabs.near[axis];
            entry[lane] = if t > entry[lane] { t } else { entry[lane] };
            let t = (far.0[lane] - far.1) * slabs.far[axis];
            exit[lane] = if t < exit[lane] { t } else { exit[lane] };
        }
    }
    (entry, exit)
}

/// Returns the nearest hit, or with `ANY` the first one found, among those that `accept` accepts.
#[inline(never)]
pub(crate) fn walk<const ANY: bool>(
    wide: &WideBvh,
    ray: &Ray,
    counter: &mut impl Counter,
    mut accept: impl FnMut(Hit) -> bool,
) -> Option<Hit> {
    let prepared = PreparedRay::new(ray);
    let visit = |block: &TriangleBlock, nearest: &mut Hit| {
        let mut is_nearer = false;
        for lane in 0..TriangleBlock::LANES {
            if let Some((object, triangle)) = block.triangle(lane)
                && let Some(t) = triangle.intersect(&prepared, nearest.t)
            {
                let hit = Hit { t, object };
                if hit.precedes(nearest) && accept(hit) {
                    *nearest = hit;
                    is_nearer = true;
                    if ANY {
                        break;
                    }
                }
            }
        }
        is_nearer
    };
    let slabs = wide.slabs(ray);
    let intervals = |node: &WideNode| intervals(&slabs, node);
    let nearest = traverse::<ANY>(wide, ray.t_max(), intervals, counter, visit);
    (!nearest.is_miss()).then_some(nearest)
}

/// Visits the leaves up to the nearest hit, or with `ANY` up to the first hit that is found, in no
/// order. `intervals` returns where the boxes of a node begin and end, and the first exceeds the
/// second for a box to leave out. `visit` tests a block, and returns whether the nearest hit is a
/// new one.
#[inline(always)]
pub(crate) fn traverse<const ANY: bool>(
    wide: &WideBvh,
    t_max: f32,
    intervals: impl Fn(&WideNode) -> ([f32; 8], [f32; 8]),
    counter: &mut impl Counter,
    mut visit: impl FnMut(&TriangleBlock, &mut Hit) -> bool,
) -> Hit {
    let mut nearest = Hit { t: t_max, object: u32::MAX };
    let Some(mut child) = wide.root else { return nearest };
    let mut stack = SmallVec::<[Pending; 32]>::new();
    let mut entered = [Pending { entry: 0.0, child: Child::node(0) }; 8];
    loop {
        if child.is_node() {
            counter.boxes(WideNode::LANES);
            let node = &wide.nodes[child.index()];
            if let Some(last) = enter::<ANY>(node, intervals(node), nearest.t, &mut entered) {
                child = entered[last].child;
                stack.extend_from_slice(&entered[..last]);
                continue;
            }
        } else {
            for block in &wide.blocks[child.index()..] {
                (0..TriangleBlock::LANES).for_each(|_| counter.object());
                if visit(block, &mut nearest) && ANY {
                    return nearest;
                }
                if block.is_last() {
                    break;
                }
            }
        }
        child = loop {
            let Some(pending) = stack.pop() else { return nearest };
            if pending.entry <= nearest.t {
                break pending.child;
            }
        };
    }
}

/// Writes the children that are entered before `t_max`, the nearest last, or with `ANY` in the order
/// of their lanes. Returns the index of the last; `None` if there are none.
#[inline(always)]
fn enter<const ANY: bool>(
    node: &WideNode,
    (entry, exit): ([f32; 8], [f32; 8]),
    t_max: f32,
    entered: &mut [Pending; 8],
) -> Option<usize> {
    let mut count = 0;
    for lane in 0..8 {
        if entry[lane] <= exit[lane] && entry[lane] <= t_max {
            // Insertion; the higher lane is nearer on ties, for example where the ray begins in
            // both boxes.
            let mut at = count;
            while !ANY && at > 0 && entered[at - 1].entry < entry[lane] {
                entered[at] = entered[at - 1];
                at -= 1;
            }
            entered[at] = Pending { entry: entry[lane], child: node.children[lane] };
            count += 1;
        }
    }
    count.checked_sub(1usize)
}
