//! Top-down division: scenes sorted along every axis, the candidate splits of a node, and builders
//! that choose among them.

mod divide;
pub mod median_cut;
pub mod muller_fellner;
mod presort;
mod rule;
pub mod spatial;
mod split_cost;
mod stall;
mod sweep;

pub use divide::Workspace;
pub use presort::Presorted;
pub use rule::{Shortlist, Split, SplitRule, TakeBest};
pub use split_cost::AreaOnly;
