//! Keys that several kinds of reports share, and checks of their lists.

use bvh_config::{Accepts, OutOfRange};

/// Accepts lists that are not empty.
#[derive(Clone, Copy, Debug)]
pub struct OneOrMore;

impl<T> Accepts<Vec<T>> for OneOrMore {
    fn check(&self, key: &str, found: &Vec<T>) -> Result<(), OutOfRange> {
        if found.is_empty() { Err(OutOfRange::new(key, "empty", "one or more")) } else { Ok(()) }
    }
}

/// The labels of methods that a configuration names, each with the key of its place.
pub trait Labels {
    /// Returns all labels under `key` in order.
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

bvh_config::config! { serde;
    /// Methods that make one line of a figure.
    pub struct Series {
        /// Name of the line in the figure.
        name: String;
        /// Labels of the methods.
        methods: Vec<String>, in OneOrMore;
    }
}

impl Labels for Series {
    fn labels(&self, key: &str) -> Vec<(String, &str)> {
        self.methods.labels(&format!("{key}.methods"))
    }
}

/// Rejects names of files that could lead to another folder.
pub fn check_file(name: &str) -> Result<(), OutOfRange> {
    // Other characters separate folders or are invalid on some system.
    let is_plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(is_plain) {
        return Ok(());
    }
    Err(OutOfRange::new("file", format!("{name:?}"), "letters, digits, - and _"))
}
