//! The paper's numbers beside ours, and the verdicts on them.

use serde::{Deserialize, Serialize};

/// One row of `paper.csv`: a number of the paper beside ours.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PaperRow {
    /// Where the paper has it.
    pub source: String,
    /// Scene, ours a stand-in.
    pub scene: String,
    /// What is compared.
    pub quantity: String,
    /// The paper's value; empty if it has none and the row only adds to the others.
    pub paper: String,
    /// Ours.
    pub ours: String,
    /// The paper's value as a ratio to its base; empty where that has no meaning.
    pub paper_over_base: Option<f64>,
    /// Ours likewise.
    pub ours_over_base: Option<f64>,
    /// Whether they agree, and if not, how they differ.
    pub verdict: Verdict,
    /// Why, where known.
    pub reason: String,
}

impl PaperRow {
    /// A row about what the paper has in `source`, without numbers.
    pub fn new(source: &str, scene: impl Into<String>, quantity: impl Into<String>, reason: &str) -> Self {
        Self {
            source: source.into(),
            scene: scene.into(),
            quantity: quantity.into(),
            paper: String::new(),
            ours: String::new(),
            paper_over_base: None,
            ours_over_base: None,
            verdict: Verdict::NotInPaper,
            reason: reason.into(),
        }
    }

    /// The same row with both sides as they are shown, and the verdict on them.
    #[must_use]
    pub fn compare(self, paper: impl Into<String>, ours: impl Into<String>, verdict: Verdict) -> Self {
        Self { paper: paper.into(), ours: ours.into(), verdict, ..self }
    }

    /// The same row with both sides as ratios to base.
    #[must_use]
    pub fn ratios(self, paper: Option<f64>, ours: f64) -> Self {
        Self { paper_over_base: paper, ours_over_base: Some(ours), ..self }
    }
}

/// Declares the verdicts with the words that stand for them in `paper.csv`.
macro_rules! verdicts {
    ($($(#[$doc:meta])* $verdict:ident = $name:literal,)*) => {
        /// How a number of ours compares with the paper's.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum Verdict {
            $($(#[$doc])* #[serde(rename = $name)] $verdict,)*
        }

        impl Verdict {
            /// The words that stand for it in `paper.csv`.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$verdict => $name,)*
                }
            }
        }
    };
}

verdicts! {
    /// Within the tolerance, and not across the base.
    Agrees = "agrees",
    /// Within the tolerance, but above the base where the paper is below it.
    CloseButHigher = "close, but higher, across the base",
    /// Within the tolerance, but below the base where the paper is above it.
    CloseButLower = "close, but lower, across the base",
    /// Higher by more than the tolerance, on the same side of the base.
    SameDirectionHigher = "same direction, higher",
    /// Lower by more than the tolerance, on the same side of the base.
    SameDirectionLower = "same direction, lower",
    /// Higher by more than the tolerance, and across the base.
    DiffersHigher = "differs, higher",
    /// Lower by more than the tolerance, and across the base.
    DiffersLower = "differs, lower",
    /// Something that is not a number differs.
    Differs = "differs",
    /// Our range over scenes lies in the paper's.
    InsideRange = "inside the paper's range",
    /// Our range over scenes leaves the paper's.
    OutsideRange = "outside the paper's range",
    /// Our runs spread more.
    Wider = "wider",
    /// Our runs spread less.
    Narrower = "narrower",
    /// The paper has no such number.
    NotInPaper = "not in the paper by cost",
}

impl Verdict {
    /// How our ratio to base compares with the paper's: whether it is within `tolerance` of it, and on the same side of
    /// the base.
    pub fn of_ratios(paper: f64, ours: f64, tolerance: f64) -> Self {
        // The paper prints four digits: closer to the base than this is on neither side.
        let side = |ratio: f64| if (ratio - 1.0).abs() < 5e-4 { 0.0 } else { (ratio - 1.0).signum() };
        let close = (ours / paper - 1.0).abs() <= tolerance;
        let across = side(paper) * side(ours) < 0.0;
        match (close, across, ours > paper) {
            (true, false, _) => Self::Agrees,
            (true, true, true) => Self::CloseButHigher,
            (true, true, false) => Self::CloseButLower,
            (false, false, true) => Self::SameDirectionHigher,
            (false, false, false) => Self::SameDirectionLower,
            (false, true, true) => Self::DiffersHigher,
            (false, true, false) => Self::DiffersLower,
        }
    }

    /// Whether ours is not the paper's number but on its side of the base.
    pub fn is_same_direction(self) -> bool {
        matches!(self, Self::SameDirectionHigher | Self::SameDirectionLower)
    }
}

#[cfg(test)]
mod tests {
    use super::Verdict;

    #[test]
    fn verdicts_tell_agreement_direction_and_contradiction_apart() {
        assert_eq!(Verdict::of_ratios(1.0018, 1.003, 0.02), Verdict::Agrees);
        assert_eq!(Verdict::of_ratios(1.1, 1.2, 0.02), Verdict::SameDirectionHigher);
        assert_eq!(Verdict::of_ratios(2.0, 1.1, 0.02), Verdict::SameDirectionLower);
        assert_eq!(Verdict::of_ratios(0.996, 1.01, 0.02), Verdict::CloseButHigher);
        assert_eq!(Verdict::of_ratios(0.95, 1.2, 0.02), Verdict::DiffersHigher);
    }
}
