//! Traversal of the one tree type: the nearest hit of a ray, and whether a ray hits anything.
//!
//! [`nearest_hit`] and [`any_hit`] accept triangles, spheres, or objects of any other kind that
//! implements [`Primitive`]. [`nearest_hit_by`] and [`any_hit_by`] accept a closure that tests one
//! object, and a counter of tests. The closure can also skip objects.
//!
//! Boxes are visited front to back and skipped if they begin behind the nearest hit. The box test
//! ([`Slabs`](crate::Slabs)) is conservative. The answer is the same, bit by bit, as the answer of
//! testing every object, for any tree, provided that every distance that a test returns is inside
//! the interval of the object's box. [`Triangle::intersect`](crate::Triangle::intersect),
//! [`Sphere::intersect`](crate::Sphere::intersect) and [`clip_to_box`](crate::clip_to_box) return
//! such distances.

use crate::{BvhView, Hit, NodeKind, Primitive, Ray, Slabs};
use core::ops::ControlFlow;
use smallvec::SmallVec;

/// A counter of the tests of a traversal. `()` counts nothing and costs nothing.
pub trait Counter {
    /// Adds the tests of `boxes` boxes. The root's box counts too.
    #[inline(always)]
    fn boxes(&mut self, boxes: usize) {
        let _ = boxes;
    }

    /// Adds the test of one object.
    #[inline(always)]
    fn object(&mut self) {}
}

impl Counter for () {}

/// The numbers of tests of one ray or of many rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TestCounts {
    /// Tests against the boxes of nodes, root and leaves included.
    pub boxes: u64,
    /// Tests against objects.
    pub objects: u64,
}

impl Counter for TestCounts {
    #[inline(always)]
    fn boxes(&mut self, boxes: usize) {
        self.boxes += boxes as u64;
    }

    #[inline(always)]
    fn object(&mut self) {
        self.objects += 1;
    }
}

/// Returns the nearest of `objects` that `ray` hits in its range. Among objects at the same
/// distance, the lowest id wins.
///
/// `tree` is a [`&Bvh`](crate::Bvh) over the [boxes](crate::boxes) of `objects`, or a view of one.
///
/// # Panics
/// May panic or not return for a tree that [`validate`](crate::validate()) rejects, and may panic
/// for a tree over more objects.
#[inline]
pub fn nearest_hit<'t, P: Primitive>(
    tree: impl Into<BvhView<'t>>,
    objects: &[P],
    ray: &Ray,
) -> Option<Hit> {
    let prepared = P::prepare(ray);
    nearest_hit_by(tree, ray, |id, t_max| objects[id as usize].intersect(&prepared, t_max), &mut ())
}

/// Returns whether `ray` hits any of `objects` in its range: the query of a shadow ray.
///
/// `tree` and panics are as for [`nearest_hit`].
#[inline]
pub fn any_hit<'t, P: Primitive>(tree: impl Into<BvhView<'t>>, objects: &[P], ray: &Ray) -> bool {
    let prepared = P::prepare(ray);
    any_hit_by(
        tree,
        ray,
        |id| objects[id as usize].intersect(&prepared, ray.t_max()).is_some(),
        &mut (),
    )
}

/// Returns the [`nearest_hit`] of objects that a closure tests, and counts the tests. `&mut ()`
/// counts nothing.
///
/// `tree` is a [`&Bvh`](crate::Bvh) or a view of one. `test(object, t_max)` returns the distance at
/// which the ray hits the object if that distance is in `ray.t_min()..=t_max`.
#[inline]
pub fn nearest_hit_by<'t>(
    tree: impl Into<BvhView<'t>>,
    ray: &Ray,
    mut test: impl FnMut(u32, f32) -> Option<f32>,
    counter: &mut impl Counter,
) -> Option<Hit> {
    let mut nearest = None;
    walk(tree.into(), ray, counter, |objects, t_max, counter| {
        nearest_of(objects.iter().copied(), t_max, &mut nearest, &mut test, counter);
        ControlFlow::Continue(())
    });
    nearest
}

/// Returns whether a ray hits [any](any_hit) of the objects that a closure tests, and counts the
/// tests.
///
/// `test(object)` returns whether the ray hits the object. Although any hit is enough, boxes are
/// visited front to back: near objects fill more of the view and are more likely to be hit.
#[inline]
pub fn any_hit_by<'t>(
    tree: impl Into<BvhView<'t>>,
    ray: &Ray,
    mut test: impl FnMut(u32) -> bool,
    counter: &mut impl Counter,
) -> bool {
    let mut found = false;
    walk(tree.into(), ray, counter, |objects, _, counter| {
        for &object in objects {
            counter.object();
            if test(object) {
                found = true;
                return ControlFlow::Break(());
            }
        }
        ControlFlow::Continue(())
    });
    found
}

/// Returns the nearest hit without a tree. Tests the objects `0..objects` one after the other;
/// otherwise the same as [`nearest_hit_by`].
pub fn nearest_hit_of_all(
    objects: u32,
    ray: &Ray,
    mut test: impl FnMut(u32, f32) -> Option<f32>,
    counter: &mut impl Counter,
) -> Option<Hit> {
    let mut nearest = None;
    nearest_of(0..objects, &mut ray.t_max(), &mut nearest, &mut test, counter);
    nearest
}

/// Returns whether a ray hits any object, without a tree. Tests the objects `0..objects` one after
/// the other; otherwise the same as [`any_hit_by`].
pub fn any_hit_of_all(
    objects: u32,
    mut test: impl FnMut(u32) -> bool,
    counter: &mut impl Counter,
) -> bool {
    (0..objects).any(|object| {
        counter.object();
        test(object)
    })
}

/// Tests `objects` one after the other. Stores the nearest hit, and lowers `t_max` to its distance.
#[inline(always)]
fn nearest_of(
    objects: impl Iterator<Item = u32>,
    t_max: &mut f32,
    nearest: &mut Option<Hit>,
    test: &mut impl FnMut(u32, f32) -> Option<f32>,
    counter: &mut impl Counter,
) {
    for object in objects {
        counter.object();
        // A closure of the caller may ignore `t_max`.
        if let Some(t) = test(object, *t_max)
            && t <= *t_max
        {
            let hit = Hit { t, object };
            if nearest.is_none_or(|nearest| hit.precedes(&nearest)) {
                *nearest = Some(hit);
                *t_max = t;
            }
        }
    }
}

/// A node that is visited later, and the distance `entry` at which the ray enters its box. The
/// stack keeps the node's children or objects instead of its index, because the node may have left
/// the cache by then.
#[derive(Clone, Copy)]
struct Pending {
    entry: f32,
    kind: NodeKind,
}

/// Calls `leaf` with the objects of every leaf that the ray may hit, the nearest leaf first, until
/// `leaf` breaks. `leaf` may lower the distance beyond which boxes are skipped.
#[inline(always)]
fn walk<C: Counter>(
    tree: BvhView,
    ray: &Ray,
    counter: &mut C,
    mut leaf: impl FnMut(&[u32], &mut f32, &mut C) -> ControlFlow<()>,
) {
    let Some(root) = tree.nodes.first() else { return };
    let slabs = Slabs::in_frame(ray, tree.frame, &root.aabb);
    let mut t_max = ray.t_max();
    counter.boxes(1);
    if slabs.entry(&root.aabb) > t_max {
        return;
    }
    let mut kind = root.kind();
    let mut stack = SmallVec::<[Pending; 64]>::new();
    loop {
        match kind {
            NodeKind::Leaf { first, count } => {
                let first = first as usize;
                let objects = &tree.prim_ids[first..first + count as usize];
                if leaf(objects, &mut t_max, counter).is_break() {
                    return;
                }
            }
            NodeKind::Inner { first, count: 2 } => {
                counter.boxes(2);
                let pair = &tree.nodes[first as usize..first as usize + 2];
                let (a, b) = (slabs.entry(&pair[0].aabb), slabs.entry(&pair[1].aabb));
                // This branch is often mispredicted, but it pays: the processor continues with the
                // child that it expects to be nearer while the distances are still being computed.
                let (entry, near, far_entry, far) =
                    if b < a { (b, &pair[1], a, &pair[0]) } else { (a, &pair[0], b, &pair[1]) };
                if entry <= t_max {
                    if far_entry <= t_max {
                        stack.push(Pending { entry: far_entry, kind: far.kind() });
                    }
                    kind = near.kind();
                    continue;
                }
            }
            NodeKind::Inner { first, count } => {
                counter.boxes(count as usize);
                let mut nearest: Option<Pending> = None;
                let waiting = stack.len();
                // From the last on, so that the first of several at the same distance is nearest.
                for child in tree.nodes[first as usize..][..count as usize].iter().rev() {
                    let mut child = Pending { entry: slabs.entry(&child.aabb), kind: child.kind() };
                    if child.entry > t_max {
                        continue;
                    }
                    let Some(nearest) = &mut nearest else {
                        nearest = Some(child);
                        continue;
                    };
                    if child.entry <= nearest.entry {
                        core::mem::swap(&mut child, nearest);
                    }
                    stack.push(child);
                }
                if stack.len() > waiting + 1 {
                    // Stable, for the same reason.
                    stack[waiting..].sort_by(|a, b| b.entry.total_cmp(&a.entry));
                }
                if let Some(nearest) = nearest {
                    kind = nearest.kind;
                    continue;
                }
            }
        }
        kind = loop {
            let Some(pending) = stack.pop() else { return };
            // A hit found after the push may be in front of this box.
            if pending.entry <= t_max {
                break pending.kind;
            }
        };
    }
}
