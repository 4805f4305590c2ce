//! The surface at the end of a ray: its place, its orientation and its looks.

use bvh_core::{Aabb, Hit, Primitives};
use glam::DVec3;

/// A point of a surface, seen from one side. Colours are linear red, green and blue.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The point, in world units.
    pub point: DVec3,
    /// The unit normal on the side that is seen.
    pub normal: DVec3,
    /// The fraction of light that it scatters evenly.
    pub colour: DVec3,
    /// The fraction that it mirrors when seen from straight above, 0 to 1. It mirrors more at grazing angles, unless 0.
    pub mirror: f64,
    /// The fraction of its light that haze hides, 0 to 1.
    pub haze: f64,
}

/// The colour of triangles, plaster: meshes come without colours.
const PLASTER: DVec3 = DVec3::new(0.80, 0.73, 0.64);

/// The colours of spheres, in turn.
const COLOURS: [DVec3; 6] = [
    DVec3::new(0.78, 0.16, 0.10),
    DVec3::new(0.90, 0.52, 0.08),
    DVec3::new(0.03, 0.32, 0.36),
    DVec3::new(0.05, 0.11, 0.32),
    DVec3::new(0.84, 0.78, 0.66),
    DVec3::new(0.28, 0.46, 0.22),
];

impl Surface {
    /// The surface of the object that the ray from `origin` in `direction` has hit.
    pub fn of_object(objects: &Primitives, hit: &Hit, origin: DVec3, direction: DVec3) -> Self {
        let id = hit.object as usize;
        let met = origin + direction * f64::from(hit.t);
        let (point, normal, colour, mirror) = match objects {
            Primitives::Triangles(triangles) => {
                let [a, b, c] = triangles[id].0.map(|corner| corner.as_dvec3());
                // Edges are normalised first, so that tiny triangles have a normal.
                let ab = (b - a).normalize_or_zero();
                let ac = (c - a).normalize_or_zero();
                (met, ab.cross(ac).normalize_or(-direction), PLASTER, 0.0)
            }
            Primitives::Spheres(spheres) => {
                let center = spheres[id].center.as_dvec3();
                let normal = (met - center).normalize_or(-direction);
                let point = center + normal * f64::from(spheres[id].radius);
                (point, normal, COLOURS[id % COLOURS.len()], 0.05)
            }
        };
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        Self { point, normal, colour, mirror, haze: 0.0 }
    }
}

/// The plane that the scene stands on or hovers over. No structure contains it: one division finds it.
#[derive(Clone, Debug)]
pub struct Ground {
    up: DVec3,
    height: f64,
    center: DVec3,
    /// Half the diagonal of the scene's box.
    radius: f64,
    /// Whether it is checkered, as it is under spheres, which have no floor of their own to judge distances by.
    checkered: bool,
}

impl Ground {
    /// The ground under objects with these bounds; `None` under nothing and under a single point.
    pub fn below(objects: &Primitives, bounds: &Aabb, up: DVec3) -> Option<Self> {
        bounds.check().ok()?;
        let checkered = matches!(objects, Primitives::Spheres(_));
        let gap = if checkered { 0.05 } else { 1e-3 };
        let radius = bounds.extent().length() / 2.0;
        if radius == 0.0 {
            return None;
        }
        let height = bounds.min.as_dvec3().dot(up) - gap * radius;
        Some(Self { up, height, center: bounds.doubled_centroid() / 2.0, radius, checkered })
    }

    /// The distance at which the ray meets the ground; `None` unless it comes from above.
    pub fn meet(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let above = origin.dot(self.up) - self.height;
        let descent = -direction.dot(self.up);
        (above > 0.0 && descent > 0.0).then(|| above / descent)
    }

    /// The surface at this distance.
    pub fn surface(&self, origin: DVec3, direction: DVec3, distance: f64) -> Surface {
        let point = origin + direction * distance;
        let away = (point - self.center) / self.radius;
        let aside = away.cross(self.up);
        let squared = aside.length_squared();
        let haze = squared / (squared + 20.0);
        let tile = |x: f64| (x * 3.0).floor() as i64 & 1;
        let flat = [0, 1, 2].map(|axis| if self.up[axis] == 0.0 { tile(aside[axis]) } else { 0 });
        let dark = self.checkered && (flat[0] + flat[1] + flat[2]) & 1 == 1;
        let colour =
            if dark { DVec3::new(0.045, 0.05, 0.065) } else { DVec3::new(0.24, 0.25, 0.27) };
        Surface {
            point,
            normal: self.up,
            colour,
            mirror: if self.checkered { 0.1 } else { 0.0 },
            haze,
        }
    }
}
