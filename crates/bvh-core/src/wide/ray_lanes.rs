//! Rays side by side, a ray per lane, from any order in memory.

use super::lanes::{Lanes, Mask};
use super::pairs::Pairs;
use crate::Slabs;
use crate::ray::pow2;
use crate::triangle::AXES;

// # The box test
//
// Every kernel computes the distances to the planes of a box as `plane · scale + shift`, and visits
// a box whose greatest near distance is at most its least far distance. The test decides which boxes
// are visited, never an answer. It must be *conservative*: whenever the interval that `Slabs`
// computes for a triangle's own box has a distance `t <= t_max`, every box around the triangle
// passes.
//
// Names, for one axis: u = 2⁻²⁴; o, d and i are the origin, the direction and its reciprocal; D is
// the largest component of the direction; S is the largest component of the origin plus the largest
// coordinate of the scene. Take i > 0, since the other sign mirrors every step. `Slabs` has a margin
// m of at most 10uS + 2⁻¹²⁶. With L = o + m and U = o − m, rounded, it computes for a lower plane
// p > L at least (p − L) · i · (1 − 2u) − 2⁻¹⁴⁹, for another lower plane nothing positive, and for
// an upper plane at most (p − U) · i · (1 + 12u) + 2⁻¹⁴⁸. The test here uses the margin M = 32uS,
// and computes (p − L') · s and (p − U') · s with L' = o + M, U' = o − M and a scale s.
//
// 1. *Shift.* M is added to the origin or to the plane, which rounds by at most uS, and the product
//    of origin and scale rounds by at most uS · s. With the rounding of L, all of these move a plane
//    by less than 4uS. Hence L' and L differ by at least (32 − 10 − 4)uS = 18uS, and so do U' and U.
// 2. *Relative errors.* The factors of `Slabs` and the last rounding here amount to 3u on a near
//    distance and 13u on a far one. No plane is farther from the origin than S. So these factors
//    move no plane by more than 14uS, and 4uS of the margin remain.
// 3. *Underflow.* Errors of subnormal numbers are below 2⁻¹⁴⁶ together. Rays with S / D < 2⁻¹²⁰ are
//    left to the portable kernel; for all others the remaining margin is at least
//    4uS / D = 2⁻¹⁴² in distance.
// 4. *Clamp.* Where |d| is far smaller than D, i · o could overflow. Hence |s| is i clamped to
//    K = 2²⁴ / D. Near distances only become nearer. A far plane p that `Slabs` has in front of the
//    origin has p ≥ U, and then (p − U') · K ≥ 4uS · K = 4S / D, which no distance exceeds that
//    `Slabs` accepts on the axis of D.
// 5. *Overflow.* Rays with S ≥ 2⁶⁰, S · K ≥ 2¹²⁰ or S < 2⁻⁹⁰ are left to the portable kernel.
//
// `Slabs` moves a hit's distance into the interval of the triangle's box. Hence a near distance is at
// most the distance of any accepted hit, and needs no margin compared with the nearest hit so far.
//
// Interval arithmetic takes the least and the greatest product over all origins and all scales of a
// packet by the same operations, with the largest S. Rounding is monotone: the bounds are not beyond
// the distances of any ray of the packet by more than the steps above allow.

/// As many rays as there are lanes. Vectors of three are by axis.
#[derive(Clone, Copy)]
pub(crate) struct RayLanes<L> {
    pub(crate) origin: [L; 3],
    pub(crate) direction: [L; 3],
    pub(crate) inverse: [L; 3],
    pub(crate) t_min: L,
    pub(crate) t_max: L,
}

impl<L: Lanes> RayLanes<L> {
    /// By how much boxes grow, in multiples of the largest size of a coordinate.
    pub(crate) const MARGIN: f32 = 4.0 * Slabs::MARGIN;

    /// A bit per axis along which the first ray runs backwards.
    #[inline(always)]
    pub(crate) fn octant(&self) -> u32 {
        let [x, y, z] = self.inverse;
        x.signs() & 1 | (y.signs() & 1) << 1 | (z.signs() & 1) << 2
    }

    /// The axes of the shear of rays that [cohere](Self::cohere).
    #[inline(always)]
    pub(crate) fn axes(&self) -> [usize; 3] {
        let (second, third) = self.largest();
        AXES[if third.bits() != 0 { 2 } else { usize::from(second.bits() != 0) }]
    }

    /// The rays whose direction is largest along y, and along z: the lowest axis on ties.
    #[inline(always)]
    pub(crate) fn largest(&self) -> (L::Mask, L::Mask) {
        let [x, y, z] = self.direction;
        let x = x.abs();
        let y = y.abs();
        let z = z.abs();
        let third = x.max(y).lt(z);
        (x.lt(y).and_not(third), third)
    }

    /// The rays within the bounds of the proof above, the largest size of a coordinate for each, and the
    /// reciprocals of the directions made so small that nothing overflows.
    #[inline(always)]
    pub(crate) fn bounded(&self, largest: f32) -> (L::Mask, L, [L; 3]) {
        // SAFETY: values exist.
        unsafe {
            let [x, y, z] = self.inverse;
            let limit = x.abs().min(y.abs()).min(z.abs()) * L::splat(pow2(24));
            let [ox, oy, oz] = self.origin;
            let size = ox.abs().max(oy.abs()).max(oz.abs()) + L::splat(largest);
            let most_shift = size * limit;
            let in_range = size.lt(L::splat(pow2(60)))
                & L::splat(pow2(-90)).le(size)
                & most_shift.lt(L::splat(pow2(120)))
                & L::splat(pow2(-96)).le(most_shift);
            let least = L::splat(0.0) - limit;
            let scale = [x.max(least).min(limit), y.max(least).min(limit), z.max(least).min(limit)];
            (in_range, size, scale)
        }
    }

    /// The bounded reciprocals, if all rays are in range, run to the same sides, and mostly along the same axis.
    #[inline(always)]
    pub(crate) fn cohere(&self, largest: f32) -> Option<[L; 3]> {
        let all = u32::MAX >> (32 - L::N);
        let same = |mask: u32| mask == 0 || mask == all;
        let [x, y, z] = self.inverse;
        let (second, third) = self.largest();
        let (in_range, _, scale) = self.bounded(largest);
        let cohere = same(x.signs())
            & same(y.signs())
            & same(z.signs())
            & same(second.bits())
            & same(third.bits())
            & (in_range.bits() == all);
        cohere.then_some(scale)
    }

    /// The rays as triangles are tested with them.
    #[inline(always)]
    pub(crate) fn sheared(&self, [x, y, z]: [usize; 3]) -> Pairs<L> {
        let Self { origin, direction, inverse, t_min, .. } = self;
        Pairs {
            origin: [origin[x], origin[y], origin[z]],
            inverse: [inverse[x], inverse[y], inverse[z]],
            slope: [direction[x] / direction[z], direction[y] / direction[z]],
            depth: direction[z],
            t_min: *t_min,
        }
    }
}

/// The extremes of many rays, lane by lane.
pub(crate) struct RayBounds<L> {
    lowest: [L; 3],
    highest: [L; 3],
    least: [L; 3],
    most: [L; 3],
    begin: L,
    end: L,
}

impl<L: Lanes> RayBounds<L> {
    /// Of no rays.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(crate) unsafe fn none() -> Self {
        // SAFETY: the caller's promise.
        let (low, high) = unsafe { (L::splat(f32::NEG_INFINITY), L::splat(f32::INFINITY)) };
        Self {
            lowest: [high; 3],
            highest: [low; 3],
            least: [high; 3],
            most: [low; 3],
            begin: high,
            end: low,
        }
    }

    #[inline(always)]
    pub(crate) fn add(&mut self, rays: &RayLanes<L>, scale: &[L; 3]) {
        for (axis, (&origin, &scale)) in rays.origin.iter().zip(scale).enumerate() {
            self.lowest[axis] = self.lowest[axis].min(origin);
            self.highest[axis] = self.highest[axis].max(origin);
            self.least[axis] = self.least[axis].min(scale);
            self.most[axis] = self.most[axis].max(scale);
        }
        self.begin = self.begin.min(rays.t_min);
        self.end = self.end.max(rays.t_max);
    }

    #[inline(always)]
    pub(crate) fn origins(&self, axis: usize) -> [f32; 2] {
        [least(self.lowest[axis]), self.highest[axis].greatest()]
    }

    #[inline(always)]
    pub(crate) fn scales(&self, axis: usize) -> [f32; 2] {
        [least(self.least[axis]), self.most[axis].greatest()]
    }

    #[inline(always)]
    pub(crate) fn begin(&self) -> f32 {
        least(self.begin)
    }

    #[inline(always)]
    pub(crate) fn end(&self) -> f32 {
        self.end.greatest()
    }

    /// The margin of boxes for all rays, in a scene whose coordinates are at most `largest`.
    #[inline(always)]
    pub(crate) fn margin(&self, largest: f32) -> f32 {
        let mut size = self.highest[0].max(self.lowest[0].abs());
        for axis in 0..3 {
            size = size
                .max(self.lowest[axis].abs())
                .max(self.highest[axis].abs());
        }
        (size.greatest() + largest) * RayLanes::<L>::MARGIN
    }
}

/// The least lane.
#[inline(always)]
fn least<L: Lanes>(lanes: L) -> f32 {
    // SAFETY: a value exists.
    let minus = unsafe { L::splat(-0.0) };
    -(lanes ^ minus).greatest()
}
