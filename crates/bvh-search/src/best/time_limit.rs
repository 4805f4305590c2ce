//! The time of a search for a small budget, in multiples of the duration of the Morton sort.
//!
//! The sort always runs first. Its duration follows the machine and the scene as the durations of
//! the other steps do. Clocks tell fractions of all time.

use crate::parallel::threads;
use crate::run::{Observer, Problem, SearchError};
use crate::tuning::{
    ANNEAL_FROM_TIME, BUILDS, COLD_MEMORY, FINISH_TIME, SEVERAL_THREADS, WARM_SAMPLE,
};
use bvh_build::ploc::{self, MortonOrder};

/// The shortest duration of a sort, as a fraction of all time. A coarse clock may not advance
/// during a sort, and sort times divide by its duration.
const SHORTEST_SORT: f64 = 1e-9;

/// The time of a search with a clock. Its unit, a *sort time*, is the duration of the Morton sort.
pub(super) struct TimeLimit {
    /// When the sort began, as a fraction of all time.
    began: f64,
    /// One sort time, as a fraction of all time.
    sort: f64,
}

impl TimeLimit {
    /// Reads the clock after the sort that began at the fraction `began` of all time. Returns
    /// `None` without a clock.
    pub fn after_sort(began: Option<f64>, observer: &dyn Observer) -> Option<Self> {
        let began = began?;
        let sort = (observer.progress()? - began).max(SHORTEST_SORT);
        Some(Self { began, sort })
    }

    /// Returns the time from the beginning of the sort to the end of the search, in sort times.
    fn sort_times(&self) -> f64 {
        (1.0 - self.began) / self.sort
    }

    /// Returns whether annealing ends lower than clustering and reinsertion in this time.
    pub fn is_enough_for_annealing(
        &self,
        problem: &Problem,
        observer: &dyn Observer,
    ) -> Result<bool, SearchError> {
        let enough = for_threads(ANNEAL_FROM_TIME);
        if self.sort_times() >= enough {
            return Ok(true);
        }
        if self.sort_times() < enough / COLD_MEMORY {
            return Ok(false);
        }
        // The sort may have been slow because it was the first to use its memory.
        let warm = Self { sort: warm_sort(problem, observer)?, ..*self };
        Ok(warm.sort_times() >= enough)
    }

    /// Returns the clustering that takes all of a very short time; `None` if reinsertion has time.
    pub fn only_build(&self) -> Option<ploc::Config> {
        for (enough, clustering) in BUILDS {
            if self.sort_times() < enough {
                return Some(clustering);
            }
        }
        None
    }

    /// Returns the fraction of all time at which reinsertion must end, so that the tree can still
    /// be ordered and evaluated.
    pub fn end_of_reinsertion(&self) -> f64 {
        1.0 - FINISH_TIME * self.sort
    }
}

/// Returns the sort times that suffice with the threads of this process where `sort_times` suffice
/// with one thread.
fn for_threads(sort_times: f64) -> f64 {
    if threads() > 1 { SEVERAL_THREADS * sort_times } else { sort_times }
}

/// Estimates the duration of the sort in warm memory, in which the later steps run, as a fraction
/// of all time. The observer has a clock.
fn warm_sort(problem: &Problem, observer: &dyn Observer) -> Result<f64, SearchError> {
    let sample = &problem.boxes[..problem.boxes.len().div_ceil(WARM_SAMPLE)];
    let began = observer.progress().unwrap_or(0.0);
    MortonOrder::new(sample)?;
    let took = observer.progress().unwrap_or(0.0) - began;
    Ok((took * problem.boxes.len() as f64 / sample.len() as f64).max(SHORTEST_SORT))
}
