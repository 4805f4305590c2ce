//! The bounds of a packet of rays, with which a node is culled for all of them at once.

use super::instructions::Instructions;
use super::lanes::Lanes;
use super::node::WideNode;
use super::ray_lanes::RayBounds;
use crate::slabs::{FAR, NEAR};

/// The bounds of a packet as boxes are tested with them: along each axis the origins for which the
/// distances to near planes are least and to far planes greatest, and the extreme scales.
pub(super) struct Culling<L> {
    /// The indices of the planes that the rays meet first, by axis, and of the planes opposite.
    near: [usize; 3],
    far: [usize; 3],
    near_origin: [L; 3],
    far_origin: [L; 3],
    /// The extreme factors of near and of far planes, the one of the lesser size first.
    near_factors: [[L; 2]; 3],
    far_factors: [[L; 2]; 3],
    begin: L,
    side: [f32; 3],
}

impl<L: Lanes> Culling<L> {
    /// Returns the bounds of rays of one octant, for boxes whose coordinates are at most `largest`.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(super) unsafe fn new<R: Lanes>(bounds: &RayBounds<R>, octant: u32) -> Self {
        // SAFETY: the caller's promise.
        unsafe {
            let zero = L::splat(0.0);
            let mut culling = Self {
                near: [0; 3],
                far: [0; 3],
                near_origin: [zero; 3],
                far_origin: [zero; 3],
                near_factors: [[zero; 2]; 3],
                far_factors: [[zero; 2]; 3],
                begin: L::splat(bounds.begin()),
                side: [1.0; 3],
            };
            for axis in 0..3 {
                let [lowest, highest] = bounds.origins(axis);
                let [least, most] = bounds.inverses(axis);
                let is_backwards = octant >> axis & 1 != 0;
                culling.near[axis] = axis + 3 * usize::from(is_backwards);
                culling.far[axis] = axis + 3 * usize::from(!is_backwards);
                // Distances grow with the plane minus the origin if the scale is positive, else the
                // other way.
                let (near, far) = if is_backwards {
                    culling.side[axis] = -1.0;
                    (lowest, highest)
                } else {
                    (highest, lowest)
                };
                culling.near_origin[axis] = L::splat(near);
                culling.far_origin[axis] = L::splat(far);
                // An infinite factor must be the second: `cull` has NaN from it, not a number.
                let (small, large) = if is_backwards { (most, least) } else { (least, most) };
                culling.near_factors[axis] = [L::splat(small * NEAR), L::splat(large * NEAR)];
                culling.far_factors[axis] = [L::splat(small * FAR), L::splat(large * FAR)];
            }
            culling
        }
    }

    /// Returns the least distance at which any ray may enter each child, and a bit per child that
    /// some ray may enter before `farthest`: the bounds of `(plane − origin) · scale` over all
    /// rays.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(super) unsafe fn cull<K: Instructions<Boxes = L>>(
        &self,
        node: &WideNode,
        farthest: f32,
    ) -> (L, u32) {
        // SAFETY: planes are whole and aligned.
        unsafe {
            let mut entry = self.begin;
            let mut exit = L::splat(farthest);
            for axis in 0..3 {
                let near = L::load(node.planes.as_ptr().add(self.near[axis]).cast());
                let near = near - self.near_origin[axis];
                let [small, large] = self.near_factors[axis];
                let near = (near * small).min(near * large);
                // `max` returns the second of two zeros: entries are never −0.
                entry = near.max(entry);
                let far = L::load(node.planes.as_ptr().add(self.far[axis]).cast());
                let far = far - self.far_origin[axis];
                let [small, large] = self.far_factors[axis];
                let far = (far * small).max(far * large);
                // `min` returns the second of a NaN and a number.
                exit = far.min(exit);
            }
            (entry, K::entered(entry, exit))
        }
    }

    /// Returns the planes of a box that contains everything, by axis.
    #[inline(always)]
    pub(super) fn all_space(&self) -> [[f32; 2]; 3] {
        let far = self.side.map(|margin| f32::INFINITY.copysign(margin));
        [[-far[0], far[0]], [-far[1], far[1]], [-far[2], far[2]]]
    }

    /// Returns the near and the far plane of the child in a lane, by axis, moved by the margin.
    ///
    /// # Safety
    /// There is such a lane.
    #[inline(always)]
    pub(super) unsafe fn planes(&self, node: &WideNode, lane: usize) -> [[f32; 2]; 3] {
        // SAFETY: there are six planes of eight lanes.
        unsafe {
            let lanes = node.planes.as_ptr().cast::<f32>().add(lane);
            let mut planes = [[0.0; 2]; 3];
            for (axis, planes) in planes.iter_mut().enumerate() {
                *planes = [
                    *lanes.add(WideNode::LANES * self.near[axis]),
                    *lanes.add(WideNode::LANES * self.far[axis]),
                ];
            }
            planes
        }
    }
}
