//! Structures that are timed while they trace rays: layouts of our trees, and other libraries'
//! structures.

use super::answers::SOME_HIT;
use bvh_core::{Coherence, Hit, Ray, WideBvh};
use bvh_scenes::trace::{Accelerator, Query};
use std::time::Instant;

/// Rays that are traced together.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// The question that the rays ask.
    pub query: Query,
    /// Hint that consecutive rays begin close to each other and run in similar directions, or not.
    pub coherence: Coherence,
    /// True if the rays cover the pixels of squares of 16 × 16, square by square, in Morton order.
    pub in_squares: bool,
    /// The rays.
    pub rays: &'a [Ray],
}

/// Writes the distance and the object of each ray's hit (arbitrary ones for an any-hit query), and
/// returns the seconds of each [`PART`] of the rays, or the reason why there are no answers.
pub type Trace<'a> = Box<dyn Fn(&Batch, &mut [Option<Hit>]) -> Result<Vec<f64>, String> + 'a>;

/// The traversal of a contender.
pub enum Tracer<'a> {
    /// A traversal of ours. Its answers must be right bit by bit, and its tests are counted.
    Own(Accelerator<'a>),
    /// A traversal of ours, batch by batch. Packets share tests, so these are not counted.
    Batches(WideBvh),
    /// A traversal of another library.
    Other(Trace<'a>),
}

impl Tracer<'_> {
    /// Traces all rays, as [`Trace`] does.
    pub fn trace(&self, batch: &Batch, hits: &mut [Option<Hit>]) -> Result<Vec<f64>, String> {
        let rays = batch.rays;
        match (self, batch.query) {
            (Self::Other(trace), _) => trace(batch, hits),
            (Self::Own(accelerator), Query::Any) => {
                Ok(timed(rays, hits, |ray| accelerator.any_hit(ray).then_some(SOME_HIT)))
            }
            (Self::Own(accelerator), _) => {
                Ok(timed(rays, hits, |ray| accelerator.nearest_hit(ray)))
            }
            (Self::Batches(wide), _) => {
                Ok(in_batches(batch, hits, |batch, hits| time_batch(wide, batch, hits)))
            }
        }
    }
}

/// A structure that traces rays, and its names in tables.
pub struct Contender<'a> {
    /// Name of the layout.
    pub layout: String,
    /// The instruction set that it is limited to.
    pub instructions: String,
    /// The version of the library.
    pub version: String,
    /// The seconds to make the layout: ours from a tree, another library's from triangles.
    pub preparation_seconds: f64,
    /// The traversal.
    pub tracer: Tracer<'a>,
}

impl Contender<'_> {
    /// Returns true if two contenders of one library have the same layout and instruction set.
    pub fn is_called_as(&self, other: &Self) -> bool {
        self.layout == other.layout && self.instructions == other.instructions
    }
}

/// The number of rays that are timed together. It is small, so that in some turn no other program
/// interrupts them.
pub const PART: usize = 8192;

/// Answers every ray and returns the seconds of each part.
#[inline(always)]
pub fn timed<R>(
    rays: &[R],
    hits: &mut [Option<Hit>],
    mut answer: impl FnMut(&R) -> Option<Hit>,
) -> Vec<f64> {
    let mut seconds = Vec::with_capacity(rays.len().div_ceil(PART));
    for (rays, hits) in rays.chunks(PART).zip(hits.chunks_mut(PART)) {
        let start = Instant::now();
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = answer(ray);
        }
        seconds.push(start.elapsed().as_secs_f64());
    }
    seconds
}

/// The number of rays per call of the wide layout. Their answers fit into the first-level cache.
pub const BATCH: usize = 1024;

/// Answers every ray by calls of up to [`BATCH`] rays, each of which returns its seconds. Returns
/// the seconds of each part.
pub fn in_batches(
    batch: &Batch,
    hits: &mut [Option<Hit>],
    call: impl Fn(&Batch, &mut [Option<Hit>]) -> f64,
) -> Vec<f64> {
    let of_part = |(rays, hits): (&[Ray], &mut [Option<Hit>])| {
        let calls = rays.chunks(BATCH).zip(hits.chunks_mut(BATCH));
        calls.map(|(rays, hits)| call(&Batch { rays, ..*batch }, hits)).sum()
    };
    batch.rays.chunks(PART).zip(hits.chunks_mut(PART)).map(of_part).collect()
}

/// Answers the rays of one call and returns its seconds.
fn time_batch(wide: &WideBvh, batch: &Batch, hits: &mut [Option<Hit>]) -> f64 {
    let &Batch { query, coherence, rays, .. } = batch;
    // Both buffers are on the stack, so that no allocation is timed.
    let mut nearest = [Hit::MISS; BATCH];
    let mut any = [false; BATCH];
    let nearest = &mut nearest[..rays.len()];
    let any = &mut any[..rays.len()];
    let start = Instant::now();
    if query == Query::Any {
        wide.any_hits(rays, any, coherence);
    } else {
        wide.nearest_hits(rays, nearest, coherence);
    }
    let seconds = start.elapsed().as_secs_f64();
    // Conversions are ours, not the layout's, and stay outside the measured time.
    for ((hit, nearest), any) in hits.iter_mut().zip(nearest).zip(any) {
        let found = if query == Query::Any { any.then_some(SOME_HIT) } else { Some(*nearest) };
        *hit = found.filter(|hit| !hit.is_miss());
    }
    seconds
}
