//! Packets of coherent rays. Interval arithmetic culls the children of a node for all rays at once.
//! The vectors of rays test a child that is left one after the other, from the first vector that
//! entered the parent until one enters the child.
//!
//! Source: Wald, Boulos & Shirley 2007, 'Ray tracing deformable scenes using dynamic bounding
//! volume hierarchies'; Overbeck, Ramamoorthi & Mark 2008, 'Large ray packets for real-time Whitted
//! ray tracing' (ranged traversal).

use super::answer::{ANY_HIT, Bounded, Find, NEAREST_HIT};
use super::instructions::{Instructions, Task, lane_of, last_key};
use super::kernel::{SPARE, STACK, deep_stacks};
use super::lanes::{Lanes, Mask};
use super::layout::{Child, WideBvh, WideNode};
use super::packet_vector::{Nearest, Vector};
use super::pinhole::{Seen, one_origin};
use super::ray_lanes::{BoxLanes, RayBounds, RayLanes};
use super::triangles::TriangleBlock;
use crate::each::Each;
use crate::slabs::{FAR, NEAR};
use core::mem::MaybeUninit;
use glam::Vec3;

pub(crate) const RAYS: usize = 128;
const VECTORS: usize = RAYS / 8;

/// A packet of vectors of rays that [cohere](RayLanes::cohere), all of the same octant.
pub(crate) struct Packet<K: Instructions> {
    vectors: [MaybeUninit<Vector<K::Rays>>; VECTORS],
    count: usize,
    /// One bit per axis: set where the rays run backwards.
    octant: u32,
    bounds: RayBounds<K::Rays>,
    /// The origin of all rays, if they have one, while the packet is traced.
    origin: Option<Vec3>,
}

/// The parent of a child that waits.
#[derive(Clone, Copy)]
struct Parent {
    node: u32,
    /// The first vector that entered the node.
    vector: u32,
}

impl<K: Instructions> Packet<K> {
    #[inline(always)]
    pub(crate) unsafe fn new() -> Self {
        Self {
            vectors: [const { MaybeUninit::uninit() }; VECTORS],
            count: 0,
            octant: 0,
            // SAFETY: the processor has the instructions.
            bounds: unsafe { RayBounds::none() },
            origin: None,
        }
    }

    #[inline(always)]
    pub(crate) fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns whether rays of this octant can be added.
    #[inline(always)]
    pub(crate) fn takes(&self, octant: u32) -> bool {
        self.count == 0 || (self.count < RAYS / K::Rays::N && self.octant == octant)
    }

    /// Adds rays that cohere, of which the first is number `first` of its batch.
    #[inline(always)]
    pub(crate) fn add(&mut self, rays: RayLanes<K::Rays>, boxed: BoxLanes<K::Rays>, first: usize) {
        self.bounds.add(&rays, &boxed);
        self.octant = boxed.octant();
        // SAFETY: values of the rays exist.
        self.vectors[self.count].write(unsafe { Vector::new(rays, boxed, first) });
        self.count += 1;
    }

    /// Traces the packet, writes its answers, and empties it.
    #[inline(always)]
    pub(crate) unsafe fn trace<F: Find>(&mut self, wide: &WideBvh, find: &mut F) {
        // SAFETY: the processor has the instructions.
        unsafe { K::call(Trace { packet: self, wide, find }) };
    }

    /// The origin of all rays, if they have one. In a frame, origins that differ may be rounded to
    /// the same one.
    #[inline(always)]
    unsafe fn one_origin<F: Find>(&self, wide: &WideBvh) -> Option<Vec3> {
        if F::ANY || F::DECIDES {
            return None;
        }
        if wide.framed.is_none() {
            return one_origin(&self.bounds, &wide.bounds);
        }
        // SAFETY: the processor has the instructions; as many vectors are written as are counted.
        unsafe {
            let mut bounds = RayBounds::none();
            for vector in &self.vectors[..self.count] {
                let rays = &vector.assume_init_ref().rays;
                let [x, y, z] = rays.direction;
                let one = x.filled(1.0);
                // Sizes, because rays of one octant of the frame may run to both sides of an axis
                // of the file.
                let inverse = [one / x.abs(), one / y.abs(), one / z.abs()];
                bounds.add(rays, &BoxLanes { origin: rays.origin, inverse });
            }
            one_origin(&bounds, &wide.bounds)
        }
    }

    #[inline(always)]
    unsafe fn write<F: Find>(&self, find: &mut F) {
        const { assert!(K::Rays::N <= 16) };
        let mut distances = [0.0; 16];
        let mut objects = [0; 16];
        for vector in &self.vectors[..self.count] {
            // SAFETY: as many vectors are written as are counted; there is room for sixteen lanes.
            let first = unsafe {
                let vector = vector.assume_init_ref();
                vector.nearest.t.store(distances.as_mut_ptr());
                vector.nearest.object.store(objects.as_mut_ptr().cast());
                vector.first
            };
            for (lane, (&t, &object)) in distances.iter().zip(&objects).enumerate().take(K::Rays::N)
            {
                find.write(first + lane, t, object);
            }
        }
    }

    #[inline(always)]
    unsafe fn traverse<F: Find>(
        &mut self,
        wide: &WideBvh,
        find: &mut F,
        root: Child,
        culling: &Culling<K::Boxes>,
    ) {
        // SAFETY: the references of the layout are sound, and its stacks large enough.
        unsafe {
            let nodes = wide.nodes.as_ptr();
            let mut farthest = self.bounds.end();
            let mut end = last_key(farthest);
            let mut keys = MaybeUninit::<[u32; STACK + SPARE]>::uninit();
            let mut parents = MaybeUninit::<[Parent; STACK + SPARE]>::uninit();
            let mut deep_keys = deep_stacks::<u32>(1, wide.stack_need);
            let mut deep_parents = deep_stacks::<Parent>(1, wide.stack_need);
            let keys: *mut u32 = deep_keys
                .as_mut()
                .map_or(keys.as_mut_ptr().cast(), |deep| deep.as_mut_ptr().cast());
            let parents: *mut Parent = deep_parents
                .as_mut()
                .map_or(parents.as_mut_ptr().cast(), |deep| deep.as_mut_ptr().cast());
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
                    let (entries, mask) = culling.cull::<K>(node, farthest);
                    if mask != 0 {
                        if F::ANY {
                            K::compress_keys(entries, mask, keys.add(top));
                        } else {
                            K::sort_keys(entries, mask, keys.add(top));
                        }
                        for i in 0..8 {
                            *parents.add(top + i) = parent;
                        }
                        top += mask.count_ones() as usize;
                        fetch::<K>(wide, node, mask);
                    }
                } else {
                    let block = child.index();
                    if self.visit_leaf(first, entered, &planes, block, wide, find) {
                        farthest = self.farthest();
                        end = last_key(farthest);
                        if F::ANY && farthest < 0.0 {
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
                    let lane = lane_of(key);
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

    #[inline(always)]
    unsafe fn farthest(&self) -> f32 {
        // SAFETY: as many vectors are written as are counted.
        unsafe {
            let mut t = self.vectors[0].assume_init_ref().nearest.t;
            for vector in &self.vectors[1..self.count] {
                t = t.max(vector.assume_init_ref().nearest.t);
            }
            t.greatest()
        }
    }

    /// Returns a bit per ray of a vector that enters the box of these planes before its nearest
    /// hit.
    #[inline(always)]
    unsafe fn enter(&self, vector: usize, planes: &[[f32; 2]; 3]) -> u32 {
        // SAFETY: the vector is counted.
        unsafe {
            let vector = self.vectors.get_unchecked(vector).assume_init_ref();
            let mut entry = vector.t_min;
            let mut exit = vector.nearest.t;
            for (axis, &[near, far]) in planes.iter().enumerate() {
                let origin = vector.box_origin[axis];
                let near = (K::Rays::splat(near) - origin) * vector.near_factor[axis];
                let far = (K::Rays::splat(far) - origin) * vector.far_factor[axis];
                entry = entry.max(near);
                exit = far.min(exit);
            }
            entry.le(exit).bits()
        }
    }

    /// Tests the triangles of a leaf with the rays that enter it. `entered` has a bit per ray of
    /// the vector `first` that enters the box of these planes, and earlier vectors do not enter it.
    /// Returns whether any ray has a new nearest hit.
    #[inline(always)]
    unsafe fn visit_leaf<F: Find>(
        &mut self,
        first: usize,
        entered: u32,
        planes: &[[f32; 2]; 3],
        mut index: usize,
        wide: &WideBvh,
        find: &mut F,
    ) -> bool {
        let mut is_hit = false;
        // SAFETY: the processor has the instructions; the vectors are counted; a block that is not
        // its leaf's last is followed by another.
        unsafe {
            loop {
                let block = &*wide.blocks.as_ptr().add(index);
                let mut seen = None;
                // A closure would be compiled without the instructions wherever it is not inlined.
                if let Some(origin) = self.origin {
                    seen = Some(Seen::new::<K::Block>(block, origin));
                }
                for i in first..self.count {
                    let entered = if i > first { self.enter(i, planes) } else { entered };
                    if entered != 0 {
                        let vector = self.vectors.get_unchecked_mut(i).assume_init_mut();
                        is_hit |= match &seen {
                            _ if F::DECIDES => bound::<K, F>(vector, entered, index, wide, find),
                            Some(seen) => seen.test(vector, entered, block, wide),
                            None if F::ANY => test::<_, ANY_HIT>(vector, entered, block, wide),
                            None => test::<_, NEAREST_HIT>(vector, entered, block, wide),
                        };
                    }
                }
                if block.is_last() {
                    return is_hit;
                }
                index += 1;
            }
        }
    }
}

/// Fetches the beginnings of some children, because the packet comes to most of them soon.
#[inline(always)]
unsafe fn fetch<K: Instructions>(wide: &WideBvh, node: &WideNode, mut mask: u32) {
    while mask != 0 {
        let lane = mask.trailing_zeros() as usize & 7;
        mask &= mask - 1;
        // SAFETY: a prefetch may name any address.
        unsafe {
            K::prefetch_bytes(wide.places().of(node.children[lane]), size_of::<TriangleBlock>())
        };
    }
}

struct Trace<'a, K: Instructions, F> {
    packet: &'a mut Packet<K>,
    wide: &'a WideBvh,
    find: &'a mut F,
}

impl<K: Instructions, F: Find> Task<K> for Trace<'_, K, F> {
    type Output = ();

    #[inline(always)]
    unsafe fn run(self) {
        let Self { packet, wide, find } = self;
        // SAFETY: the processor has the instructions.
        unsafe {
            let culling = Culling::<K::Boxes>::new(&packet.bounds, packet.octant);
            packet.origin = packet.one_origin::<F>(wide);
            if let Some(root) = wide.root {
                packet.traverse(wide, find, root, &culling);
            }
            packet.write(find);
            packet.count = 0;
            packet.bounds = RayBounds::none();
        }
    }
}

/// Tests the triangles of a block with the rays of a vector that entered it. Returns whether any
/// ray has a new nearest hit.
#[inline(always)]
unsafe fn test<L: Lanes, const ANY: bool>(
    vector: &mut Vector<L>,
    entered: u32,
    block: &TriangleBlock,
    wide: &WideBvh,
) -> bool {
    let mut is_hit = false;
    vector.shear(wide);
    // SAFETY: the processor has the instructions of `L`; the vector has been sheared.
    unsafe {
        let pairs = vector.pairs.assume_init_ref();
        for lane in 0..block.len() {
            let corners = block.splat_corners::<L>(lane, vector.axes);
            let mut candidates = pairs.candidates(&corners);
            candidates.crossings.possible &= entered;
            let nearest = &mut vector.nearest;
            if ANY {
                let (possible, sure) = pairs.within(&candidates, nearest.t);
                if sure != 0 {
                    is_hit |= nearest.end(nearest.t.mask(sure), block.id(lane));
                }
                candidates.crossings.possible = possible & !sure;
            }
            let crossings = candidates.crossings;
            if crossings.possible == 0 {
                continue;
            }
            let (inside, t) = pairs.decide(&corners, crossings, nearest.t);
            let inside = inside & t.mask(entered);
            is_hit |= if ANY {
                nearest.end(inside, block.id(lane))
            } else {
                nearest.offer(inside, t, block.id(lane))
            };
        }
    }
    is_hit
}

/// Does the same where hits are decided elsewhere: bounds of distances in f32 tell nearly always which
/// hit is a ray's nearest, for all rays of a vector at once.
#[inline(always)]
unsafe fn bound<K: Instructions, F: Find>(
    vector: &mut Vector<K::Rays>,
    entered: u32,
    index: usize,
    wide: &WideBvh,
    find: &mut F,
) -> bool {
    let mut is_hit = false;
    vector.shear(wide);
    // SAFETY: the processor has the instructions; the vector has been sheared, and there is such a
    // block.
    unsafe {
        let block = wide.blocks.get_unchecked(index);
        let pairs = vector.pairs.assume_init_ref();
        for lane in 0..block.len() {
            let corners = block.splat_corners::<K::Rays>(lane, vector.axes);
            let mut candidates = pairs.candidates(&corners);
            candidates.crossings.possible &= entered;
            if candidates.crossings.possible == 0 {
                continue;
            }
            let nearest = &mut vector.nearest;
            let (possible, certain) = pairs.within(&candidates, nearest.t);
            if possible == 0 {
                continue;
            }
            let (bounds, along) = pairs.distances(&candidates);
            let counted = find.counted(certain, along);
            let taken = if F::ANY {
                is_hit |= F::TAKES_CERTAIN && nearest.end(bounds[0].mask(counted), block.id(lane));
                if F::TAKES_CERTAIN { counted } else { 0 }
            } else {
                let hits = bounds[1].lt(nearest.low) & nearest.t.mask(counted);
                nearest.take(hits, bounds, block.id(lane));
                hits.bits()
            };
            is_hit |= taken != 0;
            let others = possible & !(certain & !counted) & !taken;
            if others != 0 {
                let one = One { pairs: others, certain, along, bounds, lane };
                is_hit |= K::call(Decide { nearest, first: vector.first, block, one, find });
            }
        }
    }
    is_hit
}

/// Pairs of rays and one triangle of a block, with what f32 knows.
struct One<L> {
    pairs: u32,
    certain: u32,
    along: u32,
    bounds: [L; 2],
    lane: usize,
}

/// The decision of pairs that bounds leave open, which are few.
struct Decide<'a, L, F> {
    nearest: &'a mut Nearest<L>,
    /// The number of the first ray.
    first: usize,
    block: &'a TriangleBlock,
    one: One<L>,
    find: &'a mut F,
}

impl<K: Instructions, F: Find> Task<K> for Decide<'_, K::Rays, F> {
    /// Whether any ray has a new nearest hit.
    type Output = bool;

    #[inline(always)]
    unsafe fn run(self) -> bool {
        let Self { nearest, first, block, one, find } = self;
        let mut is_hit = false;
        let mut distances = [[0.0; 16]; 2];
        for (distances, bounds) in distances.iter_mut().zip(one.bounds) {
            // SAFETY: there is room for sixteen lanes.
            unsafe { bounds.store(distances.as_mut_ptr()) };
        }
        let [low, high] = distances;
        let known = nearest.known();
        for ray in (0..K::Rays::N).filter(|ray| one.pairs >> ray & 1 != 0) {
            let bit = |of: u32| (of >> ray & 1) << one.lane;
            let bounded = Bounded {
                low: [low[ray]; TriangleBlock::LANES],
                high: [high[ray]; TriangleBlock::LANES],
                possible: 1 << one.lane,
                certain: bit(one.certain),
                along: bit(one.along),
            };
            let number = first + ray;
            if !F::ANY {
                find.learn(number, known(ray));
            }
            // SAFETY: the processor has the instructions; the block is one of the layout.
            let Some(hit) = (unsafe { find.decide::<K>(number, block, &bounded) }) else {
                continue;
            };
            is_hit = true;
            let this = nearest.t.mask(1 << ray);
            if F::ANY {
                nearest.end(this, hit.object);
            } else {
                let known = find.known(number);
                let bounds = [known.low, known.high].each(|t| nearest.t.filled(t));
                nearest.take(this, bounds, known.object);
            }
        }
        is_hit
    }
}

/// The bounds of a packet as boxes are tested with them: along each axis the origins for which the
/// distances to near planes are least and to far planes greatest, and the extreme scales.
pub(super) struct Culling<L> {
    /// The indices of the planes that the rays meet first, by axis, and of the planes opposite.
    near: [usize; 3],
    far: [usize; 3],
    near_origin: [L; 3],
    far_origin: [L; 3],
    /// The extreme factors of near and of far planes, the one of the lesser size first.
    near_factors: [[L; 2]; 3],
    far_factors: [[L; 2]; 3],
    begin: L,
    side: [f32; 3],
}

impl<L: Lanes> Culling<L> {
    #[inline(always)]
    pub(super) unsafe fn new<R: Lanes>(bounds: &RayBounds<R>, octant: u32) -> Self {
        // SAFETY: the processor has the instructions.
        unsafe {
            let zero = L::splat(0.0);
            let mut culling = Self {
                near: [0; 3],
                far: [0; 3],
                near_origin: [zero; 3],
                far_origin: [zero; 3],
                near_factors: [[zero; 2]; 3],
                far_factors: [[zero; 2]; 3],
                begin: L::splat(bounds.begin()),
                side: [1.0; 3],
            };
            for axis in 0..3 {
                let [lowest, highest] = bounds.origins(axis);
                let [least, most] = bounds.inverses(axis);
                let is_backwards = octant >> axis & 1 != 0;
                culling.near[axis] = axis + 3 * usize::from(is_backwards);
                culling.far[axis] = axis + 3 * usize::from(!is_backwards);
                // Distances grow with the plane minus the origin if the scale is positive, else the
                // other way.
                let (near, far) = if is_backwards {
                    culling.side[axis] = -1.0;
                    (lowest, highest)
                } else {
                    (highest, lowest)
                };
                culling.near_origin[axis] = L::splat(near);
                culling.far_origin[axis] = L::splat(far);
                // An infinite factor must be the second: `cull` has NaN from it, not a number.
                let (small, large) = if is_backwards { (most, least) } else { (least, most) };
                culling.near_factors[axis] = [L::splat(small * NEAR), L::splat(large * NEAR)];
                culling.far_factors[axis] = [L::splat(small * FAR), L::splat(large * FAR)];
            }
            culling
        }
    }

    /// Returns the [keys](super::instructions::Pending) of the children that some ray may enter by
    /// `farthest`, by the least distance of all rays, and a bit for each of them: the bounds of
    /// `(plane − origin) · scale` over all rays.
    #[inline(always)]
    pub(super) unsafe fn cull<K: Instructions<Boxes = L>>(
        &self,
        node: &WideNode,
        farthest: f32,
    ) -> (L, u32) {
        // SAFETY: planes are whole and aligned.
        unsafe {
            let mut entry = self.begin;
            let mut exit = L::splat(farthest);
            for axis in 0..3 {
                let near = L::load(node.planes.as_ptr().add(self.near[axis]).cast());
                let near = near - self.near_origin[axis];
                let [small, large] = self.near_factors[axis];
                let near = (near * small).min(near * large);
                // `max` returns the second of two zeros: entries are never −0.
                entry = near.max(entry);
                let far = L::load(node.planes.as_ptr().add(self.far[axis]).cast());
                let far = far - self.far_origin[axis];
                let [small, large] = self.far_factors[axis];
                let far = (far * small).max(far * large);
                // `min` returns the second of a NaN and a number.
                exit = far.min(exit);
            }
            K::keys(entry, entry.le(exit))
        }
    }

    /// Returns the planes of a box that contains everything, by axis.
    #[inline(always)]
    pub(super) fn all_space(&self) -> [[f32; 2]; 3] {
        let far = self.side.each(|side| f32::INFINITY.copysign(side));
        [[-far[0], far[0]], [-far[1], far[1]], [-far[2], far[2]]]
    }

    /// Returns the near and the far plane of the child in a lane, by axis.
    ///
    /// # Safety
    /// There is such a lane.
    #[inline(always)]
    pub(super) unsafe fn planes(&self, node: &WideNode, lane: usize) -> [[f32; 2]; 3] {
        // SAFETY: there are six planes of eight lanes.
        unsafe {
            let lanes = node.planes.as_ptr().cast::<f32>().add(lane);
            let mut planes = [[0.0; 2]; 3];
            for (axis, planes) in planes.iter_mut().enumerate() {
                *planes = [
                    *lanes.add(WideNode::LANES * self.near[axis]),
                    *lanes.add(WideNode::LANES * self.far[axis]),
                ];
            }
            planes
        }
    }
}
