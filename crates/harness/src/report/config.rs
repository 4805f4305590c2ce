//! What the configurations of reports share: keys that several kinds have, and what their lists have to be.

use super::target::Target;
use bvh_build::OutOfRange;
use bvh_build::config::{Accepts, Itself};
use std::collections::BTreeMap;

bvh_build::config! { serde;
    /// A report on some methods that needs to know nothing else.
    pub struct Methods {
        /// What it belongs to, such as a section of the paper.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
    }
}

bvh_build::config! { serde;
    /// A report on how fast some methods reach targets. Every repetition is one run: 25 or more make a distribution.
    pub struct Targets {
        /// What it belongs to.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
        /// Costs to be reached: base, base −1 %, best known +1 % and +0.1 % unless others are named.
        targets: Vec<Target> = Target::usual(), in Itself;
    }
    check |config: &Self| OneOrMore.check("targets", &config.targets);
}

/// Accepts lists that are not empty.
#[derive(Clone, Copy, Debug)]
pub struct OneOrMore;

impl<T> Accepts<Vec<T>> for OneOrMore {
    fn check(&self, key: &str, found: &Vec<T>) -> Result<(), OutOfRange> {
        if found.is_empty() { Err(OutOfRange::new(key, "empty", "one or more")) } else { Ok(()) }
    }
}

/// Refuses a list of the paper's numbers for a scene that is longer than `methods`, which it follows.
pub fn one_for_each(paper: &BTreeMap<String, Vec<f64>>, methods: &[String]) -> Result<(), OutOfRange> {
    let Some((scene, numbers)) = paper.iter().find(|(_, numbers)| numbers.len() > methods.len()) else {
        return Ok(());
    };
    let accepted = format!("up to {}, one for each of methods", methods.len());
    Err(OutOfRange::new(format!("paper.{scene}"), format!("a list of {} numbers", numbers.len()), accepted))
}

/// The label of the first method, which the others are compared with; empty if there is none.
pub fn first(methods: &[String]) -> &str {
    methods.first().map_or("", String::as_str)
}
