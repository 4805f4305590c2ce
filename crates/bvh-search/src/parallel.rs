//! Loops over independent tasks, on all threads of the current rayon pool, or on one thread without
//! the feature `rayon`.
//!
//! Results come in the order of the tasks, whichever thread ran them.

/// Maximum number of nodes of all trees that a batch of trials keeps, 1 GB. It decides how often
/// the budget is checked, and affects no result.
pub(crate) const KEPT_NODES: u64 = 1 << 25;

/// Returns the results of the tasks `0..count`. `init` builds a separate state for every thread:
/// buffers that its tasks reuse.
pub(crate) fn map_init<S, T: Send>(
    count: usize,
    init: impl Fn() -> S + Send + Sync,
    task: impl Fn(&mut S, usize) -> T + Send + Sync,
) -> Vec<T> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        (0..count)
            .into_par_iter()
            .map_init(init, task)
            .collect()
    }
    #[cfg(not(feature = "rayon"))]
    {
        let mut state = init();
        (0..count)
            .map(|number| task(&mut state, number))
            .collect()
    }
}

/// Returns the results of a few long tasks. Each may run on another thread.
pub(crate) fn map<I: Send, T: Send>(tasks: Vec<I>, task: impl Fn(I) -> T + Send + Sync) -> Vec<T> {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        tasks
            .into_par_iter()
            .with_max_len(1)
            .map(task)
            .collect()
    }
    #[cfg(not(feature = "rayon"))]
    tasks.into_iter().map(task).collect()
}

/// Calls two functions. Each may run on another thread.
pub(crate) fn call_both(first: &mut (dyn FnMut() + Send), second: &mut (dyn FnMut() + Send)) {
    #[cfg(feature = "rayon")]
    rayon::join(first, second);
    #[cfg(not(feature = "rayon"))]
    {
        first();
        second();
    }
}

/// The number of threads that share the tasks.
pub(crate) fn threads() -> usize {
    #[cfg(feature = "rayon")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "rayon"))]
    1
}
