//! Rays side by side, a ray per lane, from any order in memory.

use super::box_ray::{CLAMP, MARGIN, SHIFTS, SIZES};
use super::lanes::{Lanes, Mask};
use super::pairs::{Pairs, SINGLE_ERROR};
use crate::ray::AXES;

/// One ray per lane. Vectors of three are by axis.
#[derive(Clone, Copy)]
pub(crate) struct RayLanes<L> {
    pub(crate) origin: [L; 3],
    pub(crate) direction: [L; 3],
    pub(crate) inverse: [L; 3],
    pub(crate) t_min: L,
    pub(crate) t_max: L,
}

impl<L: Lanes> RayLanes<L> {
    /// Returns a bit per axis along which the first ray runs backwards.
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

    /// The rays within the bounds of [`box_ray`](super::box_ray), the largest absolute value of a
    /// coordinate for each, and the reciprocals of the directions made so small that nothing
    /// overflows.
    #[inline(always)]
    pub(crate) fn bounded(&self, largest: f32) -> (L::Mask, L, [L; 3]) {
        // SAFETY: values exist.
        unsafe {
            let [x, y, z] = self.inverse;
            let limit = x.abs().min(y.abs()).min(z.abs()) * L::splat(CLAMP);
            let size = self.reach_up_to(largest);
            let shift = size * limit;
            let in_range = size.lt(L::splat(SIZES.end))
                & L::splat(SIZES.start).le(size)
                & shift.lt(L::splat(SHIFTS.end))
                & L::splat(SHIFTS.start).le(shift);
            let least = L::splat(0.0) - limit;
            let scale = [x.max(least).min(limit), y.max(least).min(limit), z.max(least).min(limit)];
            (in_range, size, scale)
        }
    }

    /// The bounded reciprocals, if all rays are in range, run to the same sides, and mostly along
    /// the same axis.
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

    /// The largest absolute value of a coordinate of the origin, plus `largest`.
    #[inline(always)]
    fn reach_up_to(&self, largest: f32) -> L {
        let [x, y, z] = self.origin;
        // SAFETY: a value exists.
        x.abs().max(y.abs()).max(z.abs()) + unsafe { L::splat(largest) }
    }

    /// Returns the rays as triangles are tested with them whose coordinates are at most `largest`.
    #[inline(always)]
    pub(crate) fn sheared(&self, [x, y, z]: [usize; 3], largest: f32) -> Pairs<L> {
        let Self { origin, direction, t_min, .. } = self;
        let reach = self.reach_up_to(largest);
        // SAFETY: a value exists.
        let part = unsafe { L::splat(SINGLE_ERROR) };
        Pairs {
            origin: [origin[x], origin[y], origin[z]],
            direction: [direction[x], direction[y], direction[z]],
            slope: [direction[x] / direction[z], direction[y] / direction[z]],
            reach,
            error: reach * part,
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
    /// Returns the bounds of no rays.
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
            size = size.max(self.lowest[axis].abs()).max(self.highest[axis].abs());
        }
        (size.greatest() + largest) * MARGIN
    }
}

/// Returns the least lane.
#[inline(always)]
fn least<L: Lanes>(lanes: L) -> f32 {
    // SAFETY: a value exists.
    let minus = unsafe { L::splat(-0.0) };
    -(lanes ^ minus).greatest()
}
