//! The distances of hits in exact arithmetic, the reference for the answers of tracers.

use crate::exact_area::whole;
use bvh_core::{Ray, Triangle};
use glam::Vec3;
use num_bigint::{BigInt, Sign};

/// A vector in units of 2^-149, of which every f32 is an integer multiple.
type Vector = [BigInt; 3];

/// Returns whether `t` is the distance at which the ray's line meets the plane of the triangle,
/// rounded once to the nearest f32, ties to even. False for a line in the plane, and for a plane
/// behind the origin.
pub fn is_rounded_distance(ray: &Ray, triangle: &Triangle, t: f32) -> bool {
    let [a, b, c] = triangle.0.map(vector);
    let origin = vector(ray.origin());
    let normal = cross(&difference(&b, &a), &difference(&c, &a));
    let height = dot(&normal, &difference(&a, &origin));
    let speed = dot(&normal, &vector(ray.direction()));
    let (height, speed) = match speed.sign() {
        Sign::Minus => (-height, -speed),
        Sign::Plus => (height, speed),
        Sign::NoSign => return false,
    };
    if !t.is_finite() || t.is_sign_negative() || height.sign() == Sign::Minus {
        return false;
    }
    // The sum of two neighbours in units of 2^-149 is their middle in units of 2^-150.
    let above = if t == f32::MAX { BigInt::from(1) << (128 + 149) } else { whole(t.next_up()) };
    let end = (whole(t) + above) * &speed;
    let begin = if t == 0.0 { BigInt::ZERO } else { (whole(t) + whole(t.next_down())) * speed };
    let distance = height << 150;
    let is_even = t.to_bits() & 1 == 0;
    // Zero has no neighbour below, so that its interval includes its begin.
    if is_even { begin <= distance && distance <= end } else { begin < distance && distance < end }
}

fn vector(p: Vec3) -> Vector {
    p.to_array().map(whole)
}

fn difference(p: &Vector, q: &Vector) -> Vector {
    [0, 1, 2].map(|i| &p[i] - &q[i])
}

fn cross(p: &Vector, q: &Vector) -> Vector {
    [(1, 2), (2, 0), (0, 1)].map(|(i, j)| &p[i] * &q[j] - &p[j] * &q[i])
}

fn dot(p: &Vector, q: &Vector) -> BigInt {
    &p[0] * &q[0] + &p[1] * &q[1] + &p[2] * &q[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the distances, of a few around the real one, that count as the rounded one.
    fn accepted(origin: f32, direction: f32, plane: f32) -> Vec<f32> {
        let triangle =
            Triangle([[0.0, 0.0, plane], [1.0, 0.0, plane], [0.0, 1.0, plane]].map(Vec3::from));
        let ray = Ray::half_line([0.25, 0.25, origin], [0.0, 0.0, direction]).unwrap();
        let real = ((f64::from(plane) - f64::from(origin)) / f64::from(direction)) as f32;
        [real.next_down(), real, real.next_up(), 0.0]
            .into_iter()
            .filter(|&t| is_rounded_distance(&ray, &triangle, t))
            .collect()
    }

    #[test]
    fn one_number_is_the_rounded_distance() {
        assert_eq!(accepted(0.0, 3.0, 1.0), [1.0 / 3.0]);
        assert_eq!(accepted(0.0, -3.0, -1.0), [1.0 / 3.0]);
        assert_eq!(accepted(0.1, 1.0, 0.3), [0.3f32 - 0.1]);
        assert_eq!(accepted(-1e30, 1e-10, 1.0), [0.0; 0]);
    }

    #[test]
    fn a_distance_in_the_middle_rounds_to_even() {
        // 2^24 + 1 and 2^24 + 3 are in the middle between two f32.
        assert_eq!(accepted(-1.0, 1.0, 16_777_216.0), [16_777_216.0]);
        assert_eq!(accepted(-3.0, 1.0, 16_777_216.0), [16_777_220.0]);
    }

    #[test]
    fn planes_behind_the_origin_and_around_the_ray_have_no_distance() {
        assert_eq!(accepted(2.0, 1.0, 1.0), [0.0; 0]);
        let triangle = Triangle([Vec3::ZERO, Vec3::X, Vec3::Y]);
        let ray = Ray::half_line([0.1, 0.1, 0.0], [1.0, 0.0, 0.0]).unwrap();
        assert!(!is_rounded_distance(&ray, &triangle, 0.0));
    }
}
