//! The crate `bvh`.

use super::Built;
use crate::measure::contender::{Batch, Contender, Tracer, timed};
use crate::measure::layout::COMPILED;
use ::bvh::aabb::{Aabb as TheirAabb, Bounded};
use ::bvh::bounding_hierarchy::BHShape;
use ::bvh::bvh::{Bvh as TheirBvh, BvhNode};
use ::bvh::ray::Ray as TheirRay;
use bvh_core::{Aabb, Bvh, Hit, Node, Ray, Triangle};
use bvh_scenes::trace::Query;
use glam::Vec3;
use nalgebra::{Point3, Vector3};
use std::time::Instant;

/// An object's box, and its corners if it is a triangle.
#[derive(Clone)]
struct Shape {
    aabb: TheirAabb<f32, 3>,
    corners: [Point3<f32>; 3],
    object: u32,
    node: usize,
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

fn point(p: Vec3) -> Point3<f32> {
    Point3::new(p.x, p.y, p.z)
}

fn shapes<'a>(boxes: impl Iterator<Item = (Aabb, [Vec3; 3])> + 'a) -> Vec<Shape> {
    let shape = |(object, (aabb, corners)): (u32, (Aabb, [Vec3; 3]))| Shape {
        aabb: TheirAabb { min: point(aabb.min), max: point(aabb.max) },
        corners: corners.map(point),
        object,
        node: 0,
    };
    (0..).zip(boxes).map(shape).collect()
}

/// Converts a ray to the library's type, which normalises its direction.
fn ray(ray: &Ray) -> TheirRay<f32, 3> {
    let direction = ray.direction();
    TheirRay::new(point(ray.origin()), Vector3::new(direction.x, direction.y, direction.z))
}

/// Converts a tree to our type.
///
/// The library keeps the boxes of children in their parent, and none for the root or in leaves.
/// Here an inner node gets the union of its children's boxes, and a leaf its object's box.
fn to_ours(theirs: &TheirBvh<f32, 3>, boxes: &[Aabb]) -> Bvh {
    let corner = |p: Point3<f32>| Vec3::new(p.x, p.y, p.z);
    let aabb = |b: TheirAabb<f32, 3>| Aabb { min: corner(b.min), max: corner(b.max) };
    let unknown = Node::leaf(Aabb::EMPTY, 0, 0);
    let mut nodes = vec![unknown; boxes.len().min(1)];
    let mut prim_ids = Vec::new();
    let mut open = vec![(0, 0); nodes.len()];
    while let Some((from, to)) = open.pop() {
        nodes[to] = match theirs.nodes[from] {
            BvhNode::Leaf { shape_index, .. } => {
                prim_ids.push(shape_index as u32);
                Node::leaf(boxes[shape_index], prim_ids.len() as u32 - 1, 1)
            }
            BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } => {
                let first = nodes.len();
                nodes.extend([unknown; 2]);
                open.extend([(child_r_index, first + 1), (child_l_index, first)]);
                Node::inner(aabb(child_l_aabb).union(&aabb(child_r_aabb)), first as u32, 2)
            }
        };
    }
    Bvh { nodes, prim_ids }
}

/// Builds on one thread; the library's leaves have one object.
pub(super) fn build(boxes: &[Aabb]) -> Built {
    // Building reads no corners.
    let mut shapes = shapes(boxes.iter().map(|&aabb| (aabb, [aabb.min; 3])));
    let start = Instant::now();
    let theirs = TheirBvh::build(&mut shapes);
    let seconds = start.elapsed().as_secs_f64();
    Built::tight(to_ours(&theirs, boxes), seconds, boxes)
}

/// The iterator by distance, ended at the first box that begins behind the nearest hit: the
/// library's only traversal that is ordered and works at any depth. Its triangle test sees front
/// sides only, so each triangle is tested both ways round.
pub(super) fn contender(triangles: &[Triangle]) -> Contender<'_> {
    let mut shapes = shapes(
        triangles
            .iter()
            .map(|triangle| (triangle.aabb(), triangle.0)),
    );
    let start = Instant::now();
    let tree = TheirBvh::build(&mut shapes);
    let preparation_seconds = start.elapsed().as_secs_f64();
    let meets = |shape: &Shape, ray: &TheirRay<f32, 3>| {
        let [a, b, c] = &shape.corners;
        // The library culls back sides, and our rays hit both sides.
        let front = ray.intersects_triangle(a, b, c).distance;
        if front.is_finite() { front } else { ray.intersects_triangle(a, c, b).distance }
    };
    let trace = move |batch: &Batch, hits: &mut [Option<Hit>]| {
        // Distances along unit vectors are converted.
        let theirs =
            |ray: &Ray| (self::ray(ray), ray.direction().length(), ray.t_min(), ray.t_max());
        let rays: Vec<_> = batch.rays.iter().map(theirs).collect();
        Ok(timed(&rays, hits, |(ray, length, t_min, t_max)| {
            let mut nearest: Option<Hit> = None;
            let low = t_min * length;
            let mut high = t_max * length;
            for shape in tree.nearest_traverse_iterator(ray, &shapes) {
                let distance = meets(shape, ray);
                if distance >= low && distance <= high {
                    nearest = Some(Hit { t: distance / length, object: shape.object });
                    high = distance;
                    if batch.query == Query::Any {
                        break;
                    }
                } else if ray
                    .intersection_slice_for_aabb(&shape.aabb)
                    .is_some_and(|(entry, _)| entry > high)
                {
                    break;
                }
            }
            nearest
        }))
    };
    Contender {
        layout: "binary, their own".into(),
        instructions: COMPILED.into(),
        version: env!("HARNESS_BVH").into(),
        preparation_seconds,
        tracer: Tracer::Other(Box::new(trace)),
    }
}
