//! Targets: the costs at which a run counts as having solved a scene.

use super::data::Rows;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Bound::{Excluded, Included};

bvh_config::config! { serde;
    /// A cost relative to the greedy tree's or to the best known.
    #[derive(Copy)]
    pub struct Target {
        /// The cost that the percentage is relative to.
        of: Of;
        /// Distance of the target above that cost, in percent; below it if negative.
        percent: f64, in (Excluded(-100.0), Included(1e6));
    }
}

/// The cost that a target is relative to.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "snake_case")]
pub enum Of {
    /// The greedy Müller–Fellner tree.
    #[default]
    Base,
    /// The exact optimum of small scenes, otherwise the best known cost.
    BestKnown,
}

impl Target {
    /// Returns the cost on this scene; `None` if the scene has no reference.
    pub fn cost(&self, rows: &Rows, scene: &str) -> Option<f64> {
        let of = match self.of {
            Of::Base => rows.base_cost(scene),
            Of::BestKnown => rows.reference(scene)?.cost,
        };
        // A target of 0 % must be exactly the cost it is relative to.
        Some(if self.percent == 0.0 { of } else { of * (1.0 + self.percent / 100.0) })
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let of = match self.of {
            Of::Base => "base",
            Of::BestKnown => "best known",
        };
        match self.percent {
            0.0 => f.write_str(of),
            percent if percent < 0.0 => write!(f, "{of} −{} %", -percent),
            percent => write!(f, "{of} +{percent} %"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_named_as_in_the_field() {
        for (of, percent, name) in [
            (Of::Base, 0.0, "base"),
            (Of::Base, -1.0, "base −1 %"),
            (Of::BestKnown, 0.1, "best known +0.1 %"),
        ] {
            assert_eq!(Target { of, percent }.to_string(), name);
        }
    }
}
