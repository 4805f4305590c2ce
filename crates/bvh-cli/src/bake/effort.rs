//! Budgets of time or work on the command line.

use std::str::FromStr;
use std::time::Duration;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Effort {
    /// Time since the search began.
    Time(Duration),
    /// Nodes built or visited: [`Budget::max_work`](bvh_search::Budget::max_work).
    Work(u64),
}

impl Effort {
    pub fn share(self, part: f64) -> Self {
        match self {
            Self::Time(time) => Self::Time(time.mul_f64(part)),
            Self::Work(work) => Self::Work((work as f64 * part) as u64),
        }
    }

    pub fn work(self) -> Option<u64> {
        match self {
            Self::Time(_) => None,
            Self::Work(work) => Some(work),
        }
    }
}

impl FromStr for Effort {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let effort = match text.strip_suffix("work") {
            Some(amount) => work(amount).map(Self::Work),
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

fn work(amount: &str) -> Option<u64> {
    let units = [("k", 1_000), ("M", 1_000_000), ("G", 1_000_000_000), ("", 1)];
    let split = |(name, unit)| Some((amount.strip_suffix(name)?, unit));
    let (number, unit) = units.into_iter().find_map(split)?;
    number.trim_end().parse::<u64>().ok()?.checked_mul(unit)
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
