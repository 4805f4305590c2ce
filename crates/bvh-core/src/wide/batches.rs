//! Batches of rays: one after the other in memory, or by component.

use super::answer::Answers;
use super::coherence::Coherence;
use super::layout::WideBvh;
use super::source::Source;
use super::vector;
use crate::{Hit, Kernel, Ray, RayComponents};

impl WideBvh {
    /// [`nearest_hit`](Self::nearest_hit) of every ray, into as many `hits`; [`Hit::MISS`] for a ray that meets nothing.
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn nearest_hits(&self, rays: &[Ray], mut hits: &mut [Hit], coherence: Coherence) {
        assert_eq!(rays.len(), hits.len(), "a hit for every ray");
        self.trace(rays, &mut hits, coherence);
    }

    /// [`any_hit`](Self::any_hit) of every ray, into as many `hits`.
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn any_hits(&self, rays: &[Ray], mut hits: &mut [bool], coherence: Coherence) {
        assert_eq!(rays.len(), hits.len(), "an answer for every ray");
        self.trace(rays, &mut hits, coherence);
    }

    /// [`nearest_hits`](Self::nearest_hits) of rays by component, whose answers are by component, too: infinite and `u32::MAX` for a ray that
    /// meets nothing.
    ///
    /// # Panics
    /// If `rays`, `distances` and `objects` are not equally many.
    pub fn nearest_hits_by_component(
        &self,
        rays: &RayComponents,
        distances: &mut [f32],
        objects: &mut [u32],
        coherence: Coherence,
    ) {
        assert_eq!(rays.len(), distances.len(), "a distance for every ray");
        assert_eq!(rays.len(), objects.len(), "an object for every ray");
        self.trace(rays, &mut (distances, objects), coherence);
    }

    /// [`any_hits`](Self::any_hits) of rays by component.
    ///
    /// # Panics
    /// If `rays` and `hits` are not equally many.
    pub fn any_hits_by_component(
        &self,
        rays: &RayComponents,
        mut hits: &mut [bool],
        coherence: Coherence,
    ) {
        assert_eq!(rays.len(), hits.len(), "an answer for every ray");
        self.trace(rays, &mut hits, coherence);
    }

    #[inline]
    fn trace<A: Answers>(&self, rays: impl Source, answers: &mut A, coherence: Coherence) {
        if self.kernel != Kernel::Portable {
            // SAFETY: `kernel` is available and `stack_need` small enough, as `choose` saw.
            return unsafe { vector::trace(self, rays, answers, coherence) };
        }
        for number in 0..rays.len() {
            answers.alone(number, self, &rays.ray(number));
        }
    }
}
