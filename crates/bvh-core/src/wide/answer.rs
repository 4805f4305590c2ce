//! A batch of rays: where the rays are, which hits count, and where the answers go.

use super::instances::{InstanceHit, Instances};
use super::layout::WideBvh;
use super::source::Source;
use crate::{Hit, Ray};

/// The value of the parameter `ANY` of a traversal that ends a ray at the first hit that is found.
pub(crate) const ANY_HIT: bool = true;

/// The value of `ANY` of a traversal that finds a ray's nearest hit.
pub(crate) const NEAREST_HIT: bool = false;

/// Returns whether a hit of the ray with this number counts.
pub(crate) type Accept<'a> = dyn FnMut(usize, Hit) -> bool + 'a;

/// The place of the answers to the rays of a batch, by the number of the ray.
pub(crate) trait Answers {
    /// Writes the answer for a ray: the distance at which its traversal ended, and the hit object
    /// with the instance of this object, `u32::MAX` for none.
    fn write(&mut self, number: usize, t: f32, instance: u32, object: u32);

    /// Writes the answers for consecutive rays from number `first` on, likewise. Slices are equally
    /// long.
    fn write_lanes(&mut self, first: usize, distances: &[f32], instances: &[u32], objects: &[u32]) {
        let lanes = distances.iter().zip(instances.iter().zip(objects));
        for (lane, (&t, (&instance, &object))) in lanes.enumerate() {
            self.write(first + lane, t, instance, object);
        }
    }
}

/// A batch of rays and of their answers.
// Not generic over any of these: each kernel would be compiled once more for every kind of rays and
// of answers. A call through a pointer per ray, or per vector of rays, takes no measurable time.
pub(crate) struct Batch<'a> {
    pub(crate) rays: Source<'a>,
    pub(crate) answers: &'a mut dyn Answers,
    /// Decides which hits count. Without it all hits count, and hits in instances always do.
    pub(crate) accept: Option<&'a mut Accept<'a>>,
    /// The scene whose instances are the leaves of the traced layout; `None` if its leaves are
    /// triangles.
    pub(crate) scene: Option<&'a Instances>,
}

impl<'a> Batch<'a> {
    /// Returns a batch whose hits all count, in a layout whose leaves are triangles.
    #[inline]
    pub(crate) fn new(rays: Source<'a>, answers: &'a mut dyn Answers) -> Self {
        Self { rays, answers, accept: None, scene: None }
    }

    /// Returns a batch whose hits all count, in the layout of a scene's tree over instances.
    #[inline]
    pub(crate) fn through_instances(
        scene: &'a Instances,
        rays: &'a [Ray],
        answers: &'a mut dyn Answers,
    ) -> Self {
        Self { rays: Source::Rays(rays), answers, accept: None, scene: Some(scene) }
    }

    /// Traces one ray by itself, and writes its answer. With `ANY` the first hit that is found ends
    /// the ray.
    pub(crate) fn alone<const ANY: bool>(&mut self, number: usize, wide: &WideBvh, ray: &Ray) {
        if let Some(scene) = self.scene {
            let hit = if ANY {
                scene.any_hit(ray).then_some(InstanceHit { t: 0.0, instance: 0, triangle: 0 })
            } else {
                scene.nearest_hit(ray)
            };
            let InstanceHit { t, instance, triangle } = hit.unwrap_or(InstanceHit::MISS);
            return self.answers.write(number, t, instance, triangle);
        }
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
        self.answers.write(number, t, u32::MAX, object);
    }
}

/// The distance of a hit, infinite for none.
#[inline(always)]
fn distance(t: f32, object: u32) -> f32 {
    if object == u32::MAX { f32::INFINITY } else { t }
}

// Slices have no known size, which a trait object needs, so references to slices are the answers.
impl Answers for &mut [Hit] {
    fn write(&mut self, number: usize, t: f32, _: u32, object: u32) {
        self[number] = Hit { t: distance(t, object), object };
    }
}

impl Answers for &mut [bool] {
    fn write(&mut self, number: usize, _: f32, _: u32, object: u32) {
        self[number] = object != u32::MAX;
    }
}

/// Distances and objects in separate slices.
impl Answers for (&mut [f32], &mut [u32]) {
    fn write(&mut self, number: usize, t: f32, _: u32, object: u32) {
        self.0[number] = distance(t, object);
        self.1[number] = object;
    }
}

impl Answers for &mut [InstanceHit] {
    fn write(&mut self, number: usize, t: f32, instance: u32, object: u32) {
        self[number] = InstanceHit { t: distance(t, object), instance, triangle: object };
    }
}
