//! Runs an experiment: jobs in, rows out, none lost.

pub mod archive;
pub mod check;
pub mod execute;
pub mod finish;
mod job;
mod judge;
mod measurement;
mod perform;
pub mod provenance;
mod ray_cost;
pub mod reference;
pub mod resolved;
mod runs;
pub mod selection;
mod solved;
mod suite;
pub mod target;
mod trace;
