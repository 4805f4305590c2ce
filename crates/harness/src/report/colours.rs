//! The colour of every method, the same in all figures: one hue per method or library, and grey for
//! the paper.

use figures::Hue::{self, *};

/// Beginnings of names of series by their colour; the longest that fits decides.
const COLOURS: [(Hue, &[&str]); 13] = [
    (Ink, &["Müller–Fellner", "exact SAH sweep", "greedy"]),
    (Olive, &["Goldsmith–Salmon", "best, never exact", "rebuild"]),
    (Green, &["GRASP", "best of 10", "k = 2", "noise", "valid tree"]),
    (Forest, &["GRASP, noise", "best of 100", "median cut", "treelets"]),
    (Blue, &["best", "refused"]),
    (Wine, &["annealing"]),
    (Sky, &["best by rays", "rotations"]),
    (Pink, &["best of each axis", "ruin and recreate"]),
    (Amber, &["best, no end", "obvhs", "random orders", "random picking"]),
    (Orange, &["broken", "reinsertion"]),
    (Grey, &["bvh", "paper"]),
    (Brown, &["agglomerative", "clustering"]),
    (Indigo, &["genetic", "median run", "one run", "range over runs"]),
];

/// Returns the colour of the series, if it is of a known method.
pub fn hue(series: &str) -> Option<Hue> {
    let names = COLOURS.iter().flat_map(|(hue, names)| names.iter().map(move |name| (*hue, *name)));
    let known = names.filter(|(_, name)| series.starts_with(name));
    known.max_by_key(|(_, name)| name.len()).map(|(hue, _)| hue)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_variant_has_the_colour_of_its_method() {
        assert_eq!(hue("best, 1 s"), hue("best"));
        assert_ne!(hue("best, no end"), hue("best"));
        assert_eq!(hue("obvhs slow"), hue("obvhs fast"));
        assert_eq!(hue("primary, same path"), None);
    }
}
