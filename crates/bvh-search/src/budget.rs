//! When a search must stop, and why it did.

/// Limits in machine-independent units; `None` is no limit. For a limit in seconds, cancel through the
/// [`Observer`](crate::Observer).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields, default)
)]
pub struct Budget {
    /// Most trees or moves to evaluate.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub max_evaluations: Option<u64>,
    /// Most work, in nodes made or visited.
    #[cfg_attr(feature = "serde", serde(skip_serializing_if = "Option::is_none"))]
    pub max_work: Option<u64>,
}

/// Why a search returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum StopReason {
    /// It did all that its configuration asks for.
    Completed,
    /// No tree costs less than its incumbent.
    Optimal,
    /// [`Budget::max_evaluations`] was reached.
    Evaluations,
    /// [`Budget::max_work`] was reached.
    Work,
    /// The observer asked for it.
    Cancelled,
}
