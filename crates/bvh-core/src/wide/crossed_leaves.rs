//! The triangles of the leaves that a ray enters, tested for [all hits](super::all_hits).

use super::lanes::{DoubleLanes, Lanes, Mask};
use super::one_ray::Leaves;
use super::triangles::TriangleBlock;
use crate::exact::{ERROR, Line};
use crate::ray::AXES;
use crate::{Aabb, Hit, Ray};
use alloc::vec::Vec;

/// Collects all hits of a ray.
pub(crate) struct AllHits<'a> {
    pub(super) ray: &'a Ray,
    pub(super) line: Line,
    pub(super) sloped: SlopedLine,
    pub(super) hits: &'a mut Vec<Hit>,
}

impl AllHits<'_> {
    /// Tests the triangles of these lanes.
    #[inline(always)]
    pub(super) fn test(&mut self, block: &TriangleBlock, mut lanes: u32) {
        while lanes != 0 {
            let lane = lanes.trailing_zeros() as usize & 3;
            lanes &= lanes - 1;
            if let Some((object, triangle)) = block.triangle(lane)
                && let Some(t) = self.line.crossing(self.ray, &triangle.0)
                && self.ray.t_min() <= t
                && t <= self.ray.t_max()
            {
                self.hits.push(Hit { t, object });
            }
        }
    }
}

impl<L: Lanes> Leaves<L> for AllHits<'_> {
    #[inline(always)]
    unsafe fn visit(&mut self, block: &TriangleBlock, _: &mut Hit) -> bool {
        // SAFETY: the processor has the instructions. The lanes are the same for all blocks; the
        // compiler keeps them in registers.
        let candidates = unsafe { LineLanes::<L>::new(&self.sloped).candidates(block) };
        self.test(block, candidates);
        false
    }
}

/// A line in f64, sheared by division instead of multiplication, which needs fewer operations.
#[derive(Clone, Copy)]
pub(super) struct SlopedLine {
    origin: [f64; 3],
    /// The movement along the first two axes per step along the third.
    slope: [f64; 2],
    /// The direction's largest component.
    depth: f64,
    /// At least the coordinates of corners relative to the origin.
    reach: f64,
    largest_axis: usize,
}

impl SlopedLine {
    /// Prepares a ray for triangles within `bounds`.
    #[inline(always)]
    pub(super) fn new(ray: &Ray, bounds: &Aabb) -> Self {
        let Line { origin, direction: [dx, dy, dz], axes } = Line::new(ray);
        let origin64 = ray.origin().as_dvec3();
        let reach = (bounds.max.as_dvec3() - origin64).max(origin64 - bounds.min.as_dvec3());
        let reach = reach.max_element();
        Self { origin, slope: [dx / dz, dy / dz], depth: dz, reach, largest_axis: axes[2] }
    }
}

/// A line in the lanes of a block.
pub(super) struct LineLanes<L: Lanes> {
    origin: [L::Double; 3],
    slope: [L::Double; 2],
    /// The bound of the errors of edge values.
    error: L::Double,
    /// The bound of the error of a depth, apart from the errors of edge values.
    depth_error: L::Double,
    inverse_depth: L::Double,
    axes: [usize; 3],
}

/// The answers of four triangles.
pub(super) struct Decision {
    /// One bit per triangle: set if the line crosses it at the origin or in front of it.
    pub(super) hits: u32,
    /// One bit per triangle: set if the error bounds permit several answers.
    pub(super) unsure: u32,
    /// The rounded distances of the triangles that the line crosses.
    pub(super) distances: [f32; TriangleBlock::LANES],
}

/// The values of a block's three edges.
struct Edges<D> {
    values: [D; 3],
    least: D,
    most: D,
}

/// With R at least the coordinates of corners relative to the origin and ε = 2⁻⁵³, a sheared
/// coordinate is at most 2.1 R, its error below 7 εR, and the error of an edge value below 80 εR².
/// The tests leave all triangles within E = 512 εR² to [`Line::crossing`].
///
/// The distance is, as in [`exact`](crate::exact),
///
/// ```text
///   t d_z = A_z + (v (B_z − A_z) + w (C_z − A_z)) / D,      D = u + v + w
/// ```
///
/// D is off by less than 300 εR², and more than 3 E if all values are above E, so the weights `v /
/// D` and `w / D` are off by less than 80 εR² / D + 300 εR² / D < E / D each. With Z the larger
/// |B_z − A_z|, |C_z − A_z| this moves `t d_z` by less than 2.1 EZ / D; all roundings, those of the
/// last two products with the inverse of `d_z` included, are below 50 εR. The bound (4 EZ / |D| +
/// 64 εR) / |d_z| covers both.
impl<L: Lanes> LineLanes<L> {
    /// Copies the line to all lanes.
    ///
    /// # Safety
    /// The processor has the instructions of `L`, and the caller is compiled with them.
    #[inline(always)]
    pub(super) unsafe fn new(line: &SlopedLine) -> Self {
        let [ox, oy, oz] = line.origin;
        let [x_slope, y_slope] = line.slope;
        // SAFETY: the processor has the instructions.
        unsafe {
            Self {
                origin: [L::Double::splat(ox), L::Double::splat(oy), L::Double::splat(oz)],
                slope: [L::Double::splat(x_slope), L::Double::splat(y_slope)],
                // 512 ε of the square.
                error: L::Double::splat(line.reach * line.reach * (8.0 * ERROR)),
                depth_error: L::Double::splat(line.reach * ERROR),
                inverse_depth: L::Double::splat(1.0 / line.depth),
                axes: AXES[line.largest_axis % 3],
            }
        }
    }

    /// Returns a bit per triangle of the block that the line may meet.
    ///
    /// # Safety
    /// As for [`new`](Self::new).
    #[inline(always)]
    pub(super) unsafe fn candidates(&self, block: &TriangleBlock) -> u32 {
        // SAFETY: the processor has the instructions; axes are below 3.
        let [a, b, c] = unsafe { block.corners_along::<L>(self.axes) };
        let edges = Edges::new([self.sheared(a), self.sheared(b), self.sheared(c)]);
        !L::narrow(self.misses(&edges)).bits() & 15
    }

    /// Decides the triangles of the block in f64 as far as the error bounds permit.
    ///
    /// # Safety
    /// As for [`new`](Self::new).
    #[inline(always)]
    pub(super) unsafe fn decide(&self, block: &TriangleBlock) -> Decision {
        // SAFETY: the processor has the instructions; axes are below 3, and there is room for four
        // distances.
        unsafe {
            let [a, b, c] = block.corners_along::<L>(self.axes);
            let a = self.sheared(a);
            let b = self.sheared(b);
            let c = self.sheared(c);
            let edges = Edges::new([a, b, c]);
            let zero = L::Double::splat(0.0);
            let is_inside = self.error.lt(edges.least) | edges.most.lt(zero - self.error);
            let [u, v, w] = edges.values;
            let determinant = u + v + w;
            let b_depth = b[2] - a[2];
            let c_depth = c[2] - a[2];
            let inverse = L::Double::splat(1.0) / determinant;
            let depth = a[2] + (v * b_depth + w * c_depth) * inverse;
            let size = |x: L::Double| x.max(zero - x);
            let spread = size(b_depth).max(size(c_depth));
            let four = L::Double::splat(4.0);
            let slack = four * self.error * spread * size(inverse) + self.depth_error;
            let t = depth * self.inverse_depth;
            let slack = slack * size(self.inverse_depth);
            let low = t - slack;
            let high = t + slack;
            let rounded = L::single(high);
            // A distance that rounds to infinity is beyond the range of every ray.
            let is_hit = L::narrow(is_inside & zero.le(low)) & L::single(low).eq(rounded);
            let is_behind = L::narrow(self.misses(&edges) | is_inside & high.lt(zero));
            let mut distances = [0.0; TriangleBlock::LANES];
            rounded.store(distances.as_mut_ptr());
            let hits = is_hit.bits();
            Decision { hits, unsure: !(hits | is_behind.bits()) & 15, distances }
        }
    }

    /// Returns a corner of each triangle relative to the origin, sheared.
    #[inline(always)]
    fn sheared(&self, corner: [L; 3]) -> [L::Double; 3] {
        let z = corner[2].double() - self.origin[2];
        let x = corner[0].double() - self.origin[0];
        let y = corner[1].double() - self.origin[1];
        [x - self.slope[0] * z, y - self.slope[1] * z, z]
    }

    /// Returns the triangles that the line certainly misses.
    #[inline(always)]
    fn misses(&self, edges: &Edges<L::Double>) -> <L::Double as DoubleLanes>::Mask {
        // SAFETY: values exist.
        let zero = unsafe { L::Double::splat(0.0) };
        edges.least.lt(zero - self.error) & self.error.lt(edges.most)
    }
}

impl<D: DoubleLanes> Edges<D> {
    #[inline(always)]
    fn new([a, b, c]: [[D; 3]; 3]) -> Self {
        let u = c[0] * b[1] - c[1] * b[0];
        let v = a[0] * c[1] - a[1] * c[0];
        let w = b[0] * a[1] - b[1] * a[0];
        Self { values: [u, v, w], least: u.min(v).min(w), most: u.max(v).max(w) }
    }
}
