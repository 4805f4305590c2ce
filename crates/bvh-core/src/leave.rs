//! Points next to a surface, from which rays leave it.

use crate::Triangle;
use glam::{DVec3, Vec3};

/// ε of f32, half a unit in the last place of 1.
const ROUNDING: f64 = 1.0 / (1 << 24) as f64;

impl Triangle {
    /// Returns an origin for rays that leave the triangle at `point`, on the side toward which
    /// `side` points. No ray from there whose direction points to this side, or along the plane,
    /// hits the triangle again. Returns the rounded point for a triangle without area. `point` is
    /// in the triangle up to rounding, sizes are between 2⁻¹⁰⁰ and 2¹⁰⁰, and the area is at least
    /// 2⁻³⁰ of the square of the longest side along an axis: the normal of a thinner sliver is too
    /// uncertain in f64, and a ray may hit it again.
    ///
    /// The origin is farther from the plane than 24 εR, ε = 2⁻²⁴, where R is the largest component
    /// of the corners relative to the origin; the normal of the thinnest slivers takes up to half
    /// of it. In real arithmetic, in which every kernel answers, any distance would do. This one
    /// also suffices for other tracers that round corners relative to the origin and the slope of
    /// the ray to f32: they hit a triangle whose corners are moved by less than 4 εR in each
    /// component. All its points are nearer to the plane than 7 εR.
    ///
    /// ```
    /// # use bvh_core::{PreparedRay, Ray, Triangle};
    /// let triangle = Triangle::from([[0.0, 0.0, 0.1], [1.0, 0.0, 0.3], [0.0, 1.0, 0.7]]);
    /// let ray = Ray::half_line([0.3, 0.2, 5.0], [0.0, 0.0, -1.0])?;
    /// let normal = triangle.normal().unwrap();
    /// let origin = triangle.leave(triangle.closest_point([0.3, 0.2, 0.28]), normal);
    /// let reflected = Ray::half_line(origin, normal)?;
    /// assert_eq!(triangle.intersect(&PreparedRay::new(&reflected), f32::MAX), None);
    /// # Ok::<(), bvh_core::InvalidRay>(())
    /// ```
    pub fn leave(&self, point: DVec3, side: Vec3) -> Vec3 {
        let [a, b, c] = self.0.map(Vec3::as_dvec3);
        let (scale, Some(normal)) = self.scale_and_normal() else { return point.as_vec3() };
        let toward = if normal.dot(side.as_dvec3()) < 0.0 { -normal } else { normal };
        // The first try covers the rounding of the origin, too.
        let mut distance = ROUNDING * (32.0 * scale + 2.0 * point.abs().max_element());
        let mut origin = point.as_vec3();
        // Never infinite for a finite point.
        while distance.is_finite() {
            origin = (point + toward * distance).as_vec3();
            let reach = [a, b, c]
                .map(|corner| (corner - origin.as_dvec3()).abs().max_element())
                .into_iter()
                .fold(0.0, f64::max);
            if toward.dot(origin.as_dvec3() - a) > 24.0 * ROUNDING * reach {
                break;
            }
            distance *= 2.0;
        }
        origin
    }
}
