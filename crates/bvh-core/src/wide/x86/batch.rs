//! Batches of rays with AVX-512: packets of sixteen where the rays are coherent, and else many rays in flight.

use super::answer::Answer;
use super::interleaved;
use super::packet::Packet;
use super::prepared::{RAYS, Sixteen};
use crate::wide::layout::WideBvh;
use crate::{Coherence, Ray};

/// So many rays between packets are traced together.
const MANY: usize = 8 * RAYS;

/// The answers of all rays.
///
/// # Safety
/// As [`nearest`](super::one_ray::nearest), with AVX-512; `rays` are as many as `answers`.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
pub(crate) unsafe fn trace<A: Answer>(wide: &WideBvh, rays: &[Ray], answers: &mut [A], coherence: Coherence) {
    // SAFETY: the caller's promises.
    unsafe {
        if coherence == Coherence::Incoherent {
            return interleaved::trace(wide, rays, answers);
        }
        // Rays from here on wait to be traced otherwise.
        let mut from = 0;
        for (i, sixteen) in rays.as_chunks::<RAYS>().0.iter().enumerate() {
            let sixteen = Sixteen::new(sixteen, wide.largest);
            if sixteen.cohere() {
                rest(wide, &rays[from..i * RAYS], &mut answers[from..i * RAYS]);
                from = (i + 1) * RAYS;
                let mut packet = Packet::new(&sixteen);
                packet.trace::<A>(wide);
                let (t, object) = packet.hits();
                for (i, answer) in answers[from - RAYS..from].iter_mut().enumerate() {
                    *answer = A::of(t[i], object[i]);
                }
            }
        }
        rest(wide, &rays[from..], &mut answers[from..]);
    }
}

/// Between packets: a few rays at the edge of something cohere nearly, and are traced one by one; many do not.
#[inline(always)]
unsafe fn rest<A: Answer>(wide: &WideBvh, rays: &[Ray], answers: &mut [A]) {
    // SAFETY: the caller's promises.
    unsafe {
        if rays.len() >= MANY {
            interleaved::trace(wide, rays, answers);
        } else {
            for (ray, answer) in rays.iter().zip(answers) {
                *answer = A::alone(wide, ray);
            }
        }
    }
}
