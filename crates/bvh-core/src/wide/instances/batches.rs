//! Batches of rays through instances.

use super::Placed;
use crate::wide::answer::{ANY_HIT, Batch, NEAREST_HIT};
use crate::{Aabb, Coherence, InstanceHit, Instances, Ray, Slabs, WideBvh};

impl Instances {
    /// Writes the [nearest hit](Self::nearest_hit) of every ray to `hits`; [`InstanceHit::MISS`]
    /// for a ray that hits nothing. The answers of a batch are, bit by bit, the answers of single
    /// calls, and distances are in multiples of the lengths of the rays' directions.
    ///
    /// Coherent rays pass through the tree over the instances in packets of 64. Those that enter an
    /// instance are moved into its part together, and are a packet there. All other rays are in
    /// flight through both levels: each visits its instances in the order in which it enters them.
    ///
    /// ```
    /// # use bvh_core::{Aabb, Bvh, Coherence, Instance, InstanceHit, Instances, Node, Ray, Triangle, WideBvh, boxes};
    /// # use glam::{Affine3A, Vec3};
    /// # let triangles = [Triangle::from([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])];
    /// # let tree = Bvh { nodes: vec![Node::leaf(boxes(&triangles)[0], 0, 1)], prim_ids: vec![0] };
    /// # let parts = vec![WideBvh::new(&tree, &triangles)?];
    /// # let moved = |z| Instance { part: 0, transform: Affine3A::from_translation(Vec3::Z * z) };
    /// # let instances = vec![moved(0.0), moved(4.0)];
    /// # let boxes = Instance::boxes(&instances, &parts)?;
    /// # let top = Bvh { nodes: vec![Node::leaf(boxes[0].union(&boxes[1]), 0, 2)], prim_ids: vec![0, 1] };
    /// let scene = Instances::new(parts, instances, top)?;
    /// let down = |x| Ray::half_line([x, 0.2, 9.0], [0.0, 0.0, -1.0]).unwrap();
    /// let mut hits = [InstanceHit::MISS; 2];
    /// scene.nearest_hits(&[down(0.2), down(7.0)], &mut hits, Coherence::Coherent);
    /// assert_eq!(hits, [InstanceHit { t: 5.0, instance: 1, triangle: 0 }, InstanceHit::MISS]);
    /// # Ok::<(), bvh_core::InvalidInstances>(())
    /// ```
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn nearest_hits(&self, rays: &[Ray], mut hits: &mut [InstanceHit], coherence: Coherence) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        let batch = Batch::through_instances(self, rays, &mut hits);
        self.wide_top.trace::<NEAREST_HIT>(batch, coherence);
    }

    /// Writes to `hits` whether each ray hits a triangle of [any instance](Self::any_hit).
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn any_hits(&self, rays: &[Ray], mut hits: &mut [bool], coherence: Coherence) {
        assert_eq!(rays.len(), hits.len(), "an answer for every ray");
        let batch = Batch::through_instances(self, rays, &mut hits);
        self.wide_top.trace::<ANY_HIT>(batch, coherence);
    }

    /// Returns the ray in the coordinates of an instance's part, and the distance at which it
    /// enters the instance's box. Returns `None` if the ray does not enter the box up to `t_max`,
    /// or if the instance's transform makes its direction vanish or overflow.
    #[inline(always)]
    pub(crate) fn enter(&self, instance: u32, ray: &Ray, t_max: f32) -> Option<(Ray, f32)> {
        let placed = &self.placed[instance as usize];
        let entry = Slabs::new(ray, &self.wide_top.bounds).entry(&placed.aabb);
        if entry > t_max {
            return None;
        }
        Some((placed.local(ray, t_max)?, entry))
    }

    /// Returns the part of an instance.
    #[inline(always)]
    pub(crate) fn part_of(&self, instance: u32) -> &WideBvh {
        &self.parts[self.placed[instance as usize].part as usize]
    }

    /// Returns the instances as they are prepared for rays.
    #[inline(always)]
    pub(crate) fn placed(&self) -> &[Placed] {
        &self.placed
    }

    /// Returns the box around all instances.
    #[inline(always)]
    pub(crate) fn bounds(&self) -> Aabb {
        self.wide_top.bounds
    }
}
