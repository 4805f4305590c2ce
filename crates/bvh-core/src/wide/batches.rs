//! The public calls for batches of rays.

use super::answer::{ANY_HIT, Accept, Batch, NEAREST_HIT};
use super::coherence::Coherence;
use super::layout::WideBvh;
use super::vector;
use crate::{Hit, Kernel, Ray};

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
    pub(super) fn trace<const ANY: bool>(&self, mut batch: Batch, coherence: Coherence) {
        if self.kernel != Kernel::Portable {
            // SAFETY: `kernel` is available, as those who set it saw.
            return unsafe { vector::trace::<ANY>(self, &mut batch, coherence) };
        }
        for number in 0..batch.rays.len() {
            let ray = batch.rays[number];
            batch.alone::<ANY>(number, self, &ray);
        }
    }
}
