//! Loops over independent tasks, on all threads of the current rayon pool, or on one thread without
//! the feature `rayon`.
//!
//! Results come in the order of the tasks, whichever thread ran them.

use std::sync::{Mutex, MutexGuard, PoisonError};

/// Maximum number of nodes of all trees that a batch of trials keeps, 1 GB. It decides how often
/// the budget is checked, and affects no result.
pub(crate) const KEPT_NODES: u64 = 1 << 25;

/// Returns the results of the tasks `0..count`. `init` builds a separate state for every thread:
/// buffers that its tasks reuse. For long tasks: all threads share a list of idle states.
pub(crate) fn map_init<S: Send, T: Send>(
    count: usize,
    init: impl Fn() -> S + Sync,
    task: impl Fn(&mut S, usize) -> T + Sync,
) -> Vec<T> {
    let idle = Mutex::new(vec![]);
    collect(count, usize::MAX, |number| {
        let reused = lock(&idle).pop();
        let mut state = reused.unwrap_or_else(&init);
        let result = task(&mut state, number);
        lock(&idle).push(state);
        result
    })
}

/// Returns the results of a few long tasks. Each may run on another thread.
pub(crate) fn map<I: Send, T: Send>(tasks: Vec<I>, task: impl Fn(I) -> T + Sync) -> Vec<T> {
    let inputs = slots(tasks.into_iter().map(Some));
    collect(inputs.len(), 1, |number| lock(&inputs[number]).take().map(&task))
        .into_iter()
        .flatten()
        .collect()
}

/// Returns the results of the tasks `0..count`, at most `most` of them in one piece of work.
fn collect<T: Send>(count: usize, most: usize, task: impl Fn(usize) -> T + Sync) -> Vec<T> {
    let results = slots((0..count).map(|_| None));
    run_each(count, most, &|number| *lock(&results[number]) = Some(task(number)));
    results
        .into_iter()
        .filter_map(|slot| slot.into_inner().unwrap_or_else(PoisonError::into_inner))
        .collect()
}

/// Runs every task of `0..count` once. It is not generic, because rayon's machinery is large and
/// would otherwise be compiled again for every loop and every metric.
fn run_each(count: usize, most: usize, task: &(dyn Fn(usize) + Sync)) {
    #[cfg(feature = "rayon")]
    {
        use rayon::prelude::*;
        (0..count).into_par_iter().with_max_len(most).for_each(task);
    }
    #[cfg(not(feature = "rayon"))]
    {
        let _ = most;
        (0..count).for_each(task);
    }
}

/// Places that different threads may fill. No two tasks use the same place, so no lock ever waits.
fn slots<T>(contents: impl Iterator<Item = Option<T>>) -> Vec<Mutex<Option<T>>> {
    contents.map(Mutex::new).collect()
}

/// Locks a place. Its content is whole even where a task panicked.
fn lock<T>(place: &Mutex<T>) -> MutexGuard<'_, T> {
    place.lock().unwrap_or_else(PoisonError::into_inner)
}

pub(crate) fn call_both(first: &mut (dyn FnMut() + Send), second: &mut (dyn FnMut() + Send)) {
    #[cfg(feature = "rayon")]
    rayon::join(first, second);
    #[cfg(not(feature = "rayon"))]
    {
        first();
        second();
    }
}

pub(crate) fn threads() -> usize {
    #[cfg(feature = "rayon")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "rayon"))]
    1
}
