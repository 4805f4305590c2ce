//! A batch of rays: where the rays are, which hits count, and where the answers go.

use super::layout::WideBvh;
use crate::{Hit, Ray};

/// The value of the parameter `ANY` of a traversal that ends a ray at the first hit that is found.
pub(crate) const ANY_HIT: bool = true;

/// The value of `ANY` of a traversal that finds a ray's nearest hit.
pub(crate) const NEAREST_HIT: bool = false;

/// Returns whether a hit of the ray with this number counts.
pub(crate) type Accept<'a> = dyn FnMut(usize, Hit) -> bool + 'a;

/// The place of the answers to the rays of a batch, by the number of the ray.
pub(crate) trait Answers {
    /// Writes the answer for a ray: the distance at which its traversal ended, and the hit object,
    /// `u32::MAX` for none.
    fn write(&mut self, number: usize, t: f32, object: u32);

    /// Writes the answers for consecutive rays from number `first` on, likewise. Slices are equally
    /// long.
    fn write_lanes(&mut self, first: usize, distances: &[f32], objects: &[u32]) {
        for (lane, (&t, &object)) in distances.iter().zip(objects).enumerate() {
            self.write(first + lane, t, object);
        }
    }
}

/// A batch of rays and of their answers.
// Not generic over any of these: each kernel would be compiled once more for every kind of rays and
// of answers. A call through a pointer per ray, or per vector of rays, takes no measurable time.
pub(crate) struct Batch<'a> {
    pub(crate) rays: &'a [Ray],
    pub(crate) answers: &'a mut dyn Answers,
    /// Decides which hits count. Without it all hits count.
    pub(crate) accept: Option<&'a mut Accept<'a>>,
}

impl<'a> Batch<'a> {
    /// Returns a batch whose hits all count.
    #[inline]
    pub(crate) fn new(rays: &'a [Ray], answers: &'a mut dyn Answers) -> Self {
        Self { rays, answers, accept: None }
    }

    /// Traces one ray by itself, and writes its answer. With `ANY` the first hit that is found ends
    /// the ray.
    pub(crate) fn alone<const ANY: bool>(&mut self, number: usize, wide: &WideBvh, ray: &Ray) {
        let any = Hit { t: 0.0, object: 0 };
        let hit = match (&mut self.accept, ANY) {
            (None, false) => wide.nearest_hit(ray),
            (None, true) => wide.any_hit(ray).then_some(any),
            (Some(accept), false) => wide.nearest_hit_where(ray, |hit| accept(number, hit)),
            (Some(accept), true) => {
                wide.any_hit_where(ray, |hit| accept(number, hit)).then_some(any)
            }
        };
        let Hit { t, object } = hit.unwrap_or(Hit::MISS);
        self.answers.write(number, t, object);
    }
}

/// The distance of a hit, infinite for none.
#[inline(always)]
fn distance(t: f32, object: u32) -> f32 {
    if object == u32::MAX { f32::INFINITY } else { t }
}

// Slices have no known size, which a trait object needs, so references to slices are the answers.
impl Answers for &mut [Hit] {
    fn write(&mut self, number: usize, t: f32, object: u32) {
        self[number] = Hit { t: distance(t, object), object };
    }
}

impl Answers for &mut [bool] {
    fn write(&mut self, number: usize, _: f32, object: u32) {
        self[number] = object != u32::MAX;
    }
}
