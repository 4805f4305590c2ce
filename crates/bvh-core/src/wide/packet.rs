//! Packets of coherent rays: nodes are culled for all rays at once by interval arithmetic, and a child that is left is tested
//! vector by vector from the first that entered its parent; the first one that enters it will do.
//!
//! Source: Wald, Boulos & Shirley 2007, 'Ray tracing deformable scenes using dynamic bounding volume hierarchies'; Overbeck,
//! Ramamoorthi & Mark 2008, 'Large ray packets for real-time Whitted ray tracing' (ranged traversal).

use super::answer::Answers;
use super::instructions::Instructions;
use super::kernel::STACK;
use super::lanes::{Lanes, Mask};
use super::layout::WideBvh;
use super::node::{Child, WideNode};
use super::pairs::Pairs;
use super::ray_lanes::{RayBounds, RayLanes};
use super::triangles::TriangleBlock;
use core::mem::MaybeUninit;

/// Vectors of a packet, at most.
pub(crate) const VECTORS: usize = 64 / 8;

/// A packet of vectors of rays that [cohere](RayLanes::cohere), all of the same octant.
pub(crate) struct Packet<K: Instructions> {
    vectors: [MaybeUninit<Vector<K::Rays>>; VECTORS],
    count: usize,
    /// A bit per axis along which the rays run backwards.
    octant: u32,
    /// Indices of the planes that the rays meet first, by axis, and of those opposite.
    near: [usize; 3],
    far: [usize; 3],
    bounds: RayBounds<K::Rays>,
}

/// Rays of a packet side by side.
struct Vector<L> {
    /// The distance to a plane is `plane · scale + shift`.
    scale: [L; 3],
    shift: [L; 3],
    t_min: L,
    /// The nearest hits so far, or the ends of the rays and `u32::MAX`.
    t: L,
    object: L,
    /// The rays, and whether `pairs` has been made of them: many packets come to no triangle.
    rays: RayLanes<L>,
    axes: [usize; 3],
    is_sheared: bool,
    pairs: MaybeUninit<Pairs<L>>,
    /// The number of the first ray in its batch.
    first: usize,
}

/// What a child that waits came from.
#[derive(Clone, Copy)]
struct Parent {
    node: u32,
    /// The first vector that entered the node.
    vector: u32,
}

/// The bounds of a packet as its boxes are tested: along each axis the origins that make distances to near planes least and
/// to far ones greatest, and the extreme scales.
struct Culling<L> {
    near_origin: [L; 3],
    far_origin: [L; 3],
    least: [L; 3],
    most: [L; 3],
    begin: L,
    /// What is added to near planes, and subtracted from far ones.
    margin: [f32; 3],
}

impl<K: Instructions> Packet<K> {
    /// No rays.
    ///
    /// # Safety
    /// The processor has the instructions.
    #[inline(always)]
    pub(crate) unsafe fn new() -> Self {
        Self {
            vectors: [const { MaybeUninit::uninit() }; VECTORS],
            count: 0,
            octant: 0,
            near: [0; 3],
            far: [0; 3],
            // SAFETY: the caller's promise.
            bounds: unsafe { RayBounds::none() },
        }
    }

    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Whether rays of this octant can be added.
    #[inline(always)]
    pub(crate) fn takes(&self, octant: u32) -> bool {
        self.count == 0
            || (self.count < VECTORS.min(K::PACKET / K::Rays::N) && self.octant == octant)
    }

    /// Adds rays that cohere, of which the first is number `first` of its batch.
    #[inline(always)]
    pub(crate) fn add(&mut self, rays: RayLanes<K::Rays>, scale: [K::Rays; 3], first: usize) {
        // SAFETY: a value exists.
        let (zero, none) = unsafe { (K::Rays::splat(0.0), K::Rays::splat_bits(u32::MAX)) };
        let [x, y, z] = rays.origin;
        let shift = [zero - x * scale[0], zero - y * scale[1], zero - z * scale[2]];
        self.bounds.add(&rays, &scale);
        self.octant = rays.octant();
        self.vectors[self.count].write(Vector {
            scale,
            shift,
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

    /// Traces the packet, writes its answers, and empties it. Where [`Answers::ANY`] a ray ends at its first hit, which need not
    /// be the nearest.
    ///
    /// # Safety
    /// As of [`trace`](super::batch::trace).
    #[inline(always)]
    pub(crate) unsafe fn trace<A: Answers>(&mut self, wide: &WideBvh, answers: &mut A) {
        // SAFETY: the caller's promises; as many vectors are written as are counted.
        unsafe {
            for axis in 0..3 {
                let backwards = (self.octant >> axis & 1) as usize;
                self.near[axis] = axis + 3 * backwards;
                self.far[axis] = axis + 3 - 3 * backwards;
            }
            let culling = Culling::<K::Boxes>::new(&self.bounds, self.octant, wide.largest);
            if let Some(root) = wide.root {
                self.traverse::<A>(wide, root, &culling);
            }
            for vector in &self.vectors[..self.count] {
                let vector = vector.assume_init_ref();
                answers.write_lanes(vector.first, vector.t, vector.object);
            }
            self.count = 0;
            self.bounds = RayBounds::none();
        }
    }

    #[inline(always)]
    unsafe fn traverse<A: Answers>(
        &mut self,
        wide: &WideBvh,
        root: Child,
        culling: &Culling<K::Boxes>,
    ) {
        // SAFETY: the references of the layout are sound, and its stacks large enough.
        unsafe {
            let nodes = wide.nodes.as_ptr();
            let blocks = wide.blocks.as_ptr();
            let mut farthest = self.bounds.end();
            let mut end = key_of(farthest);
            if !root.is_node() {
                for i in 0..self.count {
                    self.visit_leaf::<A>(i, u32::MAX, blocks.add(root.index()));
                }
                return;
            }
            let mut keys = MaybeUninit::<[u32; STACK + 8]>::uninit();
            let mut parents = MaybeUninit::<[Parent; STACK + 8]>::uninit();
            let keys = keys.as_mut_ptr().cast::<u32>();
            let parents = parents.as_mut_ptr().cast::<Parent>();
            let mut top = 0;
            let mut parent = Parent { node: root.index() as u32, vector: 0 };
            loop {
                let node = &*nodes.add(parent.node as usize);
                let (entry, mask) = self.cull(node, culling, farthest);
                if mask != 0 {
                    if A::ANY {
                        K::compress_keys(entry, mask, keys.add(top));
                    } else {
                        K::sort_keys(entry, mask, keys.add(top));
                    }
                    for i in 0..8 {
                        *parents.add(top + i) = parent;
                    }
                    top += mask.count_ones() as usize;
                }
                parent = loop {
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
                    let planes = self.planes(node, lane, culling);
                    let mut i = waiting.vector as usize;
                    let entered = loop {
                        let entered = self.enter(i, &planes);
                        if entered != 0 || i + 1 == self.count {
                            break entered;
                        }
                        i += 1;
                    };
                    if entered == 0 {
                        continue;
                    }
                    let child = *node.children.get_unchecked(lane);
                    if child.is_node() {
                        break Parent { node: child.index() as u32, vector: i as u32 };
                    }
                    let block = blocks.add(child.index());
                    let mut is_hit = self.visit_leaf::<A>(i, entered, block);
                    for i in i + 1..self.count {
                        let entered = self.enter(i, &planes);
                        if entered != 0 {
                            is_hit |= self.visit_leaf::<A>(i, entered, block);
                        }
                    }
                    if is_hit {
                        farthest = self.farthest();
                        end = key_of(farthest);
                        if A::ANY && farthest < 0.0 {
                            return;
                        }
                    }
                };
            }
        }
    }

    /// The greatest distance at which a ray may still have a nearer hit.
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

    /// The least distance at which any ray may enter each child, and a bit per child that some ray may enter before
    /// `farthest`: the bounds of `(plane − origin) · scale` over all rays.
    #[inline(always)]
    unsafe fn cull(
        &self,
        node: &WideNode,
        culling: &Culling<K::Boxes>,
        farthest: f32,
    ) -> (K::Boxes, u32) {
        // SAFETY: the caller's promises; loads are of whole, aligned planes.
        unsafe {
            let mut entry = culling.begin;
            let mut exit = K::Boxes::splat(farthest);
            for axis in 0..3 {
                let near = K::Boxes::load(node.planes.as_ptr().add(self.near[axis]).cast());
                let near = near - culling.near_origin[axis];
                let near = (near * culling.least[axis]).min(near * culling.most[axis]);
                // Of two zeros the second: entries are never −0.
                entry = near.max(entry);
                let far = K::Boxes::load(node.planes.as_ptr().add(self.far[axis]).cast());
                let far = far - culling.far_origin[axis];
                let far = (far * culling.least[axis]).max(far * culling.most[axis]);
                // Of a NaN and a number the second: unused lanes stay NaN.
                exit = exit.min(far);
            }
            (entry, K::entered(entry, exit))
        }
    }

    /// The planes of the child in a lane, near and far by axis, moved by the margin.
    #[inline(always)]
    unsafe fn planes(
        &self,
        node: &WideNode,
        lane: usize,
        culling: &Culling<K::Boxes>,
    ) -> [[f32; 2]; 3] {
        // SAFETY: planes are six, lanes eight.
        unsafe {
            let lanes = node.planes.as_ptr().cast::<f32>().add(lane);
            let mut planes = [[0.0; 2]; 3];
            for (axis, planes) in planes.iter_mut().enumerate() {
                let margin = culling.margin[axis];
                *planes = [
                    *lanes.add(WideNode::LANES * self.near[axis]) - margin,
                    *lanes.add(WideNode::LANES * self.far[axis]) + margin,
                ];
            }
            planes
        }
    }

    /// A bit per ray of a vector that enters the box of these planes before its nearest hit.
    #[inline(always)]
    unsafe fn enter(&self, vector: usize, planes: &[[f32; 2]; 3]) -> u32 {
        // SAFETY: the caller's promise: the vector is counted.
        unsafe {
            let vector = self
                .vectors
                .get_unchecked(vector)
                .assume_init_ref();
            let mut entry = vector.t_min;
            let mut exit = vector.t;
            for (axis, &[near, far]) in planes.iter().enumerate() {
                let near = K::Rays::splat(near).mul_add(vector.scale[axis], vector.shift[axis]);
                let far = K::Rays::splat(far).mul_add(vector.scale[axis], vector.shift[axis]);
                entry = entry.max(near);
                exit = exit.min(far);
            }
            entry.le(exit).bits()
        }
    }

    /// Tests the triangles of a leaf against those rays of a vector that entered it; whether any has a new nearest hit.
    #[inline(always)]
    unsafe fn visit_leaf<A: Answers>(
        &mut self,
        vector: usize,
        entered: u32,
        block: *const TriangleBlock,
    ) -> bool {
        // SAFETY: the caller's promises; a block that is not its leaf's last is followed by another.
        unsafe {
            let vector = self
                .vectors
                .get_unchecked_mut(vector)
                .assume_init_mut();
            if !vector.is_sheared {
                vector
                    .pairs
                    .write(vector.rays.sheared(vector.axes));
                vector.is_sheared = true;
            }
            let pairs = vector.pairs.assume_init_ref();
            let mut block = block;
            let mut is_hit = false;
            loop {
                for lane in 0..(*block).len() {
                    let corners = (*block).splat_corners::<K::Rays>(lane, vector.axes);
                    let candidates = pairs.candidates(&corners) & entered;
                    if candidates == 0 {
                        continue;
                    }
                    let (inside, t) = pairs.decide(&corners, vector.t);
                    let inside = inside & Mask::from_bits(candidates);
                    let object = K::Rays::splat_bits((*block).id(lane));
                    let hits = if A::ANY {
                        inside
                    } else {
                        t.lt(vector.t) & inside
                            | t.eq(vector.t) & inside & object.below(vector.object)
                    };
                    if hits.bits() != 0 {
                        is_hit = true;
                        // A ray that has its answer ends before it begins.
                        let t = if A::ANY { K::Rays::splat(-1.0) } else { t };
                        vector.t = Lanes::select(hits, t, vector.t);
                        vector.object = Lanes::select(hits, object, vector.object);
                    }
                }
                if (*block).is_last() {
                    return is_hit;
                }
                block = block.add(1);
            }
        }
    }
}

/// The greatest key of a child that a ray may enter before `farthest`.
#[inline(always)]
fn key_of(farthest: f32) -> u32 {
    farthest.to_bits() | 7
}

impl<L: Lanes> Culling<L> {
    #[inline(always)]
    unsafe fn new<R: Lanes>(bounds: &RayBounds<R>, octant: u32, largest: f32) -> Self {
        // SAFETY: the caller's promise.
        unsafe {
            let margin = bounds.margin(largest);
            let zero = L::splat(0.0);
            let mut culling = Self {
                near_origin: [zero; 3],
                far_origin: [zero; 3],
                least: [zero; 3],
                most: [zero; 3],
                begin: L::splat(bounds.begin()),
                margin: [margin; 3],
            };
            for axis in 0..3 {
                let [lowest, highest] = bounds.origins(axis);
                let [least, most] = bounds.scales(axis);
                let is_backwards = octant >> axis & 1 != 0;
                // Distances grow with the plane minus the origin if the scale is positive, else the other way.
                let (near, far) = if is_backwards {
                    culling.margin[axis] = -margin;
                    (lowest - margin, highest + margin)
                } else {
                    (highest + margin, lowest - margin)
                };
                culling.near_origin[axis] = L::splat(near);
                culling.far_origin[axis] = L::splat(far);
                culling.least[axis] = L::splat(least);
                culling.most[axis] = L::splat(most);
            }
            culling
        }
    }
}
