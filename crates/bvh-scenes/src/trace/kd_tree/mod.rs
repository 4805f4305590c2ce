//! A KD-tree by the surface area heuristic: a baseline for comparison with bounding volume hierarchies.
//!
//! Wald & Havran 2006, 'On building fast kd-trees for ray tracing, and on doing that in O(N log N)', section 4.3.
//!
//! Differs from the paper: objects are boxes, whose perfect split is the box clipped to the cell. So events are never
//! regenerated or merged: those outside a cell are no candidates, and lists stay sorted. The depth (Pharr, Jakob &
//! Humphreys, Physically Based Rendering, 4.4) and the number of references are bounded.

mod traverse;

use bvh_build::{BuildError, check_scene};
use bvh_config::{Check, above};
use bvh_core::Aabb;

bvh_config::config! {
    /// How to split: constants of the surface area heuristic, in any unit of time. The defaults are the paper's.
    pub struct Config {
        /// Time to step through a cell.
        traversal: f64 = 15.0, in above(0.0);
        /// Time to test an object.
        intersection: f64 = 20.0, in 0.0..;
        /// Factor on the cost of a split that cuts off empty space.
        empty_factor: f64 = 0.8, in 0.0..=1.0;
    }
}

/// A tree of cells that fill the root's box without overlap. An object is named by every leaf that its box overlaps.
#[derive(Clone, Debug)]
pub struct KdTree {
    /// The box around all objects.
    bounds: Aabb,
    /// The root first; siblings are adjacent and come after their parent.
    cells: Vec<Cell>,
    objects: Vec<u32>,
    depth: usize,
}

#[derive(Clone, Copy, Debug)]
enum Cell {
    /// Cut at `position`. The child below the plane is at index `below`, the child above it at the next index.
    Inner { axis: u8, position: f32, below: u32 },
    /// Names a range of `objects`.
    Leaf { first: u32, count: u32 },
}

impl KdTree {
    /// The limit on the depth in [`Config::build`] for 2^31 objects, more than there can be.
    const MAX_DEPTH: usize = 49;

    /// Number of cells, inner ones included.
    pub fn cells(&self) -> usize {
        self.cells.len()
    }

    /// Number of times that leaves name an object: at least the number of objects.
    pub fn references(&self) -> usize {
        self.objects.len()
    }

    /// Edges from the root to the deepest leaf; 0 for the tree without cells.
    pub fn depth(&self) -> usize {
        self.depth
    }
}

/// The beginning or the end of an object's box along an axis. At equal positions ends come first and starts last: a box
/// that ends at a plane is not above it, and one that starts there is not below.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Event {
    position: f32,
    kind: Kind,
    object: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Kind {
    End,
    /// Both, for a box without extent along the axis.
    Planar,
    Start,
}

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Below,
    Above,
    Both,
}

struct Split {
    axis: usize,
    position: f32,
    /// Whether boxes that lie in the plane go below it rather than above.
    planar_below: bool,
    below: usize,
    above: usize,
}

/// A cell that is still to be made.
struct Frame {
    cell: usize,
    bounds: Aabb,
    events: [Vec<Event>; 3],
    count: usize,
    depth: usize,
    /// Upper limit on the references of the leaves below.
    budget: usize,
}

impl Config {
    /// References per object that a tree may have. Wald & Havran report 2 to 6 for meshes.
    const MAX_REFERENCES: usize = 16;

    /// Builds a tree over `boxes`; `boxes[i]` bounds object `i`. No boxes give the tree without cells. O(n log n).
    ///
    /// At most 8 + 1.3 log₂ n deep, with at most 16 references per object.
    pub fn build(&self, boxes: &[Aabb]) -> Result<KdTree, BuildError> {
        check_scene(boxes)?;
        self.check()?;
        let n = boxes.len();
        let bounds = boxes
            .iter()
            .fold(Aabb::EMPTY, |all, b| all.union(b));
        let mut tree = KdTree { bounds, cells: vec![], objects: vec![], depth: 0 };
        if n == 0 {
            return Ok(tree);
        }
        let max_depth = ((8.0 + 1.3 * libm::log2(n as f64)) as usize).min(KdTree::MAX_DEPTH);
        let mut sides = vec![Side::Both; n];
        let placeholder = Cell::Leaf { first: 0, count: 0 };
        tree.cells.push(placeholder);
        let budget = n
            .saturating_mul(Self::MAX_REFERENCES)
            .min(u32::MAX as usize);
        let events = [0, 1, 2].map(|axis| events(boxes, axis));
        let mut stack = vec![Frame { cell: 0, bounds, events, count: n, depth: 0, budget }];
        while let Some(frame) = stack.pop() {
            tree.depth = tree.depth.max(frame.depth);
            let split = if frame.depth < max_depth { self.best_split(&frame) } else { None };
            let Some(split) = split else {
                let first = tree.objects.len();
                let own = frame.events[0]
                    .iter()
                    .filter(|event| event.kind != Kind::End);
                tree.objects.extend(own.map(|event| event.object));
                tree.objects[first..].sort_unstable();
                tree.cells[frame.cell] =
                    Cell::Leaf { first: first as u32, count: frame.count as u32 };
                continue;
            };
            let below = tree.cells.len();
            tree.cells.extend([placeholder; 2]);
            let axis = split.axis;
            let position = split.position;
            tree.cells[frame.cell] =
                Cell::Inner { axis: axis as u8, position, below: below as u32 };
            for event in &frame.events[axis] {
                sides[event.object as usize] = split.side(&boxes[event.object as usize]);
            }
            let part = |side: Side| {
                let stays =
                    |event: &&Event| [side, Side::Both].contains(&sides[event.object as usize]);
                [0, 1, 2].map(|axis| {
                    frame.events[axis]
                        .iter()
                        .filter(stays)
                        .copied()
                        .collect::<Vec<_>>()
                })
            };
            let mut lower = frame.bounds;
            let mut upper = frame.bounds;
            (lower.max[axis], upper.min[axis]) = (position, position);
            let depth = frame.depth + 1;
            let all = split.below + split.above;
            let share =
                |count: usize| (frame.budget as u128 * count as u128 / all as u128) as usize;
            let child = |cell, bounds, side, count| Frame {
                cell,
                bounds,
                events: part(side),
                count,
                depth,
                budget: share(count),
            };
            stack.push(child(below + 1, upper, Side::Above, split.above));
            stack.push(child(below, lower, Side::Below, split.below));
        }
        Ok(tree)
    }

    /// The cheapest split within the budget, or `None` if a leaf is cheaper. Ties go to the lower axis and position.
    fn best_split(&self, frame: &Frame) -> Option<Split> {
        let mut best: Option<Split> = None;
        let mut limit = self.intersection * frame.count as f64;
        let area = frame.bounds.half_area();
        let extent = frame.bounds.extent();
        for axis in 0..3 {
            let low = frame.bounds.min[axis];
            let high = frame.bounds.max[axis];
            let u = extent[(axis + 1) % 3];
            let v = extent[(axis + 2) % 3];
            // The probability that a line through the cell meets the part of this length, or the part's share of the
            // length if the cell has no area.
            let chance = |length: f64| {
                if area > 0.0 { (u * v + length * (u + v)) / area } else { length / extent[axis] }
            };
            let mut below = 0;
            let mut above = frame.count;
            for group in frame.events[axis].chunk_by(|a, b| a.position == b.position) {
                let position = group[0].position;
                let ends = group.partition_point(|event| event.kind == Kind::End);
                let planar = group.partition_point(|event| event.kind <= Kind::Planar) - ends;
                above -= ends + planar;
                if low < position && position < high {
                    let chances = (
                        chance(f64::from(position) - f64::from(low)),
                        chance(f64::from(high) - f64::from(position)),
                    );
                    let mut consider = |below: usize, above: usize, planar_below: bool| {
                        let tests = chances.0 * below as f64 + chances.1 * above as f64;
                        let factor = if below == 0 || above == 0 { self.empty_factor } else { 1.0 };
                        let cost = factor * (self.traversal + self.intersection * tests);
                        if cost < limit && below + above <= frame.budget {
                            limit = cost;
                            best = Some(Split { axis, position, planar_below, below, above });
                        }
                    };
                    consider(below + planar, above, true);
                    if planar > 0 {
                        consider(below, above + planar, false);
                    }
                }
                below += group.len() - ends;
            }
        }
        best
    }
}

impl Split {
    fn side(&self, object: &Aabb) -> Side {
        let min = object.min[self.axis];
        let max = object.max[self.axis];
        if min == max && min == self.position {
            if self.planar_below { Side::Below } else { Side::Above }
        } else if max <= self.position {
            Side::Below
        } else if min >= self.position {
            Side::Above
        } else {
            Side::Both
        }
    }
}

/// The sorted events of all objects along one axis.
fn events(boxes: &[Aabb], axis: usize) -> Vec<Event> {
    let mut events = Vec::with_capacity(2 * boxes.len());
    for (b, object) in boxes.iter().zip(0..) {
        // −0 and +0 are one position.
        let min = b.min[axis] + 0.0;
        let max = b.max[axis] + 0.0;
        if min == max {
            events.push(Event { position: min, kind: Kind::Planar, object });
        } else {
            events.push(Event { position: min, kind: Kind::Start, object });
            events.push(Event { position: max, kind: Kind::End, object });
        }
    }
    events.sort_by(|a, b| {
        a.position
            .total_cmp(&b.position)
            .then(a.kind.cmp(&b.kind))
    });
    events
}
