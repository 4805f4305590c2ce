//! Computes the light that reaches a pixel with rays through the pixel, to the lights, and along
//! mirror reflections.

use super::image::{self, Film, Options};
use super::surface::{Ground, Surface};
use crate::Scene;
use crate::rays::{Camera, View};
use crate::trace::Accelerator;
use bvh_core::{Aabb, Ray};
use glam::DVec3;

#[derive(Clone, Debug)]
struct Light {
    position: DVec3,
    /// Linear red, green and blue at distance 0.
    colour: DVec3,
    /// The distance at which the light has half its strength.
    reach: f64,
}

impl Light {
    fn new(position: DVec3, colour: [f64; 3], reach: f64) -> Self {
        Self { position, colour: colour.into(), reach }
    }

    fn at(&self, distance: f64) -> DVec3 {
        let relative = distance / self.reach;
        self.colour / (1.0 + relative * relative)
    }
}

/// Returns lights that suit a view. A scene seen from outside has a warm light at the upper left
/// and a weak cool light at the right. A scene seen from inside has a sun overhead, sunlight
/// reflected by the floor, and a weak lamp near the eye.
fn automatic(view: &View, up: DVec3, bounds: &Aabb) -> Vec<Light> {
    if bounds.check().is_err() {
        return vec![];
    }
    let center = bounds.doubled_centroid() / 2.0;
    let radius = bounds.extent().length() / 2.0;
    let forward = (view.at - view.from).normalize_or(DVec3::NEG_Z);
    let right = forward.cross(up).normalize_or_zero();
    if view.is_inside(bounds) {
        let sun = center + up * (4.0 * radius) + right * (0.85 * radius) + forward * (0.6 * radius);
        let lamp = view.from + up * (0.05 * radius) - right * (0.04 * radius);
        // The renderer has no diffuse reflection. This light replaces the sunlight that the floor
        // would reflect to walls and vaults.
        let floor = view.at - up * (0.15 * radius) + right * (0.05 * radius);
        return vec![
            Light::new(sun, [2.0, 1.72, 1.3], f64::INFINITY),
            Light::new(lamp, [0.50, 0.34, 0.19], 0.3 * radius),
            Light::new(floor, [0.95, 0.74, 0.48], 0.3 * radius),
        ];
    }
    let key = center + up * (2.2 * radius) - right * (1.5 * radius) - forward * (1.4 * radius);
    let fill = center + up * (1.2 * radius) + right * (2.2 * radius) - forward * (1.2 * radius);
    vec![
        Light::new(key, [1.25, 1.16, 1.02], f64::INFINITY),
        Light::new(fill, [0.20, 0.24, 0.32], f64::INFINITY),
    ]
}

/// All surfaces that a ray can meet, the lights, and the camera.
pub struct World<'a> {
    accelerator: &'a Accelerator<'a>,
    options: &'a Options,
    camera: Camera,
    up: DVec3,
    lights: Vec<Light>,
    ground: Option<Ground>,
}

const HORIZON: DVec3 = DVec3::new(0.58, 0.66, 0.76);
const ZENITH: DVec3 = DVec3::new(0.11, 0.24, 0.50);
/// Ambient light from below, which the surroundings reflect.
const BELOW: DVec3 = DVec3::new(0.22, 0.20, 0.18);
/// The fraction of the ambient light that reaches a surface.
const AMBIENT: f64 = 0.42;

impl<'a> World<'a> {
    pub fn new(accelerator: &'a Accelerator<'a>, scene: &Scene, options: &'a Options) -> Self {
        let Options { view, width, height, ground, .. } = options;
        let bounds = &Aabb::union_of(&scene.boxes);
        let up = scene.up();
        // An interior has its own floor.
        let ground = if *ground && !view.is_inside(bounds) {
            Ground::below(accelerator.objects(), bounds, up)
        } else {
            None
        };
        let camera = Camera::new(view, up, *width, *height);
        Self { accelerator, options, camera, up, lights: automatic(view, up, bounds), ground }
    }

    pub fn row(&self, y: u32) -> Film {
        let &Options { width, samples, .. } = self.options;
        let mut row = Film { width, ..Film::default() };
        for x in 0..width {
            let mut sum = DVec3::ZERO;
            let before = row.counts.boxes + row.counts.objects;
            for v in 0..samples {
                for u in 0..samples {
                    let right = f64::from(x) + (f64::from(u) + 0.5) / f64::from(samples);
                    let down = f64::from(y) + (f64::from(v) + 0.5) / f64::from(samples);
                    let direction = self.camera.direction(right, down);
                    let light = self.radiance(self.camera.origin, direction, &mut row);
                    // Exposure before the average keeps the edges of highlights smooth.
                    sum += image::expose(light);
                }
            }
            row.pixels.push(image::encode(sum / f64::from(samples * samples)));
            row.tests.push(row.counts.boxes + row.counts.objects - before);
        }
        row
    }

    /// Returns the light from `direction`. A loop follows reflections, because each surface has
    /// only one.
    fn radiance(&self, mut origin: DVec3, mut direction: DVec3, film: &mut Film) -> DVec3 {
        let mut light = DVec3::ZERO;
        let mut weight = 1.0;
        for _ in 0..=self.options.depth {
            let Some(surface) = self.meet(origin, direction, film) else { break };
            let facing = -surface.normal.dot(direction);
            // Schlick 1994, 'An inexpensive BRDF model for physically-based rendering'.
            let grazing = 1.0 - facing.clamp(0.0, 1.0);
            let rise = (grazing * grazing) * (grazing * grazing) * grazing;
            let mirror = if surface.mirror > 0.0 {
                surface.mirror + (1.0 - surface.mirror) * rise
            } else {
                0.0
            };
            let reflected = direction + surface.normal * (2.0 * facing);
            let start = self.lifted(&surface, origin);
            let direct = self.direct(&surface, start, reflected, mirror, film);
            light += weight * (direct * (1.0 - surface.haze) + HORIZON * surface.haze);
            weight *= mirror * (1.0 - surface.haze);
            // A smaller weight changes no byte of a pixel.
            if weight < 1.0 / 256.0 {
                return light;
            }
            (origin, direction) = (start, reflected);
        }
        light + weight * self.sky(direction)
    }

    fn meet(&self, origin: DVec3, direction: DVec3, film: &mut Film) -> Option<Surface> {
        film.rays += 1;
        let hit = Ray::half_line(origin.as_vec3(), direction.as_vec3())
            .ok()
            .and_then(|ray| self.accelerator.nearest_hit_counted(&ray, &mut film.counts));
        if let Some(ground) = &self.ground
            && let Some(distance) = ground.meet(origin, direction)
            && hit.is_none_or(|hit| f64::from(hit.t) > distance)
        {
            return Some(ground.surface(origin, direction, distance));
        }
        hit.map(|hit| Surface::of_object(self.accelerator.objects(), &hit, origin, direction))
    }

    /// Returns a point just in front of the surface, from which a ray does not meet the surface
    /// again.
    fn lifted(&self, surface: &Surface, seen_from: DVec3) -> DVec3 {
        // Rounding moves a hit by a few units in the last place of the largest coordinate involved,
        // and 64 units are a safe multiple.
        let size = surface.point.abs().max(seen_from.abs()).max_element();
        surface.point + surface.normal * (size * (64.0 * f64::from(f32::EPSILON)))
    }

    fn direct(
        &self,
        surface: &Surface,
        start: DVec3,
        reflected: DVec3,
        mirror: f64,
        film: &mut Film,
    ) -> DVec3 {
        let height = 0.5 + 0.5 * surface.normal.dot(self.up);
        let mut diffuse = (BELOW + (ZENITH * 0.5 + HORIZON * 0.5 - BELOW) * height) * AMBIENT;
        let mut highlight = DVec3::ZERO;
        for light in &self.lights {
            let to_light = light.position - start;
            let distance = to_light.length();
            let towards = to_light / distance;
            let cosine = surface.normal.dot(towards);
            // The cosine is NaN if the light is exactly at this point.
            if cosine.is_nan() || cosine <= 0.0 || self.is_shadowed(start, towards, distance, film)
            {
                continue;
            }
            let arriving = light.at(distance);
            diffuse += arriving * cosine;
            if mirror > 0.0 {
                let mut gloss = reflected.dot(towards).max(0.0);
                // Seven squarings give Phong's exponent 128 without a function of the platform.
                for _ in 0..7 {
                    gloss *= gloss;
                }
                highlight += arriving * gloss * 0.9;
            }
        }
        surface.colour * diffuse * (1.0 - mirror) + highlight
    }

    fn is_shadowed(&self, start: DVec3, towards: DVec3, distance: f64, film: &mut Film) -> bool {
        film.rays += 1;
        let ray = Ray::new(start.as_vec3(), towards.as_vec3(), 0.0, distance as f32);
        ray.is_ok_and(|ray| self.accelerator.any_hit_counted(&ray, &mut film.counts))
    }

    fn sky(&self, direction: DVec3) -> DVec3 {
        HORIZON + (ZENITH - HORIZON) * direction.dot(self.up).clamp(0.0, 1.0)
    }
}
