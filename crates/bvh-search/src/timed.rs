//! The everyday calls: the best tree for a given time, with every parameter at its default.

use crate::{Bake, BakeError, Budget, Choice, Deadline, Open, Outcome, SearchError, ray_density};
use bvh_core::{Aabb, Bvh, InFrame, Primitives, RayDensity, Segment, Triangle};
use std::time::Duration;

/// Returns the best tree over `boxes` that [`best`](crate::best) finds in about `time`, from the
/// milliseconds of a build to the minutes of a bake. The search plans with the time, so one call
/// for a second finds a better tree than ten calls for a tenth. The search ends earlier if it
/// proves its tree optimal, and later if the time is not enough for the fastest build.
///
/// [`Bake`] has everything else: progress, cancellation, seeds, divided objects, other searches,
/// and limits in work instead of time, which give the same result on every machine.
///
/// ```
/// use bvh_search::prelude::*;
/// let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(|x| Aabb::from([[x; 3], [x + 1.5; 3]])).collect();
/// let tree = bake(&boxes, Duration::from_millis(10))?.tree;
/// validate(&tree, &boxes)?;
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn bake(boxes: &[Aabb], time: Duration) -> Result<Outcome, SearchError> {
    Ok(Bake::new(boxes).search(None, &Deadline::after(time))?.outcome)
}

/// Improves a tree over `boxes` for about `time`: a tree from another library, or one that has been
/// [refitted](Bvh::refit) to objects that moved. The growth of the tree's
/// [internal area](bvh_core::cost::internal_area) over the root's area, or of
/// [`WideBvh::expected_visits`](bvh_core::WideBvh::expected_visits), measures how far refitting has
/// degraded the tree. Accepts the same trees as [`optimize`](crate::optimize()).
///
/// ```
/// use bvh_search::prelude::*;
/// let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(|x| Aabb::from([[x; 3], [x + 1.5; 3]])).collect();
/// let greedy = muller_fellner::Config::default().build(&boxes)?;
/// let better = improve(&greedy, &boxes, Duration::from_millis(10))?.tree;
/// assert!(cost::internal_area(&better) <= cost::internal_area(&greedy));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn improve(tree: &Bvh, boxes: &[Aabb], time: Duration) -> Result<Outcome, SearchError> {
    let bake = Bake { start: Some(tree), ..Bake::new(boxes) };
    Ok(bake.search(None, &Deadline::after(time))?.outcome)
}

/// Returns the best tree over `triangles` that [`best`](crate::best) finds in about `time` for rays
/// like the recorded `segments`, and the density of these rays as by
/// [`ray_density`](crate::ray_density).
///
/// The boxes of the tree may lie in a [frame](Bvh::frame). The tree is best for its rays; other rays
/// may take longer than with a tree from [`bake`]. The layout for the same rays is
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
/// let (outcome, density) = bake_for_rays(&triangles, &segments, Duration::from_millis(10))?;
/// let wide = WideBvh::for_rays(&outcome.tree, &triangles, &density.visits(&outcome.tree))?;
/// assert!(wide.any_hit(&Ray::half_line([0.2, 0.2, 0.0], [0.0, 0.0, 1.0])?));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn bake_for_rays(
    triangles: &[Triangle],
    segments: &[Segment],
    time: Duration,
) -> Result<(Outcome, RayDensity), BakeError> {
    let deadline = Deadline::after(time);
    let Choice { frame, .. } = Choice::of(triangles, Budget::UNLIMITED, &deadline);
    let frame = frame.as_ref();
    let boxes = InFrame { triangles, frame }.boxes();
    let shapes = Primitives::Triangles(triangles.to_vec());
    let bake = Bake { frame, shapes: Some(&shapes), ..Bake::new(&boxes) };
    let rays = |tree: &_, _, is_over: &dyn Fn() -> bool| {
        ray_density(tree, Some(&shapes), segments, is_over)
    };
    let mut chosen =
        bake.choose(&Open { rays: Some(&rays), ..Open::default() }, None, &deadline)?;
    let greedy = chosen.greedy.take();
    let outcome = chosen.bake(&bake).search(greedy, &deadline)?.outcome;
    Ok((outcome, chosen.density.expect("the density of rays that nobody cancels")))
}
