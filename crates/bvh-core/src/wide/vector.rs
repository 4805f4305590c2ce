//! A target without vector kernels.

use super::kernel::Kernel;

/// Returns whether this processor can run a kernel other than the portable one: no.
pub(super) fn has(_: Kernel) -> bool {
    false
}

/// Is never called.
pub(super) unsafe fn dispatch<T, O>(_: Kernel, _: T) -> O {
    unreachable!("no layout has a vector kernel")
}
