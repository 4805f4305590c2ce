//! Random rays, and the kinds of rays. They are the same on every machine.

use bvh_core::{Aabb, Ray};
use glam::DVec3;
use rand::RngExt;
use rand::rngs::ChaCha8Rng;

bvh_config::config! {
    /// A distribution of random rays over the root's box.
    #[derive(Copy, Eq)]
    pub enum Family {
        /// The paper's rays: the origin is uniform in the box, and the direction is uniform.
        Inside,
        /// Lines that meet the box, uniform in the measure that is proportional to surface area.
        Lines,
    }
}

/// Returns a random ray of a family; `None` if the box is too small or too large for a ray.
pub fn random_ray(family: Family, root: &Aabb, rng: &mut ChaCha8Rng) -> Option<Ray> {
    let low = root.min.as_dvec3();
    let size = root.extent();
    let inside = DVec3::from_array(rng.random());
    let (origin, direction) = match family {
        Family::Inside => (inside, on_sphere(rng)),
        Family::Lines => {
            // A uniform point on the surface and an inward direction with cosine density make a
            // line that is uniform among all lines through the box.
            let areas = [size.y * size.z, size.z * size.x, size.x * size.y];
            let pick = rng.random::<f64>() * areas.iter().sum::<f64>();
            let axis =
                if pick < areas[0] { 0 } else { 1 + usize::from(pick >= areas[0] + areas[1]) };
            let far = rng.random::<bool>();
            let mut origin = inside;
            origin[axis] = f64::from(u8::from(far));
            let mut normal = DVec3::ZERO;
            normal[axis] = if far { -1.0 } else { 1.0 };
            // A unit normal plus a uniform unit vector has cosine density (Lambert).
            (origin, on_sphere(rng) + normal)
        }
    };
    // Rounding to f32 may leave the box by one step.
    let origin = (low + origin * size).as_vec3().clamp(root.min, root.max);
    Ray::half_line(origin, direction.as_vec3()).ok()
}

/// Returns a uniform point on the unit sphere: the direction of a uniform point in the unit ball,
/// which needs no function that differs between machines.
pub fn on_sphere(rng: &mut ChaCha8Rng) -> DVec3 {
    loop {
        let unit = DVec3::from_array(rng.random());
        let point = unit * 2.0 - 1.0;
        let squared = point.length_squared();
        // Near the centre rounding would make some directions more likely than others.
        if squared <= 1.0 && squared > 1e-6 {
            return point / squared.sqrt();
        }
    }
}

bvh_config::config! {
    /// A kind of rays that a renderer traces.
    #[derive(Copy, Eq)]
    pub enum Kind {
        /// Rays with random origins and random directions; nearest hit.
        Incoherent,
        /// Rays from a camera; nearest hit.
        Primary,
        /// Rays from hits in random directions; nearest hit.
        Bounce,
        /// Rays from hits to a light; any hit.
        Shadow,
    }
}

impl Kind {
    /// Returns the kind's name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Incoherent => "incoherent",
            Self::Primary => "primary",
            Self::Bounce => "bounce",
            Self::Shadow => "shadow",
        }
    }
}

/// A place of a camera, in world units, or in fractions of a scene's box: 0 is the lower corner and
/// 1 the upper corner. The default, in fractions, sees a scene from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct Viewpoint {
    /// The camera's position.
    pub eye: [f64; 3],
    /// The point in the middle of the picture.
    pub target: [f64; 3],
}

impl Default for Viewpoint {
    fn default() -> Self {
        Self { eye: [1.9, 1.3, 2.2], target: [0.5; 3] }
    }
}

impl Viewpoint {
    /// Converts fractions of the root's box into points.
    #[must_use]
    pub fn in_box(self, root: &Aabb) -> Self {
        let [eye, target] = [self.eye, self.target].map(|place| in_box(root, place).to_array());
        Self { eye, target }
    }
}

/// Converts fractions of the root's box into a point.
pub fn in_box(root: &Aabb, fractions: [f64; 3]) -> DVec3 {
    root.min.as_dvec3() + DVec3::from(fractions) * root.extent()
}
