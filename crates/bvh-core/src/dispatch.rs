//! A macro that compiles a function a second time for processors with wider vectors, and chooses at
//! run time.

/// Defines the function `$fast`. It runs the `#[inline(always)]` function `$plain`, compiled with
/// AVX2 if the processor has it: a [`PackedAabb`](crate::PackedAabb) is then one register, which
/// makes builds about a third faster. The operations and their order are the same, and none is
/// fused, hence the same bits. The macro is for the crates of this workspace.
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
                    // SAFETY: `vectorised` needs AVX2, and the processor has it by the test above.
                    return unsafe { vectorised($($name),*) };
                }
            }
            $plain($($name),*)
        }
    };
}
