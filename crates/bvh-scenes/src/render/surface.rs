//! The surface at the end of a ray: its position, orientation and appearance.

use bvh_core::{Aabb, Corners, Hit, Primitives};
use glam::DVec3;

/// A point of a surface, seen from one side. Colours are linear red, green and blue.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The point, in world units.
    pub point: DVec3,
    /// The unit normal on the visible side.
    pub normal: DVec3,
    /// The fraction of light that the surface scatters evenly.
    pub colour: DVec3,
    /// The fraction of light that the surface mirrors at normal incidence, 0 to 1. A surface with 0
    /// mirrors nothing; all others mirror more at grazing angles.
    pub mirror: f64,
    /// The fraction of the surface's light that haze hides, 0 to 1.
    pub haze: f64,
}

/// The colour of all triangles, because loaders read no colours.
const PLASTER: DVec3 = DVec3::new(0.80, 0.73, 0.64);

const COLOURS: [DVec3; 6] = [
    DVec3::new(0.78, 0.16, 0.10),
    DVec3::new(0.90, 0.52, 0.08),
    DVec3::new(0.03, 0.32, 0.36),
    DVec3::new(0.05, 0.11, 0.32),
    DVec3::new(0.84, 0.78, 0.66),
    DVec3::new(0.28, 0.46, 0.22),
];

impl Surface {
    /// Returns the surface of the object that the ray from `origin` in `direction` has hit.
    pub fn of_object(objects: &Primitives, hit: &Hit, origin: DVec3, direction: DVec3) -> Self {
        let id = hit.object as usize;
        let met = origin + direction * f64::from(hit.t);
        let of_triangle = |[a, b, c]: [DVec3; 3]| {
            // Edges are normalised first, so that tiny triangles have a normal.
            let ab = (b - a).normalize_or_zero();
            let ac = (c - a).normalize_or_zero();
            (met, ab.cross(ac).normalize_or(-direction), PLASTER, 0.0)
        };
        let (point, normal, colour, mirror) = match objects {
            Primitives::Triangles(triangles) => of_triangle(triangles[id].corners()),
            Primitives::Doubles(triangles) => of_triangle(triangles[id].corners()),
            Primitives::Spheres(spheres) => {
                let center = spheres[id].center.as_dvec3();
                let normal = (met - center).normalize_or(-direction);
                // The distance has f32 precision; the point on the sphere is exact to f64.
                let point = center + normal * f64::from(spheres[id].radius);
                (point, normal, COLOURS[id % COLOURS.len()], 0.05)
            }
        };
        // Meshes have triangles of both orientations, so the side that is seen counts as the front.
        let normal = if normal.dot(direction) > 0.0 { -normal } else { normal };
        Self { point, normal, colour, mirror, haze: 0.0 }
    }
}

/// The plane below the scene. No acceleration structure contains it, because one division
/// intersects it.
#[derive(Clone, Debug)]
pub struct Ground {
    up: DVec3,
    height: f64,
    center: DVec3,
    /// Half the diagonal of the scene's box.
    radius: f64,
    /// True under spheres, whose distances would be hard to judge without a pattern.
    checkered: bool,
}

impl Ground {
    /// Returns the ground under objects with these bounds. No objects and a single point have none.
    pub fn below(objects: &Primitives, bounds: &Aabb, up: DVec3) -> Option<Self> {
        bounds.check().ok()?;
        let checkered = matches!(objects, Primitives::Spheres(_));
        // A gap keeps the ground apart from floors that are at the bottom of a mesh.
        let gap = if checkered { 0.05 } else { 1e-3 };
        let radius = bounds.extent().length() / 2.0;
        if radius == 0.0 {
            return None;
        }
        let height = bounds.min.as_dvec3().dot(up) - gap * radius;
        Some(Self { up, height, center: bounds.doubled_centroid() / 2.0, radius, checkered })
    }

    /// Returns the distance at which the ray meets the ground; `None` unless it comes from above.
    pub fn meet(&self, origin: DVec3, direction: DVec3) -> Option<f64> {
        let above = origin.dot(self.up) - self.height;
        let descent = -direction.dot(self.up);
        (above > 0.0 && descent > 0.0).then(|| above / descent)
    }

    /// Returns the surface at this distance.
    pub fn surface(&self, origin: DVec3, direction: DVec3, distance: f64) -> Surface {
        let point = origin + direction * distance;
        let away = (point - self.center) / self.radius;
        let aside = away.cross(self.up);
        let squared = aside.length_squared();
        // Haze hides the horizon, where the pattern would be finer than a pixel.
        let haze = squared / (squared + 20.0);
        let mut tiles = 0;
        for axis in 0..3 {
            // The pattern varies along the ground only, not along the up direction.
            if self.up[axis] == 0.0 {
                tiles += (aside[axis] * 3.0).floor() as i64 & 1;
            }
        }
        let dark = self.checkered && tiles & 1 == 1;
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
