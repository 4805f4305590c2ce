//! Scenes and trees for the unit tests of searches.

use crate::run::{Found, Observer, Problem, Run, Search};
use crate::tree::{HalfArea, Working};
use bvh_build::Builder;
use bvh_config::Check;
use bvh_core::{Aabb, Bvh, RayDensity, Segment};

/// Returns a reproducible scatter of `n` small boxes.
pub(crate) fn scatter(n: u32) -> Vec<Aabb> {
    let hash =
        |i: u32, salt: u32| (i.wrapping_mul(2_654_435_761).rotate_left(salt) % 65_521) as f32;
    (0..n)
        .map(|i| {
            let low = [hash(i, 3), hash(i, 11), hash(i, 19)];
            Aabb::from((low, low.map(|c| c + hash(i, 27) / 32.0)))
        })
        .collect()
}

/// Builds the working form of a binary tree over finite boxes.
pub(crate) fn built(builder: &dyn Builder, boxes: &[Aabb]) -> Working {
    let tree = builder.build(boxes).unwrap();
    Working::from_bvh(&tree, HalfArea::default()).unwrap()
}

/// Returns the density of rays from a corner of the scene to the corners of all objects; `None` if
/// the scene has no extent.
pub(crate) fn density(boxes: &[Aabb]) -> Option<RayDensity> {
    let bounds = Aabb::union_of(boxes);
    let to = boxes.iter().flat_map(|aabb| [aabb.min, aabb.max]);
    let segments = to.map(|to| Segment { from: bounds.min.to_array(), to: to.to_array() });
    RayDensity::of_rays(&bounds, &segments.collect::<Vec<_>>(), 0.1).ok()
}

/// A search that is a function.
pub(crate) struct Does<F>(pub F);

impl<F> Check for Does<F> {}

impl<F: Fn(&mut Run) -> Bvh> Search for Does<F> {
    fn search(&self, _: &Problem, _: u64, run: &mut Run) -> Found {
        Ok(self.0(run))
    }
}

/// A clock that stands still.
pub(crate) struct At(pub f64);

impl Observer for At {
    fn progress(&self) -> Option<f64> {
        Some(self.0)
    }
}
