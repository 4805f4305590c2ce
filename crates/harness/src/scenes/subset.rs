//! Parts of scenes by name: evenly spaced, at random, or around one object.

use bvh_core::Aabb;
use bvh_search::Stream;
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};

/// Which of a scene's objects to take; what follows the scene's name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// `:COUNT`: so many, evenly spaced in their order.
    Spaced(usize),
    /// `:random:COUNT:SEED`: so many distinct ones.
    Random(usize, u64),
    /// `:cluster:COUNT:SEED`: so many around a random one, nearest box centres first.
    Cluster(usize, u64),
}

impl Part {
    /// The scene's name and the part, if `name` ends like one.
    pub fn parse(name: &str) -> Option<(&str, Self)> {
        let (before, last) = name.rsplit_once(':')?;
        let seeded = || {
            let (before, count) = before.rsplit_once(':')?;
            let (whole, kind) = before.rsplit_once(':')?;
            let (count, seed) = (count.parse().ok()?, last.parse().ok()?);
            match kind {
                "random" => Some((whole, Self::Random(count, seed))),
                "cluster" => Some((whole, Self::Cluster(count, seed))),
                _ => None,
            }
        };
        seeded().or_else(|| Some((before, Self::Spaced(last.parse().ok()?))))
    }

    /// How many objects it has.
    pub fn count(&self) -> usize {
        match *self {
            Self::Spaced(count) | Self::Random(count, _) | Self::Cluster(count, _) => count,
        }
    }

    /// Their indices in order, for a count of 1 to as many as there are boxes.
    pub fn choose(&self, boxes: &[Aabb]) -> Vec<usize> {
        let all = boxes.len();
        let mut chosen = match *self {
            Self::Spaced(count) => (0..count).map(|index| index * all / count).collect(),
            Self::Random(count, seed) => {
                let mut objects: Vec<usize> = (0..all).collect();
                objects.partial_shuffle(&mut Stream::seed_from_u64(seed), count).0.to_vec()
            }
            Self::Cluster(count, seed) => {
                let center = boxes[Stream::seed_from_u64(seed).random_range(0..all)].doubled_centroid();
                let distance = |&object: &usize| (boxes[object].doubled_centroid() - center).length_squared();
                let mut nearest: Vec<usize> = (0..all).collect();
                nearest.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
                nearest.truncate(count);
                nearest
            }
        };
        chosen.sort_unstable();
        chosen
    }
}

/// How many names [`expand`] makes of this one.
pub fn names(name: &str) -> u64 {
    let ranges = name.split(':').skip(1).filter_map(range);
    ranges.map(|(low, high)| (u64::from(high) + 1).saturating_sub(low.into())).fold(1, u64::saturating_mul)
}

/// The numbers of `A..B`.
fn range(word: &str) -> Option<(u32, u32)> {
    let (low, high) = word.split_once("..")?;
    Some((low.parse().ok()?, high.parse().ok()?))
}

/// `name` with every `A..B` after a colon replaced by A, A + 1, … B: many parts of a scene on one line of a spec.
pub fn expand(name: &str) -> Vec<String> {
    let mut names = vec![String::new()];
    for (index, word) in name.split(':').enumerate() {
        let words: Vec<String> = match range(word).filter(|_| index > 0) {
            Some((low, high)) => (low..=high).map(|number| number.to_string()).collect(),
            None => vec![word.to_owned()],
        };
        let colon = if index > 0 { ":" } else { "" };
        let longer =
            |name: &String| words.iter().map(|word| format!("{name}{colon}{word}")).collect::<Vec<_>>();
        names = names.iter().flat_map(longer).collect();
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_told_by_what_follows_the_name() {
        assert_eq!(Part::parse("a:30"), Some(("a", Part::Spaced(30))));
        assert_eq!(Part::parse("a:random:12:7"), Some(("a", Part::Random(12, 7))));
        assert_eq!(Part::parse("c:/b.obj:cluster:6:0"), Some(("c:/b.obj", Part::Cluster(6, 0))));
        for none in ["a", "c:/b.obj", "a:cluster:6:x", "a:cluster"] {
            assert_eq!(Part::parse(none), None, "{none}");
        }
    }

    #[test]
    fn ranges_are_expanded_from_left_to_right() {
        let expected = ["a:random:6:0", "a:random:6:1", "a:random:7:0", "a:random:7:1"];
        assert_eq!(expand("a:random:6..7:0..1"), expected);
        assert_eq!(expand("../x..y.obj"), ["../x..y.obj"]);
        for name in ["a", "a:1..3", "a:random:6..7:0..1", "../x..y.obj", "a:3..1"] {
            assert_eq!(names(name), expand(name).len() as u64, "{name}");
        }
    }

    #[test]
    fn chosen_objects_are_distinct_and_a_cluster_is_around_one_of_them() {
        let cube = |x: f32| Aabb::from(([x * x, 0.0, 0.0], [x * x + 1.0, 1.0, 1.0]));
        let boxes: Vec<Aabb> = (0..100u8).map(f32::from).map(cube).collect();
        for seed in 0..20 {
            let random = Part::Random(30, seed).choose(&boxes);
            assert!(random.is_sorted_by(|a, b| a < b) && random.len() == 30);
            let cluster = Part::Cluster(9, seed).choose(&boxes);
            assert!(cluster.windows(2).all(|pair| pair[1] == pair[0] + 1) && cluster.len() == 9, "{cluster:?}");
        }
        assert_ne!(Part::Random(30, 1).choose(&boxes), Part::Random(30, 2).choose(&boxes));
    }
}
