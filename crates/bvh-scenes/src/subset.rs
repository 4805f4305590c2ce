//! Subsets of scenes by name: evenly spaced, at random, or around one object.

use bvh_core::Aabb;
use rand::rngs::ChaCha8Rng;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use std::num::NonZeroU32;

/// A selection of a scene's objects, which the end of the scene's name specifies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subset {
    /// `:COUNT`: this many objects, evenly spaced in the scene's order.
    Spaced(usize),
    /// `:random:COUNT:SEED`: this many objects, drawn without replacement.
    Random(usize, u64),
    /// `:cluster:COUNT:SEED`: this many objects, whose box centres are nearest to the centre of a
    /// random object's box.
    Cluster(usize, u64),
}

impl Subset {
    /// Splits `name` into the scene's name and the subset, if it ends in a subset.
    pub fn parse(name: &str) -> Option<(&str, Self)> {
        let (before, last) = name.rsplit_once(':')?;
        // The longer form comes first, because its last word is a number as well.
        if let Some((before, count)) = before.rsplit_once(':')
            && let Some((whole, kind @ ("random" | "cluster"))) = before.rsplit_once(':')
        {
            let make = if kind == "random" { Self::Random } else { Self::Cluster };
            return Some((whole, make(count.parse().ok()?, last.parse().ok()?)));
        }
        Some((before, Self::Spaced(last.parse().ok()?)))
    }

    /// Returns the number of objects.
    pub fn count(&self) -> usize {
        match *self {
            Self::Spaced(count) | Self::Random(count, _) | Self::Cluster(count, _) => count,
        }
    }

    /// Returns the objects' indices in ascending order. The count must be 1 to the number of boxes.
    /// O(n log n) for a cluster, otherwise O(n).
    pub fn choose(&self, boxes: &[Aabb]) -> Vec<usize> {
        let all = boxes.len();
        let mut chosen = match *self {
            Self::Spaced(count) => (0..count).map(|index| index * all / count).collect(),
            Self::Random(count, seed) => {
                let mut objects: Vec<usize> = (0..all).collect();
                objects.partial_shuffle(&mut ChaCha8Rng::seed_from_u64(seed), count).0.to_vec()
            }
            Self::Cluster(count, seed) => {
                let middle = ChaCha8Rng::seed_from_u64(seed).random_range(0..all);
                let center = boxes[middle].doubled_centroid();
                let distances: Vec<_> = boxes
                    .iter()
                    .map(|b| (b.doubled_centroid() - center).length_squared())
                    .collect();
                let mut nearest: Vec<usize> = (0..all).collect();
                // The sort is stable: of equally near objects, those with lower indices are chosen.
                nearest.sort_by(|&a, &b| distances[a].total_cmp(&distances[b]));
                nearest.truncate(count);
                nearest
            }
        };
        chosen.sort_unstable();
        chosen
    }
}

/// Returns the number of names that [`expand`] makes of `name`, without making them.
pub fn names(name: &str) -> u64 {
    // The first word is the scene, whose path may contain two dots.
    let ranges = name.split(':').skip(1).filter_map(range);
    ranges
        .map(|(low, high, step)| {
            let step = u64::from(step.get());
            (u64::from(high) + step).saturating_sub(low.into()) / step
        })
        .fold(1, u64::saturating_mul)
}

fn range(word: &str) -> Option<(u32, u32, NonZeroU32)> {
    let (low, high) = word.split_once("..")?;
    let (high, step) = high.split_once('/').unwrap_or((high, "1"));
    Some((low.parse().ok()?, high.parse().ok()?, step.parse().ok()?))
}

/// Replaces every `A..B` after a colon of `name` by A, A + 1, …, B, and `A..B/STEP` by every number
/// at a step from A. One line of a spec can thus name many subsets of a scene.
pub fn expand(name: &str) -> Vec<String> {
    let mut words = name.split(':');
    let mut names = vec![words.next().unwrap_or_default().to_owned()];
    for word in words {
        let words: Vec<String> = match range(word) {
            Some((low, high, step)) => {
                let numbers = (low..=high).step_by(step.get() as usize);
                numbers.map(|number| number.to_string()).collect()
            }
            None => vec![word.to_owned()],
        };
        names = names
            .iter()
            .flat_map(|name| words.iter().map(move |word| format!("{name}:{word}")))
            .collect();
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_suffix_of_the_name_selects_a_subset() {
        assert_eq!(Subset::parse("a:30"), Some(("a", Subset::Spaced(30))));
        assert_eq!(Subset::parse("a:random:12:7"), Some(("a", Subset::Random(12, 7))));
        assert_eq!(
            Subset::parse("c:/b.obj:cluster:6:0"),
            Some(("c:/b.obj", Subset::Cluster(6, 0)))
        );
        for none in ["a", "c:/b.obj", "a:cluster:6:x", "a:cluster"] {
            assert_eq!(Subset::parse(none), None, "{none}");
        }
    }

    #[test]
    fn ranges_are_expanded_from_left_to_right() {
        let expected = ["a:random:6:0", "a:random:6:1", "a:random:7:0", "a:random:7:1"];
        assert_eq!(expand("a:random:6..7:0..1"), expected);
        assert_eq!(expand("a:0..9/4"), ["a:0", "a:4", "a:8"]);
        assert_eq!(expand("a:0..9/0"), ["a:0..9/0"]);
        assert_eq!(expand("../x..y.obj"), ["../x..y.obj"]);
        for name in
            ["a", "a:1..3", "a:random:6..7:0..1", "../x..y.obj", "a:3..1", "a:0..9/3", "a:1..3/9"]
        {
            assert_eq!(names(name), expand(name).len() as u64, "{name}");
        }
    }

    #[test]
    fn chosen_objects_are_distinct_and_a_cluster_is_around_one_of_them() {
        // The distance between neighbours grows, so that the nearest objects are consecutive.
        let boxes: Vec<Aabb> = (0..100u8)
            .map(f32::from)
            .map(|x| Aabb::from(([x * x, 0.0, 0.0], [x * x + 1.0, 1.0, 1.0])))
            .collect();
        for seed in 0..20 {
            let random = Subset::Random(30, seed).choose(&boxes);
            assert!(random.is_sorted_by(|a, b| a < b) && random.len() == 30);
            let cluster = Subset::Cluster(9, seed).choose(&boxes);
            assert!(
                cluster.windows(2).all(|pair| pair[1] == pair[0] + 1) && cluster.len() == 9,
                "{cluster:?}"
            );
        }
        assert_ne!(Subset::Random(30, 1).choose(&boxes), Subset::Random(30, 2).choose(&boxes));
    }
}
