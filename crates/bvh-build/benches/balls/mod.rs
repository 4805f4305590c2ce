//! Bumpy balls at random, their rays, and the comparison of two ways to trace them.

use bvh_build::{Builder, muller_fellner};
use bvh_core::{Aabb, Ray, Triangle, WideBvh, boxes};
use glam::{Affine3A, Quat, Vec3};
use std::time::Instant;

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

/// Returns transforms to a grid with this distance between neighbours, with random turns and sizes.
pub fn transforms(copies: usize, distance: f32) -> Vec<Affine3A> {
    let mut random = Random(1);
    let side = (copies as f32).cbrt().ceil() as usize;
    let mut transforms = Vec::with_capacity(copies);
    for i in 0..copies {
        let cell = [i % side, i / side % side, i / side / side].map(|i| i as f32);
        let shift = (Vec3::from(cell) + 0.3 * random.point()) * distance;
        let turn = Quat::from_axis_angle(random.point().normalize(), 6.0 * random.unit());
        let scale = Vec3::splat(0.7 + 0.6 * random.unit());
        transforms.push(Affine3A::from_scale_rotation_translation(scale, turn, shift));
    }
    transforms
}

/// Returns a copy of the triangles for each transform.
pub fn copied(triangles: &[Triangle], transforms: &[Affine3A]) -> Vec<Triangle> {
    let mut copies = Vec::with_capacity(transforms.len() * triangles.len());
    for transform in transforms {
        for triangle in triangles {
            copies.push(triangle.transformed(transform));
        }
    }
    copies
}

/// Returns the rays of a camera in front of the scene, in tiles of eight by eight pixels.
pub fn camera(bounds: &Aabb) -> Vec<Ray> {
    let extent = bounds.max - bounds.min;
    let eye = bounds.min + extent * Vec3::new(0.4, 0.6, -0.3);
    let mut rays = Vec::new();
    for i in 0..PIXELS * PIXELS {
        let tile = i / 64;
        let x = 8 * (tile % (PIXELS / 8)) + i % 8;
        let y = 8 * (tile / (PIXELS / 8)) + i / 8 % 8;
        let at = Vec3::new(x as f32, y as f32, 0.0) / PIXELS as f32;
        rays.push(Ray::half_line(eye, bounds.min + extent * at - eye).expect("a direction"));
    }
    rays
}

/// Returns rays from one point of the scene through another.
pub fn random(bounds: &Aabb) -> Vec<Ray> {
    let mut random = Random(2);
    let extent = bounds.max - bounds.min;
    let mut rays = Vec::new();
    for _ in 0..PIXELS * PIXELS / 2 {
        let from = bounds.min + extent * (0.5 + 0.5 * random.point());
        let to = bounds.min + extent * (0.5 + 0.5 * random.point());
        rays.push(Ray::half_line(from, to - from).expect("a direction"));
    }
    rays
}

/// Prints the head of a table of comparisons.
pub fn print_head(first: &str, second: &str) {
    println!("{:<38} {:>14} {:>14} {:>8}", "scene and rays", first, second, "ratio");
}

/// Runs both in turns, and prints millions of rays per second and the median of the ratios of
/// speeds.
pub fn compare(name: &str, rays: usize, mut first: impl FnMut(), mut second: impl FnMut()) {
    let mut speeds = [const { Vec::new() }; 3];
    for round in 0..=ROUNDS {
        let start = Instant::now();
        first();
        let middle = Instant::now();
        second();
        let second = middle.elapsed().as_secs_f64();
        let first = (middle - start).as_secs_f64();
        // The first round warms the caches.
        if round > 0 {
            speeds[0].push(rays as f64 / first * 1e-6);
            speeds[1].push(rays as f64 / second * 1e-6);
            speeds[2].push(first / second);
        }
    }
    let [first, second, ratio] = speeds.map(|mut values| {
        values.sort_by(f64::total_cmp);
        values[ROUNDS / 2]
    });
    println!("{name:<38} {first:>14.2} {second:>14.2} {ratio:>8.3}");
}

/// Returns the layout of the tree by Müller–Fellner.
pub fn layout(triangles: &[Triangle]) -> WideBvh {
    let tree = muller_fellner::Config::default().build(&boxes(triangles)).expect("finite boxes");
    WideBvh::new(&tree, triangles).expect("a tree over the triangles")
}

/// Returns an octahedron whose faces are divided into four as often as `levels` says, pushed to a
/// sphere of about radius 1 with bumps.
pub fn ball(levels: usize) -> Vec<Triangle> {
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
    triangles.into_iter().map(|corners| Triangle(corners.map(bumpy))).collect()
}
