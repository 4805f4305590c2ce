//! Runs an experiment: jobs in, rows out, none of them lost.

pub mod check;
pub mod execute;
mod job;
pub mod merge;
pub mod provenance;
pub mod reference;
pub mod rows;
pub mod store;
