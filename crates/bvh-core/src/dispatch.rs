//! Compiles a function a second time for processors with wider vectors, and chooses at run time.

/// Defines `$fast`, which does what the `#[inline(always)]` function `$plain` does, with AVX2 where the processor has
/// it: a [`PackedAabb`](crate::PackedAabb) is then one register, which takes about a third off the time of a build.
/// Same operations in the same order, none fused, hence the same bits. For the crates of this workspace; needs `std`
/// where it is used.
#[doc(hidden)]
#[macro_export]
macro_rules! with_vector_instructions {
    ($(#[$attribute:meta])* $vis:vis $fast:ident = $plain:ident $(<$($generic:ident: $bound:ident),*>)?
        ($($name:ident: $type:ty),* $(,)?) $(-> $result:ty)?) => {
        $(#[$attribute])*
        $vis fn $fast $(<$($generic: $bound),*>)? ($($name: $type),*) $(-> $result)? {
            #[cfg(target_arch = "x86_64")]
            {
                #[target_feature(enable = "avx2")]
                fn vectorised $(<$($generic: $bound),*>)? ($($name: $type),*) $(-> $result)? {
                    $plain($($name),*)
                }
                if is_x86_feature_detected!("avx2") {
                    // SAFETY: the processor has AVX2, checked on the line above.
                    return unsafe { vectorised($($name),*) };
                }
            }
            $plain($($name),*)
        }
    };
}
