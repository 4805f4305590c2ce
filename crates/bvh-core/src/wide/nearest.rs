//! The nearest triangle of a point, found by any kernel.

use crate::query::Near;
use glam::{DVec3, Vec3};

/// The point of a mesh that is closest to a given point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// The triangle that contains it; of several the one of the lowest id.
    pub object: u32,
    /// The closest point.
    pub point: DVec3,
    /// Its distance from the given point, 0 or more.
    pub distance: f64,
}

/// The nearest triangle of a point so far.
pub(super) struct Nearest {
    pub(super) target: DVec3,
    pub(super) near: Near,
    offset: DVec3,
}

impl Nearest {
    #[inline(always)]
    pub(super) fn new(point: Vec3) -> Self {
        let near = Near { object: u32::MAX, distance_squared: f64::INFINITY };
        Self { target: point.as_dvec3(), near, offset: DVec3::ZERO }
    }

    /// Takes a triangle if it is nearer; `offset` is the vector to its closest point.
    #[inline(always)]
    pub(super) fn offer(&mut self, object: u32, offset: DVec3) {
        let near = Near { object, distance_squared: offset.length_squared() };
        if near < self.near {
            self.near = near;
            self.offset = offset;
        }
    }

    #[inline(always)]
    pub(super) fn closest(&self) -> Option<Closest> {
        // A layout over triangles without area has nodes and no triangles.
        let is_found = self.near.object != u32::MAX;
        is_found.then(|| Closest {
            object: self.near.object,
            point: self.target + self.offset,
            distance: libm::sqrt(self.near.distance_squared),
        })
    }
}
