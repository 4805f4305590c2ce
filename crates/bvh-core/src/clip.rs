//! Parts of objects. If an object is divided among several leaves, each leaf has a *reference* to
//! it and a box around a part of it.
//!
//! A long thin triangle fills little of its box, and no tree over full boxes can change that. A
//! tree with split references (Stich, Friedrich & Dietrich 2009) refers to the triangle in several
//! leaves, and the boxes of these leaves together cover the triangle:
//!
//! ```text
//!   one leaf            three leaves
//!   ┌──────────────┐    ┌────┐
//!   │ ▚▖           │    │ ▚▖ └───┐
//!   │   ▝▚▖        │    └──┐▝▚▖  └────┐
//!   │      ▝▚▖     │       └────┐▝▚▖  │
//!   │         ▝▚▖  │            └─────┘
//!   └──────────────┘
//! ```
//!
//! Builders and searches see only boxes. [`Clip`] tells them how large the part of an object in a
//! region is.

use crate::aabb::{round_down, round_up};
use crate::each::Each;
use crate::{Aabb, Corners, Frame, InFrame, Primitives, Sphere, Triangle};
use core::fmt::Debug;
use glam::DVec3;
use smallvec::SmallVec;

/// Objects whose parts have boxes.
pub trait Clip: Debug + Sync {
    /// Returns a box around everything of the object that is in `region`, or [`Aabb::EMPTY`] if
    /// nothing is; computed corners are moved outwards by `slack` bounds of their error, at least 1.
    /// The returned box is inside `region` and inside the object's box. If `region` is the object's
    /// box, the returned box equals it.
    fn part(&self, object: u32, region: &Aabb, slack: f64) -> Aabb;

    /// Returns the [part](Self::part) for builders.
    fn clip(&self, object: u32, region: &Aabb) -> Aabb {
        self.part(object, region, 4.0)
    }

    /// Returns the [part](Self::part) for validation. It is inside the box that
    /// [`clip`](Self::clip) returns for any region around this one. The parts that a builder made
    /// may therefore be a little larger than the parts that validation finds, and are never smaller.
    fn clip_tightly(&self, object: u32, region: &Aabb) -> Aabb {
        self.part(object, region, 1.0)
    }
}

impl Clip for &[Triangle] {
    #[inline]
    fn part(&self, object: u32, region: &Aabb, slack: f64) -> Aabb {
        InFrame { triangles: self, frame: None }.part(object, region, slack)
    }
}

/// The part of a sphere is the intersection of its box with the region: cheap and exact.
impl Clip for &[Sphere] {
    fn part(&self, object: u32, region: &Aabb, _: f64) -> Aabb {
        self[object as usize].aabb().intersection(region)
    }
}

impl Primitives {
    /// Returns the parts of the objects in these boxes; `None` for spheres in a frame, of which
    /// nothing is known.
    pub fn parts_in<'a>(&'a self, frame: Option<&'a Frame>) -> Option<Box<dyn Clip + 'a>> {
        Some(match self {
            Self::Triangles(triangles) => Box::new(InFrame { triangles, frame }),
            Self::Doubles(triangles) => Box::new(InFrame { triangles, frame }),
            Self::Spheres(spheres) if frame.is_none() => Box::new(spheres.as_slice()),
            Self::Spheres(_) => return None,
        })
    }
}

impl Clip for Primitives {
    fn part(&self, object: u32, region: &Aabb, slack: f64) -> Aabb {
        let frame = None;
        match self {
            Self::Triangles(triangles) => InFrame { triangles, frame }.part(object, region, slack),
            Self::Doubles(triangles) => InFrame { triangles, frame }.part(object, region, slack),
            Self::Spheres(spheres) => spheres.as_slice().part(object, region, slack),
        }
    }
}

/// The planes of the region cut the triangle in f64 (Sutherland & Hodgman 1974). A cut makes
/// corners that are off by a few rounding errors, and a later cut may drop geometry within that
/// error: an edge along a plane would be lost completely. The planes are therefore moved outwards
/// by a bound of the error before they cut, and the corners are moved outwards after the cuts. The
/// result is rounded outwards to f32 and never leaves the region. The bound is relative to the
/// triangle's largest coordinate: 2⁻⁴⁶ of it, 64 rounding errors, while each of the six cuts makes
/// at most 5, and a frame at most 4 · 3 where it makes the corners.
impl<T: Corners> Clip for InFrame<'_, T> {
    #[inline]
    fn part(&self, object: u32, region: &Aabb, slack: f64) -> Aabb {
        let triangle = &self.triangles[object as usize];
        let full = triangle.aabb_in(self.frame);
        let common = full.intersection(region);
        // Most triangles are inside the region or outside of it, and need no cut.
        if common == full || common == Aabb::EMPTY {
            return common;
        }
        let farthest = full.min.abs().max(full.max.abs());
        let largest = farthest.max_element();
        let error = DVec3::splat(f64::from(largest) * (slack * (64.0 * f64::EPSILON)));
        let low = region.min.as_dvec3() - error;
        let high = region.max.as_dvec3() + error;
        let corners = triangle.corners();
        let corners =
            self.frame.map_or(corners, |frame| corners.each(|corner| frame.point(corner)));
        let mut kept = Polygon::from_slice(&corners);
        for axis in 0..3 {
            // Planes that miss the triangle cut nothing off.
            if full.min[axis] < region.min[axis] {
                kept = cut(&kept, axis, low[axis], 1.0);
            }
            if full.max[axis] > region.max[axis] {
                kept = cut(&kept, axis, high[axis], -1.0);
            }
        }
        if kept.is_empty() {
            return Aabb::EMPTY;
        }
        let min = kept.iter().fold(DVec3::INFINITY, |min, corner| min.min(*corner)) - error;
        let max = kept.iter().fold(DVec3::NEG_INFINITY, |max, corner| max.max(*corner)) + error;
        Aabb { min: round_down(min), max: round_up(max) }.intersection(&common)
    }
}

/// The corners of a convex planar polygon: a triangle cut by up to six planes, of which each adds at
/// most one corner, but for a polygon that rounding has made slightly concave.
type Polygon = SmallVec<[DVec3; 9]>;

/// Returns the part of a polygon above a plane across an axis if `side` is 1, the part below it if
/// `side` is −1. New corners are exactly on the plane.
#[inline]
fn cut(polygon: &Polygon, axis: usize, position: f64, side: f64) -> Polygon {
    let mut kept = Polygon::new();
    let height = |point: DVec3| side * (point[axis] - position);
    for (index, &from) in polygon.iter().enumerate() {
        let next = if index + 1 == polygon.len() { 0 } else { index + 1 };
        let to = polygon[next];
        let before = height(from);
        let after = height(to);
        if before >= 0.0 {
            kept.push(from);
        }
        // A corner in the plane is kept above, and would be its own crossing.
        if (before < 0.0) != (after < 0.0) && before != 0.0 && after != 0.0 {
            let mut crossing = from + (to - from) * (before / (before - after));
            crossing[axis] = position;
            kept.push(crossing);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        // Coordinates of all magnitudes, and often the same one, so that planes go through corners.
        prop_oneof![-4.0f32..4.0, (-3i8..3).prop_map(f32::from), -1e-30f32..1e-30, -1e6f32..1e6]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(coordinate()).prop_map(Vec3::from_array)
    }

    fn region() -> impl Strategy<Value = Aabb> {
        [point(), point()].prop_map(Aabb::around)
    }

    fn is_inside(point: DVec3, aabb: &Aabb) -> bool {
        let above = point.cmpge(aabb.min.as_dvec3());
        let below = point.cmple(aabb.max.as_dvec3());
        (above & below).all()
    }

    proptest! {
        #[test]
        fn a_part_holds_every_point_of_the_triangle_in_the_region(
            corners in [point(), point(), point()],
            region in region(),
            weights in prop::array::uniform3(0.0f64..1.0),
        ) {
            let triangles = &[Triangle(corners)][..];
            let full = triangles[0].aabb();
            let [part, tight] = [triangles.clip(0, &region), triangles.clip_tightly(0, &region)];
            prop_assert!(part.contains(&tight) && region.contains(&part) && full.contains(&part));
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            let sum: f64 = weights.iter().sum();
            let mean = (a * weights[0] + b * weights[1] + c * weights[2]) / sum.max(1e-9);
            // The mean is off by rounding errors of the largest coordinate. A tight part allows
            // for such errors within the triangle's box, and no part leaves that box.
            let point = mean.clamp(full.min.as_dvec3(), full.max.as_dvec3());
            if is_inside(point, &region) {
                prop_assert!(is_inside(point, &tight), "{point} in {tight:?}");
            }
        }

        #[test]
        fn parts_of_smaller_regions_are_smaller(
            corners in [point(), point(), point()],
            outer in region(),
            cut in coordinate(),
            axis in 0usize..3,
        ) {
            let triangles = &[Triangle(corners)][..];
            let mut inner = outer;
            inner.max[axis] = cut.clamp(outer.min[axis], outer.max[axis]);
            let inner_part = triangles.clip_tightly(0, &inner);
            let outer_part = triangles.clip(0, &outer);
            prop_assert!(outer_part.contains(&inner_part), "{inner_part:?} in {outer_part:?}");
        }
    }

    #[test]
    fn the_half_of_a_diagonal_is_a_quarter_of_its_box() {
        let triangles = &[Triangle::from([[0.0; 3], [4.0, 4.0, 0.0], [4.0, 4.0, 1.0]])][..];
        let half = Aabb::from([[0.0; 3], [2.0, 4.0, 1.0]]);
        let part = triangles.clip(0, &half);
        assert_eq!(part.min, Vec3::ZERO);
        assert_eq!(part.max.x, 2.0);
        assert!((part.max.y - 2.0).abs() < 1e-6, "{part:?}");
        assert!((part.max.z - 0.5).abs() < 1e-6, "{part:?}");
        // This region overlaps the triangle's box, but not the triangle.
        let missed = Aabb::from([[0.0, 3.0, 0.0], [1.0, 4.0, 1.0]]);
        assert_eq!(triangles.clip(0, &missed), Aabb::EMPTY);
    }

    #[test]
    fn a_corner_in_the_plane_is_kept_once() {
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
        for (position, side, expected) in [
            (0.0, 1.0, &corners[..]),
            (0.0, -1.0, &[DVec3::ZERO, DVec3::Y]),
            (1.0, 1.0, &[DVec3::X]),
            (0.25, 1.0, &[DVec3::new(0.25, 0.0, 0.0), DVec3::X, DVec3::new(0.25, 0.75, 0.0)]),
        ] {
            assert_eq!(cut(&Polygon::from_slice(&corners), 0, position, side).as_slice(), expected);
        }
    }
}
