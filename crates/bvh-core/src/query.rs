//! Questions of a tree that are not rays': what lies in a region, and what lies nearest to a point.
//!
//! As for rays, the objects may be anything: the caller passes a closure that looks at one of them. It is also the filter: what it passes
//! over is not found. Boxes are tested conservatively, so that the answers are those of looking at every object, whatever the tree.
//!
//! | question | function | boxes visited |
//! |---|---|---|
//! | what may overlap a box, a sphere, a frustum, or contain a point? | [`overlapping`] | those that do, and their siblings |
//! | what does a ray hit, all of it? | [`all_hits`] | likewise |
//! | what may a ray meet, hit or not? | [`along`] | likewise |
//! | what is nearest to a point? | [`nearest`] | about O(log n) for objects that are spread out |
//! | what are the k nearest? | [`k_nearest`] | about O(k + log n) likewise |
//!
//! All of them go over the tree. The [wide layout](crate::WideBvh) has only what rays can hit, and answers rays only, with a filter by
//! [`nearest_hit_where`](crate::WideBvh::nearest_hit_where): it leaves out triangles without area, which lie in regions and near to points
//! as others do.
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

use crate::{Aabb, BvhView, Hit, NodeKind, Primitive, Ray, Sphere, any_hit_by};
use alloc::collections::BTreeSet;
use alloc::{vec, vec::Vec};
use core::cmp::Ordering;
use core::ops::ControlFlow;
use glam::{DVec3, Vec3};

/// A part of space.
pub trait Region {
    /// Whether the region may have a point in the box, borders included: never false if it has.
    fn may_meet(&self, aabb: &Aabb) -> bool;
}

impl Region for Aabb {
    #[inline]
    fn may_meet(&self, aabb: &Aabb) -> bool {
        self.min.cmple(aabb.max).all() && aabb.min.cmple(self.max).all()
    }
}

/// The point alone: which objects may contain it?
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

/// The points on the inner sides of some planes: the view of a camera, for example.
#[derive(Clone, Debug, PartialEq)]
pub struct Frustum {
    /// `[a, b, c, d]` of each plane, on the inner side of which a·x + b·y + c·z + d is not negative.
    pub planes: Vec<[f32; 4]>,
}

impl Region for Frustum {
    /// A box beyond an edge of the frustum may be accepted though no point of it is inside.
    #[inline]
    fn may_meet(&self, aabb: &Aabb) -> bool {
        self.planes.iter().all(|&[a, b, c, d]| {
            let normal = Vec3::new(a, b, c);
            // The corner that lies farthest inside. Products are exact in f64; their sums are rounded, hence the margin.
            let corner = Vec3::select(normal.cmpge(Vec3::ZERO), aabb.max, aabb.min).as_dvec3();
            let terms = normal.as_dvec3() * corner;
            let size = terms.abs().element_sum() + f64::from(d.abs());
            terms.element_sum() + f64::from(d) >= -ROUNDING * size
        })
    }
}

/// More than the relative rounding error of any distance here.
const ROUNDING: f64 = 1e-14;

/// The squared distance of a point from a box, at most: 0 inside, and never more than that of any point of the box, however that is
/// rounded.
#[inline]
fn least_distance_squared(aabb: &Aabb, point: Vec3) -> f64 {
    let outside = (aabb.min.as_dvec3() - point.as_dvec3()).max(point.as_dvec3() - aabb.max.as_dvec3());
    outside.max(DVec3::ZERO).length_squared() * (1.0 - ROUNDING)
}

/// Shows `visit` the objects of every leaf whose box the region may meet, until it breaks. Returns what it broke with. A divided
/// object is shown once for each of its leaves.
///
/// # Panics
/// May panic, or not return, for a tree that [`validate`](crate::validate()) refuses; so may the other queries.
pub fn overlapping<'t, B>(
    tree: impl Into<BvhView<'t>>,
    region: &impl Region,
    mut visit: impl FnMut(u32) -> ControlFlow<B>,
) -> Option<B> {
    let tree = tree.into();
    let mut open: Vec<usize> = (0..tree.nodes.len().min(1)).collect();
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

/// Shows `visit` the objects of every leaf whose box the ray meets in its range, in no order of distance, until it breaks: for all hits
/// along a ray. Returns what it broke with.
pub fn along<'t, B>(
    tree: impl Into<BvhView<'t>>,
    ray: &Ray,
    mut visit: impl FnMut(u32) -> ControlFlow<B>,
) -> Option<B> {
    let mut broke_with = None;
    let breaks = |object| match visit(object) {
        ControlFlow::Continue(()) => false,
        ControlFlow::Break(with) => {
            broke_with = Some(with);
            true
        }
    };
    any_hit_by(tree, ray, breaks, &mut ());
    broke_with
}

/// Every one of `objects` that the ray hits in its range and that `keep` does not pass over, the nearest first; of several at the same
/// distance the one of the lowest id. `tree` is one over their [boxes](crate::boxes).
pub fn all_hits<'t, P: Primitive>(
    tree: impl Into<BvhView<'t>>,
    objects: &[P],
    ray: &Ray,
    mut keep: impl FnMut(u32) -> bool,
) -> Vec<Hit> {
    let prepared = P::prepare(ray);
    let mut hits = Vec::new();
    along(tree, ray, |object| -> ControlFlow<()> {
        if keep(object)
            && let Some(t) = objects[object as usize].intersect(&prepared, ray.t_max())
        {
            hits.push(Hit { t, object });
        }
        ControlFlow::Continue(())
    });
    hits.sort_unstable_by(|a, b| a.t.total_cmp(&b.t).then(a.object.cmp(&b.object)));
    // A split object is met in several leaves.
    hits.dedup();
    hits
}

/// An object near a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// The object.
    pub object: u32,
    /// The square of its distance, world units squared.
    pub distance_squared: f64,
}

impl Eq for Near {}

impl PartialOrd for Near {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Near {
    /// The nearer first; of equally near ones the lower id.
    fn cmp(&self, other: &Self) -> Ordering {
        self.distance_squared.total_cmp(&other.distance_squared).then(self.object.cmp(&other.object))
    }
}

/// The object nearest to `point`, of equally near ones the one of the lowest id, if its squared distance is at most `limit`.
/// `distance_squared` gives that of an object, the whole of one that is divided, which must be no less than that of its box, or `None`
/// to pass it over.
pub fn nearest<'t>(
    tree: impl Into<BvhView<'t>>,
    point: impl Into<Vec3>,
    limit: f64,
    distance_squared: impl FnMut(u32) -> Option<f64>,
) -> Option<Near> {
    k_nearest(tree, point, 1, limit, distance_squared).pop()
}

/// The `k` objects nearest to `point`, or fewer if there are fewer within `limit`, nearest first; otherwise as [`nearest`].
pub fn k_nearest<'t>(
    tree: impl Into<BvhView<'t>>,
    point: impl Into<Vec3>,
    k: usize,
    limit: f64,
    mut distance_squared: impl FnMut(u32) -> Option<f64>,
) -> Vec<Near> {
    let (tree, point) = (tree.into(), point.into());
    // A set, because a divided object is met in several leaves.
    let mut found: BTreeSet<Near> = BTreeSet::new();
    if k == 0 || limit.is_nan() {
        return vec![];
    }
    let least = |index: usize| least_distance_squared(&tree.nodes[index].aabb, point);
    let mut open: Vec<(f64, usize)> = (0..tree.nodes.len().min(1)).map(|root| (least(root), root)).collect();
    while let Some((distance, index)) = open.pop() {
        let most =
            if found.len() == k { found.last().map_or(limit, |near| near.distance_squared) } else { limit };
        if distance > most {
            continue;
        }
        let node = &tree.nodes[index];
        if !node.is_leaf() {
            let from = open.len();
            open.extend(node.children().map(|child| (least(child), child)).filter(|child| child.0 <= most));
            // The nearest child is visited next.
            open[from..].sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
            continue;
        }
        for &object in &tree.prim_ids[node.prims()] {
            let Some(distance_squared) = distance_squared(object).filter(|&distance| distance <= limit) else {
                continue;
            };
            found.insert(Near { object, distance_squared });
            if found.len() > k {
                found.pop_last();
            }
        }
    }
    found.into_iter().collect()
}
