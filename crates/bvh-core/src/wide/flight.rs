//! Batches of incoherent rays, with many rays in flight: a step of each in turn.
//!
//! One ray alone waits: for the next node to come from memory, for one box test to end before the
//! next can begin, for the processor to recover from branches that nobody can predict. Steps of
//! different rays do not depend on each other. While one ray waits, the processor does the step of
//! the next:
//!
//! ```text
//!            ┌─> at a node: boxes ────────────────────────────────┐
//!  in flight ┼─> at a leaf: candidates ─> pairs, decided exactly ─┼─> pop, fetch what comes next ─> in flight
//!            └─> at the end: write the answer, start another ─────┘
//! ```
//!
//! Hardly a branch depends on one ray: its next step decides the list that it is appended to, and
//! the order of children and those behind a hit are found without branches, too. A ray is at the
//! end when its stack is empty, which is seen with the leaves.

use super::answer::{Bounded, Find};
use super::gathered::Gathered;
use super::instructions::{Instructions, Pending, Task};
use super::kernel::{LINE, SPARE, STACK, deep_stacks};
use super::lanes::{Aligned, Lanes};
use super::layout::{Child, Places, WideBvh, WideNode};
use super::pairs::Crossings;
use super::prepared::{Prepared, Ready, Test};
use super::ray_lanes::Rays;
use super::triangles::TriangleBlock;
use crate::Hit;
use crate::each::Each;
use bytemuck::Zeroable;
use core::marker::PhantomData;
use core::mem::MaybeUninit;
use core::ops::Range;

const FLIGHT: usize = 48;

/// The maximum number of rays that are prepared at once.
const RAYS: usize = 16;

#[inline(always)]
pub(crate) unsafe fn trace<K: Instructions, F: Find>(
    wide: &WideBvh,
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
        find,
        from: numbers.start,
        end: numbers.end,
        gathered: Gathered::EMPTY,
        counts: Counts { at_nodes: 0, at_leaves: 0 },
        at_nodes: EMPTY,
        at_leaves: EMPTY,
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
}

/// Appends a ray to a list if it `belongs` there, without a branch. While a list is gone through it
/// may be filled again from its beginning.
#[inline(always)]
unsafe fn append(list: &mut List, count: &mut usize, traversal: *mut Traversal, belongs: bool) {
    // SAFETY: a list is never full when a ray is not in it.
    unsafe { *list.get_unchecked_mut(*count) = traversal };
    *count += usize::from(belongs);
}

/// The rays of a batch that are in flight, and that are not yet.
struct Flight<'a, K, F> {
    /// The layout at whose root rays start.
    wide: &'a WideBvh,
    find: &'a mut F,
    /// The numbers of the rays that have not been prepared.
    from: usize,
    end: usize,
    gathered: Gathered,
    counts: Counts,
    at_nodes: List,
    /// Rays at leaves and at their end.
    at_leaves: List,
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
        let need = self.wide.stack_need;
        let mut stacks = MaybeUninit::<Aligned<[Pending; FLIGHT * (STACK + SPARE)]>>::uninit();
        let mut deep = deep_stacks::<Pending>(FLIGHT, need);
        let stacks: *mut Pending =
            deep.as_mut().map_or(stacks.as_mut_ptr().cast(), |deep| deep.as_mut_ptr().cast());
        // SAFETY: the processor has the instructions; there is room for so many, since stacks that
        // are not deep fit in the frame.
        unsafe {
            for i in 0..FLIGHT {
                // The stacks are dense, so that few pages hold them.
                (*traversals.add(i)).stack = stacks.add(i * places_of_stack(need));
                append(&mut self.idle, &mut self.idle_count, traversals.add(i), true);
            }
            loop {
                self.start_idle();
                let Counts { at_nodes, at_leaves } = self.counts;
                if at_nodes + at_leaves == 0 {
                    return;
                }
                self.visit_nodes();
                let Counts { at_nodes, at_leaves } = self.counts;
                let leaves_wait = at_leaves >= FLIGHT / 2 || at_nodes == 0;
                if leaves_wait {
                    self.finish();
                    self.visit_leaves();
                }
            }
        }
    }
}

impl<K: Instructions, F: Find> Flight<'_, K, F> {
    /// Starts the next rays, a vector at a time, while there are places for them. Answers those
    /// that miss the box around everything, and by themselves those that begin far from it.
    #[inline(always)]
    unsafe fn start_idle(&mut self) {
        let wide = self.wide;
        let rays = self.find.rays();
        let root = wide.root.unwrap_or(Child::END);
        let mut counts = self.counts;
        while self.idle_count >= K::Rays::N && self.from < self.end {
            let from = self.from;
            self.from = (from + K::Rays::N).min(self.end);
            let there = u32::MAX >> (32 - (self.from - from));
            // SAFETY: the processor has the instructions; as many places as lanes are idle.
            unsafe {
                rays.prefetch::<K>(self.from + K::Rays::N);
                let lanes = rays.load_up_to::<K::Rays>(from, self.end, wide.frame());
                let ready = Ready::new(lanes, wide);
                let mut entering = there & ready.enter(wide.root_box());
                let mut others = !entering & u32::MAX >> (32 - K::Rays::N);
                self.idle_count -= K::Rays::N;
                let idle = self.idle.as_ptr().add(self.idle_count);
                let places: [_; RAYS] = core::array::from_fn(|i| *idle.add(i % K::Rays::N));
                if entering != 0 {
                    ready.write(from as u32, places.map(|traversal| &raw mut (*traversal).ray));
                }
                while entering != 0 {
                    let traversal = *places.get_unchecked(entering.trailing_zeros() as usize);
                    entering &= entering - 1;
                    (*traversal).start(root);
                    self.enlist(traversal, root, &mut counts);
                }
                while others != 0 {
                    let lane = others.trailing_zeros() as usize;
                    others &= others - 1;
                    let place = *places.get_unchecked(lane);
                    append(&mut self.idle, &mut self.idle_count, place, true);
                    let number = from + lane;
                    if number >= self.from {
                        continue;
                    }
                    if ready.far >> lane & 1 != 0 {
                        self.find.alone(wide, number);
                    } else {
                        self.find.write(number, f32::INFINITY, u32::MAX);
                    }
                }
            }
        }
        self.counts = counts;
    }

    /// Puts a ray where its next visit is.
    #[inline(always)]
    unsafe fn enlist(&mut self, traversal: *mut Traversal, child: Child, counts: &mut Counts) {
        // SAFETY: every list has a place for every traversal.
        unsafe {
            append(&mut self.at_nodes, &mut counts.at_nodes, traversal, child.is_node());
            append(&mut self.at_leaves, &mut counts.at_leaves, traversal, !child.is_node());
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
        let mut keys = [const { MaybeUninit::<K::Boxes>::uninit() }; FLIGHT];
        let mut masks = [0; FLIGHT];
        // SAFETY: there are at most `FLIGHT` rays; the references of the layout are sound, and its
        // stacks large enough.
        unsafe {
            for i in 0..count {
                let traversal = &**self.at_nodes.get_unchecked(i);
                let node = traversal.node(wide);
                let (entries, mask) = traversal.ray.boxes::<K>(node, traversal.t());
                keys.get_unchecked_mut(i).write(entries);
                *masks.get_unchecked_mut(i) = mask;
            }
            for i in 0..count {
                let traversal = &mut **self.at_nodes.get_unchecked(i);
                let node = traversal.node(wide);
                let mask = *masks.get_unchecked(i);
                if F::ANY || F::ALL {
                    K::compress(node, mask, traversal.top);
                } else {
                    K::sort(node, keys.get_unchecked(i).assume_init(), mask, traversal.top);
                }
                traversal.top = traversal.top.add(mask.count_ones() as usize).sub(1);
            }
            // Only now, when what was pushed has reached the cache: a load would wait for the
            // stores, which are wider.
            let places = wide.places();
            for i in 0..count {
                let traversal = &mut **self.at_nodes.get_unchecked(i);
                let child = traversal.go_on::<K>(places);
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
            let mut hopeful = [MaybeUninit::<Hopeful>::uninit(); FLIGHT + 1];
            let mut hopeful_count = 0;
            for i in (0..count).step_by(quarters) {
                let at = |k: usize| *self.at_leaves.get_unchecked((i + k).min(count - 1));
                let four = [at(0), at(1), at(2), at(3)];
                let (crossings, sure) = candidates::<K::Rays, F>(wide, four);
                for (k, &traversal) in four.iter().enumerate().take(quarters) {
                    let four = |pairs: u32| pairs >> (4 * k) & 0b1111;
                    let is_hit = F::ANY && F::TAKES_CERTAIN && four(sure) != 0;
                    if F::ANY {
                        let nearest = (*traversal).nearest;
                        (*traversal).nearest = if is_hit { 0 } else { nearest };
                    }
                    let possible = four(crossings.possible);
                    let certain = four(crossings.certain);
                    let next = hopeful.get_unchecked_mut(hopeful_count);
                    next.write(Hopeful { traversal, possible, certain });
                    let is_hopeful = (possible != 0) & !is_hit & (i + k < count);
                    hopeful_count += usize::from(is_hopeful);
                }
            }
            let hopeful = core::slice::from_raw_parts(hopeful.as_ptr().cast(), hopeful_count);
            for some in hopeful.chunks(Gathered::RAYS) {
                self.decide(some);
            }
            let places = wide.places();
            for i in 0..count {
                let traversal = &mut **self.at_leaves.get_unchecked(i);
                traversal.leave_block(wide, F::ANY);
                let child = traversal.go_on::<K>(places);
                self.enlist(traversal, child, &mut counts);
            }
            self.counts = counts;
        }
    }

    /// Gives every ray the nearest among the hit that it has and those in the block at which it is,
    /// or appends all of the block. Pairs that may be hits are few, and side by side their
    /// decisions take little time.
    #[inline(always)]
    unsafe fn decide(&mut self, hopeful: &[Hopeful]) {
        let wide = self.wide;
        if F::DECIDES {
            // SAFETY: the processor has the instructions; the rays are at blocks.
            return unsafe { self.decide_elsewhere(hopeful) };
        }
        let pairs = &mut self.gathered;
        // SAFETY: the processor has the instructions; the rays are at blocks.
        unsafe {
            pairs.clear();
            for (i, &Hopeful { traversal, possible, certain, .. }) in hopeful.iter().enumerate() {
                let traversal = &*traversal;
                let block = traversal.block(wide);
                let mut lanes = possible & block.used::<K::Block>();
                while lanes != 0 {
                    let lane = lanes.trailing_zeros();
                    lanes &= lanes - 1;
                    let is_certain = certain >> lane & 1;
                    pairs.push(&traversal.ray, block, traversal.t(), lane, i as u32, is_certain);
                }
            }
            for first in (0..pairs.count).step_by(K::Rays::N) {
                let decided = pairs.decide::<K::Rays>(first, F::ALL);
                for pair in first..(first + K::Rays::N).min(pairs.count) {
                    let (ray, lane) = pairs.names(pair);
                    let traversal = &mut *hopeful.get_unchecked(ray).traversal;
                    let block = traversal.block(wide);
                    if F::ALL {
                        let number = traversal.ray.number as usize;
                        self.find.append(number, &decided, pair - first, block, lane);
                    } else {
                        let key = decided.key(pair - first, block.id(lane));
                        traversal.nearest = traversal.nearest.min(key);
                    }
                }
            }
            if !F::ANY && !F::ALL {
                for &Hopeful { traversal, .. } in hopeful {
                    (*traversal).drop_farther::<K>();
                }
            }
        }
    }

    /// Does the same where `find` decides.
    #[inline(always)]
    unsafe fn decide_elsewhere(&mut self, hopeful: &[Hopeful]) {
        let quarters = K::Rays::N / 4;
        for i in (0..hopeful.len()).step_by(quarters) {
            // SAFETY: the rays are at blocks; the processor has the instructions.
            unsafe {
                let at = |k: usize| hopeful[(i + k).min(hopeful.len() - 1)].traversal;
                let four = [at(0), at(1), at(2), at(3)];
                let bounded = bounds::<K::Rays>(self.wide, four);
                let count = quarters.min(hopeful.len() - i);
                for (traversal, bounded) in four.into_iter().zip(&bounded).take(count) {
                    let traversal = &mut *traversal;
                    let block = traversal.block(self.wide);
                    let number = traversal.ray.number as usize;
                    let hit = self.find.decide::<K>(number, block, bounded);
                    if let Some(Hit { t, object }) = hit {
                        traversal.nearest = u64::from(t.to_bits()) << 32 | u64::from(object);
                        if !F::ANY {
                            traversal.drop_farther::<K>();
                        }
                    }
                }
            }
        }
    }

    /// Writes the answers of rays at their end.
    #[inline(always)]
    unsafe fn finish(&mut self) {
        let count = core::mem::replace(&mut self.counts.at_leaves, 0);
        let first = self.idle_count;
        // SAFETY: so many rays are at leaves or at their end, whose places become idle.
        unsafe {
            for i in 0..count {
                let traversal = *self.at_leaves.get_unchecked(i);
                let is_at_end = (*traversal).child == Child::END;
                let at_leaves = &mut self.counts.at_leaves;
                append(&mut self.at_leaves, at_leaves, traversal, !is_at_end);
                append(&mut self.idle, &mut self.idle_count, traversal, is_at_end);
            }
            for i in first..self.idle_count {
                let traversal = &**self.idle.get_unchecked(i);
                let number = traversal.ray.number as usize;
                self.find.write(number, traversal.t(), traversal.nearest as u32);
            }
        }
    }
}

/// The number of places of a stack that holds so many children: whole cache lines.
fn places_of_stack(need: usize) -> usize {
    (need + SPARE).next_multiple_of(LINE)
}

/// The traversal of the layout by one ray.
#[repr(C, align(64))]
struct Traversal {
    ray: Prepared,
    /// The bits of the nearest hit's distance so far, above its object; or those of the end of the
    /// ray, above `u32::MAX`. Distances are not negative, so that the nearer hit is less.
    nearest: u64,
    top: *mut Pending,
    /// The node or the block of triangles to visit next, or [`END`](Child::END).
    child: Child,
    /// [`END`](Child::END), the children that wait, the next block of the same leaf, and room for
    /// stores of whole registers.
    stack: *mut Pending,
}

/// # Safety
///
/// All functions: the processor has the instructions of `K`, the traversal was started, and the
/// references of the layout are sound, so that the stack has room for what a visit pushes.
impl Traversal {
    #[inline(always)]
    unsafe fn start(&mut self, root: Child) {
        self.nearest = u64::from(self.ray.t_max.to_bits()) << 32 | u64::from(u32::MAX);
        self.child = root;
        // SAFETY: the stack has more than one place.
        unsafe {
            self.stack.write(u64::from(Child::END.bits()));
            self.top = self.stack.add(1);
        }
    }

    /// Goes on to the child at the top of the stack, and fetches it.
    #[inline(always)]
    unsafe fn go_on<K: Instructions>(&mut self, places: Places) -> Child {
        // SAFETY: the top of the stack holds at least an end; a prefetch may name any address.
        unsafe {
            self.child = Child::from_bits(*self.top as u32);
            K::prefetch_bytes(places.of(self.child), size_of::<WideNode>());
            self.child
        }
    }

    #[inline(always)]
    unsafe fn node<'a>(&self, wide: &'a WideBvh) -> &'a WideNode {
        // SAFETY: references are sound.
        unsafe { &*wide.nodes.as_ptr().add(self.child.index()) }
    }

    #[inline(always)]
    unsafe fn block<'a>(&self, wide: &'a WideBvh) -> &'a TriangleBlock {
        // SAFETY: references are sound.
        unsafe { &*wide.blocks.as_ptr().add(self.child.index()) }
    }

    /// The distance beyond which nothing counts.
    #[inline(always)]
    fn t(&self) -> f32 {
        f32::from_bits((self.nearest >> 32) as u32)
    }

    /// Takes the children behind the nearest hit from the stack.
    #[inline(always)]
    unsafe fn drop_farther<K: Instructions>(&mut self) {
        // SAFETY: the stack is between its bottom and its top.
        self.top = unsafe { K::drop_farther(self.stack, self.top, self.t()) };
    }

    /// Leaves a block of triangles, so that the top of the stack holds the next one of the leaf, or
    /// what waits, or the end if any hit will do and there is one.
    #[inline(always)]
    unsafe fn leave_block(&mut self, wide: &WideBvh, ends_at_hit: bool) {
        // SAFETY: a block that is not its leaf's last is followed by another; the stack holds at
        // least an end, and has room for one more.
        unsafe {
            let is_last = self.block(wide).is_last();
            *self.top = u64::from(Child::leaf(self.child.index() as u32 + 1).bits());
            self.top = self.top.add(usize::from(!is_last));
            if ends_at_hit && self.nearest as u32 != u32::MAX {
                self.top = self.stack.add(1);
            }
            self.top = self.top.sub(1);
        }
    }
}

/// A ray at a block, and a bit for each of its triangles that the ray may hit and that it certainly
/// crosses.
#[derive(Clone, Copy)]
struct Hopeful {
    traversal: *mut Traversal,
    possible: u32,
    certain: u32,
}

/// Tests the blocks at which rays are, four pairs per ray. Returns also a bit for each triangle that
/// its ray certainly hits.
#[inline(always)]
unsafe fn candidates<L: Lanes, F: Find>(
    wide: &WideBvh,
    four: [*mut Traversal; 4],
) -> (Crossings, u32) {
    // SAFETY: the processor has the instructions; the rays are at blocks; the bits of the nearest
    // hit are the first two of four aligned lanes.
    unsafe {
        let tests = four.each(|at| Test { ray: &(*at).ray, block: (*at).block(wide) });
        let rays = Test::rays::<L>(tests);
        let candidates = rays.candidates(&Test::corners(tests));
        let crossings = candidates.crossings;
        if F::ALL {
            return (crossings, 0);
        }
        let t_max = L::load_quarters(four.each(|at| (&raw const (*at).nearest).cast()));
        let (possible, sure) = rays.within(&candidates, t_max.spread::<1>());
        (Crossings { possible, ..crossings }, sure)
    }
}

/// Returns the same with bounds of the distances.
#[inline(always)]
unsafe fn bounds<L: Lanes>(wide: &WideBvh, four: [*mut Traversal; 4]) -> [Bounded; 4] {
    let mut bounded = [Bounded::zeroed(); 4];
    // SAFETY: as in `candidates`; there is room.
    unsafe {
        let tests = four.each(|at| Test { ray: &(*at).ray, block: (*at).block(wide) });
        let rays = Test::rays::<L>(tests);
        let candidates = rays.candidates(&Test::corners(tests));
        let t_max = L::load_quarters(four.each(|at| (&raw const (*at).nearest).cast()));
        let (possible, certain) = rays.within(&candidates, t_max.spread::<1>());
        let ([low, high], along) = rays.distances(&candidates);
        let to = bounded.as_mut_ptr();
        let to = [to, to.add(1), to.add(2), to.add(3)];
        low.store_quarters(to.each(|to| (&raw mut (*to).low).cast()));
        high.store_quarters(to.each(|to| (&raw mut (*to).high).cast()));
        for (k, to) in bounded.iter_mut().enumerate().take(L::N / 4) {
            let four = |pairs: u32| pairs >> (4 * k) & 0b1111;
            to.possible = four(possible);
            to.certain = four(certain);
            to.along = four(along);
        }
    }
    bounded
}
