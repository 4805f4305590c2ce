//! Packets of coherent rays. Interval arithmetic culls the children of a node for all rays at once.
//! The vectors of rays test a child that is left one after the other, from the first vector that
//! entered the parent until one enters the child.
//!
//! Source: Wald, Boulos & Shirley 2007, 'Ray tracing deformable scenes using dynamic bounding
//! volume hierarchies'; Overbeck, Ramamoorthi & Mark 2008, 'Large ray packets for real-time Whitted
//! ray tracing' (ranged traversal).

use super::answer::Batch;
use super::culling::Culling;
use super::instructions::{Instructions, Part};
use super::kernel::{DeepStacks, SPARE, STACK};
use super::lanes::{Lanes, Mask as _};
use super::layout::WideBvh;
use super::node::{Child, WideNode};
use super::pairs::Pairs;
use super::ray_lanes::{RayBounds, RayLanes};
use crate::slabs::{FAR, NEAR};
use core::mem::MaybeUninit;

/// The maximum number of vectors in a packet.
pub(crate) const VECTORS: usize = 64 / 8;

/// A packet of vectors of rays that [cohere](RayLanes::cohere), all of the same octant.
pub(crate) struct Packet<K: Instructions> {
    pub(super) vectors: [MaybeUninit<Vector<K::Rays>>; VECTORS],
    pub(super) count: usize,
    /// One bit per axis: set where the rays run backwards.
    octant: u32,
    bounds: RayBounds<K::Rays>,
}

/// Rays of a packet side by side.
pub(super) struct Vector<L> {
    near_factor: [L; 3],
    far_factor: [L; 3],
    t_min: L,
    /// The nearest hits so far, or the ends of the rays and `u32::MAX`.
    pub(super) t: L,
    pub(super) object: L,
    /// The rays, and whether `pairs` has been made from them. Many packets meet no triangle.
    pub(super) rays: RayLanes<L>,
    pub(super) axes: [usize; 3],
    pub(super) is_sheared: bool,
    pub(super) pairs: MaybeUninit<Pairs<L>>,
    /// The number of the first ray in its batch.
    pub(super) first: usize,
}

/// The parent of a child that waits.
#[derive(Clone, Copy)]
struct Parent {
    node: u32,
    /// The first vector that entered the node.
    vector: u32,
}

impl<K: Instructions> Packet<K> {
    /// Returns a packet without rays.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(crate) unsafe fn new() -> Self {
        Self {
            vectors: [const { MaybeUninit::uninit() }; VECTORS],
            count: 0,
            octant: 0,
            // SAFETY: the caller's promise.
            bounds: unsafe { RayBounds::none() },
        }
    }

    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns whether rays of this octant can be added.
    #[inline(always)]
    pub(crate) fn takes(&self, octant: u32) -> bool {
        self.count == 0
            || (self.count < VECTORS.min(K::PACKET / K::Rays::N) && self.octant == octant)
    }

    /// Adds rays that cohere, of which the first is number `first` of its batch.
    #[inline(always)]
    pub(crate) fn add(&mut self, rays: RayLanes<K::Rays>, first: usize) {
        // SAFETY: a value exists.
        let [near, far, none] =
            unsafe { [NEAR, FAR, f32::from_bits(u32::MAX)].map(|x| K::Rays::splat(x)) };
        self.bounds.add(&rays);
        let [x, y, z] = rays.inverse;
        self.octant = rays.octant();
        self.vectors[self.count].write(Vector {
            near_factor: [x * near, y * near, z * near],
            far_factor: [x * far, y * far, z * far],
            t_min: rays.t_min,
            t: rays.t_max,
            object: none,
            axes: rays.axes(),
            rays,
            is_sheared: false,
            pairs: MaybeUninit::uninit(),
            first,
        });
        self.count += 1;
    }

    /// Traces the packet, writes its answers, and empties it. With `ANY` a ray ends at its first
    /// hit, which need not be the nearest.
    ///
    /// # Safety
    /// As for [`trace`](super::batch::trace).
    #[inline(always)]
    pub(crate) unsafe fn trace<const ANY: bool>(&mut self, wide: &WideBvh, batch: &mut Batch) {
        // SAFETY: the caller's promises.
        unsafe { K::call(Trace::<K, ANY> { packet: self, wide, batch }) };
    }

    /// Writes the answers.
    #[inline(always)]
    unsafe fn write(&self, batch: &mut Batch) {
        const { assert!(K::Rays::N <= 16) };
        let mut distances = [0.0; 16];
        let mut objects = [0; 16];
        for vector in &self.vectors[..self.count] {
            // SAFETY: as many vectors are written as are counted; there is room for sixteen lanes.
            let first = unsafe {
                let vector = vector.assume_init_ref();
                vector.t.store(distances.as_mut_ptr());
                vector.object.store(objects.as_mut_ptr().cast());
                vector.first
            };
            let lanes = ..K::Rays::N;
            batch.answers.write_lanes(first, &distances[lanes], &objects[lanes]);
        }
    }

    #[inline(always)]
    unsafe fn traverse<const ANY: bool>(
        &mut self,
        wide: &WideBvh,
        root: Child,
        culling: &Culling<K::Boxes>,
        batch: &mut Batch,
    ) {
        // SAFETY: the references of the layout are sound, and its stacks large enough.
        unsafe {
            let nodes = wide.nodes.as_ptr();
            let blocks = wide.blocks.as_ptr();
            let mut farthest = self.bounds.end();
            let mut end = key_of(farthest);
            let mut keys = MaybeUninit::<[u32; STACK + SPARE]>::uninit();
            let mut parents = MaybeUninit::<[Parent; STACK + SPARE]>::uninit();
            let mut deep_keys = DeepStacks::new(1, wide.stack_need);
            let mut deep_parents = DeepStacks::new(1, wide.stack_need);
            let keys: *mut u32 =
                deep_keys.as_mut().map_or(keys.as_mut_ptr().cast(), |deep| deep.stack(0));
            let parents: *mut Parent =
                deep_parents.as_mut().map_or(parents.as_mut_ptr().cast(), |deep| deep.stack(0));
            let mut top = 0;
            let mut child = root;
            // The first vector that enters the child, its rays that do, and the planes of the
            // child.
            let mut first = 0;
            let mut entered = u32::MAX;
            let mut planes = culling.all_space();
            loop {
                if child.is_node() {
                    let parent = Parent { node: child.index() as u32, vector: first as u32 };
                    let node = &*nodes.add(child.index());
                    let (entry, mask) = culling.cull::<K>(node, farthest);
                    if mask != 0 {
                        if ANY {
                            K::compress_keys(entry, mask, keys.add(top));
                        } else {
                            K::sort_keys(entry, mask, keys.add(top));
                        }
                        for i in 0..8 {
                            *parents.add(top + i) = parent;
                        }
                        top += mask.count_ones() as usize;
                        fetch::<K>(wide, node, mask);
                    }
                } else {
                    let block = blocks.add(child.index());
                    let accept = &mut batch.accept;
                    let is_hit = self.visit_leaf::<ANY>(
                        first,
                        entered,
                        &planes,
                        block,
                        &wide.bounds,
                        accept,
                    );
                    if is_hit {
                        farthest = self.farthest();
                        end = key_of(farthest);
                        if ANY && farthest < 0.0 {
                            return;
                        }
                    }
                }
                child = loop {
                    if top == 0 {
                        return;
                    }
                    top -= 1;
                    let key = *keys.add(top);
                    if key > end {
                        continue;
                    }
                    let lane = (!key & 7) as usize;
                    let waiting = *parents.add(top);
                    let node = &*nodes.add(waiting.node as usize);
                    planes = culling.planes(node, lane);
                    first = waiting.vector as usize;
                    entered = loop {
                        let entered = self.enter(first, &planes);
                        if entered != 0 || first + 1 == self.count {
                            break entered;
                        }
                        first += 1;
                    };
                    if entered != 0 {
                        break *node.children.get_unchecked(lane);
                    }
                };
            }
        }
    }

    /// Returns the greatest distance at which a ray may still have a nearer hit.
    #[inline(always)]
    unsafe fn farthest(&self) -> f32 {
        // SAFETY: as many vectors are written as are counted.
        unsafe {
            let mut t = self.vectors[0].assume_init_ref().t;
            for vector in &self.vectors[1..self.count] {
                t = t.max(vector.assume_init_ref().t);
            }
            t.greatest()
        }
    }

    /// Returns a bit per ray of a vector that enters the box of these planes before its nearest
    /// hit.
    #[inline(always)]
    pub(super) unsafe fn enter(&self, vector: usize, planes: &[[f32; 2]; 3]) -> u32 {
        // SAFETY: the caller's promise: the vector is counted.
        unsafe {
            let vector = self.vectors.get_unchecked(vector).assume_init_ref();
            let mut entry = vector.t_min;
            let mut exit = vector.t;
            for (axis, &[near, far]) in planes.iter().enumerate() {
                let origin = vector.rays.origin[axis];
                let near = (K::Rays::splat(near) - origin) * vector.near_factor[axis];
                let far = (K::Rays::splat(far) - origin) * vector.far_factor[axis];
                entry = entry.max(near);
                exit = far.min(exit);
            }
            entry.le(exit).bits()
        }
    }
}

/// Has the beginnings of some children fetched, because the packet comes to most of them soon.
///
/// # Safety
/// The processor has the instructions.
#[inline(always)]
unsafe fn fetch<K: Instructions>(wide: &WideBvh, node: &WideNode, mut mask: u32) {
    /// A block of triangles is three lines, a node four.
    const LINES: usize = 3;
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize & 7;
        mask &= mask - 1;
        let child = node.children[lane];
        let beginning = if child.is_node() {
            wide.nodes.as_ptr().wrapping_add(child.index()).cast::<u8>()
        } else {
            wide.blocks.as_ptr().wrapping_add(child.index()).cast::<u8>()
        };
        for line in 0..LINES {
            // SAFETY: a prefetch may name any address.
            unsafe { K::prefetch(beginning.wrapping_add(64 * line)) };
        }
    }
}

/// A packet to trace.
struct Trace<'p, 'a, K: Instructions, const ANY: bool> {
    packet: &'p mut Packet<K>,
    wide: &'p WideBvh,
    batch: &'p mut Batch<'a>,
}

impl<K: Instructions, const ANY: bool> Part for Trace<'_, '_, K, ANY> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { packet, wide, batch } = self;
        // SAFETY: the caller's promises.
        unsafe {
            let culling = Culling::<K::Boxes>::new(&packet.bounds, packet.octant);
            if let Some(root) = wide.root {
                packet.traverse::<ANY>(wide, root, &culling, batch);
            }
            packet.write(batch);
            packet.count = 0;
            packet.bounds = RayBounds::none();
        }
    }
}

/// Returns the greatest key of a child that a ray may enter before `farthest`.
#[inline(always)]
fn key_of(farthest: f32) -> u32 {
    farthest.to_bits() | 7
}
