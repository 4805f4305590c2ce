//! Batches of rays through instances, in relation to the same batches through the same scene written
//! out as triangles.
//!
//! `cargo bench -p bvh-build --bench instances [-- COPIES...]`
//!
//! The scenes are copies of one bumpy ball, turned and scaled at random: *sparse*, where most rays pass
//! between copies, and *packed*, where the boxes of neighbours overlap. Both sides have trees by
//! Müller–Fellner. Both contenders trace in turns on one thread; the ratio is the median over the rounds.

use bvh_build::{Builder, muller_fellner};
use bvh_core::{
    Aabb, Coherence, Hit, Instance, InstanceHit, Instances, Ray, Triangle, WideBvh, boxes,
};
use glam::{Affine3A, Quat, Vec3};
use std::time::Instant;

/// The numbers of copies without arguments.
const COPIES: [usize; 3] = [64, 512, 4096];
/// The pixels of the camera along each side, a multiple of eight.
const PIXELS: usize = 512;
/// The number of timed rounds.
const ROUNDS: usize = 9;

/// SplitMix64 (Steele, Lea & Flood 2014).
struct Random(u64);

impl Random {
    /// Returns a uniform number from 0 to 1.
    fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Returns a uniform point in the cube from −1 to 1.
    fn point(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

/// A scene of instances, and the same scene written out.
struct Pair {
    instances: Instances,
    flat: WideBvh,
    bounds: Aabb,
}

impl Pair {
    /// Makes copies in a grid with this distance between neighbours, in radii of the ball.
    fn new(copies: usize, distance: f32) -> Self {
        let mut random = Random(1);
        let triangles = ball(3);
        let part = layout(&triangles);
        let side = (copies as f32).cbrt().ceil() as usize;
        let instances: Vec<Instance> = (0..copies)
            .map(|i| {
                let cell = [i % side, i / side % side, i / side / side].map(|i| i as f32);
                let shift = (Vec3::from(cell) + 0.3 * random.point()) * distance;
                let turn = Quat::from_axis_angle(random.point().normalize(), 6.0 * random.unit());
                let scale = Vec3::splat(0.7 + 0.6 * random.unit());
                let transform = Affine3A::from_scale_rotation_translation(scale, turn, shift);
                Instance { part: 0, transform }
            })
            .collect();
        let mut flat = Vec::with_capacity(copies * triangles.len());
        for instance in &instances {
            flat.extend(
                triangles
                    .iter()
                    .map(|triangle| triangle.transformed(&instance.transform)),
            );
        }
        let parts = vec![part];
        let boxes = Instance::boxes(&instances, &parts).expect("instances of the part");
        let top = muller_fellner::Config::default()
            .build(&boxes)
            .expect("finite boxes");
        Self {
            bounds: Aabb::union_of(&boxes),
            instances: Instances::new(parts, instances, top).expect("a tree over the boxes"),
            flat: layout(&flat),
        }
    }

    /// Returns the rays of a camera in front of the scene, in tiles of eight by eight pixels.
    fn camera(&self) -> Vec<Ray> {
        let extent = self.bounds.max - self.bounds.min;
        let eye = self.bounds.min + extent * Vec3::new(0.4, 0.6, -0.3);
        let corner = self.bounds.min;
        let mut rays = Vec::new();
        for i in 0..PIXELS * PIXELS {
            let tile = i / 64;
            let x = 8 * (tile % (PIXELS / 8)) + i % 8;
            let y = 8 * (tile / (PIXELS / 8)) + i / 8 % 8;
            let at = Vec3::new(x as f32, y as f32, 0.0) / PIXELS as f32;
            rays.push(Ray::half_line(eye, corner + extent * at - eye).expect("a direction"));
        }
        rays
    }

    /// Returns rays from one point of the scene through another.
    fn random(&self) -> Vec<Ray> {
        let mut random = Random(2);
        let extent = self.bounds.max - self.bounds.min;
        let mut point = || self.bounds.min + extent * (0.5 + 0.5 * random.point());
        (0..PIXELS * PIXELS / 2)
            .map(|_| {
                let from = point();
                Ray::half_line(from, point() - from).expect("a direction")
            })
            .collect()
    }

    /// Prints how fast the rays are, by both questions.
    fn compare(&self, name: &str, rays: &[Ray], coherence: Coherence) {
        let mut instance_hits = vec![InstanceHit::MISS; rays.len()];
        let mut hits = vec![Hit::MISS; rays.len()];
        let mut found = vec![false; rays.len()];
        compare(
            &format!("{name} nearest"),
            rays.len(),
            || self.flat.nearest_hits(rays, &mut hits, coherence),
            || {
                self.instances
                    .nearest_hits(rays, &mut instance_hits, coherence);
            },
        );
        let mut flat_found = vec![false; rays.len()];
        compare(
            &format!("{name} any"),
            rays.len(),
            || {
                self.flat
                    .any_hits(rays, &mut flat_found, coherence)
            },
            || {
                self.instances
                    .any_hits(rays, &mut found, coherence)
            },
        );
        let differences = hits
            .iter()
            .zip(&instance_hits)
            .filter(|(hit, instance_hit)| hit.is_miss() != instance_hit.is_miss())
            .count();
        assert!(differences * 10_000 <= rays.len(), "{differences} of {} rays differ", rays.len());
    }
}

fn main() {
    let arguments = std::env::args().skip(1);
    let mut copies: Vec<usize> = arguments
        .filter(|argument| argument != "--bench")
        .map(|argument| argument.parse().expect("a number of copies"))
        .collect();
    if copies.is_empty() {
        copies.extend(COPIES);
    }
    println!("{:<38} {:>12} {:>12} {:>8}", "scene and rays", "flat, M/s", "instances", "ratio");
    for copies in copies {
        for (name, distance) in [("sparse", 4.0), ("packed", 2.2)] {
            let pair = Pair::new(copies, distance);
            let coherent = format!("{copies} {name}, coherent");
            pair.compare(&coherent, &pair.camera(), Coherence::Coherent);
            let incoherent = format!("{copies} {name}, incoherent");
            pair.compare(&incoherent, &pair.random(), Coherence::Incoherent);
        }
    }
}

/// Runs both in turns, and prints millions of rays per second and the median of the ratios of speeds.
fn compare(name: &str, rays: usize, mut flat: impl FnMut(), mut instances: impl FnMut()) {
    let mut speeds = [const { Vec::new() }; 3];
    for round in 0..=ROUNDS {
        let start = Instant::now();
        flat();
        let middle = Instant::now();
        instances();
        let instances = middle.elapsed().as_secs_f64();
        let flat = (middle - start).as_secs_f64();
        // The first round warms the caches.
        if round > 0 {
            let speed = |seconds: f64| rays as f64 / seconds * 1e-6;
            speeds[0].push(speed(flat));
            speeds[1].push(speed(instances));
            speeds[2].push(flat / instances);
        }
    }
    let [flat, instances, ratio] = speeds.map(|mut values| {
        values.sort_by(f64::total_cmp);
        values[ROUNDS / 2]
    });
    println!("{name:<38} {flat:>12.2} {instances:>12.2} {ratio:>8.3}");
}

fn layout(triangles: &[Triangle]) -> WideBvh {
    let tree = muller_fellner::Config::default()
        .build(&boxes(triangles))
        .expect("finite boxes");
    WideBvh::new(&tree, triangles).expect("a tree over the triangles")
}

/// Returns an octahedron whose faces are divided into four as often as `levels` says, pushed to a sphere
/// of about radius 1 with bumps.
fn ball(levels: usize) -> Vec<Triangle> {
    let mut triangles = Vec::new();
    for octant in 0..8 {
        let sign = |axis: usize| if octant >> axis & 1 == 0 { 1.0 } else { -1.0 };
        triangles.push([Vec3::X * sign(0), Vec3::Y * sign(1), Vec3::Z * sign(2)]);
    }
    for _ in 0..levels {
        let mut smaller = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a + b) * 0.5, (b + c) * 0.5, (c + a) * 0.5];
            smaller.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = smaller;
    }
    let bumpy = |p: Vec3| {
        let p = p.normalize();
        p * (1.0 + 0.1 * (7.0 * p.x).sin() * (5.0 * p.y).sin() * (6.0 * p.z).cos())
    };
    triangles
        .into_iter()
        .map(|corners| Triangle(corners.map(bumpy)))
        .collect()
}
