//! The objects of a scene, by their geometry.

use crate::{Aabb, Ray, Shear, Sphere, Triangle};
use alloc::vec::Vec;

/// An object of any kind that has a box and that rays can be tested against.
pub trait Primitive {
    /// A ray, prepared once for tests against many objects.
    type Prepared;

    /// A box around the object.
    fn aabb(&self) -> Aabb;

    /// Prepares a ray.
    fn prepare(ray: &Ray) -> Self::Prepared;

    /// The distance at which the ray meets the object, if that is in the ray's range and at most `t_max`. It must lie in the
    /// interval of the object's box, as [`clip_to_box`](crate::clip_to_box) makes it, for the answer not to depend on the tree.
    fn intersect(&self, ray: &Self::Prepared, t_max: f32) -> Option<f32>;
}

impl Primitive for Triangle {
    type Prepared = Shear;

    fn aabb(&self) -> Aabb {
        Triangle::aabb(self)
    }

    #[inline(always)]
    fn prepare(ray: &Ray) -> Shear {
        Shear::new(ray)
    }

    #[inline(always)]
    fn intersect(&self, shear: &Shear, t_max: f32) -> Option<f32> {
        Triangle::intersect(self, shear, t_max)
    }
}

impl Primitive for Sphere {
    type Prepared = Ray;

    fn aabb(&self) -> Aabb {
        Sphere::aabb(self)
    }

    #[inline(always)]
    fn prepare(ray: &Ray) -> Ray {
        *ray
    }

    #[inline(always)]
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<f32> {
        Sphere::intersect(self, ray, t_max)
    }
}

/// The boxes of objects, one each: what builders and searches see of them.
pub fn boxes<P: Primitive>(objects: &[P]) -> Vec<Aabb> {
    objects.iter().map(P::aabb).collect()
}

/// The objects of a scene: all of one kind, each named by its index.
#[derive(Clone, Debug, PartialEq)]
pub enum Primitives {
    /// Triangles in world units.
    Triangles(Vec<Triangle>),
    /// Spheres in world units.
    Spheres(Vec<Sphere>),
}

impl Primitives {
    /// The objects' boxes, one each.
    pub fn boxes(&self) -> Vec<Aabb> {
        match self {
            Self::Triangles(triangles) => boxes(triangles),
            Self::Spheres(spheres) => boxes(spheres),
        }
    }

    /// The objects with these indices.
    ///
    /// # Panics
    /// If there is no object of such an index.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        match self {
            Self::Triangles(all) => Self::Triangles(indices.iter().map(|&index| all[index]).collect()),
            Self::Spheres(all) => Self::Spheres(indices.iter().map(|&index| all[index]).collect()),
        }
    }
}
