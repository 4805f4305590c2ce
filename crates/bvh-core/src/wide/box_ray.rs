//! The box tests of the vector kernels: those of [`Slabs`](crate::Slabs), whose proof holds for
//! them. Only what they do about 0 · ∞ differs.
//!
//! *Parallel.* Where the reciprocal of a component of the direction overflows, the factor of exits
//! is infinite, and an exit is NaN if the ray runs in the face. `min` returns the second of a NaN
//! and a number. So an exit that is NaN is passed over, and perhaps another with it, which visits
//! more boxes and never fewer. Entries are finite, or infinite in unused lanes, whose boxes begin at
//! ∞ and end at −∞.
//!
//! *Packets.* Interval arithmetic takes the least and the greatest product over all origins and all
//! factors of a packet by the same operations. Rounding is monotone: the bounds are not beyond the
//! distances of any ray of the packet.

use super::instructions::Instructions;
use super::lanes::{DoubleLanes, Lanes};
use super::layout::WideNode;
use crate::Ray;
use crate::each::Each;
use crate::slabs::{FAR, FAR_DOUBLE, FarRay, NEAR, NEAR_DOUBLE};

/// The bytes of a node's eight planes.
const PLANE: usize = size_of::<[f32; WideNode::LANES]>();

/// A ray as boxes are tested with it.
pub(crate) trait BoxTest<K: Instructions> {
    /// Returns the [keys](super::instructions::Pending) of the boxes of a node that the ray enters
    /// by `t_max`, and a bit for each of them.
    unsafe fn boxes(&self, node: &WideNode, t_max: f32) -> (K::Boxes, u32);
}

/// The bytes of a node before the planes that a ray meets first, by axis, and before the planes
/// opposite.
#[derive(Clone, Copy)]
struct Planes {
    near: [usize; 3],
    far: [usize; 3],
}

impl Planes {
    #[inline(always)]
    fn of(ray: &Ray) -> Self {
        let [_, _, inverse] = ray.vectors();
        let backwards = inverse.is_negative_bitmask() as usize;
        let near = [
            3 * PLANE * (backwards & 1),
            3 * PLANE * (backwards >> 1 & 1) + PLANE,
            3 * PLANE * (backwards >> 2 & 1) + 2 * PLANE,
        ];
        Self { near, far: [3 * PLANE - near[0], 5 * PLANE - near[1], 7 * PLANE - near[2]] }
    }

    /// Returns the near and the far planes of a node across an axis.
    #[inline(always)]
    unsafe fn load<L: Lanes>(&self, node: &WideNode, axis: usize) -> [L; 2] {
        // SAFETY: both name aligned planes of the node, of as many lanes as `L`.
        unsafe {
            let planes = node.planes.as_ptr().cast::<u8>();
            [
                L::load(planes.add(self.near[axis]).cast()),
                L::load(planes.add(self.far[axis]).cast()),
            ]
        }
    }
}

/// A ray in all lanes.
pub(crate) struct BoxRay<L> {
    planes: Planes,
    origin: [L; 3],
    near_factor: [L; 3],
    far_factor: [L; 3],
    t_min: L,
}

impl<L: Lanes> BoxRay<L> {
    #[inline(always)]
    pub(crate) unsafe fn new(ray: &Ray) -> Self {
        let origin = ray.origin();
        let near = ray.inverse_direction() * NEAR;
        let far = ray.inverse_direction() * FAR;
        // SAFETY: the processor has the instructions.
        unsafe {
            Self {
                planes: Planes::of(ray),
                origin: [L::splat(origin.x), L::splat(origin.y), L::splat(origin.z)],
                near_factor: [L::splat(near.x), L::splat(near.y), L::splat(near.z)],
                far_factor: [L::splat(far.x), L::splat(far.y), L::splat(far.z)],
                t_min: L::splat(ray.t_min()),
            }
        }
    }
}

impl<K: Instructions> BoxTest<K> for BoxRay<K::Boxes> {
    #[inline(always)]
    unsafe fn boxes(&self, node: &WideNode, t_max: f32) -> (K::Boxes, u32) {
        // SAFETY: the processor has the instructions.
        unsafe {
            let mut near = [self.t_min; 3];
            let mut far = [self.t_min; 3];
            for axis in 0..3 {
                let [near_plane, far_plane] = self.planes.load::<K::Boxes>(node, axis);
                near[axis] = (near_plane - self.origin[axis]) * self.near_factor[axis];
                far[axis] = (far_plane - self.origin[axis]) * self.far_factor[axis];
            }
            let entry = near[0].max(near[1]).max(near[2].max(self.t_min));
            let exit = far[0].min(far[1]).min(far[2].min(K::Boxes::splat(t_max)));
            K::keys(entry, entry.le(exit))
        }
    }
}

/// A ray that begins [far](Ray::is_far_from) from the scene: boxes are tested in f64.
pub(crate) struct FarBoxRay {
    planes: Planes,
    /// The origins of near and of far planes, which differ in a frame.
    near_origin: [f64; 3],
    far_origin: [f64; 3],
    inverse: [f64; 3],
    t_min: f32,
}

impl FarBoxRay {
    /// `boxed` and `far` are forms of one ray.
    pub(crate) fn new(boxed: &Ray, far: &FarRay) -> Self {
        let is_backwards = |axis: usize| boxed.inverse_direction()[axis].is_sign_negative();
        let origin = |axis: usize, is_lower: bool| {
            if is_lower { far.lower[axis] } else { far.upper[axis] }
        };
        Self {
            planes: Planes::of(boxed),
            near_origin: [0, 1, 2].each(|axis| origin(axis, !is_backwards(axis))),
            far_origin: [0, 1, 2].each(|axis| origin(axis, is_backwards(axis))),
            // The signs of zeros decide the planes, here as there.
            inverse: far.direction.recip().to_array(),
            t_min: boxed.t_min(),
        }
    }
}

impl<K: Instructions> BoxTest<K> for FarBoxRay {
    #[inline(always)]
    unsafe fn boxes(&self, node: &WideNode, t_max: f32) -> (K::Boxes, u32) {
        // SAFETY: the processor has the instructions.
        unsafe {
            let double = |x: f64| <K::Boxes as Lanes>::Double::splat(x);
            let mut entry = double(f64::NEG_INFINITY);
            let mut exit = double(f64::INFINITY);
            for axis in 0..3 {
                let [near, far] = self.planes.load::<K::Boxes>(node, axis);
                let inverse = double(self.inverse[axis]);
                let near_origin = double(self.near_origin[axis]);
                let far_origin = double(self.far_origin[axis]);
                entry = ((near.double() - near_origin) * inverse).max(entry);
                exit = ((far.double() - far_origin) * inverse).min(exit);
            }
            let entry = entry * double(NEAR_DOUBLE);
            let exit = exit * double(FAR_DOUBLE);
            let crosses = K::Boxes::narrow(entry.le(exit));
            // The range of the ray is compared with rounded distances, as those of hits are.
            let t_min = K::Boxes::splat(self.t_min);
            let entry = K::Boxes::single(entry).max(t_min);
            let is_in_range = t_min.le(K::Boxes::single(exit)) & entry.le(K::Boxes::splat(t_max));
            K::keys(entry, crosses & is_in_range)
        }
    }
}
