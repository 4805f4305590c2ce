//! Compares the paper's numbers with ours and gives a verdict on each.

use serde::{Deserialize, Serialize};

/// One row of `paper.csv`: a statement of the paper and our result. Absolute costs are not
/// compared, because the scenes are not the paper's.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PaperRow {
    /// The place in the paper.
    pub source: String,
    /// The scene; ours is a stand-in.
    pub scene: String,
    /// The quantity that is compared.
    pub quantity: String,
    /// The paper's number or words.
    pub paper: String,
    /// Our number or words.
    pub ours: String,
    /// The paper's value as a ratio to its base; empty where it has no number.
    pub paper_over_base: Option<f64>,
    /// Our value as a ratio to base; empty where the paper has no number.
    pub ours_over_base: Option<f64>,
    /// Lower end of the interval that has our value in nine of ten repetitions, or in all if there
    /// are few; empty where chance plays no part.
    pub ours_low: Option<f64>,
    /// Upper end of this interval.
    pub ours_high: Option<f64>,
    /// Agreement, or the kind of difference.
    pub verdict: Verdict,
    /// The condition of agreement.
    pub rule: String,
    /// The reason for a difference, where known.
    pub reason: String,
}

impl PaperRow {
    /// Makes a row without numbers.
    pub fn new(scene: impl Into<String>, quantity: impl Into<String>) -> Self {
        Self { scene: scene.into(), quantity: quantity.into(), ..Self::default() }
    }

    /// Adds both sides as they are shown, the verdict on them, and its rule.
    #[must_use]
    pub fn compare(
        self,
        paper: impl Into<String>,
        ours: impl Into<String>,
        verdict: Verdict,
        rule: impl Into<String>,
    ) -> Self {
        Self { paper: paper.into(), ours: ours.into(), verdict, rule: rule.into(), ..self }
    }

    /// Adds the paper's and our ratio to base by the closest of several readings, and the verdict.
    #[must_use]
    pub fn compare_reading(self, paper: f64, ours: f64, reading: &str, tolerance: f64) -> Self {
        // The paper prints no formula, so the closest reading is the most favourable to it.
        let is_close = (ours / paper - 1.0).abs() <= tolerance;
        let row = self.compare(
            format!("{paper:.4}"),
            format!("{ours:.4}, by {reading}"),
            if is_close { Verdict::Inconclusive } else { Verdict::Differs },
            format!(
                "differs if no reading is within {} % of the paper's; the paper prints no formula, \
                 so that a reading which is within cannot be distinguished from the paper's",
                100.0 * tolerance
            ),
        );
        Self { paper_over_base: Some(paper), ours_over_base: Some(ours), ..row }
    }

    /// Adds the paper's words and our value, and the verdict on them. The words hold if the whole
    /// interval of our value lies from the number `from` on; without one there is no verdict.
    #[must_use]
    pub fn compare_words(
        self,
        says: &str,
        ours: f64,
        interval: Option<(f64, f64)>,
        from: Option<f64>,
    ) -> Self {
        let (low, high) = interval.unwrap_or((ours, ours));
        let (verdict, rule) = match from {
            None => (Verdict::NoVerdict, "the paper gives no number".to_owned()),
            Some(from) => {
                let verdict = match (low >= from, high < from) {
                    (true, _) => Verdict::Agrees,
                    (_, true) => Verdict::Differs,
                    _ => Verdict::Inconclusive,
                };
                let rule = "its whole interval lies from";
                (verdict, format!("{rule} {from} on; it differs if the interval lies below"))
            }
        };
        let row = self.compare(says, format!("{ours:.3}"), verdict, rule);
        let (ours_low, ours_high) = interval.unzip();
        Self { ours_low, ours_high, ..row }
    }

    /// Adds the paper's and our ratio to base, and the verdict on them. Our ratio has an interval
    /// if it depends on chance. The ratios agree if the whole interval is within the relative
    /// distance `tolerance` of the paper's ratio and on the same side of 1.
    #[must_use]
    pub fn compare_ratios(
        self,
        paper: f64,
        ours: f64,
        interval: Option<(f64, f64)>,
        tolerance: f64,
    ) -> Self {
        let (low, high) = interval.unwrap_or((ours, ours));
        let verdicts = [low, ours, high].map(|ours| Verdict::of_ratios(paper, ours, tolerance));
        // The verdict must not depend on the luck of this repetition, so the whole interval
        // decides.
        let same = verdicts.iter().all(|verdict| *verdict == verdicts[0]);
        let row = self.compare(
            format!("{paper:.4}"),
            format!("{ours:.4}"),
            if same { verdicts[0] } else { Verdict::Inconclusive },
            format!("within {} % of the paper's, and on the same side of 1", 100.0 * tolerance),
        );
        let (ours_low, ours_high) = interval.unzip();
        Self {
            paper_over_base: Some(paper),
            ours_over_base: Some(ours),
            ours_low,
            ours_high,
            ..row
        }
    }
}

/// The relation of our number to the paper's.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Verdict {
    /// The rule holds.
    #[serde(rename = "agrees")]
    Agrees,
    /// Higher than the rule allows, on the same side of the base.
    #[serde(rename = "same direction, higher")]
    SameDirectionHigher,
    /// Lower than the rule allows, on the same side of the base.
    #[serde(rename = "same direction, lower")]
    SameDirectionLower,
    /// Higher, and above the base where the paper is below it.
    #[serde(rename = "differs, higher")]
    DiffersHigher,
    /// Lower, and below the base where the paper is above it.
    #[serde(rename = "differs, lower")]
    DiffersLower,
    /// The rule does not hold, and neither number is higher.
    #[serde(rename = "differs")]
    Differs,
    /// Another repetition may have led to another verdict.
    #[serde(rename = "inconclusive")]
    Inconclusive,
    /// The paper has words and no number, so no data could lead to another verdict.
    #[default]
    #[serde(rename = "no verdict")]
    NoVerdict,
}

impl Verdict {
    /// Compares our ratio to base with the paper's: by the relative distance `tolerance`, and by
    /// the side of the base.
    fn of_ratios(paper: f64, ours: f64, tolerance: f64) -> Self {
        // The paper prints four digits, so a ratio this close to the base is on neither side.
        let side =
            |ratio: f64| if (ratio - 1.0).abs() < 5e-4 { 0.0 } else { (ratio - 1.0).signum() };
        let close = (ours / paper - 1.0).abs() <= tolerance;
        match (close, side(paper) * side(ours) < 0.0, ours > paper) {
            (true, false, _) => Self::Agrees,
            (false, false, true) => Self::SameDirectionHigher,
            (false, false, false) => Self::SameDirectionLower,
            (_, true, true) => Self::DiffersHigher,
            (_, true, false) => Self::DiffersLower,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn verdict(paper: f64, ours: f64, interval: Option<(f64, f64)>) -> Verdict {
        PaperRow::new("", "").compare_ratios(paper, ours, interval, 0.02).verdict
    }

    #[test]
    fn verdicts_tell_agreement_direction_and_contradiction_apart() {
        assert_eq!(verdict(1.0018, 1.003, None), Verdict::Agrees);
        assert_eq!(verdict(1.1, 1.2, None), Verdict::SameDirectionHigher);
        assert_eq!(verdict(2.0, 1.1, None), Verdict::SameDirectionLower);
        assert_eq!(verdict(0.95, 1.2, None), Verdict::DiffersHigher);
        // Close by, but the paper finds an improvement where ours finds none.
        assert_eq!(verdict(0.996, 1.01, None), Verdict::DiffersHigher);
    }

    #[test]
    fn what_another_repetition_could_turn_round_cannot_be_told() {
        assert_eq!(verdict(0.99, 0.995, Some((0.992, 0.998))), Verdict::Agrees);
        assert_eq!(verdict(0.99, 0.999, Some((0.996, 1.004))), Verdict::Inconclusive);
        assert_eq!(verdict(1.1, 1.3, Some((1.2, 1.4))), Verdict::SameDirectionHigher);
    }
}
