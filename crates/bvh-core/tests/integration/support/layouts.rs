//! Layouts of several trees by every kernel, and rays that packets are made for.

use super::{Random, SHAPES, boxes, chain, tree};
use crate::references::divided;
use bvh_core::{Bvh, Kernel, Ray, Triangle, WideBvh, collapse_leaves, cost::SahConstants};
use glam::Vec3;

/// Returns a layout of the triangles by a tree of one of the shapes.
pub fn layout(triangles: &[Triangle], shape: usize) -> WideBvh {
    let tree = tree(&boxes(triangles), SHAPES[shape], &mut Random(5));
    WideBvh::new(&tree, triangles).unwrap()
}

/// Returns the layout for every kernel that this processor has.
pub fn by_kernel(wide: &WideBvh) -> Vec<(Kernel, WideBvh)> {
    let of = |kernel| Some((kernel, wide.clone().with_kernel(kernel)?));
    Kernel::ALL.into_iter().filter_map(of).collect()
}

/// A tree, and its layout for every kernel.
pub struct Traced {
    pub tree: Bvh,
    pub layouts: Vec<(Kernel, WideBvh)>,
}

impl Traced {
    pub fn new(tree: Bvh, triangles: &[Triangle]) -> Self {
        Self { layouts: by_kernel(&WideBvh::new(&tree, triangles).unwrap()), tree }
    }

    /// Makes trees of all shapes, the deepest one, trees of larger leaves, and trees of divided
    /// triangles.
    pub fn all(triangles: &[Triangle], random: &mut Random) -> Vec<Self> {
        Self::all_and_planes(triangles, random).0
    }

    /// Returns the same, and the planes that divide triangles.
    pub fn all_and_planes(
        triangles: &[Triangle],
        random: &mut Random,
    ) -> (Vec<Self>, Vec<(u32, usize, f32)>) {
        let boxes = boxes(triangles);
        let mut trees: Vec<Bvh> = SHAPES.iter().map(|&shape| tree(&boxes, shape, random)).collect();
        let (parts, planes) = divided(&trees[0], triangles, &mut Random(9));
        let merged =
            [&trees[0], &parts].map(|tree| collapse_leaves(tree, &SahConstants::default()));
        trees.extend(merged);
        trees.extend([parts, chain(&boxes)]);
        (trees.into_iter().map(|tree| Self::new(tree, triangles)).collect(), planes)
    }
}

/// Returns groups of sixteen rays that begin close to each other and run nearly in the same
/// direction, towards and beyond an edge or a corner of some triangle: the rays that packets are
/// made for, in the hardest places.
pub fn bundles(triangles: &[Triangle], count: usize, random: &mut Random) -> Vec<Ray> {
    let mut rays = Vec::new();
    for _ in 0..count {
        let Triangle([a, b, c]) = random.of(triangles);
        let size = triangles
            .iter()
            .flat_map(|t| t.0)
            .fold(0.0f32, |size, p| size.max(p.abs().max_element()));
        let target = random.of(&[a, (a + b) * 0.5, (a + b + c) / 3.0]);
        let far = random.point() * 3.0;
        let inside = random.point();
        let close = target + random.point() * size * 1e-3;
        let origin = random.of(&[far * size, inside * size, close]);
        let spread = random.of(&[0.0, 1e-7, 1e-3, 0.1]);
        let shift = random.of(&[0.0, 1e-7, 1e-2]);
        for _ in 0..16 {
            let from = origin + random.point() * (shift * size);
            let mut to = target + random.point() * (spread * size) - from;
            if random.below(8) == 0 {
                to[random.below(3)] = 0.0;
            }
            let to = to / size.max(f32::MIN_POSITIVE);
            let (t_min, t_max) = random.of(&[
                (0.0, f32::MAX),
                (0.0, size),
                (size, size),
                (0.5 * size, f32::INFINITY),
            ]);
            rays.push(
                Ray::new(from, to, t_min, t_max).unwrap_or(Ray::half_line(from, Vec3::X).unwrap()),
            );
        }
    }
    rays
}
