//! Batches of rays: packets where the rays are coherent, otherwise many rays in flight.

use super::answer::{Any, Find, Nearest};
use super::instructions::{Instructions, Task};
use super::lanes::Lanes;
use super::layout::WideBvh;
use super::packet::{Packet, RAYS};
use super::ray_lanes::Rays;
use super::{flight, vector};
use crate::{Hit, Kernel, Ray};
use core::ops::Range;

/// Tells what the rays of a batch have in common. The hint changes no answer, and
/// [`Kernel::Portable`](crate::Kernel::Portable) traces the rays one after the other in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coherence {
    /// Consecutive rays begin close to each other and run in similar directions, as rays through
    /// neighbouring pixels do, or rays from neighbouring points to a light. Packets of 128 trace
    /// them where they cohere; all other rays are traced as incoherent ones.
    Coherent,
    /// Consecutive rays have little in common. Four dozen rays are in flight, and each advances by a
    /// step in turn, which hides the latency of memory. This pays from a hundred rays on.
    Incoherent,
}

impl WideBvh {
    /// Writes the [nearest hit](Self::nearest_hit) of every ray to `hits`; [`Hit::MISS`] for a ray
    /// that meets nothing.
    ///
    /// ```
    /// # use bvh_core::{Bvh, Coherence, Hit, Node, Ray, Triangle, WideBvh};
    /// let triangles = [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]].map(Triangle::from);
    /// # let tree = Bvh::new(vec![Node::leaf(triangles[0].aabb(), 0, 1)], vec![0]);
    /// let wide = WideBvh::new(&tree, &triangles)?;
    /// let rays = [0.2, 0.9].map(|x| Ray::half_line([x, 0.2, 3.0], [0.0, 0.0, -1.0]).unwrap());
    /// let mut hits = [Hit::MISS; 2];
    /// wide.nearest_hits(&rays, &mut hits, Coherence::Coherent);
    /// assert_eq!(hits, [Hit { t: 3.0, object: 0 }, Hit::MISS]);
    /// # Ok::<(), bvh_core::InvalidBvh>(())
    /// ```
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn nearest_hits(&self, rays: &[Ray], hits: &mut [Hit], coherence: Coherence) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        for (rays, hits) in rays.chunks(AT_ONCE).zip(hits.chunks_mut(AT_ONCE)) {
            self.trace(Nearest { rays, hits }, coherence);
        }
    }

    /// Writes to `hits` whether each ray meets [any triangle](Self::any_hit).
    ///
    /// ```
    /// # use bvh_core::{Bvh, Coherence, Node, Ray, Triangle, WideBvh};
    /// let triangles = [[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]].map(Triangle::from);
    /// # let tree = Bvh::new(vec![Node::leaf(triangles[0].aabb(), 0, 1)], vec![0]);
    /// let wide = WideBvh::new(&tree, &triangles)?;
    /// // Shadow rays: is anything between a point and a light?
    /// let rays = [-1.0, 1.0].map(|z| Ray::new([0.2, 0.2, z], [0.0, 0.0, 5.0 - z], 0.0, 1.0).unwrap());
    /// let mut is_hidden = [false; 2];
    /// wide.any_hits(&rays, &mut is_hidden, Coherence::Incoherent);
    /// assert_eq!(is_hidden, [true, false]);
    /// # Ok::<(), bvh_core::InvalidBvh>(())
    /// ```
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn any_hits(&self, rays: &[Ray], hits: &mut [bool], coherence: Coherence) {
        assert_eq!(rays.len(), hits.len(), "an answer for every ray");
        for (rays, hits) in rays.chunks(AT_ONCE).zip(hits.chunks_mut(AT_ONCE)) {
            self.trace(Any { rays, hits }, coherence);
        }
    }

    /// Answers at most [`AT_ONCE`] rays.
    pub(super) fn trace<F: Find>(&self, mut find: F, coherence: Coherence) {
        let count = find.rays().count();
        if self.kernel == Kernel::Portable || count < FEW {
            (0..count).for_each(|number| find.alone(self, number));
            return;
        }
        let task = Batch::<_, false> { wide: self, find: &mut find, coherence };
        // SAFETY: a layout's kernel is available.
        unsafe {
            // Rays in f64 bring their frame, and all hits are searched in flight.
            if const { !F::DECIDES && !F::ALL } && self.framed.is_some() {
                vector::dispatch(self.kernel, task.in_frame())
            } else {
                vector::dispatch(self.kernel, task)
            }
        }
    }
}

/// The number of rays in a batch, whose numbers have 32 bits.
const AT_ONCE: usize = 1 << 31;

/// The number of rays below which rays in flight are not worth their preparation.
const FEW: usize = 8;

/// The minimum run of rays between packets that is traced in flight rather than ray by ray.
const MANY: usize = 128;

/// The search for the answers to all rays of a batch: coherent rays in packets, other rays in
/// flight. Without a frame nothing is copied for one, which would take a tenth of the time of rays
/// that meet little.
struct Batch<'a, F, const IN_FRAME: bool> {
    wide: &'a WideBvh,
    find: &'a mut F,
    coherence: Coherence,
}

impl<'a, F> Batch<'a, F, false> {
    fn in_frame(self) -> Batch<'a, F, true> {
        let Self { wide, find, coherence } = self;
        Batch { wide, find, coherence }
    }
}

impl<K: Instructions, F: Find, const IN_FRAME: bool> Task<K> for Batch<'_, F, IN_FRAME> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { wide, find, coherence } = self;
        let rays = find.rays();
        // SAFETY: the processor has the instructions of `K`.
        unsafe {
            if F::ALL || coherence == Coherence::Incoherent {
                return flight::trace::<K, F>(wide, 0..rays.count(), find);
            }
            let mut packet = Packet::<K>::new();
            // The rays from `first_of_rest` up to `next` fit no packet, and wait for `rest`.
            let mut first_of_rest = 0;
            let mut next = 0;
            while next + K::Rays::N <= rays.count() {
                rays.prefetch::<K>(next + RAYS);
                let frame = if IN_FRAME { wide.frame() } else { None };
                let (lanes, boxed) = rays.load(next, frame);
                if boxed.cohere(&lanes, wide.near_box()) {
                    if !packet.takes(boxed.octant()) {
                        packet.trace(wide, find);
                    }
                    packet.add(lanes, boxed, next);
                    rest::<K, F>(wide, first_of_rest..next, find);
                    first_of_rest = next + K::Rays::N;
                }
                next += K::Rays::N;
            }
            if !packet.is_empty() {
                packet.trace(wide, find);
            }
            rest::<K, F>(wide, first_of_rest..rays.count(), find);
        }
    }
}

/// Traces the rays between two packets. A few rays at the edge of something are nearly coherent and
/// faster one by one; a long run of them is faster in flight.
#[inline(always)]
unsafe fn rest<K: Instructions, F: Find>(wide: &WideBvh, numbers: Range<usize>, find: &mut F) {
    let is_many = numbers.len() >= MANY;
    if is_many {
        // SAFETY: the processor has the instructions of `K`.
        unsafe { flight::trace::<K, F>(wide, numbers, find) };
    } else {
        numbers.for_each(|number| find.alone(wide, number));
    }
}
