//! Compares every traversal with testing every triangle, and makes difficult rays.

use anyhow::{Result, bail, ensure};
use bvh_build::{Builder, goldsmith_salmon, median_cut, muller_fellner};
use bvh_core::{
    Aabb, Bvh, Coherence, Hit, Kernel, Primitives, Ray, Triangle, WideBvh, collapse_leaves,
    cost::SahConstants,
};
use bvh_scenes::trace::{Accelerator, KdTree, Structure};
use bvh_search::Stream;
use glam::Vec3;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use std::borrow::Cow;

/// Answers rays: the nearest hit of each, and whether there is any.
pub type Answers<'a> = Box<dyn Fn(&[Ray]) -> Vec<(Option<Hit>, bool)> + 'a>;

/// Prepares objects for rays in several ways, each with its name, or returns the reason why it
/// cannot.
pub type Traversal = fn(&Primitives) -> Result<Vec<(String, Answers<'_>)>>;

/// Every traversal by name.
pub const TRAVERSALS: &[(&str, Traversal)] = &[
    ("binary tree", over_binary_trees),
    ("n-ary tree", |objects| {
        let tree = build(objects, &goldsmith_salmon::Config::default())?;
        Ok(vec![singly("whole", objects, Structure::Tree(Cow::Owned(tree)))])
    }),
    ("wide, SIMD", by_every_kernel),
    ("wide, portable", |objects| {
        let portable = |wide| singly("portable", objects, Structure::WidePortable(wide));
        Ok(wide_layouts(objects)?.map(portable).into())
    }),
    ("KD-tree", |objects| {
        let cells = KdTree::build(&objects.boxes())?;
        Ok(vec![singly("cells", objects, Structure::KdTree(cells))])
    }),
];

fn build(objects: &Primitives, builder: &dyn Builder) -> Result<Bvh> {
    Ok(builder.build(&objects.boxes())?)
}

/// Prepares trees with one object per leaf, with leaves merged by the surface area heuristic, and
/// with a tenth of all objects in every leaf.
fn over_binary_trees(objects: &Primitives) -> Result<Vec<(String, Answers<'_>)>> {
    let greedy = build(objects, &muller_fellner::Config::default())?;
    let merged = collapse_leaves(&greedy, &SahConstants::default());
    let tenths = median_cut::Config { leaf_fraction: 0.1, ..Default::default() };
    let trees =
        [greedy, merged, build(objects, &tenths)?].into_iter().zip(["one", "merged", "tenths"]);
    Ok(trees.map(|(tree, name)| singly(name, objects, Structure::Tree(Cow::Owned(tree)))).collect())
}

/// Lays out a binary tree and a tree with many children per node.
fn wide_layouts(objects: &Primitives) -> Result<[WideBvh; 2]> {
    let Primitives::Triangles(triangles) = objects else {
        bail!("only triangles have a wide layout");
    };
    let binary = build(objects, &muller_fellner::Config::default())?;
    let wide = build(objects, &goldsmith_salmon::Config::default())?;
    Ok([WideBvh::new(&binary, triangles)?, WideBvh::new(&wide, triangles)?])
}

/// Answers rays by every kernel of this processor, ray by ray and together, with both hints.
pub fn by_every_kernel(objects: &Primitives) -> Result<Vec<(String, Answers<'_>)>> {
    let mut answers = Vec::new();
    for wide in wide_layouts(objects)? {
        for kernel in Kernel::ALL {
            // The processor may lack the kernel's instructions.
            let Some(wide) = wide.clone().with_kernel(kernel) else { continue };
            for coherence in [Coherence::Coherent, Coherence::Incoherent] {
                let wide = wide.clone();
                let answer: Answers = Box::new(move |rays| together(&wide, rays, coherence));
                answers.push((format!("{kernel:?}, {coherence:?}"), answer));
            }
            answers.push(singly(&format!("{kernel:?}"), objects, Structure::Wide(wide)));
        }
    }
    Ok(answers)
}

fn singly<'a>(
    name: &str,
    objects: &'a Primitives,
    structure: Structure<'a>,
) -> (String, Answers<'a>) {
    let accelerator = Accelerator::new(objects, structure);
    let answer = move |ray: &Ray| (accelerator.nearest_hit(ray), accelerator.any_hit(ray));
    (name.to_owned(), Box::new(move |rays| rays.iter().map(&answer).collect()))
}

fn together(wide: &WideBvh, rays: &[Ray], coherence: Coherence) -> Vec<(Option<Hit>, bool)> {
    let mut nearest = vec![Hit::MISS; rays.len()];
    let mut any = vec![false; rays.len()];
    wide.nearest_hits(rays, &mut nearest, coherence);
    wide.any_hits(rays, &mut any, coherence);
    nearest.into_iter().map(|hit| (!hit.is_miss()).then_some(hit)).zip(any).collect()
}

/// Returns the bits of an answer, for exact comparison.
pub fn bits(hit: Option<Hit>) -> Option<(u32, u32)> {
    hit.map(|hit| (hit.t.to_bits(), hit.object))
}

/// Checks P3: for all rays the traversal gives the answers of testing every object, bit by bit.
/// Returns the number of rays that hit.
pub fn check(traversal: Traversal, objects: &Primitives, rays: &[Ray]) -> Result<usize> {
    let (_, brute_force) = singly("", objects, Structure::Brute);
    let expected = brute_force(rays);
    let ways = traversal(objects)?;
    ensure!(!ways.is_empty(), "P3: no way to answer rays");
    for (way, answers) in ways {
        let answers = answers(rays);
        for ((ray, (nearest, any)), (hit, is_hit)) in rays.iter().zip(answers).zip(&expected) {
            ensure!(
                bits(nearest) == bits(*hit) && any == *is_hit,
                "P3: {way}: {ray:?} gives {nearest:?} and {any}, testing every object {hit:?}"
            );
        }
    }
    Ok(expected.iter().filter(|(hit, _)| hit.is_some()).count())
}

/// Returns rays for a scene of any scale: random ones; towards corners, edges and centres; along
/// axes with zeros of both signs; in the planes of faces of boxes; from inside and from corners;
/// over short, empty and single-point ranges.
///
/// # Panics
///
/// If the scene allows fewer rays than `count`.
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
    // A scene that allows fewer rays would be tested less than the others without notice.
    assert_eq!(rays.len(), count, "too few rays");
    rays
}
