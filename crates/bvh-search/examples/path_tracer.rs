//! A path tracer that records the segments of a frame, bakes a tree for them, and traces the next
//! frame with it: cut-out triangles, a light, diffuse reflections.
//!
//! `cargo run -p bvh-search --example path_tracer [SCENE [SECONDS]]`, by default `cloister` and 2

use bvh_scenes::Scene;
use bvh_scenes::rays::{Camera, Kind, TracedRay, View, in_box, on_sphere, tests_per_ray};
use bvh_search::Stream;
use bvh_search::bvh_core::glam::DVec3;
use bvh_search::prelude::*;
use rand::SeedableRng;
use std::error::Error;

const WIDTH: u32 = 160;
const BOUNCES: u32 = 2;

struct World {
    triangles: Vec<Triangle>,
    light: Vec3,
    /// Longer than the scene.
    far: f32,
}

impl World {
    /// Returns whether a triangle is opaque at a hit: every eighth one is a grate.
    fn is_opaque(&self, ray: &Ray, hit: Hit) -> bool {
        let triangle = &self.triangles[hit.object as usize];
        let Some([u, v, _]) = triangle.barycentrics(ray) else { return true };
        !hit.object.is_multiple_of(8) || ((u * 16.0) as u32 + (v * 16.0) as u32).is_multiple_of(2)
    }

    /// Returns the light that arrives along a ray, and records all rays on the way.
    fn radiance(
        &self,
        wide: &WideBvh,
        mut ray: Ray,
        rng: &mut Stream,
        traced: &mut Vec<TracedRay>,
    ) -> f32 {
        let mut light = 0.0;
        let mut weight = 1.0;
        let mut kind = Kind::Primary;
        for _ in 0..=BOUNCES {
            let hit = wide.nearest_hit_where(&ray, |hit| self.is_opaque(&ray, hit));
            let end = hit.map_or(self.far / ray.direction().length(), |hit| hit.t);
            let segment = Segment::of_ray(&ray, end);
            traced.extend(segment.map(|segment| TracedRay { kind, ray, segment }));
            let Some(hit) = hit else { break };
            let triangle = &self.triangles[hit.object as usize];
            let Some(normal) = triangle.normal() else { break };
            let normal = if normal.dot(ray.direction()) < 0.0 { normal } else { -normal };
            let point = ray.at(end) + normal * (1e-5 * self.far);
            weight *= 0.7;
            let to_light = self.light - point;
            let cosine = normal.dot(to_light.normalize());
            if let Ok(ray) = Ray::new(point, to_light, 0.0, 1.0)
                && cosine > 0.0
            {
                // A shadow ray is recorded up to the light: any object on the way may end it.
                let segment = Segment::of_ray(&ray, 1.0);
                let kind = Kind::Shadow;
                traced.extend(segment.map(|segment| TracedRay { kind, ray, segment }));
                let is_lit = !wide.any_hit_where(&ray, |hit| self.is_opaque(&ray, hit));
                light += if is_lit { weight * cosine } else { 0.0 };
            }
            // A point on the unit sphere around the tip of the normal: a direction by its cosine.
            let Ok(next) = Ray::half_line(point, normal + on_sphere(rng).as_vec3()) else { break };
            ray = next;
            kind = Kind::Bounce;
        }
        light
    }

    /// Traces a picture. Returns its mean brightness and all rays.
    fn frame(&self, wide: &WideBvh, view: &View) -> Result<(f32, Vec<TracedRay>), Box<dyn Error>> {
        let camera = Camera::new(view, DVec3::Y, WIDTH, WIDTH);
        let mut rng = Stream::seed_from_u64(1);
        let mut traced = Vec::new();
        let mut brightness = 0.0;
        for pixel in 0..WIDTH * WIDTH {
            let [x, y] = [pixel % WIDTH, pixel / WIDTH].map(|place| f64::from(place) + 0.5);
            let ray = Ray::half_line(camera.origin.as_vec3(), camera.direction(x, y).as_vec3())?;
            brightness += self.radiance(wide, ray, &mut rng, &mut traced);
        }
        Ok((brightness / (WIDTH * WIDTH) as f32, traced))
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let scene = Scene::load(&arguments.next().unwrap_or("cloister".into()))?;
    let time = Duration::from_secs_f64(arguments.next().unwrap_or("2".into()).parse()?);
    let triangles = scene.triangles()?.to_vec();
    let all = Aabb::union_of(&scene.boxes);
    let far = 4.0 * all.extent().max_element() as f32;
    let light = in_box(&all, [0.5, 0.9, 0.5]).as_vec3();
    let by_area = WideBvh::new(&bake(&scene.boxes, time)?.tree, &triangles)?;
    let world = World { triangles, light, far };

    // Record a frame, and bake for its rays.
    let view = |from, at| View { from: in_box(&all, from), at: in_box(&all, at), fov: 70.0 };
    let first = view([0.5, 0.6, 0.5], [0.9, 0.4, 0.9]);
    let (brightness, recorded) = world.frame(&by_area, &first)?;
    println!("first frame: {} rays, brightness {brightness:.3}", recorded.len());
    let segments: Vec<Segment> = recorded.iter().map(|traced| traced.segment).collect();
    let (outcome, density) = bake_for_rays(&world.triangles, &segments, time)?;
    let visits = density.visits(&outcome.tree);
    let for_rays = WideBvh::for_rays(&outcome.tree, &world.triangles, &visits)?;

    // The camera moves on. The same frame by both trees is the same picture.
    let next = view([0.51, 0.59, 0.48], [0.88, 0.4, 0.88]);
    let elsewhere = view([0.4, 0.7, 0.3], [0.6, 0.2, 0.9]);
    for (frame, view) in [("next frame", next), ("elsewhere", elsewhere)] {
        let (before, traced) = world.frame(&by_area, &view)?;
        for kind in [Kind::Primary, Kind::Bounce, Kind::Shadow] {
            let of_kind = traced.iter().filter(|traced| traced.kind == kind);
            let rays: Vec<Ray> = of_kind.map(|traced| traced.ray).collect();
            let [old, new] = [&by_area, &for_rays].map(|wide| {
                let [nodes, blocks] = tests_per_ray(wide, kind, &rays);
                nodes + blocks
            });
            let gain = 100.0 * (new / old - 1.0);
            let kind = kind.name();
            println!(
                "{frame}, {kind}: {old:.2} tests per ray by area, {new:.2} recorded, {gain:+.1} %"
            );
        }
        let after = world.frame(&for_rays, &view)?.0;
        assert_eq!(after, before, "the answers do not depend on the tree");
    }
    Ok(())
}
