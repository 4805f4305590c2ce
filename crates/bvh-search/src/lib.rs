//! Stochastic search for better bounding volume hierarchies.
//!
//! A search is one file with a `Config` that implements [`Search`]. It proposes trees; the [`Run`] that it is given
//! counts evaluations, keeps the incumbent's cost and the history, and says when to stop, so that no search can forget
//! to. [`solve`] starts a search and returns its [`Outcome`]. Searches read no clock and hold no global
//! state; the same seed gives the same outcome on any number of threads.
//!
//! [`best`] is the one to take; [`optimize()`] applies it to a tree made elsewhere. Local search minimises the internal
//! area of binary trees with one object per leaf. For these every objective of a [`Problem`] is a constant plus a multiple
//! of it, so that all of them fall together.
//!
//! ```
//! use bvh_core::Aabb;
//! use bvh_search::{Problem, Budget, grasp, solve};
//! let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(|i| {
//!     let at = [i, (i * 7.3) % 11.0, (i * 3.1) % 5.0];
//!     Aabb::from((at, at.map(|c| c + 1.5)))
//! }).collect();
//! let config = grasp::Config { trials: 20, noise: Some(0.1), ..Default::default() };
//! let outcome = solve(&config, &Problem::new(&boxes), 1, Budget::default(), &())?;
//! assert_eq!(outcome.history.len(), 20);
//! assert_eq!(outcome.cost, outcome.history.iter().map(|event| event.cost).fold(f64::INFINITY, f64::min));
//! # Ok::<(), bvh_search::SearchError>(())
//! ```

pub mod annealing;
pub mod best;
pub mod exact;
mod local;
pub mod lower_bound;
mod multistart;
mod optimize;
mod orders;
mod parallel;
#[cfg(feature = "serde")]
mod registry;
mod run;
#[cfg(test)]
mod scatter;
pub mod shortcuts;
mod tree;
mod tuning;

pub use annealing::ruin_recreate;
pub use local::initial::Start;
pub use local::{LocalSearch, reinsertion, rotation, treelet};
pub use multistart::{grasp, iterated, rebuild};
pub use optimize::optimize;
pub use orders::{genetic, random_orders};
#[cfg(feature = "serde")]
pub use registry::Method;
pub use run::{
    Budget, Event, Judge, Observer, Outcome, Problem, Quota, Run, Search, SearchError, Shortcut, StopReason,
    Stream, Tally, solve,
};
