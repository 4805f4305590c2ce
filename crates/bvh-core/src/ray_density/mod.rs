//! How many ray segments enter a box: a measure of boxes for the rays that are traced, in place of their area.
//!
//! The surface area heuristic prices a box by its area, because an endless uniform line meets a convex box with a chance
//! proportional to it. Real rays start on surfaces, end at hits and come from a camera. [`RayDensity`] is made from a sample of
//! such segments and gives the expected number that enter any box, in constant time.
//!
//! A segment enters a convex box at most once: either it starts inside, or it crosses one of the six faces inward. So
//!
//! ```text
//!                 ┌──────────┐            entries(box) =   segments that start in the box
//!     ───────────→│          │                           + rightward crossings of its left face
//!                 │    •──→  │←───                       + leftward  crossings of its right face
//!                 └──────────┘                           + the same for the other two axes
//! ```
//!
//! On a grid each of these seven counts is a look-up in a summed-area table (Crow 1984). All seven tables have the same corners, so they are
//! added up, with their signs, into one table per corner of a box: eight look-ups in all. Between grid points the tables
//! are interpolated linearly in each coordinate.
//!
//! **Monotone.** A segment is recorded as the sequence of cells that it visits, one face at a time. Its coordinates are monotone along
//! the way, so it visits the cells of a box of cells in one stretch, and the tables count segments that visit any of them: a larger box of cells has
//! no smaller count. The interpolated value is the mean count over all shifts of a grid-rounded box, each axis rounded by a shift of its own that is the same for both
//! of its ends; rounding preserves inclusion, so the mean is monotone too. Box corners are first rounded outward to
//! 1/512 of a cell; all counts and weights are then integers whose products and sums stay below 2⁵³, so that
//! the arithmetic is exact, and neither the order of summation, nor vector registers, nor the shortcut for boxes within one cell change a bit.
//!
//! The idea of counting the rays that meet a box is that of Bittner & Havran 2009 (ray distribution heuristic, for kd-trees) and of
//! Ng & Trifonov's empirical ray cost, section 4, which tested every box with every ray.

mod crossings;
#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod x86;

use crate::cost::Measure;
use crate::{Aabb, Bvh, PackedAabb};
use alloc::vec::Vec;
use crossings::{CELLS, Crossings, index};
use glam::DVec3;

/// Fractions of a cell that box corners are rounded to, as a power of two.
const FRACTION_BITS: u32 = 9;
const FRACTIONS: u32 = 1 << FRACTION_BITS;
/// What one entry counts as in the arithmetic with whole fractions, which are of all three axes.
const FRACTIONS_OF_ENTRY: f64 = (1u64 << (3 * FRACTION_BITS)) as f64;
/// How far the segments of [`RayDensity::of_rays`] are lengthened at both ends, in cells along their main axis.
///
/// Found on the kitchen, Sponza and smooth meshes: without it the number of inner nodes that rays enter is underestimated by up
/// to a sixth, and trees for rays from a camera in the kitchen save half as many tests; twice as much overestimates it.
const LENGTHENED: f64 = 0.25;
/// A part of a ray: where it begins, and where it ends, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Where the ray starts.
    pub from: [f32; 3],
    /// Where it ends: at its hit, or where it leaves the scene.
    pub to: [f32; 3],
}

/// Why there is no density.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DensityError {
    /// A segment has a coordinate that is NaN or infinite.
    #[error("segment {index} has a coordinate that is not finite")]
    NotFinite {
        /// Index of the segment.
        index: usize,
    },
    /// Too many segments to count them exactly.
    #[error("{segments} segments; accepted: 1 to {most}", most = RayDensity::MOST_SEGMENTS)]
    Count {
        /// The number of segments.
        segments: usize,
    },
    /// No segment meets the scene.
    #[error("none of the segments meets the bounds of the scene")]
    NoneMeets,
    /// The weight of area is out of range.
    #[error("the weight of area is {0}; accepted: 0 to 1")]
    AreaWeight(f64),
    /// The bounds are empty or not finite.
    #[error("the bounds of the scene are empty or not finite")]
    Bounds,
}

/// The expected number of segments that enter a box, mixed with the box's area; see the [module](self).
///
/// About 11 MB, whatever the number of segments. Made in O(segments · cells along one) and cloned by copying.
#[derive(Clone, Debug)]
pub struct RayDensity {
    low: DVec3,
    /// Fractions of cells per world unit.
    scale: DVec3,
    /// `[cell][corner of the box]`: the signed counts at the cell's eight grid points.
    corners: Vec<Corner>,
    /// `[cell]`: what a box within the cell needs.
    cells: Vec<Cell>,
    /// Segments that meet the bounds.
    segments: u32,
    /// Half area per fractional entry.
    entry_weight: f64,
    area_weight: f64,
}

/// The signed counts at the eight grid points of a cell, in half a cache line.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
struct Corner([f32; 8]);

/// What a box within one cell needs, in one cache line: four rows of one number per axis and a zero. With the box's `low` and `high` ends
/// within the cell and its size, the flux through its faces across an axis, and in the first axis what starts in it as well, is
/// `[0] + [1] · low + [2] · high + [3] · size` per unit of those faces.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
struct Cell([f32; 16]);

/// Corners of a box in fractions of cells.
struct Rounded {
    low: [u32; 3],
    high: [u32; 3],
}

impl RayDensity {
    /// Most segments, so that all arithmetic is exact: 4 · 2²⁰ · 2²⁷ · 8 < 2⁵³.
    pub const MOST_SEGMENTS: usize = 1 << 20;

    /// The density of `segments` over the scene with these bounds. `area_weight` is the part of a box's measure that is its
    /// area, 0 to 1, so that boxes which no sample enters are not free; a tenth serves well.
    ///
    /// # Errors
    /// [`DensityError`] if there are no segments, too many, none that meets the bounds, or one that is not finite.
    pub fn new(bounds: &Aabb, segments: &[Segment], area_weight: f64) -> Result<Self, DensityError> {
        Self::lengthened(bounds, segments, area_weight, 0.0)
    }

    /// As [`new`](Self::new), for the segments of rays between surfaces, which are lengthened at both ends by a quarter of
    /// a cell.
    ///
    /// Rays end, and most begin, on surfaces, and surfaces are where the boxes are: a flat box around a wall is entered by
    /// every ray that ends on the wall. But within a cell the density is interpolated, so that between the last face that rays
    /// cross and the first one that they do not, half of them would seem to be missing.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn of_rays(bounds: &Aabb, segments: &[Segment], area_weight: f64) -> Result<Self, DensityError> {
        Self::lengthened(bounds, segments, area_weight, LENGTHENED)
    }

    fn lengthened(
        bounds: &Aabb,
        segments: &[Segment],
        area_weight: f64,
        by: f64,
    ) -> Result<Self, DensityError> {
        if !(0.0..=1.0).contains(&area_weight) {
            return Err(DensityError::AreaWeight(area_weight));
        }
        if segments.is_empty() || segments.len() > Self::MOST_SEGMENTS {
            return Err(DensityError::Count { segments: segments.len() });
        }
        let (low, high) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let size = high - low;
        if !(low.is_finite() && high.is_finite() && size.min_element() >= 0.0) {
            return Err(DensityError::Bounds);
        }
        // A flat scene is given some thickness, so that rays cross it.
        let thickness = (size.max_element() / 1024.0).max(f64::MIN_POSITIVE * 1e20);
        let padding = (DVec3::splat(thickness) - size).max(DVec3::ZERO);
        let (low, size) = (low - 0.5 * padding, size + padding);
        let mut crossings = Crossings::new();
        let cells_per_unit = DVec3::splat(CELLS as f64) / size;
        for (index, segment) in segments.iter().enumerate() {
            if !segment.from.iter().chain(&segment.to).all(|c| c.is_finite()) {
                return Err(DensityError::NotFinite { index });
            }
            let place = |corner: [f32; 3]| (DVec3::from(corner.map(f64::from)) - low) * cells_per_unit;
            let (from, to) = (place(segment.from), place(segment.to));
            let along = (to - from) / (to - from).abs().max_element().max(f64::MIN_POSITIVE);
            crossings.record(from - by * along, to + by * along);
        }
        if crossings.segments == 0 {
            return Err(DensityError::NoneMeets);
        }
        let root = bounds.half_area();
        Ok(Self {
            low,
            scale: cells_per_unit * f64::from(FRACTIONS),
            corners: crossings.corner_tables(),
            cells: crossings.cell_table(),
            segments: crossings.segments,
            entry_weight: (1.0 - area_weight) * root / (FRACTIONS_OF_ENTRY * f64::from(crossings.segments)),
            area_weight,
        })
    }

    /// Number of segments that meet the bounds.
    pub fn segments(&self) -> u32 {
        self.segments
    }

    /// The expected number of segments that enter the box; 0 for the empty box. Constant time.
    pub fn entries(&self, bounds: &Aabb) -> f64 {
        self.fractional_entries(bounds) / FRACTIONS_OF_ENTRY
    }

    /// The box's measure in units of half area: that of the scene's bounds is their half area, whatever the segments.
    /// Monotone under inclusion, rounding included. 0 for the empty box.
    pub fn measure(&self, bounds: &Aabb) -> f64 {
        self.entry_weight * self.fractional_entries(bounds) + self.area_weight * bounds.half_area()
    }

    /// The measure of every node's box relative to that of the root, which is 1 unless it is 0: the number of visits that a node
    /// gets for each ray that enters the scene. O(nodes).
    pub fn visits(&self, tree: &Bvh) -> Vec<f32> {
        let root = tree.root_aabb().map_or(0.0, |root| self.measure(&root));
        let scale = if root > 0.0 { 1.0 / root } else { 0.0 };
        tree.nodes.iter().map(|node| ((self.measure(&node.aabb) * scale) as f32).min(1.0)).collect()
    }

    /// Entries times 512³, an integer.
    fn fractional_entries(&self, bounds: &Aabb) -> f64 {
        if bounds.min.cmpgt(bounds.max).any() {
            return 0.0;
        }
        let rounded = self.round(bounds);
        let cell = rounded.low.map(cell_of);
        if (0..3).all(|axis| rounded.high[axis] <= (cell[axis] as u32 + 1) << FRACTION_BITS) {
            within(&self.cells[index(cell)], &rounded, cell)
        } else {
            self.across(&rounded)
        }
    }

    /// The corners, rounded outward and clamped to the grid.
    #[inline]
    fn round(&self, bounds: &Aabb) -> Rounded {
        let most = DVec3::splat(f64::from((CELLS as u32) << FRACTION_BITS));
        let place = |corner: glam::Vec3| ((corner.as_dvec3() - self.low) * self.scale).clamp(DVec3::ZERO, most);
        let (low, high) = (place(bounds.min), place(bounds.max));
        // Coordinates are not negative: a cast rounds down.
        let up = |value: f64| {
            let down = value as u32;
            down + u32::from(f64::from(down) < value)
        };
        Rounded { low: low.to_array().map(|c| c as u32), high: high.to_array().map(up) }
    }

    /// Sums the signed counts at the eight corners of the box.
    fn across(&self, rounded: &Rounded) -> f64 {
        let ends = [&rounded.low, &rounded.high];
        let mut sum = 0.0;
        for corner in 0..8 {
            let at = [0, 1, 2].map(|axis| ends[corner >> axis & 1][axis]);
            let cell = at.map(cell_of);
            let values = &self.corners[8 * index(cell) + corner].0;
            let part = [0, 1, 2].map(|axis| at[axis] - ((cell[axis] as u32) << FRACTION_BITS));
            let [x, y, z] = part.map(|part| [f64::from(FRACTIONS - part), f64::from(part)]);
            let xy = [x[0] * y[0], x[1] * y[0], x[0] * y[1], x[1] * y[1]];
            let plane = |k: usize| (0..4).map(|i| xy[i] * f64::from(values[4 * k + i])).sum::<f64>();
            sum += z[0] * plane(0) + z[1] * plane(1);
        }
        sum
    }
}

impl Measure for RayDensity {
    // Searches call it through a reference to the trait. Inlined, it would be compiled as the crate is that makes the reference.
    #[inline(never)]
    fn of(&self, aabb: &PackedAabb) -> f64 {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
            // SAFETY: the processor has AVX2 and FMA, checked on the line above.
            let entries = unsafe { x86::fractional_entries(self, aabb) };
            return self.entry_weight * entries + self.area_weight * aabb.half_area();
        }
        self.measure(&Aabb::from(aabb))
    }
}

/// The cell of a corner; the last one for the upper end of the grid.
#[inline]
fn cell_of(corner: u32) -> usize {
    ((corner >> FRACTION_BITS) as usize).min(CELLS - 1)
}

/// The fractional entries of a box within one cell: the flux through each face of the cell, interpolated to the box's
/// face, times that face's part of it; and the starts, times the box's part of the cell.
#[inline]
fn within(cell_table: &Cell, rounded: &Rounded, cell: [usize; 3]) -> f64 {
    let begin = cell.map(|c| (c as u32) << FRACTION_BITS);
    let low = [0, 1, 2].map(|axis| f64::from(rounded.low[axis] - begin[axis]));
    let high = [0, 1, 2].map(|axis| f64::from(rounded.high[axis] - begin[axis]));
    let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
    let row = |k: usize, axis: usize| f64::from(cell_table.0[4 * k + axis]);
    let flux =
        |axis| row(0, axis) + row(1, axis) * low[axis] + row(2, axis) * high[axis] + row(3, axis) * size[axis];
    flux(0) * (size[1] * size[2]) + flux(1) * (size[0] * size[2]) + flux(2) * (size[0] * size[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortcut_within_a_cell_and_the_sum_over_corners_give_the_same_bits() {
        let mut state = 1u64;
        let mut next = |most: u32| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as u32 % most
        };
        let mut point = || [0, 1, 2].map(|_| next(1 << 20) as f32 / (1 << 15) as f32);
        let segments: Vec<Segment> = (0..2000).map(|_| Segment { from: point(), to: point() }).collect();
        let bounds = Aabb::from([[0.0; 3], [CELLS as f32; 3]]);
        let density = RayDensity::new(&bounds, &segments, 0.0).unwrap();
        let mut entered = 0;
        for _ in 0..20_000 {
            let cell = [0, 1, 2].map(|_| next(CELLS as u32) as usize);
            let ends = [0, 1, 2].map(|_| [next(FRACTIONS + 1), next(FRACTIONS + 1)]);
            let place = |axis: usize, part: u32| ((cell[axis] as u32) << FRACTION_BITS) + part;
            let low = [0, 1, 2].map(|axis| place(axis, ends[axis][0].min(ends[axis][1])));
            let high = [0, 1, 2].map(|axis| place(axis, ends[axis][0].max(ends[axis][1])));
            let rounded = Rounded { low, high };
            let home = rounded.low.map(cell_of);
            // A lower corner at the upper end of its cell belongs to the next one.
            if home == cell {
                let short = within(&density.cells[index(cell)], &rounded, cell);
                assert_eq!(short.to_bits(), density.across(&rounded).to_bits(), "{low:?} {high:?}");
                entered += u32::from(short > 0.0);
            }
        }
        assert!(entered > 5000);
    }
}
