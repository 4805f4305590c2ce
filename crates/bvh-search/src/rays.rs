//! Trees for the rays of one program: record segments, search, trace the next ones.

use crate::SearchError;
#[cfg(feature = "std")]
use crate::{Budget, Deadline, Outcome, Problem, best, solve};
#[cfg(feature = "std")]
use bvh_core::cost::{Measure, Objective};
use bvh_core::{Aabb, DensityError, RayDensity, Segment};
#[cfg(feature = "std")]
use std::time::Duration;

/// The share of area in the measure of a box. Without it, a box that no recorded ray enters would be
/// free; with it, other rays lose little.
const AREA_WEIGHT: f64 = 0.1;

/// The reason why no tree was found.
#[derive(Debug, thiserror::Error)]
pub enum FindError {
    /// The search failed.
    #[error(transparent)]
    Search(#[from] SearchError),
    /// The rays are invalid.
    #[error("rays: {0}")]
    Rays(#[from] DensityError),
}

/// Returns the best tree over `boxes` that [`best`](crate::best) finds in about `time` for rays like
/// the recorded `segments`, and their density. The segments begin where rays began and end at their
/// hits or outside the scene. Of more than [`RayDensity::MOST_SEGMENTS`] segments, every n-th counts.
///
/// The tree is best for its rays; other rays may take longer than with a tree from
/// [`bake`](crate::bake). The layout for the same rays is
/// `WideBvh::for_rays(&tree, &triangles, &density.visits(&tree))`.
///
/// ```
/// use bvh_search::prelude::*;
/// let triangles: Vec<Triangle> = (0..50u8)
///     .map(|i| Triangle::from([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]].map(|c| c.map(|x| x * f32::from(i + 1)))))
///     .collect();
/// // Yesterday's frame: rays from a camera to their hits.
/// let segments: Vec<Segment> = (0..100u8)
///     .map(|i| Segment { from: [0.5, 0.5, -9.0], to: [f32::from(i) / 9.0, 0.5, 1.0] })
///     .collect();
/// let (outcome, density) = bake_for_rays(&boxes(&triangles), &segments, Duration::from_millis(10))?;
/// let wide = WideBvh::for_rays(&outcome.tree, &triangles, &density.visits(&outcome.tree))?;
/// assert!(wide.any_hit(&Ray::half_line([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])?));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[cfg(feature = "std")]
pub fn bake_for_rays(
    boxes: &[Aabb],
    segments: &[Segment],
    time: Duration,
) -> Result<(Outcome, RayDensity), FindError> {
    let deadline = Deadline::after(time);
    let density = ray_density(boxes, segments)?;
    let problem = Problem {
        objective: Objective::Layout,
        measure: Some(&density as &dyn Measure),
        ..Problem::new(boxes)
    };
    let config = best::Config::default();
    let outcome = solve(&config, &problem, 1, Budget::UNLIMITED, &deadline)?;
    Ok((outcome, density))
}

/// Returns the density of segments between surfaces of the boxes, with a tenth of area. Of more than
/// [`RayDensity::MOST_SEGMENTS`] segments, every n-th counts.
pub fn ray_density(boxes: &[Aabb], segments: &[Segment]) -> Result<RayDensity, DensityError> {
    let bounds = boxes
        .iter()
        .fold(Aabb::EMPTY, |bounds, aabb| bounds.union(aabb));
    let step = segments
        .len()
        .div_ceil(RayDensity::MOST_SEGMENTS)
        .max(1);
    if step == 1 {
        return RayDensity::of_rays(&bounds, segments, AREA_WEIGHT);
    }
    let sampled: Vec<Segment> = segments.iter().step_by(step).copied().collect();
    RayDensity::of_rays(&bounds, &sampled, AREA_WEIGHT)
}
