//! Batches of incoherent rays many rays in flight, a step of each in turn.
//!
//! One ray alone waits: for the next node to come from memory, for one box test to end before the next can begin, for
//! the processor to recover from branches that nobody can predict. Steps of different rays do not depend on each other,
//! so that the processor does the next ray's while one waits:
//!
//! ```text
//!            ┌─> at a node: boxes ────────────────────────────┐
//!  in flight ┼─> at a leaf: candidates ─> exact decisions ────┼─> pop, fetch what comes next ─> in flight
//!            └─> at the end: write the answer, start another ─┘
//! ```
//!
//! What a ray waits for decides which list it is in and is no branch; nor is the order of hits, nor what they cut off.

use super::answer::Answers;
use super::instructions::{Instructions, Pending};
use super::kernel::STACK;
use super::lanes::Lanes;
use super::layout::WideBvh;
use super::node::{Child, WideNode};
use super::prepared::{Prepared, Ready};
use super::source::Source;
use super::triangles::TriangleBlock;
use crate::triangle::AXES;
use core::marker::PhantomData;
use core::mem::MaybeUninit;
use core::ops::Range;

/// Rays in flight, at most.
const FLIGHT: usize = 32;

/// Rays that are prepared at once, at most.
const RAYS: usize = 16;

/// Rays of a batch that are numbered together.
const MOST: usize = 1 << 31;

/// At the bottom of every stack.
const END: Child = Child::leaf(u32::MAX);

/// The answers of the rays of these numbers.
///
/// # Safety
/// As of [`batch::trace`](super::batch::trace).
#[inline(always)]
pub(crate) unsafe fn trace<K: Instructions, A: Answers>(
    wide: &WideBvh,
    rays: impl Source,
    answers: &mut A,
    numbers: Range<usize>,
) {
    const { assert!(K::FLIGHT <= FLIGHT && K::Rays::N <= RAYS) };
    // No triangle has an area. The flight below expects that every ray visits something.
    if wide.root.is_none() {
        for number in numbers {
            answers.write(number, f32::INFINITY, u32::MAX);
        }
        return;
    }
    // SAFETY: the caller's promises.
    unsafe {
        let mut traversals = MaybeUninit::<[Traversal; FLIGHT]>::uninit();
        let mut flight = Flight {
            wide,
            rays,
            answers,
            from: numbers.start,
            end: numbers.start,
            ready: [MaybeUninit::uninit(); RAYS],
            waiting: 0,
            at_nodes: List::EMPTY,
            at_leaves: List::EMPTY,
            at_end: List::EMPTY,
            instructions: PhantomData::<K>,
        };
        // Rays are numbered by 32 bits.
        while flight.end < numbers.end {
            flight.from = flight.end;
            flight.end = numbers.end.min(flight.from + MOST);
            flight.trace(traversals.as_mut_ptr().cast());
        }
    }
}

/// The way of one ray through the layout.
#[repr(C, align(64))]
struct Traversal {
    ray: Prepared,
    /// The nearest hit so far, or the end of the ray and `u32::MAX`.
    t: f32,
    object: u32,
    top: *mut Pending,
    /// The node or the block of triangles to visit next.
    child: Child,
    stack: Stack,
}

/// [`END`], what waits, the block after the present one, and room for stores of whole registers.
#[repr(C, align(64))]
struct Stack([MaybeUninit<Pending>; STACK + 24]);

impl Traversal {
    /// Goes on to what is on top of the stack, and has it fetched.
    #[inline(always)]
    unsafe fn pop<K: Instructions>(&mut self, wide: &WideBvh) {
        // SAFETY: nothing is popped after `END`; a prefetch may name any address.
        unsafe {
            self.top = self.top.sub(1);
            let child = Child::from_bits(*self.top as u32);
            self.child = child;
            let (array, size) = if child.is_node() {
                (wide.nodes.as_ptr().cast::<u8>(), size_of::<WideNode>())
            } else {
                (wide.blocks.as_ptr().cast::<u8>(), size_of::<TriangleBlock>())
            };
            let lines = array.wrapping_add(child.index().wrapping_mul(size));
            for line in 0..4 {
                K::prefetch(lines.wrapping_add(64 * line));
            }
        }
    }
}

/// Rays that wait for the same.
struct List {
    rays: [*mut Traversal; FLIGHT],
    count: usize,
}

impl List {
    const EMPTY: Self = Self { rays: [core::ptr::null_mut(); FLIGHT], count: 0 };

    /// Appends a ray if it `belongs` here, without a branch. While a list is gone through it may be filled again from its
    /// beginning.
    #[inline(always)]
    unsafe fn append(&mut self, traversal: *mut Traversal, belongs: bool) {
        // SAFETY: a list is never full when a ray is not in it.
        unsafe { *self.rays.get_unchecked_mut(self.count) = traversal };
        self.count += usize::from(belongs);
    }

    #[inline(always)]
    unsafe fn get(&self, i: usize) -> *mut Traversal {
        // SAFETY: the caller's promise: `i` is less than the count.
        unsafe { *self.rays.get_unchecked(i) }
    }
}

/// Rays of a batch: those on their way, those that have been prepared, and those that have not.
struct Flight<'a, K, S, A> {
    wide: &'a WideBvh,
    rays: S,
    answers: &'a mut A,
    /// The numbers of the rays that have not been prepared.
    from: usize,
    end: usize,
    /// The last that have been, and a bit for each that has not been started.
    ready: [MaybeUninit<Prepared>; RAYS],
    waiting: u32,
    at_nodes: List,
    at_leaves: List,
    at_end: List,
    instructions: PhantomData<K>,
}

impl<K: Instructions, S: Source, A: Answers> Flight<'_, K, S, A> {
    /// Traces all rays.
    #[inline(always)]
    unsafe fn trace(&mut self, traversals: *mut Traversal) {
        // SAFETY: the caller's promises; there is room for so many.
        unsafe {
            let first = self.from;
            for i in 0..K::FLIGHT {
                self.start(first, traversals.add(i));
            }
            while self.at_nodes.count + self.at_leaves.count > 0 {
                self.visit_nodes();
                if self.at_leaves.count >= K::FLIGHT / 2 || self.at_nodes.count == 0 {
                    self.visit_leaves();
                    self.finish(first);
                }
            }
        }
    }

    /// Starts the next ray, if there is one; number 0 is ray number `first` of its batch.
    #[inline(always)]
    unsafe fn start(&mut self, first: usize, traversal: *mut Traversal) {
        // SAFETY: `ready` is written where `waiting` has a bit.
        unsafe {
            while self.waiting == 0 {
                if self.from == self.end {
                    return;
                }
                self.prepare(first);
            }
            let next = self.waiting.trailing_zeros() as usize;
            self.waiting &= self.waiting - 1;
            let traversal = &mut *traversal;
            traversal.ray = self.ready.get_unchecked(next).assume_init();
            traversal.t = traversal.ray.t_max;
            traversal.object = u32::MAX;
            traversal.child = self.wide.root.unwrap_or(END);
            traversal.stack.0[0].write(u64::from(END.bits()));
            traversal.top = traversal
                .stack
                .0
                .as_mut_ptr()
                .cast::<Pending>()
                .add(1);
            self.enlist(traversal);
        }
    }

    /// Prepares the next rays, traces those that cannot be, and answers those that miss the box around everything.
    #[inline(always)]
    unsafe fn prepare(&mut self, first: usize) {
        let from = self.from;
        let count = (self.end - from).min(K::Rays::N);
        self.from += count;
        let there = u32::MAX >> (32 - count);
        // SAFETY: the caller's promises; `ready` has room for sixteen.
        let in_range = unsafe {
            let ready =
                Ready::new(self.rays.lanes_up_to::<K::Rays>(from, self.end), self.wide.largest);
            self.waiting = there & ready.in_range & ready.enter(&self.wide.bounds);
            if self.waiting != 0 {
                ready.write((from - first) as u32, self.ready.as_mut_ptr().cast());
            }
            ready.in_range
        };
        let mut others = there & !self.waiting;
        while others != 0 {
            let lane = others.trailing_zeros();
            let number = from + lane as usize;
            others &= others - 1;
            if in_range >> lane & 1 == 0 {
                self.answers
                    .alone(number, self.wide, &self.rays.ray(number));
            } else {
                self.answers
                    .write(number, f32::INFINITY, u32::MAX);
            }
        }
    }

    /// Puts a ray where its next visit is.
    #[inline(always)]
    unsafe fn enlist(&mut self, traversal: &mut Traversal) {
        let child = traversal.child;
        // SAFETY: every list has a place for every traversal.
        unsafe {
            self.at_nodes.append(traversal, child.is_node());
            self.at_leaves
                .append(traversal, !child.is_node() & (child != END));
            self.at_end.append(traversal, child == END);
        }
    }

    #[inline(always)]
    unsafe fn visit_nodes(&mut self) {
        // SAFETY: the references of the layout are sound, and its stacks large enough.
        unsafe {
            let count = self.at_nodes.count;
            self.at_nodes.count = 0;
            for i in 0..count {
                let traversal = &mut *self.at_nodes.get(i);
                let node = &*self
                    .wide
                    .nodes
                    .as_ptr()
                    .add(traversal.child.index());
                let (entry, mask) = boxes::<K>(node, &traversal.ray, traversal.t);
                if A::ANY {
                    K::compress(node, mask, traversal.top);
                } else {
                    K::sort(node, entry, mask, traversal.top);
                }
                traversal.top = traversal.top.add(mask.count_ones() as usize);
                traversal.pop::<K>(self.wide);
                self.enlist(traversal);
            }
        }
    }

    #[inline(always)]
    unsafe fn visit_leaves(&mut self) {
        let blocks = self.wide.blocks.as_ptr();
        // SAFETY: as for nodes; a block that is not its leaf's last is followed by another.
        unsafe {
            let count = self.at_leaves.count;
            self.at_leaves.count = 0;
            let quarters = K::Rays::N / 4;
            let mut hopeful = List::EMPTY;
            for i in (0..count).step_by(quarters) {
                let at = |k: usize| self.at_leaves.get((i + k).min(count - 1));
                let four = [at(0), at(1), at(2), at(3)];
                let pairs = Prepared::pairs::<K::Rays>(rays_of(four));
                let found = pairs.candidates(&corners(four, blocks));
                for (k, &traversal) in four.iter().enumerate().take(quarters) {
                    hopeful.append(traversal, (found >> (4 * k) & 0b1111 != 0) & (i + k < count));
                }
            }
            for i in (0..hopeful.count).step_by(quarters) {
                let at = |k: usize| hopeful.get((i + k).min(hopeful.count - 1));
                let four = [at(0), at(1), at(2), at(3)];
                decide::<K::Rays>(four, blocks);
                if !A::ANY {
                    for &traversal in four.iter().take(quarters) {
                        let traversal = &mut *traversal;
                        let base = traversal.stack.0.as_mut_ptr().cast::<Pending>();
                        traversal.top = K::drop_farther(base, traversal.top, traversal.t);
                    }
                }
            }
            for i in 0..count {
                let traversal = &mut *self.at_leaves.get(i);
                let block = traversal.child.index();
                *traversal.top = u64::from(Child::leaf(block as u32 + 1).bits());
                traversal.top = traversal
                    .top
                    .add(usize::from(!(*blocks.add(block)).is_last()));
                if A::ANY {
                    let bottom = traversal
                        .stack
                        .0
                        .as_mut_ptr()
                        .cast::<Pending>()
                        .add(1);
                    traversal.top =
                        if traversal.object == u32::MAX { traversal.top } else { bottom };
                }
                traversal.pop::<K>(self.wide);
                self.enlist(traversal);
            }
        }
    }

    /// Writes the answers of rays at their end, and starts others in their place.
    #[inline(always)]
    unsafe fn finish(&mut self, first: usize) {
        // SAFETY: the caller's promises.
        unsafe {
            let count = self.at_end.count;
            self.at_end.count = 0;
            for i in 0..count {
                let traversal = self.at_end.get(i);
                let Traversal { ray, t, object, .. } = &*traversal;
                self.answers
                    .write(first + ray.number as usize, *t, *object);
                self.start(first, traversal);
            }
        }
    }
}

/// The eight boxes of a node: the distances at which the ray enters them, and a bit for each box entered before `t_max`.
#[inline(always)]
pub(super) unsafe fn boxes<K: Instructions>(
    node: &WideNode,
    ray: &Prepared,
    t_max: f32,
) -> (K::Boxes, u32) {
    // SAFETY: the caller's promises; loads are of whole, aligned planes, which the ray names.
    unsafe {
        let distance = |plane: u32, scale: f32, shift: f32| {
            let plane = node
                .planes
                .as_ptr()
                .cast::<u8>()
                .add(plane as usize)
                .cast();
            K::Boxes::load(plane).mul_add(K::Boxes::splat(scale), K::Boxes::splat(shift))
        };
        let near = |axis: usize| distance(ray.near[axis], ray.scale[axis], ray.near_shift[axis]);
        let far = |axis: usize| distance(ray.far[axis], ray.scale[axis], ray.far_shift[axis]);
        let entry = near(0)
            .max(near(1))
            .max(near(2).max(K::Boxes::splat(ray.t_min)));
        // Of a NaN and a number the second: unused lanes stay NaN.
        let exit = K::Boxes::splat(t_max).min(far(0).min(far(1)).min(far(2)));
        (entry, K::entered(entry, exit))
    }
}

#[inline(always)]
unsafe fn rays_of<'a>(four: [*mut Traversal; 4]) -> [&'a Prepared; 4] {
    // SAFETY: the caller's promise.
    unsafe { [&(*four[0]).ray, &(*four[1]).ray, &(*four[2]).ray, &(*four[3]).ray] }
}

/// The corners of the block at which each ray is, along the axes of its shear.
#[inline(always)]
unsafe fn corners<L: Lanes>(
    four: [*mut Traversal; 4],
    blocks: *const TriangleBlock,
) -> [[L; 3]; 3] {
    // SAFETY: the caller's promises; axes are below 3.
    unsafe {
        let lanes = |i: usize, corner: usize, axis: usize| {
            let traversal = &*four[i];
            let axis = AXES[traversal.ray.largest_axis as usize % 3][axis];
            let block = blocks.wrapping_add(traversal.child.index());
            block
                .cast::<f32>()
                .wrapping_add((3 * corner + axis) * TriangleBlock::LANES)
        };
        let of = |corner: usize, axis: usize| {
            L::load_quarters([
                lanes(0, corner, axis),
                lanes(1, corner, axis),
                lanes(2, corner, axis),
                lanes(3, corner, axis),
            ])
        };
        [
            [of(0, 0), of(0, 1), of(0, 2)],
            [of(1, 0), of(1, 1), of(1, 2)],
            [of(2, 0), of(2, 1), of(2, 2)],
        ]
    }
}

/// Gives every ray the nearest hit among those it has and those in the block at which it is, by
/// [`Hit::precedes`](crate::Hit::precedes) and without a branch.
#[inline(always)]
unsafe fn decide<L: Lanes>(four: [*mut Traversal; 4], blocks: *const TriangleBlock) {
    // SAFETY: the caller's promises; ids are four aligned lanes, and so are a traversal's distance and what follows it.
    unsafe {
        let row = |i: usize| (&raw const (*four[i]).t);
        let before = L::load_quarters([row(0), row(1), row(2), row(3)]);
        let t_max = before.spread::<0>();
        let (inside, t) = Prepared::pairs::<L>(rays_of(four)).decide(&corners(four, blocks), t_max);
        let ids = |i: usize| {
            (*blocks.wrapping_add((*four[i]).child.index()))
                .ids()
                .cast()
        };
        let ids = L::load_quarters([ids(0), ids(1), ids(2), ids(3)])
            & L::splat_bits(!TriangleBlock::LAST);
        let none = L::splat_bits(u32::MAX);
        let t = L::select(inside, t, t_max);
        let least = t.min(t.swap_twos());
        let least = least.min(least.swap_ones());
        let ids = L::select(inside & t.eq(least), ids, none);
        let own = L::select(t_max.eq(least), before.spread::<1>(), none);
        let ids = lower(ids, own);
        let ids = lower(ids, ids.swap_twos());
        let ids = lower(ids, ids.swap_ones());
        let mut distances = [0.0; 16];
        let mut objects = [0.0; 16];
        least.store(distances.as_mut_ptr());
        ids.store(objects.as_mut_ptr());
        for (i, &traversal) in four.iter().enumerate().take(L::N / 4) {
            (*traversal).t = distances[4 * i];
            (*traversal).object = f32::to_bits(objects[4 * i]);
        }
    }
}

/// The lower of two ids.
#[inline(always)]
fn lower<L: Lanes>(a: L, b: L) -> L {
    L::select(a.below(b), a, b)
}
