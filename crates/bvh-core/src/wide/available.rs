//! Which kernels this processor can run.

use super::kernel::Kernel;
use super::vector;

impl Kernel {
    /// Returns whether this processor can run the kernel.
    pub fn is_available(self) -> bool {
        self == Self::Portable || vector::has(self)
    }

    /// The fastest kernel that this processor can run.
    pub fn best() -> Self {
        Self::ALL.into_iter().find(|kernel| kernel.is_available()).unwrap_or(Self::Portable)
    }
}
