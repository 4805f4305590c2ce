//! The triangles of the leaves that a ray enters, tested for [all hits](super::all_hits).

use super::lanes::{DoubleLanes, Lanes, Mask};
use super::one_ray::Leaves;
use super::triangles::TriangleBlock;
use crate::exact::Line;
use crate::{Hit, Ray};
use alloc::vec::Vec;

/// Collects all hits of a ray.
pub(crate) struct AllHits<'a> {
    pub(super) ray: &'a Ray,
    pub(super) line: Line,
    /// The movement along the first two axes per step along the third.
    pub(super) slope: [f64; 2],
    /// The bound of the errors of edge values.
    pub(super) error: f64,
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
        // SAFETY: the caller's promise.
        let candidates = unsafe {
            // The same for all blocks; the compiler keeps it in registers.
            let line = LineLanes {
                origin: self.line.origin.map(|x| L::Double::splat(x)),
                slope: self.slope.map(|x| L::Double::splat(x)),
                error: L::Double::splat(self.error),
            };
            candidates::<L>(&line, self.line.axes, block)
        };
        self.test(block, candidates);
        false
    }
}

/// A line in f64 lanes, sheared by division instead of multiplication, which needs fewer operations.
struct LineLanes<D> {
    origin: [D; 3],
    slope: [D; 2],
    error: D,
}

/// Returns a bit per triangle of the block that the line may meet.
///
/// With R at least the coordinates of corners relative to the origin and ε = 2⁻⁵³, a sheared coordinate
/// is at most 2.1 R, its error below 7 εR, and the error of an edge value below 80 εR². The test leaves
/// all triangles within 512 εR² to [`Line::crossing`].
///
/// # Safety
/// The processor has the instructions of `L`, and the caller is compiled with them.
#[inline(always)]
unsafe fn candidates<L: Lanes>(
    line: &LineLanes<L::Double>,
    axes: [usize; 3],
    block: &TriangleBlock,
) -> u32 {
    let sheared = |corner: [L; 3]| {
        let z = corner[2].double() - line.origin[2];
        let x = corner[0].double() - line.origin[0];
        let y = corner[1].double() - line.origin[1];
        [x - line.slope[0] * z, y - line.slope[1] * z]
    };
    // SAFETY: the caller's promise; axes are below 3.
    let [a, b, c] = unsafe { block.corners_along::<L>(axes) };
    let [ax, ay] = sheared(a);
    let [bx, by] = sheared(b);
    let [cx, cy] = sheared(c);
    let u = cx * by - cy * bx;
    let v = ax * cy - ay * cx;
    let w = bx * ay - by * ax;
    let least = u.min(v).min(w);
    let most = u.max(v).max(w);
    // SAFETY: values exist.
    let zero = unsafe { L::Double::splat(0.0) };
    let outside = least.lt(zero - line.error) & line.error.lt(most);
    !L::narrow(outside).bits() & 15
}
