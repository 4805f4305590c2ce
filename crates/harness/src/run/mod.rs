//! Runs an experiment: jobs in, rows out, none lost.

pub mod check;
pub mod execute;
pub mod finish;
mod finished;
pub mod forecast;
pub(crate) mod jobs;
mod measurement;
mod perform;
pub mod provenance;
mod ray_cost;
pub mod reference;
pub mod resolved;
mod runs;
mod suite;
mod trace;
mod watch;
