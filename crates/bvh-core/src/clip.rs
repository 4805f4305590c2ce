//! Parts of objects: the boxes of *references*, where an object lies in several leaves, each with a part of it.
//!
//! A long thin triangle fills little of its box, and no tree over whole boxes can help it. A tree with split references
//! (Stich, Friedrich & Dietrich 2009) names it in several leaves, whose boxes together cover it:
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
//! Builders and searches see boxes only; the one question that they ask of a shape is how large its part in a region is.

use crate::{Aabb, Primitives, Triangle};
use core::fmt::Debug;
use glam::{DVec3, Vec3};

/// Objects whose parts have boxes.
pub trait Clip: Debug + Sync {
    /// A box inside `region` and inside the object's own box, around everything of the object that is in `region`;
    /// [`Aabb::EMPTY`] if that is nothing. With the object's own box as the region, that box.
    fn clip(&self, object: u32, region: &Aabb) -> Aabb;

    /// As [`clip`](Self::clip), and inside what that gives for any region around this one. Validation asks for it, so that
    /// the parts that a builder made may be a little larger than the parts that it finds, and never smaller. The default is
    /// right where boxes are exact.
    fn clip_tightly(&self, object: u32, region: &Aabb) -> Aabb {
        self.clip(object, region)
    }
}

impl Clip for &[Triangle] {
    #[inline]
    fn clip(&self, object: u32, region: &Aabb) -> Aabb {
        clip(&self[object as usize], region, BUILDERS)
    }

    fn clip_tightly(&self, object: u32, region: &Aabb) -> Aabb {
        clip(&self[object as usize], region, VALIDATION)
    }
}

/// Spheres keep their box but for what is outside of the region: cheap, and exact.
impl Clip for Primitives {
    fn clip(&self, object: u32, region: &Aabb) -> Aabb {
        match self {
            Self::Triangles(triangles) => triangles.as_slice().clip(object, region),
            Self::Spheres(spheres) => spheres[object as usize].aabb().intersection(region),
        }
    }

    fn clip_tightly(&self, object: u32, region: &Aabb) -> Aabb {
        match self {
            Self::Triangles(triangles) => triangles.as_slice().clip_tightly(object, region),
            Self::Spheres(_) => self.clip(object, region),
        }
    }
}

/// Multiples of the error bound by which a triangle's part is widened: more for builders than for validation.
const BUILDERS: f64 = 4.0;
const VALIDATION: f64 = 1.0;

/// The box around a triangle's part in a region.
///
/// The triangle is cut by the region's planes in f64 (Sutherland & Hodgman 1974). A corner that a cut makes is off by a few
/// rounding errors, and a later cut may drop what is off by so much: an edge that lies along a plane would be lost whole. So
/// the planes are moved outwards by a bound of the error before they cut, and the corners after it; the result is rounded
/// outwards to f32 and never leaves the region. The bound is relative to the triangle's largest coordinate: 2⁻⁴⁶ of it, 64
/// rounding errors, where six cuts make 4 each.
fn clip(triangle: &Triangle, region: &Aabb, slack: f64) -> Aabb {
    let whole = triangle.aabb();
    let common = whole.intersection(region);
    if common == whole || common == Aabb::EMPTY {
        return common;
    }
    let largest = whole.min.abs().max(whole.max.abs()).max_element();
    let error = DVec3::splat(f64::from(largest) * (slack * (64.0 * f64::EPSILON)));
    let [low, high] = [region.min.as_dvec3() - error, region.max.as_dvec3() + error];
    // Every cut adds one corner at most.
    let (mut corners, mut len) = ([DVec3::ZERO; 9], 3);
    corners[..3].copy_from_slice(&triangle.0.map(Vec3::as_dvec3));
    for axis in 0..3 {
        if whole.min[axis] < region.min[axis] {
            len = cut(&mut corners, len, axis, low[axis], 1.0);
        }
        if whole.max[axis] > region.max[axis] {
            len = cut(&mut corners, len, axis, high[axis], -1.0);
        }
    }
    if len == 0 {
        return Aabb::EMPTY;
    }
    let rest = &corners[..len];
    let low = rest.iter().fold(DVec3::INFINITY, |low, corner| low.min(*corner)) - error;
    let high = rest.iter().fold(DVec3::NEG_INFINITY, |high, corner| high.max(*corner)) + error;
    let part = Aabb {
        min: Vec3::from_array(low.to_array().map(down)),
        max: Vec3::from_array((-high).to_array().map(|x| -down(x))),
    };
    part.intersection(&common)
}

/// Keeps the part of a convex polygon on one side of a plane. Returns its number of corners.
#[inline]
fn cut(corners: &mut [DVec3; 9], len: usize, axis: usize, plane: f64, side: f64) -> usize {
    let polygon = *corners;
    let mut kept = 0;
    let mut add = |corner: DVec3| {
        if let Some(place) = corners.get_mut(kept) {
            *place = corner;
            kept += 1;
        }
    };
    for (at, &to) in polygon[..len].iter().enumerate() {
        let from = polygon[if at == 0 { len - 1 } else { at - 1 }];
        let [before, after] = [from, to].map(|corner| side * (corner[axis] - plane));
        if (before < 0.0) != (after < 0.0) {
            let mut corner = from + (to - from) * (before / (before - after));
            corner[axis] = plane;
            add(corner);
        }
        if after >= 0.0 {
            add(to);
        }
    }
    kept
}

/// The largest f32 that is not above `x`.
#[inline]
fn down(x: f64) -> f32 {
    let nearest = x as f32;
    if f64::from(nearest) > x { nearest.next_down() } else { nearest }
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;
    use proptest::prelude::*;

    fn coordinate() -> impl Strategy<Value = f32> {
        // Of all sizes, and often the same one.
        prop_oneof![-4.0f32..4.0, (-3i8..3).prop_map(f32::from), -1e-30f32..1e-30, -1e6f32..1e6]
    }

    fn point() -> impl Strategy<Value = Vec3> {
        prop::array::uniform3(coordinate()).prop_map(Vec3::from_array)
    }

    fn region() -> impl Strategy<Value = Aabb> {
        [point(), point()].prop_map(Aabb::around)
    }

    fn scene(corners: [Vec3; 3]) -> Vec<Triangle> {
        alloc::vec![Triangle(corners)]
    }

    proptest! {
        #[test]
        fn a_part_holds_every_point_of_the_triangle_in_the_region(
            corners in [point(), point(), point()], region in region(), weights in prop::array::uniform3(0.0f64..1.0)) {
            let triangles = scene(corners);
            let part = triangles.as_slice().clip(0, &region);
            let tight = triangles.as_slice().clip_tightly(0, &region);
            prop_assert!(part.contains(&tight) && region.contains(&part) && triangles[0].aabb().contains(&part));
            let [a, b, c] = corners.map(Vec3::as_dvec3);
            let sum: f64 = weights.iter().sum::<f64>().max(1e-9);
            let point = (a * weights[0] + b * weights[1] + c * weights[2]) / sum;
            // Off by rounding errors of the largest coordinate, which a tight part allows for too.
            let inside = |aabb: &Aabb| {
                point.cmpge(aabb.min.as_dvec3()).all() && point.cmple(aabb.max.as_dvec3()).all()
            };
            prop_assert!(!inside(&region) || inside(&tight), "{point} in {tight:?}");
        }

        #[test]
        fn parts_of_smaller_regions_are_smaller(
            corners in [point(), point(), point()], outer in region(), cut in coordinate(), axis in 0usize..3) {
            let triangles = scene(corners);
            let mut inner = outer;
            inner.max[axis] = cut.clamp(outer.min[axis], outer.max[axis]);
            let [inner, outer] = [triangles.as_slice().clip_tightly(0, &inner), triangles.as_slice().clip(0, &outer)];
            prop_assert!(outer.contains(&inner), "{inner:?} in {outer:?}");
        }
    }

    #[test]
    fn the_half_of_a_diagonal_is_a_quarter_of_its_box() {
        let triangles = scene([Vec3::ZERO, Vec3::new(4.0, 4.0, 0.0), Vec3::new(4.0, 4.0, 1.0)]);
        let half = Aabb::from([[0.0; 3], [2.0, 4.0, 1.0]]);
        let part = triangles.as_slice().clip(0, &half);
        assert_eq!((part.min, part.max.x), (Vec3::ZERO, 2.0));
        assert!((part.max.y - 2.0).abs() < 1e-6 && (part.max.z - 0.5).abs() < 1e-6, "{part:?}");
        let beside = Aabb::from([[0.0, 3.0, 0.0], [1.0, 4.0, 1.0]]);
        assert_eq!(triangles.as_slice().clip(0, &beside), Aabb::EMPTY);
    }
}
