//! Stochastic search for better bounding volume hierarchies.
//!
//! A search is one file with a `Config` that implements [`Search`]. It proposes trees; the [`Run`] it is handed
//! counts evaluations, keeps the incumbent's cost and the history, and says when to stop, so that no search can
//! forget to. [`solve`] starts a search and returns its [`Outcome`]. Searches read no clock and hold no global
//! state; the same seed gives the same outcome on any number of threads.
//!
//! [`portfolio`], called `best`, is the one to take; [`optimize()`] applies it to a tree made elsewhere. Local search
//! minimises the internal area of binary trees with one object per leaf. For these every objective of a [`Problem`] is
//! a constant plus a multiple of it, so all of them fall together.
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
mod budget;
mod cooling;
mod error;
pub mod exact;
mod fusing;
pub mod genetic;
pub mod grasp;
mod incumbent;
mod insertion_orders;
pub mod iterated;
mod local_search;
pub mod lower_bound;
pub mod omission;
mod optimize;
mod pieces;
mod place;
pub mod portfolio;
mod quick;
pub mod random_orders;
pub mod rebuild;
#[cfg(feature = "serde")]
mod registry;
pub mod reinsertion;
pub mod rotation;
pub mod ruin_recreate;
mod run;
#[cfg(test)]
mod scatter;
mod slab;
mod start;
mod starts;
mod stream;
pub mod treelet;
mod working;

pub use budget::{Budget, StopReason};
pub use error::SearchError;
pub use local_search::LocalSearch;
pub use omission::Omission;
pub use optimize::optimize;
#[cfg(feature = "serde")]
pub use registry::Method;
pub use run::{Event, Observer, Outcome, Problem, Quota, Run, Search, Tally, solve};
pub use start::Start;
pub use stream::Stream;
