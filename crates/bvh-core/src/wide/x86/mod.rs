//! The instruction sets of x86-64.

pub(super) mod avx2;
pub(super) mod avx512;
mod lanes;
mod sort;

/// Compiles the kernels with the instructions of one processor. The functions are unsafe for the
/// reasons of those that they call, and because the processor must have the instructions.
macro_rules! entry_points {
    ($instructions:ident, $features:literal) => {
        /// [`one_ray::trace`](crate::wide::one_ray::trace).
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn one_ray<const ANY: bool>(
            wide: &WideBvh,
            ray: &crate::Ray,
            accept: impl FnMut(crate::Hit) -> bool,
        ) -> crate::Hit {
            // SAFETY: this function is compiled with the instructions; the rest is the caller's promise.
            unsafe { crate::wide::one_ray::trace::<$instructions, ANY>(wide, ray, accept) }
        }

        /// [`batch::trace`](crate::wide::batch::trace).
        #[target_feature(enable = $features)]
        pub(crate) unsafe fn trace<A: Answers>(
            wide: &WideBvh,
            rays: impl Source,
            answers: &mut A,
            coherence: crate::Coherence,
        ) {
            // SAFETY: this function is compiled with the instructions; the rest is the caller's promise.
            unsafe { crate::wide::batch::trace::<$instructions, A>(wide, rays, answers, coherence) }
        }

        /// [`in_flight::trace`](crate::wide::in_flight::trace).
        #[target_feature(enable = $features)]
        unsafe fn in_flight<A: Answers>(
            wide: &WideBvh,
            rays: impl Source,
            answers: &mut A,
            numbers: Range<usize>,
        ) {
            // SAFETY: this function is compiled with the instructions; the rest is the caller's promise.
            unsafe {
                crate::wide::in_flight::trace::<$instructions, A>(wide, rays, answers, numbers)
            }
        }
    };
}
use entry_points;

/// What all instruction sets of x86-64 have in common.
macro_rules! common_instructions {
    () => {
        #[inline(always)]
        unsafe fn prefetch(line: *const u8) {
            // SAFETY: a prefetch may name any address.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(line.cast()) }
        }

        #[inline(always)]
        unsafe fn in_flight<A: Answers>(
            wide: &WideBvh,
            rays: impl Source,
            answers: &mut A,
            numbers: Range<usize>,
        ) {
            // SAFETY: the processor has the instructions, and there is an answer for every ray.
            unsafe { in_flight(wide, rays, answers, numbers) }
        }
    };
}
use common_instructions;
