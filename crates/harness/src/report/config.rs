//! What the configurations of reports share: keys that several kinds have, and what their lists have to be.

use super::target::Target;
use bvh_config::{Accepts, Nested, OutOfRange};
use std::collections::BTreeMap;

bvh_config::config! { serde;
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

bvh_config::config! { serde;
    /// A report on how fast some methods reach targets. Every repetition is one run: 25 or more make a distribution.
    pub struct Targets {
        /// What it belongs to.
        source: String;
        /// Heading.
        title: String;
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
        /// Costs to be reached: base, base −1 %, best known +1 % and +0.1 % unless others are named.
        targets: Vec<Target> = Target::usual(), in Nested;
    }
    check |config: &Self| OneOrMore.faults("targets", &config.targets);
}

/// Accepts lists that are not empty.
#[derive(Clone, Copy, Debug)]
pub struct OneOrMore;

impl<T> Accepts<Vec<T>> for OneOrMore {
    fn faults(&self, key: &str, found: &Vec<T>) -> Vec<OutOfRange> {
        if found.is_empty() { vec![OutOfRange::new(key, "empty", "one or more")] } else { vec![] }
    }
}

/// The labels of methods that a configuration names under `key`, each with the key of its own place.
pub trait Labels {
    /// All of them, in order.
    fn labels(&self, key: &str) -> Vec<(String, &str)>;
}

impl Labels for String {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        vec![(key.into(), self)]
    }
}

impl<L: Labels> Labels for [L] {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        self.iter()
            .enumerate()
            .flat_map(|(at, named)| named.labels(&format!("{key}[{at}]")))
            .collect()
    }
}

impl Labels for [String; 2] {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        self.as_slice().labels(key)
    }
}

/// Refuses lists of the paper's numbers for a scene that are longer than `methods`, which they follow.
pub fn one_for_each(paper: &BTreeMap<String, Vec<f64>>, methods: &[String]) -> Vec<OutOfRange> {
    let accepted = format!("up to {}, one for each of methods", methods.len());
    let long = paper
        .iter()
        .filter(|(_, numbers)| numbers.len() > methods.len());
    let fault = |(scene, numbers): (&String, &Vec<f64>)| {
        let found = format!("a list of {} numbers", numbers.len());
        OutOfRange::new(format!("paper.{scene}"), found, &accepted)
    };
    long.map(fault).collect()
}

/// The label of the first method, which the others are compared with; empty if there is none.
pub fn first(methods: &[String]) -> &str {
    methods.first().map_or("", String::as_str)
}
