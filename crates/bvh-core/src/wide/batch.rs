//! Batches of rays: packets where the rays are coherent, otherwise many rays in flight.

use super::answer::Batch;
use super::coherence::Coherence;
use super::in_flight;
use super::instructions::Instructions;
use super::lanes::Lanes;
use super::layout::WideBvh;
use super::packet::Packet;
use super::ray_lanes::{RayLanes, prefetch};
use core::ops::Range;

/// The minimum run of rays between packets that is traced in flight rather than ray by ray.
const MANY: usize = 128;

/// Answers all rays: coherent rays in packets, other rays in flight.
///
/// # Safety
/// The processor has the instructions of `K`, and the caller is compiled with them; there is an
/// answer for every ray; the references of `wide` are sound.
#[inline(always)]
pub(crate) unsafe fn trace<K: Instructions, const ANY: bool>(
    wide: &WideBvh,
    batch: &mut Batch,
    coherence: Coherence,
) {
    let rays = batch.rays;
    // SAFETY: the caller's promises.
    unsafe {
        if coherence == Coherence::Incoherent {
            return in_flight::trace::<K, ANY>(wide, batch, 0..rays.len());
        }
        let mut packet = Packet::<K>::new();
        // The rays from `first_of_rest` up to `next` fit no packet, and wait for `rest`.
        let mut first_of_rest = 0;
        let mut next = 0;
        while next + K::Rays::N <= rays.len() {
            prefetch::<K>(rays, next + K::PACKET);
            let lanes = RayLanes::load(rays, next);
            if lanes.cohere(&wide.near) {
                if !packet.takes(lanes.octant()) {
                    packet.trace::<ANY>(wide, batch);
                }
                packet.add(lanes, next);
                rest::<K, ANY>(wide, batch, first_of_rest..next);
                first_of_rest = next + K::Rays::N;
            }
            next += K::Rays::N;
        }
        if !packet.is_empty() {
            packet.trace::<ANY>(wide, batch);
        }
        rest::<K, ANY>(wide, batch, first_of_rest..rays.len());
    }
}

/// Traces the rays between two packets. A few rays at the edge of something are nearly coherent and
/// faster one by one; a long run of them is faster in flight.
#[inline(always)]
unsafe fn rest<K: Instructions, const ANY: bool>(
    wide: &WideBvh,
    batch: &mut Batch,
    numbers: Range<usize>,
) {
    let is_many = numbers.len() >= MANY;
    if is_many {
        // SAFETY: the caller's promises.
        unsafe { in_flight::trace::<K, ANY>(wide, batch, numbers) };
    } else {
        for number in numbers {
            let ray = batch.rays[number];
            batch.alone::<ANY>(number, wide, &ray);
        }
    }
}
