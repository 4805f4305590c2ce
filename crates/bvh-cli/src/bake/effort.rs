//! Budgets of time or work on the command line.

use bvh_search::Deadline;
use std::str::FromStr;
use std::time::Duration;

/// A budget of time or work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Time since the search began.
    Time(Duration),
    /// Nodes built or visited: [`Budget::max_work`](bvh_search::Budget::max_work).
    Work(u64),
}

impl Effort {
    /// Returns a fraction of this budget.
    pub fn share(self, part: f64) -> Self {
        match self {
            Self::Time(time) => Self::Time(time.mul_f64(part)),
            Self::Work(work) => Self::Work((work as f64 * part) as u64),
        }
    }

    /// Returns the work, unless the budget is a time.
    pub fn work(self) -> Option<u64> {
        match self {
            Self::Time(_) => None,
            Self::Work(work) => Some(work),
        }
    }

    /// Returns the deadline of a search that begins now. A budget of work has none.
    pub(super) fn deadline(self) -> Deadline {
        Deadline::after(if let Self::Time(limit) = self { limit } else { Duration::MAX })
    }
}

impl FromStr for Effort {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let effort = match text.strip_suffix("work") {
            Some(amount) => {
                let digits = amount.trim_end_matches(['k', 'M', 'G']);
                let unit = match &amount[digits.len()..] {
                    "" => Some(1),
                    "k" => Some(1_000),
                    "M" => Some(1_000_000),
                    "G" => Some(1_000_000_000),
                    _ => None,
                };
                let number: Option<u64> = digits.trim_end().parse().ok();
                number.zip(unit).and_then(|(number, unit)| number.checked_mul(unit)).map(Self::Work)
            }
            // `5M` would be five months, but its author probably forgot `work`.
            None if text.contains('M') => None,
            None => humantime::parse_duration(text).ok().map(Self::Time),
        };
        effort.ok_or_else(|| {
            "expected a time such as 10s, 500ms or 1h30m, \
             or work such as 50Mwork (units k, M, G)"
                .into()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn budgets_are_times_or_work() {
        for (text, expected) in [
            ("10s", Some(Effort::Time(Duration::from_secs(10)))),
            ("1m 30s", Some(Effort::Time(Duration::from_secs(90)))),
            ("0s", Some(Effort::Time(Duration::ZERO))),
            ("50000000work", Some(Effort::Work(50_000_000))),
            ("50Mwork", Some(Effort::Work(50_000_000))),
            ("2 Gwork", Some(Effort::Work(2_000_000_000))),
            ("10", None),
            ("5M", None),
            ("work", None),
            ("-5work", None),
            ("5kMwork", None),
            ("99999999999Gwork", None),
            ("soon", None),
        ] {
            assert_eq!(text.parse().ok(), expected, "{text}");
        }
    }
}
