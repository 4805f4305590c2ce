//! One part of an experiment that is run on several machines.

use std::fmt;
use std::str::FromStr;

/// The part `number` of `of`, both from 1; written `number/of`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    number: usize,
    of: usize,
}

impl Shard {
    /// Whether run `index` of the experiment belongs to this part. Neighbouring runs go to different parts, so that
    /// every part has its share of a large scene or a slow method.
    pub fn has(&self, index: usize) -> bool {
        index % self.of == self.number - 1
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parsed = text.split_once('/').and_then(|(number, of)| {
            Some(Self { number: number.parse().ok()?, of: of.parse().ok()? })
        });
        parsed
            .filter(|shard| (1..=shard.of).contains(&shard.number))
            .ok_or_else(|| "accepted: I/N with I from 1 to N, as 2/8".into())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_run_belongs_to_one_part() {
        for of in 1..=7 {
            let parts: Vec<Shard> = (1..=of)
                .map(|number| Shard { number, of })
                .collect();
            for index in 0..30 {
                assert_eq!(
                    parts
                        .iter()
                        .filter(|part| part.has(index))
                        .count(),
                    1
                );
            }
        }
    }

    #[test]
    fn parts_are_written_as_they_are_read_and_wrong_ones_are_refused() {
        assert_eq!("2/8".parse::<Shard>().unwrap().to_string(), "2/8");
        for wrong in ["0/3", "4/3", "1/0", "1", "a/b", "-1/2", ""] {
            assert!(
                wrong
                    .parse::<Shard>()
                    .unwrap_err()
                    .contains("I/N"),
                "{wrong}"
            );
        }
    }
}
