//! The segments of a density, and the reasons to reject them.

use super::RayDensity;
use crate::{Frame, Ray};
use glam::Vec3;

/// The part of a ray between its start and its end, in world units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The start of the ray.
    pub from: [f32; 3],
    /// The end of the ray: its hit, or the point where it leaves the scene.
    pub to: [f32; 3],
}

impl Segment {
    /// Returns the part of a ray up to the distance `end`, in multiples of the direction's length.
    /// `None` if the end is beyond the range of f32, because a density accepts finite segments
    /// only.
    ///
    /// ```
    /// # use bvh_core::{Ray, Segment};
    /// let ray = Ray::half_line([1.0, 0.0, 0.0], [2.0, 0.0, 0.0])?;
    /// assert_eq!(Segment::of_ray(&ray, 3.0).map(|segment| segment.to), Some([7.0, 0.0, 0.0]));
    /// assert_eq!(Segment::of_ray(&ray, f32::MAX), None);
    /// # Ok::<(), bvh_core::InvalidRay>(())
    /// ```
    pub fn of_ray(ray: &Ray, end: f32) -> Option<Self> {
        let to = ray.at(end);
        to.is_finite().then(|| Self { from: ray.origin().to_array(), to: to.to_array() })
    }

    /// Returns the segment in the coordinates of a tree's [frame](crate::Bvh::frame), rounded, for
    /// the density of its boxes; the same without a frame.
    #[must_use]
    pub fn in_frame(self, frame: Option<&Frame>) -> Self {
        let Some(frame) = frame else { return self };
        let moved = |at: [f32; 3]| frame.point(Vec3::from(at).as_dvec3()).as_vec3().to_array();
        Self { from: moved(self.from), to: moved(self.to) }
    }
}

/// The reason why a density cannot be made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // The messages explain the fields.
pub enum DensityError {
    /// A segment has a coordinate that is NaN or infinite.
    #[error("segment {index} has a coordinate that is not finite")]
    NotFinite { index: usize },
    /// There are no segments, or too many to count them exactly.
    #[error("{segments} segments; accepted: 1 to {most}", most = RayDensity::MOST_SEGMENTS)]
    Count { segments: usize },
    /// No segment meets the scene.
    #[error("none of the segments meets the bounds of the scene")]
    NoneMeets,
    /// The weight of area is out of range.
    #[error("the weight of area is {0}; accepted: 0 to 1")]
    AreaWeight(f64),
    /// The bounds are empty or not finite.
    #[error("the bounds of the scene are empty or not finite")]
    Bounds,
}
