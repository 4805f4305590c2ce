//! Sphere scenes for ray tracing: the 75 spheres of the second source document, and larger scenes
//! with the same density.
//!
//! Centres follow Roberts' (2018) additive recurrence on the plastic-number generalization of the
//! golden ratio, which keeps any number of points evenly apart without a grid. Differs from the
//! document: the document gives no positions.

use super::stand_ins::jitter;
use bvh_core::Sphere;
use glam::DVec3;

/// Half the size of the box of the centres, which is centred at the origin and has about the ratio
/// 16:9 along the z axis.
const HALF_SIZE: DVec3 = DVec3::new(8.0, 4.5, 5.0);

/// Generates `count` spheres whose centres fill the box |x| <= 8, |y| <= 4.5, |z| <= 5 at every
/// count. Radii vary by a factor of 4 and shrink with the cube root of `count`, so that the total
/// volume stays the same; few spheres touch. Every call gives the same bytes on every machine.
/// O(count).
pub fn spheres(count: usize) -> Vec<Sphere> {
    // The steps are 1/g, 1/g², 1/g³ for the real root g of g⁴ = g + 1.
    let steps =
        DVec3::new(0.819_172_513_396_164_4, 0.671_043_606_703_789_2, 0.549_700_477_901_970_2);
    let volume = 8.0 * HALF_SIZE.x * HALF_SIZE.y * HALF_SIZE.z;
    let spacing = libm::cbrt(volume / count as f64);
    (0..count)
        .map(|i| {
            let unit = (steps * i as f64 + DVec3::splat(0.5)).map(|x| x - x.floor());
            // A small jitter hides the planes that the recurrence forms.
            let loose = DVec3::splat(0.12 * spacing);
            let shift = DVec3::new(jitter(12, i), jitter(13, i), jitter(14, i)) * loose;
            let center = (unit * 2.0 - DVec3::ONE) * (HALF_SIZE - loose) + shift;
            // The square of a uniform draw makes many small spheres and few large ones.
            let draw = 0.5 + 0.5 * jitter(11, i);
            let radius = spacing * (0.10 + 0.30 * draw * draw);
            Sphere { center: center.as_vec3(), radius: radius as f32 }
        })
        .collect()
}
