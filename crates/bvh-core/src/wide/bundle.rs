//! Bundles: up to 128 rays that go through the tree together.
//!
//! What bounds the rays of a vector rules out children of a node, eight at once. Then the rays of the
//! vectors that are left are tested against each child's box, eight rays or more at once.

use super::instructions::{Instructions, Pending, lane_of};
use super::lanes::Lanes;
use super::layout::{Child, WideNode};
use super::obstacles::Obstacles;
use super::triangles::TriangleBlock;
use core::mem::MaybeUninit;

/// The maximum number of vectors.
pub(super) const VECTORS: usize = 8;

/// The maximum number of rays of a vector.
pub(super) const LANES: usize = 16;

/// The maximum number of rays.
pub(crate) const RAYS: usize = VECTORS * LANES;

/// The number of inner children that rays enter untested if they are a node's only ones.
const FEW: u32 = 2;

/// What rays have in common, and so how they are tested.
pub(super) trait Shape<K: Instructions, O: Obstacles> {
    /// What bounds the rays that enter the children of a node.
    type Outline;
    /// The same in memory.
    type Rows;
    /// What bounds the rays that enter one child.
    type Child;
    /// The triangles of a block, as these rays see them.
    type Shadows;

    unsafe fn outline(&self, node: &WideNode) -> Self::Outline;

    /// Returns a bit for each child that any ray may enter, and the keys of these children if the
    /// nearest is visited first.
    unsafe fn all(&self, outline: &Self::Outline) -> (u32, Option<K::Boxes>);

    /// Returns a bit for each child that a ray of a vector may enter.
    unsafe fn vector(&self, outline: &Self::Outline, vector: usize) -> u32;

    unsafe fn write(&self, outline: &Self::Outline, rows: *mut Self::Rows);

    unsafe fn child(&self, rows: &Self::Rows, lane: usize) -> Self::Child;

    /// Returns a bit for each ray of a vector that enters a child.
    unsafe fn rays(&self, child: &Self::Child, vector: usize) -> u32;

    unsafe fn shadows(&self, block: &TriangleBlock) -> Self::Shadows;

    /// Returns a bit for each of some rays of a vector that the triangle in a lane certainly stops,
    /// and for each that it may stop.
    unsafe fn test(
        &self,
        shadows: &Self::Shadows,
        lane: usize,
        vector: usize,
        rays: u32,
    ) -> (u32, u32);

    /// A ray by its number.
    fn ray(&self, number: usize) -> O::Ray;
}

/// The state of rays on their way through a tree.
pub(super) struct Bundle<'a, O> {
    obstacles: &'a O,
    /// A bit for each ray that nothing has stopped, and for each vector that has one.
    live: [u32; VECTORS],
    alive: u32,
    /// A bit for each ray that enters the box of the leaf being visited, of the vectors that do.
    entered: [u32; VECTORS],
    /// What was done, about in cycles.
    pub(super) work: u64,
    /// Whether every ray is tested against the boxes of inner nodes, how many of those were, and
    /// how many no ray enters.
    pub(super) is_strict: bool,
    pub(super) tested: u32,
    pub(super) pruned: u32,
}

impl<'a, O: Obstacles> Bundle<'a, O> {
    pub(super) fn new(obstacles: &'a O) -> Self {
        Self {
            obstacles,
            live: [0; VECTORS],
            alive: 0,
            entered: [0; VECTORS],
            work: 0,
            is_strict: true,
            tested: 0,
            pruned: 0,
        }
    }

    /// Traces the rays of these numbers, and returns a bit for each that nothing stops.
    ///
    /// # Safety
    /// From `base` on there is room for a stack.
    #[inline(always)]
    pub(super) unsafe fn trace<K: Instructions>(
        &mut self,
        shape: &impl Shape<K, O>,
        rays: u128,
        base: *mut Pending,
    ) -> u128 {
        self.alive = 0;
        for vector in 0..VECTORS {
            let rays = (rays >> (vector * K::Rays::N)) as u32 & (u32::MAX >> (32 - K::Rays::N));
            self.live[vector] = rays;
            self.alive |= u32::from(rays != 0) << vector;
        }
        if let Some(root) = self.obstacles.boxes().root
            && self.alive != 0
        {
            // SAFETY: the processor has the instructions, and the stack has room.
            unsafe { self.traverse(shape, root, base) };
        }
        (0..VECTORS).map(|vector| u128::from(self.live[vector]) << (vector * K::Rays::N)).sum()
    }

    /// Visits what the rays enter below a child.
    #[inline(always)]
    unsafe fn traverse<K: Instructions, S: Shape<K, O>>(
        &mut self,
        shape: &S,
        root: Child,
        base: *mut Pending,
    ) {
        let wide = self.obstacles.boxes();
        // SAFETY: the processor has the instructions; references are sound, and the stack has room.
        unsafe {
            let mut top = base;
            let mut child = root;
            let mut vectors = self.alive;
            if !child.is_node() {
                self.entered = self.live;
                self.visit_leaf(shape, child.index(), vectors);
                return;
            }
            loop {
                let node = &*wide.nodes.as_ptr().add(child.index());
                let outline = shape.outline(node);
                self.work += 20;
                let (mut inner, keys) = shape.all(&outline);
                let is_leaf = K::Boxes::load(node.children.as_ptr().cast()).signs();
                // Near the root a few children are all that most rays enter.
                let is_open = inner & is_leaf == 0
                    && inner.count_ones() <= FEW
                    && 2 * vectors.count_ones() > self.alive.count_ones();
                let mut entering = Entering(0);
                let mut rows = MaybeUninit::<S::Rows>::uninit();
                if !is_open {
                    let any;
                    (entering, any) = self.enter_children(shape, &outline, vectors);
                    // Rounding may let one vector into a box that all together do not enter, which
                    // has no key.
                    inner &= any;
                    shape.write(&outline, rows.as_mut_ptr());
                    let mut leaves = inner & is_leaf;
                    inner &= !is_leaf;
                    while leaves != 0 {
                        let lane = leaves.trailing_zeros() as usize & 7;
                        leaves &= leaves - 1;
                        let entered =
                            self.enter(shape, rows.assume_init_ref(), lane, entering.of(lane));
                        let leaf = node.children.get_unchecked(lane).index();
                        if entered != 0 && self.visit_leaf(shape, leaf, entered) {
                            return;
                        }
                    }
                }
                let mut order = MaybeUninit::<[u32; 16]>::uninit();
                let order: *mut u32 = order.as_mut_ptr().cast();
                if let Some(keys) = keys {
                    let keys = K::Boxes::select(keys.mask(inner), keys, keys.filled(0.0));
                    K::sort_keys(keys, inner, order);
                }
                for place in 0..inner.count_ones() as usize {
                    let lane = match keys {
                        Some(_) => lane_of(*order.add(place)),
                        None => inner.trailing_zeros() as usize & 7,
                    };
                    inner &= inner.wrapping_sub(1);
                    let mut entered = vectors;
                    if !is_open {
                        entered = entering.of(lane) & self.alive;
                        if self.is_strict {
                            entered = self.enter(shape, rows.assume_init_ref(), lane, entered);
                            self.tested += 1;
                            self.pruned += u32::from(entered == 0);
                        }
                    }
                    let child = node.children.get_unchecked(lane).bits();
                    *top = u64::from(child) | u64::from(entered) << 32;
                    top = top.add(usize::from(entered != 0));
                }
                loop {
                    if top == base {
                        return;
                    }
                    top = top.sub(1);
                    child = Child::from_bits(*top as u32);
                    vectors = (*top >> 32) as u32 & self.alive;
                    if vectors != 0 {
                        break;
                    }
                }
            }
        }
    }

    /// Returns which of some vectors have rays that may enter the children of a node, and a bit for
    /// each child that any may enter.
    #[inline(always)]
    unsafe fn enter_children<K: Instructions, S: Shape<K, O>>(
        &mut self,
        shape: &S,
        outline: &S::Outline,
        mut vectors: u32,
    ) -> (Entering, u32) {
        let mut entering = Entering(0);
        let mut any = 0;
        self.work += 10 * u64::from(vectors.count_ones());
        while vectors != 0 {
            let vector = vectors.trailing_zeros() as usize % VECTORS;
            vectors &= vectors - 1;
            // SAFETY: the processor has the instructions.
            let mask = unsafe { shape.vector(outline, vector) };
            entering.0 |= u64::from(mask) << (8 * vector);
            any |= mask;
        }
        (entering, any)
    }

    /// Returns which of some vectors have live rays that enter the box of a node's child, and notes
    /// these rays.
    #[inline(always)]
    unsafe fn enter<K: Instructions, S: Shape<K, O>>(
        &mut self,
        shape: &S,
        rows: &S::Rows,
        lane: usize,
        mut vectors: u32,
    ) -> u32 {
        let mut entered = 0;
        self.work += 15 * u64::from(vectors.count_ones());
        // SAFETY: the processor has the instructions; there are eight lanes.
        unsafe {
            let child = shape.child(rows, lane);
            while vectors != 0 {
                let vector = vectors.trailing_zeros() as usize % VECTORS;
                vectors &= vectors - 1;
                let rays = shape.rays(&child, vector) & self.live[vector];
                self.entered[vector] = rays;
                entered |= u32::from(rays != 0) << vector;
            }
        }
        entered
    }

    /// Tests the triangles of a leaf with the rays of some vectors that enter it. Returns whether all
    /// rays are stopped.
    #[inline(always)]
    unsafe fn visit_leaf<K: Instructions>(
        &mut self,
        shape: &impl Shape<K, O>,
        mut index: usize,
        vectors: u32,
    ) -> bool {
        let wide = self.obstacles.boxes();
        // SAFETY: a block that is not its leaf's last is followed by another.
        unsafe {
            loop {
                let block = &*wide.blocks.as_ptr().add(index);
                if self.visit(shape, block, vectors) {
                    return true;
                }
                if block.is_last() {
                    return false;
                }
                index += 1;
            }
        }
    }

    /// Tests the triangles of a block. Returns whether all rays are stopped.
    #[inline(always)]
    unsafe fn visit<K: Instructions>(
        &mut self,
        shape: &impl Shape<K, O>,
        block: &TriangleBlock,
        vectors: u32,
    ) -> bool {
        // SAFETY: the processor has the instructions.
        unsafe {
            let shadows = shape.shadows(block);
            self.work += 100;
            for lane in 0..block.len() {
                let mut left = vectors;
                while left != 0 {
                    let vector = left.trailing_zeros() as usize % VECTORS;
                    left &= left - 1;
                    let rays = self.entered[vector];
                    if rays == 0 {
                        continue;
                    }
                    self.work += 20;
                    let (mut stopped, mut open) = shape.test(&shadows, lane, vector, rays);
                    while open != 0 {
                        let ray = shape.ray(vector * K::Rays::N + open.trailing_zeros() as usize);
                        let is_stopped = self.obstacles.stops(&ray, block, lane);
                        stopped |= u32::from(is_stopped) << open.trailing_zeros();
                        open &= open - 1;
                    }
                    self.entered[vector] &= !stopped;
                    self.live[vector] &= !stopped;
                    self.alive &= !(u32::from(self.live[vector] == 0) << vector);
                }
            }
        }
        self.alive == 0
    }
}

/// A byte for each vector with a bit for each child of a node that its rays may enter.
struct Entering(u64);

impl Entering {
    /// Returns a bit for each vector whose rays may enter a child.
    #[inline(always)]
    fn of(&self, child: usize) -> u32 {
        // Moves the lowest bit of byte i to bit 56 + i.
        let lowest = (self.0 >> child) & 0x0101_0101_0101_0101;
        (lowest.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
    }
}

/// Coefficients of four triangles, lane by lane.
pub(super) struct Coefficients<const ROWS: usize>(pub(super) [[f32; 4]; ROWS]);

impl<const ROWS: usize> Coefficients<ROWS> {
    /// # Safety
    /// There is such a row, and the lane is one of four.
    #[inline(always)]
    pub(super) unsafe fn number(&self, row: usize, lane: usize) -> f32 {
        // SAFETY: they exist.
        unsafe { *self.0.get_unchecked(row).get_unchecked(lane) }
    }
}

/// Writes three coefficients with flipped signs as rows of four, and returns their sizes.
///
/// # Safety
/// The processor has the instructions of `L`, which has four lanes; there is room for three rows.
#[inline(always)]
pub(super) unsafe fn store_three<L: Lanes>(
    [x, y, z]: [L::Double; 3],
    flip: L,
    to: *mut f32,
) -> [L; 3] {
    let [x, y, z] = [L::single(x), L::single(y), L::single(z)];
    // SAFETY: the caller's.
    unsafe {
        (x ^ flip).store(to);
        (y ^ flip).store(to.add(4));
        (z ^ flip).store(to.add(8));
    }
    [x.abs(), y.abs(), z.abs()]
}
