//! Rays by component, the format of numpy, C and wavefront renderers.

use crate::{InvalidRay, Ray};
use glam::Vec3;

/// Rays as one slice per component, all of the same length.
#[derive(Clone, Copy, Debug)]
pub struct RayComponents<'a> {
    origin: [&'a [f32]; 3],
    direction: [&'a [f32]; 3],
    t_min: Distances<'a>,
    t_max: Distances<'a>,
}

/// One end of the ranges of many rays.
#[derive(Clone, Copy, Debug)]
pub enum Distances<'a> {
    /// One distance for all rays.
    All(f32),
    /// One distance per ray.
    Each(&'a [f32]),
}

impl Distances<'_> {
    /// Returns the distance of one ray.
    #[inline(always)]
    pub(crate) fn of(&self, number: usize) -> f32 {
        match self {
            Self::All(distance) => *distance,
            Self::Each(distances) => distances[number],
        }
    }

    fn is_for(&self, count: usize) -> bool {
        match self {
            Self::All(_) => true,
            Self::Each(distances) => distances.len() == count,
        }
    }
}

/// The reason why components are rejected.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("ray {number}: {reason}")]
pub struct InvalidRays {
    /// The number of the first rejected ray.
    pub number: usize,
    /// The fault of that ray.
    pub reason: InvalidRay,
}

impl<'a> RayComponents<'a> {
    /// Makes rays from components that satisfy the rules of [`Ray::new`]. O(n).
    ///
    /// # Panics
    /// Panics if the slices are not equally long.
    pub fn new(
        origin: [&'a [f32]; 3],
        direction: [&'a [f32]; 3],
        t_min: Distances<'a>,
        t_max: Distances<'a>,
    ) -> Result<Self, InvalidRays> {
        let rays = Self::assume_valid(origin, direction, t_min, t_max);
        for number in 0..rays.len() {
            let [origin, direction] = rays.vectors(number);
            Ray::new(origin, direction, rays.t_min.of(number), rays.t_max.of(number))
                .map_err(|reason| InvalidRays { number, reason })?;
        }
        Ok(rays)
    }

    /// Makes rays like [`new`](Self::new), without the checks, for callers who know that they would
    /// pass. Otherwise answers may be wrong, but nothing is undefined.
    ///
    /// # Panics
    /// Panics if the slices are not equally long.
    pub fn assume_valid(
        origin: [&'a [f32]; 3],
        direction: [&'a [f32]; 3],
        t_min: Distances<'a>,
        t_max: Distances<'a>,
    ) -> Self {
        let count = origin[0].len();
        let are_equal = origin.iter().chain(&direction).all(|component| component.len() == count);
        assert!(
            are_equal && t_min.is_for(count) && t_max.is_for(count),
            "slices of the same length"
        );
        Self { origin, direction, t_min, t_max }
    }

    /// Returns the number of rays.
    #[inline(always)]
    pub fn len(&self) -> usize {
        self.origin[0].len()
    }

    /// Returns whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.origin[0].is_empty()
    }

    /// Returns one of the rays.
    ///
    /// # Panics
    /// Panics if there is no such ray.
    #[inline(always)]
    pub fn ray(&self, number: usize) -> Ray {
        let [origin, direction] = self.vectors(number);
        Ray::assume_valid(origin, direction, self.t_min.of(number), self.t_max.of(number))
    }

    #[inline(always)]
    fn vectors(&self, number: usize) -> [Vec3; 2] {
        [self.origin, self.direction].map(|[x, y, z]| Vec3::new(x[number], y[number], z[number]))
    }

    /// Returns the slices of the origins and of the directions.
    #[inline(always)]
    pub(crate) fn slices(&self) -> [[&'a [f32]; 3]; 2] {
        [self.origin, self.direction]
    }

    /// Returns the ends of the ranges.
    #[inline(always)]
    pub(crate) fn ranges(&self) -> [Distances<'a>; 2] {
        [self.t_min, self.t_max]
    }
}
