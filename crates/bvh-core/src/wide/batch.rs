//! Batches of coherent rays with AVX-512: packets of sixteen where the rays allow it, and else one ray at a time.

use super::avx512::{any_hit, nearest_hit};
use super::layout::WideBvh;
use super::packet::{Packet, RAYS};
use crate::{Hit, Ray};

/// The nearest hits of all rays, in packets where the rays are coherent.
///
/// # Safety
/// As [`nearest_hit`]; `rays` are as many as `hits`.
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
pub(crate) unsafe fn nearest_hits(wide: &WideBvh, rays: &[Ray], hits: &mut [Hit]) {
    // SAFETY: the caller's promises.
    unsafe {
        let (packets, rest) = rays.as_chunks::<RAYS>();
        for (rays, hits) in packets.iter().zip(hits.chunks_exact_mut(RAYS)) {
            if let Some(mut packet) = Packet::new(rays, wide.largest) {
                packet.trace::<false>(wide);
                let (t, object) = packet.hits();
                for (i, hit) in hits.iter_mut().enumerate() {
                    *hit = if object[i] == u32::MAX { Hit::MISS } else { Hit { t: t[i], object: object[i] } };
                }
            } else {
                for (ray, hit) in rays.iter().zip(hits) {
                    let (t, object) = nearest_hit(wide, ray);
                    *hit = if object == u32::MAX { Hit::MISS } else { Hit { t, object } };
                }
            }
        }
        for (ray, hit) in rest.iter().zip(&mut hits[rays.len() - rest.len()..]) {
            let (t, object) = nearest_hit(wide, ray);
            *hit = if object == u32::MAX { Hit::MISS } else { Hit { t, object } };
        }
    }
}

/// Whether each ray meets anything, in packets where the rays are coherent.
///
/// # Safety
/// As [`nearest_hits`].
#[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi1,bmi2,popcnt,lzcnt")]
pub(crate) unsafe fn any_hits(wide: &WideBvh, rays: &[Ray], hits: &mut [bool]) {
    // SAFETY: the caller's promises.
    unsafe {
        let (packets, rest) = rays.as_chunks::<RAYS>();
        for (rays, hits) in packets.iter().zip(hits.chunks_exact_mut(RAYS)) {
            if let Some(mut packet) = Packet::new(rays, wide.largest) {
                packet.trace::<true>(wide);
                let (_, object) = packet.hits();
                (0..RAYS).for_each(|i| hits[i] = object[i] != u32::MAX);
            } else {
                rays.iter().zip(hits).for_each(|(ray, hit)| *hit = any_hit(wide, ray));
            }
        }
        for (ray, hit) in rest.iter().zip(&mut hits[rays.len() - rest.len()..]) {
            *hit = any_hit(wide, ray);
        }
    }
}
