//! Costs to be reached: what it means that a run has solved a scene.

use super::Rows;
use serde::{Deserialize, Serialize};

/// A cost relative to the greedy tree's or to the best known.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Target {
    /// What the percentage is of.
    pub of: Of,
    /// So much above it, below if negative.
    pub percent: f64,
}

/// What a target is relative to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Of {
    /// The greedy Müller–Fellner tree.
    Base,
    /// The exact optimum of small scenes, else the best known cost.
    BestKnown,
}

impl Target {
    /// Base, base −1 %, best known +1 %, best known +0.1 %.
    pub fn usual() -> Vec<Self> {
        let of = |of, percent| Self { of, percent };
        vec![of(Of::Base, 0.0), of(Of::Base, -1.0), of(Of::BestKnown, 1.0), of(Of::BestKnown, 0.1)]
    }

    /// As figures show it.
    pub fn name(&self) -> String {
        let of = match self.of {
            Of::Base => "base",
            Of::BestKnown => "best known",
        };
        match self.percent {
            0.0 => of.into(),
            percent if percent < 0.0 => format!("{of} −{} %", -percent),
            percent => format!("{of} +{percent} %"),
        }
    }

    /// The cost on this scene; `None` if it has no reference.
    pub fn cost(&self, rows: &Rows, scene: &str) -> Option<f64> {
        let of = match self.of {
            Of::Base => rows.base_cost(scene),
            Of::BestKnown => rows.reference(scene)?.cost,
        };
        // No rounding where there is nothing to multiply with.
        Some(if self.percent == 0.0 { of } else { of * (1.0 + self.percent / 100.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_are_named_as_in_the_field() {
        let names: Vec<String> = Target::usual().iter().map(Target::name).collect();
        assert_eq!(names, ["base", "base −1 %", "best known +1 %", "best known +0.1 %"]);
    }
}
