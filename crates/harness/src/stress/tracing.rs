//! Every traversal against testing every triangle, and the rays that make it hard.

use super::Verdict;
use bvh_build::{BuildError, Builder, goldsmith_salmon, kd_tree, muller_fellner};
use bvh_core::{Aabb, Bvh, Hit, Ray, Shear, Triangle, WideBvh, any_hit, nearest_hit, nearest_hit_of_all};
use bvh_search::Stream;
use glam::Vec3;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};

/// Answers rays: the nearest hit, and whether there is any.
pub type Tracer = Box<dyn Fn(&Ray) -> (Option<Hit>, bool)>;

/// What prepares a scene for rays; or why it cannot.
pub type Traversal = fn(&[Triangle]) -> Result<Tracer, String>;

/// Every traversal by name: a further one is one line.
pub const TRAVERSALS: &[(&str, Traversal)] = &[
    ("binary tree", |scene| over_tree(scene, &muller_fellner::Config::default())),
    ("n-ary tree", |scene| over_tree(scene, &goldsmith_salmon::Config::default())),
    ("wide, SIMD", |scene| wide(scene, |wide, ray| (wide.nearest_hit(ray), wide.any_hit(ray)))),
    ("wide, portable", |scene| {
        wide(scene, |wide, ray| (wide.view().nearest_hit_portable(ray), wide.view().any_hit_portable(ray)))
    }),
    ("KD-tree", over_cells),
];

fn build(scene: &[Triangle], builder: &dyn Builder) -> Result<Bvh, String> {
    builder.build(&super::scenes::boxes(scene)).map_err(|error: BuildError| error.to_string())
}

fn over_tree(scene: &[Triangle], builder: &dyn Builder) -> Result<Tracer, String> {
    let (tree, triangles) = (build(scene, builder)?, scene.to_vec());
    Ok(Box::new(move |ray| {
        let shear = Shear::new(ray);
        let test = |id: u32, t_max| triangles[id as usize].intersect(&shear, t_max);
        let any = any_hit(&tree, ray, |id| test(id, ray.t_max()).is_some(), &mut ());
        (nearest_hit(&tree, ray, test, &mut ()), any)
    }))
}

fn over_cells(scene: &[Triangle]) -> Result<Tracer, String> {
    let cells =
        kd_tree::Config::default().build(&super::scenes::boxes(scene)).map_err(|error| error.to_string())?;
    let triangles = scene.to_vec();
    Ok(Box::new(move |ray| {
        let shear = Shear::new(ray);
        let test = |id: u32, t_max| triangles[id as usize].intersect(&shear, t_max);
        let any = cells.any_hit(ray, |id| test(id, ray.t_max()).is_some(), &mut ());
        (cells.nearest_hit(ray, test, &mut ()), any)
    }))
}

fn wide(scene: &[Triangle], answer: fn(&WideBvh, &Ray) -> (Option<Hit>, bool)) -> Result<Tracer, String> {
    // From binary trees and from ones with many children.
    let layouts = [
        build(scene, &muller_fellner::Config::default())?,
        build(scene, &goldsmith_salmon::Config::default())?,
    ]
    .map(|tree| WideBvh::new(&tree, scene).map_err(|error| error.to_string()));
    let [binary, n_ary] = layouts;
    let (binary, n_ary) = (binary?, n_ary?);
    Ok(Box::new(move |ray| {
        let (one, other) = (answer(&binary, ray), answer(&n_ary, ray));
        // Two layouts that disagree: one of them differs from brute force.
        if bits(one.0) == bits(other.0) { (one.0, one.1 && other.1) } else { (None, !one.1) }
    }))
}

/// The answer of testing every triangle.
pub fn brute_force(triangles: &[Triangle], ray: &Ray) -> Option<Hit> {
    let shear = Shear::new(ray);
    let test = |id: u32, t_max| triangles[id as usize].intersect(&shear, t_max);
    nearest_hit_of_all(triangles.len() as u32, ray, test, &mut ())
}

fn bits(hit: Option<Hit>) -> Option<(u32, u32)> {
    hit.map(|hit| (hit.t.to_bits(), hit.object))
}

/// P3: the traversal gives the answer of brute force for all rays, bit by bit. Says how many hit.
pub fn check(traversal: Traversal, triangles: &[Triangle], rays: &[Ray]) -> Verdict {
    let trace = traversal(triangles)?;
    let mut hits = 0;
    for ray in rays {
        let expected = brute_force(triangles, ray);
        hits += usize::from(expected.is_some());
        let (nearest, any) = trace(ray);
        if bits(nearest) != bits(expected) || any != expected.is_some() {
            return Err(format!("P3: {ray:?} gives {nearest:?} and {any}, every triangle {expected:?}"));
        }
    }
    Ok(format!("{hits} of {} rays hit", rays.len()))
}

/// Rays at a scene of any scale: at random, towards corners, edges and centres, along axes with zeros of both signs, in
/// the planes of faces of boxes, from inside, from corners, and over short, empty and single-point ranges.
pub fn rays(triangles: &[Triangle], count: usize, seed: u64) -> Vec<Ray> {
    let mut rng = Stream::seed_from_u64(seed);
    let bounds = triangles.iter().fold(Aabb::EMPTY, |b, t| b.union(&t.aabb()));
    let bounds = if bounds.check().is_ok() { bounds } else { Aabb::from(([0.0; 3], [1.0; 3])) };
    let mut rays = Vec::with_capacity(count);
    for attempt in 0..20 * count {
        if rays.len() == count {
            break;
        }
        let mut unit = || Vec3::from([(); 3].map(|()| rng.random::<f32>()));
        // Weighted, so that nothing overflows.
        let inside = |at: Vec3| bounds.min * (1.0 - at) + bounds.max * at;
        let (somewhere, elsewhere, direction) = (inside(unit()), inside(unit()), unit() * 2.0 - 1.0);
        let Triangle([a, b, c]) = triangles.choose(&mut rng).copied().unwrap_or(Triangle([somewhere; 3]));
        let along = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z][attempt / 8 % 6];
        let beside = |target: Vec3| target - along * (bounds.extent().max_element() as f32).min(1e38);
        let (origin, direction) = match attempt % 8 {
            0 => (somewhere, direction),
            1 => (somewhere, elsewhere - somewhere),
            2 => (somewhere, a - somewhere),
            3 => (somewhere, a / 2.0 + b / 2.0 - somewhere),
            4 => (beside(a / 3.0 + b / 3.0 + c / 3.0), along),
            5 => (beside(a), along * Vec3::new(1.0, -1.0, 1.0)),
            6 => (a, b - a),
            _ => (bounds.min, bounds.max / 2.0 - bounds.min / 2.0),
        };
        let distance = rng.random::<f32>() * 2.0;
        let (t_min, t_max) = match attempt / 16 % 5 {
            0 => (0.0, f32::INFINITY),
            1 => (0.0, distance),
            2 => (distance / 2.0, distance),
            3 if attempt % 2 == 0 => (1.0, 1.0),
            3 => (1.0, 0.5),
            _ => (0.0, f32::MAX),
        };
        // Any length will do, but not every one is accepted.
        let length = direction.abs().max_element();
        let scaled = if length > 0.0 { direction / length } else { direction };
        rays.extend(Ray::new(origin, if attempt % 3 == 0 { scaled } else { direction }, t_min, t_max));
    }
    rays
}
