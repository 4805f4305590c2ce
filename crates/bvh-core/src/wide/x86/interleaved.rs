//! Batches of incoherent rays with AVX-512: many rays in flight, a step of each in turn.
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

use super::answer::Answer;
use super::avx512::Avx512;
use super::leaves::{candidates, nearest_of};
use super::one_ray::{Instructions, Pending};
use super::prepared::{Prepared, RAYS, Sixteen};
use crate::Ray;
use crate::wide::kernel::STACK;
use crate::wide::layout::WideBvh;
use crate::wide::node::{Child, WideNode};
use crate::wide::triangles::TriangleBlock;
use core::arch::x86_64::*;
use core::mem::MaybeUninit;

/// Rays in flight. Measured on Zen 4 with 8 to 32: fewer wait for each other, more gain nothing.
const FLIGHT: usize = 24;

/// Rays of a batch that are numbered together.
const MOST: usize = 1 << 31;

/// Leaves are visited when so many rays are at one, or none is at a node.
const AT_LEAVES: usize = FLIGHT / 2;

/// At the bottom of every stack.
const END: Child = Child::leaf(u32::MAX);

/// The answers of all rays.
///
/// # Safety
/// As [`nearest`](super::one_ray::nearest), with AVX-512; `rays` are as many as `answers`.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
pub(crate) unsafe fn trace<A: Answer>(wide: &WideBvh, rays: &[Ray], answers: &mut [A]) {
    let Some(root) = wide.root else { return answers.fill(A::MISS) };
    if rays.is_empty() {
        return;
    }
    // Rays are numbered by 32 bits.
    if rays.len() > MOST {
        for (rays, answers) in rays.chunks(MOST).zip(answers.chunks_mut(MOST)) {
            // SAFETY: the caller's promises.
            unsafe { trace(wide, rays, answers) };
        }
        return;
    }
    // SAFETY: the caller's promises.
    unsafe {
        let mut traversals = MaybeUninit::<[Traversal; FLIGHT]>::uninit();
        let mut flight = Flight {
            wide,
            root,
            rays,
            answers,
            prepared: 0,
            ready: [MaybeUninit::uninit(); RAYS],
            waiting: 0,
            at_nodes: List::EMPTY,
            at_leaves: List::EMPTY,
            at_end: List::EMPTY,
        };
        for i in 0..FLIGHT {
            flight.start(traversals.as_mut_ptr().cast::<Traversal>().add(i));
        }
        while flight.at_nodes.count + flight.at_leaves.count > 0 {
            flight.visit_nodes();
            if flight.at_leaves.count >= AT_LEAVES || flight.at_nodes.count == 0 {
                flight.visit_leaves();
                flight.end();
            }
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
    /// The node or the block of triangles to visit next.
    child: Child,
    top: *mut Pending,
    stack: Stack,
}

/// [`END`], what waits, the block after the present one, and room for stores of whole registers.
#[repr(C, align(64))]
struct Stack([MaybeUninit<Pending>; STACK + 24]);

impl Traversal {
    /// Goes on to what is on top of the stack, and has it fetched.
    #[inline(always)]
    unsafe fn pop(&mut self, wide: &WideBvh) {
        // SAFETY: nothing is popped after `END`; a prefetch may name any address.
        unsafe {
            self.top = self.top.sub(1);
            let child = Child::from_bits(*self.top as u32);
            self.child = child;
            let (array, size) = if child.is_node() {
                (wide.nodes.as_ptr().cast::<i8>(), size_of::<WideNode>())
            } else {
                (wide.blocks.as_ptr().cast::<i8>(), size_of::<TriangleBlock>())
            };
            let lines = array.wrapping_add(child.index().wrapping_mul(size));
            _mm_prefetch::<_MM_HINT_T0>(lines);
            _mm_prefetch::<_MM_HINT_T0>(lines.wrapping_add(64));
            _mm_prefetch::<_MM_HINT_T0>(lines.wrapping_add(128));
            _mm_prefetch::<_MM_HINT_T0>(lines.wrapping_add(192));
        }
    }

    /// Takes what begins behind the nearest hit from the stack.
    #[inline(always)]
    unsafe fn drop_farther(&mut self) {
        // SAFETY: the stack has room for a register more than it holds, and is aligned.
        unsafe {
            let nearest = u64::from(self.t.to_bits() | 7) << 32 | u64::from(u32::MAX);
            let nearest = _mm512_set1_epi64(nearest as i64);
            let base = self.stack.0.as_mut_ptr().cast::<Pending>();
            let (mut from, mut to) = (base, base);
            while from < self.top {
                let pending = _mm512_load_si512(from.cast());
                let held = (0xff_u32 >> (8 - (self.top.offset_from(from) as usize).min(8))) as u8;
                let kept = _mm512_mask_cmple_epu64_mask(held, pending, nearest);
                _mm512_storeu_si512(to.cast(), _mm512_maskz_compress_epi64(kept, pending));
                to = to.add(kept.count_ones() as usize);
                from = from.add(8);
            }
            self.top = to;
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

/// All rays of a batch: those on their way, those that have been prepared, and those that have not.
struct Flight<'a, A> {
    wide: &'a WideBvh,
    root: Child,
    rays: &'a [Ray],
    answers: &'a mut [A],
    /// How many of `rays` have been prepared.
    prepared: usize,
    /// The last of these, and a bit for each that has not been started.
    ready: [MaybeUninit<Prepared>; RAYS],
    waiting: u16,
    at_nodes: List,
    at_leaves: List,
    at_end: List,
}

impl<A: Answer> Flight<'_, A> {
    /// Starts the next ray, if there is one.
    #[inline(always)]
    unsafe fn start(&mut self, traversal: *mut Traversal) {
        // SAFETY: `ready` is written where `waiting` has a bit.
        unsafe {
            while self.waiting == 0 {
                if self.prepared == self.rays.len() {
                    return;
                }
                self.prepare();
            }
            let next = self.waiting.trailing_zeros() as usize;
            self.waiting &= self.waiting - 1;
            let traversal = &mut *traversal;
            traversal.ray = self.ready.get_unchecked(next).assume_init();
            traversal.t = traversal.ray.t_max;
            traversal.object = u32::MAX;
            traversal.child = self.root;
            traversal.stack.0[0].write(u64::from(END.bits()));
            traversal.top = traversal.stack.0.as_mut_ptr().cast::<Pending>().add(1);
            self.enlist(traversal);
        }
    }

    /// Prepares the next sixteen rays, traces those that cannot be, and answers those that miss the box around everything.
    #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
    unsafe fn prepare(&mut self) {
        let first = self.prepared;
        let rays = &self.rays[first..];
        let count = rays.len().min(RAYS);
        let padded;
        let sixteen = match rays.first_chunk::<RAYS>() {
            Some(sixteen) => sixteen,
            None => {
                padded = core::array::from_fn(|i| rays[i.min(count - 1)]);
                &padded
            }
        };
        self.prepared += count;
        let there = (u32::from(u16::MAX) >> (RAYS - count)) as u16;
        // SAFETY: this function has the instructions; `ready` has room for sixteen.
        let (in_range, waiting) = unsafe {
            let sixteen = Sixteen::new(sixteen, self.wide.largest);
            let waiting = there & sixteen.in_range & sixteen.enter(&self.wide.bounds);
            if waiting != 0 {
                sixteen.write(first as u32, self.ready.as_mut_ptr().cast());
            }
            (sixteen.in_range, waiting)
        };
        self.waiting = waiting;
        if waiting != there {
            self.answers[first..self.prepared].fill(A::MISS);
        }
        let mut others = there & !in_range;
        while others != 0 {
            let number = first + others.trailing_zeros() as usize;
            // SAFETY: the promises of `trace`.
            self.answers[number] = unsafe { A::alone(self.wide, &self.rays[number]) };
            others &= others - 1;
        }
    }

    /// Puts a ray where its next visit is.
    #[inline(always)]
    unsafe fn enlist(&mut self, traversal: &mut Traversal) {
        let child = traversal.child;
        // SAFETY: every list has a place for every traversal.
        unsafe {
            self.at_nodes.append(traversal, child.is_node());
            self.at_leaves.append(traversal, !child.is_node() & (child != END));
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
                let node = &*self.wide.nodes.as_ptr().add(traversal.child.index());
                let (entry, mask) = boxes(node, &traversal.ray, traversal.t);
                if A::ANY {
                    let children = _mm256_load_si256(node.children.as_ptr().cast());
                    let entered = _mm256_maskz_compress_epi32(mask as u8, children);
                    _mm512_storeu_si512(traversal.top.cast(), _mm512_cvtepu32_epi64(entered));
                } else {
                    Avx512::sort(node, entry, mask, traversal.top);
                }
                traversal.top = traversal.top.add(mask.count_ones() as usize);
                traversal.pop(self.wide);
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
            let block_of = |traversal: *mut Traversal| blocks.add((*traversal).child.index());
            let mut hopeful = List::EMPTY;
            for i in (0..count).step_by(4) {
                let at = |k: usize| self.at_leaves.get((i + k).min(count - 1));
                let four = [at(0), at(1), at(2), at(3)];
                let rays = [&(*four[0]).ray, &(*four[1]).ray, &(*four[2]).ray, &(*four[3]).ray];
                let their = [block_of(four[0]), block_of(four[1]), block_of(four[2]), block_of(four[3])];
                let found = candidates(rays, their);
                for (k, &traversal) in four.iter().enumerate() {
                    hopeful.append(traversal, (found >> (4 * k) & 0b1111 != 0) & (i + k < count));
                }
            }
            for i in (0..hopeful.count).step_by(2) {
                let two = [hopeful.get(i), hopeful.get((i + 1).min(hopeful.count - 1))];
                let rays = [&(*two[0]).ray, &(*two[1]).ray];
                let before = [((*two[0]).t, (*two[0]).object), ((*two[1]).t, (*two[1]).object)];
                let nearest = nearest_of(rays, [block_of(two[0]), block_of(two[1])], before);
                for (&traversal, nearest) in two.iter().zip(nearest) {
                    let traversal = &mut *traversal;
                    (traversal.t, traversal.object) = nearest;
                    if !A::ANY {
                        traversal.drop_farther();
                    }
                }
            }
            for i in 0..count {
                let traversal = &mut *self.at_leaves.get(i);
                let block = traversal.child.index();
                *traversal.top = u64::from(Child::leaf(block as u32 + 1).bits());
                traversal.top = traversal.top.add(usize::from(!(*blocks.add(block)).is_last()));
                if A::ANY {
                    let bottom = traversal.stack.0.as_mut_ptr().cast::<Pending>().add(1);
                    traversal.top = if traversal.object == u32::MAX { traversal.top } else { bottom };
                }
                traversal.pop(self.wide);
                self.enlist(traversal);
            }
        }
    }

    /// Writes the answers of rays at their end, and starts others in their place.
    #[inline(always)]
    unsafe fn end(&mut self) {
        // SAFETY: rays are numbered as answers are.
        unsafe {
            let count = self.at_end.count;
            self.at_end.count = 0;
            for i in 0..count {
                let traversal = self.at_end.get(i);
                let Traversal { ray, t, object, .. } = &*traversal;
                *self.answers.get_unchecked_mut(ray.number as usize) = A::of(*t, *object);
                self.start(traversal);
            }
        }
    }
}

/// [`Instructions::boxes`] for a ray in memory.
#[inline(always)]
unsafe fn boxes(node: &WideNode, ray: &Prepared, t_max: f32) -> (__m256, u32) {
    // SAFETY: the caller has AVX-512; loads are of whole, aligned planes of 32 bytes, which the ray names.
    unsafe {
        let distance = |plane: u32, scale: f32, shift: f32| {
            let plane = node.planes.as_ptr().cast::<u8>().add(plane as usize).cast();
            _mm256_fmadd_ps(_mm256_load_ps(plane), _mm256_set1_ps(scale), _mm256_set1_ps(shift))
        };
        let near = |axis: usize| distance(ray.near[axis], ray.near_scale[axis], ray.near_shift[axis]);
        let far = |axis: usize| distance(ray.far[axis], ray.far_scale[axis], ray.far_shift[axis]);
        let entry = _mm256_max_ps(near(2), _mm256_set1_ps(ray.t_min));
        let entry = _mm256_max_ps(_mm256_max_ps(near(0), near(1)), entry);
        let exit = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), far(2));
        // Of a NaN and a number the instruction gives the second operand: unused lanes stay NaN.
        let exit = _mm256_min_ps(_mm256_set1_ps(t_max), exit);
        (entry, u32::from(_mm256_cmp_ps_mask::<_CMP_LE_OQ>(entry, exit)))
    }
}
