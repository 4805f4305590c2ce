//! Random rays that judge trees instead of a cost.

use bvh_core::Bvh;
use bvh_scenes::Scene;
use bvh_scenes::rays::{RandomRays, empirical_cost};
use bvh_search::Judge;

/// Judges a tree by the mean number of box tests of random rays, the same rays for every tree.
///
/// Ng & Trifonov 2003, section 4: 'The intention was to use actual simulation instead of the cost
/// function for evaluating fitness, but using a small number of rays gave unstable evaluations and
/// poor performance.'
///
/// Differs from the paper: the rays are the same for all trees of a run. The paper leaves this
/// open, but new rays for every evaluation would explain the instability.
#[derive(Debug)]
pub(crate) struct RayJudge<'a> {
    pub rays: &'a RandomRays,
    pub scene: &'a Scene,
    /// Seed of the rays. Every repetition uses different rays, and none of them reappear in the
    /// final measurement.
    pub seed: u64,
}

impl Judge for RayJudge<'_> {
    fn judge(&self, tree: &Bvh) -> f64 {
        empirical_cost(self.rays, &self.scene.primitives, tree, self.seed).boxes.mean
    }
}
