//! Axis-aligned boxes. Every builder, search and cost sees an object only as its box.

use crate::each::Each;
use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3};

/// An axis-aligned bounding box in world units. Its extents may be zero. [`Aabb::EMPTY`] is the box
/// around nothing.
///
/// ```
/// # use bvh_core::Aabb;
/// let all = Aabb::from([[0.0; 3], [1.0; 3]]).union(&Aabb::from([[2.0; 3], [3.0; 3]]));
/// assert_eq!(all, Aabb::from([[0.0; 3], [3.0; 3]]));
/// // Half of the surface, as everywhere.
/// assert_eq!(all.half_area(), 27.0);
/// assert!(all.contains(&Aabb::EMPTY));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Aabb {
    /// Lower corner.
    pub min: Vec3,
    /// Upper corner: at least `min` in every component unless the box is empty.
    pub max: Vec3,
}

impl Aabb {
    /// The neutral element of [`union`](Aabb::union): contains nothing, area 0 by definition.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// Returns the smallest box around `points`, or [`Aabb::EMPTY`] if there are none. A NaN
    /// coordinate of any point makes the box NaN along that axis, and [`check`](Self::check)
    /// rejects such a box.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, Self::extended_to)
    }

    /// Returns the smallest box around `boxes`, or [`Aabb::EMPTY`] if there are none.
    pub fn union_of<'a>(boxes: impl IntoIterator<Item = &'a Self>) -> Self {
        boxes.into_iter().fold(Self::EMPTY, |union, aabb| union.union(aabb))
    }

    /// Returns the smallest box around this box and `point`, with NaN along every axis where one of
    /// them is NaN.
    fn extended_to(self, point: Vec3) -> Self {
        // The minimum and maximum of vectors may return either operand if one of them is NaN.
        let nan = self.min.is_nan_mask() | point.is_nan_mask();
        Self {
            min: Vec3::select(nan, Vec3::NAN, self.min.min(point)),
            max: Vec3::select(nan, Vec3::NAN, self.max.max(point)),
        }
    }

    /// Returns the smallest box around both boxes.
    #[inline]
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// Returns the intersection of both boxes, or [`Aabb::EMPTY`] if they are disjoint.
    #[inline]
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        let common = Self { min: self.min.max(other.min), max: self.max.min(other.max) };
        if common.min.cmpgt(common.max).any() { Self::EMPTY } else { common }
    }

    /// Cuts the box at a plane and returns the lower and the upper part. `axis` is 0 to 2, and
    /// `plane` is a coordinate along that axis inside the box.
    #[inline]
    #[must_use]
    pub fn halves(&self, axis: usize, plane: f32) -> [Self; 2] {
        let mut low = *self;
        let mut high = *self;
        low.max[axis] = plane;
        high.min[axis] = plane;
        [low, high]
    }

    /// Returns half of the surface area, xy + yz + zx, in world units squared; 0 for an empty box.
    ///
    /// Coordinates are promoted to f64 *before* they are subtracted. Finite f32 coordinates
    /// therefore always give a finite area, and scaling the box by a power of two scales the area
    /// exactly. The area is monotone, rounding included: a box never has a larger area than a box
    /// that contains it.
    #[inline]
    pub fn half_area(&self) -> f64 {
        let size = self.extent();
        let is_empty = size.cmplt(DVec3::ZERO).any();
        if is_empty { 0.0 } else { size.x * size.y + size.y * size.z + size.z * size.x }
    }

    /// Returns the side lengths in world units; negative infinity for an empty box.
    #[inline]
    pub fn extent(&self) -> DVec3 {
        self.max.as_dvec3() - self.min.as_dvec3()
    }

    /// Returns *twice* the centre of the box, the sort key of builders. Unlike the centre it is
    /// exact for coordinates of similar magnitude and never out of range. Zeros are positive,
    /// because −0 and +0 must be the same key.
    #[inline]
    pub fn doubled_centroid(&self) -> DVec3 {
        self.min.as_dvec3() + self.max.as_dvec3() + DVec3::ZERO
    }

    /// Returns whether `other` is inside this box. Equal borders count as inside, and there is no
    /// tolerance. Every box contains the empty box.
    #[inline]
    pub fn contains(&self, other: &Self) -> bool {
        (self.min.cmple(other.min) & other.max.cmple(self.max)).all()
    }

    /// Returns the axis (0, 1 or 2) of the largest extent; the lowest such axis on ties.
    pub fn longest_axis(&self) -> usize {
        let extent = self.extent();
        let mut longest = 0;
        for axis in 1..3 {
            if extent[axis] > extent[longest] {
                longest = axis;
            }
        }
        longest
    }

    /// Rejects a box that no object may have: coordinates must be finite, and no component of `min`
    /// may exceed the same component of `max`.
    pub fn check(&self) -> Result<(), InvalidBoxReason> {
        if !(self.min.is_finite() && self.max.is_finite()) {
            Err(InvalidBoxReason::NotFinite)
        } else if self.min.cmpgt(self.max).any() {
            Err(InvalidBoxReason::Inverted)
        } else {
            Ok(())
        }
    }
}

impl From<([f32; 3], [f32; 3])> for Aabb {
    fn from((min, max): ([f32; 3], [f32; 3])) -> Self {
        Self { min: min.into(), max: max.into() }
    }
}

impl From<[[f32; 3]; 2]> for Aabb {
    /// Makes a box from its lower and its upper corner.
    fn from([min, max]: [[f32; 3]; 2]) -> Self {
        Self { min: min.into(), max: max.into() }
    }
}

/// The reason why a box is rejected as the box of an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidBoxReason {
    /// A coordinate is NaN or infinite.
    #[error("has a coordinate that is not finite")]
    NotFinite,
    /// A component of `min` exceeds the same component of `max`.
    #[error("has min above max")]
    Inverted,
}

/// The rejected box of an object.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the box of object {index}, {} to {}, {reason}; accepted: finite numbers, the lower corner first",
    .found.min, .found.max
)]
pub struct InvalidBox {
    /// Index of the object.
    pub index: usize,
    /// Its box.
    pub found: Aabb,
    /// The fault of its box.
    pub reason: InvalidBoxReason,
}

/// Rejects the first box that no object may have. O(n).
pub fn check_boxes(boxes: &[Aabb]) -> Result<(), InvalidBox> {
    for (index, &found) in boxes.iter().enumerate() {
        found.check().map_err(|reason| InvalidBox { index, found, reason })?;
    }
    Ok(())
}

#[inline]
pub(crate) fn round_down(point: DVec3) -> Vec3 {
    Vec3::from(point.to_array().each(|x| {
        let nearest = x as f32;
        if f64::from(nearest) > x { nearest.next_down() } else { nearest }
    }))
}

#[inline]
pub(crate) fn round_up(point: DVec3) -> Vec3 {
    -round_down(-point)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_empty_box_is_neutral_and_has_no_area() {
        let b = Aabb::from(([-1.0, 0.0, 2.0], [3.0, 0.5, 2.0]));
        assert_eq!(Aabb::EMPTY.union(&b), b);
        assert_eq!(Aabb::union_of([]), Aabb::EMPTY);
        let all = Aabb::from(([-1.0, 0.0, 1.0], [3.0, 4.0, 2.0]));
        assert_eq!(Aabb::union_of(&[b, Aabb::from(([0.0, 0.0, 1.0], [1.0, 4.0, 1.0]))]), all);
        assert_eq!(Aabb::EMPTY.half_area(), 0.0);
        assert!(b.contains(&Aabb::EMPTY));
    }

    #[test]
    fn a_box_contains_another_if_all_six_planes_do() {
        let unit = Aabb::from([[0.0; 3], [1.0; 3]]);
        assert!(unit.contains(&unit));
        for plane in 0..6 {
            // A box that is inverted may be inside, too.
            let outside = if plane < 3 { -0.5 } else { 1.5 };
            for shifted in [0.5, -0.5, 1.5, f32::NAN] {
                let mut corners = [[0.0f32; 3], [1.0; 3]];
                corners[plane / 3][plane % 3] = shifted;
                let is_inside = shifted != outside && !shifted.is_nan();
                assert_eq!(unit.contains(&corners.into()), is_inside, "{corners:?}");
            }
        }
    }

    #[test]
    fn a_nan_coordinate_of_any_point_makes_a_box_that_is_rejected() {
        for point in 0..3 {
            for axis in 0..3 {
                let mut points = [Vec3::ZERO, Vec3::ONE, Vec3::new(-1.0, 2.0, 0.5)];
                points[point][axis] = f32::NAN;
                let aabb = Aabb::around(points);
                assert_eq!(aabb.check(), Err(InvalidBoxReason::NotFinite), "{points:?}");
                for other_axis in (0..3).filter(|&other_axis| other_axis != axis) {
                    assert!(aabb.min[other_axis].is_finite());
                    assert!(aabb.max[other_axis].is_finite());
                }
            }
        }
    }

    #[test]
    fn a_rejected_box_is_reported_by_its_index_and_its_numbers() {
        let good = Aabb::from(([0.0; 3], [1.0; 3]));
        for (bad, reason) in [
            (Aabb::from(([0.0, f32::NAN, 0.0], [1.0; 3])), InvalidBoxReason::NotFinite),
            (Aabb::from(([0.0; 3], [1.0, f32::INFINITY, 1.0])), InvalidBoxReason::NotFinite),
            (Aabb::from(([0.0, 2.0, 0.0], [1.0; 3])), InvalidBoxReason::Inverted),
            (Aabb::EMPTY, InvalidBoxReason::NotFinite),
        ] {
            let error = check_boxes(&[good, bad, bad]).unwrap_err();
            assert_eq!((error.index, error.reason), (1, reason));
            assert!(error.to_string().contains(&format!("{} to {}", bad.min, bad.max)), "{error}");
        }
    }

    #[test]
    fn the_longest_axis_is_the_lowest_on_ties() {
        assert_eq!(Aabb::from(([0.0; 3], [1.0, 2.0, 2.0])).longest_axis(), 1);
        assert_eq!(Aabb::from(([0.0; 3], [1.0; 3])).longest_axis(), 0);
    }
}
