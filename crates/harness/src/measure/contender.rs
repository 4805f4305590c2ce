//! Anything that traces rays and is timed: a layout of one of our trees, or another library's structure.

use super::answers::SOME_HIT;
use bvh_core::{Coherence, Hit, Ray, WideBvh};
use bvh_scenes::trace::{Accelerator, Query};
use std::time::Instant;

/// Rays that are traced together.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// What they ask.
    pub query: Query,
    /// Whether consecutive rays begin close to each other and run the same way.
    pub coherence: Coherence,
    /// Whether the rays go through all pixels of squares of 16 × 16, one square after the other, in Morton order.
    pub in_squares: bool,
    /// The rays.
    pub rays: &'a [Ray],
}

/// Answers rays, the distance and the object of a hit for each (any of both for an any-hit query), and returns the
/// seconds that each [`PART`] of the rays took. An error says why there are no answers.
pub type Trace<'a> = Box<dyn Fn(&Batch, &mut [Option<Hit>]) -> Result<Vec<f64>, String> + 'a>;

/// What traces the rays of a contender.
pub enum Tracer<'a> {
    /// One of ours. Its answers must be right bit by bit, and its tests are counted.
    Own(Accelerator<'a>),
    /// One of ours, batch by batch: packets share tests, which are not counted.
    Batches(WideBvh),
    /// Another library's.
    Other(Trace<'a>),
}

impl Tracer<'_> {
    /// Traces all rays; as [`Trace`].
    pub fn trace(&self, batch: &Batch, hits: &mut [Option<Hit>]) -> Result<Vec<f64>, String> {
        let rays = batch.rays;
        match (self, batch.query) {
            (Self::Other(trace), _) => trace(batch, hits),
            (Self::Own(own), Query::Any) => {
                Ok(timed(rays, hits, |ray| own.any_hit(ray).then_some(SOME_HIT)))
            }
            (Self::Own(own), _) => Ok(timed(rays, hits, |ray| own.nearest_hit(ray))),
            (Self::Batches(wide), _) => Ok(in_batches(wide, batch, hits)),
        }
    }
}

/// A structure that traces rays, and what it is called in tables.
pub struct Contender<'a> {
    /// Name of the layout.
    pub layout: String,
    /// The instruction set that it is held to.
    pub instructions: String,
    /// The version of the library.
    pub version: String,
    /// The time it took to make the layout: of ours from a tree, of another library's from triangles.
    pub preparation_seconds: f64,
    /// What traces.
    pub tracer: Tracer<'a>,
}

impl Contender<'_> {
    /// Whether two contenders of one library have the same layout, held to the same instruction set.
    pub fn is_called_as(&self, other: &Self) -> bool {
        self.layout == other.layout && self.instructions == other.instructions
    }
}

/// Rays whose time is taken together. They are few, so that in some turn no other program interrupts them.
pub const PART: usize = 8192;

/// Answers every ray and returns the seconds that each part of them took.
#[inline(always)]
pub fn timed<R>(
    rays: &[R],
    hits: &mut [Option<Hit>],
    mut answer: impl FnMut(&R) -> Option<Hit>,
) -> Vec<f64> {
    let part = |(rays, hits): (&[R], &mut [Option<Hit>])| {
        let start = Instant::now();
        for (ray, hit) in rays.iter().zip(hits) {
            *hit = answer(ray);
        }
        start.elapsed().as_secs_f64()
    };
    rays.chunks(PART)
        .zip(hits.chunks_mut(PART))
        .map(part)
        .collect()
}

/// Rays that the wide layout is handed at once: their answers stay in the first cache.
const BATCH: usize = 1024;

/// Answers every ray by batches and returns the seconds that each part of them took.
fn in_batches(wide: &WideBvh, batch: &Batch, hits: &mut [Option<Hit>]) -> Vec<f64> {
    let &Batch { query, coherence, rays, .. } = batch;
    let mut nearest = [Hit::MISS; BATCH];
    let mut any = [false; BATCH];
    let mut batch = |(rays, hits): (&[Ray], &mut [Option<Hit>])| {
        let nearest = &mut nearest[..rays.len()];
        let any = &mut any[..rays.len()];
        let start = Instant::now();
        if query == Query::Any {
            wide.any_hits(rays, any, coherence);
        } else {
            wide.nearest_hits(rays, nearest, coherence);
        }
        let seconds = start.elapsed().as_secs_f64();
        for ((hit, nearest), any) in hits.iter_mut().zip(nearest).zip(any) {
            let found = if query == Query::Any { any.then_some(SOME_HIT) } else { Some(*nearest) };
            *hit = found.filter(|hit| !hit.is_miss());
        }
        seconds
    };
    let part = |(rays, hits): (&[Ray], &mut [Option<Hit>])| {
        rays.chunks(BATCH)
            .zip(hits.chunks_mut(BATCH))
            .map(&mut batch)
            .sum()
    };
    rays.chunks(PART)
        .zip(hits.chunks_mut(PART))
        .map(part)
        .collect()
}
