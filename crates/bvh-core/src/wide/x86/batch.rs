//! Batches of rays with AVX-512: packets of sixteen where the rays are coherent, and else many rays in flight.

use super::answer::Answer;
use super::interleaved;
use super::packet::Packet;
use super::prepared::RAYS;
use crate::wide::layout::WideBvh;
use crate::{Coherence, Ray};

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
        // Rays from here on wait to be traced as incoherent ones.
        let mut from = 0;
        for (i, sixteen) in rays.as_chunks::<RAYS>().0.iter().enumerate() {
            if let Some(mut packet) = Packet::new(sixteen, wide.largest) {
                interleaved::trace(wide, &rays[from..i * RAYS], &mut answers[from..i * RAYS]);
                from = (i + 1) * RAYS;
                packet.trace::<A>(wide);
                let (t, object) = packet.hits();
                for (i, answer) in answers[from - RAYS..from].iter_mut().enumerate() {
                    *answer = A::of(t[i], object[i]);
                }
            }
        }
        interleaved::trace(wide, &rays[from..], &mut answers[from..]);
    }
}
