//! Rays of a batch in memory: rays one after the other, or components in slices.

use super::instructions::Instructions;
use super::lanes::Lanes;
use super::ray_lanes::RayLanes;
use crate::components::Distances;
use crate::{Ray, RayComponents};

/// Rays in memory, by their numbers.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    /// Rays one after the other.
    Rays(&'a [Ray]),
    /// Rays by component.
    Components(&'a RayComponents<'a>),
}

impl Source<'_> {
    /// Returns the number of rays.
    #[inline(always)]
    pub(crate) fn len(self) -> usize {
        match self {
            Self::Rays(rays) => rays.len(),
            Self::Components(rays) => rays.len(),
        }
    }

    /// Returns the ray with a number.
    #[inline(always)]
    pub(crate) fn ray(self, number: usize) -> Ray {
        match self {
            Self::Rays(rays) => rays[number],
            Self::Components(rays) => rays.ray(number),
        }
    }

    /// Has the rays that follow number `first` fetched that are as many as a vector's. They need
    /// not exist. While a packet is traced, the processor does not see that the rays of the next
    /// one follow.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(crate) unsafe fn prefetch<K: Instructions>(self, first: usize) {
        const LINE: usize = 64;
        // Components are streams, which the processor recognises.
        let Self::Rays(rays) = self else { return };
        let next = rays.as_ptr().wrapping_add(first).cast::<u8>();
        for line in 0..(K::Rays::N * size_of::<Ray>()).div_ceil(LINE) {
            // SAFETY: a prefetch may name any address.
            unsafe { K::prefetch(next.wrapping_add(line * LINE)) };
        }
    }

    /// Returns one ray per lane, from number `first` on.
    ///
    /// # Safety
    /// The processor has the instructions, and there are so many rays.
    #[inline(always)]
    pub(crate) unsafe fn lanes<L: Lanes>(self, first: usize) -> RayLanes<L> {
        // SAFETY: the caller's promises.
        unsafe {
            match self {
                Self::Rays(rays) => lanes_of_rays(rays, first),
                Self::Components(rays) => lanes_of_components(rays, first),
            }
        }
    }

    /// Returns the same as [`lanes`](Self::lanes), where the last ray before `end` fills the lanes
    /// that have none.
    ///
    /// # Safety
    /// The processor has the instructions, and there is a ray.
    #[inline(always)]
    pub(crate) unsafe fn lanes_up_to<L: Lanes>(self, first: usize, end: usize) -> RayLanes<L> {
        // SAFETY: the caller's promises.
        unsafe {
            if first + L::N <= end {
                return self.lanes(first);
            }
            let padded: [Ray; 16] = core::array::from_fn(|i| self.ray((first + i).min(end - 1)));
            lanes_of_rays(&padded, 0)
        }
    }
}

/// Returns one ray per lane, from number `first` on.
///
/// # Safety
/// The processor has the instructions, and there are so many rays.
#[inline(always)]
pub(crate) unsafe fn lanes_of_rays<L: Lanes>(rays: &[Ray], first: usize) -> RayLanes<L> {
    // SAFETY: the caller's promises; a ray is three vectors of four lanes.
    unsafe {
        let rays = rays.as_ptr().add(first);
        let [ox, oy, oz, t_min] = transpose(rays, 0);
        let [dx, dy, dz, t_max] = transpose(rays, 1);
        let [ix, iy, iz, _] = transpose(rays, 2);
        RayLanes {
            origin: [ox, oy, oz],
            direction: [dx, dy, dz],
            inverse: [ix, iy, iz],
            t_min,
            t_max,
        }
    }
}

/// Returns one ray per lane, likewise.
#[inline(always)]
unsafe fn lanes_of_components<L: Lanes>(rays: &RayComponents, first: usize) -> RayLanes<L> {
    let [[ox, oy, oz], [dx, dy, dz]] = rays.slices();
    let [t_min, t_max] = rays.ranges();
    // SAFETY: the caller's promises; slices are equally long.
    unsafe {
        let component = |slice: &[f32]| L::load_unaligned(slice.as_ptr().add(first));
        let distance = |distances: Distances<'_>| match distances {
            Distances::All(distance) => L::splat(distance),
            Distances::Each(distances) => component(distances),
        };
        let direction = [component(dx), component(dy), component(dz)];
        let zero = L::splat(0.0);
        let one = L::splat(1.0);
        let most = L::splat(f32::MAX);
        let least = L::splat(f32::MIN);
        // The same operations as in `Ray`, so that the bits agree.
        let inverse = |direction: L| (one / direction).max(least).min(most);
        RayLanes {
            origin: [component(ox), component(oy), component(oz)],
            direction,
            inverse: [inverse(direction[0]), inverse(direction[1]), inverse(direction[2])],
            t_min: distance(t_min).max(zero) + zero,
            t_max: distance(t_max).min(most) + zero,
        }
    }
}

/// Returns one of the three vectors of rays, by component.
#[inline(always)]
unsafe fn transpose<L: Lanes>(rays: *const Ray, vector: usize) -> [L; 4] {
    const STEP: usize = size_of::<Ray>() / 4;
    // SAFETY: the caller's promises; quarters beyond the lanes are not loaded.
    unsafe {
        let row = |i: usize| {
            let ray = rays.cast::<f32>().wrapping_add(4 * vector + i * STEP);
            L::load_quarters([
                ray,
                ray.wrapping_add(4 * STEP),
                ray.wrapping_add(8 * STEP),
                ray.wrapping_add(12 * STEP),
            ])
        };
        L::transpose_quarters([row(0), row(1), row(2), row(3)])
    }
}
