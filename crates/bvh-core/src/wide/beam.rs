//! Beams: parallel rays from neighbouring points, and whether anything stops them.
//!
//! All rays of a beam run along one direction. So what a triangle does to them depends on where
//! they start alone, and linearly. In coordinates relative to the middle of the points, sheared
//! along the direction, the rays are points p of a plane, and a triangle is a triangle in it:
//!
//! ```text
//!     C            one edge value:  u(p) = (B − p) × (C − p) = B × C + p.x (B.y − C.y) + p.y (C.x − B.x)
//!    ╱ ╲           the ray of p crosses the triangle where u, v and w have the same sign,
//!   ╱ p ╲          S = u + v + w is the same for all rays,
//!  A─────B         and S t d_z = S z_A + v(p) (z_B − z_A) + w(p) (z_C − z_A) − S p.z
//! ```
//!
//! The coefficients are computed once for a beam, in f64, and rounded to f32. A ray then takes eight
//! fused operations, a product and a difference, instead of thirty.
//!
//! # Boxes
//!
//! For two axes a and b, p_a d_b − p_b d_a is the same along a ray, its *place* for this pair. The line
//! of a ray meets a box if for all three pairs its place is between the least and the greatest of the
//! box, and the ray meets it if besides it begins before the box's far planes and ends behind the
//! near ones. These are the conditions of slabs, multiplied out. They bound the rays of a vector more
//! tightly than intervals of their origins: places of rays from a street that runs along the direction
//! differ little.
//!
//! Coordinates are relative to the middle of the points and scaled by a power of two, so that they
//! are at most 1 in the scene; axes are turned so that the direction d has no negative component, and
//! its greatest is 1. With u = 2⁻²⁴, coordinates are off by u, and so the places of points and planes by
//! 2u each, and by 4u and 5u more from their products, differences and pads. A direction in a frame and
//! its quotient are off by 2u of each component, which moves the place at a hit by 8u, and the
//! origin in a frame by 2u beyond what pads the planes, which moves it by 4u. The pad of 32u is greater
//! than all together. Rays that begin before a plane do so in relative coordinates, too, since all
//! are rounded monotonically by the same operation. The end of a ray is compared along one axis, with
//! 32u and with 32u of the range.
//!
//! # The bounds of triangles
//!
//! Coordinates are scaled by a power of two, so that relative ones are at most 1. With u = 2⁻²⁴ and
//! ε = 2⁻⁵³, let m be the largest |x|, |y| of the sheared corners, H_x and H_y half the extents of the
//! sheared points and H_z half that of the points along z, and n = m + H_x + H_y.
//!
//! *Corners.* A relative coordinate is off by 2ε, its product with the slope by 4ε, and the sheared
//! coordinate, which is at most 2, by η = 20ε. The difference of two of them is off by 2.5η, B × C by
//! less than 5ηm, and u(p) by less than 10ηn: below 2⁻⁴⁵n. S is off by less than 20ηm. z_B − z_A is at
//! most 2, and so the constant term of the last equation is off by less than 80ηm, its coefficients
//! by 12ηn, S p.z by 40ηm, and S times an end, which matters up to 4, by 80ηm: below 2⁻⁴⁰n together.
//! Products of two errors are left out. They, and what f32 loses below its normal numbers, count
//! only where n is below 2⁻⁴⁵; there no value exceeds the bound 2⁻⁴⁴n, and nothing is certain.
//!
//! *Points.* A relative coordinate is rounded to f32, off by u, the slope too, and so the sheared
//! ones are off by at most 4u of H_x and H_y. The coefficients are rounded, and two fused operations,
//! or four, or twice as many without fused ones: less than 9u of
//! |B × C| + |B.y − C.y| H_x + |C.x − B.x| H_y. In the last equation they are less than 12u of the sum
//! of its terms' sizes. The code has 16u for both.
//!
//! *Decisions.* Where S is certainly not 0, one edge value of the other sign is enough: the sum is
//! S, so that another one has its sign, and the line misses the triangle. The end of the range is
//! multiplied by S |d_z| and 1 ± 8u, which covers these roundings and that of a distance to f32, but
//! for one that is subnormal, which is off by 2⁻¹⁵⁰. No relative coordinate is larger than 1, and so
//! ends beyond 16 are as good as 16. Where S may have another sign than the one computed, a hit is
//! never certain, and a miss by its distance is, since the error of S is in the bound.
//!
//! Rays that are left open are traced by themselves, against that triangle alone.

use super::bundle::{Coefficients, LANES, Shape, VECTORS, store_three};
use super::instructions::Instructions;
use super::lanes::{Aligned, DoubleLanes, Lanes, Mask};
use super::layout::WideNode;
use super::obstacles::{Beams, Obstacles};
use super::ray_lanes::least as least_of;
use super::triangles::TriangleBlock;
use crate::Aabb;
use crate::each::Each;
use crate::exact::{AXES, largest_axis};
use crate::ray::{pow2, power_below};
use core::mem::MaybeUninit;
use glam::{DVec3, Vec3};

/// Points side by side: what beams in all directions have in common.
pub(super) struct Group<K: Instructions> {
    /// The middle, and the power of two by which relative coordinates are scaled.
    centre: DVec3,
    scale: f64,
    /// The largest relative coordinates.
    half: Vec3,
    relative: [[K::Rays; 3]; VECTORS],
    /// The same for boxes.
    box_centre: Vec3,
    box_scale: f32,
    places: [[K::Rays; 3]; VECTORS],
    /// The places of each lane, vector by vector.
    columns: [[K::Rays; 3]; LANES],
    /// The least and the greatest place of each vector, and of all, by axis.
    bounds: [Aabb; VECTORS],
    whole: Aabb,
    /// The number of vectors.
    count: usize,
}

impl<K: Instructions> Group<K> {
    #[inline(always)]
    pub(super) unsafe fn new<O: Obstacles>(beams: &Beams<'_, O>, origins: &[Vec3]) -> Self {
        const { assert!(VECTORS <= K::Rays::N && K::Rays::N <= LANES) };
        let points = || beams.points.iter().map(|&point| O::point(point));
        let min = points().fold(DVec3::INFINITY, DVec3::min);
        let max = points().fold(DVec3::NEG_INFINITY, DVec3::max);
        let centre = min * 0.5 + max * 0.5;
        let half = (max - centre).max(centre - min);
        let reach = beams.obstacles.reach(centre).max(half.max_element());
        let scale = power_below(1.0 / reach);
        let last = beams.points.len() - 1;
        let around = Aabb::around(origins.iter().copied());
        let box_centre = around.min * 0.5 + around.max * 0.5;
        let all = beams.obstacles.boxes().root_box().union(&around);
        let reach = (all.max - box_centre).max(box_centre - all.min).max_element();
        let box_scale = power_below(1.0 / f64::from(reach.max(pow2(-100)))) as f32;
        let box_centre = box_centre * box_scale;
        // SAFETY: the processor has the instructions; there are aligned lanes.
        unsafe {
            let none = [K::Rays::splat(0.0); 3];
            let count = beams.points.len().div_ceil(K::Rays::N);
            let mut group = Self {
                centre,
                scale,
                // Rounded up.
                half: (half * scale).as_vec3() * (1.0 + 2.0 * f32::EPSILON),
                relative: [none; VECTORS],
                box_centre,
                box_scale,
                places: [none; VECTORS],
                columns: [none; LANES],
                bounds: [Aabb::EMPTY; VECTORS],
                whole: Aabb::EMPTY,
                count,
            };
            let mut places = Aligned([[[0.0; LANES]; 3]; VECTORS]);
            for vector in 0..count {
                for axis in 0..3 {
                    let mut lanes = Aligned([[0.0; LANES]; 2]);
                    for lane in 0..K::Rays::N {
                        let point = (vector * K::Rays::N + lane).min(last);
                        let relative = O::point(beams.points[point])[axis] - centre[axis];
                        lanes.0[0][lane] = (relative * scale) as f32;
                        lanes.0[1][lane] = origins[point][axis];
                    }
                    group.relative[vector][axis] = K::Rays::load(lanes.0[0].as_ptr());
                    let place = K::Rays::load(lanes.0[1].as_ptr());
                    let place =
                        place.mul_sub(place.filled(box_scale), place.filled(box_centre[axis]));
                    group.places[vector][axis] = place;
                    place.store(places.0[vector][axis].as_mut_ptr());
                }
                let place = |lane: usize| Vec3::from(places.0[vector].each(|axis| axis[lane]));
                group.bounds[vector] = Aabb::around((0..K::Rays::N).map(place));
            }
            for lane in 0..K::Rays::N {
                for axis in 0..3 {
                    let mut lanes = Aligned([0.0; LANES]);
                    for (vector, place) in lanes.0.iter_mut().enumerate() {
                        *place = places.0[vector.min(count - 1)][axis][lane];
                    }
                    group.columns[lane][axis] = K::Rays::load(lanes.0.as_ptr());
                }
            }
            group.whole = Aabb::union_of(&group.bounds[..count]);
            group
        }
    }
}

/// The rays of a group in one direction.
pub(super) struct Beam<'a, K: Instructions, O: Obstacles> {
    group: &'a Group<K>,
    beams: &'a Beams<'a, O>,
    direction: DVec3,
    /// The axes in the shear's order: the direction's largest component is the last.
    axes: [usize; 3],
    /// The movement along the first two axes against a step along the third.
    slope: [f64; 2],
    /// The largest coordinates of the sheared points.
    half: [f32; 3],
    /// −0 if the direction runs backwards along the last axis, otherwise 0.
    side: f32,
    /// The ends of the range, each with what is certainly before and behind it, as depths.
    range: [[f32; 2]; 2],
    /// The sheared points.
    points: [[K::Rays; 3]; VECTORS],
    /// What decides which boxes rays enter: for each ray, for each vector and for all.
    sides: [Sides<K::Rays>; VECTORS],
    bounds: [Bounds<K::Boxes>; VECTORS],
    whole: Bounds<K::Boxes>,
    outlook: Outlook<K::Boxes>,
}

impl<'a, K: Instructions, O: Obstacles> Beam<'a, K, O> {
    #[inline(always)]
    pub(super) unsafe fn new(group: &'a Group<K>, beams: &'a Beams<'a, O>) -> Self {
        // SAFETY: the processor has the instructions.
        unsafe {
            let none = [K::Rays::splat(0.0); 3];
            Self {
                group,
                beams,
                direction: DVec3::ZERO,
                axes: [0; 3],
                slope: [0.0; 2],
                half: [0.0; 3],
                side: 0.0,
                range: [[0.0; 2]; 2],
                points: [none; VECTORS],
                sides: [Sides { pairs: none, begin: none, end: none[0] }; VECTORS],
                bounds: [Bounds::none(); VECTORS],
                whole: Bounds::none(),
                outlook: Outlook::none(),
            }
        }
    }

    /// Turns all rays to a direction.
    #[inline(always)]
    pub(super) unsafe fn aim(&mut self, direction: DVec3) {
        let Self { group, beams, .. } = *self;
        let axes = AXES[largest_axis(direction)];
        let [x, y, z] = axes;
        let depth = direction[z];
        let slope = [-direction[x] / depth, -direction[y] / depth];
        let slopes = slope.each(|slope| slope as f32);
        let size = depth.abs() * group.scale;
        let half = group.half;
        self.direction = direction;
        self.axes = axes;
        self.slope = slope;
        self.half = [
            slopes[0].abs().mul_add(half[z], half[x]) * (1.0 + 2.0 * f32::EPSILON),
            slopes[1].abs().mul_add(half[z], half[y]) * (1.0 + 2.0 * f32::EPSILON),
            half[z],
        ];
        self.side = if depth < 0.0 { -0.0 } else { 0.0 };
        self.range = beams.range.each(|t| {
            let end = (t * size).min(16.0);
            let slack = end * f64::from(pow2(-21)) + f64::from(f32::from_bits(1)) * size;
            [(end - slack) as f32, (end + slack) as f32]
        });
        // SAFETY: the processor has the instructions.
        unsafe {
            let slopes = [K::Rays::splat(slopes[0]), K::Rays::splat(slopes[1])];
            for vector in 0..group.count {
                let relative = &group.relative[vector];
                let depths = relative[z];
                self.points[vector] = [
                    depths.mul_add(slopes[0], relative[x]),
                    depths.mul_add(slopes[1], relative[y]),
                    depths,
                ];
            }
            self.look();
        }
    }

    /// Computes what decides which boxes rays enter.
    #[inline(always)]
    unsafe fn look(&mut self) {
        let Self { group, beams, direction, .. } = *self;
        let ray = beams.obstacles.ray(beams.points[0], direction, beams.range);
        let boxed = beams.obstacles.boxed(&ray);
        let along = boxed.direction();
        let sign = Vec3::ONE.copysign(along);
        let size = along.abs() / along.abs().max_element();
        let last = largest_axis(size.as_dvec3());
        let range = f64::from(boxed.t_max()) * (1.0 + f64::from(pow2(-20)));
        let range = (range + f64::from(f32::from_bits(1))) * f64::from(along[last].abs());
        let pad = pow2(-19);
        let range = (range * f64::from(group.box_scale) * f64::from(1.0 + pad)) as f32 + pad;
        // SAFETY: the processor has the instructions; there are aligned lanes.
        unsafe {
            self.outlook = Outlook::new(sign, size, group.box_scale, group.box_centre, last);
            let mut factors = [[K::Rays::splat(0.0); 2]; 3];
            for (factors, [a, b]) in factors.iter_mut().zip(PAIRS) {
                *factors = [K::Rays::splat(sign[a] * size[b]), K::Rays::splat(sign[b] * size[a])];
            }
            let mut least = pairs(&group.columns[0], &factors);
            let mut most = least;
            for places in &group.columns[1..K::Rays::N] {
                for (k, pair) in pairs(places, &factors).into_iter().enumerate() {
                    least[k] = least[k].min(pair);
                    most[k] = most[k].max(pair);
                }
            }
            let mut extremes = Aligned([[[0.0; LANES]; 2]; 3]);
            for (k, extremes) in extremes.0.iter_mut().enumerate() {
                least[k].store(extremes[0].as_mut_ptr());
                most[k].store(extremes[1].as_mut_ptr());
                self.whole.least[k] = K::Boxes::splat(least_of(least[k]));
                self.whole.most[k] = K::Boxes::splat(most[k].greatest());
            }
            let minus = sign.map(|sign| 0.0f32.copysign(sign));
            for (vector, bounds) in self.bounds.iter_mut().enumerate().take(group.count) {
                let places = &group.places[vector];
                let sides = &mut self.sides[vector];
                sides.pairs = pairs(places, &factors);
                for axis in 0..3 {
                    sides.begin[axis] = places[axis] ^ places[axis].filled(minus[axis]);
                    bounds.least[axis] = K::Boxes::splat(extremes.0[axis][0][vector]);
                    bounds.most[axis] = K::Boxes::splat(extremes.0[axis][1][vector]);
                }
                sides.end = sides.begin[last] + places[last].filled(range);
                bounds.set_ends(&group.bounds[vector], sign, last, range);
            }
            self.whole.set_ends(&group.whole, sign, last, range);
        }
    }
}

impl<K: Instructions, O: Obstacles> Shape<K, O> for Beam<'_, K, O> {
    type Outline = Outline<K::Boxes>;
    type Rows = Rows;
    type Child = Outline<K::Rays>;
    type Shadows = Shadows;

    #[inline(always)]
    unsafe fn outline(&self, node: &WideNode) -> Outline<K::Boxes> {
        // SAFETY: the processor has the instructions.
        unsafe { self.outlook.outline(node) }
    }

    #[inline(always)]
    unsafe fn all(&self, outline: &Outline<K::Boxes>) -> (u32, Option<K::Boxes>) {
        (outline.meets_bounds(&self.whole), None)
    }

    #[inline(always)]
    unsafe fn vector(&self, outline: &Outline<K::Boxes>, vector: usize) -> u32 {
        outline.meets_bounds(&self.bounds[vector])
    }

    #[inline(always)]
    unsafe fn write(&self, outline: &Outline<K::Boxes>, rows: *mut Rows) {
        // SAFETY: there is room.
        unsafe { outline.write(rows) };
    }

    #[inline(always)]
    unsafe fn child(&self, rows: &Rows, lane: usize) -> Outline<K::Rays> {
        // SAFETY: the processor has the instructions, and there is such a lane.
        unsafe { Outline::of_child(rows, lane) }
    }

    #[inline(always)]
    unsafe fn rays(&self, child: &Outline<K::Rays>, vector: usize) -> u32 {
        let Sides { pairs, begin, end } = &self.sides[vector];
        child.meets(pairs, pairs, begin, *end)
    }

    #[inline(always)]
    unsafe fn shadows(&self, block: &TriangleBlock) -> Shadows {
        // SAFETY: the processor has the instructions.
        unsafe { Shadows::of_beam(self, block) }
    }

    #[inline(always)]
    unsafe fn test(&self, shadows: &Shadows, lane: usize, vector: usize, rays: u32) -> (u32, u32) {
        // SAFETY: the processor has the instructions; the lane is one of four.
        unsafe {
            let [x, y, z] = self.points[vector];
            let u = shadows.value_at(0, lane, x, y);
            let v = shadows.value_at(3, lane, x, y);
            let w = shadows.value_at(6, lane, x, y);
            let least = u.min(v).min(w);
            let edge_error = shadows.number(Shadows::EDGE_ERROR, lane);
            let area = shadows.number(Shadows::AREA, lane);
            let error = x.filled(edge_error);
            // The bound of S is four times that of an edge value.
            let is_flat = area <= 4.0 * edge_error;
            let mut missed = least.lt(x.filled(-edge_error)).bits();
            if is_flat {
                missed &= error.lt(u.max(v).max(w)).bits();
            }
            let possible = rays & !missed;
            if possible == 0 {
                return (0, 0);
            }
            let z = z ^ z.filled(self.side);
            let depth = shadows.value_at(Shadows::DEPTH, lane, x, y) - z * z.filled(area);
            let slack = shadows.number(Shadows::DEPTH_ERROR, lane);
            let [begin, end] = self.range;
            let within = z.filled(area * begin[1] + slack).lt(depth)
                & depth.lt(z.filled(area * end[0] - slack));
            let beyond = depth.lt(z.filled(area * begin[0] - slack))
                | z.filled(area * end[1] + slack).lt(depth);
            let certain = if is_flat { 0 } else { error.lt(least).bits() & within.bits() };
            let stopped = possible & certain;
            (stopped, possible & !stopped & !beyond.bits())
        }
    }

    fn ray(&self, number: usize) -> O::Ray {
        let Beams { obstacles, points, range, .. } = self.beams;
        obstacles.ray(points[number], self.direction, *range)
    }
}

/// The coefficients of four triangles for a beam, lane by lane: three for each edge value, three for
/// the depth, |S|, and the bounds of the errors. The signs are those for a positive S and a positive
/// direction.
pub(super) type Shadows = Coefficients<15>;

impl Shadows {
    const DEPTH: usize = 9;
    const AREA: usize = 12;
    const EDGE_ERROR: usize = 13;
    const DEPTH_ERROR: usize = 14;

    /// Returns what the three coefficients from a row on give for points.
    ///
    /// # Safety
    /// As for [`number`](Self::number).
    #[inline(always)]
    unsafe fn value_at<L: Lanes>(&self, row: usize, lane: usize, x: L, y: L) -> L {
        // SAFETY: the rows exist.
        unsafe {
            let constant = x.filled(self.number(row + 2, lane));
            let along_y = x.filled(self.number(row + 1, lane)).mul_add(y, constant);
            x.filled(self.number(row, lane)).mul_add(x, along_y)
        }
    }

    #[inline(always)]
    unsafe fn of_beam<K: Instructions, O: Obstacles>(
        beam: &Beam<'_, K, O>,
        block: &TriangleBlock,
    ) -> Self {
        // SAFETY: the processor has the instructions; a register of a block has four lanes.
        unsafe {
            let [x, y, z] = beam.axes;
            let scale = <K::Block as Lanes>::Double::splat(beam.group.scale);
            let centre = beam.group.centre * beam.group.scale;
            let middle =
                [scale.filled(centre[x]), scale.filled(centre[y]), scale.filled(centre[z])];
            let slope = [scale.filled(beam.slope[0]), scale.filled(beam.slope[1])];
            let [a, b, c] = beam.beams.obstacles.corners::<K::Block>(block, beam.axes);
            let a = sheared(a, middle, scale, slope);
            let b = sheared(b, middle, scale, slope);
            let c = sheared(c, middle, scale, slope);
            let u = edge(&b, &c);
            let v = edge(&c, &a);
            let w = edge(&a, &b);
            let area = w[1].mul_sub(v[0], w[0] * v[1]);
            let (side, other) = (b[2] - a[2], c[2] - a[2]);
            let depth = [
                v[0].mul_add(side, w[0] * other),
                v[1].mul_add(side, w[1] * other),
                area.mul_add(a[2], v[2].mul_add(side, w[2] * other)),
            ];
            let area = K::Block::single(area);
            let minus = area.filled(-0.0);
            let flip = area & minus;
            let area = area.abs();
            let [hx, hy, hz] = beam.half;
            let (hx, hy, hz) = (area.filled(hx), area.filled(hy), area.filled(hz));
            let mut rows = MaybeUninit::<Aligned<[[f32; 4]; 15]>>::uninit();
            let to = rows.as_mut_ptr().cast::<f32>();
            let half = [hx, hy];
            let u = write::<K::Block>(u, flip, half, to);
            let v = write::<K::Block>(v, flip, half, to.add(12));
            let w = write::<K::Block>(w, flip, half, to.add(24));
            let sizes = u.max(v).max(w);
            let flip = flip ^ area.filled(beam.side);
            let depths = write::<K::Block>(depth, flip, half, to.add(4 * Self::DEPTH));
            let depths = area.mul_add(hz, depths);
            let far_x = a[0].abs().max(b[0].abs()).max(c[0].abs());
            let far_y = a[1].abs().max(b[1].abs()).max(c[1].abs());
            let extent = K::Block::single(far_x.max(far_y)) + hx + hy;
            let roundings = area.filled(pow2(-20));
            let edge_error = sizes.mul_add(roundings, extent * area.filled(pow2(-44)));
            let depth_error = depths.mul_add(roundings, extent * area.filled(pow2(-39)));
            area.store(to.add(4 * Self::AREA));
            edge_error.store(to.add(4 * Self::EDGE_ERROR));
            depth_error.store(to.add(4 * Self::DEPTH_ERROR));
            Self(rows.assume_init().0)
        }
    }
}

// These are functions, since closures may not be compiled with the instructions.

/// Returns a corner relative to the middle of a beam, scaled and sheared.
#[inline(always)]
fn sheared<D: DoubleLanes>(corner: [D; 3], middle: [D; 3], scale: D, slope: [D; 2]) -> [D; 3] {
    // The products are exact.
    let z = corner[2].mul_sub(scale, middle[2]);
    [
        z.mul_add(slope[0], corner[0].mul_sub(scale, middle[0])),
        z.mul_add(slope[1], corner[1].mul_sub(scale, middle[1])),
        z,
    ]
}

/// Returns the coefficients of the edge value of two corners.
#[inline(always)]
fn edge<D: DoubleLanes>([bx, by, _]: &[D; 3], [cx, cy, _]: &[D; 3]) -> [D; 3] {
    [*by - *cy, *cx - *bx, bx.mul_sub(*cy, *by * *cx)]
}

/// Writes three coefficients with flipped signs as rows of four, and returns a bound of the sizes of
/// their terms together.
#[inline(always)]
unsafe fn write<L: Lanes>(
    coefficients: [L::Double; 3],
    flip: L,
    [hx, hy]: [L; 2],
    to: *mut f32,
) -> L {
    // SAFETY: there is room for three rows.
    let [x, y, constant] = unsafe { store_three(coefficients, flip, to) };
    x.mul_add(hx, y.mul_add(hy, constant))
}

/// The pairs of axes.
const PAIRS: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];

/// Returns the places of rays beside each other, for each pair of axes.
#[inline(always)]
fn pairs<L: Lanes>(&[x, y, z]: &[L; 3], [xy, yz, zx]: &[[L; 2]; 3]) -> [L; 3] {
    [x.mul_sub(xy[0], y * xy[1]), y.mul_sub(yz[0], z * yz[1]), z.mul_sub(zx[0], x * zx[1])]
}

/// What decides which boxes rays enter, a ray per lane: where they run beside each other, and where
/// they begin and end.
#[derive(Clone, Copy)]
struct Sides<L> {
    pairs: [L; 3],
    begin: [L; 3],
    end: L,
}

/// Bounds of the sides of many rays.
#[derive(Clone, Copy)]
struct Bounds<L> {
    least: [L; 3],
    most: [L; 3],
    begin: [L; 3],
    end: L,
}

impl<L: Lanes> Bounds<L> {
    #[inline(always)]
    unsafe fn none() -> Self {
        // SAFETY: the processor has the instructions.
        let none = unsafe { L::splat(0.0) };
        Self { least: [none; 3], most: [none; 3], begin: [none; 3], end: none }
    }

    #[inline(always)]
    unsafe fn set_ends(&mut self, places: &Aabb, sign: Vec3, last: usize, range: f32) {
        // SAFETY: the processor has the instructions.
        unsafe {
            for axis in 0..3 {
                let is_forwards = sign[axis] > 0.0;
                let begin = if is_forwards { places.min[axis] } else { -places.max[axis] };
                self.begin[axis] = L::splat(begin);
            }
            let end = if sign[last] > 0.0 { places.max[last] } else { -places.min[last] };
            self.end = L::splat(end + range);
        }
    }
}

/// A direction as boxes are seen along it.
struct Outlook<L> {
    /// The rows of the planes that the rays meet first, by axis, and of the planes opposite.
    near: [usize; 3],
    far: [usize; 3],
    scale: [L; 3],
    centre: [L; 3],
    size: [L; 3],
    pad: L,
    /// The axis along which the direction is largest.
    last: usize,
}

impl<L: Lanes> Outlook<L> {
    #[inline(always)]
    unsafe fn none() -> Self {
        // SAFETY: the processor has the instructions.
        unsafe { Self::new(Vec3::ONE, Vec3::ONE, 1.0, Vec3::ONE, 0) }
    }

    #[inline(always)]
    unsafe fn new(sign: Vec3, size: Vec3, scale: f32, centre: Vec3, last: usize) -> Self {
        // SAFETY: the processor has the instructions.
        unsafe {
            let splat = |v: Vec3| [L::splat(v.x), L::splat(v.y), L::splat(v.z)];
            let is_backwards = [sign.x < 0.0, sign.y < 0.0, sign.z < 0.0].each(usize::from);
            let [x, y, z] = is_backwards;
            Self {
                near: [3 * x, 1 + 3 * y, 2 + 3 * z],
                far: [3 - 3 * x, 4 - 3 * y, 5 - 3 * z],
                scale: splat(sign * scale),
                centre: splat(sign * centre),
                size: splat(size),
                pad: L::splat(pow2(-19)),
                last,
            }
        }
    }

    /// Returns what bounds the rays that enter the children of a node.
    #[inline(always)]
    unsafe fn outline(&self, node: &WideNode) -> Outline<L> {
        // SAFETY: planes are whole and aligned.
        unsafe {
            let planes = node.planes.as_ptr();
            let near = self.planes(planes, &self.near);
            let far = self.planes(planes, &self.far);
            let pad = self.pad;
            let [x, y, z] = self.size;
            Outline {
                least: [
                    near[0].mul_sub(y, far[1].mul_add(x, pad)),
                    near[1].mul_sub(z, far[2].mul_add(y, pad)),
                    near[2].mul_sub(x, far[0].mul_add(z, pad)),
                ],
                most: [
                    far[0].mul_sub(y, near[1].mul_sub(x, pad)),
                    far[1].mul_sub(z, near[2].mul_sub(y, pad)),
                    far[2].mul_sub(x, near[0].mul_sub(z, pad)),
                ],
                far,
                near: near[self.last],
            }
        }
    }

    #[inline(always)]
    unsafe fn planes(&self, planes: *const [f32; 8], rows: &[usize; 3]) -> [L; 3] {
        // SAFETY: planes are whole and aligned.
        unsafe {
            let [x, y, z] = [
                L::load(planes.add(rows[0]).cast()),
                L::load(planes.add(rows[1]).cast()),
                L::load(planes.add(rows[2]).cast()),
            ];
            [
                x.mul_sub(self.scale[0], self.centre[0]),
                y.mul_sub(self.scale[1], self.centre[1]),
                z.mul_sub(self.scale[2], self.centre[2]),
            ]
        }
    }
}

/// Bounds of the sides of rays that enter boxes.
pub(super) struct Outline<L> {
    least: [L; 3],
    most: [L; 3],
    far: [L; 3],
    near: L,
}

/// An outline of eight boxes.
pub(super) type Rows = Aligned<[[f32; WideNode::LANES]; 10]>;

impl<L: Lanes> Outline<L> {
    /// Returns a bit for each box that rays of these bounds may enter.
    #[inline(always)]
    fn meets_bounds(&self, Bounds { least, most, begin, end }: &Bounds<L>) -> u32 {
        self.meets(least, most, begin, *end)
    }

    #[inline(always)]
    fn meets(&self, least: &[L; 3], most: &[L; 3], begin: &[L; 3], end: L) -> u32 {
        let mut meets = self.near.le(end);
        for axis in 0..3 {
            meets = meets
                & self.least[axis].le(most[axis])
                & least[axis].le(self.most[axis])
                & begin[axis].le(self.far[axis]);
        }
        meets.bits()
    }

    #[inline(always)]
    unsafe fn write(&self, rows: *mut Rows) {
        // SAFETY: there is room for ten rows.
        unsafe {
            let to = rows.cast::<f32>();
            for axis in 0..3 {
                self.least[axis].store(to.add(8 * axis));
                self.most[axis].store(to.add(8 * (3 + axis)));
                self.far[axis].store(to.add(8 * (6 + axis)));
            }
            self.near.store(to.add(8 * 9));
        }
    }

    /// Returns the outline of one child in all lanes.
    #[inline(always)]
    unsafe fn of_child(rows: &Rows, lane: usize) -> Self {
        // SAFETY: the processor has the instructions; the rows have eight lanes.
        unsafe {
            let row = |row: usize| L::splat(*rows.0[row].get_unchecked(lane));
            Self {
                least: [row(0), row(1), row(2)],
                most: [row(3), row(4), row(5)],
                far: [row(6), row(7), row(8)],
                near: row(9),
            }
        }
    }
}
