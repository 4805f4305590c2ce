//! All hits of many rays, with many rays in flight.
//!
//! A search for all hits cuts nothing off, so the order of visits does not matter. A visit of a
//! node puts the inner children that the ray enters on the ray's stack, and the leaves on a list of
//! pairs that all rays share:
//!
//! ```text
//!   at a node: boxes ─┬─> inner children: the ray's stack ─> the ray's next node
//!                     └─> leaves: pairs of a ray and a block ─> candidates ─> decisions ─> hits
//! ```
//!
//! Steps of different rays and of different pairs do not depend on each other, and no step has a
//! branch that is hard to predict. One ray alone waits for memory, and for the processor to recover
//! from such branches.

use super::crossed_leaves::{Decision, LineLanes, SlopedLine};
use super::instructions::{Instructions, Pending};
use super::kernel::{DeepStacks, SPARE, STACK};
use super::lanes::Lanes;
use super::layout::WideBvh;
use super::node::{Child, WideNode};
use super::prepared::{Prepared, Ready};
use super::ray_lanes::RayLanes;
use super::triangles::TriangleBlock;
use crate::exact::Line;
use crate::{Hit, Ray};
use alloc::vec::Vec;
use core::mem::MaybeUninit;

/// The largest number of rays that are traced together. What is kept of each fits in the cache.
pub(super) const MOST: usize = 256;

/// The largest number of rays in flight.
const FLIGHT: usize = 32;

/// The number of pairs that are tested together, at most.
const PAIRS: usize = 1024;

/// The largest number of rays that are prepared at once.
const RAYS: usize = 16;

/// At the bottom of every stack.
const END: Child = Child::leaf(u32::MAX);

/// A hit of the ray of this number.
#[derive(Clone, Copy)]
pub(crate) struct Found {
    pub(super) number: u32,
    pub(super) hit: Hit,
}

/// A block of triangles, as the bits of a [`Child`], and above them the number of a ray that
/// entered it.
type Pair = u64;

/// Appends the hits of the rays to `found`, in no order; the hits of a divided triangle once for
/// each of its leaves.
///
/// # Safety
/// The processor has the instructions of `K`, and the caller is compiled with them; the references
/// of `wide` are sound; there are at most [`MOST`] rays.
#[inline(always)]
pub(crate) unsafe fn trace<K: Instructions>(wide: &WideBvh, rays: &[Ray], found: &mut Vec<Found>) {
    const { assert!(K::FLIGHT <= FLIGHT && K::Rays::N <= RAYS) };
    let Some(root) = wide.root else { return };
    let mut prepared = [const { MaybeUninit::<Prepared>::uninit() }; MOST + RAYS];
    let mut lines = [const { MaybeUninit::<SlopedLine>::uninit() }; MOST];
    let mut waiting = [0; MOST];
    let mut count = 0;
    // SAFETY: the caller's promises; there is room for the last lanes.
    unsafe {
        for first in (0..rays.len()).step_by(K::Rays::N) {
            let lanes = RayLanes::<K::Rays>::load_up_to(rays, first, rays.len());
            let ready = Ready::new(lanes, wide);
            ready.write(first as u32, prepared[first].as_mut_ptr());
            let entered = ready.enter(&wide.bounds);
            let last = rays.len().min(first + K::Rays::N);
            for (lane, number) in (first..last).enumerate() {
                if entered >> lane & 1 == 1 {
                    lines[number].write(SlopedLine::new(&rays[number], &wide.bounds));
                    waiting[count] = number as u32;
                    count += 1;
                }
            }
        }
        let mut pairs = Pairs { wide, rays, lines: &lines, pairs: [0; PAIRS], count: 0, found };
        let waiting = &waiting[..count];
        if root.is_node() {
            visit_nodes::<K>(&mut pairs, waiting, prepared.as_ptr().cast(), root);
        } else {
            for &number in waiting {
                pairs.append_leaf::<K>(root, number);
            }
        }
        pairs.test::<K>();
    }
}

/// The way of one ray through the layout.
#[repr(C, align(64))]
struct Traversal {
    ray: *const Prepared,
    top: *mut Pending,
    /// The node to visit next.
    child: Child,
    number: u32,
    /// [`END`], what waits, and room for stores of whole registers: `frame`, or on the heap.
    stack: *mut Pending,
    frame: [MaybeUninit<Pending>; STACK + SPARE],
}

impl Traversal {
    /// Starts a ray.
    #[inline(always)]
    unsafe fn start(&mut self, number: u32, prepared: *const Prepared, root: Child) {
        // SAFETY: the caller's promise: the ray is prepared.
        self.ray = unsafe { prepared.add(number as usize) };
        self.number = number;
        self.child = root;
        // SAFETY: the stack has more than one place.
        unsafe {
            self.stack.write(u64::from(END.bits()));
            self.top = self.stack.add(1);
        }
    }
}

/// Visits all nodes that the rays of these numbers enter, and puts their leaves on the list.
///
/// # Safety
/// As for [`trace`]; the rays are prepared, and the root is a node.
#[inline(always)]
unsafe fn visit_nodes<K: Instructions>(
    pairs: &mut Pairs,
    waiting: &[u32],
    prepared: *const Prepared,
    root: Child,
) {
    let mut traversals = [const { MaybeUninit::<Traversal>::uninit() }; FLIGHT];
    let mut deep = DeepStacks::new(FLIGHT, pairs.wide.stack_need);
    for (i, traversal) in traversals.iter_mut().enumerate() {
        let traversal: *mut Traversal = traversal.as_mut_ptr();
        // SAFETY: the traversal exists; its fields need not be initialised to be named.
        unsafe {
            let frame = (&raw mut (*traversal).frame).cast();
            (*traversal).stack = deep.as_mut().map_or(frame, |deep| deep.stack(i));
        }
    }
    let mut active = [core::ptr::null_mut(); FLIGHT];
    let mut count = K::FLIGHT.min(waiting.len());
    let (first, mut waiting) = waiting.split_at(count);
    let nodes = pairs.wide.nodes.as_ptr();
    // SAFETY: the references of the layout are sound, and its stacks large enough; nothing is
    // popped after `END`; a prefetch may name any address.
    unsafe {
        for (i, &number) in first.iter().enumerate() {
            active[i] = traversals[i].as_mut_ptr();
            (*active[i]).start(number, prepared, root);
        }
        while count > 0 {
            let visits = count;
            let mut ended = [core::ptr::null_mut(); FLIGHT];
            let mut ends = 0;
            count = 0;
            for i in 0..visits {
                let traversal = &mut *active[i];
                let ray = &*traversal.ray;
                let node = &*nodes.add(traversal.child.index());
                let (_, entered) = ray.boxes::<K>(node, ray.t_max);
                let leaves = K::Boxes::load(node.children.as_ptr().cast()).signs();
                K::compress(node, entered & !leaves, traversal.top);
                let inner = (entered & !leaves).count_ones() as usize;
                pairs.append_leaves::<K>(node, entered & leaves, traversal.number);
                traversal.top = traversal.top.add(inner).sub(1);
                traversal.child = Child::from_bits(*traversal.top as u32);
                let is_at_end = traversal.child == END;
                let line = nodes.wrapping_add(traversal.child.index()).cast::<u8>();
                for offset in 0..size_of::<WideNode>() / 64 {
                    K::prefetch(line.wrapping_add(64 * offset));
                }
                active[count] = traversal;
                count += usize::from(!is_at_end);
                ended[ends] = traversal;
                ends += usize::from(is_at_end);
            }
            for &traversal in &ended[..ends] {
                let Some((&number, rest)) = waiting.split_first() else { break };
                waiting = rest;
                (*traversal).start(number, prepared, root);
                active[count] = traversal;
                count += 1;
            }
            if pairs.count > PAIRS - WideNode::LANES * (FLIGHT + 1) {
                pairs.test::<K>();
            }
        }
    }
}

/// The pairs of a ray and a block of triangles that wait for their test.
struct Pairs<'a> {
    wide: &'a WideBvh,
    rays: &'a [Ray],
    /// Written for all rays in flight.
    lines: &'a [MaybeUninit<SlopedLine>; MOST],
    pairs: [Pair; PAIRS],
    count: usize,
    found: &'a mut Vec<Found>,
}

impl Pairs<'_> {
    /// Appends a leaf.
    #[inline(always)]
    unsafe fn append_leaf<K: Instructions>(&mut self, leaf: Child, number: u32) {
        self.pairs[self.count] = u64::from(leaf.bits()) | u64::from(number) << 32;
        self.count += 1;
        if self.count == PAIRS {
            // SAFETY: the caller's promises, those of `trace`.
            unsafe { self.test::<K>() };
        }
    }

    /// Appends the leaves among the children of a node, without a branch.
    ///
    /// # Safety
    /// As for [`trace`]; there is room for eight more than are appended.
    #[inline(always)]
    unsafe fn append_leaves<K: Instructions>(&mut self, node: &WideNode, leaves: u32, number: u32) {
        // SAFETY: the caller's promises.
        unsafe {
            let to = self.pairs.as_mut_ptr().add(self.count);
            K::compress(node, leaves, to);
            // All eight, whose number the compiler knows.
            for i in 0..WideNode::LANES {
                *to.add(i) |= u64::from(number) << 32;
            }
        }
        self.count += leaves.count_ones() as usize;
    }

    /// Tests all pairs and empties the list.
    ///
    /// # Safety
    /// As for [`trace`].
    #[inline(always)]
    unsafe fn test<K: Instructions>(&mut self) {
        /// The number of pairs between the one that is tested and the one that is fetched from
        /// memory.
        const AHEAD: usize = 8;
        let blocks = self.wide.blocks.as_ptr();
        let block_of = |pair: Pair| blocks.wrapping_add(Child::from_bits(pair as u32).index());
        // SAFETY: pairs name rays in flight and blocks of the layout; after a block that is not the
        // last of its leaf comes another; a prefetch may name any address.
        unsafe {
            while self.count > 0 {
                let mut hopeful = [0; PAIRS];
                let mut hopes = 0;
                let mut rest = 0;
                for i in 0..self.count {
                    let ahead = block_of(self.pairs[(i + AHEAD).min(self.count - 1)]);
                    for offset in 0..size_of::<TriangleBlock>().div_ceil(64) {
                        K::prefetch(ahead.cast::<u8>().wrapping_add(64 * offset));
                    }
                    let pair = self.pairs[i];
                    let block = &*block_of(pair);
                    let line = self.lines[(pair >> 32) as usize].assume_init_ref();
                    let line = LineLanes::<K::Block>::new(line);
                    hopeful[hopes] = pair;
                    hopes += usize::from(line.candidates(block) != 0);
                    // The next block of the leaf takes the place of a pair that has been tested.
                    self.pairs[rest] = pair + 1;
                    rest += usize::from(!block.is_last());
                }
                self.count = rest;
                for &pair in &hopeful[..hopes] {
                    self.decide::<K>((pair >> 32) as u32, &*block_of(pair));
                }
            }
        }
    }

    /// Appends the hits of a ray in a block.
    #[inline(always)]
    unsafe fn decide<K: Instructions>(&mut self, number: u32, block: &TriangleBlock) {
        let ray = &self.rays[number as usize];
        // SAFETY: the caller's promises.
        let Decision { mut hits, mut unsure, distances } = unsafe {
            let line = self.lines[number as usize].assume_init_ref();
            LineLanes::<K::Block>::new(line).decide(block)
        };
        while hits != 0 {
            let lane = hits.trailing_zeros() as usize & 3;
            hits &= hits - 1;
            self.append(number, ray, Hit { t: distances[lane], object: block.id(lane) });
        }
        while unsure != 0 {
            let lane = unsure.trailing_zeros() as usize & 3;
            unsure &= unsure - 1;
            if let Some((object, triangle)) = block.triangle(lane)
                && let Some(t) = Line::new(ray).crossing(ray, &triangle.0)
            {
                self.append(number, ray, Hit { t, object });
            }
        }
    }

    /// Appends a hit if it is in the range of its ray, and not of an unused lane.
    #[inline(always)]
    fn append(&mut self, number: u32, ray: &Ray, hit: Hit) {
        if ray.t_min() <= hit.t && hit.t <= ray.t_max() && !hit.is_miss() {
            self.found.push(Found { number, hit });
        }
    }
}
