//! The points of the triangles closest to given points.

use super::answer::NEAREST_HIT;
use super::box_ray::BoxTest;
use super::double::DWideBvh;
use super::instructions::{Instructions, Pending, Task};
use super::kernel::{SPARE, STACK, deep_stacks};
use super::lanes::{DoubleLanes, Lanes, Mask};
use super::layout::{WideBvh, WideNode};
use super::obstacles::Obstacles;
use super::one_ray::{Leaves, visit};
use super::triangles::TriangleBlock;
use super::{portable, vector};
use crate::ray::pow2;
use crate::triangle::offset_from;
use crate::{Aabb, Corners, DTriangle, Frame, Hit, Kernel};
use core::mem::MaybeUninit;
use glam::{DVec3, Vec3};

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

/// The nearest triangle of a point so far.
struct Nearest {
    target: DVec3,
    object: u32,
    offset: DVec3,
    distance_squared: f64,
}

impl Nearest {
    #[inline(always)]
    fn new(target: DVec3) -> Self {
        Self { target, object: u32::MAX, offset: DVec3::ZERO, distance_squared: f64::MAX }
    }

    /// Takes a triangle if it is nearer, or as near and of a lower id; `offset` is the vector to its
    /// closest point.
    #[inline(always)]
    fn offer(&mut self, object: u32, offset: DVec3) {
        let distance_squared = offset.length_squared();
        if distance_squared < self.distance_squared
            || distance_squared == self.distance_squared && object < self.object
        {
            *self = Self { object, offset, distance_squared, ..*self };
        }
    }

    /// Returns the greatest [bound](PointLanes) that a box with a nearer triangle may have.
    #[inline(always)]
    fn limit(&self, scale: f32) -> f32 {
        let scaled = self.distance_squared * f64::from(scale) * f64::from(scale);
        let limit = (scaled * (1.0 + 1.0 / (1 << 18) as f64)) as f32 + f32::MIN_POSITIVE;
        // Beyond it are the unused lanes.
        limit.min(f32::MAX)
    }

    #[inline(always)]
    fn closest(&self) -> Option<Closest> {
        // A layout over triangles without area has nodes and no triangles.
        let is_found = self.object != u32::MAX;
        is_found.then(|| Closest {
            object: self.object,
            point: self.target + self.offset,
            distance: self.distance_squared.sqrt(),
        })
    }
}

impl WideBvh {
    /// Returns the closest point of the triangles, in f64; among triangles at the same distance the
    /// lowest id wins. Returns `None` for a point that is not finite, and if no triangle has an
    /// area: the layout omits triangles without area.
    ///
    /// The point is the point of [`Triangle::closest_point`](crate::Triangle::closest_point), and no
    /// other triangle's point is closer as computed in f64. In a layout with divided triangles that
    /// are 10¹⁵ times as large as their distances, rounding decides which of them is the closest,
    /// and kernels may differ in it; so it does in a frame with triangles that are 10⁸ times as long
    /// as high. About O(log n) for a point near triangles that are spread out.
    ///
    /// ```
    /// # use bvh_core::{Aabb, Bvh, Node, Triangle, WideBvh};
    /// let triangle = Triangle::from([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    /// # let leaf = Node::leaf(triangle.aabb(), 0, 1);
    /// # let tree = Bvh::new(vec![leaf], vec![0]);
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
        let surface = Surface { obstacles: self, frame: self.frame(), doubles: None };
        surface.closest_points(points, closest);
    }
}

impl DWideBvh {
    /// Returns the closest point of the triangles, as [`WideBvh::closest_point`] does. Returns
    /// `None`, too, for a point so far that the square of its distance overflows.
    pub fn closest_point(&self, point: impl Into<DVec3>) -> Option<Closest> {
        let mut closest = [None];
        self.closest_points(&[point.into()], &mut closest);
        closest[0]
    }

    /// Writes the [closest point](Self::closest_point) of every point.
    ///
    /// # Panics
    /// Panics if `points` and `closest` are not equally many.
    pub fn closest_points(&self, points: &[DVec3], closest: &mut [Option<Closest>]) {
        let doubles = Some(&self.triangles[..]);
        let surface = Surface { obstacles: self, frame: Some(&self.frame), doubles };
        surface.closest_points(points, closest);
    }
}

/// A layout of triangles in f32 or in f64.
struct Surface<'a, O> {
    obstacles: &'a O,
    /// The frame of the boxes, if it is not the file's.
    frame: Option<&'a Frame>,
    /// The triangles by id, if they are in f64.
    doubles: Option<&'a [DTriangle]>,
}

impl<O: Obstacles> Surface<'_, O> {
    fn closest_points(&self, points: &[O::Point], closest: &mut [Option<Closest>]) {
        assert_eq!(points.len(), closest.len(), "an answer for every point");
        let kernel = self.obstacles.boxes().kernel;
        if kernel != Kernel::Portable {
            let task = ClosestPoints { surface: self, points, closest };
            // SAFETY: a layout's kernel is available.
            return unsafe { vector::dispatch(kernel, task) };
        }
        for (&point, closest) in points.iter().zip(closest) {
            *closest = self.closest_portable(point.into());
        }
    }

    /// Returns a point as the distances of boxes are computed from it; `None` if it is not finite.
    #[inline(always)]
    fn boxed(&self, point: DVec3) -> Option<Vec3> {
        // A point that is moved nearer is not farther from any box.
        let in_frame = |frame: &Frame| frame.point(point).as_vec3().clamp(Vec3::MIN, Vec3::MAX);
        let boxed = self.frame.map_or(point.as_vec3(), in_frame);
        (point.is_finite() && boxed.is_finite()).then_some(boxed)
    }

    fn closest_portable(&self, target: DVec3) -> Option<Closest> {
        let wide = self.obstacles.boxes();
        let boxed = self.boxed(target)?;
        let mut nearest = Nearest::new(target);
        let scale = scale(boxed, wide.root_box());
        let scaled = (boxed * scale).to_array();
        let intervals = |node: &WideNode| {
            let mut sums = [0.0; WideNode::LANES];
            for (axis, &scaled) in scaled.iter().enumerate() {
                for (lane, sum) in sums.iter_mut().enumerate() {
                    let below = node.planes[axis][lane] * scale - scaled;
                    let above = scaled - node.planes[axis + 3][lane] * scale;
                    let outside = below.max(above).max(0.0);
                    *sum += outside * outside;
                }
            }
            // Unused lanes are infinitely far away.
            (sums, [f32::MAX; WideNode::LANES])
        };
        let visit = |block: &TriangleBlock, limit: &mut Hit| {
            for (object, triangle) in block.triangles() {
                let corners = match self.doubles {
                    None => triangle.corners(),
                    Some(triangles) => triangles[object as usize].0,
                };
                nearest.offer(object, offset_from(target, corners));
            }
            limit.t = nearest.limit(scale);
            false
        };
        portable::traverse::<NEAREST_HIT>(wide, f32::MAX, intervals, &mut (), visit);
        nearest.closest()
    }
}

/// Returns the power of two that makes the largest coordinate about 1, so that no square overflows.
fn scale(point: Vec3, bounds: &Aabb) -> f32 {
    let size = point.abs().max(bounds.min.abs()).max(bounds.max.abs()).max_element();
    let exponent = (size.to_bits() >> 23) as i32 - 127;
    pow2((-exponent).clamp(-126, 126))
}

/// The search for the closest points of points by a vector kernel.
struct ClosestPoints<'a, O: Obstacles> {
    surface: &'a Surface<'a, O>,
    points: &'a [O::Point],
    closest: &'a mut [Option<Closest>],
}

impl<K: Instructions, O: Obstacles> Task<K> for ClosestPoints<'_, O> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { surface, points, closest } = self;
        let wide = surface.obstacles.boxes();
        let mut stack = [const { MaybeUninit::<Pending>::uninit() }; STACK + SPARE];
        let mut deep = deep_stacks::<Pending>(1, wide.stack_need);
        let stack =
            deep.as_mut().map_or(stack.as_mut_ptr().cast(), |deep| deep.as_mut_ptr().cast());
        for (&point, closest) in points.iter().zip(closest) {
            let target = point.into();
            let Some(boxed) = surface.boxed(target) else {
                *closest = None;
                continue;
            };
            // SAFETY: the processor has the instructions; the stack has room for `stack_need`
            // children and one register more.
            *closest = unsafe {
                let boxes = PointLanes::<K::Boxes>::new(boxed, wide.root_box());
                let scale = boxes.scale_of_one;
                let mut triangles =
                    TargetLanes::<_, K::Block>::new(surface.obstacles, target, scale);
                // Unused lanes are infinitely far away.
                visit::<K, NEAREST_HIT>(wide, f32::MAX, &boxes, &mut triangles, stack);
                triangles.nearest.closest()
            };
        }
    }
}

/// A point as boxes are tested with it: in f32, [scaled](scale()).
///
/// The computed square of a distance exceeds the real one by at most 2⁻²⁰ of it, and by at most
/// 2⁻¹⁴⁰ where numbers are subnormal. A [frame](crate::frame) adds 2⁻²³ of the square, since what
/// its errors have in common with the box is in the pad. The [limit](Nearest::limit) adds more than
/// all of these.
struct PointLanes<L> {
    scaled: [L; 3],
    scale: L,
    scale_of_one: f32,
}

impl<L: Lanes> PointLanes<L> {
    #[inline(always)]
    unsafe fn new(point: Vec3, bounds: &Aabb) -> Self {
        let scale = scale(point, bounds);
        let [x, y, z] = (point * scale).to_array();
        // SAFETY: the processor has the instructions.
        unsafe {
            Self {
                scaled: [L::splat(x), L::splat(y), L::splat(z)],
                scale: L::splat(scale),
                scale_of_one: scale,
            }
        }
    }
}

impl<K: Instructions> BoxTest<K> for PointLanes<K::Boxes> {
    /// Returns keys by bounds of the scaled squared distances from the boxes of a node, ∞ for unused
    /// lanes, and a bit for each box whose bound is at most `limit`.
    #[inline(always)]
    unsafe fn boxes(&self, node: &WideNode, limit: f32) -> (K::Boxes, u32) {
        let zero = self.scale.filled(0.0);
        let mut sum = zero;
        for axis in 0..3 {
            // SAFETY: planes are aligned.
            let (lower, upper) = unsafe {
                let lower = K::Boxes::load(node.planes[axis].as_ptr());
                (lower, K::Boxes::load(node.planes[axis + 3].as_ptr()))
            };
            let below = lower * self.scale - self.scaled[axis];
            let above = self.scaled[axis] - upper * self.scale;
            let outside = zero.max(below.max(above));
            sum = outside.mul_add(outside, sum);
        }
        // SAFETY: the processor has the instructions.
        unsafe { K::keys(sum, sum.le(sum.filled(limit))) }
    }
}

/// A point in f64, in the lanes of a block of triangles, and its nearest triangle.
struct TargetLanes<'a, O, L: Lanes> {
    obstacles: &'a O,
    target: [L::Double; 3],
    nearest: Nearest,
    scale: f32,
}

type Vector<D> = [D; 3];

impl<'a, O: Obstacles, L: Lanes> TargetLanes<'a, O, L> {
    #[inline(always)]
    unsafe fn new(obstacles: &'a O, target: DVec3, scale: f32) -> Self {
        let nearest = Nearest::new(target);
        let DVec3 { x, y, z } = target;
        // SAFETY: the processor has the instructions.
        let target = unsafe { [L::Double::splat(x), L::Double::splat(y), L::Double::splat(z)] };
        Self { obstacles, target, nearest, scale }
    }
}

impl<K: Instructions, O: Obstacles> Leaves<K> for TargetLanes<'_, O, K::Block> {
    /// Offers the triangles of a block that are as near as the nearest so far, and lowers `limit` to
    /// the greatest bound that a box with a nearer triangle may have.
    #[inline(always)]
    unsafe fn visit(&mut self, block: &TriangleBlock, limit: &mut Hit) -> bool {
        // SAFETY: the processor has the instructions; there is room for four numbers.
        unsafe {
            let [a, b, c] = self.obstacles.corners::<K::Block>(block, [0, 1, 2]);
            let target = self.target;
            let offset = offset(minus(a, target), minus(b, target), minus(c, target));
            let most = offset[0].filled(self.nearest.distance_squared);
            let mut lanes = K::Block::narrow(dot(offset, offset).le(most)).bits();
            if lanes == 0 {
                return false;
            }
            let mut components = [[0.0; TriangleBlock::LANES]; 3];
            for (component, lanes) in components.iter_mut().zip(offset) {
                lanes.store(component.as_mut_ptr());
            }
            let [x, y, z] = components;
            while lanes != 0 {
                let lane = lanes.trailing_zeros() as usize & 3;
                lanes &= lanes - 1;
                // An unused lane repeats a triangle, and its id is greater.
                self.nearest.offer(block.id(lane), DVec3::new(x[lane], y[lane], z[lane]));
            }
            limit.t = self.nearest.limit(self.scale);
            true
        }
    }
}

/// Returns the vectors to the nearest points of triangles: the operations of
/// [`offset_from`], bit by bit.
#[inline(always)]
fn offset<D: DoubleLanes>(a: Vector<D>, b: Vector<D>, c: Vector<D>) -> Vector<D> {
    let normal = cross(minus(b, a), minus(c, a));
    let zero = normal[0].filled(0.0);
    let is_inside = zero.lt(dot(normal, cross(a, b)))
        & zero.lt(dot(normal, cross(b, c)))
        & zero.lt(dot(normal, cross(c, a)));
    let inside = times(normal, dot(normal, a) / dot(normal, normal));
    let inside = into_box(inside, lesser(lesser(a, b), c), greater(greater(a, b), c));
    let mut nearest = nearest_of_edge(a, b);
    let mut distance = dot(nearest, nearest);
    let offset = nearest_of_edge(b, c);
    let other = dot(offset, offset);
    let is_nearer = other.lt(distance);
    nearest = select(is_nearer, offset, nearest);
    distance = D::select(is_nearer, other, distance);
    let offset = nearest_of_edge(c, a);
    let is_nearer = dot(offset, offset).lt(distance);
    nearest = select(is_nearer, offset, nearest);
    select(is_inside, inside, nearest)
}

#[inline(always)]
fn nearest_of_edge<D: DoubleLanes>(from: Vector<D>, to: Vector<D>) -> Vector<D> {
    let [fx, fy, fz] = from;
    let [tx, ty, tz] = to;
    let is_ordered = fx.lt(tx) | fx.eq(tx) & (fy.lt(ty) | fy.eq(ty) & fz.le(tz));
    let first = select(is_ordered, from, to);
    let second = select(is_ordered, to, from);
    let edge = minus(second, first);
    let zero = fx.filled(0.0);
    let along = zero - dot(first, edge);
    let length_squared = dot(edge, edge);
    let between = times(edge, along / length_squared);
    let nearest = plus(first, between);
    let nearest = into_box(nearest, lesser(first, second), greater(first, second));
    let nearest = select(length_squared.le(along), second, nearest);
    select(along.le(zero), first, nearest)
}

#[inline(always)]
fn select<D: DoubleLanes>(mask: D::Mask, yes: Vector<D>, no: Vector<D>) -> Vector<D> {
    let x = D::select(mask, yes[0], no[0]);
    let y = D::select(mask, yes[1], no[1]);
    let z = D::select(mask, yes[2], no[2]);
    [x, y, z]
}

#[inline(always)]
fn into_box<D: DoubleLanes>(point: Vector<D>, min: Vector<D>, max: Vector<D>) -> Vector<D> {
    lesser(max, greater(min, point))
}

#[inline(always)]
fn lesser<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> Vector<D> {
    [a[0].min(b[0]), a[1].min(b[1]), a[2].min(b[2])]
}

#[inline(always)]
fn greater<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> Vector<D> {
    [a[0].max(b[0]), a[1].max(b[1]), a[2].max(b[2])]
}

#[inline(always)]
fn plus<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> Vector<D> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn minus<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> Vector<D> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn times<D: DoubleLanes>(a: Vector<D>, factor: D) -> Vector<D> {
    [a[0] * factor, a[1] * factor, a[2] * factor]
}

#[inline(always)]
fn dot<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> D {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline(always)]
fn cross<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> Vector<D> {
    [a[1] * b[2] - b[1] * a[2], a[2] * b[0] - b[2] * a[0], a[0] * b[1] - b[0] * a[1]]
}
