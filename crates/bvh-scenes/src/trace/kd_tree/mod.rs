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

mod traverse;

use bvh_build::{BuildError, check_scene};
use bvh_config::{Check, above};
use bvh_core::Aabb;

bvh_config::config! {
    /// The constants of the surface area heuristic, in any unit of time. The defaults are the
    /// paper's.
    pub struct Config {
        /// The time to step through a cell.
        traversal: f64 = 15.0, in above(0.0);
        /// The time to test an object.
        intersection: f64 = 20.0, in 0.0..;
        /// The factor on the cost of a split that cuts off empty space.
        empty_factor: f64 = 0.8, in 0.0..=1.0;
    }
}

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

impl KdTree {
    /// The limit on the depth in [`Config::build`] for 2^31 objects, more than a scene can have.
    const MAX_DEPTH: usize = 49;

    /// Returns the number of cells, inner cells included.
    pub fn cells(&self) -> usize {
        self.cells.len()
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

#[derive(Clone, Copy, PartialEq)]
enum Side {
    Below,
    Above,
    Both,
}

struct Split {
    axis: usize,
    position: f32,
    /// True if boxes in the plane go below it, and false if they go above it.
    planar_below: bool,
    below: usize,
    above: usize,
}

/// A cell that is not built yet.
struct Frame {
    cell: usize,
    bounds: Aabb,
    events: [Vec<Event>; 3],
    count: usize,
    depth: usize,
    /// The upper limit on the number of references in the leaves below.
    budget: usize,
}

impl Config {
    /// The limit on references per object. Wald & Havran report 2 to 6 for meshes.
    const MAX_REFERENCES: usize = 16;

    /// Builds a tree over `boxes`; `boxes[i]` bounds object `i`. No boxes give the tree without
    /// cells. O(n log n).
    ///
    /// The tree is at most 8 + 1.3 log₂ n deep and has at most 16 references per object.
    pub fn build(&self, boxes: &[Aabb]) -> Result<KdTree, BuildError> {
        check_scene(boxes)?;
        self.check()?;
        let n = boxes.len();
        let bounds = Aabb::union_of(boxes);
        let mut tree = KdTree { bounds, cells: vec![], objects: vec![], depth: 0 };
        if n == 0 {
            return Ok(tree);
        }
        let max_depth = ((8.0 + 1.3 * libm::log2(n as f64)) as usize).min(KdTree::MAX_DEPTH);
        let mut sides = vec![Side::Both; n];
        let placeholder = Cell::Leaf { first: 0, count: 0 };
        tree.cells.push(placeholder);
        let budget = n.saturating_mul(Self::MAX_REFERENCES).min(u32::MAX as usize);
        let events = [0, 1, 2].map(|axis| events(boxes, axis));
        let mut stack = vec![Frame { cell: 0, bounds, events, count: n, depth: 0, budget }];
        while let Some(frame) = stack.pop() {
            tree.depth = tree.depth.max(frame.depth);
            let split = if frame.depth < max_depth { self.best_split(&frame) } else { None };
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
            let axis = split.axis;
            let position = split.position;
            tree.cells[frame.cell] =
                Cell::Inner { axis: axis as u8, position, below: below as u32 };
            for event in &frame.events[axis] {
                sides[event.object as usize] = split.side(&boxes[event.object as usize]);
            }
            let mut lower = frame.bounds;
            lower.max[axis] = position;
            let mut upper = frame.bounds;
            upper.min[axis] = position;
            let all = split.below + split.above;
            stack.push(Frame {
                cell: below + 1,
                bounds: upper,
                events: events_on(Side::Above, &frame.events, &sides),
                count: split.above,
                depth: frame.depth + 1,
                budget: share(frame.budget, split.above, all),
            });
            stack.push(Frame {
                cell: below,
                bounds: lower,
                events: events_on(Side::Below, &frame.events, &sides),
                count: split.below,
                depth: frame.depth + 1,
                budget: share(frame.budget, split.below, all),
            });
        }
        Ok(tree)
    }

    /// Returns the cheapest split within the budget, or `None` if a leaf is cheaper. Ties go to the
    /// lower axis and position.
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
            // The probability that a line through the cell meets the part of this length, or the
            // part's share of the length if the cell has no area.
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
                    let chance_below = chance(f64::from(position) - f64::from(low));
                    let chance_above = chance(f64::from(high) - f64::from(position));
                    // Objects in the plane may go to either side; below comes first and wins ties.
                    let choices: &[bool] = if planar > 0 { &[true, false] } else { &[true] };
                    for &planar_below in choices {
                        let below = below + if planar_below { planar } else { 0 };
                        let above = above + if planar_below { 0 } else { planar };
                        let tests = chance_below * below as f64 + chance_above * above as f64;
                        let factor = if below == 0 || above == 0 { self.empty_factor } else { 1.0 };
                        let cost = factor * (self.traversal + self.intersection * tests);
                        if cost < limit && below + above <= frame.budget {
                            limit = cost;
                            best = Some(Split { axis, position, planar_below, below, above });
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

/// Returns the share of the references that a child with `count` of `all` objects may have.
fn share(budget: usize, count: usize, all: usize) -> usize {
    // The product can exceed 64 bits.
    (budget as u128 * count as u128 / all as u128) as usize
}

/// Returns the events of the objects on one side of a split. Filtering keeps the lists sorted.
fn events_on(side: Side, events: &[Vec<Event>; 3], sides: &[Side]) -> [Vec<Event>; 3] {
    [0, 1, 2].map(|axis| {
        events[axis]
            .iter()
            .filter(|event| [side, Side::Both].contains(&sides[event.object as usize]))
            .copied()
            .collect()
    })
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
