//! The objects of a scene, by their geometry.

use crate::{Aabb, Sphere, Triangle};
use alloc::vec::Vec;

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
            Self::Triangles(triangles) => triangles.iter().map(Triangle::aabb).collect(),
            Self::Spheres(spheres) => spheres.iter().map(Sphere::aabb).collect(),
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
