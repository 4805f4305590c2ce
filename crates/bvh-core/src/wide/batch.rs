//! Batches of rays: packets where the rays are coherent, and else many rays in flight.

use super::answer::Answers;
use super::coherence::Coherence;
use super::instructions::Instructions;
use super::lanes::Lanes;
use super::layout::WideBvh;
use super::packet::Packet;
use super::source::Source;
use core::ops::Range;

/// So many rays between packets are traced together.
const MANY: usize = 128;

/// The answers of all rays: of coherent ones in packets, of the others in flight.
///
/// # Safety
/// The processor has the instructions of `K`, and the caller is compiled with them; there is an answer for every ray; the
/// references of `wide` are sound and its `stack_need` is at most [`STACK`](super::kernel::STACK).
#[inline(always)]
pub(crate) unsafe fn trace<K: Instructions, A: Answers>(
    wide: &WideBvh,
    rays: impl Source,
    answers: &mut A,
    coherence: Coherence,
) {
    // SAFETY: the caller's promises.
    unsafe {
        if coherence == Coherence::Incoherent {
            return K::in_flight(wide, rays, answers, 0..rays.len());
        }
        let mut packet = Packet::<K>::new();
        // Rays from here on wait to be traced otherwise.
        let mut from = 0;
        let mut at = 0;
        while at + K::Rays::N <= rays.len() {
            let lanes = rays.lanes::<K::Rays>(at);
            if let Some(scale) = lanes.cohere(wide.largest) {
                if !packet.takes(lanes.octant()) {
                    packet.trace(wide, answers);
                }
                packet.add(lanes, scale, at);
                rest::<K, A>(wide, rays, answers, from..at);
                from = at + K::Rays::N;
            }
            at += K::Rays::N;
        }
        if !packet.is_empty() {
            packet.trace(wide, answers);
        }
        rest::<K, A>(wide, rays, answers, from..rays.len());
    }
}

/// Between packets: a few rays at the edge of something cohere nearly, and are traced one by one; many do not.
#[inline(always)]
unsafe fn rest<K: Instructions, A: Answers>(
    wide: &WideBvh,
    rays: impl Source,
    answers: &mut A,
    numbers: Range<usize>,
) {
    if numbers.len() >= MANY {
        // SAFETY: the caller's promises.
        unsafe { K::in_flight(wide, rays, answers, numbers) };
    } else {
        for number in numbers {
            answers.alone(number, wide, &rays.ray(number));
        }
    }
}
