//! Packets whose hits are decided elsewhere: bounds of distances in f32 tell nearly always which hit
//! is a ray's nearest, for all rays of a vector at once.

use super::answer::{Bounded, Find};
use super::instructions::{Instructions, Task};
use super::lanes::{Lanes, Mask};
use super::layout::WideBvh;
use super::packet_vector::{Nearest, Vector};
use super::triangles::TriangleBlock;

/// Tests the triangles of a block with the rays of a vector that entered it. Returns whether any
/// ray has a new nearest hit.
#[inline(always)]
pub(super) unsafe fn bound<K: Instructions, F: Find>(
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
                let bounds = [known.low, known.high].map(|t| nearest.t.filled(t));
                nearest.take(this, bounds, known.object);
            }
        }
        is_hit
    }
}
