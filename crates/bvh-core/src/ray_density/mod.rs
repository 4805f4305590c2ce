//! The number of ray segments that enter a box: a measure of boxes for the rays that are traced,
//! instead of their area.
//!
//! The surface area heuristic prices a box by its area, because the probability that an endless
//! uniform line meets a convex box is proportional to the area. Real rays start on surfaces, end at
//! hits and come from a camera. [`RayDensity`] is made from a sample of such segments. It returns
//! the expected number of segments that enter any box, in constant time.
//!
//! A segment enters a convex box at most once: either it starts inside, or it crosses one of the
//! six faces inward. Therefore
//!
//! ```text
//!                 ┌──────────┐            entries(box) =   segments that start in the box
//!     ───────────→│          │                           + rightward crossings of its left face
//!                 │    •──→  │←───                       + leftward  crossings of its right face
//!                 └──────────┘                           + the same for the other two axes
//! ```
//!
//! On a grid each of these seven counts is a look-up in a summed-area table (Crow 1984). All seven
//! tables are read at the same corners. They are added up, with their signs, into one table per
//! corner of a box, which leaves eight look-ups. Between grid points the tables are interpolated
//! linearly in each coordinate.
//!
//! **Monotone.** A segment is recorded as the sequence of cells that it visits, one face at a time.
//! Its coordinates are monotone along the way, so it visits the cells of a box of cells in one
//! stretch, and the tables count the segments that visit any of these cells. A larger box of cells
//! therefore has no smaller count. The interpolated value is the mean count over all shifts of a
//! grid-rounded box. Each axis is rounded by a separate shift that is the same for both ends of the
//! box. Rounding preserves inclusion, so the mean is monotone too.
//!
//! **Exact.** Box corners are first rounded outward to 1/512 of a cell. All counts and weights are
//! then integers whose products and sums stay below 2⁵³, so the arithmetic is exact. The order of
//! summation, vector registers, and the shortcut for boxes within one cell do not change a bit.
//!
//! The idea of counting the rays that meet a box is from Bittner & Havran 2009 (ray distribution
//! heuristic, for kd-trees) and from Ng & Trifonov's empirical ray cost, section 4, which tested
//! every box with every ray.

mod crossings;
mod segment;

use crate::cost::Measure;
use crate::each::Each;
use crate::{Aabb, Bvh, Node, PackedAabb, TestCounts};
use crossings::{CELLS, Crossings, index};
use glam::{DVec3, DVec4, Vec4};
pub use segment::{DensityError, Segment};

/// The number of fractions of a cell, a power of two. Box corners are rounded to fractions.
const FRACTIONS: f64 = 512.0;
/// The value of one entry in the integer arithmetic: a product of fractions along all three axes.
const FRACTIONS_OF_ENTRY: f64 = FRACTIONS * FRACTIONS * FRACTIONS;
/// The length by which segments are extended at both ends, in cells along their main axis.
///
/// Found on the kitchen, Sponza and smooth meshes. Without the extension the number of inner nodes
/// that rays enter is underestimated by up to a sixth, and trees for rays from a camera in the
/// kitchen save half as many tests. Twice the length overestimates the number.
const LENGTHENED: f64 = 0.25;

/// The expected number of segments that enter a box, mixed with the box's area; see the
/// [module](self).
///
/// Takes about 11 MB for any number of segments. A clone copies this memory.
///
/// ```
/// # use bvh_core::{Aabb, RayDensity, Segment};
/// let scene = Aabb::from([[0.0; 3], [8.0; 3]]);
/// let rays = [1.0, 2.0, 3.0].map(|y| Segment { from: [-1.0, y, 1.0], to: [4.0, y, 1.0] });
/// let density = RayDensity::of_rays(&scene, &rays, 0.1)?;
/// let [front, back] = [0.0, 6.0].map(|x| Aabb::from([[x, 0.0, 0.0], [x + 2.0, 8.0, 8.0]]));
/// assert!(density.entries(&front) > 2.9 && density.entries(&back) == 0.0);
/// assert!(density.measure(&front) > density.measure(&back));
/// # Ok::<(), bvh_core::DensityError>(())
/// ```
#[derive(Clone, Debug)]
pub struct RayDensity {
    /// The lower corner of the grid, in world units, and 0.
    low: DVec4,
    /// Fractions of cells per world unit, and 0.
    scale: DVec4,
    /// The signed counts at a cell's eight grid points: `[cell][corner of the box]`.
    corners: Vec<Corner>,
    /// The counts for boxes within a cell: `[cell]`.
    cells: Vec<Cell>,
    /// The number of segments that meet the bounds.
    segments: u32,
    /// Half area per fractional entry.
    entry_weight: f64,
    area_weight: f64,
}

/// The place of a grid in the world.
struct Grid {
    low: DVec3,
    cells_per_unit: DVec3,
}

impl Grid {
    fn new(bounds: &Aabb) -> Result<Self, DensityError> {
        let min = bounds.min.as_dvec3();
        let max = bounds.max.as_dvec3();
        let extent = max - min;
        if !(min.is_finite() && max.is_finite() && extent.min_element() >= 0.0) {
            return Err(DensityError::Bounds);
        }
        // A flat scene gets some thickness, so that rays cross its cells.
        let thickness = (extent.max_element() / 1024.0).max(f64::MIN_POSITIVE * 1e20);
        let padding = (DVec3::splat(thickness) - extent).max(DVec3::ZERO);
        let cells_per_unit = DVec3::splat(CELLS as f64) / (extent + padding);
        Ok(Self { low: min - 0.5 * padding, cells_per_unit })
    }

    /// Returns the ends of a segment in cells, [extended](LENGTHENED); `None` if the segment is not
    /// finite.
    fn in_cells(&self, segment: &Segment) -> Option<[DVec3; 2]> {
        let start = DVec3::from(segment.from.each(f64::from));
        let end = DVec3::from(segment.to.each(f64::from));
        if !start.is_finite() || !end.is_finite() {
            return None;
        }
        let from = (start - self.low) * self.cells_per_unit;
        let to = (end - self.low) * self.cells_per_unit;
        let length = (to - from).abs().max_element();
        // A segment of length 0 has no direction and is not extended.
        let direction = (to - from) / length.max(f64::MIN_POSITIVE);
        Some([from - LENGTHENED * direction, to + LENGTHENED * direction])
    }
}

/// The signed counts at the eight grid points of a cell, in half a cache line: the lower and the
/// upper four along z.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
struct Corner([Vec4; 2]);

/// The counts for boxes within one cell, in one cache line: four rows of one number per axis and a
/// zero.
///
/// The flux through the box's two faces across an axis is `[0] + [1] · low + [2] · high + [3] ·
/// size`, per unit of these faces. `low` and `high` are the ends of the box within the cell along
/// the axis, and `size` is their difference. The fourth row is 0 except for the first axis, where
/// it adds the segments that start in the box.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Cell([Vec4; 4]);

/// The corners of a box in fractions of cells: integers from 0 to the end of the grid.
#[derive(Debug)]
struct Rounded {
    low: DVec4,
    high: DVec4,
}

impl RayDensity {
    /// The largest number of segments for which all arithmetic is exact: 4 · 2²⁰ · 2²⁷ · 8 < 2⁵³.
    pub const MOST_SEGMENTS: usize = 1 << 20;

    /// The tests after which no more rays should be traced for a density: about two seconds. Rays
    /// in scenes that a tree can divide take a tenth; where objects are as large as the scene, fewer
    /// rays must do.
    pub const MOST_TESTS: u64 = 1 << 28;

    /// Returns whether one more ray can be traced for a density, after these tests of the rays among
    /// the first part `done` of all, 0 to 1. Half of [`MOST_TESTS`](Self::MOST_TESTS) are for the
    /// first rays and half for all in proportion, so that some rays of every part are traced.
    pub fn affords(tests: &TestCounts, done: f64) -> bool {
        let most = (0.5 + 0.5 * done) * Self::MOST_TESTS as f64;
        ((tests.boxes + tests.objects) as f64) < most
    }

    /// Makes the density of the rays between `segments`' ends over a scene with these bounds.
    /// `area_weight` is the share of the area in the measure of a box, 0 to 1. With a weight above
    /// 0, boxes that no sample enters are not free; a tenth works well. O(segments · cells that a
    /// segment visits).
    ///
    /// Segments are extended at both ends by a quarter of a cell along their main axis. Most rays
    /// begin and end on surfaces, which boxes are around. Between the last face of a cell that rays
    /// cross and the next one, half of those that end on a wall would seem to miss the box around it.
    pub fn of_rays(
        bounds: &Aabb,
        segments: &[Segment],
        area_weight: f64,
    ) -> Result<Self, DensityError> {
        if !(0.0..=1.0).contains(&area_weight) {
            return Err(DensityError::AreaWeight(area_weight));
        }
        if segments.is_empty() || segments.len() > Self::MOST_SEGMENTS {
            return Err(DensityError::Count { segments: segments.len() });
        }
        let grid = Grid::new(bounds)?;
        let mut crossings = Crossings::new();
        for (index, segment) in segments.iter().enumerate() {
            let [from, to] = grid.in_cells(segment).ok_or(DensityError::NotFinite { index })?;
            crossings.record(from, to);
        }
        if crossings.segments == 0 {
            return Err(DensityError::NoneMeets);
        }
        let entries_of_root = FRACTIONS_OF_ENTRY * f64::from(crossings.segments);
        Ok(Self {
            low: grid.low.extend(0.0),
            scale: (grid.cells_per_unit * FRACTIONS).extend(0.0),
            corners: crossings.corner_tables(),
            cells: crossings.cell_table(),
            segments: crossings.segments,
            entry_weight: (1.0 - area_weight) * bounds.half_area() / entries_of_root,
            area_weight,
        })
    }

    /// Returns the number of segments that meet the bounds.
    pub fn segments(&self) -> u32 {
        self.segments
    }

    /// Returns the expected number of segments that enter the box; 0 for the empty box. Constant
    /// time.
    pub fn entries(&self, bounds: &Aabb) -> f64 {
        self.fractional_entries(bounds) / FRACTIONS_OF_ENTRY
    }

    /// Returns the measure of a box, in units of half area; 0 for the empty box. The measure of the
    /// scene's bounds is their half area, for any segments. The measure is monotone under
    /// inclusion, rounding included.
    pub fn measure(&self, bounds: &Aabb) -> f64 {
        self.entry_weight * self.fractional_entries(bounds) + self.area_weight * bounds.half_area()
    }

    /// Returns the number of visits that each node gets per ray that enters the scene: the measure
    /// of the node's box, divided by the measure of the root. The root has 1 unless its measure is
    /// 0. O(nodes).
    pub fn visits(&self, tree: &Bvh) -> Vec<f32> {
        self.visits_of(&tree.root_aabb().unwrap_or(Aabb::EMPTY), &tree.nodes)
    }

    /// Returns the number of [visits](Self::visits) of some nodes of a tree with this root, so that
    /// several threads can share a tree.
    pub fn visits_of(&self, root: &Aabb, nodes: &[Node]) -> Vec<f32> {
        let root = self.measure(root);
        let scale = if root > 0.0 { 1.0 / root } else { 0.0 };
        // Rounding must not give a child more visits than the root.
        let visits = |node: &Node| ((self.measure(&node.aabb) * scale) as f32).min(1.0);
        nodes.iter().map(visits).collect()
    }

    /// Returns the entries times 512³, an integer.
    fn fractional_entries(&self, bounds: &Aabb) -> f64 {
        let is_empty = bounds.min.cmpgt(bounds.max).any();
        if is_empty { 0.0 } else { fractional_entries(self, &PackedAabb::from(bounds)) }
    }

    /// Returns the corners in fractions of cells, rounded outward and clamped to the grid.
    #[inline(always)]
    fn round(&self, bounds: &PackedAabb) -> Rounded {
        let [negated_min, max] = bounds.planes().each(|plane| Vec4::from(plane).as_dvec4());
        let end = DVec4::splat(CELLS as f64 * FRACTIONS);
        let clamped = |point: DVec4| ((point - self.low) * self.scale).max(DVec4::ZERO).min(end);
        Rounded { low: clamped(-negated_min).floor(), high: clamped(max).ceil() }
    }

    /// Returns the sum of the terms of a box's eight corners.
    #[inline(always)]
    fn across(&self, Rounded { low, high }: &Rounded) -> f64 {
        let cells = [cell_of(*low), cell_of(*high)];
        let places = [*low - cells[0] * FRACTIONS, *high - cells[1] * FRACTIONS];
        let cells = cells.each(indices);
        // The weights of the grid points around the low and around the high corner: along x and y,
        // of the four of a plane; along z, of the two planes.
        let weights = |axis: usize| places.each(|place| [FRACTIONS - place[axis], place[axis]]);
        let along_x = weights(0).each(|[a, b]| DVec4::new(a, b, a, b));
        let along_y = weights(1).each(|[a, b]| DVec4::new(a, a, b, b));
        let along_z = weights(2);
        let mut sum = DVec4::ZERO;
        for corner in 0..8 {
            let [i, j, k] = [0, 1, 2].each(|axis| corner >> axis & 1);
            let cell = [cells[i][0], cells[j][1], cells[k][2]];
            let [lower, upper] =
                self.corners[8 * index(cell) + corner].0.each(|four| four.as_dvec4());
            let [below, above] = along_z[k];
            sum += (lower * below + upper * above) * (along_x[i] * along_y[j]);
        }
        sum.element_sum()
    }
}

crate::with_vector_instructions! {
    fractional_entries = entries_plain(density: &RayDensity, bounds: &PackedAabb) -> f64
}

/// Returns the entries times 512³ of a box that is not empty.
#[inline(always)]
fn entries_plain(density: &RayDensity, bounds: &PackedAabb) -> f64 {
    let rounded = density.round(bounds);
    // A box within one cell needs one look-up instead of eight.
    let cell = cell_of(rounded.low);
    if (rounded.high - cell * FRACTIONS).cmple(DVec4::splat(FRACTIONS)).all() {
        within(&density.cells[index(indices(cell))], &rounded, cell)
    } else {
        density.across(&rounded)
    }
}

impl Measure for RayDensity {
    // Searches call this function through a trait object. If it were inlined, the crate that makes
    // the trait object would compile it, with its own options.
    #[inline(never)]
    fn of(&self, aabb: &PackedAabb) -> f64 {
        let entries = fractional_entries(self, aabb);
        self.entry_weight * entries + self.area_weight * aabb.half_area()
    }
}

/// Returns the cells of a corner along all axes; the last cell for the upper end of the grid.
#[inline(always)]
fn cell_of(corner: DVec4) -> DVec4 {
    (corner * (1.0 / FRACTIONS)).floor().min(DVec4::splat((CELLS - 1) as f64))
}

#[inline(always)]
fn indices(cell: DVec4) -> [usize; 3] {
    [cell.x, cell.y, cell.z].each(|index| index as u32 as usize)
}

/// Returns the fractional entries of a box within one cell. They are the sum of two parts: the flux
/// through each face of the cell, interpolated to the position of the box's face, times the share
/// of the box's face in it; and the starts in the cell, times the share of the box in the cell.
#[inline(always)]
fn within(table: &Cell, rounded: &Rounded, cell: DVec4) -> f64 {
    let low = rounded.low - cell * FRACTIONS;
    let high = rounded.high - cell * FRACTIONS;
    let size = high - low;
    let others = DVec4::new(size.y * size.z, size.z * size.x, size.x * size.y, 0.0);
    let [constant, by_low, by_high, by_size] = table.0.each(|row| row.as_dvec4());
    let flux = constant + by_low * low + by_high * high + by_size * size;
    (flux * others).element_sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points() -> impl Strategy<Value = Vec<[f32; 3]>> {
        prop::collection::vec(prop::array::uniform3(0.0..CELLS as f32), 400)
    }

    proptest! {
        // A density takes a tenth of a second.
        #![proptest_config(ProptestConfig::with_cases(4))]
        #[test]
        fn the_shortcut_within_a_cell_and_the_sum_over_corners_give_the_same_bits(
            points in points(),
            boxes in prop::collection::vec(prop::array::uniform9(0..512u16), 5000),
        ) {
            let (pairs, _) = points.as_chunks();
            let segments: Vec<_> = pairs.iter().map(|&[from, to]| Segment { from, to }).collect();
            // The cells have a side of 1.
            let bounds = Aabb::from([[0.0; 3], [CELLS as f32; 3]]);
            let density = RayDensity::of_rays(&bounds, &segments, 0.0).unwrap();
            for numbers in boxes {
                let [i, j, k, a, b, c, d, e, f] = numbers.map(f64::from);
                let cell = (DVec4::new(i, j, k, 0.0) % CELLS as f64).floor();
                let corner = |x, y, z| cell * FRACTIONS + DVec4::new(x, y, z, 0.0);
                let first = corner(a, b, c);
                let second = corner(d + 1.0, e + 1.0, f + 1.0);
                let rounded = Rounded { low: first.min(second), high: first.max(second) };
                // A lower corner at the upper end of its cell belongs to the next cell.
                if cell_of(rounded.low) == cell {
                    let short = within(&density.cells[index(indices(cell))], &rounded, cell);
                    let full = density.across(&rounded);
                    prop_assert_eq!(short.to_bits(), full.to_bits(), "{:?}", rounded);
                }
            }
        }
    }
}
