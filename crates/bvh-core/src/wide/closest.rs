//! The points of the triangles closest to given points, and signed distances.

use super::layout::WideBvh;
use super::node::{Child, WideNode};
use super::triangles::TriangleBlock;
use crate::query::Near;
use alloc::vec::Vec;
use glam::{DVec3, Vec3, Vec4};

/// The point of a mesh that is closest to a given point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closest {
    /// The triangle that contains it; of several the one of the lowest id.
    pub object: u32,
    /// The closest point.
    pub point: DVec3,
    /// Its distance from the given point, 0 or more.
    pub distance: f64,
}

/// A child that is visited later, and a lower bound of the squared distances of its triangles.
#[derive(Clone, Copy)]
struct Pending {
    bound: f64,
    child: Child,
}

impl WideBvh {
    /// Returns the closest point of the triangles, in f64; among triangles at the same distance the
    /// lowest id wins. Returns `None` for a point that is not finite, and if no triangle has an area:
    /// the layout omits triangles without area.
    ///
    /// The answer is the answer of [`Triangle::closest_point`](crate::Triangle::closest_point) for every
    /// triangle. About O(log n) for a point near triangles that are spread out.
    ///
    /// ```
    /// # use bvh_core::{Aabb, Bvh, Node, Triangle, WideBvh};
    /// let triangle = Triangle::from([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    /// # let leaf = Node::leaf(triangle.aabb(), 0, 1);
    /// # let tree = Bvh { nodes: vec![leaf], prim_ids: vec![0] };
    /// let wide = WideBvh::new(&tree, &[triangle])?;
    /// let closest = wide.closest_point([0.25, 0.25, 3.0]).unwrap();
    /// assert_eq!((closest.object, closest.distance), (0, 3.0));
    /// assert_eq!(closest.point.to_array(), [0.25, 0.25, 0.0]);
    /// # Ok::<(), bvh_core::InvalidBvh>(())
    /// ```
    pub fn closest_point(&self, point: impl Into<Vec3>) -> Option<Closest> {
        let mut closest = [None];
        self.closest_points(&[point.into()], &mut closest);
        closest[0]
    }

    /// Writes the [closest point](Self::closest_point) of every point.
    ///
    /// # Panics
    /// Panics if `points` and `closest` are not equally many.
    pub fn closest_points(&self, points: &[Vec3], closest: &mut [Option<Closest>]) {
        assert_eq!(points.len(), closest.len(), "an answer for every point");
        closest_of_all(self, points, closest);
    }

    /// Writes the distance of every point from the [closest point](Self::closest_point), negative if the
    /// mesh [contains](Self::contains) the point: the sign follows from parity, and is right for
    /// closed meshes. Infinite where there is no closest point.
    ///
    /// # Panics
    /// Panics if `points` and `distances` are not equally many.
    pub fn signed_distances(&self, points: &[Vec3], distances: &mut [f64]) {
        assert_eq!(points.len(), distances.len(), "a distance for every point");
        let mut inside = alloc::vec![false; points.len()];
        self.contains(points, &mut inside);
        let mut closest = alloc::vec![None; points.len()];
        self.closest_points(points, &mut closest);
        for ((closest, inside), distance) in closest.iter().zip(inside).zip(distances) {
            let size = closest.map_or(f64::INFINITY, |closest| closest.distance);
            *distance = if inside { -size } else { size };
        }
    }

    #[inline(always)]
    fn closest(&self, point: Vec3, stack: &mut Vec<Pending>) -> Option<Closest> {
        let mut child = self.root.filter(|_| point.is_finite())?;
        let target = point.as_dvec3();
        let mut nearest = Near { object: u32::MAX, distance_squared: f64::INFINITY };
        let mut closest = DVec3::ZERO;
        let scale = 1.0 / f64::from(point.abs().max_element().max(self.largest));
        stack.clear();
        loop {
            if child.is_node() {
                let node = &self.nodes[child.index()];
                let bounds = bounds(node, point);
                let first = stack.len();
                for (lane, &bound) in bounds.iter().enumerate() {
                    // False for unused lanes, which are NaN.
                    if bound <= nearest.distance_squared {
                        let mut at = stack.len();
                        stack.push(Pending { bound, child: node.children[lane] });
                        // Insertion, the nearest child last.
                        while at > first && stack[at - 1].bound < bound {
                            stack.swap(at - 1, at);
                            at -= 1;
                        }
                    }
                }
            } else {
                for block in &self.blocks[child.index()..] {
                    let limit = libm::sqrt(nearest.distance_squared) * scale + SLACK;
                    let mut lanes = near_lanes(block, point, scale as f32, limit as f32);
                    while lanes != 0 {
                        let lane = lanes.trailing_zeros() as usize;
                        lanes &= lanes - 1;
                        let Some((object, triangle)) = block.triangle(lane) else { continue };
                        let offset = triangle.offset_from(target);
                        let near = Near { object, distance_squared: offset.length_squared() };
                        if near < nearest {
                            nearest = near;
                            closest = target + offset;
                        }
                    }
                    if block.is_last() {
                        break;
                    }
                }
            }
            child = loop {
                let Some(pending) = stack.pop() else {
                    return Some(Closest {
                        object: nearest.object,
                        point: closest,
                        distance: libm::sqrt(nearest.distance_squared),
                    });
                };
                if pending.bound <= nearest.distance_squared {
                    break pending.child;
                }
            };
        }
    }
}

#[cfg(feature = "std")]
crate::with_vector_instructions! {
    /// Writes the closest point of every point.
    closest_of_all = closest_of_all_plain(
        wide: &WideBvh, points: &[Vec3], closest: &mut [Option<Closest>],
    )
}
#[cfg(not(feature = "std"))]
use closest_of_all_plain as closest_of_all;

#[inline(always)]
fn closest_of_all_plain(wide: &WideBvh, points: &[Vec3], closest: &mut [Option<Closest>]) {
    let mut stack = Vec::new();
    for (&point, closest) in points.iter().zip(closest) {
        *closest = wide.closest(point, &mut stack);
    }
}

/// The part of the largest coordinate by which distances in f32 may be too large; their error is some
/// dozen units in the last place, 2⁻²⁴ each.
const SLACK: f64 = 1.0 / (1 << 16) as f64;

/// Returns a bit per triangle whose scaled distance from the point may be at most `limit`: the distances
/// of four triangles at once, in f32, where `scale` makes the largest coordinate 1. A triangle so small
/// that its normal underflows is smaller than the slack, and its edges are as near as its inside. NaN
/// counts as near.
#[inline(always)]
fn near_lanes(block: &TriangleBlock, point: Vec3, scale: f32, limit: f32) -> u32 {
    let corner = |corner: &[[f32; TriangleBlock::LANES]; 3]| {
        Lanes3([0, 1, 2].map(|axis| (Vec4::from(corner[axis]) - Vec4::splat(point[axis])) * scale))
    };
    let [a, b, c] = block.corners.each_ref().map(corner);
    let to_edge = |from: Lanes3, to: Lanes3| {
        let edge = to.minus(from);
        let along = -from.dot(edge) / edge.dot(edge);
        let along = along.max(Vec4::ZERO).min(Vec4::ONE);
        let nearest = Lanes3([0, 1, 2].map(|axis| from.0[axis] + edge.0[axis] * along));
        nearest.dot(nearest)
    };
    let edges = to_edge(a, b)
        .min(to_edge(b, c))
        .min(to_edge(c, a));
    let normal = b.minus(a).cross(c.minus(a));
    let inside = |from: Lanes3, to: Lanes3| normal.dot(from.cross(to)).cmpgt(Vec4::ZERO);
    let height = normal.dot(a);
    let plane = height * height / normal.dot(normal);
    let is_inside = inside(a, b) & inside(b, c) & inside(c, a);
    let nearest = Vec4::select(is_inside, plane.min(edges), edges);
    !nearest
        .cmpgt(Vec4::splat(limit * limit))
        .bitmask()
        & 15
}

/// Four vectors.
#[derive(Clone, Copy)]
struct Lanes3([Vec4; 3]);

impl Lanes3 {
    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        Self([0, 1, 2].map(|axis| self.0[axis] - other.0[axis]))
    }

    #[inline(always)]
    fn dot(self, other: Self) -> Vec4 {
        let [x, y, z] = self.0;
        x * other.0[0] + y * other.0[1] + z * other.0[2]
    }

    #[inline(always)]
    fn cross(self, other: Self) -> Self {
        let [x, y, z] = self.0;
        let [u, v, w] = other.0;
        Self([y * w - z * v, z * u - x * w, x * v - y * u])
    }
}

/// Returns lower bounds of the squared distances of a point from the boxes of a node; NaN for unused
/// lanes.
#[inline(always)]
fn bounds(node: &WideNode, point: Vec3) -> [f64; WideNode::LANES] {
    /// Covers the rounding of the differences in f32, and all rounding in f64.
    const ROUNDING: f64 = 1.0 - 1.0 / (1 << 21) as f64;
    let mut bounds = [0.0; WideNode::LANES];
    for axis in 0..3 {
        let lower = &node.planes[axis];
        let upper = &node.planes[axis + 3];
        for lane in 0..WideNode::LANES {
            let below = lower[lane] - point[axis];
            let above = point[axis] - upper[lane];
            // Comparisons that keep NaN.
            let outside = if below > above { below } else { above };
            let outside = f64::from(if outside < 0.0 { 0.0 } else { outside });
            bounds[lane] += outside * outside;
        }
    }
    bounds.map(|bound| bound * ROUNDING)
}
