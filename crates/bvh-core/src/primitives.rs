//! The geometry of a scene's objects.

use crate::{Aabb, DTriangle, Frame, InFrame, PreparedRay, Ray, Sphere, Triangle};

/// An object of any kind that has a box and that can be tested against rays.
pub trait Primitive {
    /// A ray that is prepared once for tests against many objects.
    type Prepared;

    /// Returns a box around the object.
    fn aabb(&self) -> Aabb;

    /// Prepares a ray.
    fn prepare(ray: &Ray) -> Self::Prepared;

    /// Returns the distance at which the ray hits the object if that distance is in the ray's range
    /// and at most `t_max`. The distance must be inside the interval of the object's box, which
    /// [`clip_to_box`](crate::clip_to_box) ensures. Otherwise the answer depends on the tree.
    fn intersect(&self, ray: &Self::Prepared, t_max: f32) -> Option<f32>;
}

impl Primitive for Triangle {
    type Prepared = PreparedRay;

    fn aabb(&self) -> Aabb {
        Triangle::aabb(self)
    }

    #[inline(always)]
    fn prepare(ray: &Ray) -> PreparedRay {
        PreparedRay::new(ray)
    }

    #[inline(always)]
    fn intersect(&self, prepared: &PreparedRay, t_max: f32) -> Option<f32> {
        Triangle::intersect(self, prepared, t_max)
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

/// Returns the box of every object, in the same order, as builders and searches need them.
pub fn boxes<P: Primitive>(objects: &[P]) -> Vec<Aabb> {
    objects.iter().map(P::aabb).collect()
}

/// The objects of a scene. All are of one kind, and the index of an object is its id.
#[derive(Clone, Debug, PartialEq)]
pub enum Primitives {
    /// Triangles in world units.
    Triangles(Vec<Triangle>),
    /// Triangles in f64, in world units.
    Doubles(Vec<DTriangle>),
    /// Spheres in world units.
    Spheres(Vec<Sphere>),
}

impl Primitives {
    /// Returns the number of objects.
    pub fn count(&self) -> usize {
        match self {
            Self::Triangles(triangles) => triangles.len(),
            Self::Doubles(triangles) => triangles.len(),
            Self::Spheres(spheres) => spheres.len(),
        }
    }

    /// Returns the box of every object along the file's axes, in the same order.
    pub fn boxes(&self) -> Vec<Aabb> {
        self.boxes_in(None)
    }

    /// Returns the box of every object, that of triangles in a frame if there is one.
    pub fn boxes_in(&self, frame: Option<&Frame>) -> Vec<Aabb> {
        match self {
            Self::Triangles(triangles) => InFrame { triangles, frame }.boxes(),
            Self::Doubles(triangles) => InFrame { triangles, frame }.boxes(),
            Self::Spheres(spheres) => boxes(spheres),
        }
    }

    /// Returns the objects with these indices.
    ///
    /// # Panics
    /// Panics if an index is out of range.
    #[must_use]
    pub fn select(&self, indices: &[usize]) -> Self {
        match self {
            Self::Triangles(triangles) => Self::Triangles(select(triangles, indices)),
            Self::Doubles(triangles) => Self::Doubles(select(triangles, indices)),
            Self::Spheres(spheres) => Self::Spheres(select(spheres, indices)),
        }
    }
}

fn select<T: Copy>(objects: &[T], indices: &[usize]) -> Vec<T> {
    indices.iter().map(|&index| objects[index]).collect()
}
