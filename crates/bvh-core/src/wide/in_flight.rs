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

use super::answer::Batch;
use super::instructions::{Instructions, Part};
use super::kernel::DeepStacks;
use super::lanes::Lanes;
use super::layout::WideBvh;
use super::node::Child;
use super::prepared::{Prepared, Ready};
use super::ray_lanes::{RayLanes, prefetch};
use super::traversal::{self, Traversal};
use core::marker::PhantomData;
use core::mem::MaybeUninit;
use core::ops::Range;

/// The maximum number of rays in flight.
const FLIGHT: usize = 32;

/// The maximum number of rays that are prepared at once.
const RAYS: usize = 16;

/// The maximum number of rays of a batch that are numbered together.
const MOST: usize = 1 << 31;

/// Answers the rays of these numbers.
///
/// # Safety
/// As for [`batch::trace`](super::batch::trace).
#[inline(always)]
pub(crate) unsafe fn trace<K: Instructions, const ANY: bool>(
    wide: &WideBvh,
    batch: &mut Batch,
    numbers: Range<usize>,
) {
    const { assert!(K::FLIGHT <= FLIGHT && K::Rays::N <= RAYS) };
    // No triangle has an area. The flight below expects that every ray visits something.
    if wide.root.is_none() {
        for number in numbers {
            batch.answers.write(number, f32::INFINITY, u32::MAX);
        }
        return;
    }
    // SAFETY: the caller's promises.
    unsafe { K::call(Trace::<K, ANY>::new(wide, batch, numbers)) };
}

/// A flight of all rays up to the last number.
struct Trace<'a, 'b, K, const ANY: bool> {
    flight: Flight<'a, 'b, K, ANY>,
    last: usize,
}

impl<'a, 'b, K, const ANY: bool> Trace<'a, 'b, K, ANY> {
    #[inline(always)]
    fn new(wide: &'a WideBvh, batch: &'a mut Batch<'b>, numbers: Range<usize>) -> Self {
        let flight = Flight {
            wide,
            batch,
            from: numbers.start,
            end: numbers.start,
            ready: [MaybeUninit::uninit(); RAYS],
            waiting: 0,
            at_nodes: List::EMPTY,
            at_leaves: List::EMPTY,
            at_end: List::EMPTY,
            idle: List::EMPTY,
            instructions: PhantomData,
        };
        Self { flight, last: numbers.end }
    }
}

impl<K: Instructions, const ANY: bool> Part for Trace<'_, '_, K, ANY> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { mut flight, last } = self;
        let mut traversals = MaybeUninit::<[Traversal; FLIGHT]>::uninit();
        let traversals = traversals.as_mut_ptr().cast::<Traversal>();
        let mut deep = DeepStacks::new(FLIGHT, flight.wide.stack_need);
        for i in 0..FLIGHT {
            // SAFETY: there is room for so many.
            unsafe {
                Traversal::set_stack(traversals.add(i), deep.as_mut().map(|deep| deep.stack(i)));
            }
        }
        // Rays are numbered by 32 bits.
        while flight.end < last {
            flight.from = flight.end;
            flight.end = last.min(flight.from + MOST);
            // SAFETY: the caller's promises.
            unsafe { flight.trace(traversals) };
        }
    }
}

/// Rays that wait for the same step.
struct List {
    rays: [*mut Traversal; FLIGHT],
    count: usize,
}

impl List {
    const EMPTY: Self = Self { rays: [core::ptr::null_mut(); FLIGHT], count: 0 };

    /// Appends a ray if it `belongs` here, without a branch. While a list is gone through it may be
    /// filled again from its beginning.
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

/// The rays of a batch that are in flight, that are prepared, and that are neither.
struct Flight<'a, 'b, K, const ANY: bool> {
    /// The layout at whose root rays start.
    wide: &'a WideBvh,
    batch: &'a mut Batch<'b>,
    /// The numbers of the rays that have not been prepared.
    from: usize,
    end: usize,
    /// The last that have been, and a bit for each that has not been started.
    ready: [MaybeUninit<Prepared>; RAYS],
    waiting: u32,
    at_nodes: List,
    at_leaves: List,
    at_end: List,
    /// The places of rays whose answers are written.
    idle: List,
    instructions: PhantomData<K>,
}

impl<K: Instructions, const ANY: bool> Flight<'_, '_, K, ANY> {
    /// Traces all rays.
    #[inline(always)]
    unsafe fn trace(&mut self, traversals: *mut Traversal) {
        // SAFETY: the caller's promises; there is room for so many.
        unsafe {
            let first = self.from;
            for i in 0..K::FLIGHT {
                self.idle.append(traversals.add(i), true);
            }
            loop {
                self.start_idle(first);
                if self.at_nodes.count + self.at_leaves.count + self.at_end.count == 0 {
                    return;
                }
                self.visit_nodes();
                let leaves_wait = self.at_leaves.count >= K::FLIGHT / 2 || self.at_nodes.count == 0;
                if leaves_wait {
                    self.visit_leaves(first);
                    self.finish(first);
                }
            }
        }
    }

    /// Starts the next rays in the idle places, as far as there are rays; number 0 is ray number
    /// `first` of its batch.
    #[inline(always)]
    unsafe fn start_idle(&mut self, first: usize) {
        let count = core::mem::replace(&mut self.idle.count, 0);
        for i in 0..count {
            while self.waiting == 0 {
                if self.from == self.end {
                    return;
                }
                // SAFETY: the caller's promises.
                unsafe { self.prepare(first) };
            }
            let next = self.waiting.trailing_zeros() as usize;
            self.waiting &= self.waiting - 1;
            // SAFETY: so many places are idle; `ready` is written where `waiting` had a bit.
            unsafe {
                let traversal = &mut *self.idle.get(i);
                let ray = self.ready.get_unchecked(next).assume_init();
                traversal.start(ray, self.wide);
                self.enlist(traversal);
            }
        }
    }

    /// Prepares the next rays, and answers those that miss the box around everything.
    #[inline(always)]
    unsafe fn prepare(&mut self, first: usize) {
        let from = self.from;
        let count = (self.end - from).min(K::Rays::N);
        self.from += count;
        let there = u32::MAX >> (32 - count);
        let rays = self.batch.rays;
        // SAFETY: the caller's promises; `ready` has room for sixteen.
        unsafe {
            prefetch::<K>(rays, self.from + K::Rays::N);
            let ready =
                Ready::new(RayLanes::<K::Rays>::load_up_to(rays, from, self.end), self.wide);
            self.waiting = there & ready.enter(&self.wide.bounds);
            if self.waiting != 0 {
                ready.write((from - first) as u32, self.ready.as_mut_ptr().cast());
            }
        }
        let mut others = there & !self.waiting;
        while others != 0 {
            let lane = others.trailing_zeros();
            let number = from + lane as usize;
            others &= others - 1;
            self.batch.answers.write(number, f32::INFINITY, u32::MAX);
        }
    }

    /// Puts a ray where its next visit is.
    #[inline(always)]
    unsafe fn enlist(&mut self, traversal: &mut Traversal) {
        let child = traversal.child;
        // SAFETY: every list has a place for every traversal.
        unsafe {
            self.at_nodes.append(traversal, child.is_node());
            let is_at_end = child == Child::END;
            self.at_leaves.append(traversal, !child.is_node() & !is_at_end);
            self.at_end.append(traversal, is_at_end);
        }
    }

    /// Visits the nodes at which rays are, in three passes. A pass over many rays has short chains
    /// of dependent operations, so that the processor works on several rays at once; the whole
    /// visit of one ray fills half of its window of instructions.
    #[inline(always)]
    unsafe fn visit_nodes(&mut self) {
        let count = self.at_nodes.count;
        let mut entries = [const { MaybeUninit::<K::Boxes>::uninit() }; FLIGHT];
        let mut masks = [0; FLIGHT];
        // SAFETY: there are at most `FLIGHT` rays; the references of the layout are sound, and its
        // stacks large enough.
        unsafe {
            for i in 0..count {
                let traversal = &*self.at_nodes.get(i);
                let node = &*traversal.nodes.add(traversal.child.index());
                let (entry, mask) = traversal.ray.boxes::<K>(node, traversal.t);
                entries.get_unchecked_mut(i).write(entry);
                *masks.get_unchecked_mut(i) = mask;
            }
            for i in 0..count {
                let traversal = &mut *self.at_nodes.get(i);
                let node = &*traversal.nodes.add(traversal.child.index());
                let entry = entries.get_unchecked(i).assume_init();
                traversal.enter::<K, ANY>(node, entry, *masks.get_unchecked(i));
            }
            self.at_nodes.count = 0;
            for i in 0..count {
                let traversal = &mut *self.at_nodes.get(i);
                traversal.fetch::<K>();
                self.enlist(traversal);
            }
        }
    }

    #[inline(always)]
    unsafe fn visit_leaves(&mut self, first: usize) {
        // SAFETY: as for nodes; a block that is not its leaf's last is followed by another.
        unsafe {
            let count = self.at_leaves.count;
            self.at_leaves.count = 0;
            let quarters = K::Rays::N / 4;
            let mut hopeful = List::EMPTY;
            for i in (0..count).step_by(quarters) {
                let at = |k: usize| self.at_leaves.get((i + k).min(count - 1));
                let four = [at(0), at(1), at(2), at(3)];
                let found = traversal::candidates::<K::Rays>(four);
                for (k, &traversal) in four.iter().enumerate().take(quarters) {
                    hopeful.append(traversal, (found >> (4 * k) & 0b1111 != 0) & (i + k < count));
                }
            }
            for i in (0..hopeful.count).step_by(quarters) {
                let at = |k: usize| hopeful.get((i + k).min(hopeful.count - 1));
                let four = [at(0), at(1), at(2), at(3)];
                if let Some(accept) = &mut self.batch.accept {
                    // A traversal that only fills the lanes must not show its hits twice.
                    let rays = &four[..quarters.min(hopeful.count - i)];
                    traversal::decide_accepted::<K::Rays>(rays, first, accept);
                } else {
                    traversal::decide::<K::Rays>(four);
                }
                if !ANY {
                    for &traversal in four.iter().take(quarters) {
                        (*traversal).drop_farther::<K>();
                    }
                }
            }
            for i in 0..count {
                let traversal = &mut *self.at_leaves.get(i);
                traversal.leave_block::<ANY>();
                traversal.fetch::<K>();
                self.enlist(traversal);
            }
        }
    }

    /// Writes the answers of rays at their end.
    #[inline(always)]
    unsafe fn finish(&mut self, first: usize) {
        let count = core::mem::replace(&mut self.at_end.count, 0);
        for i in 0..count {
            // SAFETY: so many rays are at their end, and their places become idle.
            unsafe {
                let traversal = self.at_end.get(i);
                let Traversal { ray, t, object, .. } = &*traversal;
                self.batch.answers.write(first + ray.number as usize, *t, *object);
                self.idle.append(traversal, true);
            }
        }
    }
}
