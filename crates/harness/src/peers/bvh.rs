//! The crate `bvh`.

use super::{Built, Raw, Theirs, convert};
use crate::measure::Query;
use crate::measure::speed::{Contender, Tracer, timed};
use ::bvh::aabb::{Aabb as TheirAabb, Bounded};
use ::bvh::bounding_hierarchy::BHShape;
use ::bvh::bvh::{Bvh as TheirBvh, BvhNode};
use ::bvh::ray::Ray as TheirRay;
use bvh_core::{Aabb, Bvh, Hit, Ray, Triangle};
use glam::Vec3;
use nalgebra::{Point3, Vector3};
use std::time::Instant;

/// A box that may know its triangle.
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

/// A ray with the library's unit direction.
fn ray(ray: &Ray) -> TheirRay<f32, 3> {
    let direction = ray.direction();
    TheirRay::new(point(ray.origin()), Vector3::new(direction.x, direction.y, direction.z))
}

fn shapes_of_boxes(boxes: &[Aabb]) -> Vec<Shape> {
    shapes(boxes.iter().map(|&aabb| (aabb, [aabb.min; 3])))
}

/// A leaf has the object's box and no other; an inner node what its two boxes contain.
fn to_ours(theirs: &TheirBvh<f32, 3>, boxes: &[Aabb]) -> Bvh {
    let corner = |p: Point3<f32>| Vec3::new(p.x, p.y, p.z);
    let aabb = |b: TheirAabb<f32, 3>| Aabb { min: corner(b.min), max: corner(b.max) };
    convert(boxes, |index| match theirs.nodes[index] {
        BvhNode::Leaf { shape_index, .. } => (boxes[shape_index], Theirs::Leaf(vec![shape_index as u32])),
        BvhNode::Node { child_l_index, child_l_aabb, child_r_index, child_r_aabb, .. } => {
            (aabb(child_l_aabb).union(&aabb(child_r_aabb)), Theirs::Inner([child_l_index, child_r_index]))
        }
    })
}

/// Builds on one thread; the library's leaves have one object.
pub(super) fn build(boxes: &[Aabb]) -> Built {
    let mut shapes = shapes_of_boxes(boxes);
    let start = Instant::now();
    let theirs = TheirBvh::build(&mut shapes);
    let seconds = start.elapsed().as_secs_f64();
    Built::tight(to_ours(&theirs, boxes), seconds, boxes)
}

/// Its recursive traversal, which collects all objects whose boxes the ray meets.
pub(super) fn raw(boxes: &[Aabb]) -> Raw {
    let mut shapes = shapes_of_boxes(boxes);
    let theirs = TheirBvh::build(&mut shapes);
    let tree = to_ours(&theirs, boxes);
    let nearest = move |ray: &Ray, test: &dyn Fn(u32) -> Option<f32>| {
        let found = theirs.traverse(&self::ray(ray), &shapes);
        found.iter().filter_map(|shape| test(shape.object)).min_by(f32::total_cmp)
    };
    Raw { tree, nearest: Box::new(nearest) }
}

/// The iterator by distance, ended at the first box that begins behind the nearest hit: of the library's traversals the
/// only one that is ordered and has no limit of depth. Its triangle test sees front sides only and is asked for both.
pub(super) fn contender(triangles: &[Triangle]) -> Contender<'_> {
    let mut shapes = shapes(triangles.iter().map(|triangle| (triangle.aabb(), triangle.0)));
    let start = Instant::now();
    let tree = TheirBvh::build(&mut shapes);
    let preparation_seconds = start.elapsed().as_secs_f64();
    let meets = |shape: &Shape, ray: &TheirRay<f32, 3>| {
        let [a, b, c] = &shape.corners;
        let front = ray.intersects_triangle(a, b, c).distance;
        if front.is_finite() { front } else { ray.intersects_triangle(a, c, b).distance }
    };
    let trace = move |query: Query, rays: &[Ray], hits: &mut [Option<Hit>]| {
        // Distances along unit vectors are converted.
        let theirs = |ray: &Ray| (self::ray(ray), ray.direction().length(), ray.t_min(), ray.t_max());
        let rays: Vec<_> = rays.iter().map(theirs).collect();
        timed(&rays, hits, |(ray, length, t_min, t_max)| {
            let mut nearest: Option<Hit> = None;
            let (low, mut high) = (t_min * length, t_max * length);
            for shape in tree.nearest_traverse_iterator(ray, &shapes) {
                let distance = meets(shape, ray);
                if distance >= low && distance <= high {
                    nearest = Some(Hit { t: distance / length, object: shape.object });
                    high = distance;
                    if query == Query::Any {
                        break;
                    }
                } else if ray.intersection_slice_for_aabb(&shape.aabb).is_some_and(|(entry, _)| entry > high) {
                    break;
                }
            }
            nearest
        })
    };
    Contender {
        layout: "binary, their own".into(),
        preparation_seconds,
        tracer: Tracer::Other(Box::new(trace)),
    }
}
