//! The look of every method, the same in all figures: one colour per method, one hue per library,
//! and grey for the paper.

use figures::Hue::{
    Amber, Blue, Brown, Forest, Green, Grey, Indigo, Ink, Olive, Orange, Pink, Sky, Wine,
};
use figures::Shape::{Cross, Diamond, Disc, Inverted, Ring, Square, Star, Triangle};
use figures::{Hue, Look, Shape};

/// Beginnings of names of series; the longest that fits decides.
const LOOKS: &[(&str, Hue, Shape)] = &[
    ("Goldsmith–Salmon", Olive, Triangle),
    ("Build", Ink, Disc),
    ("GRASP", Green, Triangle),
    ("GRASP, noise", Forest, Diamond),
    ("GRASP, reinsertion", Green, Square),
    ("Müller–Fellner", Ink, Square),
    ("Other", Ink, Diamond),
    ("Search", Ink, Square),
    ("Trace", Ink, Triangle),
    ("a minute", Blue, Ring),
    ("agglomerative", Brown, Diamond),
    ("annealing", Wine, Star),
    ("best", Blue, Disc),
    ("best by rays", Sky, Square),
    ("best of each axis", Pink, Diamond),
    ("best of 10", Green, Triangle),
    ("best of 100", Forest, Square),
    ("best, 0.1 s", Blue, Triangle),
    ("best, 1 s", Blue, Square),
    ("best, 60 s", Blue, Ring),
    ("best, never exact", Olive, Inverted),
    ("best, no end", Amber, Diamond),
    ("broken", Orange, Square),
    ("bvh", Grey, Star),
    ("clustering", Brown, Diamond),
    ("exact SAH sweep", Ink, Square),
    ("genetic", Indigo, Star),
    ("greedy", Ink, Square),
    ("k = 2", Green, Disc),
    ("median cut", Forest, Inverted),
    ("median run", Indigo, Disc),
    ("noise", Green, Disc),
    ("obvhs", Amber, Diamond),
    ("obvhs, reinsertion", Amber, Cross),
    ("one run", Indigo, Disc),
    ("paper", Grey, Ring),
    ("paper, best of 100", Grey, Square),
    ("random orders", Amber, Inverted),
    ("random picking", Amber, Inverted),
    ("range over runs", Indigo, Square),
    ("rebuild", Olive, Diamond),
    ("refused", Blue, Square),
    ("reinsertion", Orange, Square),
    ("rotations", Sky, Inverted),
    ("ruin and recreate", Pink, Disc),
    ("treelets", Forest, Cross),
    ("valid tree", Green, Square),
];

/// Returns the look of the series, if it is of a known method.
pub fn look(series: &str) -> Option<Look> {
    let known = LOOKS.iter().filter(|(name, ..)| series.starts_with(name));
    let (_, hue, shape) = known.max_by_key(|(name, ..)| name.len())?;
    Some(Look { hue: *hue, shape: *shape })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variant_has_the_colour_of_its_method_and_its_own_shape() {
        let look = |series| look(series).unwrap();
        assert_eq!(look("best, 1 s").hue, look("best").hue);
        assert_ne!(look("best, 1 s").shape, look("best, 0.1 s").shape);
        assert_eq!(look("obvhs slow").hue, look("obvhs fast").hue);
        assert_eq!(super::look("primary, same path"), None);
    }
}
