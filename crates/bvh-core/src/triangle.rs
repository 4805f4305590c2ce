//! Triangles, and a watertight ray test: no ray passes through the edge between two triangles.

use crate::each::Each;
use crate::exact::{Line, is_degenerate};
use crate::{Aabb, Frame, Ray};
use bytemuck::{Pod, Zeroable};
use glam::{Affine3A, DVec3, Vec3};

/// A triangle in world units. Rays can hit both sides.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Triangle(pub [Vec3; 3]);

impl From<[[f32; 3]; 3]> for Triangle {
    fn from(corners: [[f32; 3]; 3]) -> Self {
        Self(corners.each(Vec3::from))
    }
}

/// A ray prepared for tests against triangles.
#[derive(Clone, Copy, Debug)]
pub struct PreparedRay {
    ray: Ray,
    line: Line,
}

impl PreparedRay {
    /// Prepares a ray.
    #[inline(always)]
    pub fn new(ray: &Ray) -> Self {
        Self { ray: *ray, line: ray.line() }
    }
}

impl Triangle {
    /// Returns the smallest box around the three corners.
    #[inline]
    pub fn aabb(&self) -> Aabb {
        Aabb::around(self.0)
    }

    pub(crate) fn area(&self) -> f64 {
        let [a, b, c] = self.0.each(|corner| corner.as_dvec3());
        0.5 * (b - a).cross(c - a).length()
    }

    /// Returns the point of the triangle nearest to `point`, in f64. A degenerate triangle counts
    /// as a segment or a point.
    ///
    /// Source: Ericson 2005, *Real-Time Collision Detection*, section 5.1.5.
    pub fn closest_point(&self, point: impl Into<Vec3>) -> DVec3 {
        let point = point.into().as_dvec3();
        point + offset_from(point, self.0.each(Vec3::as_dvec3))
    }

    /// Returns the weights of the three corners at the point where the ray's line meets the
    /// triangle's plane. Their sum is 1. They interpolate values of the corners, such as normals,
    /// at a hit. Returns `None` for a ray in the plane.
    pub fn barycentrics(&self, ray: &Ray) -> Option<[f64; 3]> {
        ray.line().barycentrics(&self.0)
    }

    /// Returns the triangle moved by a transform, such as the transform of an
    /// [`Instance`](crate::Instance). Corners are computed in f64 and rounded once.
    #[must_use]
    pub fn transformed(&self, transform: &Affine3A) -> Self {
        let transform = transform.as_daffine3();
        Self(self.0.each(|corner| transform.transform_point3(corner.as_dvec3()).as_vec3()))
    }

    /// Returns the unit vector perpendicular to the triangle, on the side from which its corners
    /// run counterclockwise, computed in f64; `None` for a degenerate triangle.
    pub fn normal(&self) -> Option<Vec3> {
        normal_of(self.corners()).map(|normal| normal.as_vec3())
    }

    /// Returns whether the corners coincide or are collinear, in real arithmetic. Such a triangle is
    /// never hit. A triangle with a corner that is not finite is not degenerate.
    pub fn is_degenerate(&self) -> bool {
        is_degenerate(&self.0)
    }

    /// Returns the distance at which the ray hits the triangle, in real arithmetic, if that
    /// distance is in the ray's range and at most `t_max`. The distance is the real one, rounded
    /// once to the nearest `f32`, ties to even, and therefore within half a unit in the last place.
    ///
    /// The ray's line must cross the closed triangle, and the ray must not be parallel to its
    /// plane. A triangle behind the origin is not hit, however near. No distance is −0.
    ///
    /// The test is watertight: a ray through a common edge of two triangles hits at least one of
    /// them. No ray hits a degenerate triangle. f64 decides nearly all triangles. Next to an edge,
    /// or where a distance is nearly the middle between two `f32`, expansions decide, which takes
    /// microseconds.
    ///
    /// Source: Shewchuk 1997, 'Adaptive precision floating-point arithmetic and fast robust
    /// geometric predicates'.
    ///
    /// ```
    /// use bvh_core::{PreparedRay, Ray, Triangle};
    /// let triangle = Triangle::from([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]);
    /// let ray = Ray::half_line([0.5, 0.5, 0.0], [0.0, 0.0, 3.0]).unwrap();
    /// assert_eq!(triangle.intersect(&PreparedRay::new(&ray), 9.0), Some(1.0 / 3.0));
    /// ```
    pub fn intersect(&self, prepared: &PreparedRay, t_max: f32) -> Option<f32> {
        let t = prepared.line.crossing(&self.0, false)?;
        (prepared.ray.t_min() <= t && t <= t_max).then_some(t)
    }

    /// Returns the distance at which the ray crosses the triangle, in real arithmetic, if that
    /// distance is in the ray's range. The same as [`intersect`](Self::intersect), but of the
    /// triangles that meet in an edge or a corner, the ray crosses only those that its line would
    /// cross if it were moved by (ε, ε², ε³) with an infinitely small ε > 0. The line of a ray
    /// crosses a closed mesh an even number of times.
    ///
    /// Source: Edelsbrunner & Mücke 1990, 'Simulation of simplicity'.
    ///
    /// ```
    /// use bvh_core::{Ray, Triangle};
    /// let [a, b, c, d] = [[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [0.0, 1.0, 1.0]];
    /// let diagonal = Ray::half_line([0.5, 0.5, 0.0], [0.0, 0.0, 1.0]).unwrap();
    /// assert_eq!(Triangle::from([a, b, c]).crossing(&diagonal), Some(1.0));
    /// assert_eq!(Triangle::from([a, c, d]).crossing(&diagonal), None);
    /// ```
    pub fn crossing(&self, ray: &Ray) -> Option<f32> {
        let t = ray.line().crossing(&self.0, true)?;
        (ray.t_min() <= t && t <= ray.t_max()).then_some(t)
    }
}

impl Frame {
    /// Returns the smallest box in the frame that certainly contains the triangle, rounded outwards,
    /// of every triangle in the same order.
    pub fn boxes<T: Corners>(&self, triangles: &[T]) -> Vec<Aabb> {
        InFrame { triangles, frame: Some(self) }.boxes()
    }
}

/// A triangle in f32 or f64.
pub trait Corners: Copy + core::fmt::Debug + Sync {
    /// Returns the corners.
    fn corners(&self) -> [DVec3; 3];

    /// Returns a box around the triangle that lies in a frame, or in the file's axes without one.
    fn aabb_in(&self, frame: Option<&Frame>) -> Aabb;
}

impl Corners for Triangle {
    #[inline]
    fn corners(&self) -> [DVec3; 3] {
        self.0.each(Vec3::as_dvec3)
    }

    #[inline]
    fn aabb_in(&self, frame: Option<&Frame>) -> Aabb {
        frame.map_or_else(|| self.aabb(), |frame| frame.aabb_of(self.corners()))
    }
}

/// Triangles with their boxes and parts in a tree's frame, or in the file's axes if it has none.
#[derive(Clone, Copy, Debug)]
pub struct InFrame<'a, T = Triangle> {
    /// The triangles.
    pub triangles: &'a [T],
    /// The frame.
    pub frame: Option<&'a Frame>,
}

impl<T: Corners> InFrame<'_, T> {
    /// Returns the box of every triangle, in the same order.
    pub fn boxes(&self) -> Vec<Aabb> {
        self.triangles.iter().map(|triangle| triangle.aabb_in(self.frame)).collect()
    }
}

/// Returns the unit vector perpendicular to a triangle, `None` for a degenerate one.
pub(crate) fn normal_of([a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    // Scaled edges have lengths of about one, so their product neither overflows nor underflows.
    let scale = (b - a).abs().max((c - a).abs()).max_element();
    ((b - a) / scale).cross((c - a) / scale).try_normalize()
}

/// Returns the vector from `point` to the nearest point of the triangle of these corners. Triangles
/// with a common edge or corner compute the same bits for a nearest point on it. Rounded or not, the
/// point is in the box of the corners, so no box along the file's axes around the triangle is
/// farther.
pub(crate) fn offset_from(point: DVec3, corners: [DVec3; 3]) -> DVec3 {
    let [a, b, c] = corners.each(|corner| corner - point);
    let normal = (b - a).cross(c - a);
    let is_inside = |from: DVec3, to: DVec3| normal.dot(from.cross(to)) > 0.0;
    if is_inside(a, b) && is_inside(b, c) && is_inside(c, a) {
        let offset = normal * (normal.dot(a) / normal.length_squared());
        return into_box(offset, lesser(lesser(a, b), c), greater(greater(a, b), c));
    }
    let mut nearest = nearest_of_edge(a, b);
    for (from, to) in [(b, c), (c, a)] {
        let offset = nearest_of_edge(from, to);
        if offset.length_squared() < nearest.length_squared() {
            nearest = offset;
        }
    }
    nearest
}

/// Returns the point of a segment nearest to zero, the same bits for both directions of the
/// segment.
fn nearest_of_edge(from: DVec3, to: DVec3) -> DVec3 {
    let is_ordered = from.to_array() <= to.to_array();
    let (from, to) = if is_ordered { (from, to) } else { (to, from) };
    let edge = to - from;
    let along = -from.dot(edge);
    let length_squared = edge.length_squared();
    if along <= 0.0 {
        from
    } else if along >= length_squared {
        to
    } else {
        into_box(from + edge * (along / length_squared), lesser(from, to), greater(from, to))
    }
}

/// Returns the point of a box that is nearest to `point`. Differences of corners that are far
/// larger than a distance cancel, and rounding would move the point far out of the box.
fn into_box(point: DVec3, min: DVec3, max: DVec3) -> DVec3 {
    lesser(max, greater(min, point))
}

/// Returns the lesser component along each axis, `b`'s of two zeros, as the kernels do.
fn lesser(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::select(a.cmplt(b), a, b)
}

/// Returns the greater component along each axis, `b`'s of two zeros, as the kernels do.
fn greater(a: DVec3, b: DVec3) -> DVec3 {
    DVec3::select(a.cmpgt(b), a, b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DRay, DTriangle};

    #[test]
    fn the_weights_of_the_corners_are_those_of_the_point_that_is_hit() {
        let triangle = Triangle([
            Vec3::new(4.0, 0.0, 1.0),
            Vec3::new(0.0, 8.0, 2.0),
            Vec3::new(0.0, 0.0, -3.0),
        ]);
        for expected in [[0.25, 0.5, 0.25], [1.0, 0.0, 0.0], [0.0, 0.5, 0.5], [0.125, 0.125, 0.75]]
        {
            let [a, b, c] = triangle.0.map(Vec3::as_dvec3);
            let target = (a * expected[0] + b * expected[1] + c * expected[2]).as_vec3();
            for direction in [Vec3::Z, -Vec3::Z, Vec3::new(0.5, -0.25, 1.0)] {
                let ray = Ray::half_line(target - direction * 2.0, direction).unwrap();
                assert_eq!(triangle.barycentrics(&ray), Some(expected));
                let [origin, direction] = ray.ends().map(Vec3::as_dvec3);
                let ray = DRay::half_line(origin, direction).unwrap();
                assert_eq!(DTriangle(triangle.corners()).barycentrics(&ray), Some(expected));
            }
        }
        let in_plane = Ray::half_line(triangle.0[0], triangle.0[1] - triangle.0[0]).unwrap();
        assert_eq!(triangle.barycentrics(&in_plane), None);
    }

    #[test]
    fn the_normal_is_on_the_side_from_which_the_corners_run_counterclockwise_at_every_size() {
        for exponent in [-126, -60, 0, 60, 120] {
            let scale = libm::exp2f(exponent as f32);
            let triangle = Triangle([
                Vec3::ZERO,
                Vec3::new(2.0 * scale, 0.0, 0.0),
                Vec3::new(0.0, scale, 0.0),
            ]);
            assert_eq!(triangle.normal(), Some(Vec3::Z), "2^{exponent}");
            assert_eq!(DTriangle(triangle.corners()).normal(), Some(DVec3::Z), "2^{exponent}");
            let [a, b, c] = triangle.0;
            assert_eq!(Triangle([a, c, b]).normal(), Some(-Vec3::Z), "2^{exponent}");
        }
        assert_eq!(Triangle([Vec3::ONE; 3]).normal(), None);
        assert_eq!(Triangle([Vec3::ZERO, Vec3::ONE, 2.0 * Vec3::ONE]).normal(), None);
    }
}
