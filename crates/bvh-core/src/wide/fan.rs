//! Fans: rays from one point in many directions, and whether anything stops them.
//!
//! The corners of a triangle relative to the point, A, B and C, make a number for each edge and
//! direction d, and one for all directions:
//!
//! ```text
//!     u(d) = d · (B × C),   v(d) = d · (C × A),   w(d) = d · (A × B),   V = A · (B × C)
//! ```
//!
//! Where the ray meets the triangle, t d = αA + βB + γC with α, β, γ ≥ 0 of the sum 1, and so t u = αV,
//! t v = βV and t w = γV, and t (u + v + w) = V. The coefficients are computed once for a point, in f64,
//! and rounded to f32. A ray takes nine operations.
//!
//! Points whose neighbours are far away have fans cheaper than beams: a fan finds what is around its
//! point once for all directions, and what is there is still in the cache for the next point. The
//! directions of a fan are of one octant of the boxes. So the rays meet the planes of boxes in the same
//! order, and the nearest child is visited first.
//!
//! # The bounds
//!
//! *Boxes.* The test is that of [`Slabs`](crate::Slabs), whose proof holds for it, but all rays begin
//! at 0 and end at the greatest end. The least reciprocal of a vector's directions, in size, and the
//! greatest bound entries and exits: rounding is monotone. A box behind the point has a negative exit
//! for all of them.
//!
//! *Triangles.* Coordinates are scaled by a power of two, so that relative ones are at most 1, and
//! directions so that their largest components are 1. With u = 2⁻²⁴ and ε = 2⁻⁵³, let m be the largest
//! coordinate of the corners. A relative coordinate is off by ε of itself, a component of B × C by less
//! than 10εm², u(d) by less than 2⁻⁴⁸m² and V by less than 2⁻⁴⁷m³. In f32, u(d) is off by 7u of the sum of
//! its coefficients' sizes, and V by u of itself. The code has 16u for both, 2⁻⁴⁴m² and 2⁻⁴⁴m³, and 2⁻¹²⁰
//! for what f32 loses below its normal numbers.
//!
//! *Decisions.* If V is certainly not 0, u, v and w of a hit have its sign or are 0, since t ≥ 0, and
//! where all certainly have it, the ray meets the triangle at t = V / (u + v + w) > 0. If V may be 0, a
//! ray misses the triangle where two edges certainly have different signs: else t u = αV and t v = βV
//! need t = 0, and the point itself would lie in the triangle, where all edges have one sign. Ends of the range
//! are multiplied by u + v + w, which is off by four bounds of an edge, and 1 ± 16u. No relative
//! coordinate is larger than 1, and so ends beyond 16 are as good as 16.
//!
//! Rays that are left open are traced by themselves, against that triangle alone.

use super::bundle::{Coefficients, LANES, Shape, VECTORS, store_three};
use super::instructions::Instructions;
use super::lanes::{Aligned, DoubleLanes, Lanes, Mask};
use super::layout::WideNode;
use super::obstacles::{Beams, Obstacles};
use super::triangles::TriangleBlock;
use crate::ray::{pow2, power_below};
use crate::slabs::{FAR, NEAR};
use core::mem::MaybeUninit;
use glam::{DVec3, Vec3};

/// Directions of one octant of the boxes.
pub(super) struct Fan<'a, K: Instructions> {
    numbers: &'a [u32],
    /// The rows of the planes that the rays meet first, by axis, and of the planes opposite.
    near: [usize; 3],
    far: [usize; 3],
    /// The reciprocals of the directions for entries and for exits.
    factors: [[[K::Rays; 2]; 3]; VECTORS],
    /// Their least for entries and their greatest for exits, of each vector and of all.
    bounds: [[[K::Boxes; 2]; 3]; VECTORS],
    whole: [[K::Boxes; 2]; 3],
    /// The greatest end of a ray.
    end: f32,
    /// The directions, whose largest components are 1.
    along: [[K::Rays; 3]; VECTORS],
    /// By what they are scaled, and the greatest of these factors.
    sizes: [[f64; LANES]; VECTORS],
    size: f64,
}

impl<'a, K: Instructions> Fan<'a, K> {
    #[inline(always)]
    pub(super) unsafe fn new<O: Obstacles>(beams: &Beams<'_, O>, numbers: &'a [u32]) -> Self {
        // SAFETY: the processor has the instructions; there are aligned lanes.
        unsafe {
            let none = K::Rays::splat(0.0);
            let no_box = K::Boxes::splat(0.0);
            let mut fan = Self {
                numbers,
                near: [0; 3],
                far: [0; 3],
                factors: [[[none; 2]; 3]; VECTORS],
                bounds: [[[no_box; 2]; 3]; VECTORS],
                whole: [[no_box; 2]; 3],
                end: f32::NEG_INFINITY,
                along: [[none; 3]; VECTORS],
                sizes: [[1.0; LANES]; VECTORS],
                size: 0.0,
            };
            let mut lowest = Vec3::INFINITY;
            let mut highest = Vec3::ZERO;
            let mut sign = Vec3::ONE;
            for (vector, numbers) in numbers.chunks(K::Rays::N).enumerate() {
                let mut inverses = Aligned([[0.0; LANES]; 3]);
                let mut along = Aligned([[0.0; LANES]; 3]);
                let mut least = Vec3::INFINITY;
                let mut most = Vec3::ZERO;
                for lane in 0..K::Rays::N {
                    let number = numbers[lane.min(numbers.len() - 1)];
                    let direction = beams.directions[number as usize];
                    let ray = beams.obstacles.ray(beams.points[0], direction, beams.range);
                    let boxed = beams.obstacles.boxed(&ray);
                    let inverse = boxed.inverse_direction();
                    sign = Vec3::ONE.copysign(inverse);
                    least = least.min(inverse.abs());
                    most = most.max(inverse.abs());
                    fan.end = fan.end.max(boxed.t_max());
                    let size = 1.0 / direction.abs().max_element();
                    fan.sizes[vector][lane] = size;
                    fan.size = fan.size.max(size);
                    for axis in 0..3 {
                        inverses.0[axis][lane] = inverse[axis];
                        along.0[axis][lane] = (direction[axis] * size) as f32;
                    }
                }
                for axis in 0..3 {
                    let inverse = K::Rays::load(inverses.0[axis].as_ptr());
                    let factors = [inverse * none.filled(NEAR), inverse * none.filled(FAR)];
                    fan.factors[vector][axis] = factors;
                    fan.along[vector][axis] = K::Rays::load(along.0[axis].as_ptr());
                    fan.bounds[vector][axis] = [
                        K::Boxes::splat(least[axis] * sign[axis] * NEAR),
                        K::Boxes::splat(most[axis] * sign[axis] * FAR),
                    ];
                }
                lowest = lowest.min(least);
                highest = highest.max(most);
            }
            for axis in 0..3 {
                let is_backwards = sign[axis] < 0.0;
                fan.near[axis] = axis + 3 * usize::from(is_backwards);
                fan.far[axis] = axis + 3 * usize::from(!is_backwards);
                fan.whole[axis] = [
                    K::Boxes::splat(lowest[axis] * sign[axis] * NEAR),
                    K::Boxes::splat(highest[axis] * sign[axis] * FAR),
                ];
            }
            fan
        }
    }
}

/// A fan from a point.
pub(super) struct Pencil<'a, K: Instructions, O: Obstacles> {
    fan: &'a Fan<'a, K>,
    beams: &'a Beams<'a, O>,
    point: usize,
    /// The point as boxes are tested with it.
    origin: [K::Boxes; 3],
    /// The power of two by which coordinates are scaled, and the point times it.
    scale: f64,
    scaled: DVec3,
    /// Whether ends of the range decide about rays.
    is_limited: bool,
}

impl<'a, K: Instructions, O: Obstacles> Pencil<'a, K, O> {
    #[inline(always)]
    pub(super) unsafe fn new(
        fan: &'a Fan<'a, K>,
        beams: &'a Beams<'a, O>,
        point: usize,
        origin: Vec3,
    ) -> Self {
        let place = O::point(beams.points[point]);
        let scale = power_below(1.0 / beams.obstacles.reach(place));
        let [begin, end] = beams.range;
        // SAFETY: the processor has the instructions.
        unsafe {
            Self {
                fan,
                beams,
                point,
                origin: [
                    K::Boxes::splat(origin.x),
                    K::Boxes::splat(origin.y),
                    K::Boxes::splat(origin.z),
                ],
                scale,
                scaled: place * scale,
                is_limited: begin > 0.0 || end * scale / fan.size < 16.0,
            }
        }
    }
}

impl<K: Instructions, O: Obstacles> Shape<K, O> for Pencil<'_, K, O> {
    type Outline = [[K::Boxes; 2]; 3];
    type Rows = Aligned<[[[f32; WideNode::LANES]; 2]; 3]>;
    type Child = [[K::Rays; 2]; 3];
    type Shadows = Projections;

    #[inline(always)]
    unsafe fn outline(&self, node: &WideNode) -> Self::Outline {
        // SAFETY: planes are whole and aligned.
        unsafe {
            let planes = node.planes.as_ptr();
            let mut outline = [[self.origin[0]; 2]; 3];
            for (axis, outline) in outline.iter_mut().enumerate() {
                let near = K::Boxes::load(planes.add(self.fan.near[axis]).cast());
                let far = K::Boxes::load(planes.add(self.fan.far[axis]).cast());
                *outline = [near - self.origin[axis], far - self.origin[axis]];
            }
            outline
        }
    }

    #[inline(always)]
    unsafe fn all(&self, outline: &Self::Outline) -> (u32, Option<K::Boxes>) {
        // SAFETY: the processor has the instructions.
        unsafe {
            let (entry, mask) = overlap(outline, &self.fan.whole, self.fan.end);
            let (keys, mask) = K::keys(entry, mask);
            (mask, Some(keys))
        }
    }

    #[inline(always)]
    unsafe fn vector(&self, outline: &Self::Outline, vector: usize) -> u32 {
        // SAFETY: the processor has the instructions.
        unsafe { overlap(outline, &self.fan.bounds[vector], self.fan.end).1.bits() }
    }

    #[inline(always)]
    unsafe fn write(&self, outline: &Self::Outline, rows: *mut Self::Rows) {
        // SAFETY: there is room for six rows.
        unsafe {
            let to = rows.cast::<f32>();
            for (axis, [near, far]) in outline.iter().enumerate() {
                near.store(to.add(16 * axis));
                far.store(to.add(16 * axis + 8));
            }
        }
    }

    #[inline(always)]
    unsafe fn child(&self, rows: &Self::Rows, lane: usize) -> Self::Child {
        // SAFETY: the processor has the instructions, and there is such a lane.
        unsafe {
            let mut child = [[K::Rays::splat(0.0); 2]; 3];
            for (child, rows) in child.iter_mut().zip(&rows.0) {
                *child = [
                    K::Rays::splat(*rows[0].get_unchecked(lane)),
                    K::Rays::splat(*rows[1].get_unchecked(lane)),
                ];
            }
            child
        }
    }

    #[inline(always)]
    unsafe fn rays(&self, child: &Self::Child, vector: usize) -> u32 {
        // SAFETY: the processor has the instructions.
        unsafe { overlap(child, &self.fan.factors[vector], self.fan.end).1.bits() }
    }

    #[inline(always)]
    unsafe fn shadows(&self, block: &TriangleBlock) -> Projections {
        // SAFETY: the processor has the instructions.
        unsafe { Projections::of_pencil(self, block) }
    }

    #[inline(always)]
    unsafe fn test(
        &self,
        shadows: &Projections,
        lane: usize,
        vector: usize,
        rays: u32,
    ) -> (u32, u32) {
        // SAFETY: the processor has the instructions; the lane is one of four.
        unsafe {
            let along = &self.fan.along[vector];
            let u = shadows.value_along(0, lane, along);
            let v = shadows.value_along(3, lane, along);
            let w = shadows.value_along(6, lane, along);
            let least = u.min(v).min(w);
            let edge_error = shadows.number(Projections::EDGE_ERROR, lane);
            let volume = shadows.number(Projections::VOLUME, lane);
            let slack = shadows.number(Projections::VOLUME_ERROR, lane);
            let error = least.filled(edge_error);
            let is_flat = volume <= slack;
            let mut missed = least.lt(least.filled(-edge_error)).bits();
            if is_flat {
                missed &= error.lt(u.max(v).max(w)).bits();
            }
            let possible = rays & !missed;
            if possible == 0 {
                return (0, 0);
            }
            if is_flat {
                return (0, possible);
            }
            let mut certain = error.lt(least).bits();
            let mut beyond = 0;
            if self.is_limited {
                let [begin, end] = self.ends(vector);
                let sum = u + v + w;
                let high = sum + least.filled(4.0 * edge_error);
                let low = sum - least.filled(4.0 * edge_error);
                let volumes = [least.filled(volume - slack), least.filled(volume + slack)];
                certain &= (high * begin[1]).lt(volumes[0]).bits();
                certain &= volumes[1].lt(low * end[0]).bits();
                beyond = volumes[1].lt(low * begin[0]).bits();
                beyond |= (high * end[1]).lt(volumes[0]).bits();
            }
            let stopped = possible & certain;
            (stopped, possible & !stopped & !beyond)
        }
    }

    fn ray(&self, number: usize) -> O::Ray {
        let Beams { obstacles, points, range, directions, .. } = self.beams;
        obstacles.ray(points[self.point], directions[self.fan.numbers[number] as usize], *range)
    }
}

impl<K: Instructions, O: Obstacles> Pencil<'_, K, O> {
    /// Returns the ends of the range in the unit of a vector's directions, each with what is
    /// certainly before and behind it.
    #[inline(always)]
    unsafe fn ends(&self, vector: usize) -> [[K::Rays; 2]; 2] {
        // SAFETY: the processor has the instructions; there are aligned lanes.
        unsafe {
            let mut ends = [[K::Rays::splat(0.0); 2]; 2];
            for (ends, t) in ends.iter_mut().zip(self.beams.range) {
                let mut lanes = Aligned([[0.0; LANES]; 2]);
                for lane in 0..K::Rays::N {
                    let size = self.scale / self.fan.sizes[vector][lane];
                    let end = (t * size).min(16.0);
                    let slack = end * f64::from(pow2(-20)) + f64::from(f32::from_bits(1)) * size;
                    // Both factors of a comparison with it may not be negative.
                    lanes.0[0][lane] = (end - slack).max(0.0) as f32;
                    lanes.0[1][lane] = (end + slack) as f32;
                }
                *ends = [K::Rays::load(lanes.0[0].as_ptr()), K::Rays::load(lanes.0[1].as_ptr())];
            }
            ends
        }
    }
}

/// Returns entries, and where they are before exits and the end.
#[inline(always)]
unsafe fn overlap<L: Lanes>(planes: &[[L; 2]; 3], factors: &[[L; 2]; 3], end: f32) -> (L, L::Mask) {
    // SAFETY: the processor has the instructions.
    let (mut entry, mut exit) = unsafe { (L::splat(0.0), L::splat(end)) };
    for (&[near, far], &[near_factor, far_factor]) in planes.iter().zip(factors) {
        // `max` returns the second of two zeros: entries are never −0.
        entry = (near * near_factor).max(entry);
        // `min` returns the second of a NaN and a number.
        exit = (far * far_factor).min(exit);
    }
    (entry, entry.le(exit))
}

/// The coefficients of four triangles for a point, lane by lane: three for each edge, |V|, and the
/// bounds of the errors. The signs are those for a positive V.
pub(super) type Projections = Coefficients<12>;

impl Projections {
    const VOLUME: usize = 9;
    const EDGE_ERROR: usize = 10;
    const VOLUME_ERROR: usize = 11;

    /// Returns the products of the three coefficients from a row on and directions.
    #[inline(always)]
    unsafe fn value_along<L: Lanes>(&self, row: usize, lane: usize, &[x, y, z]: &[L; 3]) -> L {
        // SAFETY: the rows exist.
        unsafe {
            let along_z = x.filled(self.number(row + 2, lane)) * z;
            let along_y = x.filled(self.number(row + 1, lane)).mul_add(y, along_z);
            x.filled(self.number(row, lane)).mul_add(x, along_y)
        }
    }

    #[inline(always)]
    unsafe fn of_pencil<K: Instructions, O: Obstacles>(
        pencil: &Pencil<'_, K, O>,
        block: &TriangleBlock,
    ) -> Self {
        // SAFETY: the processor has the instructions; a register of a block has four lanes.
        unsafe {
            let scale = <K::Block as Lanes>::Double::splat(pencil.scale);
            let origin = pencil.scaled;
            let origin = [scale.filled(origin.x), scale.filled(origin.y), scale.filled(origin.z)];
            let [a, b, c] = pencil.beams.obstacles.corners::<K::Block>(block, [0, 1, 2]);
            let a = relative(a, scale, origin);
            let b = relative(b, scale, origin);
            let c = relative(c, scale, origin);
            let u = cross(&b, &c);
            let v = cross(&c, &a);
            let w = cross(&a, &b);
            let volume = a[0].mul_add(u[0], a[1].mul_add(u[1], a[2] * u[2]));
            let volume = K::Block::single(volume);
            let flip = volume & volume.filled(-0.0);
            let volume = volume.abs();
            let mut rows = MaybeUninit::<Aligned<[[f32; 4]; 12]>>::uninit();
            let to = rows.as_mut_ptr().cast::<f32>();
            let u = write::<K::Block>(u, flip, to);
            let v = write::<K::Block>(v, flip, to.add(12));
            let w = write::<K::Block>(w, flip, to.add(24));
            let size =
                extent::<K::Block>(&a).max(extent::<K::Block>(&b)).max(extent::<K::Block>(&c));
            let square = size * size;
            let roundings = volume.filled(pow2(-20));
            let sizes = u.max(v).max(w);
            let [share, least] = [volume.filled(pow2(-44)), volume.filled(pow2(-120))];
            let edge_error = sizes.mul_add(roundings, square.mul_add(share, least));
            let cube = square * size;
            let volume_error = volume.mul_add(roundings, cube.mul_add(share, least));
            volume.store(to.add(4 * Self::VOLUME));
            edge_error.store(to.add(4 * Self::EDGE_ERROR));
            volume_error.store(to.add(4 * Self::VOLUME_ERROR));
            Self(rows.assume_init().0)
        }
    }
}

/// Returns a corner relative to a point, scaled.
#[inline(always)]
fn relative<D: DoubleLanes>(corner: [D; 3], scale: D, origin: [D; 3]) -> [D; 3] {
    // The products are exact.
    [
        corner[0].mul_sub(scale, origin[0]),
        corner[1].mul_sub(scale, origin[1]),
        corner[2].mul_sub(scale, origin[2]),
    ]
}

#[inline(always)]
fn cross<D: DoubleLanes>([bx, by, bz]: &[D; 3], [cx, cy, cz]: &[D; 3]) -> [D; 3] {
    [by.mul_sub(*cz, *bz * *cy), bz.mul_sub(*cx, *bx * *cz), bx.mul_sub(*cy, *by * *cx)]
}

/// Returns the largest coordinate.
#[inline(always)]
fn extent<L: Lanes>([x, y, z]: &[L::Double; 3]) -> L {
    L::single(x.abs().max(y.abs()).max(z.abs()))
}

/// Writes three coefficients with flipped signs as rows of four, and returns the sum of their sizes.
#[inline(always)]
unsafe fn write<L: Lanes>(coefficients: [L::Double; 3], flip: L, to: *mut f32) -> L {
    // SAFETY: there is room for three rows.
    let [x, y, z] = unsafe { store_three(coefficients, flip, to) };
    x + y + z
}
