//! A target without vector kernels.

use super::all_in_flight::Found;
use super::answer::Batch;
use super::crossed_leaves::AllHits;
use super::layout::WideBvh;
use super::nearest::Closest;
use super::node::WideNode;
use super::tightness::NodeTest;
use crate::{Coherence, Hit, Kernel, Ray};
use alloc::vec::Vec;
use glam::Vec3;

/// Returns whether this processor can run a kernel other than the portable one: no.
pub(super) fn has(_: Kernel) -> bool {
    false
}

/// Is never called.
pub(super) unsafe fn one_ray<const ANY: bool>(
    _: &WideBvh,
    _: &Ray,
    _: impl FnMut(Hit) -> bool,
) -> Hit {
    Hit::MISS
}

/// Is never called.
pub(super) unsafe fn entered(_: &WideBvh, _: &Ray, _: &WideNode, _: NodeTest) -> u32 {
    0
}

/// Is never called.
pub(super) unsafe fn all_hits(_: &WideBvh, _: &Ray, _: &mut AllHits) {}

/// Is never called.
pub(super) unsafe fn all_hits_of(_: &WideBvh, _: &[Ray], _: &mut Vec<Found>) {}

/// Is never called.
pub(super) unsafe fn closest_points(_: &WideBvh, _: &[Vec3], _: &mut [Option<Closest>]) {}

/// Is never called.
pub(crate) unsafe fn trace<const ANY: bool>(_: &WideBvh, _: &mut Batch, _: Coherence) {}
