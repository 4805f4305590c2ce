//! The builder of the initial tree of a local search.

use bvh_build::muller_fellner;

/// Returns Müller–Fellner with |L|^0.9. Local search from its trees reaches lower costs than from
/// trees of the original heuristic.
pub(crate) fn construction() -> muller_fellner::Config {
    let heuristic = muller_fellner::Heuristic::AreaTimesPower(0.9);
    muller_fellner::Config { heuristic, ..Default::default() }
}
