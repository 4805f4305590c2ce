//! Frames: the directions along which the boxes of a tree lie.
//!
//! A building that stands obliquely in its file fills little of boxes along the file's axes. Boxes
//! along its own walls are the boxes of the same building as its author drew it:
//!
//! ```text
//!   boxes along the file's axes      boxes in a frame
//!   ┌───────────────┐                      ╱╲
//!   │      ╱╲       │                     ╱  ╲
//!   │    ╱    ╲     │                   ╱      ╲
//!   │  ╱        ╲   │                  ╱        ╱
//!   │  ╲        ╱   │                  ╲      ╱
//!   │    ╲    ╱     │                    ╲  ╱
//!   └───────────────┘                     ╲╱
//! ```
//!
//! Triangles, rays and answers stay in the coordinates of the file, bit by bit. Boxes are a filter
//! that may only be too large, and so may be tested in any coordinates q = R (p − c). In real
//! arithmetic, a point of an object is in the object's box, and a ray o + t d is at
//! R (o − c) + t R d for the same t. It does not matter whether R is a rotation; a nearly orthogonal
//! matrix keeps distances, and so areas and costs mean what they mean in the file.
//!
//! # The bounds
//!
//! With ε = 2⁻⁵³ and M the sum of |Rᵢⱼ| |pⱼ − cⱼ| over j, a coordinate of R (p − c) that is computed
//! in f64 is off by less than 4.1εM from its difference, product and two sums, and one of R d by less
//! than 3.1ε times the same sum for d. The rows of R have length 1 up to 2⁻⁴¹, and so M is at most
//! the length of p − c. What underflows in f64 is far below every slack.
//!
//! *Near.* Let S be the largest coordinate of the root's box in the frame, and let the ray begin in
//! its [near region](crate::slabs::near_region), less than 514 S from 0 along each axis. Then M is
//! below 2¹⁰ S, and the origin O is off by less than 2⁻⁴⁰ S. Up to a point in the root's box, t |d|
//! is at most √3 · 515 S: the direction's error moves that point by less than 2⁻⁴⁰ S. Let D be the
//! computed component of the direction, and x the coordinate of a point of the scene at t. Both
//! errors together, `slack` = 2⁻³⁸ S, give
//!
//! ```text
//!   x − slack ≤ O + t D ≤ x + slack
//! ```
//!
//! [`Slabs`](crate::Slabs) move the origin by a slack, that of far rays, up for lower faces and down
//! for upper faces, and round it there to the same side. The rest of their proof holds for O and D.
//!
//! Vector kernels round the origin to the nearest number o, off by u|O| with u = 2⁻²⁴, or by half of
//! the least number, which the rounding of planes outwards covers. They have one origin for both
//! faces. Since |O| ≤ |x| + |x − O|, the planes of the layout are moved
//! outwards by u|x| + slack, with the largest |x| in the box. What is left is at most ut|D|:
//!
//! ```text
//!   lower − o ≤ t D (1 + u),      upper − o ≥ t D (1 − u)
//! ```
//!
//! A difference, the product of the reciprocal with 1 ∓ 4u, and the final product are rounded by
//! at most u / (1 + u) of themselves, the last one monotonically. So the reciprocal i has to be so
//! close to 1 / D that
//!
//! ```text
//!   i D ≤ (1 + u) / ((1 + 2u)² (1 − 4u))  and  i D ≥ (1 + u)² / ((1 + 4u) (1 − u))
//! ```
//!
//! or, without third powers, 1 − u + 8u² ≤ i D ≤ 1 + u + 12u². Rounding to the nearest number keeps
//! a factor between 1 − u + u² and 1 + u − u². The number that is rounded is therefore 10u² greater
//! than 1 / D, where 7u² to 13u² would do; six operations in f64 add less than u² / 4.
//!
//! *Far.* Other rays are tested in f64. By 4ε for the origin and 9ε for the direction they are off
//! by less than 2⁻⁴⁸ (M + S) with the largest M, by which their origins are moved as above.

use crate::aabb::{round_down, round_up};
use crate::each::Each;
use crate::{Aabb, Ray};
use glam::{DMat3, DVec3, Vec3};

/// The frame of a tree's boxes: a rotation and a centre. The coordinates of a point p in the frame
/// are rotation · (p − centre).
///
/// A tree with a frame is traced by rays in the file's coordinates, and gives the answers of every
/// other tree. Frames are for triangles only: [`boxes`](Self::boxes) returns the boxes to build a
/// tree over.
///
/// Boxes are resolved to 2⁻²⁴ of their distance from the centre, and to 2⁻³⁸ of the largest such
/// distance. Far from a small detail the centre costs time, never answers.
///
/// ```
/// use bvh_core::{Frame, Triangle, glam::{DMat3, DVec3}};
/// let frame = Frame::new(DMat3::from_rotation_z(-0.5), DVec3::ZERO)?;
/// // A square that is turned by half a radian, as two triangles.
/// let (sin, cos) = 0.5f32.sin_cos();
/// let [a, b, c, d] = [[0.0; 3], [cos, sin, 0.0], [cos - sin, sin + cos, 0.0], [-sin, cos, 0.0]];
/// let square = [[a, b, c], [a, c, d]].map(Triangle::from);
/// assert!(square[0].aabb().half_area() > 1.18);
/// assert!(frame.boxes(&square)[0].half_area() < 1.001);
/// # Ok::<(), bvh_core::InvalidFrame>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The directions of the frame's axes in the file's coordinates: the rows of the rotation.
    pub(crate) axes: [DVec3; 3],
    pub(crate) centre: DVec3,
}

/// The reason why numbers are rejected as a frame.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum InvalidFrame {
    /// The matrix is not a rotation: its rows must have length 1 and be perpendicular to each other
    /// up to 2⁻⁴⁰, and must not mirror.
    #[error("the frame's matrix {0} is no rotation")]
    Rotation(DMat3),
    /// A coordinate of the centre is not finite, or larger than any coordinate of a scene.
    #[error("the frame's centre {0} must be finite and within the range of f32")]
    Centre(DVec3),
}

impl Frame {
    /// The axes and the centre of the file.
    pub(crate) const FILE: Self =
        Self { axes: [DVec3::X, DVec3::Y, DVec3::Z], centre: DVec3::ZERO };
    /// The number of bytes in a file.
    pub(crate) const BYTES: usize = 96;

    /// Makes the frame in which the coordinates of p are `rotation · (p − centre)`.
    pub fn new(rotation: DMat3, centre: DVec3) -> Result<Self, InvalidFrame> {
        let rows = rotation.transpose();
        let axes = [rows.x_axis, rows.y_axis, rows.z_axis];
        let product = rotation * rows;
        let error = (product - DMat3::IDENTITY).to_cols_array().map(f64::abs);
        // NaN is in no range.
        let is_orthogonal = error.iter().all(|&error| error <= 1.0 / (1u64 << 40) as f64);
        if !(is_orthogonal && rotation.determinant() > 0.0) {
            return Err(InvalidFrame::Rotation(rotation));
        }
        let range = f64::from(f32::MIN)..=f64::from(f32::MAX);
        if !centre.to_array().iter().all(|x| range.contains(x)) {
            return Err(InvalidFrame::Centre(centre));
        }
        Ok(Self { axes, centre })
    }

    /// The rotation from the file's axes to the frame's.
    pub fn rotation(&self) -> DMat3 {
        let [x, y, z] = self.axes;
        DMat3::from_cols(x, y, z).transpose()
    }

    /// The point of the file that has the coordinates 0, 0, 0 in the frame.
    pub fn centre(&self) -> DVec3 {
        self.centre
    }

    /// Returns the rotation, row by row, and the centre.
    pub(crate) fn to_bytes(self) -> Vec<u8> {
        let [x, y, z] = self.axes;
        let rows = [x, y, z, self.centre].map(|row| row.to_array());
        bytemuck::bytes_of(&rows).to_vec()
    }

    pub(crate) fn of_bytes(bytes: &[u8; Self::BYTES]) -> Result<Self, InvalidFrame> {
        let [x, y, z, centre] = bytemuck::cast::<_, [[f64; 3]; 4]>(*bytes).map(DVec3::from);
        Self::new(DMat3::from_cols(x, y, z).transpose(), centre)
    }

    /// Returns the coordinates of a point in the frame, rounded.
    #[inline]
    pub fn point(&self, point: DVec3) -> DVec3 {
        self.direction(point - self.centre)
    }

    /// Returns the components of a direction in the frame, rounded.
    #[inline]
    pub fn direction(&self, direction: DVec3) -> DVec3 {
        DVec3::from(self.axes.each(|axis| axis.dot(direction)))
    }

    /// Returns the sums of |Rᵢⱼ| |pⱼ − cⱼ|, to which errors are relative.
    #[inline]
    fn sums(&self, point: DVec3) -> DVec3 {
        let size = (point - self.centre).abs();
        DVec3::from(self.axes.each(|axis| axis.abs().dot(size)))
    }

    /// Returns the smallest box in the frame that certainly contains a triangle of these corners: it is
    /// rounded outwards.
    pub(crate) fn aabb_of(&self, corners: [DVec3; 3]) -> Aabb {
        /// 8ε, twice the bound of the error.
        const ERROR: f64 = 4.0 * f64::EPSILON;
        let mut min = DVec3::INFINITY;
        let mut max = DVec3::NEG_INFINITY;
        for corner in corners {
            let point = self.point(corner);
            let error = ERROR * self.sums(corner);
            // A NaN of any corner must not be lost.
            if point.is_nan() {
                return Aabb { min: Vec3::NAN, max: Vec3::NAN };
            }
            min = min.min(point - error);
            max = max.max(point + error);
        }
        Aabb { min: round_down(min), max: round_up(max) }
    }

    /// By how much the number is greater that is rounded to a reciprocal: 10u².
    pub(crate) const ABOVE: f64 = 1.0 + 10.0 / (1u64 << 48) as f64;

    /// Returns the ray for boxes in the frame that it begins near to.
    #[inline(always)]
    pub(crate) fn ray(&self, ray: &Ray) -> Ray {
        let ends = ray.ends().each(Vec3::as_dvec3);
        self.ray_of(ends, [ray.t_min(), ray.t_max()])
    }

    /// Returns the same for an origin and a direction in f64.
    #[inline(always)]
    pub(crate) fn ray_of(&self, [origin, direction]: [DVec3; 2], [t_min, t_max]: [f32; 2]) -> Ray {
        let origin = self.point(origin).as_vec3();
        let direction = self.direction(direction);
        let inverse = (Self::ABOVE / direction).as_vec3();
        Ray::with_inverse(origin, direction.as_vec3(), inverse, t_min, t_max)
    }

    /// Returns by how much rays that begin near a scene are off in the frame, apart from the
    /// rounding to f32. `bounds` is the root's box in the frame.
    #[inline(always)]
    pub(crate) fn slack(bounds: &Aabb) -> f64 {
        f64::from(size(bounds)) / (1u64 << 38) as f64
    }

    /// Returns by how much a ray of this origin is off in the frame in f64.
    pub(crate) fn far_slack(&self, origin: DVec3, bounds: &Aabb) -> f64 {
        let farthest = self.sums(origin).max_element() + f64::from(size(bounds));
        farthest / (1u64 << 48) as f64
    }

    /// Returns a box of a tree as the layout has it, for rays whose origins are rounded to f32.
    pub(crate) fn padded(aabb: &Aabb, slack: f64) -> Aabb {
        const U: f64 = (f32::EPSILON / 2.0) as f64;
        let pad = aabb.min.abs().max(aabb.max.abs()).as_dvec3() * U + slack;
        // What no scene reaches needs no pad.
        Aabb {
            min: round_down(aabb.min.as_dvec3() - pad).max(Vec3::MIN),
            max: round_up(aabb.max.as_dvec3() + pad).min(Vec3::MAX),
        }
    }
}

/// Returns the largest coordinate of a box.
#[inline(always)]
pub(crate) fn size(aabb: &Aabb) -> f32 {
    aabb.min.abs().max(aabb.max.abs()).max_element()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Corners, Triangle};
    use glam::DQuat;
    use num_rational::BigRational;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_box_in_a_frame_contains_the_corners_in_real_arithmetic_and_little_else(
            turn in prop::array::uniform4(-1.0f64..1.0),
            centre in prop::array::uniform3(-1.0f64..1.0),
            corners in prop::array::uniform9(-1.0f32..1.0),
            exponents in prop::array::uniform2(-100i32..100),
        ) {
            let [size, far] = exponents.map(|exponent| libm::ldexp(1.0, exponent));
            let rotation = DMat3::from_quat(DQuat::from_array(turn).normalize());
            let frame = Frame::new(rotation, DVec3::from(centre) * far).unwrap();
            let triangle = Triangle::from(corners.map(|x| x * size as f32));
            let aabb = frame.aabb_of(triangle.corners());
            let exactly = |x: f64| BigRational::from_float(x).unwrap();
            for axis in 0..3 {
                let along = frame.axes[axis];
                let coordinates = triangle.0.map(|corner| -> BigRational {
                    let term = |i: usize| {
                        exactly(along[i]) * (exactly(corner[i].into()) - exactly(frame.centre[i]))
                    };
                    (0..3).map(term).sum()
                });
                let [min, max] = [aabb.min[axis], aabb.max[axis]].map(|x| exactly(x.into()));
                let least = coordinates.iter().min().unwrap();
                let most = coordinates.iter().max().unwrap();
                prop_assert!(&min <= least && most <= &max);
                // Two steps of f32, of which the error in f64 may be one.
                let step = (size + far) * f64::from(f32::EPSILON) * 4.0;
                prop_assert!(max - min <= most - least + exactly(step));
            }
        }
    }

    #[test]
    fn only_rotations_and_finite_centres_make_a_frame() {
        let turn = DMat3::from_rotation_y(0.3);
        for rotation in [
            DMat3::ZERO,
            -turn,
            turn * (1.0 + 1e-9),
            DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::Y),
            DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::NAN),
            DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::INFINITY),
        ] {
            let rejected = Frame::new(rotation, DVec3::ZERO);
            assert!(matches!(rejected, Err(InvalidFrame::Rotation(_))), "{rotation}");
        }
        for x in [f64::NAN, f64::INFINITY, 1e39] {
            let rejected = Frame::new(turn, DVec3::new(0.0, 0.0, x));
            assert!(matches!(rejected, Err(InvalidFrame::Centre(_))), "{x}");
        }
        let frame = Frame::new(turn, DVec3::ONE).unwrap();
        assert_eq!((frame.rotation(), frame.centre()), (turn, DVec3::ONE));
        assert_eq!(frame.point(DVec3::ONE), DVec3::ZERO);
    }
}
