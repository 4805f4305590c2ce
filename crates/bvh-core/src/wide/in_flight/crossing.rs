//! Rays in flight through instances: a ray that comes to an instance is moved into its part,
//! several rays at a time, and goes on there. A mark on its stack brings it back.

use super::super::instances::Placed;
use super::super::instructions::Instructions;
use super::super::lanes::Lanes;
use super::super::node::Child;
use super::super::prepared::{Prepared, Ready};
use super::super::source::lanes_of_rays;
use super::super::traversal::Traversal;
use super::{Flight, RAYS};
use crate::Ray;
use core::mem::MaybeUninit;

impl<K: Instructions, const ANY: bool, const IN_INSTANCES: bool>
    Flight<'_, '_, K, ANY, IN_INSTANCES>
{
    /// Has every ray at the end of an instance leave it, and every ray at an instance enter it;
    /// writes the answers of rays at their end.
    #[inline(always)]
    pub(super) unsafe fn cross(&mut self, first: usize) {
        let count = self.at_end.count;
        self.at_end.count = 0;
        let mut entering = Entering::none();
        // SAFETY: the caller's promises; every ray is started.
        unsafe {
            for i in 0..count {
                let traversal = &mut *self.at_end.get(i);
                if traversal.child == Child::LEAVE && !traversal.leave_instance(self.wide) {
                    self.finish_alone(first, traversal);
                    continue;
                }
                if traversal.child == Child::END {
                    let (t, instance, object) = traversal.nearest_of_all::<ANY>();
                    let number = first + traversal.ray.number as usize;
                    self.batch.answers.write(number, t, instance, object);
                    self.idle.append(traversal, true);
                    continue;
                }
                if traversal.child.is_instance_or_mark() {
                    let ray = self.batch.rays.ray(first + traversal.ray.number as usize);
                    let instance = traversal.child.instance_index();
                    if let Some(scene) = self.batch.scene
                        && let Some((local_ray, entry)) = scene.enter(instance, &ray, traversal.t)
                    {
                        entering.add(traversal, local_ray, entry);
                        if entering.count == K::Rays::N {
                            self.enter(&mut entering);
                        }
                        continue;
                    }
                    traversal.pop();
                }
                traversal.fetch::<K>(self.placed());
                self.enlist(traversal);
            }
            if entering.count > 0 {
                self.enter(&mut entering);
            }
        }
    }

    /// Has rays enter the instances at which they are.
    #[inline(always)]
    unsafe fn enter(&mut self, entering: &mut Entering) {
        let count = core::mem::replace(&mut entering.count, 0);
        let Some(scene) = self.batch.scene else { return };
        let mut prepared = [const { MaybeUninit::<Prepared>::uninit() }; RAYS];
        // SAFETY: so many rays have been added; there is room for as many as there are lanes.
        unsafe {
            // The last ray fills the lanes that have none.
            for lane in count..K::Rays::N {
                entering.rays[lane] = entering.rays[count - 1];
            }
            let rays = entering.rays.as_ptr().cast::<Ray>();
            let rays = core::slice::from_raw_parts(rays, K::Rays::N);
            let mut far = 0;
            let mut reaches = [0.0; RAYS];
            for (i, ray) in rays.iter().enumerate().take(count) {
                let traversal = &*entering.traversals[i].assume_init();
                let part = scene.part_of(traversal.child.instance_index());
                far |= u32::from(!ray.begins_in(&part.near)) << i;
                reaches[i] = ray.reach(&part.bounds);
            }
            let rays = lanes_of_rays::<K::Rays>(rays, 0);
            let ready = Ready::with_far(rays, K::Rays::load_unaligned(reaches.as_ptr()), far);
            ready.write(0, prepared.as_mut_ptr().cast());
            for (i, prepared) in prepared.iter().enumerate().take(count) {
                let traversal = &mut *entering.traversals[i].assume_init();
                let entry = entering.entries[i].assume_init();
                let part = scene.part_of(traversal.child.instance_index());
                traversal.enter_instance(prepared.assume_init(), entry, part);
                traversal.fetch::<K>(self.placed());
                self.enlist(traversal);
            }
        }
    }

    /// Answers a ray by itself.
    #[cold]
    #[inline(never)]
    unsafe fn finish_alone(&mut self, first: usize, traversal: &mut Traversal) {
        let number = first + traversal.ray.number as usize;
        let ray = self.batch.rays.ray(number);
        self.batch.alone::<ANY>(number, self.wide, &ray);
        // SAFETY: the ray is on no list.
        unsafe { self.idle.append(traversal, true) };
    }

    /// Returns the instances that leaves of the layout name, or none.
    #[inline(always)]
    pub(super) fn placed<'s>(&self) -> &'s [Placed]
    where
        Self: 's,
    {
        match self.batch.scene {
            Some(scene) if IN_INSTANCES => scene.placed(),
            _ => &[],
        }
    }
}

/// Rays that are about to enter instances.
struct Entering {
    traversals: [MaybeUninit<*mut Traversal>; RAYS],
    /// The rays in the coordinates of the instances' parts.
    rays: [MaybeUninit<Ray>; RAYS],
    /// The distances at which the rays enter the instances' boxes.
    entries: [MaybeUninit<f32>; RAYS],
    count: usize,
}

impl Entering {
    /// Returns no rays.
    #[inline(always)]
    fn none() -> Self {
        Self {
            traversals: [MaybeUninit::uninit(); RAYS],
            rays: [MaybeUninit::uninit(); RAYS],
            entries: [MaybeUninit::uninit(); RAYS],
            count: 0,
        }
    }

    /// Adds a ray.
    #[inline(always)]
    fn add(&mut self, traversal: *mut Traversal, local_ray: Ray, entry: f32) {
        self.traversals[self.count].write(traversal);
        self.rays[self.count].write(local_ray);
        self.entries[self.count].write(entry);
        self.count += 1;
    }
}
