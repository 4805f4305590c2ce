//! What may be asked of a ray: its nearest hit, or whether it has any.

use super::avx512::{any_hit, nearest_hit};
use crate::wide::layout::WideBvh;
use crate::{Hit, Ray};

/// The answer to one ray of a batch.
pub(crate) trait Answer: Copy {
    /// Whether the first hit that is found will do.
    const ANY: bool;
    /// The answer for a ray that meets nothing.
    const MISS: Self;

    /// The answer for a ray whose traversal ended at this distance with this object, `u32::MAX` for none.
    fn of(t: f32, object: u32) -> Self;

    /// The answer for one ray by itself.
    ///
    /// # Safety
    /// As [`nearest`](super::one_ray::nearest), with AVX-512.
    unsafe fn alone(wide: &WideBvh, ray: &Ray) -> Self;
}

impl Answer for Hit {
    const ANY: bool = false;
    const MISS: Self = Hit::MISS;

    #[inline(always)]
    fn of(t: f32, object: u32) -> Self {
        Self { t: if object == u32::MAX { f32::INFINITY } else { t }, object }
    }

    #[inline(always)]
    unsafe fn alone(wide: &WideBvh, ray: &Ray) -> Self {
        // SAFETY: the caller's promises.
        let (t, object) = unsafe { nearest_hit(wide, ray) };
        Self::of(t, object)
    }
}

impl Answer for bool {
    const ANY: bool = true;
    const MISS: Self = false;

    #[inline(always)]
    fn of(_: f32, object: u32) -> Self {
        object != u32::MAX
    }

    #[inline(always)]
    unsafe fn alone(wide: &WideBvh, ray: &Ray) -> Self {
        // SAFETY: the caller's promises.
        unsafe { any_hit(wide, ray) }
    }
}
