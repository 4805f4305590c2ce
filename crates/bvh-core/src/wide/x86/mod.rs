//! The instruction sets of x86-64.

mod lanes;
#[macro_use]
mod sort;
mod avx2;
mod avx512;

use super::instructions::{Instructions, Task};
use crate::Kernel;
use avx2::Avx2;
use avx512::Avx512;

/// Returns whether this processor can run a kernel.
pub(super) fn has(kernel: Kernel) -> bool {
    match kernel {
        Kernel::Avx2 => has_avx2(),
        Kernel::Avx512 => has_avx512(),
        _ => false,
    }
}

fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("popcnt")
        && is_x86_feature_detected!("lzcnt")
}

fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
}

/// Runs a task with the instructions of a kernel.
///
/// # Safety
/// [`has`] returns true for the kernel.
#[inline(always)]
pub(super) unsafe fn dispatch<T, O>(kernel: Kernel, task: T) -> O
where
    T: Task<Avx2, Output = O> + Task<Avx512, Output = O>,
{
    // SAFETY: the processor has the instructions of the kernel.
    unsafe {
        match kernel {
            Kernel::Avx512 => Avx512::call(task),
            _ => Avx2::call(task),
        }
    }
}
