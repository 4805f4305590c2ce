//! The crate `bvh`: binned surface area heuristic. It has no settings.

use crate::tracing::contender::{Batch, Contender, Trace, Tracer, timed};
use crate::tracing::layout::COMPILED;
use crate::{Racer, tight};
use ::bvh::aabb::{Aabb as TheirAabb, Bounded};
use ::bvh::bounding_hierarchy::BHShape;
use ::bvh::bvh::{Bvh as TheirBvh, BvhNode};
use ::bvh::ray::Ray as TheirRay;
use bvh_config::{OutOfRange, fault};
use bvh_core::{Aabb, Bvh, Hit, Node, Ray, Triangle};
use bvh_scenes::trace::Query;
use glam::Vec3;
use harness::peers::{BuildFault, Built, Library, Task};
use nalgebra::{Point3, Vector3};
use std::time::Instant;
use toml::Table;

bvh_config::config! { serde;
    /// The settings of the library, which has none.
    pub struct NoSettings {}
}

/// The crate as a method.
pub struct Crate;

impl Library for Crate {
    fn name(&self) -> &'static str {
        "bvh"
    }

    fn check(&self, settings: &Table) -> Result<(), OutOfRange> {
        fault::deserialize::<NoSettings>(settings.clone()).map(|_| ())
    }

    fn build(&self, settings: &Table, task: &Task) -> Result<Built, BuildFault> {
        self.check(settings)?;
        Ok(build(task.boxes))
    }
}

impl Racer for Crate {
    fn contenders<'a>(
        &self,
        settings: &Table,
        triangles: &'a [Triangle],
    ) -> Result<Vec<Contender<'a>>, OutOfRange> {
        self.check(settings)?;
        Ok(vec![contender(triangles)])
    }
}

/// An object as the library stores it. Only the tracing of rays reads the corners.
#[derive(Clone)]
pub struct Shape {
    aabb: TheirAabb<f32, 3>,
    corners: [Point3<f32>; 3],
    /// The object's index in the scene. The library keeps the order of the shapes, but its
    /// iterators return shapes without their indices.
    object: u32,
    /// The index of the shape's leaf, which the library writes.
    node: usize,
}

/// Returns triangles as the library stores them.
pub fn shapes(triangles: &[Triangle]) -> Vec<Shape> {
    let shape =
        |(object, triangle): (u32, &Triangle)| Shape::new(object, triangle.aabb(), triangle.0);
    (0..).zip(triangles).map(shape).collect()
}

/// Converts a tree that [`Target::BVH`](bvh_core::export::Target::BVH) fits, and tells the shapes,
/// in the order of its objects, their leaves. A divided shape is told the last one.
pub fn to_theirs(tree: &Bvh, shapes: &mut [Shape]) -> TheirBvh<f32, 3> {
    let ours = tree.to_first_count();
    let mut parents = vec![0; ours.len()];
    let mut nodes = Vec::new();
    for (index, node) in ours.iter().enumerate() {
        let (first, parent_index) = (node.first as usize, parents[index]);
        if node.count > 0 {
            let shape_index = tree.prim_ids[first] as usize;
            shapes[shape_index].node = index;
            nodes.push(BvhNode::Leaf { parent_index, shape_index });
            continue;
        }
        parents[first..first + 2].fill(index);
        let [child_l_aabb, child_r_aabb] = [first, first + 1]
            .map(|child| TheirAabb { min: ours[child].min.into(), max: ours[child].max.into() });
        nodes.push(BvhNode::Node {
            parent_index,
            child_l_index: first,
            child_l_aabb,
            child_r_index: first + 1,
            child_r_aabb,
        });
    }
    TheirBvh { nodes }
}

impl Shape {
    fn new(object: u32, aabb: Aabb, corners: [Vec3; 3]) -> Self {
        Self { aabb: to_their_box(aabb), corners: corners.map(to_their_point), object, node: 0 }
    }
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> TheirAabb<f32, 3> {
        self.aabb
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

fn to_their_point(point: Vec3) -> Point3<f32> {
    Point3::new(point.x, point.y, point.z)
}

fn to_our_point(point: Point3<f32>) -> Vec3 {
    Vec3::new(point.x, point.y, point.z)
}

fn to_their_box(aabb: Aabb) -> TheirAabb<f32, 3> {
    TheirAabb { min: to_their_point(aabb.min), max: to_their_point(aabb.max) }
}

fn to_our_box(aabb: TheirAabb<f32, 3>) -> Aabb {
    Aabb { min: to_our_point(aabb.min), max: to_our_point(aabb.max) }
}

/// Converts a tree to our type.
///
/// The library keeps the boxes of children in their parent, and none for the root or in leaves.
/// Here an inner node gets the union of its children's boxes, and a leaf its object's box.
pub fn to_our_tree(theirs: &TheirBvh<f32, 3>, boxes: &[Aabb]) -> Bvh {
    if boxes.is_empty() {
        return Bvh::default();
    }
    // Both children of a node get their places at once, so that siblings are adjacent.
    let reserved = Node::leaf(Aabb::EMPTY, 0, 0);
    let mut nodes = vec![reserved];
    let mut prim_ids = Vec::new();
    // Nodes to be converted: the index of the library's node, and the index of its reserved place.
    let mut open = vec![(0, 0)];
    while let Some((from, to)) = open.pop() {
        nodes[to] = match theirs.nodes[from] {
            BvhNode::Leaf { shape_index, .. } => {
                prim_ids.push(shape_index as u32);
                Node::leaf(boxes[shape_index], prim_ids.len() as u32 - 1, 1)
            }
            BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } => {
                let first = nodes.len();
                nodes.extend([reserved; 2]);
                open.extend([(child_r_index, first + 1), (child_l_index, first)]);
                let aabb = to_our_box(child_l_aabb).union(&to_our_box(child_r_aabb));
                Node::inner(aabb, first as u32, 2)
            }
        };
    }
    Bvh::new(nodes, prim_ids)
}

/// Builds on one thread; the library's leaves have one object.
pub fn build(boxes: &[Aabb]) -> Built {
    let mut shapes: Vec<Shape> =
        (0..).zip(boxes).map(|(object, &aabb)| Shape::new(object, aabb, [aabb.min; 3])).collect();
    let start = Instant::now();
    let theirs = TheirBvh::build(&mut shapes);
    let seconds = start.elapsed().as_secs_f64();
    tight(to_our_tree(&theirs, boxes), seconds, boxes)
}

/// A ray of ours and the same ray as the library's type, which has a unit direction and no range.
struct PreparedRay {
    theirs: TheirRay<f32, 3>,
    /// The length of our direction: the library's distances over ours.
    length: f32,
    /// The range in the library's distances.
    low: f32,
    high: f32,
}

impl PreparedRay {
    fn new(ray: &Ray) -> Self {
        let direction = ray.direction();
        let length = direction.length();
        Self {
            theirs: TheirRay::new(
                to_their_point(ray.origin()),
                Vector3::new(direction.x, direction.y, direction.z),
            ),
            length,
            low: ray.t_min() * length,
            high: ray.t_max() * length,
        }
    }

    /// Returns the library's distance of the triangle, infinite if the ray's line misses it.
    #[inline(always)]
    fn distance(&self, shape: &Shape) -> f32 {
        let [a, b, c] = &shape.corners;
        // The library's test sees front sides only, and our rays hit both sides.
        let front = self.theirs.intersects_triangle(a, b, c).distance;
        if front.is_finite() {
            return front;
        }
        self.theirs.intersects_triangle(a, c, b).distance
    }

    /// Returns whether the ray enters the shape's box behind `limit`, a distance of the library.
    #[inline(always)]
    fn enters_behind(&self, shape: &Shape, limit: f32) -> bool {
        self.theirs.intersection_slice_for_aabb(&shape.aabb).is_some_and(|(entry, _)| entry > limit)
    }

    /// Returns the nearest hit in the ray's range, or for [`Query::Any`] the first one found, by
    /// the library's iterator over boxes in the order of their distances. The search ends at the
    /// first box behind the nearest hit. This traversal is the library's only one that is ordered
    /// and works at any depth.
    #[inline(always)]
    fn hit(&self, tree: &TheirBvh<f32, 3>, shapes: &[Shape], query: Query) -> Option<Hit> {
        let mut nearest = None;
        let mut high = self.high;
        for shape in tree.nearest_traverse_iterator(&self.theirs, shapes) {
            let distance = self.distance(shape);
            if distance >= self.low && distance <= high {
                nearest = Some(Hit { t: distance / self.length, object: shape.object });
                high = distance;
                if query == Query::Any {
                    break;
                }
            } else if self.enters_behind(shape, high) {
                break;
            }
        }
        nearest
    }
}

/// Returns the traversal of a tree over shapes, which know their leaves.
pub fn trace(tree: TheirBvh<f32, 3>, shapes: Vec<Shape>) -> Trace<'static> {
    Box::new(move |batch: &Batch, hits: &mut [Option<Hit>]| {
        let rays: Vec<PreparedRay> = batch.rays.iter().map(PreparedRay::new).collect();
        Ok(timed(&rays, hits, |ray| ray.hit(&tree, &shapes, batch.query)))
    })
}

/// Builds the library's tree over triangles and returns its traversal.
fn contender(triangles: &[Triangle]) -> Contender<'_> {
    let mut shapes = shapes(triangles);
    let start = Instant::now();
    let tree = TheirBvh::build(&mut shapes);
    let preparation_seconds = start.elapsed().as_secs_f64();
    Contender {
        layout: "binary, their own".into(),
        instructions: COMPILED.into(),
        version: env!("ATTIC_BVH").into(),
        preparation_seconds,
        tracer: Tracer::Other(trace(tree, shapes)),
    }
}
