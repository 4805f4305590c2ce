//! A KD-tree by the surface area heuristic: a baseline for comparison with bounding volume
//! hierarchies.
//!
//! Wald & Havran 2006, 'On building fast kd-trees for ray tracing, and on doing that in O(N log
//! N)', section 4.3.
//!
//! Differs from the paper: objects are boxes, whose perfect split is the box clipped to the cell.
//! Events are therefore never regenerated or merged: events outside a cell are no candidates, and
//! lists stay sorted. The depth (Pharr, Jakob & Humphreys, Physically Based Rendering, 4.4) and the
//! number of references are bounded.
//!
//! The traversal gives the same answers as a test of every object: a ray's interval in a cell is
//! computed by the operations of [`Slabs`] and is only ever cut by split planes. If an object's box is
//! on one side of a plane, its interval is therefore within the interval of that side. A box on both
//! sides is referenced from both, and the two intervals overlap. Hence the traversal skips no cell
//! that contains a hit. A hit outside the current cell counts as well, and cells that begin behind
//! the hit are skipped.

use bvh_build::{BuildError, check_scene};
use bvh_core::{Aabb, Counter, Hit, Ray, Slabs};
use std::ops::ControlFlow;

/// The paper's constants of the surface area heuristic, in units of time: to step through a cell,
/// and to test an object.
const TRAVERSAL: f64 = 15.0;
const INTERSECTION: f64 = 20.0;
/// The paper's factor on the cost of a split that cuts off empty space.
const EMPTY_FACTOR: f64 = 0.8;
/// The limit on references per object. Wald & Havran report 2 to 6 for meshes.
const MAX_REFERENCES: usize = 16;

/// A tree of cells that fill the root's box without overlap. Every leaf that an object's box
/// overlaps names the object.
#[derive(Clone, Debug)]
pub struct KdTree {
    /// The box around all objects.
    bounds: Aabb,
    /// The cells, the root first. Siblings are adjacent and come after their parent.
    cells: Vec<Cell>,
    /// The objects of all leaves, one leaf after the other.
    objects: Vec<u32>,
    depth: usize,
}

#[derive(Clone, Copy, Debug)]
enum Cell {
    /// A cell that a plane splits. The child below the plane is at index `below`, and the child
    /// above it is at the next index.
    Inner { axis: u8, position: f32, below: u32 },
    /// A leaf with a range of [`KdTree::objects`].
    Leaf { first: u32, count: u32 },
}

/// The start or the end of an object's box along an axis. At equal positions ends come first and
/// starts last: a box that ends at a plane is not above the plane, and a box that starts there is
/// not below.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Event {
    position: f32,
    kind: Kind,
    object: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    End,
    /// The start and the end of a box without extent along the axis.
    Planar,
    Start,
}

struct Split {
    axis: usize,
    position: f32,
    /// True if boxes in the plane go below it, and false if they go above it.
    planar_below: bool,
    /// The numbers of objects below and above the plane.
    counts: [usize; 2],
}

struct Frame {
    cell: usize,
    bounds: Aabb,
    events: [Vec<Event>; 3],
    count: usize,
    depth: usize,
    /// The upper limit on the number of references in the leaves below.
    budget: usize,
}

impl KdTree {
    /// The limit on the depth in [`build`](Self::build) for 2^31 objects, more than a scene can have.
    const MAX_DEPTH: usize = 49;

    /// Builds a tree over `boxes`; `boxes[i]` bounds object `i`. No boxes give the tree without
    /// cells. O(n log n).
    ///
    /// The tree is at most 8 + 1.3 log₂ n deep and has at most 16 references per object.
    pub fn build(boxes: &[Aabb]) -> Result<Self, BuildError> {
        check_scene(boxes)?;
        let n = boxes.len();
        let bounds = Aabb::union_of(boxes);
        let mut tree = Self { bounds, cells: vec![], objects: vec![], depth: 0 };
        if n == 0 {
            return Ok(tree);
        }
        let max_depth = ((8.0 + 1.3 * libm::log2(n as f64)) as usize).min(Self::MAX_DEPTH);
        let mut sides = vec![[true; 2]; n];
        let placeholder = Cell::Leaf { first: 0, count: 0 };
        tree.cells.push(placeholder);
        let budget = n.saturating_mul(MAX_REFERENCES).min(u32::MAX as usize);
        let events = [0, 1, 2].map(|axis| events(boxes, axis));
        let mut stack = vec![Frame { cell: 0, bounds, events, count: n, depth: 0, budget }];
        while let Some(frame) = stack.pop() {
            tree.depth = tree.depth.max(frame.depth);
            let split = if frame.depth < max_depth { frame.best_split() } else { None };
            let Some(split) = split else {
                let first = tree.objects.len();
                // Every object has exactly one event that is not an end.
                let starts = frame.events[0].iter().filter(|event| event.kind != Kind::End);
                tree.objects.extend(starts.map(|event| event.object));
                tree.objects[first..].sort_unstable();
                tree.cells[frame.cell] =
                    Cell::Leaf { first: first as u32, count: frame.count as u32 };
                continue;
            };
            let below = tree.cells.len();
            tree.cells.extend([placeholder; 2]);
            let Split { axis, position, counts, .. } = split;
            tree.cells[frame.cell] =
                Cell::Inner { axis: axis as u8, position, below: below as u32 };
            for event in &frame.events[axis] {
                sides[event.object as usize] = split.sides(&boxes[event.object as usize]);
            }
            let halves = frame.bounds.halves(axis, position);
            for side in [1, 0] {
                let count = counts[side];
                let is_here = |event: &&Event| sides[event.object as usize][side];
                // Filtering keeps the lists sorted.
                let events = [0, 1, 2]
                    .map(|axis| frame.events[axis].iter().filter(is_here).copied().collect());
                // The product can exceed 64 bits.
                let share = frame.budget as u128 * count as u128 / (counts[0] + counts[1]) as u128;
                stack.push(Frame {
                    cell: below + side,
                    bounds: halves[side],
                    events,
                    count,
                    depth: frame.depth + 1,
                    budget: share as usize,
                });
            }
        }
        Ok(tree)
    }

    /// Returns the number of references from leaves to objects: at least the number of objects.
    pub fn references(&self) -> usize {
        self.objects.len()
    }

    /// Returns the number of edges from the root to the deepest leaf; 0 for the tree without cells.
    pub fn depth(&self) -> usize {
        self.depth
    }
}

impl Frame {
    /// Returns the cheapest split within the budget, or `None` if a leaf is cheaper. Ties go to the
    /// lower axis and position.
    fn best_split(&self) -> Option<Split> {
        let mut best: Option<Split> = None;
        let mut limit = INTERSECTION * self.count as f64;
        let area = self.bounds.half_area();
        let extent = self.bounds.extent();
        for axis in 0..3 {
            let low = self.bounds.min[axis];
            let high = self.bounds.max[axis];
            let u = extent[(axis + 1) % 3];
            let v = extent[(axis + 2) % 3];
            // The probability that a line through the cell meets the part of this length, or the
            // part's share of the length if the cell has no area.
            let chance = |length: f64| {
                if area > 0.0 { (u * v + length * (u + v)) / area } else { length / extent[axis] }
            };
            let mut below = 0;
            let mut above = self.count;
            for group in self.events[axis].chunk_by(|a, b| a.position == b.position) {
                let position = group[0].position;
                let ends = group.partition_point(|event| event.kind == Kind::End);
                let planar = group.partition_point(|event| event.kind <= Kind::Planar) - ends;
                above -= ends + planar;
                if low < position && position < high {
                    let chance_below = chance(f64::from(position) - f64::from(low));
                    let chance_above = chance(f64::from(high) - f64::from(position));
                    // Objects in the plane may go to either side; below comes first and wins ties.
                    let choices: &[bool] = if planar > 0 { &[true, false] } else { &[true] };
                    for &planar_below in choices {
                        let below = below + if planar_below { planar } else { 0 };
                        let above = above + if planar_below { 0 } else { planar };
                        let tests = chance_below * below as f64 + chance_above * above as f64;
                        let factor = if below == 0 || above == 0 { EMPTY_FACTOR } else { 1.0 };
                        let cost = factor * (TRAVERSAL + INTERSECTION * tests);
                        if cost < limit && below + above <= self.budget {
                            limit = cost;
                            let counts = [below, above];
                            best = Some(Split { axis, position, planar_below, counts });
                        }
                    }
                }
                below += group.len() - ends;
            }
        }
        best
    }
}

impl Split {
    /// Returns whether the object is below the plane, and whether it is above it.
    fn sides(&self, object: &Aabb) -> [bool; 2] {
        let (min, max) = (object.min[self.axis], object.max[self.axis]);
        if min == self.position && max == self.position {
            return [self.planar_below, !self.planar_below];
        }
        [min < self.position, max > self.position]
    }
}

fn events(boxes: &[Aabb], axis: usize) -> Vec<Event> {
    let mut events = Vec::with_capacity(2 * boxes.len());
    for (b, object) in boxes.iter().zip(0..) {
        // Adding 0 turns −0 into +0, which `total_cmp` would order apart.
        let min = b.min[axis] + 0.0;
        let max = b.max[axis] + 0.0;
        if min == max {
            events.push(Event { position: min, kind: Kind::Planar, object });
        } else {
            events.push(Event { position: min, kind: Kind::Start, object });
            events.push(Event { position: max, kind: Kind::End, object });
        }
    }
    events.sort_by(|a, b| a.position.total_cmp(&b.position).then(a.kind.cmp(&b.kind)));
    events
}

impl KdTree {
    /// Returns the nearest object that `ray` hits in its range; of several at the same distance,
    /// the object with the lowest id. Accepts the same `test` as [`bvh_core::nearest_hit_by`] and
    /// gives the same answer, bit for bit.
    ///
    /// `counter` counts the root's box and every visited split plane as one box each. It counts
    /// every test of an object, which may happen once in each cell that the object overlaps.
    #[inline]
    pub fn nearest_hit(
        &self,
        ray: &Ray,
        mut test: impl FnMut(u32, f32) -> Option<f32>,
        counter: &mut impl Counter,
    ) -> Option<Hit> {
        let mut nearest: Option<Hit> = None;
        let _ = self.walk(ray, counter, |object, t_max| {
            if let Some(t) = test(object, *t_max)
                && t <= *t_max
            {
                let hit = Hit { t, object };
                // Cells may return equal distances in any order; the lowest id decides.
                if nearest.is_none_or(|nearest| hit.precedes(&nearest)) {
                    nearest = Some(hit);
                    *t_max = t;
                }
            }
            ControlFlow::Continue(())
        });
        nearest
    }

    /// Returns whether `ray` hits any object in its range; see [`bvh_core::any_hit_by`] and
    /// [`nearest_hit`](Self::nearest_hit).
    #[inline]
    pub fn any_hit(
        &self,
        ray: &Ray,
        mut test: impl FnMut(u32) -> bool,
        counter: &mut impl Counter,
    ) -> bool {
        let visit = |object, _: &mut f32| match test(object) {
            true => ControlFlow::Break(()),
            false => ControlFlow::Continue(()),
        };
        self.walk(ray, counter, visit).is_break()
    }

    /// Calls `visit` with the objects of every leaf on the ray, from near to far, until it breaks.
    /// It may lower the distance beyond which cells are skipped.
    #[inline(always)]
    fn walk(
        &self,
        ray: &Ray,
        counter: &mut impl Counter,
        mut visit: impl FnMut(u32, &mut f32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        if self.cells.is_empty() {
            return ControlFlow::Continue(());
        }
        let slabs = Slabs::new(ray, &self.bounds);
        let backwards = ray.inverse_direction().to_array().map(|inverse| inverse < 0.0);
        let mut t_max = ray.t_max();
        counter.boxes(1);
        let (mut entry, mut exit) = slabs.interval(&self.bounds);
        if entry > exit || entry > t_max {
            return ControlFlow::Continue(());
        }
        // Every level adds at most one pending cell, so the stack cannot overflow.
        let mut stack = [(0, 0.0, 0.0); Self::MAX_DEPTH];
        let mut pending = 0;
        let mut cell = 0;
        loop {
            match self.cells[cell] {
                Cell::Leaf { first, count } => {
                    for &object in &self.objects[first as usize..][..count as usize] {
                        counter.object();
                        visit(object, &mut t_max)?;
                    }
                }
                Cell::Inner { axis, position, below } => {
                    counter.boxes(1);
                    let (far_entry, near_exit) = slabs.crossing(axis.into(), position);
                    let near = below as usize + usize::from(backwards[usize::from(axis)]);
                    let far = below as usize + usize::from(!backwards[usize::from(axis)]);
                    let far_entry = far_entry.max(entry);
                    let near_exit = near_exit.min(exit);
                    let near_met = entry <= near_exit;
                    let far_met = far_entry <= exit && far_entry <= t_max;
                    if near_met {
                        if far_met {
                            stack[pending] = (far, far_entry, exit);
                            pending += 1;
                        }
                        (cell, exit) = (near, near_exit);
                        continue;
                    }
                    if far_met {
                        (cell, entry) = (far, far_entry);
                        continue;
                    }
                }
            }
            loop {
                if pending == 0 {
                    return ControlFlow::Continue(());
                }
                pending -= 1;
                (cell, entry, exit) = stack[pending];
                if entry <= t_max {
                    break;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    /// Makes boxes between points of a small grid: many are flat, identical or nested, and many
    /// faces coincide.
    fn boxes() -> impl Strategy<Value = Vec<Aabb>> {
        let corners = prop::array::uniform2(prop::array::uniform3(-3i8..4));
        let b = corners.prop_map(|corners| {
            Aabb::around(corners.map(|corner| Vec3::from(corner.map(|c| f32::from(c) * 0.75))))
        });
        prop::collection::vec(b, 0..120)
    }

    proptest! {
        #[test]
        fn trees_have_few_levels_and_references(boxes in boxes()) {
            let tree = KdTree::build(&boxes).unwrap();
            prop_assert!(tree.references() >= boxes.len() && tree.references() <= 16 * boxes.len());
            prop_assert!(tree.depth() as f64 <= 8.0 + 1.3 * libm::log2(boxes.len().max(1) as f64));
        }
    }
}
