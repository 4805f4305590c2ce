//! One part of an experiment that several machines run.

use std::fmt;
use std::str::FromStr;

/// Part `number` of `count`, both from 1; written `number/count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    count: usize,
}

impl Shard {
    /// Returns true if run `index` of the experiment belongs to this part.
    pub fn has(&self, index: usize) -> bool {
        // Neighbouring runs go to different parts, which shares out a large scene or a slow method.
        index % self.count == self.number - 1
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(number, count)| {
            Some(Self { number: number.parse().ok()?, count: count.parse().ok()? })
        });
        parsed
            .filter(|shard| (1..=shard.count).contains(&shard.number))
            .ok_or_else(|| "accepted: I/N with I from 1 to N, for example 2/8".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_belongs_to_one_part() {
        for count in 1..=7 {
            for index in 0..30 {
                let parts = (1..=count).map(|number| Shard { number, count });
                let owners = parts.filter(|part| part.has(index));
                assert_eq!(owners.count(), 1);
            }
        }
    }

    #[test]
    fn parts_are_written_as_they_are_read_and_wrong_ones_are_rejected() {
        assert_eq!("2/8".parse::<Shard>().unwrap().to_string(), "2/8");
        for wrong in ["0/3", "4/3", "1/0", "1", "a/b", "-1/2", ""] {
            let error = wrong.parse::<Shard>().unwrap_err();
            assert!(error.contains("I/N"), "{wrong}");
        }
    }
}
