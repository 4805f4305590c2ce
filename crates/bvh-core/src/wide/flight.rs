//! Batches of incoherent rays, with many rays in flight: a step of each in turn.
//!
//! One ray alone waits: for the next node to come from memory, for one box test to end before the
//! next can begin, for the processor to recover from branches that nobody can predict. Steps of
//! different rays do not depend on each other. While one ray waits, the processor does the step of
//! the next:
//!
//! ```text
//!            ┌─> at a node: boxes ────────────────────────────┐
//!  in flight ┼─> at a leaf: candidates ─> exact decisions ────┼─> pop, fetch what comes next ─> in flight
//!            └─> at the end: write the answer, start another ─┘
//! ```
//!
//! No branch depends on one ray: its next step decides the list that it is appended to, and the
//! order of hits and the children behind them are found without branches, too.

use super::all_hits::Decided;
use super::answer::Find;
use super::instructions::{Instructions, Pending, Task};
use super::kernel::{DeepStacks, SPARE, STACK};
use super::lanes::Lanes;
use super::layout::{Child, WideBvh, WideNode};
use super::pairs::Plane;
use super::prepared::{Prepared, Ready, Test};
use super::ray_lanes::{RayLanes, prefetch};
use super::triangles::TriangleBlock;
use crate::Ray;
use core::marker::PhantomData;
use core::mem::MaybeUninit;
use core::ops::Range;

/// The number of rays in flight.
const FLIGHT: usize = 48;

/// The maximum number of rays that are prepared at once.
const RAYS: usize = 16;

/// Answers the rays of these numbers.
#[inline(always)]
pub(crate) unsafe fn trace<K: Instructions, F: Find>(
    wide: &WideBvh,
    rays: &[Ray],
    numbers: Range<usize>,
    find: &mut F,
) {
    const { assert!(K::Rays::N <= RAYS) };
    // No triangle has an area. The flight below expects that every ray visits something.
    if wide.root.is_none() {
        for number in numbers {
            find.write(number, f32::INFINITY, u32::MAX);
        }
        return;
    }
    let flight = Flight::<K, F> {
        wide,
        rays,
        find,
        from: numbers.start,
        end: numbers.end,
        ready: [MaybeUninit::uninit(); RAYS],
        waiting: 0,
        counts: Counts { at_nodes: 0, at_leaves: 0, at_end: 0 },
        at_nodes: EMPTY,
        at_leaves: EMPTY,
        at_end: EMPTY,
        idle: EMPTY,
        idle_count: 0,
        instructions: PhantomData,
    };
    // SAFETY: the processor has the instructions.
    unsafe { K::call(flight) };
}

/// Rays that wait for the same step.
type List = [*mut Traversal; FLIGHT];

const EMPTY: List = [core::ptr::null_mut(); FLIGHT];

/// How many rays wait for each step. A loop that appends rays has a copy, which stays in registers.
#[derive(Clone, Copy)]
struct Counts {
    at_nodes: usize,
    at_leaves: usize,
    at_end: usize,
}

/// Appends a ray to a list if it `belongs` there, without a branch. While a list is gone through it
/// may be filled again from its beginning.
#[inline(always)]
unsafe fn append(list: &mut List, count: &mut usize, traversal: *mut Traversal, belongs: bool) {
    // SAFETY: a list is never full when a ray is not in it.
    unsafe { *list.get_unchecked_mut(*count) = traversal };
    *count += usize::from(belongs);
}

/// The rays of a batch that are in flight, that are prepared, and that are neither.
struct Flight<'a, K, F> {
    /// The layout at whose root rays start.
    wide: &'a WideBvh,
    rays: &'a [Ray],
    find: &'a mut F,
    /// The numbers of the rays that have not been prepared.
    from: usize,
    end: usize,
    /// The last that have been, and a bit for each that has not been started.
    ready: [MaybeUninit<Prepared>; RAYS],
    waiting: u32,
    counts: Counts,
    at_nodes: List,
    at_leaves: List,
    at_end: List,
    /// The places of rays whose answers are written.
    idle: List,
    idle_count: usize,
    instructions: PhantomData<K>,
}

impl<K: Instructions, F: Find> Task<K> for Flight<'_, K, F> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(mut self) {
        let mut traversals = MaybeUninit::<[Traversal; FLIGHT]>::uninit();
        let traversals = traversals.as_mut_ptr().cast::<Traversal>();
        let mut deep = DeepStacks::new(FLIGHT, self.wide.stack_need);
        // SAFETY: the processor has the instructions; there is room for so many.
        unsafe {
            for i in 0..FLIGHT {
                let traversal = traversals.add(i);
                Traversal::set_stack(traversal, deep.as_mut().map(|deep| deep.stack(i)));
                append(&mut self.idle, &mut self.idle_count, traversal, true);
            }
            loop {
                self.start_idle();
                let Counts { at_nodes, at_leaves, at_end } = self.counts;
                if at_nodes + at_leaves + at_end == 0 {
                    return;
                }
                self.visit_nodes();
                let Counts { at_nodes, at_leaves, .. } = self.counts;
                let leaves_wait = at_leaves >= FLIGHT / 2 || at_nodes == 0;
                if leaves_wait {
                    self.visit_leaves();
                    self.finish();
                }
            }
        }
    }
}

impl<K: Instructions, F: Find> Flight<'_, K, F> {
    /// Starts the next rays in the idle places, as far as there are rays.
    #[inline(always)]
    unsafe fn start_idle(&mut self) {
        let count = core::mem::replace(&mut self.idle_count, 0);
        for i in 0..count {
            while self.waiting == 0 {
                if self.from == self.end {
                    return;
                }
                // SAFETY: the processor has the instructions.
                unsafe { self.prepare() };
            }
            let next = self.waiting.trailing_zeros() as usize;
            self.waiting &= self.waiting - 1;
            // SAFETY: so many places are idle; `ready` is written where `waiting` had a bit.
            unsafe {
                let traversal = &mut **self.idle.get_unchecked(i);
                let ray = self.ready.get_unchecked(next).assume_init_ref();
                traversal.start::<K>(ray, self.wide);
                let mut counts = self.counts;
                self.enlist(traversal, traversal.child, &mut counts);
                self.counts = counts;
            }
        }
    }

    /// Prepares the next rays, and answers those that miss the box around everything.
    #[inline(always)]
    unsafe fn prepare(&mut self) {
        let from = self.from;
        let count = (self.end - from).min(K::Rays::N);
        self.from += count;
        let there = u32::MAX >> (32 - count);
        let rays = self.rays;
        // SAFETY: the processor has the instructions; `ready` has room for sixteen.
        unsafe {
            prefetch::<K>(rays, self.from + K::Rays::N);
            let ready =
                Ready::new(RayLanes::<K::Rays>::load_up_to(rays, from, self.end), self.wide);
            self.waiting = there & ready.enter(&self.wide.bounds);
            if self.waiting != 0 {
                ready.write(from as u32, self.ready.as_mut_ptr().cast());
            }
        }
        let mut others = there & !self.waiting;
        while others != 0 {
            let lane = others.trailing_zeros();
            let number = from + lane as usize;
            others &= others - 1;
            self.find.write(number, f32::INFINITY, u32::MAX);
        }
    }

    /// Puts a ray where its next visit is.
    #[inline(always)]
    unsafe fn enlist(&mut self, traversal: *mut Traversal, child: Child, counts: &mut Counts) {
        // SAFETY: every list has a place for every traversal.
        unsafe {
            append(&mut self.at_nodes, &mut counts.at_nodes, traversal, child.is_node());
            let is_at_end = child == Child::END;
            let is_at_leaf = !child.is_node() & !is_at_end;
            append(&mut self.at_leaves, &mut counts.at_leaves, traversal, is_at_leaf);
            append(&mut self.at_end, &mut counts.at_end, traversal, is_at_end);
        }
    }

    /// Visits the nodes at which rays are, in three passes. A pass over many rays has short chains
    /// of dependent operations, so that the processor works on several rays at once; the whole
    /// visit of one ray fills half of its window of instructions.
    #[inline(always)]
    unsafe fn visit_nodes(&mut self) {
        let wide = self.wide;
        let mut counts = self.counts;
        let count = core::mem::replace(&mut counts.at_nodes, 0);
        let mut entries = [const { MaybeUninit::<K::Boxes>::uninit() }; FLIGHT];
        let mut masks = [0; FLIGHT];
        // SAFETY: there are at most `FLIGHT` rays; the references of the layout are sound, and its
        // stacks large enough.
        unsafe {
            for i in 0..count {
                let traversal = &**self.at_nodes.get_unchecked(i);
                let node = traversal.node(wide);
                let (entry, mask) = traversal.ray.boxes::<K>(node, traversal.t);
                entries.get_unchecked_mut(i).write(entry);
                *masks.get_unchecked_mut(i) = mask;
            }
            for i in 0..count {
                let traversal = &mut **self.at_nodes.get_unchecked(i);
                let node = traversal.node(wide);
                let mask = *masks.get_unchecked(i);
                if F::ANY || F::ALL {
                    K::compress(node, mask, traversal.top);
                } else {
                    K::sort(node, entries.get_unchecked(i).assume_init(), mask, traversal.top);
                }
                traversal.top = traversal.top.add(mask.count_ones() as usize).sub(1);
            }
            // Only now, when what was pushed has reached the cache: a load would wait for the
            // stores, which are wider.
            for i in 0..count {
                let traversal = &mut **self.at_nodes.get_unchecked(i);
                let child = traversal.go_on::<K>(wide);
                self.enlist(traversal, child, &mut counts);
            }
        }
        self.counts = counts;
    }

    #[inline(always)]
    unsafe fn visit_leaves(&mut self) {
        // SAFETY: as for nodes; a block that is not its leaf's last is followed by another.
        unsafe {
            let wide = self.wide;
            let mut counts = self.counts;
            let count = core::mem::replace(&mut counts.at_leaves, 0);
            let quarters = K::Rays::N / 4;
            let mut hopeful = EMPTY;
            let mut hopeful_count = 0;
            for i in (0..count).step_by(quarters) {
                let at = |k: usize| *self.at_leaves.get_unchecked((i + k).min(count - 1));
                let four = [at(0), at(1), at(2), at(3)];
                let (possible, sure) = candidates::<K::Rays>(wide, four);
                for (k, &traversal) in four.iter().enumerate().take(quarters) {
                    let has = |pairs: u32| pairs >> (4 * k) & 0b1111 != 0;
                    let is_hit = F::ANY && has(sure);
                    if F::ANY {
                        let object = (*traversal).object;
                        (*traversal).object = if is_hit { 0 } else { object };
                    }
                    let is_hopeful = has(possible) & !is_hit & (i + k < count);
                    append(&mut hopeful, &mut hopeful_count, traversal, is_hopeful);
                }
            }
            for i in (0..hopeful_count).step_by(quarters) {
                let at = |k: usize| *hopeful.get_unchecked((i + k).min(hopeful_count - 1));
                let four = [at(0), at(1), at(2), at(3)];
                if F::ALL {
                    // A traversal that only fills the lanes must not show its hits twice.
                    self.append_hits(four, quarters.min(hopeful_count - i));
                } else {
                    decide::<K::Rays>(wide, four);
                }
                if !F::ANY && !F::ALL {
                    for &traversal in four.iter().take(quarters) {
                        (*traversal).drop_farther::<K>();
                    }
                }
            }
            for i in 0..count {
                let traversal = &mut **self.at_leaves.get_unchecked(i);
                traversal.leave_block(wide, F::ANY);
                let child = traversal.go_on::<K>(wide);
                self.enlist(traversal, child, &mut counts);
            }
            self.counts = counts;
        }
    }

    /// Appends all hits of the first `count` rays in the blocks at which they are.
    #[inline(always)]
    unsafe fn append_hits(&mut self, four: [*mut Traversal; 4], count: usize) {
        // SAFETY: the processor has the instructions; the rays are at blocks.
        unsafe {
            let tests = tests(self.wide, four);
            let rays = Test::rays::<K::Rays>(tests);
            let corners = Test::corners(tests);
            let plane = Plane::of_lanes(&corners);
            let candidates = rays.candidates(&corners);
            let decided = rays.decide_in_f64(&corners, &plane, &candidates, ends(four));
            let decided = Decided::new(decided);
            for (i, test) in tests.iter().enumerate().take(count) {
                let number = test.ray.number as usize;
                let ray = &self.rays[number];
                decided.hits_of(i, test.block, ray, |hit| self.find.append(number, hit));
            }
        }
    }

    /// Writes the answers of rays at their end.
    #[inline(always)]
    unsafe fn finish(&mut self) {
        let count = core::mem::replace(&mut self.counts.at_end, 0);
        for i in 0..count {
            // SAFETY: so many rays are at their end, and their places become idle.
            unsafe {
                let traversal = *self.at_end.get_unchecked(i);
                let Traversal { ray, t, object, .. } = &*traversal;
                self.find.write(ray.number as usize, *t, *object);
                append(&mut self.idle, &mut self.idle_count, traversal, true);
            }
        }
    }
}

/// The traversal of the layout by one ray.
#[repr(C, align(64))]
struct Traversal {
    ray: Prepared,
    /// The nearest hit so far, or the end of the ray and `u32::MAX`.
    t: f32,
    object: u32,
    top: *mut Pending,
    /// The node or the block of triangles to visit next, or [`END`](Child::END).
    child: Child,
    /// [`END`](Child::END), the children that wait, the next block of the same leaf, and room for
    /// stores of whole registers: `frame`, or on the heap.
    stack: *mut Pending,
    frame: Frame,
}

#[repr(C, align(64))]
struct Frame([MaybeUninit<Pending>; STACK + SPARE]);

/// # Safety
///
/// All functions: the processor has the instructions of `K`, the traversal was started, and the
/// references of the layout are sound, so that the stack has room for what a visit pushes.
impl Traversal {
    /// Chooses the stack of all rays that are started here: on the heap, or in the frame.
    #[inline(always)]
    unsafe fn set_stack(this: *mut Self, deep: Option<*mut Pending>) {
        // SAFETY: the traversal exists; its fields need not be initialised to be named.
        unsafe { (*this).stack = deep.unwrap_or((&raw mut (*this).frame).cast()) };
    }

    #[inline(always)]
    unsafe fn start<K: Instructions>(&mut self, ray: &Prepared, wide: &WideBvh) {
        self.t = ray.t_max;
        self.object = u32::MAX;
        // SAFETY: the processor has the instructions of `K`.
        unsafe { self.ray.copy::<K::Block>(ray) };
        self.child = wide.root.unwrap_or(Child::END);
        // SAFETY: the stack has more than one place.
        unsafe {
            self.stack.write(u64::from(Child::END.bits()));
            self.top = self.stack.add(1);
        }
    }

    /// Goes on to the child at the top of the stack, and fetches it.
    #[inline(always)]
    unsafe fn go_on<K: Instructions>(&mut self, wide: &WideBvh) -> Child {
        // SAFETY: the top of the stack holds at least an end; a prefetch may name any address.
        unsafe {
            self.child = Child::from_bits(*self.top as u32);
            K::prefetch_bytes(wide.place(self.child), size_of::<WideNode>());
            self.child
        }
    }

    #[inline(always)]
    unsafe fn node<'a>(&self, wide: &'a WideBvh) -> &'a WideNode {
        // SAFETY: references are sound.
        unsafe { &*wide.nodes.as_ptr().add(self.child.index()) }
    }

    /// Takes the children behind the nearest hit from the stack.
    #[inline(always)]
    unsafe fn drop_farther<K: Instructions>(&mut self) {
        // SAFETY: the stack is between its bottom and its top.
        self.top = unsafe { K::drop_farther(self.stack, self.top, self.t) };
    }

    /// Leaves a block of triangles, so that the top of the stack holds the next one of the leaf, or
    /// what waits, or the end if any hit will do and there is one.
    #[inline(always)]
    unsafe fn leave_block(&mut self, wide: &WideBvh, ends_at_hit: bool) {
        // SAFETY: a block that is not its leaf's last is followed by another; the stack holds at
        // least an end, and has room for one more.
        unsafe {
            let block = self.child.index();
            let is_last = (*wide.blocks.as_ptr().add(block)).is_last();
            *self.top = u64::from(Child::leaf(block as u32 + 1).bits());
            self.top = self.top.add(usize::from(!is_last));
            if ends_at_hit && self.object != u32::MAX {
                self.top = self.stack.add(1);
            }
            self.top = self.top.sub(1);
        }
    }
}

/// Returns the tests of the blocks at which rays are.
#[inline(always)]
unsafe fn tests(wide: &WideBvh, four: [*mut Traversal; 4]) -> [Test<'_>; 4] {
    // SAFETY: the rays are at blocks.
    unsafe {
        let test = |i: usize| Test {
            ray: &(*four[i]).ray,
            block: &*wide.blocks.as_ptr().add((*four[i]).child.index()),
        };
        [test(0), test(1), test(2), test(3)]
    }
}

/// Returns a bit for each triangle that its ray may hit, of the block at which each ray is, and a
/// bit for each that it certainly hits: four bits per ray.
#[inline(always)]
unsafe fn candidates<L: Lanes>(wide: &WideBvh, four: [*mut Traversal; 4]) -> (u32, u32) {
    // SAFETY: the processor has the instructions; the rays are at blocks.
    unsafe {
        let tests = tests(wide, four);
        let rays = Test::rays::<L>(tests);
        rays.within(&rays.candidates(&Test::corners(tests)), ends(four))
    }
}

/// Returns the distances and the objects of the nearest hits so far, in the first two lanes of each
/// quarter.
#[inline(always)]
unsafe fn nearest<L: Lanes>(four: [*mut Traversal; 4]) -> L {
    // SAFETY: the processor has the instructions; the fields of a traversal from its distance on
    // are four aligned lanes.
    unsafe {
        let row = |i: usize| (&raw const (*four[i]).t);
        L::load_quarters([row(0), row(1), row(2), row(3)])
    }
}

/// Returns the distances beyond which hits do not count.
#[inline(always)]
unsafe fn ends<L: Lanes>(four: [*mut Traversal; 4]) -> L {
    // SAFETY: the processor has the instructions.
    unsafe { nearest::<L>(four).spread::<0>() }
}

/// Gives every ray the nearest hit among the hit it has and those in the block at which it is, by
/// [`Hit::precedes`](crate::Hit::precedes) and without a branch.
#[inline(always)]
unsafe fn decide<L: Lanes>(wide: &WideBvh, four: [*mut Traversal; 4]) {
    // SAFETY: the processor has the instructions; ids are four aligned lanes.
    unsafe {
        let before = nearest::<L>(four);
        let t_max = before.spread::<0>();
        let tests = tests(wide, four);
        let corners = Test::corners::<L>(tests);
        let (inside, t) = Test::rays::<L>(tests).decide_alone(&corners, t_max);
        let ids = |i: usize| tests[i].block.ids().cast();
        let ids = L::load_quarters([ids(0), ids(1), ids(2), ids(3)])
            & t.filled_with_bits(!TriangleBlock::LAST);
        let none = t.filled_with_bits(u32::MAX);
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

#[inline(always)]
fn lower<L: Lanes>(a: L, b: L) -> L {
    L::select(a.below(b), a, b)
}
