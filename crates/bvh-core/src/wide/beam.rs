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
//! fused operations, a product and a difference, instead of thirty. Boxes are tested twice: all
//! children of a node against each vector of rays by interval arithmetic, as in
//! [`packet`](super::packet), then a leaf's box against every ray of the vectors that may enter it.
//! Only the vectors that may enter a child go on to its children.
//!
//! # The bounds
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
//!
//! # Far apart
//!
//! Where the points of a beam are far apart, many vectors may enter boxes that none of their rays
//! enter. There every ray is tested against the boxes of inner nodes, too, and farther apart rays one
//! by one take less work. The first beams tell both.

use super::instructions::{Instructions, Pending, Task};
use super::kernel::{Kernel, SPARE, STACK, deep_stacks};
use super::lanes::{Aligned, DoubleLanes, Lanes, Mask};
use super::layout::{Child, WideBvh, WideNode};
use super::triangles::TriangleBlock;
use super::vector;
use crate::double::largest_axis;
use crate::exact::AXES;
use crate::ray::pow2;
use crate::slabs::{FAR, NEAR};
use crate::{Aabb, Ray};
use core::mem::MaybeUninit;
use glam::{DVec3, Vec3};

/// The maximum number of points of a beam.
pub(crate) const POINTS: usize = 64;

/// The maximum number of vectors of a beam.
const VECTORS: usize = POINTS / 4;

/// The triangles that stop beams, in f32 or f64, laid out.
pub(crate) trait Obstacles {
    /// A point.
    type Point: Copy + Into<DVec3>;
    /// A ray.
    type Ray;

    /// The layout of the boxes.
    fn boxes(&self) -> &WideBvh;

    /// The point in f64.
    fn point(point: Self::Point) -> DVec3;

    /// Returns a bound of the coordinates of all corners relative to a point.
    fn reach(&self, point: DVec3) -> f64;

    /// The ray from a point, over the range of beams.
    fn ray(&self, point: Self::Point, direction: DVec3, range: [f64; 2]) -> Self::Ray;

    /// Returns the ray as boxes are tested with it.
    fn boxed(&self, ray: &Self::Ray) -> Ray;

    /// Returns the corners of a block's triangles along some axes.
    unsafe fn corners<L: Lanes>(
        &self,
        block: &TriangleBlock,
        axes: [usize; 3],
    ) -> [[L::Double; 3]; 3];

    /// Returns whether the triangle in a lane of a block stops a ray.
    fn stops(&self, ray: &Self::Ray, block: &TriangleBlock, lane: usize) -> bool;

    /// Writes whether anything stops each ray.
    fn are_stopped(&self, rays: &[Self::Ray], stopped: &mut [bool]);
}

/// Neighbouring points, and the directions in which they look.
pub(crate) struct Beams<'a, O: Obstacles> {
    pub(crate) obstacles: &'a O,
    /// At most [`POINTS`], at least one.
    pub(crate) points: &'a [O::Point],
    /// Only directions above the surface count.
    pub(crate) normals: Option<&'a [O::Point]>,
    pub(crate) directions: &'a [DVec3],
    pub(crate) range: [f64; 2],
}

impl<O: Obstacles> Beams<'_, O> {
    /// Passes for each direction its number and a bit for each point from which it is free.
    pub(crate) fn trace(&self, free: &mut dyn FnMut(usize, u64)) {
        let numbers = spread(self.directions.len());
        let wide = self.obstacles.boxes();
        let boxed = |&point: &O::Point| {
            let ray = self.obstacles.ray(point, DVec3::X, self.range);
            self.obstacles.boxed(&ray).origin()
        };
        let origins: Vec<Vec3> = self.points.iter().map(boxed).collect();
        let is_near = wide.near_box().contains(&Aabb::around(origins.iter().copied()));
        if wide.kernel == Kernel::Portable || !is_near {
            return self.trace_alone(&numbers, free);
        }
        let task = Trace { beams: self, origins: &origins, numbers: &numbers, free };
        // SAFETY: a layout's kernel is available.
        let traced = unsafe { vector::dispatch(wide.kernel, task) };
        self.trace_alone(&numbers[traced..], free);
    }

    /// Traces ray by ray in the directions of these numbers.
    fn trace_alone(&self, numbers: &[u32], free: &mut dyn FnMut(usize, u64)) {
        /// Directions of one batch of rays, which pays if it is long.
        const AT_ONCE: usize = 32;
        let count = self.points.len();
        for numbers in numbers.chunks(AT_ONCE) {
            let ray = |&number: &u32| {
                let direction = self.directions[number as usize];
                self.points.iter().map(move |&from| self.obstacles.ray(from, direction, self.range))
            };
            let rays: Vec<O::Ray> = numbers.iter().flat_map(ray).collect();
            let mut stopped = vec![false; rays.len()];
            self.obstacles.are_stopped(&rays, &mut stopped);
            for (&number, stopped) in numbers.iter().zip(stopped.chunks_exact(count)) {
                let direction = self.directions[number as usize];
                let is_free = |&point: &usize| !stopped[point] && self.is_above(point, direction);
                free(number as usize, (0..count).filter(is_free).map(|point| 1 << point).sum());
            }
        }
    }

    /// Returns whether a direction is above the surface at a point.
    #[inline(always)]
    fn is_above(&self, point: usize, direction: DVec3) -> bool {
        // A tiny normal counts, too.
        self.normals.is_none_or(|normals| normals[point].into().dot(direction) > 0.0)
    }
}

/// Returns the numbers of directions in an order of which every beginning is spread over all of
/// them: by steps of about the golden section.
fn spread(count: usize) -> Vec<u32> {
    let is_coprime = |&step: &usize| {
        let (mut a, mut b) = (step, count);
        while b != 0 {
            (a, b) = (b, a % b);
        }
        a == 1
    };
    let step = (count * 5 / 13..count).find(is_coprime).unwrap_or(1);
    let [count, step] = [count as u64, step as u64];
    (0..count).map(|number| (number * step % count) as u32).collect()
}

/// The number of beams that tell how the others of the same points are traced.
const TRIALS: usize = 4;

/// The fraction of the children of inner nodes that no ray enters, of those that vectors may enter,
/// from which on testing every ray pays.
const LEAST_PRUNED: f32 = 0.3;

/// The work for each ray, about in cycles, from which on points are so far apart that their rays are
/// traced one by one.
const MOST_WORK: u64 = 330;

/// The tracing of beams by a vector kernel.
struct Trace<'a, O: Obstacles> {
    beams: &'a Beams<'a, O>,
    /// The points as boxes are tested with them.
    origins: &'a [Vec3],
    /// The numbers of the directions.
    numbers: &'a [u32],
    free: &'a mut dyn FnMut(usize, u64),
}

impl<K: Instructions, O: Obstacles> Task<K> for Trace<'_, O> {
    /// The number of directions that were traced.
    type Output = usize;

    #[inline(always)]
    unsafe fn run(self) -> usize {
        let Self { beams, origins, numbers, free } = self;
        let wide = beams.obstacles.boxes();
        // SAFETY: the processor has the instructions; the stack has room for `stack_need` children
        // and one register more.
        unsafe {
            let group = Group::<K>::new(beams, origins);
            let mut stack = MaybeUninit::<Aligned<[Pending; STACK + SPARE]>>::uninit();
            let mut deep = deep_stacks::<Pending>(1, wide.stack_need);
            let base =
                deep.as_mut().map_or(stack.as_mut_ptr().cast(), |deep| deep.as_mut_ptr().cast());
            let mut work = 0;
            let [mut tested, mut pruned] = [0; 2];
            for (place, &number) in numbers.iter().enumerate() {
                let most = MOST_WORK * (TRIALS * origins.len()) as u64;
                if place == TRIALS && work > most {
                    return place;
                }
                let direction = beams.directions[number as usize];
                let mut beam = Beam::new(&group, beams, direction);
                beam.is_strict = place < TRIALS || pruned as f32 > LEAST_PRUNED * tested as f32;
                if let Some(root) = wide.root {
                    beam.traverse(root, base);
                }
                work += beam.work;
                if place < TRIALS {
                    tested += beam.tested;
                    pruned += beam.pruned;
                }
                free(number as usize, beam.free());
            }
            numbers.len()
        }
    }
}

/// Points side by side: what beams in all directions have in common.
struct Group<K: Instructions> {
    /// The middle, and the power of two by which relative coordinates are scaled.
    centre: DVec3,
    scale: f64,
    /// The largest relative coordinates.
    half: Vec3,
    relative: [[K::Rays; 3]; VECTORS],
    /// As boxes are tested with them, and the extremes of each vector.
    origins: [[K::Rays; 3]; VECTORS],
    bounds: [Aabb; VECTORS],
    /// The number of vectors.
    count: usize,
}

impl<K: Instructions> Group<K> {
    #[inline(always)]
    unsafe fn new<O: Obstacles>(beams: &Beams<'_, O>, origins: &[Vec3]) -> Self {
        let points = || beams.points.iter().map(|&point| O::point(point));
        let min = points().fold(DVec3::INFINITY, DVec3::min);
        let max = points().fold(DVec3::NEG_INFINITY, DVec3::max);
        let centre = min * 0.5 + max * 0.5;
        let half = (max - centre).max(centre - min);
        let reach = beams.obstacles.reach(centre).max(half.max_element());
        let scale = power_below(1.0 / reach);
        let last = beams.points.len() - 1;
        // SAFETY: the processor has the instructions; there are aligned lanes.
        unsafe {
            let none = [[K::Rays::splat(0.0); 3]; VECTORS];
            let count = beams.points.len().div_ceil(K::Rays::N);
            let mut group = Self {
                centre,
                scale,
                // Rounded up.
                half: (half * scale).as_vec3() * (1.0 + 2.0 * f32::EPSILON),
                relative: none,
                origins: none,
                bounds: [Aabb::EMPTY; VECTORS],
                count,
            };
            for (vector, origins) in origins.chunks(K::Rays::N).enumerate() {
                group.bounds[vector] = Aabb::around(origins.iter().copied());
            }
            for vector in 0..count {
                for axis in 0..3 {
                    let mut lanes = Aligned([[0.0; 16]; 2]);
                    for lane in 0..K::Rays::N {
                        let point = (vector * K::Rays::N + lane).min(last);
                        let relative = O::point(beams.points[point])[axis] - centre[axis];
                        lanes.0[0][lane] = (relative * scale) as f32;
                        lanes.0[1][lane] = origins[point][axis];
                    }
                    group.relative[vector][axis] = K::Rays::load(lanes.0[0].as_ptr());
                    group.origins[vector][axis] = K::Rays::load(lanes.0[1].as_ptr());
                }
            }
            group
        }
    }
}

/// Returns the greatest power of two up to a positive normal number.
fn power_below(x: f64) -> f64 {
    f64::from_bits(x.to_bits() >> 52 << 52)
}

/// The rays of a group in one direction.
struct Beam<'a, K: Instructions, O: Obstacles> {
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
    boxed: Ray,
    /// The sheared points.
    points: [[K::Rays; 3]; VECTORS],
    /// The reciprocals of the direction for entries and for exits.
    factors: [[K::Rays; 2]; 3],
    /// A bit for each ray that nothing has stopped.
    live: [u32; VECTORS],
    /// A bit for each ray that enters the box of the leaf being visited, of the vectors that do.
    entered: [u32; VECTORS],
    /// What was done, about in cycles.
    work: u64,
    /// Whether every ray is tested against the boxes of inner nodes, how many of those were, and
    /// how many no ray enters.
    is_strict: bool,
    tested: u32,
    pruned: u32,
}

impl<'a, K: Instructions, O: Obstacles> Beam<'a, K, O> {
    #[inline(always)]
    unsafe fn new(group: &'a Group<K>, beams: &'a Beams<'a, O>, direction: DVec3) -> Self {
        let boxed =
            beams.obstacles.boxed(&beams.obstacles.ray(beams.points[0], direction, beams.range));
        let axes = AXES[largest_axis(direction)];
        let [x, y, z] = axes;
        let depth = direction[z];
        let slope = [-direction[x] / depth, -direction[y] / depth];
        let slopes = slope.map(|slope| slope as f32);
        let size = depth.abs() * group.scale;
        let half = group.half;
        // SAFETY: the processor has the instructions.
        unsafe {
            let none = K::Rays::splat(0.0);
            let inverse = boxed.inverse_direction();
            let mut beam = Self {
                group,
                beams,
                direction,
                axes,
                slope,
                half: [
                    slopes[0].abs().mul_add(half[z], half[x]) * (1.0 + 2.0 * f32::EPSILON),
                    slopes[1].abs().mul_add(half[z], half[y]) * (1.0 + 2.0 * f32::EPSILON),
                    half[z],
                ],
                side: if depth < 0.0 { -0.0 } else { 0.0 },
                range: beams.range.map(|t| {
                    let end = (t * size).min(16.0);
                    let slack = end * f64::from(pow2(-21)) + f64::from(f32::from_bits(1)) * size;
                    [(end - slack) as f32, (end + slack) as f32]
                }),
                boxed,
                points: [[none; 3]; VECTORS],
                factors: [[none; 2]; 3],
                live: [0; VECTORS],
                entered: [0; VECTORS],
                work: 0,
                is_strict: true,
                tested: 0,
                pruned: 0,
            };
            for (axis, factors) in beam.factors.iter_mut().enumerate() {
                let near = K::Rays::splat(inverse[axis] * NEAR);
                *factors = [near, K::Rays::splat(inverse[axis] * FAR)];
            }
            let slopes = [K::Rays::splat(slopes[0]), K::Rays::splat(slopes[1])];
            for vector in 0..group.count {
                let relative = &group.relative[vector];
                let depths = relative[z];
                beam.points[vector] = [
                    depths.mul_add(slopes[0], relative[x]),
                    depths.mul_add(slopes[1], relative[y]),
                    depths,
                ];
                let first = vector * K::Rays::N;
                let lanes = K::Rays::N.min(beams.points.len() - first);
                let above = |lane: &usize| beams.is_above(first + lane, direction);
                beam.live[vector] = match beams.normals {
                    None => u32::MAX >> (32 - lanes),
                    Some(_) => (0..lanes).filter(above).map(|lane| 1 << lane).sum(),
                };
            }
            beam
        }
    }

    /// Returns a bit for each point whose ray nothing has stopped.
    #[inline(always)]
    fn free(&self) -> u64 {
        let bits = |vector: usize| u64::from(self.live[vector]) << (vector * K::Rays::N);
        (0..self.group.count).map(bits).sum()
    }

    /// Visits what the rays enter below a child.
    ///
    /// # Safety
    /// From `base` on there is room for a stack.
    #[inline(always)]
    unsafe fn traverse(&mut self, root: Child, base: *mut Pending) {
        let wide = self.beams.obstacles.boxes();
        // SAFETY: the processor has the instructions; references are sound, and the stack has room.
        unsafe {
            let intervals = Intervals::<K>::new(&self.boxed, &self.group.bounds, self.group.count);
            let mut top = base;
            let mut child = root;
            let mut vectors = u32::MAX >> (32 - self.group.count);
            if !child.is_node() {
                self.entered = self.live;
                self.visit_leaf(child.index(), vectors);
                return;
            }
            loop {
                let node = &*wide.nodes.as_ptr().add(child.index());
                let (entering, mut inner) = self.enter_children(node, vectors, &intervals);
                let is_leaf = K::Boxes::load(node.children.as_ptr().cast()).signs();
                let mut leaves = inner & is_leaf;
                inner &= !is_leaf;
                while leaves != 0 {
                    let lane = leaves.trailing_zeros() as usize & 7;
                    leaves &= leaves - 1;
                    let entered = self.enter(node, lane, &intervals, entering.of(lane));
                    let leaf = node.children.get_unchecked(lane).index();
                    if entered != 0 && self.visit_leaf(leaf, entered) {
                        return;
                    }
                }
                while inner != 0 {
                    let lane = inner.trailing_zeros() as usize & 7;
                    inner &= inner - 1;
                    let mut entered = entering.of(lane);
                    if self.is_strict {
                        entered = self.enter(node, lane, &intervals, entered);
                        self.tested += 1;
                        self.pruned += u32::from(entered == 0);
                    }
                    if entered != 0 {
                        let child = node.children.get_unchecked(lane).bits();
                        *top = u64::from(child) | u64::from(entered) << 32;
                        top = top.add(1);
                    }
                }
                if top == base {
                    return;
                }
                top = top.sub(1);
                child = Child::from_bits(*top as u32);
                vectors = (*top >> 32) as u32;
            }
        }
    }

    /// Returns which of some vectors have live rays that may enter the children of a node, and a bit
    /// for each child that any may enter.
    #[inline(always)]
    unsafe fn enter_children(
        &mut self,
        node: &WideNode,
        mut vectors: u32,
        intervals: &Intervals<K>,
    ) -> (Entering, u32) {
        let mut entering = Entering([0; 2]);
        let mut any = 0;
        self.work += 20 + 12 * u64::from(vectors.count_ones());
        // SAFETY: the processor has the instructions.
        unsafe {
            while vectors != 0 {
                let vector = vectors.trailing_zeros() as usize % VECTORS;
                vectors &= vectors - 1;
                if self.live[vector] != 0 {
                    let mask = intervals.enter(node, vector);
                    entering.0[vector / 8] |= u64::from(mask) << (8 * (vector % 8));
                    any |= mask;
                }
            }
        }
        (entering, any)
    }

    /// Returns which of some vectors have live rays that enter the box of a node's child, and notes
    /// these rays.
    #[inline(always)]
    unsafe fn enter(
        &mut self,
        node: &WideNode,
        lane: usize,
        intervals: &Intervals<K>,
        mut vectors: u32,
    ) -> u32 {
        let mut entered = 0;
        self.work += 20 * u64::from(vectors.count_ones());
        // SAFETY: the processor has the instructions; there are six planes of eight lanes.
        unsafe {
            let lanes = node.planes.as_ptr().cast::<f32>().add(lane);
            while vectors != 0 {
                let vector = vectors.trailing_zeros() as usize % VECTORS;
                vectors &= vectors - 1;
                let mut entry = K::Rays::splat(self.boxed.t_min());
                let mut exit = K::Rays::splat(self.boxed.t_max());
                for axis in 0..3 {
                    let origin = self.group.origins[vector][axis];
                    let [near_factor, far_factor] = self.factors[axis];
                    let near = K::Rays::splat(*lanes.add(WideNode::LANES * intervals.near[axis]));
                    let far = K::Rays::splat(*lanes.add(WideNode::LANES * intervals.far[axis]));
                    entry = entry.max((near - origin) * near_factor);
                    // `min` returns the second of a NaN and a number.
                    exit = ((far - origin) * far_factor).min(exit);
                }
                let rays = entry.le(exit).bits() & self.live[vector];
                self.entered[vector] = rays;
                entered |= u32::from(rays != 0) << vector;
            }
        }
        entered
    }

    /// Tests the triangles of a leaf with the rays of some vectors that enter it. Returns whether all
    /// rays are stopped.
    #[inline(always)]
    unsafe fn visit_leaf(&mut self, mut index: usize, vectors: u32) -> bool {
        let wide = self.beams.obstacles.boxes();
        // SAFETY: a block that is not its leaf's last is followed by another.
        unsafe {
            loop {
                let block = &*wide.blocks.as_ptr().add(index);
                if self.visit(block, vectors) {
                    return true;
                }
                if block.is_last() {
                    return false;
                }
                index += 1;
            }
        }
    }

    /// Tests the triangles of a block. Returns whether all rays are stopped.
    #[inline(always)]
    unsafe fn visit(&mut self, block: &TriangleBlock, vectors: u32) -> bool {
        // SAFETY: the processor has the instructions.
        unsafe {
            let shadows = Shadows::new(self, block);
            self.work += 100;
            for lane in 0..block.len() {
                let mut left = vectors;
                while left != 0 {
                    let vector = left.trailing_zeros() as usize % VECTORS;
                    left &= left - 1;
                    let live = self.live[vector] & self.entered[vector];
                    if live == 0 {
                        continue;
                    }
                    self.work += 20;
                    let (mut stopped, mut open) = self.test(&shadows, lane, vector, live);
                    while open != 0 {
                        let point = vector * K::Rays::N + open.trailing_zeros() as usize;
                        let Beams { obstacles, points, range, .. } = self.beams;
                        let ray = obstacles.ray(points[point], self.direction, *range);
                        let is_stopped = obstacles.stops(&ray, block, lane);
                        stopped |= u32::from(is_stopped) << open.trailing_zeros();
                        open &= open - 1;
                    }
                    self.live[vector] &= !stopped;
                }
            }
        }
        self.live[..self.group.count].iter().all(|&live| live == 0)
    }

    /// Returns a bit for each of some rays of a vector that the triangle in a lane certainly stops,
    /// and for each that it may stop.
    #[inline(always)]
    unsafe fn test(&self, shadows: &Shadows, lane: usize, vector: usize, live: u32) -> (u32, u32) {
        // SAFETY: the processor has the instructions; the lane is one of four.
        unsafe {
            let [x, y, z] = self.points[vector];
            let u = shadows.value(0, lane, x, y);
            let v = shadows.value(3, lane, x, y);
            let w = shadows.value(6, lane, x, y);
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
            let possible = live & !missed;
            if possible == 0 {
                return (0, 0);
            }
            let z = z ^ z.filled(self.side);
            let depth = shadows.value(Shadows::DEPTH, lane, x, y) - z * z.filled(area);
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
}

/// A byte for each vector with a bit for each child of a node that its rays may enter.
struct Entering([u64; 2]);

impl Entering {
    /// Returns a bit for each vector whose rays may enter a child.
    #[inline(always)]
    fn of(&self, child: usize) -> u32 {
        // Moves the lowest bit of byte i to bit 56 + i.
        let gather = |bytes: u64| {
            let lowest = (bytes >> child) & 0x0101_0101_0101_0101;
            (lowest.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
        };
        gather(self.0[0]) | gather(self.0[1]) << 8
    }
}

/// The coefficients of four triangles for a beam, lane by lane: three for each edge value, three for
/// the depth, |S|, and the bounds of the errors. The signs are those for a positive S and a positive
/// direction.
struct Shadows([[f32; 4]; 15]);

impl Shadows {
    const DEPTH: usize = 9;
    const AREA: usize = 12;
    const EDGE_ERROR: usize = 13;
    const DEPTH_ERROR: usize = 14;

    /// # Safety
    /// The row is one of fifteen and the lane one of four.
    #[inline(always)]
    unsafe fn number(&self, row: usize, lane: usize) -> f32 {
        // SAFETY: they exist.
        unsafe { *self.0.get_unchecked(row).get_unchecked(lane) }
    }

    /// Returns what the three coefficients from a row on give for points.
    ///
    /// # Safety
    /// As for [`number`](Self::number).
    #[inline(always)]
    unsafe fn value<L: Lanes>(&self, row: usize, lane: usize, x: L, y: L) -> L {
        // SAFETY: the rows exist.
        unsafe {
            let constant = x.filled(self.number(row + 2, lane));
            let along_y = x.filled(self.number(row + 1, lane)).mul_add(y, constant);
            x.filled(self.number(row, lane)).mul_add(x, along_y)
        }
    }

    #[inline(always)]
    unsafe fn new<K: Instructions, O: Obstacles>(
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
    [x, y, constant]: [L::Double; 3],
    flip: L,
    [hx, hy]: [L; 2],
    to: *mut f32,
) -> L {
    let [x, y, constant] = [L::single(x), L::single(y), L::single(constant)];
    // SAFETY: there is room for three rows.
    unsafe {
        (x ^ flip).store(to);
        (y ^ flip).store(to.add(4));
        (constant ^ flip).store(to.add(8));
    }
    x.abs().mul_add(hx, y.abs().mul_add(hy, constant.abs()))
}

/// The vectors of a beam, as the children of nodes are tested with them.
struct Intervals<K: Instructions> {
    /// The rows of the planes that the rays meet first, by axis, and of the planes opposite.
    near: [usize; 3],
    far: [usize; 3],
    /// The origins of near and of far planes for the least distance to one and the greatest to the
    /// other.
    origins: [[[K::Boxes; 2]; 3]; VECTORS],
    factors: [[K::Boxes; 2]; 3],
    begin: K::Boxes,
    end: K::Boxes,
}

impl<K: Instructions> Intervals<K> {
    #[inline(always)]
    unsafe fn new(ray: &Ray, bounds: &[Aabb; VECTORS], count: usize) -> Self {
        let inverse = ray.inverse_direction();
        // SAFETY: the processor has the instructions.
        unsafe {
            let none = K::Boxes::splat(0.0);
            let mut intervals = Self {
                near: [0; 3],
                far: [0; 3],
                origins: [[[none; 2]; 3]; VECTORS],
                factors: [[none; 2]; 3],
                begin: K::Boxes::splat(ray.t_min()),
                end: K::Boxes::splat(ray.t_max()),
            };
            for axis in 0..3 {
                let is_backwards = inverse[axis].is_sign_negative();
                intervals.near[axis] = axis + 3 * usize::from(is_backwards);
                intervals.far[axis] = axis + 3 * usize::from(!is_backwards);
                for (bounds, origins) in bounds.iter().zip(&mut intervals.origins).take(count) {
                    let (low, high) = (bounds.min[axis], bounds.max[axis]);
                    let (near, far) = if is_backwards { (low, high) } else { (high, low) };
                    origins[axis] = [K::Boxes::splat(near), K::Boxes::splat(far)];
                }
                let near = K::Boxes::splat(inverse[axis] * NEAR);
                intervals.factors[axis] = [near, K::Boxes::splat(inverse[axis] * FAR)];
            }
            intervals
        }
    }

    /// Returns a bit for each child of a node that some ray of a vector may enter.
    #[inline(always)]
    unsafe fn enter(&self, node: &WideNode, vector: usize) -> u32 {
        let mut entry = self.begin;
        let mut exit = self.end;
        // SAFETY: planes are whole and aligned; there is such a vector.
        unsafe {
            let planes = node.planes.as_ptr();
            let origins = self.origins.get_unchecked(vector);
            for (axis, &[near_origin, far_origin]) in origins.iter().enumerate() {
                let [near_factor, far_factor] = self.factors[axis];
                let near = K::Boxes::load(planes.add(self.near[axis]).cast());
                let far = K::Boxes::load(planes.add(self.far[axis]).cast());
                entry = entry.max((near - near_origin) * near_factor);
                // `min` returns the second of a NaN and a number.
                exit = ((far - far_origin) * far_factor).min(exit);
            }
        }
        entry.le(exit).bits()
    }
}
