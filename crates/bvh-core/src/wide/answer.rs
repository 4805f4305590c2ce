//! The two questions about a ray: its nearest hit, or whether it has any hit.

use super::instances::{InstanceHit, Instances};
use super::lanes::Lanes;
use super::layout::WideBvh;
use crate::{Hit, Ray};

/// Answers to the rays of a batch, by the number of the ray.
pub(crate) trait Answers {
    /// True if the first hit that is found ends a ray.
    const ANY: bool;
    /// True if [`accepts`](Self::accepts) may reject hits.
    const FILTERS: bool = false;

    /// True if leaves of the layout at whose root rays start are instances of a scene.
    const IN_INSTANCES: bool = false;

    /// Returns the scene of these instances.
    #[inline(always)]
    fn scene(&self) -> Option<&Instances> {
        None
    }

    /// Returns whether a hit of the ray with this number counts.
    #[inline(always)]
    fn accepts(&mut self, number: usize, hit: Hit) -> bool {
        let _ = (number, hit);
        true
    }

    /// Writes the answer for a ray whose traversal ended at this distance with this object, `u32::MAX` for none.
    fn write(&mut self, number: usize, t: f32, object: u32);

    /// Writes the answer for a ray among instances, likewise, with the instance of the object.
    #[inline(always)]
    fn write_instance(&mut self, number: usize, t: f32, instance: u32, object: u32) {
        let _ = instance;
        self.write(number, t, object);
    }

    /// Writes the answers for rays side by side among instances, likewise.
    #[inline(always)]
    fn write_instance_lanes<L: Lanes>(&mut self, first: usize, t: L, instance: L, object: L) {
        const { assert!(L::N <= 16) };
        let mut numbers = [[0.0; 16]; 3];
        // SAFETY: there is room for sixteen.
        unsafe {
            t.store(numbers[0].as_mut_ptr());
            instance.store(numbers[1].as_mut_ptr());
            object.store(numbers[2].as_mut_ptr());
        }
        for lane in 0..L::N {
            let [t, instance, object] = numbers.map(|lanes| lanes[lane]);
            self.write_instance(first + lane, t, instance.to_bits(), object.to_bits());
        }
    }

    /// Writes the answers for rays side by side, likewise.
    #[inline(always)]
    fn write_lanes<L: Lanes>(&mut self, first: usize, t: L, object: L) {
        const { assert!(L::N <= 16) };
        let mut distances = [0.0; 16];
        let mut objects = [0.0; 16];
        // SAFETY: there is room for sixteen.
        unsafe {
            t.store(distances.as_mut_ptr());
            object.store(objects.as_mut_ptr());
        }
        for lane in 0..L::N {
            self.write(first + lane, distances[lane], f32::to_bits(objects[lane]));
        }
    }

    /// Traces one ray by itself, and writes its answer.
    #[inline(always)]
    fn alone(&mut self, number: usize, wide: &WideBvh, ray: &Ray) {
        if Self::ANY {
            self.write(number, 0.0, if wide.any_hit(ray) { 0 } else { u32::MAX });
        } else {
            let Hit { t, object } = wide.nearest_hit(ray).unwrap_or(Hit::MISS);
            self.write(number, t, object);
        }
    }
}

/// The distance of a hit, infinite for none.
#[inline(always)]
fn distance(t: f32, object: u32) -> f32 {
    if object == u32::MAX { f32::INFINITY } else { t }
}

impl Answers for &mut [Hit] {
    const ANY: bool = false;

    #[inline(always)]
    fn write(&mut self, number: usize, t: f32, object: u32) {
        self[number] = Hit { t: distance(t, object), object };
    }
}

impl Answers for &mut [bool] {
    const ANY: bool = true;

    #[inline(always)]
    fn write(&mut self, number: usize, _: f32, object: u32) {
        self[number] = object != u32::MAX;
    }
}

/// Distances and objects in separate slices.
impl Answers for (&mut [f32], &mut [u32]) {
    const ANY: bool = false;

    #[inline(always)]
    fn write(&mut self, number: usize, t: f32, object: u32) {
        self.0[number] = distance(t, object);
        self.1[number] = object;
    }

    #[inline(always)]
    fn write_lanes<L: Lanes>(&mut self, first: usize, t: L, object: L) {
        let distances = &mut self.0[first..][..L::N];
        let objects = &mut self.1[first..][..L::N];
        // SAFETY: values exist; there is room for as many as there are lanes.
        unsafe {
            let none = L::splat_bits(u32::MAX);
            let is_hit = object.below(none);
            L::select(is_hit, t, L::splat(f32::INFINITY)).store(distances.as_mut_ptr());
            object.store(objects.as_mut_ptr().cast());
        }
    }
}

/// Answers from the hits that a function accepts, which also sees the number of the ray.
pub(crate) struct Filtered<'a, A> {
    pub(crate) answers: A,
    // Not generic over the function: a generic kernel would be compiled, perhaps without optimisation,
    // by every crate that calls it.
    pub(crate) accept: &'a mut dyn FnMut(usize, Hit) -> bool,
}

impl<A: Answers> Answers for Filtered<'_, A> {
    const ANY: bool = A::ANY;
    const FILTERS: bool = true;

    #[inline(always)]
    fn accepts(&mut self, number: usize, hit: Hit) -> bool {
        (self.accept)(number, hit)
    }

    #[inline(always)]
    fn write(&mut self, number: usize, t: f32, object: u32) {
        self.answers.write(number, t, object);
    }

    fn alone(&mut self, number: usize, wide: &WideBvh, ray: &Ray) {
        let accept = |hit| (self.accept)(number, hit);
        if Self::ANY {
            let object = if wide.any_hit_where(ray, accept) { 0 } else { u32::MAX };
            self.write(number, 0.0, object);
        } else {
            let hit = wide
                .nearest_hit_where(ray, accept)
                .unwrap_or(Hit::MISS);
            self.write(number, hit.t, hit.object);
        }
    }
}

/// Answers of rays among instances, by the number of the ray.
pub(crate) trait InstanceAnswers {
    /// As [`Answers::ANY`].
    const ANY: bool;

    /// Writes the answer for a ray whose traversal ended at this distance with this object of this
    /// instance, `u32::MAX` for none.
    fn write(&mut self, number: usize, t: f32, instance: u32, object: u32);

    /// Traces one ray by itself, and writes its answer.
    fn alone(&mut self, number: usize, scene: &Instances, ray: &Ray);
}

impl InstanceAnswers for &mut [InstanceHit] {
    const ANY: bool = false;

    #[inline(always)]
    fn write(&mut self, number: usize, t: f32, instance: u32, object: u32) {
        self[number] = InstanceHit { t: distance(t, object), instance, triangle: object };
    }

    fn alone(&mut self, number: usize, scene: &Instances, ray: &Ray) {
        self[number] = scene
            .nearest_hit(ray)
            .unwrap_or(InstanceHit::MISS);
    }
}

impl InstanceAnswers for &mut [bool] {
    const ANY: bool = true;

    #[inline(always)]
    fn write(&mut self, number: usize, _: f32, _: u32, object: u32) {
        self[number] = object != u32::MAX;
    }

    fn alone(&mut self, number: usize, scene: &Instances, ray: &Ray) {
        self[number] = scene.any_hit(ray);
    }
}

/// Answers from the instances of a scene.
pub(crate) struct OfInstances<'a, A> {
    pub(crate) scene: &'a Instances,
    pub(crate) answers: A,
}

impl<A: InstanceAnswers> Answers for OfInstances<'_, A> {
    const ANY: bool = A::ANY;
    const IN_INSTANCES: bool = true;

    #[inline(always)]
    fn scene(&self) -> Option<&Instances> {
        Some(self.scene)
    }

    /// Writes a miss: hits have instances.
    #[inline(always)]
    fn write(&mut self, number: usize, t: f32, object: u32) {
        self.answers.write(number, t, u32::MAX, object);
    }

    #[inline(always)]
    fn write_instance(&mut self, number: usize, t: f32, instance: u32, object: u32) {
        self.answers.write(number, t, instance, object);
    }

    #[inline(always)]
    fn alone(&mut self, number: usize, _: &WideBvh, ray: &Ray) {
        self.answers.alone(number, self.scene, ray);
    }
}
