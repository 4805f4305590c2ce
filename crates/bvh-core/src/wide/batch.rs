//! Batches of rays: packets where the rays are coherent, otherwise many rays in flight.

use super::answer::{ANY_HIT, Accept, Batch, NEAREST_HIT};
use super::instructions::{Instructions, Task};
use super::lanes::Lanes;
use super::layout::WideBvh;
use super::packet::{Packet, RAYS};
use super::ray_lanes::{RayLanes, prefetch};
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
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn nearest_hits(&self, rays: &[Ray], mut hits: &mut [Hit], coherence: Coherence) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        self.trace::<NEAREST_HIT>(Batch::new(rays, &mut hits), coherence);
    }

    /// Writes to `hits` whether each ray meets [any triangle](Self::any_hit).
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn any_hits(&self, rays: &[Ray], mut hits: &mut [bool], coherence: Coherence) {
        assert_eq!(rays.len(), hits.len(), "an answer for every ray");
        self.trace::<ANY_HIT>(Batch::new(rays, &mut hits), coherence);
    }

    /// Writes the [nearest accepted hit](Self::nearest_hit_where) of every ray to `hits`. `accept`
    /// also sees the index of the ray in `rays`, and sees hits in no order.
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    ///
    /// ```
    /// # use bvh_core::{Aabb, Bvh, Coherence, Hit, Node, Ray, Triangle, WideBvh};
    /// # let triangles = [0.0, 1.0].map(|z| Triangle::from([[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]]));
    /// # let tree = Bvh { nodes: vec![Node::leaf(Aabb::from([[0.0; 3], [1.0; 3]]), 0, 2)], prim_ids: vec![0, 1] };
    /// # let wide = WideBvh::new(&tree, &triangles)?;
    /// let rays = [Ray::half_line([0.2, 0.2, 3.0], [0.0, 0.0, -1.0]).unwrap(); 2];
    /// let mut hits = [Hit::MISS; 2];
    /// // The second ray began on triangle 1.
    /// let own = [u32::MAX, 1];
    /// wide.nearest_hits_where(&rays, &mut hits, Coherence::Coherent, |ray, hit| hit.object != own[ray]);
    /// assert_eq!(hits.map(|hit| hit.object), [1, 0]);
    /// # Ok::<(), bvh_core::InvalidBvh>(())
    /// ```
    pub fn nearest_hits_where(
        &self,
        rays: &[Ray],
        mut hits: &mut [Hit],
        coherence: Coherence,
        mut accept: impl FnMut(usize, Hit) -> bool,
    ) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        let batch = Batch::new(rays, &mut hits);
        self.trace_where::<NEAREST_HIT>(batch, &mut accept, coherence);
    }

    /// Writes to `hits` whether each ray has [an accepted hit](Self::any_hit_where). `accept` is
    /// called as by [`nearest_hits_where`](Self::nearest_hits_where).
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn any_hits_where(
        &self,
        rays: &[Ray],
        mut hits: &mut [bool],
        coherence: Coherence,
        mut accept: impl FnMut(usize, Hit) -> bool,
    ) {
        assert_eq!(rays.len(), hits.len(), "an answer for every ray");
        let batch = Batch::new(rays, &mut hits);
        self.trace_where::<ANY_HIT>(batch, &mut accept, coherence);
    }

    // Not generic over the function, so that the kernels are compiled here and not by every crate
    // that calls them.
    fn trace_where<'a, const ANY: bool>(
        &self,
        batch: Batch<'a>,
        accept: &'a mut Accept<'a>,
        coherence: Coherence,
    ) {
        self.trace::<ANY>(Batch { accept: Some(accept), ..batch }, coherence);
    }

    /// Answers a batch by the layout's kernel.
    fn trace<const ANY: bool>(&self, mut batch: Batch, coherence: Coherence) {
        assert!(u32::try_from(batch.rays.len()).is_ok(), "fewer than 2³² rays in a batch");
        if self.kernel != Kernel::Portable {
            let task = Trace::<ANY> { wide: self, batch: &mut batch, coherence };
            // SAFETY: a layout's kernel is available.
            return unsafe { vector::dispatch(self.kernel, task) };
        }
        for number in 0..batch.rays.len() {
            let ray = batch.rays[number];
            batch.alone::<ANY>(number, self, &ray);
        }
    }
}

/// The minimum run of rays between packets that is traced in flight rather than ray by ray.
const MANY: usize = 128;

/// The search for the answers to all rays of a batch: coherent rays in packets, other rays in
/// flight.
struct Trace<'a, 'b, const ANY: bool> {
    wide: &'a WideBvh,
    batch: &'a mut Batch<'b>,
    coherence: Coherence,
}

impl<K: Instructions, const ANY: bool> Task<K> for Trace<'_, '_, ANY> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { wide, batch, coherence } = self;
        let rays = batch.rays;
        // SAFETY: the processor has the instructions of `K`.
        unsafe {
            if coherence == Coherence::Incoherent {
                return flight::trace::<K, ANY>(wide, batch, 0..rays.len());
            }
            let mut packet = Packet::<K>::new();
            // The rays from `first_of_rest` up to `next` fit no packet, and wait for `rest`.
            let mut first_of_rest = 0;
            let mut next = 0;
            while next + K::Rays::N <= rays.len() {
                prefetch::<K>(rays, next + RAYS);
                let lanes = RayLanes::load(rays, next);
                if lanes.cohere(&wide.near) {
                    if !packet.takes(lanes.octant()) {
                        packet.trace::<ANY>(wide, batch);
                    }
                    packet.add(lanes, next);
                    rest::<K, ANY>(wide, batch, first_of_rest..next);
                    first_of_rest = next + K::Rays::N;
                }
                next += K::Rays::N;
            }
            if !packet.is_empty() {
                packet.trace::<ANY>(wide, batch);
            }
            rest::<K, ANY>(wide, batch, first_of_rest..rays.len());
        }
    }
}

/// Traces the rays between two packets. A few rays at the edge of something are nearly coherent and
/// faster one by one; a long run of them is faster in flight.
#[inline(always)]
unsafe fn rest<K: Instructions, const ANY: bool>(
    wide: &WideBvh,
    batch: &mut Batch,
    numbers: Range<usize>,
) {
    let is_many = numbers.len() >= MANY;
    if is_many {
        // SAFETY: the processor has the instructions of `K`.
        unsafe { flight::trace::<K, ANY>(wide, batch, numbers) };
    } else {
        for number in numbers {
            let ray = batch.rays[number];
            batch.alone::<ANY>(number, wide, &ray);
        }
    }
}
