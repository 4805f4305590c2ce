//! The state of one ray in flight, and its steps: into a node, onto the stack, through triangles.

use super::answer::Accept;
use super::instructions::{Instructions, Pending};
use super::kernel::{SPARE, STACK};
use super::lanes::{Lanes, Mask};
use super::layout::WideBvh;
use super::node::{Child, WideNode};
use super::pairs::Pairs;
use super::prepared::Prepared;
use super::triangles::TriangleBlock;
use crate::Hit;
use crate::ray::AXES;
use core::mem::MaybeUninit;

/// The traversal of the layout by one ray.
#[repr(C, align(64))]
pub(super) struct Traversal {
    pub(super) ray: Prepared,
    /// The nearest hit so far, or the end of the ray and `u32::MAX`.
    pub(super) t: f32,
    pub(super) object: u32,
    top: *mut Pending,
    /// The node or the block of triangles to visit next, or [`END`](Child::END).
    pub(super) child: Child,
    /// The arrays of the layout in which the ray is.
    pub(super) nodes: *const WideNode,
    pub(super) blocks: *const TriangleBlock,
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
    pub(super) unsafe fn set_stack(this: *mut Self, deep: Option<*mut Pending>) {
        // SAFETY: the traversal exists; its fields need not be initialised to be named.
        unsafe { (*this).stack = deep.unwrap_or((&raw mut (*this).frame).cast()) };
    }

    /// Starts a ray at the root.
    #[inline(always)]
    pub(super) unsafe fn start(&mut self, ray: Prepared, wide: &WideBvh) {
        self.t = ray.t_max;
        self.object = u32::MAX;
        self.ray = ray;
        self.child = wide.root.unwrap_or(Child::END);
        self.nodes = wide.nodes.as_ptr();
        self.blocks = wide.blocks.as_ptr();
        // SAFETY: the stack has more than one place.
        unsafe {
            self.stack.write(u64::from(Child::END.bits()));
            self.top = self.stack.add(1);
        }
    }

    /// Goes on to what waits.
    #[inline(always)]
    pub(super) unsafe fn pop(&mut self) {
        // SAFETY: the caller's promise: the stack holds at least an end.
        unsafe {
            self.top = self.top.sub(1);
            self.child = Child::from_bits(*self.top as u32);
        }
    }

    /// Pushes the entered children, and goes on to the nearest of them, or else to what waits.
    #[inline(always)]
    pub(super) unsafe fn enter<K: Instructions, const ANY: bool>(
        &mut self,
        node: &WideNode,
        entry: K::Boxes,
        mask: u32,
    ) {
        // SAFETY: the stack holds at least an end, and has room for eight children.
        unsafe {
            let top = self.top;
            self.top = top.add(mask.count_ones() as usize).sub(1);
            if ANY {
                K::compress(node, mask, top);
                self.child = Child::from_bits(*self.top as u32);
            } else {
                // The nearest child is on top of the stack, too. But a load from there would wait
                // until the stores, which are wider, have reached the cache.
                let waiting = Child::from_bits(*top.sub(1) as u32);
                let nearest = K::sort(node, entry, mask, top);
                self.child = if mask == 0 { waiting } else { nearest };
            }
        }
    }

    /// Takes the children behind the nearest hit from the stack.
    #[inline(always)]
    pub(super) unsafe fn drop_farther<K: Instructions>(&mut self) {
        // SAFETY: the stack is between its bottom and its top.
        self.top = unsafe { K::drop_farther(self.stack, self.top, self.t) };
    }

    /// Goes on from a block of triangles: to the next one of the leaf, to what waits, or to the end
    /// if any hit will do and there is one.
    #[inline(always)]
    pub(super) unsafe fn leave_block<const ANY: bool>(&mut self) {
        // SAFETY: a block that is not its leaf's last is followed by another; the stack holds at
        // least an end, and has room for one more.
        unsafe {
            let block = self.child.index();
            let is_last = (*self.blocks.add(block)).is_last();
            *self.top = u64::from(Child::leaf(block as u32 + 1).bits());
            self.top = self.top.add(usize::from(!is_last));
            if ANY && self.object != u32::MAX {
                self.top = self.stack.add(1);
            }
            self.pop();
        }
    }

    /// Fetches the next node or block of triangles from memory.
    #[inline(always)]
    pub(super) unsafe fn fetch<K: Instructions>(&self) {
        let child = self.child;
        let (array, size) = if child.is_node() {
            (self.nodes.cast::<u8>(), size_of::<WideNode>())
        } else {
            (self.blocks.cast::<u8>(), size_of::<TriangleBlock>())
        };
        let lines = array.wrapping_add(child.index().wrapping_mul(size));
        for line in 0..4 {
            // SAFETY: a prefetch may name any address.
            unsafe { K::prefetch(lines.wrapping_add(64 * line)) };
        }
    }
}

/// Returns the rays as triangles are tested with them.
#[inline(always)]
unsafe fn pairs<L: Lanes>(four: [*mut Traversal; 4]) -> Pairs<L> {
    // SAFETY: the caller's promise: the traversals exist, and the processor has the instructions.
    unsafe { Prepared::pairs([&(*four[0]).ray, &(*four[1]).ray, &(*four[2]).ray, &(*four[3]).ray]) }
}

/// Returns a bit for each triangle that the line of its ray may meet, of the block at which each
/// ray is: four bits per ray.
#[inline(always)]
pub(super) unsafe fn candidates<L: Lanes>(four: [*mut Traversal; 4]) -> u32 {
    // SAFETY: the caller's promises.
    unsafe { pairs::<L>(four).candidates(&corners(four)).possible }
}

/// Returns the corners of the block at which each ray is, along the axes of its shear.
#[inline(always)]
unsafe fn corners<L: Lanes>(four: [*mut Traversal; 4]) -> [[L; 3]; 3] {
    // SAFETY: the caller's promises; axes are below 3.
    unsafe {
        let lanes = |i: usize, corner: usize, axis: usize| {
            let traversal = &*four[i];
            let axis = AXES[traversal.ray.largest_axis as usize % 3][axis];
            let block = traversal.blocks.wrapping_add(traversal.child.index());
            block.cast::<f32>().wrapping_add((3 * corner + axis) * TriangleBlock::LANES)
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

/// Gives every ray the nearest hit among the hit it has and those in the block at which it is, by
/// [`Hit::precedes`](crate::Hit::precedes) and without a branch.
#[inline(always)]
pub(super) unsafe fn decide<L: Lanes>(four: [*mut Traversal; 4]) {
    // SAFETY: the caller's promises; ids are four aligned lanes, and so are the fields of a
    // traversal from its distance on.
    unsafe {
        let row = |i: usize| (&raw const (*four[i]).t);
        let before = L::load_quarters([row(0), row(1), row(2), row(3)]);
        let t_max = before.spread::<0>();
        let corners = corners::<L>(four);
        let (inside, t) = pairs::<L>(four).decide_alone(&corners, t_max);
        let ids =
            |i: usize| (*(*four[i]).blocks.wrapping_add((*four[i]).child.index())).ids().cast();
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

/// Gives every ray the nearest hit that `accept` accepts, among the hit it has and those in the
/// block at which it is. The rays are numbered from `first` on.
#[inline(always)]
pub(super) unsafe fn decide_accepted<L: Lanes>(
    four: &[*mut Traversal],
    first: usize,
    accept: &mut Accept,
) {
    let last = four.len() - 1;
    let rays = [four[0], four[1.min(last)], four[2.min(last)], four[3.min(last)]];
    // SAFETY: the caller's promises; `four` has a traversal at least.
    unsafe {
        let before = [nearest(rays[0]), nearest(rays[1]), nearest(rays[2]), nearest(rays[3])];
        decide::<L>(rays);
        // Filters accept most hits, so that the nearest one in the block is asked for first.
        for (i, &traversal) in four.iter().enumerate() {
            let hit = nearest(traversal);
            let number = first + (*traversal).ray.number as usize;
            if hit != before[i] && !accept(number, hit) {
                (*traversal).t = before[i].t;
                (*traversal).object = before[i].object;
                decide_others::<L>(traversal, hit.object, number, accept);
            }
        }
    }
}

/// Gives a ray the nearest hit that `accept` accepts, as [`decide_accepted`] does, where `accept`
/// has rejected one object.
#[inline(always)]
unsafe fn decide_others<L: Lanes>(
    traversal: *mut Traversal,
    rejected: u32,
    number: usize,
    accept: &mut Accept,
) {
    // SAFETY: the caller's promises.
    unsafe {
        let ray = [traversal; 4];
        let end = &raw const (*traversal).t;
        let t_max = L::load_quarters([end; 4]).spread::<0>();
        let corners = corners::<L>(ray);
        let (inside, t) = pairs::<L>(ray).decide_alone(&corners, t_max);
        let mut distances = [0.0; 16];
        t.store(distances.as_mut_ptr());
        let block = &*(*traversal).blocks.add((*traversal).child.index());
        let mut left = inside.bits() & 0b1111;
        while left != 0 {
            let lane = left.trailing_zeros() as usize;
            left &= left - 1;
            let hit = Hit { t: distances[lane], object: block.id(lane) };
            // An unused lane repeats a triangle, which may have been rejected.
            let is_new = hit.object != rejected && !hit.is_miss();
            if is_new && hit.precedes(&nearest(traversal)) && accept(number, hit) {
                (*traversal).t = hit.t;
                (*traversal).object = hit.object;
            }
        }
    }
}

/// Returns the nearest hit of a ray so far.
#[inline(always)]
unsafe fn nearest(traversal: *const Traversal) -> Hit {
    // SAFETY: the caller's promise: the traversal exists.
    unsafe { Hit { t: (*traversal).t, object: (*traversal).object } }
}

/// Returns the lower of two ids.
#[inline(always)]
fn lower<L: Lanes>(a: L, b: L) -> L {
    L::select(a.below(b), a, b)
}
