//! Triangles in f64 side by side: the layer of [`exact`](crate::exact) in f64, for a ray and the
//! triangles of a block, and the distances of hits in twice its precision, for many rays.

use super::lanes::{DoubleLanes, Lanes, Mask};
use super::triangles::TriangleBlock;
use crate::double::largest_axis;
use crate::exact::{AXES, ERROR, Twice, distance};
use crate::{DRay, DTriangle};
use bytemuck::{Pod, Zeroable};
use glam::DVec3;

/// The triangles of a [`TriangleBlock`] in f64.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct DoubleBlock {
    /// `corners[corner][axis][lane]`.
    corners: [[[f64; TriangleBlock::LANES]; 3]; 3],
}

/// What f64 decides about a ray and the triangles of a block.
pub(super) struct Decided {
    /// A bit per triangle that the ray hits between `low` and `high`.
    pub(super) hits: u32,
    /// A bit per triangle that is left open.
    pub(super) unsure: u32,
    pub(super) low: [f64; TriangleBlock::LANES],
    pub(super) high: [f64; TriangleBlock::LANES],
}

impl DoubleBlock {
    /// The triangles of a block, with the last one in unused lanes.
    pub(super) fn new(block: &TriangleBlock, triangles: &[DTriangle]) -> Self {
        let mut corners = [[[0.0; TriangleBlock::LANES]; 3]; 3];
        let mut last = block.id(0);
        for lane in 0..TriangleBlock::LANES {
            last = if block.triangle(lane).is_some() { block.id(lane) } else { last };
            for (axes, corner) in corners.iter_mut().zip(triangles[last as usize].0) {
                (0..3).for_each(|axis| axes[axis][lane] = corner[axis]);
            }
        }
        Self { corners }
    }

    /// Returns the corners of each triangle along these axes.
    ///
    /// # Safety
    /// As [`decide`](Self::decide).
    #[inline(always)]
    pub(super) unsafe fn corners_along<L: Lanes>(&self, axes: [usize; 3]) -> [[L::Double; 3]; 3] {
        let [a, b, c] = &self.corners;
        // SAFETY: the processor has the instructions.
        unsafe { [load::<L>(a, axes), load::<L>(b, axes), load::<L>(c, axes)] }
    }

    /// Decides about those of the `possible` triangles that f64 suffices for.
    ///
    /// # Safety
    /// The processor has the instructions of `L`, which has four lanes.
    #[inline(always)]
    pub(super) unsafe fn decide<L: Lanes>(&self, ray: &DRay, possible: u32) -> Decided {
        const { assert!(L::N == TriangleBlock::LANES) };
        let [i, j, k] = AXES[largest_axis(ray.direction)];
        // SAFETY: the processor has the instructions; there are so many numbers.
        unsafe {
            let (origin, direction) = (ray.origin, ray.direction);
            let origin = splat::<L>(DVec3::new(origin[i], origin[j], origin[k]));
            let [dx, dy, dz] = splat::<L>(DVec3::new(direction[i], direction[j], direction[k]));
            let [first, second, third] = [
                load::<L>(&self.corners[0], [i, j, k]),
                load::<L>(&self.corners[1], [i, j, k]),
                load::<L>(&self.corners[2], [i, j, k]),
            ];
            let error = L::Double::splat(ERROR);
            let zero = L::Double::splat(0.0);
            // As in `Line::edges`.
            let from = minus(first, origin);
            let to_second = minus(second, origin);
            let to_third = minus(third, origin);
            let reach = largest(from).max(largest(to_second)).max(largest(to_third));
            let [ax, ay] = sheared(from, [dx, dy, dz]);
            let [bx, by] = sheared(to_second, [dx, dy, dz]);
            let [cx, cy] = sheared(to_third, [dx, dy, dz]);
            let spread = largest([ax, bx, cx]).max(largest([ay, by, cy]));
            let coordinate_error = reach * dz.abs() * error;
            let bound = coordinate_error * (spread + coordinate_error);
            let u = cx * by - cy * bx;
            let v = ax * cy - ay * cx;
            let w = bx * ay - by * ax;
            let least = u.min(v).min(w);
            let most = u.max(v).max(w);
            let below = zero - bound;
            let is_inside = bound.lt(least) | most.lt(below);
            let is_outside = least.lt(below) & bound.lt(most);
            let sides = [minus(second, first), minus(third, first)];
            let (t, slack, is_known) = plane(from, [dx, dy, dz], sides);
            let low = t - slack;
            let high = t + slack;
            let hits = is_inside & is_known & zero.le(low);
            let misses = is_outside | is_inside & is_known & high.lt(zero);
            let hits = L::narrow(hits).bits() & possible;
            let unsure = possible & !hits & !L::narrow(misses).bits();
            let mut decided = Decided { hits, unsure, low: [0.0; 4], high: [0.0; 4] };
            low.store(decided.low.as_mut_ptr());
            high.store(decided.high.as_mut_ptr());
            decided
        }
    }
}

/// A component of a vector in every lane, by axis.
pub(super) type Vector<D> = [D; 3];

// These are functions, since closures may not be compiled with the instructions.

#[inline(always)]
pub(super) unsafe fn splat<L: Lanes>(point: DVec3) -> Vector<L::Double> {
    // SAFETY: the processor has the instructions.
    unsafe { [L::Double::splat(point.x), L::Double::splat(point.y), L::Double::splat(point.z)] }
}

#[inline(always)]
unsafe fn load<L: Lanes>(
    axes: &[[f64; TriangleBlock::LANES]; 3],
    [i, j, k]: [usize; 3],
) -> Vector<L::Double> {
    // SAFETY: the processor has the instructions; there are so many numbers.
    unsafe {
        [
            L::Double::load(axes[i].as_ptr()),
            L::Double::load(axes[j].as_ptr()),
            L::Double::load(axes[k].as_ptr()),
        ]
    }
}

#[inline(always)]
fn minus<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> Vector<D> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline(always)]
fn largest<D: DoubleLanes>([x, y, z]: Vector<D>) -> D {
    x.abs().max(y.abs()).max(z.abs())
}

#[inline(always)]
fn sheared<D: DoubleLanes>([x, y, z]: Vector<D>, [dx, dy, dz]: Vector<D>) -> [D; 2] {
    [x * dz - dx * z, y * dz - dy * z]
}

#[inline(always)]
fn dot<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> D {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Returns the distances of planes, their errors, and where they are known, as in `Line::plane`: by
/// the corners relative to the origin, the direction and the sides.
#[inline(always)]
fn plane<D: DoubleLanes>(
    from: Vector<D>,
    direction: Vector<D>,
    [[px, py, pz], [qx, qy, qz]]: [Vector<D>; 2],
) -> (D, D, D::Mask) {
    let [a, b] = [py * qz, pz * qy];
    let [c, d] = [pz * qx, px * qz];
    let [e, f] = [px * qy, py * qx];
    let normal = [a - b, c - d, e - f];
    let products = [a.abs() + b.abs(), c.abs() + d.abs(), e.abs() + f.abs()];
    let along = dot(direction, normal);
    let error = along.filled(ERROR);
    let [dx, dy, dz] = direction;
    let along_error = error * dot([dx.abs(), dy.abs(), dz.abs()], products);
    let t = dot(from, normal) / along;
    let sizes = [from[0].abs(), from[1].abs(), from[2].abs()];
    let slack = error * dot(sizes, products) + t.abs() * along_error;
    // NaN fails every comparison.
    (t, slack.filled(0.25) * slack / along.abs(), along_error.le(along.abs()))
}

/// The most rays that one register needs.
pub(super) const RAYS: usize = 16;

/// Returns the numbers of as many places as there are lanes, side by side.
///
/// # Safety
/// The processor has the instructions; there are `N` numbers at a place per lane.
#[inline(always)]
pub(super) unsafe fn gathered<D: DoubleLanes, const N: usize>(from: &[*const f64; RAYS]) -> [D; N] {
    // SAFETY: the processor has the instructions; so many numbers are there.
    unsafe {
        let mut numbers = [D::splat(0.0); N];
        for first in (0..N).step_by(2) {
            let first = first.min(N - 2);
            let [a, b] = D::load_twos(&from.map(|from| from.wrapping_add(first)));
            numbers[first] = a;
            numbers[first + 1] = b;
        }
        numbers
    }
}

/// Returns the rounded distances of rays and the triangles that they hit, and a bit for each that is
/// decided.
///
/// # Safety
/// The processor has the instructions; there are a ray and a triangle per lane.
#[inline(always)]
pub(super) unsafe fn rounded_distances<L: Lanes>(
    rays: &[*const DRay; RAYS],
    triangles: &[*const DTriangle; RAYS],
) -> ([f64; RAYS], u32) {
    // SAFETY: the processor has the instructions; these are numbers.
    unsafe {
        let [x, y, z, dx, dy, dz] = gathered(&rays.map(|ray| ray.cast()));
        let [ax, ay, az, bx, by, bz, cx, cy, cz] =
            gathered(&triangles.map(|triangle| triangle.cast()));
        rounded::<L>([x, y, z], [dx, dy, dz], [[ax, ay, az], [bx, by, bz], [cx, cy, cz]])
    }
}

/// Returns the rounded distance of one hit, if it is decided.
///
/// # Safety
/// The processor has the instructions of `L`.
#[inline(always)]
pub(super) unsafe fn rounded_distance<L: Lanes>(ray: &DRay, triangle: &DTriangle) -> Option<f64> {
    let DTriangle([a, b, c]) = *triangle;
    // SAFETY: the processor has the instructions.
    let (distances, is_decided) = unsafe {
        let [origin, direction] = [splat::<L>(ray.origin), splat::<L>(ray.direction)];
        rounded::<L>(origin, direction, [splat::<L>(a), splat::<L>(b), splat::<L>(c)])
    };
    (is_decided & 1 != 0).then_some(distances[0])
}

#[inline(always)]
unsafe fn rounded<L: Lanes>(
    origin: Vector<L::Double>,
    direction: Vector<L::Double>,
    [a, b, c]: [Vector<L::Double>; 3],
) -> ([f64; RAYS], u32) {
    const { assert!(L::N <= RAYS) };
    let [low, high] =
        distance(difference(a, origin), direction, difference(b, a), difference(c, a));
    let mut distances = [0.0; RAYS];
    // SAFETY: there is room. Adding 0 turns −0 into +0.
    unsafe { (low + low.filled(0.0)).store(distances.as_mut_ptr()) };
    (distances, L::narrow(low.eq(high)).bits())
}

#[inline(always)]
fn difference<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> [Twice<D>; 3] {
    [Twice::difference(a[0], b[0]), Twice::difference(a[1], b[1]), Twice::difference(a[2], b[2])]
}
