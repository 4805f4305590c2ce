//! A scene of parts that stand in many places: a tree over the instances, each of a part in the wide layout.
//!
//! An instance sees a ray as `transform⁻¹` moves it, computed in f64 and rounded to f32 once, with its direction's length changed
//! along. So a distance means the same to all of them, and the answer is, bit by bit, the least that the parts' own layouts give to
//! these rays, whatever the tree over the instances. Beside the same scene with all triangles written out, distances differ by the
//! rounding of the moved rays here and of the moved corners there, some 10⁻⁷ of the coordinates; without rounding, as
//! by whole translations and turns by right angles, not at all.
//!
//! ```
//! use bvh_core::{Aabb, Bvh, Instance, InstanceHit, Instances, Node, Ray, Triangle, WideBvh, boxes};
//! use glam::{Affine3A, Vec3};
//! let triangles = [Triangle::from([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])];
//! let aabb = boxes(&triangles)[0];
//! let part = WideBvh::new(&Bvh { nodes: vec![Node::leaf(aabb, 0, 1)], prim_ids: vec![0] }, &triangles)?;
//! let parts = vec![part];
//! let at = |z| Instance { part: 0, transform: Affine3A::from_translation(Vec3::Z * z) };
//! let instances = vec![at(0.0), at(4.0)];
//! // Any builder of `bvh-build` makes the tree over these boxes; here it is one leaf.
//! let boxes = Instance::boxes(&instances, &parts)?;
//! let top = Bvh { nodes: vec![Node::leaf(boxes[0].union(&boxes[1]), 0, 2)], prim_ids: vec![0, 1] };
//! let scene = Instances::new(parts, instances, top)?;
//! let ray = Ray::half_line([0.2, 0.2, 9.0], [0.0, 0.0, -1.0]).unwrap();
//! assert_eq!(scene.nearest_hit(&ray), Some(InstanceHit { t: 5.0, instance: 1, triangle: 0 }));
//! # Ok::<(), bvh_core::InvalidInstances>(())
//! ```

use crate::{Aabb, Bvh, Hit, InvalidBvh, Ray, Slabs, WideBvh, any_hit_by, nearest_hit_by, validate};
use alloc::vec::Vec;
use glam::{Affine3A, DAffine3, DVec3};

/// A part, put somewhere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The part's index.
    pub part: u32,
    /// From the part's coordinates to the scene's; it must have an inverse.
    pub transform: Affine3A,
}

/// Why there is no such scene of instances.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidInstances {
    /// A part that does not exist.
    #[error("instance {instance} is of part {part} of {parts}, counted from 0")]
    Part {
        /// The instance.
        instance: usize,
        /// The part found.
        part: u32,
        /// The number of parts.
        parts: usize,
    },
    /// A part has no triangle that a ray could hit.
    #[error("instance {0} is of a part without triangles")]
    Empty(usize),
    /// The transform is not finite or has no inverse, or its box is not finite in f32.
    #[error("the transform of instance {0} or of its box is not finite, or has no inverse")]
    Transform(usize),
    /// The tree is none over the instances' boxes, or a part's none over its triangles'.
    #[error(transparent)]
    Tree(#[from] InvalidBvh),
}

impl Instance {
    /// The scene's boxes of all instances, in their order, for any builder.
    pub fn boxes(instances: &[Self], parts: &[WideBvh]) -> Result<Vec<Aabb>, InvalidInstances> {
        let prepare = |(at, instance): (usize, &Self)| instance.placed(at, parts).map(|placed| placed.aabb);
        instances.iter().enumerate().map(prepare).collect()
    }

    fn placed(&self, instance: usize, parts: &[WideBvh]) -> Result<Placed, InvalidInstances> {
        let missing = InvalidInstances::Part { instance, part: self.part, parts: parts.len() };
        let part = parts.get(self.part as usize).ok_or(missing)?;
        if part.root.is_none() {
            return Err(InvalidInstances::Empty(instance));
        }
        let transform = DAffine3::from_mat3_translation(
            glam::DMat3::from_cols_array(&self.transform.matrix3.to_cols_array().map(f64::from)),
            DVec3::from_array(self.transform.translation.to_array().map(f64::from)),
        );
        let inverse = transform.inverse();
        let (mut min, mut max, mut size) =
            (transform.translation, transform.translation, transform.translation.abs());
        for axis in 0..3 {
            let column = transform.matrix3.col(axis);
            let (a, b) = (column * f64::from(part.bounds.min[axis]), column * f64::from(part.bounds.max[axis]));
            (min, max, size) = (min + a.min(b), max + a.max(b), size + a.abs().max(b.abs()));
        }
        // More than what the rounding of a ray's origin near the part, and of the corners of this box, can move a hit.
        let margin = size * f64::from(Slabs::MARGIN);
        let aabb = Aabb { min: (min - margin).as_vec3(), max: (max + margin).as_vec3() };
        if !inverse.is_finite() || transform.matrix3.determinant() == 0.0 || aabb.check().is_err() {
            return Err(InvalidInstances::Transform(instance));
        }
        Ok(Placed { part: self.part, to_local: inverse, aabb })
    }
}

/// An instance, ready for rays.
#[derive(Clone, Copy, Debug)]
struct Placed {
    part: u32,
    to_local: DAffine3,
    aabb: Aabb,
}

impl Placed {
    /// The ray as the part sees it, up to `t_max`. `None` where the transform makes its direction vanish or overflow.
    #[inline(always)]
    fn local(&self, ray: &Ray, t_max: f32) -> Option<Ray> {
        let origin = self.to_local.transform_point3(ray.origin().as_dvec3()).as_vec3();
        let direction = self.to_local.transform_vector3(ray.direction().as_dvec3()).as_vec3();
        Ray::new(origin, direction, ray.t_min(), t_max).ok()
    }
}

/// What a ray meets first among instances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InstanceHit {
    /// The distance, in multiples of the length of the ray's direction.
    pub t: f32,
    /// The instance.
    pub instance: u32,
    /// The triangle of its part.
    pub triangle: u32,
}

/// A scene of instances, for tracing.
#[derive(Clone, Debug)]
pub struct Instances {
    parts: Vec<WideBvh>,
    placed: Vec<Placed>,
    top: Bvh,
}

impl Instances {
    /// The scene of `instances` of `parts`, with a tree over [their boxes](Instance::boxes). Instances that move need
    /// a refitted or new tree, and no new parts. O(instances).
    pub fn new(parts: Vec<WideBvh>, instances: Vec<Instance>, top: Bvh) -> Result<Self, InvalidInstances> {
        let prepare = |(at, instance): (usize, &Instance)| instance.placed(at, &parts);
        let placed: Vec<Placed> = instances.iter().enumerate().map(prepare).collect::<Result<_, _>>()?;
        validate(&top, &placed.iter().map(|placed| placed.aabb).collect::<Vec<_>>())?;
        Ok(Self { parts, placed, top })
    }

    /// The parts again, for other instances of them.
    pub fn into_parts(self) -> Vec<WideBvh> {
        self.parts
    }

    /// The ray as an instance sees it. `None` where the instance's transform makes its direction vanish or overflow; such a
    /// ray does not hit the instance.
    ///
    /// # Panics
    /// If there is no such instance.
    pub fn local_ray(&self, instance: u32, ray: &Ray) -> Option<Ray> {
        self.placed[instance as usize].local(ray, ray.t_max())
    }

    /// The nearest triangle of any instance that `ray` meets in its range; of several at the same distance the one of the lowest
    /// instance, and within it of the lowest id.
    pub fn nearest_hit(&self, ray: &Ray) -> Option<InstanceHit> {
        let slabs = Slabs::new(ray, &self.top.root_aabb()?);
        let mut nearest: Option<(Hit, u32)> = None;
        let test = |object: u32, t_max: f32| {
            let placed = &self.placed[object as usize];
            let local = self.parts[placed.part as usize].nearest_hit(&placed.local(ray, t_max)?)?;
            // Not before the box, lest a tree that looks into it later should not look at all.
            let t = local.t.max(slabs.entry(&placed.aabb));
            let hit = Hit { t, object };
            if t <= t_max && nearest.is_none_or(|(nearest, _)| hit.precedes(&nearest)) {
                nearest = Some((hit, local.object));
            }
            Some(t)
        };
        nearest_hit_by(&self.top, ray, test, &mut ());
        nearest.map(|(Hit { t, object: instance }, triangle)| InstanceHit { t, instance, triangle })
    }

    /// Whether `ray` meets a triangle of any instance in its range.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        let Some(bounds) = self.top.root_aabb() else { return false };
        let slabs = Slabs::new(ray, &bounds);
        let test = |object: u32| {
            let placed = &self.placed[object as usize];
            let local = placed.local(ray, ray.t_max());
            slabs.entry(&placed.aabb) <= ray.t_max()
                && local.is_some_and(|local| self.parts[placed.part as usize].any_hit(&local))
        };
        any_hit_by(&self.top, ray, test, &mut ())
    }
}
