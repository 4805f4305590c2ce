//! Axis-aligned boxes, which stand for the objects in every builder, search and cost.

use bytemuck::{Pod, Zeroable};
use glam::{DVec3, Vec3, Vec4};

/// An axis-aligned bounding box in world units. Extents may be zero; [`Aabb::EMPTY`] is the box around nothing.
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

    /// The smallest box around `points`, [`Aabb::EMPTY`] if there are none. A NaN coordinate of any point makes the box
    /// NaN along that axis, so that [`check`](Self::check) refuses it.
    pub fn around(points: impl IntoIterator<Item = Vec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| {
            // Minima and maxima of vectors may take either operand if one is NaN.
            let nan = b.min.is_nan_mask() | p.is_nan_mask();
            let [min, max] = [b.min.min(p), b.max.max(p)].map(|corner| Vec3::select(nan, Vec3::NAN, corner));
            Self { min, max }
        })
    }

    /// The smallest box around both.
    #[inline]
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// What both have in common; [`Aabb::EMPTY`] if that is nothing.
    #[inline]
    #[must_use]
    pub fn intersection(&self, other: &Self) -> Self {
        let common = Self { min: self.min.max(other.min), max: self.max.min(other.max) };
        if common.min.cmpgt(common.max).any() { Self::EMPTY } else { common }
    }

    /// The parts on the lower and on the upper side of the plane at `at` along an axis, 0 to 2, which cuts the box.
    #[inline]
    #[must_use]
    pub fn halves(&self, axis: usize, at: f32) -> [Self; 2] {
        let [mut low, mut high] = [*self; 2];
        (low.max[axis], high.min[axis]) = (at, at);
        [low, high]
    }

    /// Half of the surface area, xy + yz + zx, in world units squared; 0 for an empty box.
    ///
    /// Coordinates are promoted to f64 *before* they are subtracted. So finite f32 coordinates always give a finite area,
    /// and scaling by a power of two scales the area exactly. Monotone: a box inside another never has the larger area,
    /// rounding included.
    #[inline]
    pub fn half_area(&self) -> f64 {
        let d = self.extent();
        if d.cmplt(DVec3::ZERO).any() { 0.0 } else { d.x * d.y + d.y * d.z + d.z * d.x }
    }

    /// Side lengths in world units; negative infinity for an empty box.
    #[inline]
    pub fn extent(&self) -> DVec3 {
        self.max.as_dvec3() - self.min.as_dvec3()
    }

    /// *Twice* the centre of the box, the sort key of builders: unlike the centre it is exact for coordinates of similar
    /// magnitude and never out of range. Zeros are positive, so that −0 and +0 are one key.
    #[inline]
    pub fn doubled_centroid(&self) -> DVec3 {
        self.min.as_dvec3() + self.max.as_dvec3() + DVec3::ZERO
    }

    /// Whether `other` lies inside this box or touches its border from inside, compared without tolerance. Every box
    /// contains the empty box.
    #[inline]
    pub fn contains(&self, other: &Self) -> bool {
        // Four lanes at a time: min x, y, z, max x, then min z, max x, y, z.
        let lanes = |aabb: &Self| {
            let [min_x, min_y, min_z, max_x, max_y, max_z] = bytemuck::cast(*aabb);
            (Vec4::new(min_x, min_y, min_z, max_x), Vec4::new(min_z, max_x, max_y, max_z))
        };
        let ((min, max), (other_min, other_max)) = (lanes(self), lanes(other));
        let (above, below) = (min.cmple(other_min).bitmask(), max.cmpge(other_max).bitmask());
        (above & 0b0111 == 0b0111) & (below & 0b1110 == 0b1110)
    }

    /// The axis (0, 1 or 2) of the largest extent; the lowest such axis on ties.
    pub fn longest_axis(&self) -> usize {
        let d = self.extent();
        let mut axis = 0;
        for candidate in 1..3 {
            if d[candidate] > d[axis] {
                axis = candidate;
            }
        }
        axis
    }

    /// Refuses a box that no object may have: its coordinates must be finite, and `min` not above `max`.
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
    /// From the lower and the upper corner.
    fn from([min, max]: [[f32; 3]; 2]) -> Self {
        Self { min: min.into(), max: max.into() }
    }
}

/// Why a box is not accepted as an object's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidBoxReason {
    /// A coordinate is NaN or infinite.
    #[error("has a coordinate that is not finite")]
    NotFinite,
    /// Some component of `min` exceeds that of `max`.
    #[error("has min above max")]
    Inverted,
}

/// An object's box that was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the box of object {index} {reason}")]
pub struct InvalidBox {
    /// Index of the object.
    pub index: usize,
    /// What is wrong with its box.
    pub reason: InvalidBoxReason,
}

/// Refuses the first box that no object may have. O(n).
pub fn check_boxes(boxes: &[Aabb]) -> Result<(), InvalidBox> {
    for (index, b) in boxes.iter().enumerate() {
        b.check().map_err(|reason| InvalidBox { index, reason })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_empty_box_is_neutral_and_has_no_area() {
        let b = Aabb::from(([-1.0, 0.0, 2.0], [3.0, 0.5, 2.0]));
        assert_eq!(Aabb::EMPTY.union(&b), b);
        assert_eq!(Aabb::EMPTY.half_area(), 0.0);
        assert!(b.contains(&Aabb::EMPTY));
    }

    #[test]
    fn a_box_contains_another_if_all_six_planes_do() {
        let unit = Aabb::from([[0.0; 3], [1.0; 3]]);
        assert!(unit.contains(&unit));
        for plane in 0..6 {
            for (inside, shifted) in [(true, 0.5), (false, -0.5), (false, 1.5), (false, f32::NAN)] {
                let mut corners = [[0.0f32; 3], [1.0; 3]];
                corners[plane / 3][plane % 3] = shifted;
                let other = Aabb::from(corners);
                let inside = inside || (plane < 3 && shifted == 1.5) || (plane >= 3 && shifted == -0.5);
                assert_eq!(unit.contains(&other), inside, "{other:?}");
            }
        }
    }

    #[test]
    fn a_nan_coordinate_of_any_point_makes_the_box_one_that_is_refused() {
        for (point, axis) in (0..3).flat_map(|point| [0, 1, 2].map(|axis| (point, axis))) {
            let mut points = [Vec3::ZERO, Vec3::ONE, Vec3::new(-1.0, 2.0, 0.5)];
            points[point][axis] = f32::NAN;
            let aabb = Aabb::around(points);
            assert_eq!(aabb.check(), Err(InvalidBoxReason::NotFinite), "{points:?}");
            let others = [0, 1, 2].into_iter().filter(|&other| other != axis);
            others.for_each(|other| assert!(aabb.min[other].is_finite() && aabb.max[other].is_finite()));
        }
    }

    #[test]
    fn the_area_of_the_largest_finite_box_is_finite() {
        let b = Aabb { min: Vec3::splat(f32::MIN), max: Vec3::splat(f32::MAX) };
        assert!(b.half_area().is_finite() && b.doubled_centroid().is_finite());
    }

    #[test]
    fn refused_boxes_are_named_by_index() {
        let good = Aabb::from(([0.0; 3], [1.0; 3]));
        for (bad, reason) in [
            (Aabb::from(([0.0, f32::NAN, 0.0], [1.0; 3])), InvalidBoxReason::NotFinite),
            (Aabb::from(([0.0; 3], [1.0, f32::INFINITY, 1.0])), InvalidBoxReason::NotFinite),
            (Aabb::from(([0.0, 2.0, 0.0], [1.0; 3])), InvalidBoxReason::Inverted),
            (Aabb::EMPTY, InvalidBoxReason::NotFinite),
        ] {
            assert_eq!(check_boxes(&[good, bad, bad]), Err(InvalidBox { index: 1, reason }));
        }
    }

    #[test]
    fn the_longest_axis_is_the_lowest_on_ties() {
        assert_eq!(Aabb::from(([0.0; 3], [1.0, 2.0, 2.0])).longest_axis(), 1);
        assert_eq!(Aabb::from(([0.0; 3], [1.0; 3])).longest_axis(), 0);
    }
}
