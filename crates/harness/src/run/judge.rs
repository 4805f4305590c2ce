//! Random rays as the judge of trees, in place of a cost.

use crate::measure::empirical_cost;
use crate::rows::RayRow;
use bvh_core::Bvh;
use bvh_scenes::Scene;
use bvh_search::Judge;

/// The mean number of box tests of the same random rays through every tree.
///
/// Ng & Trifonov 2003, section 4: 'The intention was to use actual simulation instead of the cost function for evaluating
/// fitness, but using a small number of rays gave unstable evaluations and poor performance.'
///
/// Differs from the paper: the rays are the same for all trees of a run. The paper does not say, but new ones for every
/// evaluation would be what makes it unstable.
#[derive(Debug)]
pub(crate) struct RayJudge<'a> {
    pub rays: &'a empirical_cost::Config,
    pub scene: &'a Scene,
    /// Of the rays: those of every repetition are others, and none of them those of the final measurement.
    pub seed: u64,
}

impl Judge for RayJudge<'_> {
    fn judge(&self, tree: &Bvh) -> f64 {
        empirical_cost::measure(self.rays, self.scene, tree, self.seed, RayRow::default())
            .boxes_per_ray
    }
}
