//! Counts wrong answers to rays.

use bvh_core::{Bvh, Hit, Ray};

/// The answer to an any-hit query that hits.
pub const SOME_HIT: Hit = Hit { t: 0.0, object: 0 };

/// The numbers of wrong answers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Disagreements {
    /// Rays that should hit and do not.
    pub missed: u64,
    /// Rays that should not hit and do.
    pub false_hits: u64,
    /// Rays that hit, but at another place.
    pub other: u64,
}

/// The largest difference of distances of one hit, in multiples of the root box's diagonal.
const TOLERANCE: f64 = 1e-4;

/// Counts wrong answers of another library. Distances are compared with a tolerance. Objects are
/// not compared: where two triangles share an edge, either is right.
pub fn disagreements(
    right: &[Option<Hit>],
    found: &[Option<Hit>],
    tree: &Bvh,
    rays: &[Ray],
) -> Disagreements {
    let diagonal = tree.root_aabb().map_or(0.0, |root| root.extent().length());
    compare(right, found, |index, right, found| {
        // Distances are in units of the direction's length, and the tolerance is in world units.
        let length = rays.get(index).map_or(1.0, |ray| ray.direction().as_dvec3().length());
        // Any-hit queries have no distance.
        right == &SOME_HIT
            || (f64::from(right.t) - f64::from(found.t)).abs() * length <= TOLERANCE * diagonal
    })
}

/// Counts wrong answers of ours, which must be right bit by bit.
pub(super) fn exact_disagreements(right: &[Option<Hit>], found: &[Option<Hit>]) -> Disagreements {
    compare(right, found, |_, right, found| right == found)
}

fn compare(
    right: &[Option<Hit>],
    found: &[Option<Hit>],
    same: impl Fn(usize, &Hit, &Hit) -> bool,
) -> Disagreements {
    let mut differ = Disagreements::default();
    for (index, pair) in right.iter().zip(found).enumerate() {
        match pair {
            (Some(_), None) => differ.missed += 1,
            (None, Some(_)) => differ.false_hits += 1,
            (Some(right), Some(found)) => differ.other += u64::from(!same(index, right, found)),
            (None, None) => {}
        }
    }
    differ
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tracing::rays::rays;
    use bvh_build::{Builder, muller_fellner};
    use bvh_scenes::Scene;
    use bvh_scenes::rays::{Kind, Viewpoint};

    #[test]
    fn answers_are_compared_by_place_and_not_by_object() {
        let scene = Scene::load("escher:100").unwrap();
        let tree = muller_fellner::Config::default().build(&scene.boxes).unwrap();
        let rays = rays(Kind::Primary, 4, &scene, &tree, &Viewpoint::default(), 1);
        let hit = |t, object| Some(Hit { t, object });
        let right = [hit(1.0, 1), hit(1.0, 1), None, hit(1.0, 1)];
        let found = [hit(1.0, 2), None, hit(1.0, 1), hit(2.0, 1)];
        let differ = disagreements(&right, &found, &tree, &rays);
        assert_eq!(differ, Disagreements { missed: 1, false_hits: 1, other: 1 });
        assert_eq!(exact_disagreements(&right, &found).other, 2);
    }
}
