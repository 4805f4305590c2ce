//! A path tracer that records the segments of a frame, bakes a tree for them, and traces the next
//! frame with it: cut-out triangles, instances, a refitted flag, a light, diffuse reflections.
//!
//! `cargo run -p bvh-scenes --example path_tracer [SCENE [SECONDS]]`, by default `cloister` and 2

use bvh_core::TestCounts;
use bvh_scenes::Scene;
use bvh_search::Stream;
use bvh_search::prelude::*;
use rand::{RngExt, SeedableRng};
use std::error::Error;

const WIDTH: u32 = 160;
const BOUNCES: u32 = 2;

/// The scene that is baked, balls in three places, and a flag that moves.
struct World {
    triangles: Vec<Triangle>,
    wide: WideBvh,
    balls: Instances,
    ball: Vec<Triangle>,
    places: Vec<Affine3A>,
    flag: WideBvh,
    flag_triangles: Vec<Triangle>,
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

/// The triangle that was hit, in world coordinates, and the distance.
type Surface = (Triangle, f32);

/// Returns whether a triangle is opaque at a hit: every eighth one of the scene is a grate.
fn is_opaque(triangle: &Triangle, ray: &Ray, id: u32) -> bool {
    let Some([u, v, _]) = triangle.barycentrics(ray) else { return true };
    !id.is_multiple_of(8) || ((u * 16.0) as u32 + (v * 16.0) as u32).is_multiple_of(2)
}

impl World {
    /// Returns the nearest surface.
    fn nearest(&self, ray: &Ray) -> Option<Surface> {
        let mask = |hit: Hit| is_opaque(&self.triangles[hit.object as usize], ray, hit.object);
        let scene = self.wide.nearest_hit_where(ray, mask);
        let scene = scene.map(|hit| (self.triangles[hit.object as usize], hit.t));
        let flag = self.flag.nearest_hit(ray);
        let flag = flag.map(|hit| (self.flag_triangles[hit.object as usize], hit.t));
        let ball = self.balls.nearest_hit(ray).map(|hit| {
            let place = self.places[hit.instance as usize];
            let corners = self.ball[hit.triangle as usize].0;
            (Triangle(corners.map(|corner| place.transform_point3(corner))), hit.t)
        });
        let found = [scene, flag, ball].into_iter().flatten();
        found.min_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Returns whether anything is in the way.
    fn is_shadowed(&self, ray: &Ray) -> bool {
        let mask = |hit: Hit| is_opaque(&self.triangles[hit.object as usize], ray, hit.object);
        self.wide.any_hit_where(ray, mask) || self.flag.any_hit(ray) || self.balls.any_hit(ray)
    }

    /// Returns the light that arrives along a ray, and records all rays on the way.
    fn radiance(&self, mut ray: Ray, rng: &mut Stream, traced: &mut Vec<Traced>) -> f32 {
        let mut light = 0.0;
        let mut weight = 1.0;
        for _ in 0..=BOUNCES {
            let from = ray.origin().to_array();
            let found = self.nearest(&ray);
            let miss = self.far / ray.direction().length();
            let end = ray.origin() + ray.direction() * found.map_or(miss, |(_, t)| t);
            let segment = Segment { from, to: end.to_array() };
            traced.push(Traced { ray, segment, is_shadow: false });
            let Some((triangle, _)) = found else { break };
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
                light += if self.is_shadowed(&shadow) { 0.0 } else { weight * cosine };
            }
            // A point on the unit sphere around the tip of the normal: a direction by its cosine.
            let z: f32 = rng.random_range(-1.0..1.0);
            let (sine, along) = rng
                .random_range(0.0..std::f32::consts::TAU)
                .sin_cos();
            let across = (1.0 - z * z).sqrt();
            let direction = normal + Vec3::new(across * along, across * sine, z);
            let Ok(next) = Ray::half_line(point, direction) else { break };
            ray = next;
        }
        light
    }

    /// Traces a picture from `eye` toward `at`. Returns its mean brightness and all rays.
    fn frame(&self, eye: Vec3, at: Vec3, seed: u64) -> Result<(f32, Vec<Traced>), Box<dyn Error>> {
        let mut rng = Stream::seed_from_u64(seed);
        let mut traced = Vec::new();
        let forward = (at - eye).normalize();
        let right = forward
            .cross(Vec3::Y)
            .try_normalize()
            .unwrap_or(Vec3::X);
        let top = right.cross(forward);
        let mut brightness = 0.0;
        for pixel in 0..WIDTH * WIDTH {
            let place = |index: u32| (index as f32 + 0.5) * 1.4 / WIDTH as f32 - 0.7;
            let direction = forward + right * place(pixel % WIDTH) - top * place(pixel / WIDTH);
            brightness += self.radiance(Ray::half_line(eye, direction)?, &mut rng, &mut traced);
        }
        Ok((brightness / (WIDTH * WIDTH) as f32, traced))
    }

    /// Moves the flag.
    fn wave(&mut self, time: f32) -> Result<(), Box<dyn Error>> {
        for triangle in &mut self.flag_triangles {
            triangle.0 = triangle
                .0
                .map(|corner| corner + Vec3::Y * (time + corner.x).sin() * 0.01);
        }
        Ok(self.flag.refit(&self.flag_triangles)?)
    }
}

/// Returns the tests of boxes and triangles per ray in a layout.
fn tests(wide: &WideBvh, traced: &[Traced], is_shadow: bool) -> f64 {
    let mut counts = TestCounts::default();
    let rays = traced
        .iter()
        .filter(|traced| traced.is_shadow == is_shadow);
    for Traced { ray, .. } in rays.clone() {
        if is_shadow {
            wide.any_hit_counted(ray, &mut counts);
        } else {
            wide.nearest_hit_counted(ray, &mut counts);
        }
    }
    (counts.boxes + counts.objects) as f64 / rays.count() as f64
}

/// Returns a layout of a small mesh.
fn layout(triangles: &[Triangle]) -> Result<WideBvh, Box<dyn Error>> {
    let tree = muller_fellner::Config::default().build(&boxes(triangles))?;
    Ok(WideBvh::new(&tree, triangles)?)
}

/// Returns a sheet of `size` × `size` squares around `center`, bent around a ball if `radius` is
/// positive.
fn sheet(center: Vec3, width: f32, size: u16, radius: f32) -> Vec<Triangle> {
    let corner = |x: u16, y: u16| {
        let u = f32::from(x) / f32::from(size);
        let v = f32::from(y) / f32::from(size);
        let flat = center + Vec3::new(u - 0.5, v - 0.5, 0.0) * width;
        let (sine, cosine) = (u * std::f32::consts::TAU).sin_cos();
        let (ring, height) = (v * std::f32::consts::PI).sin_cos();
        let round = center + radius * Vec3::new(ring * cosine, height, ring * sine);
        if radius > 0.0 { round } else { flat }
    };
    let squares = (0..size * size).map(|i| (i % size, i / size));
    squares
        .flat_map(|(x, y)| {
            let [a, b] = [corner(x, y), corner(x + 1, y)];
            let [c, d] = [corner(x, y + 1), corner(x + 1, y + 1)];
            [Triangle([a, b, c]), Triangle([d, c, b])]
        })
        .collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().unwrap_or("cloister".into());
    let seconds: f64 = arguments
        .next()
        .map_or(Ok(2.0), |text| text.parse())?;
    let time = Duration::from_secs_f64(seconds);
    let scene = Scene::load(&name)?;
    let triangles = scene.triangles()?.to_vec();
    let bounds = scene
        .boxes
        .iter()
        .fold(Aabb::EMPTY, |all, aabb| all.union(aabb));
    let place =
        |x: f32, y: f32, z: f32| bounds.min + (bounds.max - bounds.min) * Vec3::new(x, y, z);
    let size = (bounds.max - bounds.min).max_element();

    let by_area = bake(&scene.boxes, time)?.tree;
    let ball = sheet(Vec3::ZERO, 0.0, 24, 0.03 * size);
    let places = [0.35, 0.5, 0.65].map(|x| Affine3A::from_translation(place(x, 0.3, 0.45)));
    let instances = places.map(|transform| Instance { part: 0, transform });
    let parts = vec![layout(&ball)?];
    let top = bake(&Instance::boxes(&instances, &parts)?, Duration::ZERO)?.tree;
    let flag_triangles = sheet(place(0.6, 0.5, 0.55), 0.1 * size, 16, 0.0);
    let mut world = World {
        wide: WideBvh::new(&by_area, &triangles)?,
        triangles,
        balls: Instances::new(parts, instances.to_vec(), top)?,
        ball,
        places: places.to_vec(),
        flag: layout(&flag_triangles)?,
        flag_triangles,
        light: place(0.5, 0.9, 0.5),
        far: 4.0 * size,
    };

    // Record a frame, and bake for its rays.
    let (brightness, recorded) = world.frame(place(0.5, 0.6, 0.5), place(0.9, 0.4, 0.9), 1)?;
    println!("first frame: {} rays, brightness {brightness:.3}", recorded.len());
    let segments: Vec<Segment> = recorded
        .iter()
        .map(|traced| traced.segment)
        .collect();
    let (outcome, density) = bake_for_rays(&scene.boxes, &segments, time)?;
    let visits = density.visits(&outcome.tree);
    let for_rays = WideBvh::for_rays(&outcome.tree, &world.triangles, &visits)?;

    // The camera and the flag move on. The same frame by both trees is the same picture.
    world.wave(0.4)?;
    let next = [place(0.51, 0.59, 0.48), place(0.88, 0.4, 0.88)];
    let elsewhere = [place(0.4, 0.7, 0.3), place(0.6, 0.2, 0.9)];
    for (frame, [eye, at]) in [("next frame", next), ("elsewhere", elsewhere)] {
        let (before, traced) = world.frame(eye, at, 2)?;
        for (kind, is_shadow) in [("camera and bounces", false), ("light", true)] {
            let old = tests(&world.wide, &traced, is_shadow);
            let new = tests(&for_rays, &traced, is_shadow);
            let gain = 100.0 * (new / old - 1.0);
            println!(
                "{frame}, {kind}: {old:.1} tests per ray by area, {new:.1} recorded, {gain:+.1} %"
            );
        }
        let by_area = std::mem::replace(&mut world.wide, for_rays.clone());
        assert_eq!(world.frame(eye, at, 2)?.0, before, "the answers do not depend on the tree");
        world.wide = by_area;
    }
    Ok(())
}
