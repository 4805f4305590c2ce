//! What points see: the choice between beams and fans.
//!
//! Where the points of a beam are far apart, many vectors may enter boxes that none of their rays
//! enter. There every ray is tested against the boxes of inner nodes, too, and farther apart
//! [fans](super::fan) take less work. The first beams tell both.

use super::beam::{Beam, Group};
use super::bundle::{Bundle, VECTORS};
use super::fan::{Fan, Pencil};
use super::instructions::{Instructions, Pending, Task};
use super::kernel::{Kernel, SPARE, STACK, deep_stacks};
use super::lanes::{Aligned, Lanes};
use super::neighbours::neighbours;
use super::obstacles::{Beams, Obstacles};
use super::vector;
use crate::Aabb;
use core::mem::MaybeUninit;
use glam::{DVec3, Vec3};

impl<O: Obstacles> Beams<'_, O> {
    /// Passes for each direction its number and a bit for each point from which it is free, for some
    /// of the points at a time.
    pub(crate) fn trace(&self, free: &mut dyn FnMut(usize, u128)) {
        let numbers = trials_first(self.directions.len());
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
        unsafe { vector::dispatch::<_, ()>(wide.kernel, task) };
    }

    /// Traces ray by ray in the directions of these numbers.
    fn trace_alone(&self, numbers: &[u32], free: &mut dyn FnMut(usize, u128)) {
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
                free(number as usize, bits(count, false, is_free));
            }
        }
    }
}

/// Returns the numbers of directions, first those of trials, which are spread over all of them.
fn trials_first(count: usize) -> Vec<u32> {
    let mut numbers: Vec<u32> = (0..count as u32).collect();
    numbers.sort_by_key(|&number| number as usize * TRIALS % count >= TRIALS);
    numbers
}

/// The number of beams that tell how the others of the same points are traced.
const TRIALS: usize = 4;

/// The fraction of the children of inner nodes that no ray enters, of those that vectors may enter,
/// from which on testing every ray pays.
const LEAST_PRUNED: f32 = 0.3;

/// The work for each ray of a fan, about in cycles, and that of a fan: points whose beams take more
/// are far apart.
const WORK_OF_FANS: [usize; 2] = [36, 2500];

/// The maximum number of directions of a fan, whose bits are turned together with those of as many
/// points.
const DIRECTIONS: usize = 64;

/// The tracing of views by a vector kernel.
struct Trace<'a, O: Obstacles> {
    beams: &'a Beams<'a, O>,
    /// The points as boxes are tested with them.
    origins: &'a [Vec3],
    /// The numbers of the directions.
    numbers: &'a [u32],
    free: &'a mut dyn FnMut(usize, u128),
}

impl<K: Instructions, O: Obstacles> Task<K> for Trace<'_, O> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { beams, origins, numbers, free } = self;
        let most = VECTORS * K::Rays::N;
        for first in (0..origins.len()).step_by(most) {
            let places = first..origins.len().min(first + most);
            let part = Beams {
                points: &beams.points[places.clone()],
                normals: beams.normals.map(|normals| &normals[places.clone()]),
                ..*beams
            };
            let mut free = |number, points: u128| free(number, points << first);
            // SAFETY: the processor has the instructions; there are as many points.
            unsafe { trace_part::<K, O>(&part, &origins[places], numbers, &mut free) };
        }
    }
}

/// Traces what as many points see as a beam may have.
#[inline(always)]
unsafe fn trace_part<K: Instructions, O: Obstacles>(
    beams: &Beams<'_, O>,
    origins: &[Vec3],
    numbers: &[u32],
    free: &mut dyn FnMut(usize, u128),
) {
    // SAFETY: the processor has the instructions; the stack has room for `stack_need` children and
    // one register more.
    unsafe {
        let mut stack = MaybeUninit::<Aligned<[Pending; STACK + SPARE]>>::uninit();
        let mut deep = deep_stacks::<Pending>(1, beams.obstacles.boxes().stack_need);
        let base = deep.as_mut().map_or(stack.as_mut_ptr().cast(), |deep| deep.as_mut_ptr().cast());
        let group = Group::<K>::new(beams, origins);
        let mut beam = Beam::new(&group, beams);
        let mut bundle = Bundle::new(beams.obstacles);
        let [of_ray, of_fan] = WORK_OF_FANS;
        let most = (of_ray + of_fan / numbers.len().max(1)) * TRIALS * origins.len();
        let mut others = numbers;
        while let [number, rest @ ..] = others {
            if numbers.len() - others.len() == TRIALS {
                if bundle.work > most as u64 {
                    break;
                }
                bundle.is_strict = bundle.pruned as f32 > LEAST_PRUNED * bundle.tested as f32;
            }
            let direction = beams.directions[*number as usize];
            beam.aim(direction);
            let is_above = |&point: &usize| beams.is_above(point, direction);
            let rays = bits(origins.len(), beams.normals.is_none(), is_above);
            free(*number as usize, bundle.trace::<K>(&beam, rays, base));
            others = rest;
        }
        bundle.is_strict = true;
        for octant in octants(beams, others) {
            for numbers in octant.chunks(DIRECTIONS) {
                let fan = Fan::<K>::new(beams, numbers);
                for (part, origins) in origins.chunks(DIRECTIONS).enumerate() {
                    let mut seen = [0; DIRECTIONS];
                    for (place, &origin) in origins.iter().enumerate() {
                        let point = part * DIRECTIONS + place;
                        let is_above = |&ray: &usize| {
                            beams.is_above(point, beams.directions[numbers[ray] as usize])
                        };
                        let rays = bits(numbers.len(), beams.normals.is_none(), is_above);
                        let pencil = Pencil::new(&fan, beams, point, origin);
                        seen[place] = bundle.trace::<K>(&pencil, rays, base) as u64;
                    }
                    transpose(&mut seen);
                    for (&number, &points) in numbers.iter().zip(&seen) {
                        free(number as usize, u128::from(points) << (part * DIRECTIONS));
                    }
                }
            }
        }
    }
}

/// Returns a bit for each number below `count`, of which `holds` is true unless it is for all.
#[inline(always)]
fn bits(count: usize, for_all: bool, holds: impl Fn(&usize) -> bool) -> u128 {
    match for_all {
        true => u128::MAX >> (u128::BITS as usize - count),
        false => (0..count).filter(holds).map(|number| 1 << number).sum(),
    }
}

/// Returns the numbers of directions by the octants of the boxes that they run in, neighbours next to
/// each other.
fn octants<O: Obstacles>(beams: &Beams<'_, O>, numbers: &[u32]) -> [Vec<u32>; 8] {
    let mut octants: [Vec<u32>; 8] = Default::default();
    for &number in numbers {
        let direction = beams.directions[number as usize];
        let ray = beams.obstacles.ray(beams.points[0], direction, beams.range);
        let inverse = beams.obstacles.boxed(&ray).inverse_direction();
        octants[inverse.is_negative_bitmask() as usize].push(number);
    }
    octants.map(|numbers| {
        let unit = |&number: &u32| beams.directions[number as usize].normalize();
        let units: Vec<DVec3> = numbers.iter().map(unit).collect();
        neighbours(&units).into_iter().map(|place| numbers[place as usize]).collect()
    })
}

/// Turns rows of bits into columns: bit `i` of number `j` into bit `j` of number `i`.
pub(crate) fn transpose(bits: &mut [u64; 64]) {
    let mut size = 32;
    let mut low = u64::MAX >> size;
    while size != 0 {
        for i in (0..64).filter(|i| i & size == 0) {
            let swapped = (bits[i] >> size ^ bits[i + size]) & low;
            bits[i] ^= swapped << size;
            bits[i + size] ^= swapped;
        }
        size /= 2;
        low ^= low << size;
    }
}
