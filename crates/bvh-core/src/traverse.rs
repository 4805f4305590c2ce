//! Which object a ray meets first, and whether it meets any: traversal of the one tree type.
//!
//! [`nearest_hit`] and [`any_hit`] take triangles, spheres, or objects of any kind that is a [`Primitive`]; [`nearest_hit_by`]
//! and [`any_hit_by`] a closure that tests one object, which can also pass objects over, and a counter of tests. Boxes are
//! visited front to back, skipped when they begin behind the nearest hit, and tested conservatively ([`Slabs`](crate::Slabs)). With tests
//! whose distances lie inside their objects' boxes, as [`Triangle::intersect`](crate::Triangle::intersect),
//! [`Sphere::intersect`](crate::Sphere::intersect) and [`clip_to_box`](crate::clip_to_box) give them, the answer is
//! that of testing every object, bit by bit, whatever the tree.
//!
//! ```
//! use bvh_core::{Aabb, Bvh, Hit, Node, Ray, Shear, TestCounts, Triangle, nearest_hit, nearest_hit_by};
//! use glam::Vec3;
//! let corners = |z| [Vec3::new(0.0, 0.0, z), Vec3::new(1.0, 0.0, z), Vec3::new(0.0, 1.0, z)];
//! let triangles = [0.0, 1.0].map(|z| Triangle(corners(z)));
//! let [a, b] = triangles.map(|t| t.aabb());
//! let tree = Bvh {
//!     nodes: vec![Node::inner(a.union(&b), 1, 2), Node::leaf(a, 0, 1), Node::leaf(b, 1, 1)],
//!     prim_ids: vec![0, 1],
//! };
//! let ray = Ray::half_line(Vec3::new(0.2, 0.2, 3.0), -Vec3::Z)?;
//! assert_eq!(nearest_hit(&tree, &triangles, &ray), Some(Hit { t: 2.0, object: 1 }));
//! let (shear, mut counts) = (Shear::new(&ray), TestCounts::default());
//! let hit = nearest_hit_by(&tree, &ray, |id, t_max| triangles[id as usize].intersect(&shear, t_max), &mut counts);
//! assert_eq!(hit, Some(Hit { t: 2.0, object: 1 }));
//! assert_eq!(counts, TestCounts { boxes: 3, objects: 1 });
//! # Ok::<(), bvh_core::InvalidRay>(())
//! ```

use crate::stack::Stack;
use crate::{BvhView, Hit, Node, NodeKind, Primitive, Ray, Slabs};
use alloc::vec::Vec;
use core::ops::ControlFlow;

/// What counts the tests of a traversal. `()` counts nothing and costs nothing.
pub trait Counter {
    /// `boxes` more boxes are tested. The root's box counts too.
    #[inline(always)]
    fn boxes(&mut self, boxes: usize) {
        let _ = boxes;
    }

    /// One more object is tested.
    #[inline(always)]
    fn object(&mut self) {}
}

impl Counter for () {}

/// Numbers of tests, of one ray or of many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct TestCounts {
    /// Tests against boxes of nodes, the root's and the leaves' included.
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

/// The nearest of `objects` that `ray` meets in its range; of several at the same distance the one of the lowest id.
///
/// `tree` is a [`&Bvh`](crate::Bvh) over their [boxes](crate::boxes), or a view of one.
///
/// # Panics
/// May panic, or not return, for a tree that [`validate`](crate::validate()) refuses, or of more objects.
#[inline]
pub fn nearest_hit<'t, P: Primitive>(tree: impl Into<BvhView<'t>>, objects: &[P], ray: &Ray) -> Option<Hit> {
    let prepared = P::prepare(ray);
    nearest_hit_by(tree, ray, |id, t_max| objects[id as usize].intersect(&prepared, t_max), &mut ())
}

/// Whether `ray` meets any of `objects` in its range: the question of a shadow ray. Otherwise as [`nearest_hit`].
#[inline]
pub fn any_hit<'t, P: Primitive>(tree: impl Into<BvhView<'t>>, objects: &[P], ray: &Ray) -> bool {
    let prepared = P::prepare(ray);
    any_hit_by(tree, ray, |id| objects[id as usize].intersect(&prepared, ray.t_max()).is_some(), &mut ())
}

/// [`nearest_hit`] of objects that a closure tests, with the tests counted; `&mut ()` counts nothing.
///
/// `tree` is a [`&Bvh`](crate::Bvh) or a view of one. `test(object, t_max)` gives the distance at which the ray meets
/// the object, if that is in `ray.t_min()..=t_max`.
///
/// # Panics
/// May panic, or not return, for a tree that [`validate`](crate::validate()) refuses.
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

/// [`any_hit`] of objects that a closure tests, with the tests counted.
///
/// `test(object)` says whether the ray meets the object. Boxes are visited front to back all the same: a hit ends the
/// search, and near objects fill more of the view.
///
/// # Panics
/// As [`nearest_hit_by`].
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

/// [`nearest_hit_by`] without a tree: tests the objects `0..objects` one after the other.
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

/// [`any_hit_by`] without a tree: tests the objects `0..objects` one after the other.
pub fn any_hit_of_all(objects: u32, mut test: impl FnMut(u32) -> bool, counter: &mut impl Counter) -> bool {
    (0..objects).any(|object| {
        counter.object();
        test(object)
    })
}

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

/// A node whose box the ray enters at `entry`, to be visited later. By what it names, not by its index: the node itself
/// may have left the cache by then.
#[derive(Clone, Copy)]
struct Pending {
    entry: f32,
    kind: NodeKind,
}

/// Hands the objects of leaves that the ray may meet to `leaf`, the nearest first, until it breaks. `leaf` may lower
/// the distance from which on boxes are skipped.
#[inline(always)]
fn walk<C: Counter>(
    tree: BvhView,
    ray: &Ray,
    counter: &mut C,
    mut leaf: impl FnMut(&[u32], &mut f32, &mut C) -> ControlFlow<()>,
) {
    let Some(root) = tree.nodes.first() else { return };
    let slabs = Slabs::new(ray, &root.aabb);
    let mut t_max = ray.t_max();
    counter.boxes(1);
    if slabs.entry(&root.aabb) > t_max {
        return;
    }
    let mut kind = root.kind();
    let mut stack =
        Stack::<Pending, 48>::new(Pending { entry: 0.0, kind: NodeKind::Inner { first: 0, count: 0 } });
    loop {
        match kind {
            NodeKind::Leaf { .. } => {
                if leaf(objects(tree, kind), &mut t_max, counter).is_break() {
                    return;
                }
            }
            NodeKind::Inner { first, count: 2 } => {
                counter.boxes(2);
                let pair = &tree.nodes[first as usize..first as usize + 2];
                let (a, b) = (slabs.entry(&pair[0].aabb), slabs.entry(&pair[1].aabb));
                // A branch, though often mispredicted: the processor goes on with the child it expects to be nearer
                // while the distances are still computed.
                let next = if b < a {
                    descend(tree, &pair[1], &pair[0], [b, a], &mut t_max, &mut stack, &mut leaf, counter)
                } else {
                    descend(tree, &pair[0], &pair[1], [a, b], &mut t_max, &mut stack, &mut leaf, counter)
                };
                match next {
                    ControlFlow::Continue(Some(next)) => {
                        kind = next;
                        continue;
                    }
                    ControlFlow::Continue(None) => {}
                    ControlFlow::Break(()) => return,
                }
            }
            NodeKind::Inner { first, count } => {
                counter.boxes(count as usize);
                let children = &tree.nodes[first as usize..first as usize + count as usize];
                push_sorted(children, &slabs, t_max, &mut stack);
            }
        }
        kind = loop {
            let Some(pending) = stack.pop() else { return };
            if pending.entry <= t_max {
                break pending.kind;
            }
        };
    }
}

/// Visits the nearer one of two children if it is a leaf. Returns what to visit next, if it is one of the two, and
/// pushes the farther one if that comes later.
#[inline(always)]
#[allow(clippy::too_many_arguments, reason = "the state of a walk, in registers")]
fn descend<C: Counter, const N: usize>(
    tree: BvhView,
    near: &Node,
    far: &Node,
    [near_entry, far_entry]: [f32; 2],
    t_max: &mut f32,
    stack: &mut Stack<Pending, N>,
    leaf: &mut impl FnMut(&[u32], &mut f32, &mut C) -> ControlFlow<()>,
    counter: &mut C,
) -> ControlFlow<(), Option<NodeKind>> {
    if near_entry > *t_max {
        return ControlFlow::Continue(None);
    }
    if let NodeKind::Leaf { .. } = near.kind() {
        leaf(objects(tree, near.kind()), t_max, counter)?;
        return ControlFlow::Continue((far_entry <= *t_max).then(|| far.kind()));
    }
    if far_entry <= *t_max {
        stack.push_if(true, Pending { entry: far_entry, kind: far.kind() });
    }
    ControlFlow::Continue(Some(near.kind()))
}

/// The objects of a leaf.
#[inline(always)]
fn objects(tree: BvhView<'_>, leaf: NodeKind) -> &[u32] {
    match leaf {
        NodeKind::Leaf { first, count } => &tree.prim_ids[first as usize..first as usize + count as usize],
        NodeKind::Inner { .. } => &[],
    }
}

/// Pushes the children that the ray enters, the nearest last; of two at the same distance the first one.
fn push_sorted<const N: usize>(children: &[Node], slabs: &Slabs, t_max: f32, stack: &mut Stack<Pending, N>) {
    let mut few = [(0.0, 0); 16];
    let mut many = Vec::new();
    let entered = match few.get_mut(..children.len()) {
        Some(few) => few,
        None => {
            many.resize(children.len(), (0.0, 0));
            &mut many[..]
        }
    };
    let mut count = 0;
    for (index, child) in children.iter().enumerate() {
        let entry = slabs.entry(&child.aabb);
        entered[count] = (entry, index);
        count += usize::from(entry <= t_max);
    }
    entered[..count].sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(b.1.cmp(&a.1)));
    for &(entry, index) in &entered[..count] {
        stack.push_if(true, Pending { entry, kind: children[index].kind() });
    }
}
