//! A path tracer that records the segments of a frame, bakes a tree for them, and traces the next
//! frame with it: cut-out triangles, instances, a refitted flag, a light, diffuse reflections.
//!
//! `cargo run -p bvh-scenes --example path_tracer [SCENE [SECONDS]]`, by default `cloister` and 2

use bvh_scenes::Scene;
use bvh_scenes::rays::{Camera, View, in_box};
use bvh_search::Stream;
use bvh_search::bvh_core::TestCounts;
use bvh_search::bvh_core::glam::DVec3;
use bvh_search::prelude::*;
use rand::{RngExt, SeedableRng};
use std::error::Error;

const WIDTH: u32 = 160;
const BOUNCES: u32 = 2;

/// Parts, of which the first is the scene and the last a flag that moves, and where they are.
struct World {
    parts: Vec<Vec<Triangle>>,
    instances: Vec<Instance>,
    light: Vec3,
    /// Longer than the scene.
    far: f32,
}

/// A traced ray. The segment of a shadow ray ends at the light.
struct Traced {
    ray: Ray,
    segment: Segment,
    is_shadow: bool,
}

/// Returns a layout of a mesh by the fastest builder.
fn layout(triangles: &[Triangle]) -> Result<WideBvh, Box<dyn Error>> {
    let tree = muller_fellner::Config::default().build(&boxes(triangles))?;
    Ok(WideBvh::new(&tree, triangles)?)
}

impl World {
    /// Returns what rays are traced in.
    fn assemble(&self, parts: Vec<WideBvh>) -> Result<Instances, Box<dyn Error>> {
        let top = bake(&Instance::boxes(&self.instances, &parts)?, Duration::ZERO)?.tree;
        Ok(Instances::new(parts, self.instances.clone(), top)?)
    }

    /// Returns the triangle of a hit in world coordinates.
    fn triangle(&self, hit: InstanceHit) -> Triangle {
        let Instance { part, transform } = self.instances[hit.instance as usize];
        let corners = self.parts[part as usize][hit.triangle as usize].0;
        Triangle(corners.map(|corner| transform.transform_point3(corner)))
    }

    /// Returns whether a triangle is opaque at a hit: every eighth one of the scene is a grate.
    fn is_opaque(&self, ray: &Ray, hit: InstanceHit) -> bool {
        let Some([u, v, _]) = self.triangle(hit).barycentrics(ray) else { return true };
        hit.instance > 0
            || !hit.triangle.is_multiple_of(8)
            || ((u * 16.0) as u32 + (v * 16.0) as u32).is_multiple_of(2)
    }

    /// Returns the light that arrives along a ray, and records all rays on the way.
    fn radiance(
        &self,
        scene: &Instances,
        mut ray: Ray,
        rng: &mut Stream,
        traced: &mut Vec<Traced>,
    ) -> f32 {
        let mut light = 0.0;
        let mut weight = 1.0;
        for _ in 0..=BOUNCES {
            let hit = scene.nearest_hit_where(&ray, |hit| self.is_opaque(&ray, hit));
            let end = ray.at(hit.map_or(self.far / ray.direction().length(), |hit| hit.t));
            let segment = Segment { from: ray.origin().to_array(), to: end.to_array() };
            traced.push(Traced { ray, segment, is_shadow: false });
            let Some(triangle) = hit.map(|hit| self.triangle(hit)) else { break };
            let Some(normal) = triangle.normal() else { break };
            let normal = if normal.dot(ray.direction()) < 0.0 { normal } else { -normal };
            let point = triangle.leave(end.as_dvec3(), normal);
            weight *= 0.7;
            let to_light = self.light - point;
            let cosine = normal.dot(to_light.normalize());
            if let Ok(shadow) = Ray::new(point, to_light, 0.0, 1.0)
                && cosine > 0.0
            {
                let segment = Segment { from: point.to_array(), to: self.light.to_array() };
                traced.push(Traced { ray: shadow, segment, is_shadow: true });
                let is_lit = !scene.any_hit_where(&shadow, |hit| self.is_opaque(&shadow, hit));
                light += if is_lit { weight * cosine } else { 0.0 };
            }
            // A point on the unit sphere around the tip of the normal: a direction by its cosine.
            let z: f32 = rng.random_range(-1.0..1.0);
            let angle: f32 = rng.random_range(0.0..std::f32::consts::TAU);
            let across = (1.0 - z * z).sqrt();
            let tip = Vec3::new(across * angle.cos(), across * angle.sin(), z);
            let Ok(next) = Ray::half_line(point, normal + tip) else { break };
            ray = next;
        }
        light
    }

    /// Traces a picture. Returns its mean brightness and all rays.
    fn frame(&self, scene: &Instances, view: &View) -> Result<(f32, Vec<Traced>), Box<dyn Error>> {
        let camera = Camera::new(view, DVec3::Y, WIDTH, WIDTH);
        let mut rng = Stream::seed_from_u64(1);
        let mut traced = Vec::new();
        let mut brightness = 0.0;
        for pixel in 0..WIDTH * WIDTH {
            let [x, y] = [pixel % WIDTH, pixel / WIDTH].map(|place| f64::from(place) + 0.5);
            let ray = Ray::half_line(camera.origin.as_vec3(), camera.direction(x, y).as_vec3())?;
            brightness += self.radiance(scene, ray, &mut rng, &mut traced);
        }
        Ok((brightness / (WIDTH * WIDTH) as f32, traced))
    }
}

/// Returns the tests of boxes and triangles per ray in a layout.
fn tests(wide: &WideBvh, traced: &[Traced], is_shadow: bool) -> f64 {
    let mut counts = TestCounts::default();
    let of_kind = |traced: &&Traced| traced.is_shadow == is_shadow;
    for Traced { ray, .. } in traced.iter().filter(of_kind) {
        if is_shadow {
            wide.any_hit_counted(ray, &mut counts);
        } else {
            wide.nearest_hit_counted(ray, &mut counts);
        }
    }
    (counts.boxes + counts.objects) as f64 / traced.iter().filter(of_kind).count() as f64
}

/// Returns the box around triangles.
fn bounds(triangles: &[Triangle]) -> Aabb {
    boxes(triangles)
        .iter()
        .fold(Aabb::EMPTY, |all, aabb| all.union(aabb))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let scene = Scene::load(&arguments.next().unwrap_or("cloister".into()))?;
    let seconds: f64 = arguments.next().unwrap_or("2".into()).parse()?;
    let time = Duration::from_secs_f64(seconds);
    let triangles = scene.triangles()?.to_vec();
    let all = bounds(&triangles);
    let size = all.extent().max_element();

    // Cones stand in three places, and one more is the flag.
    let cone = Scene::load("pinecon2:600")?.triangles()?.to_vec();
    let scale = DVec3::splat(0.06 * size / bounds(&cone).extent().max_element());
    let at = |part, x| {
        let place = in_box(&all, [x, 0.3, 0.45]);
        let transform = Affine3A::from_translation(place.as_vec3());
        Instance { part, transform: transform * Affine3A::from_scale(scale.as_vec3()) }
    };
    let whole = Instance { part: 0, transform: Affine3A::IDENTITY };
    let mut world = World {
        parts: vec![triangles.clone(), cone.clone(), cone],
        instances: vec![whole, at(1, 0.35), at(1, 0.5), at(1, 0.65), at(2, 0.6)],
        light: in_box(&all, [0.5, 0.9, 0.5]).as_vec3(),
        far: 4.0 * size as f32,
    };
    let by_area = WideBvh::new(&bake(&scene.boxes, time)?.tree, &triangles)?;
    let [cones, mut flag] = [layout(&world.parts[1])?, layout(&world.parts[2])?];
    let view = |from, at| View { from: in_box(&all, from), at: in_box(&all, at), fov: 70.0 };

    // Record a frame, and bake for its rays.
    let traced_by = world.assemble(vec![by_area.clone(), cones.clone(), flag.clone()])?;
    let first = view([0.5, 0.6, 0.5], [0.9, 0.4, 0.9]);
    let (brightness, recorded) = world.frame(&traced_by, &first)?;
    println!("first frame: {} rays, brightness {brightness:.3}", recorded.len());
    let segments: Vec<Segment> = recorded
        .iter()
        .map(|traced| traced.segment)
        .collect();
    let (outcome, density) = bake_for_rays(&triangles, &segments, time)?;
    let for_rays = WideBvh::for_rays(&outcome.tree, &triangles, &density.visits(&outcome.tree))?;

    // The camera and the flag move on. The same frame by both trees is the same picture.
    for corner in world.parts[2]
        .iter_mut()
        .flat_map(|triangle| &mut triangle.0)
    {
        corner.y += 0.1 * (0.4 + corner.x).sin();
    }
    flag.refit(&world.parts[2])?;
    let scenes = [by_area.clone(), for_rays.clone()]
        .map(|tree| world.assemble(vec![tree, cones.clone(), flag.clone()]));
    let [old_scene, new_scene] = scenes;
    let [old_scene, new_scene] = [old_scene?, new_scene?];
    let next = view([0.51, 0.59, 0.48], [0.88, 0.4, 0.88]);
    let elsewhere = view([0.4, 0.7, 0.3], [0.6, 0.2, 0.9]);
    for (frame, view) in [("next frame", next), ("elsewhere", elsewhere)] {
        let (before, traced) = world.frame(&old_scene, &view)?;
        for (kind, is_shadow) in [("camera and bounces", false), ("light", true)] {
            let old = tests(&by_area, &traced, is_shadow);
            let new = tests(&for_rays, &traced, is_shadow);
            let gain = 100.0 * (new / old - 1.0);
            println!(
                "{frame}, {kind}: {old:.1} tests per ray by area, {new:.1} recorded, {gain:+.1} %"
            );
        }
        let after = world.frame(&new_scene, &view)?.0;
        assert_eq!(after, before, "the answers do not depend on the tree");
    }
    Ok(())
}
