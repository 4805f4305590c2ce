//! Instancing: a tree over transformed copies of parts, each part in the wide layout.
//!
//! An instance is tested against the ray that `transform⁻¹` moves into the part's coordinates. The
//! moved ray is computed in f64 and rounded to f32 once. The length of its direction changes with
//! the transform, so a distance means the same for every instance. A distance that the part's layout
//! returns for the moved ray is at least that of the ray's entry into the instance's box in the scene,
//! and a ray that misses that box has no hit. The answer is, bit by bit, the least of these distances, for
//! any tree over the instances.
//!
//! Compared with the same scene whose triangles are all written out, distances differ by the
//! rounding of the moved rays and of the moved corners, about 10⁻⁷ of the coordinates. They do not
//! differ if transforms do not round: translations by whole numbers and turns by right angles.

use super::layout::WideBvh;
use crate::each::Each;
use crate::{Aabb, Bvh, Hit, InvalidBvh, Ray, Slabs, any_hit_by, nearest_hit_by, validate};
use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec3Swizzles};
use std::borrow::Borrow;
use std::sync::Arc;

/// A transformed copy of a part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instance {
    /// The part's index.
    pub part: u32,
    /// The transform from the part's coordinates to the scene's. It must have an inverse.
    pub transform: Affine3A,
}

/// The reason why instances are rejected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidInstances {
    /// The part does not exist.
    #[error("instance {instance} is of part {part} of {parts}, counted from 0")]
    #[allow(missing_docs)] // The message explains the fields.
    Part { instance: usize, part: u32, parts: usize },
    /// The part has no triangle that a ray could hit.
    #[error("instance {0} is of a part without triangles")]
    Empty(usize),
    /// The transform is not finite or has no inverse, or its box is not finite in f32.
    #[error("the transform of instance {0} or of its box is not finite, or has no inverse")]
    Transform(usize),
    /// The tree is not valid over the boxes of the instances, or the tree of a part is not valid
    /// over the boxes of its triangles.
    #[error(transparent)]
    Tree(#[from] InvalidBvh),
}

impl Instance {
    /// Returns the boxes of all instances in the scene's coordinates, in the same order, for any
    /// builder. They do not depend on the trees of the parts.
    pub fn boxes(
        instances: &[Self],
        parts: &[impl Borrow<WideBvh>],
    ) -> Result<Vec<Aabb>, InvalidInstances> {
        Ok(Self::place(instances, parts)?.iter().map(|placed| placed.aabb).collect())
    }

    /// Checks the instances and prepares them for rays.
    fn place(
        instances: &[Self],
        parts: &[impl Borrow<WideBvh>],
    ) -> Result<Vec<Placed>, InvalidInstances> {
        (instances.iter().enumerate())
            .map(|(index, instance)| {
                let missing = InvalidInstances::Part {
                    instance: index,
                    part: instance.part,
                    parts: parts.len(),
                };
                instance.placed(index, parts.get(instance.part as usize).ok_or(missing)?.borrow())
            })
            .collect()
    }

    /// Checks the instance of this part. `instance` is its index, for errors.
    fn placed(&self, instance: usize, part: &WideBvh) -> Result<Placed, InvalidInstances> {
        if part.root.is_none() {
            return Err(InvalidInstances::Empty(instance));
        }
        let transform = self.transform.as_daffine3();
        let to_local = transform.inverse();
        let aabb = transformed(&transform, &part.bounds);
        let is_singular = is_singular(&transform.matrix3);
        if !to_local.is_finite() || is_singular || aabb.check().is_err() {
            return Err(InvalidInstances::Transform(instance));
        }
        Ok(Placed { part: self.part, to_local, aabb })
    }
}

/// Returns whether the determinant is zero, or is smaller than its rounding.
fn is_singular(matrix: &DMat3) -> bool {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis].each(DVec3::abs);
    // The sum of the sizes of its six products.
    let size = x.dot(y.yzx() * z.zxy() + y.zxy() * z.yzx());
    matrix.determinant().abs() <= size * (4.0 * f64::EPSILON)
}

/// Returns a box around a transformed box in which a ray moved by the inverse transform has its
/// hits.
fn transformed(transform: &DAffine3, aabb: &Aabb) -> Aabb {
    // The box of the transformed box, column by column (Arvo 1990, 'Transforming axis-aligned
    // bounding boxes'). `size` bounds every intermediate result.
    let mut min = transform.translation;
    let mut max = transform.translation;
    let mut size = transform.translation.abs();
    for axis in 0..3 {
        let column = transform.matrix3.col(axis);
        let a = column * f64::from(aabb.min[axis]);
        let b = column * f64::from(aabb.max[axis]);
        min += a.min(b);
        max += a.max(b);
        size += a.abs().max(b.abs());
    }
    // Rounding moves a hit by less than this: the rounding of the ray's origin near the part,
    // and of the corners of this box.
    let margin = size * ROUNDING;
    Aabb { min: (min - margin).as_vec3(), max: (max + margin).as_vec3() }
}

/// The growth of a transformed box: 8u, as a part of the largest coordinate on the way.
const ROUNDING: f64 = 8.0 * (f32::EPSILON / 2.0) as f64;

/// An instance that is prepared for rays.
#[derive(Clone, Copy, Debug)]
struct Placed {
    part: u32,
    /// The transform from the scene's coordinates to the part's.
    to_local: DAffine3,
    /// The box that trees over instances have, in which all hits of the instance are.
    aabb: Aabb,
}

impl Placed {
    /// Returns the ray in the part's coordinates, up to `t_max`; `None` if the transform makes its
    /// direction vanish or overflow.
    #[inline(always)]
    fn local(&self, ray: &Ray, t_max: f32) -> Option<Ray> {
        let origin = self.to_local.transform_point3(ray.origin().as_dvec3()).as_vec3();
        let direction = self.to_local.transform_vector3(ray.direction().as_dvec3()).as_vec3();
        Ray::new(origin, direction, ray.t_min(), t_max).ok()
    }
}

/// The nearest hit of a ray among instances, in the layout that C has for it.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct InstanceHit {
    /// The distance, in multiples of the length of the ray's direction.
    pub t: f32,
    /// The index of the instance.
    pub instance: u32,
    /// The index of the triangle in the instance's part.
    pub triangle: u32,
}

impl InstanceHit {
    /// The value that a batch writes for a ray without a hit, as [`Hit::MISS`].
    pub const MISS: Self = Self { t: f32::INFINITY, instance: u32::MAX, triangle: u32::MAX };

    fn new(instance: u32, Hit { t, object: triangle }: Hit) -> Self {
        Self { t, instance, triangle }
    }
}

/// A scene of instances for tracing.
///
/// ```
/// # use bvh_core::{Aabb, Bvh, Instance, InstanceHit, Instances, Node, Ray, Triangle, WideBvh, boxes};
/// # use glam::{Affine3A, Vec3};
/// # let triangles = [Triangle::from([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])];
/// # let aabb = boxes(&triangles)[0];
/// # let part = WideBvh::new(&Bvh::new(vec![Node::leaf(aabb, 0, 1)], vec![0]), &triangles)?;
/// let parts = vec![part];
/// let moved = |z| Instance { part: 0, transform: Affine3A::from_translation(Vec3::Z * z) };
/// let instances = vec![moved(0.0), moved(4.0)];
/// // Any builder of `bvh-build` can make the tree over these boxes. Here it is a single leaf.
/// let boxes = Instance::boxes(&instances, &parts)?;
/// let top = Bvh::new(vec![Node::leaf(boxes[0].union(&boxes[1]), 0, 2)], vec![0, 1]);
/// let mut scene = Instances::new(parts, instances, top)?;
/// let ray = Ray::half_line([0.2, 0.2, 9.0], [0.0, 0.0, -1.0]).unwrap();
/// assert_eq!(scene.nearest_hit(&ray), Some(InstanceHit { t: 5.0, instance: 1, triangle: 0 }));
/// // The next frame.
/// scene.refit(&[moved(6.0), moved(4.0)])?;
/// assert_eq!(scene.nearest_hit(&ray), Some(InstanceHit { t: 3.0, instance: 0, triangle: 0 }));
/// # Ok::<(), bvh_core::InvalidInstances>(())
/// ```
#[derive(Clone, Debug)]
pub struct Instances {
    parts: Vec<Arc<WideBvh>>,
    placed: Vec<Placed>,
    /// Its boxes are tight.
    top: Bvh,
}

impl Instances {
    /// Makes a scene of `instances` of `parts`, with a tree over the [boxes of the
    /// instances](Instance::boxes), whose boxes it makes tight. Parts may be shared with other
    /// scenes, as `Arc<WideBvh>`. O(instances).
    pub fn new(
        parts: Vec<impl Into<Arc<WideBvh>>>,
        instances: Vec<Instance>,
        top: Bvh,
    ) -> Result<Self, InvalidInstances> {
        let parts = parts.into_iter().map(Into::into).collect();
        let mut scene = Self { parts, placed: Vec::new(), top: Bvh::default() };
        scene.replace(&instances, top)?;
        Ok(scene)
    }

    /// Replaces all instances, and the tree over their boxes. The parts remain, and nothing of them
    /// is copied. A rejected scene is unchanged. O(instances).
    pub fn replace(
        &mut self,
        instances: &[Instance],
        mut top: Bvh,
    ) -> Result<(), InvalidInstances> {
        let placed = Instance::place(instances, &self.parts)?;
        let boxes: Vec<Aabb> = placed.iter().map(|placed| placed.aabb).collect();
        validate(&top, &boxes)?;
        // Slabs depend on the root's box, and so would answers. The boxes lie along the scene's axes.
        top.refit(&boxes);
        top.frame = None;
        self.placed = placed;
        self.top = top;
        Ok(())
    }

    /// Moves the instances: as many as there are, with other transforms or parts, in the nodes of
    /// the present tree. Once they are far from where they were, a new tree and
    /// [`replace`](Self::replace) make rays faster. A rejected scene is unchanged. O(instances).
    ///
    /// # Panics
    /// If the number of instances differs.
    pub fn refit(&mut self, instances: &[Instance]) -> Result<(), InvalidInstances> {
        assert_eq!(instances.len(), self.placed.len(), "the same number of instances");
        let placed = Instance::place(instances, &self.parts)?;
        let boxes: Vec<Aabb> = placed.iter().map(|placed| placed.aabb).collect();
        self.top.refit(&boxes);
        self.placed = placed;
        Ok(())
    }

    /// The parts.
    pub fn parts(&self) -> &[Arc<WideBvh>] {
        &self.parts
    }

    /// The number of instances.
    pub fn instances(&self) -> usize {
        self.placed.len()
    }

    fn part_of(&self, instance: u32) -> &WideBvh {
        &self.parts[self.placed[instance as usize].part as usize]
    }

    fn slabs(&self, ray: &Ray) -> Slabs {
        Slabs::new(ray, &self.top.root_aabb().unwrap_or(Aabb::EMPTY))
    }

    /// Returns the nearest triangle of any instance that `ray` hits in its range. Among triangles
    /// at the same distance, the lowest instance comes first, then the lowest id.
    pub fn nearest_hit(&self, ray: &Ray) -> Option<InstanceHit> {
        self.nearest(ray, |part, _, local_ray| part.nearest_hit(local_ray))
    }

    /// Writes the [nearest hit](Self::nearest_hit) of every ray to `hits`; [`InstanceHit::MISS`]
    /// for a ray that meets nothing. Traces the rays one after the other.
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn nearest_hits(&self, rays: &[Ray], hits: &mut [InstanceHit]) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.nearest_hit(ray).unwrap_or(InstanceHit::MISS);
        }
    }

    /// Writes to `hits` whether each ray hits [any instance](Self::any_hit). Traces the rays one
    /// after the other.
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn any_hits(&self, rays: &[Ray], hits: &mut [bool]) {
        assert_eq!(rays.len(), hits.len(), "an answer for every ray");
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = self.any_hit(ray);
        }
    }

    /// Returns the nearest hit that `accept` accepts, for example where a texture is opaque.
    /// `accept` sees hits in no order, and only as many as the answer needs.
    pub fn nearest_hit_where(
        &self,
        ray: &Ray,
        mut accept: impl FnMut(InstanceHit) -> bool,
    ) -> Option<InstanceHit> {
        self.nearest(ray, |part, instance, local_ray| {
            part.nearest_hit_where(local_ray, |hit| accept(InstanceHit::new(instance, hit)))
        })
    }

    /// Returns the nearest hit, where `find` returns the nearest one of an instance's part.
    #[inline(always)]
    fn nearest(
        &self,
        ray: &Ray,
        mut find: impl FnMut(&WideBvh, u32, &Ray) -> Option<Hit>,
    ) -> Option<InstanceHit> {
        let slabs = self.slabs(ray);
        let mut nearest: Option<(Hit, u32)> = None;
        let test = |instance: u32, t_max: f32| {
            let placed = &self.placed[instance as usize];
            let local_ray = placed.local(ray, t_max)?;
            let found = find(self.part_of(instance), instance, &local_ray)?;
            // A hit in front of the instance's box would depend on the tree: a tree that visits the
            // box later would skip it.
            let t = found.t.max(slabs.entry(&placed.aabb));
            let hit = Hit { t, object: instance };
            if t <= t_max && nearest.is_none_or(|(nearest, _)| hit.precedes(&nearest)) {
                nearest = Some((hit, found.object));
            }
            Some(t)
        };
        nearest_hit_by(&self.top, ray, test, &mut ());
        nearest.map(|(Hit { t, object: instance }, triangle)| InstanceHit { t, instance, triangle })
    }

    /// Returns whether `ray` hits a triangle of any instance in its range.
    pub fn any_hit(&self, ray: &Ray) -> bool {
        self.any(ray, |part, _, local_ray| part.any_hit(local_ray))
    }

    /// Returns whether `ray` has a hit that `accept` accepts, for example for shadows of cut-out
    /// leaves.
    pub fn any_hit_where(&self, ray: &Ray, mut accept: impl FnMut(InstanceHit) -> bool) -> bool {
        self.any(ray, |part, instance, local_ray| {
            part.any_hit_where(local_ray, |hit| accept(InstanceHit::new(instance, hit)))
        })
    }

    /// Returns whether `ray` hits any instance, where `hits` returns whether it hits an instance's
    /// part.
    #[inline(always)]
    fn any(&self, ray: &Ray, mut hits: impl FnMut(&WideBvh, u32, &Ray) -> bool) -> bool {
        let slabs = self.slabs(ray);
        let test = |instance: u32| {
            let placed = &self.placed[instance as usize];
            // The nearest hit is never in front of the instance's box. If the ray ends before the
            // box, no hit counts here either.
            if slabs.entry(&placed.aabb) > ray.t_max() {
                return false;
            }
            placed
                .local(ray, ray.t_max())
                .is_some_and(|local_ray| hits(self.part_of(instance), instance, &local_ray))
        };
        any_hit_by(&self.top, ray, test, &mut ())
    }
}
