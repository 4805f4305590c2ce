//! Compares every traversal with testing every triangle, and makes difficult rays.

use crate::Verdict;
use anyhow::{Result, bail, ensure};
use bvh_build::{Builder, goldsmith_salmon, median_cut, muller_fellner};
use bvh_core::{
    Aabb, Bvh, Hit, Kernel, Primitives, Ray, Triangle, WideBvh, collapse_leaves, cost::SahConstants,
};
use bvh_scenes::trace::{Accelerator, KdTree, Structure};
use bvh_search::Stream;
use glam::Vec3;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use std::borrow::Cow;

/// Prepares objects for rays in one or several ways, or returns the reason why it cannot.
pub type Traversal = fn(&Primitives) -> Result<Vec<Accelerator<'_>>>;

/// Every traversal by name. Adding a traversal takes one line.
pub const TRAVERSALS: &[(&str, Traversal)] = &[
    ("binary tree", over_binary_trees),
    ("n-ary tree", |objects| {
        let tree = build(objects, &goldsmith_salmon::Config::default())?;
        Ok(vec![Accelerator::new(objects, Structure::Tree(Cow::Owned(tree)))])
    }),
    ("wide, SIMD", |objects| over_wide_layouts(objects, Structure::Wide)),
    ("wide, portable", |objects| over_wide_layouts(objects, Structure::WidePortable)),
    ("KD-tree", |objects| {
        let cells = KdTree::build(&objects.boxes())?;
        Ok(vec![Accelerator::new(objects, Structure::KdTree(cells))])
    }),
];

fn build(objects: &Primitives, builder: &dyn Builder) -> Result<Bvh> {
    Ok(builder.build(&objects.boxes())?)
}

/// Prepares trees with one object per leaf, with leaves merged by the surface area heuristic, and
/// with a tenth of all objects in every leaf.
fn over_binary_trees(objects: &Primitives) -> Result<Vec<Accelerator<'_>>> {
    let greedy = build(objects, &muller_fellner::Config::default())?;
    let merged = collapse_leaves(&greedy, &SahConstants::default());
    let tenths = median_cut::Config { leaf_fraction: 0.1, ..Default::default() };
    let trees = [greedy, merged, build(objects, &tenths)?];
    Ok(trees.map(|tree| Accelerator::new(objects, Structure::Tree(Cow::Owned(tree)))).into())
}

fn over_wide_layouts(
    objects: &Primitives,
    structure: fn(WideBvh) -> Structure<'static>,
) -> Result<Vec<Accelerator<'_>>> {
    let Primitives::Triangles(triangles) = objects else {
        bail!("only triangles have a wide layout");
    };
    let layouts = wide_layouts(triangles)?.into_iter();
    Ok(layouts.map(|(_, wide)| Accelerator::new(objects, structure(wide))).collect())
}

/// Lays out a binary tree and a tree with many children per node for every kernel of this
/// processor.
pub fn wide_layouts(triangles: &[Triangle]) -> Result<Vec<(Kernel, WideBvh)>> {
    let boxes: Vec<Aabb> = triangles.iter().map(Triangle::aabb).collect();
    let builders: [&dyn Builder; 2] =
        [&muller_fellner::Config::default(), &goldsmith_salmon::Config::default()];
    let mut layouts = Vec::new();
    for builder in builders {
        let tree = builder.build(&boxes)?;
        let wide = WideBvh::new(&tree, triangles)?;
        for kernel in Kernel::ALL {
            // The processor may lack the kernel's instructions.
            if let Some(wide) = wide.clone().with_kernel(kernel) {
                layouts.push((kernel, wide));
            }
        }
    }
    Ok(layouts)
}

/// Returns the bits of an answer, for exact comparison.
pub fn bits(hit: Option<Hit>) -> Option<(u32, u32)> {
    hit.map(|hit| (hit.t.to_bits(), hit.object))
}

/// Checks both kinds of answers to a ray, bit by bit, against that of testing every object.
pub fn compare(ray: &Ray, nearest: Option<Hit>, any: bool, expected: Option<Hit>) -> Result<()> {
    let same = bits(nearest) == bits(expected) && any == expected.is_some();
    ensure!(same, "P3: {ray:?} gives {nearest:?} and {any}, testing every object {expected:?}");
    Ok(())
}

/// Checks P3: for all rays the traversal gives the answers of testing every object, bit by bit. The
/// note reports the number of hits.
pub fn check(traversal: Traversal, objects: &Primitives, rays: &[Ray]) -> Verdict {
    let accelerators = traversal(objects)?;
    let brute_force = Accelerator::new(objects, Structure::Brute);
    let mut hits = 0;
    for ray in rays {
        let expected = brute_force.nearest_hit(ray);
        hits += usize::from(expected.is_some());
        for accelerator in &accelerators {
            compare(ray, accelerator.nearest_hit(ray), accelerator.any_hit(ray), expected)?;
        }
    }
    Ok(format!("{hits} of {} rays hit", rays.len()))
}

/// Returns rays for a scene of any scale: random ones; towards corners, edges and centres; along
/// axes with zeros of both signs; in the planes of faces of boxes; from inside and from corners;
/// over short, empty and single-point ranges.
pub fn rays(triangles: &[Triangle], count: usize, seed: u64) -> Vec<Ray> {
    let mut rng = Stream::seed_from_u64(seed);
    let bounds = triangles.iter().fold(Aabb::EMPTY, |b, t| b.union(&t.aabb()));
    // An empty scene has no bounds, and rays are needed all the same.
    let bounds = if bounds.check().is_ok() { bounds } else { Aabb::from(([0.0; 3], [1.0; 3])) };
    let mut rays = Vec::with_capacity(count);
    // Many attempts are no valid rays; the limit ends scenes that allow none.
    for attempt in 0..20 * count {
        if rays.len() == count {
            break;
        }
        let mut unit = || Vec3::from([(); 3].map(|()| rng.random::<f32>()));
        // A weighted sum of the corners cannot overflow; their difference could.
        let inside = |at: Vec3| bounds.min * (1.0 - at) + bounds.max * at;
        let somewhere = inside(unit());
        let elsewhere = inside(unit());
        let direction = unit() * 2.0 - 1.0;
        let Triangle([a, b, c]) =
            triangles.choose(&mut rng).copied().unwrap_or(Triangle([somewhere; 3]));
        // All six directions occur, so that no axis or sign is favoured.
        let along = [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z][attempt / 8 % 6];
        let beside =
            |target: Vec3| target - along * (bounds.extent().max_element() as f32).min(1e38);
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
        // Very long and very short directions are rejected, so a third of them are normalised.
        let length = direction.abs().max_element();
        let scaled = if length > 0.0 { direction / length } else { direction };
        rays.extend(Ray::new(
            origin,
            if attempt % 3 == 0 { scaled } else { direction },
            t_min,
            t_max,
        ));
    }
    rays
}
