//! The triangles closest to points, four triangles and eight boxes at once.

use super::instructions::{Instructions, Pending};
use super::kernel::{DeepStacks, SPARE, STACK};
use super::lanes::{DoubleLanes, Lanes, Mask};
use super::layout::WideBvh;
use super::nearest::{Closest, Nearest};
use super::node::{Child, WideNode};
use super::triangles::TriangleBlock;
use crate::Aabb;
use crate::ray::pow2;
use core::mem::MaybeUninit;
use glam::{DVec3, Vec3};

/// Writes the closest point of every point.
///
/// # Safety
/// The processor has the instructions of `K`, and the caller is compiled with them; the references
/// of `wide` are sound.
#[inline(always)]
pub(crate) unsafe fn trace<K: Instructions>(
    wide: &WideBvh,
    points: &[Vec3],
    closest: &mut [Option<Closest>],
) {
    let mut stack = [const { MaybeUninit::<Pending>::uninit() }; STACK + SPARE];
    let mut deep = DeepStacks::new(1, wide.stack_need);
    let stack = deep.as_mut().map_or(stack.as_mut_ptr().cast(), |deep| deep.stack(0));
    for (&point, closest) in points.iter().zip(closest) {
        *closest = match wide.root {
            // SAFETY: the stack has room for `stack_need` children and one register more.
            Some(root) if point.is_finite() => unsafe { one::<K>(wide, root, point, stack) },
            _ => None,
        };
    }
}

/// Returns the closest point of one point.
#[inline(always)]
unsafe fn one<K: Instructions>(
    wide: &WideBvh,
    root: Child,
    point: Vec3,
    base: *mut Pending,
) -> Option<Closest> {
    let mut nearest = Nearest::new(point);
    let nodes = wide.nodes.as_ptr();
    let blocks = wide.blocks.as_ptr();
    let mut top = base;
    let mut child = root;
    // SAFETY: references are sound, and the stack has room for `stack_need` children and one
    // register more.
    unsafe {
        let boxes = PointLanes::<K::Boxes>::new(point, &wide.bounds);
        let triangles = TargetLanes::<K::Block>::new(nearest.target);
        // Unused lanes are infinitely far away.
        let mut limit = f32::MAX;
        loop {
            while child.is_node() {
                let node = &*nodes.add(child.index());
                let bounds = boxes.bounds(node);
                let mask = bounds.le(K::Boxes::splat(limit)).bits();
                if mask & mask.wrapping_sub(1) == 0 {
                    if mask == 0 {
                        break;
                    }
                    child = *node.children.get_unchecked(mask.trailing_zeros() as usize);
                    continue;
                }
                child = K::sort(node, bounds, mask, top);
                top = top.add(mask.count_ones() as usize - 1);
            }
            if !child.is_node() {
                let mut block = blocks.add(child.index());
                loop {
                    if triangles.visit(&*block, &mut nearest) {
                        limit = boxes.limit(nearest.near.distance_squared);
                    }
                    if (*block).is_last() {
                        break;
                    }
                    block = block.add(1);
                }
            }
            child = loop {
                if top == base {
                    return nearest.closest();
                }
                top = top.sub(1);
                let pending = *top;
                if (pending >> 32) as u32 <= limit.to_bits() | 7 {
                    break Child::from_bits(pending as u32);
                }
            };
        }
    }
}

/// A point as boxes are tested with it: in f32, multiplied by a power of two that makes the largest
/// coordinate about 1, so that no square overflows.
///
/// The computed square of a distance exceeds the real one by at most 2⁻²⁰ of it, and by at most
/// 2⁻¹⁴⁰ where numbers are subnormal. [`limit`](Self::limit) adds more than both.
struct PointLanes<L> {
    scaled: [L; 3],
    scale: L,
    scale_of_one: f32,
}

impl<L: Lanes> PointLanes<L> {
    #[inline(always)]
    unsafe fn new(point: Vec3, bounds: &Aabb) -> Self {
        let size = point.abs().max(bounds.min.abs()).max(bounds.max.abs()).max_element();
        let exponent = (size.to_bits() >> 23) as i32 - 127;
        let scale = pow2((-exponent).clamp(-126, 126));
        let [x, y, z] = (point * scale).to_array();
        // SAFETY: the caller's promise: the processor has the instructions.
        unsafe {
            Self {
                scaled: [L::splat(x), L::splat(y), L::splat(z)],
                scale: L::splat(scale),
                scale_of_one: scale,
            }
        }
    }

    /// Returns bounds of the scaled squared distances from the boxes of a node; ∞ for unused
    /// lanes.
    #[inline(always)]
    unsafe fn bounds(&self, node: &WideNode) -> L {
        // SAFETY: the caller's promise: the processor has the instructions; planes are aligned.
        unsafe {
            let zero = L::splat(0.0);
            let mut sum = zero;
            for axis in 0..3 {
                let lower = L::load(node.planes[axis].as_ptr()) * self.scale;
                let upper = L::load(node.planes[axis + 3].as_ptr()) * self.scale;
                let below = lower - self.scaled[axis];
                let above = self.scaled[axis] - upper;
                let outside = zero.max(below.max(above));
                sum = outside.mul_add(outside, sum);
            }
            sum
        }
    }

    /// Returns the greatest bound that a box with a triangle at this squared distance may have.
    #[inline(always)]
    fn limit(&self, distance_squared: f64) -> f32 {
        let scale = f64::from(self.scale_of_one);
        let scaled = distance_squared * scale * scale;
        (scaled * (1.0 + 1.0 / (1 << 18) as f64)) as f32 + f32::MIN_POSITIVE
    }
}

/// A point in f64, in the lanes of a block of triangles.
struct TargetLanes<L: Lanes>([L::Double; 3]);

type Vector<D> = [D; 3];

impl<L: Lanes> TargetLanes<L> {
    #[inline(always)]
    unsafe fn new(target: DVec3) -> Self {
        // SAFETY: the caller's promise: the processor has the instructions.
        unsafe {
            let x = L::Double::splat(target.x);
            let y = L::Double::splat(target.y);
            let z = L::Double::splat(target.z);
            Self([x, y, z])
        }
    }

    /// Offers the triangles of a block that are as near as the nearest so far. Returns whether
    /// there are any.
    #[inline(always)]
    unsafe fn visit(&self, block: &TriangleBlock, nearest: &mut Nearest) -> bool {
        // SAFETY: the caller's promise: the processor has the instructions; there is room for four
        // numbers.
        unsafe {
            let [a, b, c] = block.corners_along::<L>([0, 1, 2]);
            let offset = offset(self.relative(a), self.relative(b), self.relative(c));
            let limit = L::Double::splat(nearest.near.distance_squared);
            let mut lanes = L::narrow(dot(offset, offset).le(limit)).bits();
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
                nearest.offer(block.id(lane), DVec3::new(x[lane], y[lane], z[lane]));
            }
            true
        }
    }

    #[inline(always)]
    fn relative(&self, corner: [L; 3]) -> Vector<L::Double> {
        let [x, y, z] = corner;
        [x.double() - self.0[0], y.double() - self.0[1], z.double() - self.0[2]]
    }
}

/// Returns the vectors to the nearest points of triangles: the operations of
/// `Triangle::offset_from`, bit by bit.
#[inline(always)]
fn offset<D: DoubleLanes>(a: Vector<D>, b: Vector<D>, c: Vector<D>) -> Vector<D> {
    let normal = cross(minus(b, a), minus(c, a));
    // SAFETY: values exist.
    let zero = unsafe { D::splat(0.0) };
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

/// Returns the points of segments nearest to zero.
#[inline(always)]
fn nearest_of_edge<D: DoubleLanes>(from: Vector<D>, to: Vector<D>) -> Vector<D> {
    let [fx, fy, fz] = from;
    let [tx, ty, tz] = to;
    let is_ordered = fx.lt(tx) | fx.eq(tx) & (fy.lt(ty) | fy.eq(ty) & fz.le(tz));
    let first = select(is_ordered, from, to);
    let second = select(is_ordered, to, from);
    let edge = minus(second, first);
    // SAFETY: values exist.
    let zero = unsafe { D::splat(0.0) };
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

/// Returns the points of boxes that are nearest to points.
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
