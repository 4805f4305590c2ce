//! Triangles in f64 side by side: the layer of [`exact`](crate::exact) in f64, for a ray and the
//! triangles of a block, and the distances of hits in twice its precision, for many rays.

use super::lanes::{DoubleLanes, Lanes, Mask};
use super::triangles::TriangleBlock;
use crate::double::NearestHit;
use crate::exact::{AXES, ERROR, Twice, distance, largest_axis};
use crate::{DRay, DTriangle};
use glam::DVec3;

/// What f64 decides about a ray and the triangles of a block.
pub(super) struct Decided {
    /// A bit per triangle that the ray hits between `low` and `high`.
    pub(super) hits: u32,
    /// A bit per triangle that is left open.
    pub(super) unsure: u32,
    pub(super) low: [f64; TriangleBlock::LANES],
    pub(super) high: [f64; TriangleBlock::LANES],
}

/// Returns the corners of the triangles in these `lanes` of a block, of which there is one, and of any
/// of them in other lanes.
///
/// # Safety
/// The processor has the instructions of `L`, which has four lanes; there is a triangle in each of
/// these `lanes`, and the triangles are those of the block.
#[inline(always)]
pub(super) unsafe fn corners_of<L: Lanes>(
    block: &TriangleBlock,
    triangles: &[DTriangle],
    lanes: u32,
) -> [Vector<L::Double>; 3] {
    const { assert!(L::N == TriangleBlock::LANES) };
    let any = lanes.trailing_zeros() as usize % TriangleBlock::LANES;
    let triangle = |lane: usize| {
        let object = block.id(if lanes >> lane & 1 != 0 { lane } else { any });
        triangles.as_ptr().wrapping_add(object as usize).cast()
    };
    let triangles = [triangle(0), triangle(1), triangle(2), triangle(3)];
    // SAFETY: the processor has the instructions; a triangle is nine numbers.
    let [ax, ay, az, bx, by, bz, cx, cy, cz] = unsafe { gathered::<L::Double, 9, 4>(&triangles) };
    [[ax, ay, az], [bx, by, bz], [cx, cy, cz]]
}

/// Decides about those of the `possible` triangles of a block that f64 suffices for. There is one.
///
/// # Safety
/// As [`corners_of`].
#[inline(always)]
pub(super) unsafe fn decide<L: Lanes>(
    ray: &DRay,
    block: &TriangleBlock,
    triangles: &[DTriangle],
    possible: u32,
) -> Decided {
    let [i, j, k] = AXES[largest_axis(ray.direction)];
    // SAFETY: the processor has the instructions; there are so many numbers.
    unsafe {
        let (origin, direction) = (ray.origin, ray.direction);
        let origin = splat::<L>(DVec3::new(origin[i], origin[j], origin[k]));
        let [dx, dy, dz] = splat::<L>(DVec3::new(direction[i], direction[j], direction[k]));
        let [a, b, c] = corners_of::<L>(block, triangles, possible);
        let first = [a[i], a[j], a[k]];
        let second = [b[i], b[j], b[k]];
        let third = [c[i], c[j], c[k]];
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

/// A component of a vector in every lane, by axis.
pub(super) type Vector<D> = [D; 3];

// These are functions, since closures may not be compiled with the instructions.

#[inline(always)]
pub(super) unsafe fn splat<L: Lanes>(point: DVec3) -> Vector<L::Double> {
    // SAFETY: the processor has the instructions.
    unsafe { [L::Double::splat(point.x), L::Double::splat(point.y), L::Double::splat(point.z)] }
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
pub(super) unsafe fn gathered<D: DoubleLanes, const N: usize, const P: usize>(
    from: &[*const f64; P],
) -> [D; N] {
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
        rounded::<L>([x, y, z], [dx, dy, dz], [[ax, ay, az], [bx, by, bz], [cx, cy, cz]], None)
    }
}

/// Returns the rounded distance of one hit, if it is decided. The time is that of a chain of dependent
/// operations, which is shorter from the bounds that the hit has already.
///
/// # Safety
/// The processor has the instructions of `L`.
#[inline(always)]
pub(super) unsafe fn rounded_distance<L: Lanes>(
    ray: &DRay,
    triangle: &DTriangle,
    hit: &NearestHit,
) -> Option<f64> {
    let DTriangle([a, b, c]) = *triangle;
    // SAFETY: the processor has the instructions.
    let (distances, is_decided) = unsafe {
        let [origin, direction] = [splat::<L>(ray.origin), splat::<L>(ray.direction)];
        let nearly = L::Double::splat(0.5 * (hit.low + hit.high));
        let corners = [splat::<L>(a), splat::<L>(b), splat::<L>(c)];
        rounded::<L>(origin, direction, corners, Some(nearly))
    };
    (is_decided & 1 != 0).then_some(distances[0])
}

#[inline(always)]
unsafe fn rounded<L: Lanes>(
    origin: Vector<L::Double>,
    direction: Vector<L::Double>,
    [a, b, c]: [Vector<L::Double>; 3],
    nearly: Option<L::Double>,
) -> ([f64; RAYS], u32) {
    const { assert!(L::N <= RAYS) };
    let [low, high] =
        distance(difference(a, origin), direction, difference(b, a), difference(c, a), nearly);
    let mut distances = [0.0; RAYS];
    // SAFETY: there is room. Adding 0 turns −0 into +0.
    unsafe { (low + low.filled(0.0)).store(distances.as_mut_ptr()) };
    (distances, L::narrow(low.eq(high)).bits())
}

#[inline(always)]
fn difference<D: DoubleLanes>(a: Vector<D>, b: Vector<D>) -> [Twice<D>; 3] {
    [Twice::difference(a[0], b[0]), Twice::difference(a[1], b[1]), Twice::difference(a[2], b[2])]
}
