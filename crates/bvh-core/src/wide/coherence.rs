//! The hint that callers give with a batch of rays.

/// Tells what the rays of a batch have in common. The hint changes no answer, and
/// [`Kernel::Portable`](crate::Kernel::Portable) traces the rays one after the other in any case.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Coherence {
    /// Consecutive rays begin close to each other and run in similar directions, as rays through
    /// neighbouring pixels do, or rays from neighbouring points to a light. Packets of 64 trace
    /// them where they cohere; all other rays are traced as incoherent ones.
    Coherent,
    /// Consecutive rays have little in common. Two dozen rays are in flight, and each advances by a
    /// step in turn, which hides the latency of memory. This pays from a hundred rays on.
    Incoherent,
}
