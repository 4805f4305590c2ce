//! Queries other than hits of a ray: the objects in a region, and the object nearest to a point.
//!
//! The objects may be of any kind. The caller passes a closure that examines one object and that
//! can also skip it. Boxes are tested conservatively. For any tree, the answer is the same as the
//! answer of examining every object.
//!
//! | query | function | boxes visited |
//! |---|---|---|
//! | objects that may overlap a box or a sphere, or may contain a point | [`overlapping`] | boxes that do, and their siblings |
//! | the object nearest to a point | [`nearest`] | about O(log n) for objects that are spread out |
//!
//! Both use the tree. The [wide layout](crate::WideBvh) is faster, but omits triangles without
//! area: its [`closest_points`](crate::WideBvh::closest_points) and
//! [`Solid::contains`](crate::Solid::contains) answer batches of points. All hits of a ray are
//! [`WideBvh::all_hits`](crate::WideBvh::all_hits), or what [`any_hit_by`](crate::any_hit_by) shows
//! a closure that returns false.
//!
//! ```
//! use bvh_core::{Aabb, Bvh, Node, Triangle, query};
//! use glam::Vec3;
//! let corners = |z| [Vec3::new(0.0, 0.0, z), Vec3::new(1.0, 0.0, z), Vec3::new(0.0, 1.0, z)];
//! let triangles = [0.0, 4.0].map(|z| Triangle(corners(z)));
//! let [a, b] = triangles.map(|t| t.aabb());
//! let tree = Bvh {
//!     nodes: vec![Node::inner(a.union(&b), 1, 2), Node::leaf(a, 0, 1), Node::leaf(b, 1, 1)],
//!     prim_ids: vec![0, 1],
//! };
//! let point = Vec3::new(0.25, 0.25, 3.0);
//! let distance = |id: u32| Some(triangles[id as usize].closest_point(point).distance_squared(point.as_dvec3()));
//! let found = query::nearest(&tree, point, f64::INFINITY, distance).unwrap();
//! assert_eq!((found.object, found.distance_squared), (1, 1.0));
//! ```

use crate::{Aabb, BvhView, NodeKind, Sphere};
use alloc::vec::Vec;
use core::ops::ControlFlow;
use glam::{DVec3, Vec3};

/// A part of space.
pub trait Region {
    /// Returns whether the region may have a point in the box, borders included. The answer may be
    /// true without such a point, but never false with one.
    fn may_meet(&self, aabb: &Aabb) -> bool;
}

impl Region for Aabb {
    #[inline]
    fn may_meet(&self, aabb: &Aabb) -> bool {
        self.min.cmple(aabb.max).all() && aabb.min.cmple(self.max).all()
    }
}

/// A single point. Objects whose boxes contain the point may contain it.
impl Region for Vec3 {
    #[inline]
    fn may_meet(&self, aabb: &Aabb) -> bool {
        aabb.min.cmple(*self).all() && self.cmple(aabb.max).all()
    }
}

impl Region for Sphere {
    #[inline]
    fn may_meet(&self, aabb: &Aabb) -> bool {
        let radius = f64::from(self.radius);
        radius >= 0.0 && least_distance_squared(aabb, self.center) <= radius * radius
    }
}

/// A bound of the relative rounding error of any distance in this module.
const ROUNDING: f64 = 1e-14;

/// Returns a lower bound of the squared distance of a point from a box; 0 inside. It never exceeds
/// the squared distance of any point of the box, even if that distance is rounded.
#[inline]
fn least_distance_squared(aabb: &Aabb, point: Vec3) -> f64 {
    let below = aabb.min.as_dvec3() - point.as_dvec3();
    let above = point.as_dvec3() - aabb.max.as_dvec3();
    let outside = below.max(above).max(DVec3::ZERO);
    outside.length_squared() * (1.0 - ROUNDING)
}

/// Calls `visit` with the objects of every leaf whose box the region may meet, until `visit`
/// breaks. Returns the value of the break. A divided object is visited once for each of its leaves.
///
/// # Panics
/// May panic or not return for a tree that [`validate`](crate::validate()) rejects. This holds for
/// all queries.
pub fn overlapping<'t, B>(
    tree: impl Into<BvhView<'t>>,
    region: &impl Region,
    mut visit: impl FnMut(u32) -> ControlFlow<B>,
) -> Option<B> {
    let tree = tree.into();
    let mut open: Vec<usize> = Vec::new();
    if !tree.nodes.is_empty() {
        open.push(0);
    }
    while let Some(index) = open.pop() {
        let node = &tree.nodes[index];
        if !region.may_meet(&node.aabb) {
            continue;
        }
        match node.kind() {
            NodeKind::Inner { .. } => open.extend(node.children().rev()),
            NodeKind::Leaf { .. } => {
                for &object in &tree.prim_ids[node.prims()] {
                    if let ControlFlow::Break(with) = visit(object) {
                        return Some(with);
                    }
                }
            }
        }
    }
    None
}

/// An object near a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// The id of the object.
    pub object: u32,
    /// The square of its distance in world units squared.
    pub distance_squared: f64,
}

impl Near {
    /// Returns whether this object is nearer, or as near and of a lower id.
    #[inline(always)]
    pub(crate) fn precedes(&self, other: &Self) -> bool {
        self.distance_squared < other.distance_squared
            || self.distance_squared == other.distance_squared && self.object < other.object
    }
}

/// Returns the object nearest to `point` if its squared distance is at most `limit`. Among objects
/// at the same distance, the lowest id wins.
///
/// `distance_squared` returns the squared distance of an object, or `None` to skip the object. The
/// distance must not be less than the distance of the object's box. The distance of a divided
/// object is the distance of the full object.
pub fn nearest<'t>(
    tree: impl Into<BvhView<'t>>,
    point: impl Into<Vec3>,
    limit: f64,
    mut distance_squared: impl FnMut(u32) -> Option<f64>,
) -> Option<Near> {
    let tree = tree.into();
    let point = point.into();
    let mut nearest: Option<Near> = None;
    // Nodes with lower bounds of the distances of their objects.
    let mut open: Vec<(f64, usize)> = Vec::new();
    if let Some(root) = tree.nodes.first() {
        open.push((least_distance_squared(&root.aabb, point), 0));
    }
    while let Some((bound, index)) = open.pop() {
        let most = nearest.map_or(limit, |nearest| nearest.distance_squared);
        let node = &tree.nodes[index];
        if bound > most {
            continue;
        }
        let first_child = open.len();
        for child in node.children() {
            let bound = least_distance_squared(&tree.nodes[child].aabb, point);
            if bound <= most {
                open.push((bound, child));
            }
        }
        // The nearest child last, so that it is visited next.
        open[first_child..].sort_by(|a, b| b.0.total_cmp(&a.0));
        for &object in &tree.prim_ids[node.prims()] {
            if let Some(distance_squared) = distance_squared(object) {
                let near = Near { object, distance_squared };
                if distance_squared <= limit && nearest.is_none_or(|other| near.precedes(&other)) {
                    nearest = Some(near);
                }
            }
        }
    }
    nearest
}
