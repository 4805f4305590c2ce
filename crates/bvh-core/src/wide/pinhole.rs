//! Packets of rays from one origin at leaves, as through the pixels of a pinhole camera. What the
//! tests of a triangle compute from its corners and the origin is computed once for all rays.
//!
//! With corners relative to the origin, the line crosses the triangle where d · (B × C), d · (C × A)
//! and d · (A × B) have the same sign, because it passes each edge on the same side. Names are those
//! of [`pairs`](super::pairs): u = 2⁻²⁴, ε = 2⁻⁵³; R is the largest relative coordinate, X the
//! largest component of the three products, D the largest component of d.
//!
//! *Edges.* A relative coordinate is off by εR, so that a component of a product is off by 4εR² from
//! them and by another 4εR² from its own roundings in f64; rounding it to f32 adds uX. Three
//! components move an edge value by less than 3 (uX + 9εR²) D, and its own roundings by less than
//! 10uXD: in total by less than E = (32uX + 64εR²) D. Underflow, of components and of products, adds
//! less than 2⁻¹²⁶. Nothing overflows with R < 2⁴⁰ and D < 2²¹; other packets have no common origin
//! here. If all edge values are above E, or all below −E, the line crosses the triangle; if one is
//! above and one below, it does not.
//!
//! *Distance.* As in [`pairs`](super::pairs), from the same numbers: only the product N · (A − O)
//! and the factors of its bound are computed once. The normal is that of the corners themselves.
//! Corners relative to a distant origin would have lost the sides of a small triangle.
//!
//! What either leaves open is tested as in any packet.

use super::lanes::{DoubleLanes, Lanes, Mask};
use super::layout::WideBvh;
use super::packet_vector::Vector;
use super::pairs::{Crossings, Plane, meet};
use super::ray_lanes::RayBounds;
use super::triangles::TriangleBlock;
use crate::Aabb;
use crate::each::Each;
use crate::ray::pow2;
use core::mem::MaybeUninit;
use glam::Vec3;

/// The origin of all rays, if they have one from which the bounds above hold for triangles within
/// `bounds`.
#[inline(always)]
pub(super) fn one_origin<L: Lanes>(rays: &RayBounds<L>, bounds: &Aabb) -> Option<Vec3> {
    let mut origin = Vec3::ZERO;
    // Bounds of the reciprocals of largest components.
    let mut least = f32::INFINITY;
    let mut most = f32::INFINITY;
    for axis in 0..3 {
        let [low, high] = rays.origins(axis);
        if low != high {
            return None;
        }
        origin[axis] = low;
        let [first, last] = rays.inverses(axis).each(f32::abs);
        least = least.min(first.min(last));
        most = most.min(first.max(last));
    }
    let reach = (bounds.max - origin).max(origin - bounds.min).max_element();
    let is_in_range = pow2(-20) < least && most < pow2(20) && reach < pow2(40);
    is_in_range.then_some(origin)
}

/// Four triangles as rays of one origin see them, lane by lane.
#[repr(C)]
pub(super) struct Seen {
    /// The components of B × C, C × A and A × B, and E / D.
    edges: [[f32; 4]; 10],
    /// The components of the normal, its product with A − O, and the bound of the distance's error
    /// for a speed of 1.
    plane: [[f64; 4]; 5],
}

impl Seen {
    #[inline(always)]
    pub(super) unsafe fn new<L: Lanes>(block: &TriangleBlock, origin: Vec3) -> Self {
        let mut seen = MaybeUninit::<Self>::uninit();
        // SAFETY: the processor has the instructions; all rows are written.
        unsafe {
            let corners = block.corners_along::<L>(TriangleBlock::ROWS);
            let plane = Plane::of_lanes(&corners);
            let origin = [L::splat(origin.x), L::splat(origin.y), L::splat(origin.z)];
            let (height, slack) = plane.height(&corners[0], &origin);
            let [a, b, c] = corners;
            let a = minus(&a, &origin);
            let b = minus(&b, &origin);
            let c = minus(&c, &origin);
            let edges = (&raw mut (*seen.as_mut_ptr()).edges).cast::<f32>();
            let mut most = L::splat(0.0);
            let products = [cross(&b, &c), cross(&c, &a), cross(&a, &b)];
            for (row, &component) in products.as_flattened().iter().enumerate() {
                let component = L::single(component);
                most = most.max(component.abs());
                component.store(edges.add(4 * row));
            }
            let reach = L::single(largest(&a).max(largest(&b)).max(largest(&c)));
            let error = most * most.filled(pow2(-19)) + reach * reach * reach.filled(pow2(-47));
            error.store(edges.add(4 * 9));
            let [x, y, z] = plane.normal;
            let planes = (&raw mut (*seen.as_mut_ptr()).plane).cast::<f64>();
            for (row, number) in [x, y, z, height, slack].into_iter().enumerate() {
                number.store(planes.add(4 * row));
            }
            seen.assume_init()
        }
    }

    /// Tests the triangles of a block with the rays of a vector that entered it. Returns whether
    /// any ray has a new nearest hit.
    #[inline(always)]
    pub(super) unsafe fn test<L: Lanes>(
        &self,
        vector: &mut Vector<L>,
        entered: u32,
        block: &TriangleBlock,
        wide: &WideBvh,
    ) -> bool {
        // SAFETY: the processor has the instructions of `L`; lanes are below four.
        unsafe {
            let direction = vector.rays.direction;
            let longest = direction[vector.axes[2]].abs();
            let underflow = longest.filled(f32::MIN_POSITIVE);
            let mut is_hit = false;
            for lane in 0..block.len() {
                let edge = |row: usize| L::splat(*self.edges[row].get_unchecked(lane));
                let value = |row: usize| {
                    let x = edge(row) * direction[0];
                    edge(row + 2).mul_add(direction[2], edge(row + 1).mul_add(direction[1], x))
                };
                let error = edge(9).mul_add(longest, underflow);
                let crossings = Crossings::new([value(0), value(3), value(6)], error);
                let possible = entered & crossings.possible;
                if possible == 0 {
                    continue;
                }
                let certain = possible & crossings.certain;
                let plane = |row: usize| L::Double::splat(*self.plane[row].get_unchecked(lane));
                let normal = [plane(0), plane(1), plane(2)];
                let (meets, is_behind, mut t) = meet(&normal, direction, (plane(3), plane(4)));
                let mut inside = meets & t.mask(certain);
                if possible & !(certain & (meets | is_behind).bits()) != 0 {
                    vector.shear(wide);
                    let pairs = vector.pairs.assume_init_ref();
                    let corners = block.splat_corners::<L>(lane, vector.axes);
                    let crossings = pairs.candidates(&corners).crossings;
                    (inside, t) = pairs.decide(&corners, crossings, vector.nearest.t);
                    inside = inside & t.mask(entered);
                }
                let inside = inside & vector.t_min.le(t);
                is_hit |= vector.nearest.offer(inside, t, block.id(lane));
            }
            is_hit
        }
    }
}

#[inline(always)]
fn minus<L: Lanes>(a: &[L; 3], b: &[L; 3]) -> [L::Double; 3] {
    [a[0].double() - b[0].double(), a[1].double() - b[1].double(), a[2].double() - b[2].double()]
}

#[inline(always)]
fn cross<D: DoubleLanes>(a: &[D; 3], b: &[D; 3]) -> [D; 3] {
    [
        a[1].mul_sub(b[2], a[2] * b[1]),
        a[2].mul_sub(b[0], a[0] * b[2]),
        a[0].mul_sub(b[1], a[1] * b[0]),
    ]
}

#[inline(always)]
fn largest<D: DoubleLanes>([x, y, z]: &[D; 3]) -> D {
    x.abs().max(y.abs()).max(z.abs())
}
