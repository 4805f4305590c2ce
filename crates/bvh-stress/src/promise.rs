//! The promises that the suite checks, and the reports of broken ones.

use std::fmt;

/// A promise of every method, traversal and reader for every input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Promise {
    /// No panic, hang or abort: a tree, or a typed error naming the object.
    P1,
    /// Containment is exact, bit by bit.
    P2,
    /// No false miss: every traversal gives the answers of brute force.
    P3,
    /// The same bytes for any number of threads.
    P4,
    /// Scaling by 2^k leaves the topology and multiplies areas by 4^k.
    P5,
    /// Depth is reported, no stack overflows.
    P6,
    /// Every cost is finite and equals the tree's cost.
    P7,
}

impl Promise {
    /// Reports that `what` breaks this promise.
    pub fn broken(self, what: impl fmt::Display) -> Broken {
        Broken { promise: Some(self), what: what.to_string() }
    }
}

impl fmt::Display for Promise {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        fmt::Debug::fmt(self, f)
    }
}

/// A broken promise. Its text form is `P2: observation`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Broken {
    /// The general promise; none if only the case makes it.
    pub promise: Option<Promise>,
    /// The observation.
    pub what: String,
}

impl Broken {
    /// For `map_err`: reports a failure that breaks a promise of the case itself.
    pub fn case(what: impl fmt::Display) -> Self {
        Self { promise: None, what: what.to_string() }
    }

    /// Adds the `place` of the observation.
    pub fn within(self, place: impl fmt::Display) -> Self {
        Self { what: format!("{place}: {}", self.what), ..self }
    }
}

impl fmt::Display for Broken {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self.promise {
            Some(promise) => write!(f, "{promise}: {}", self.what),
            None => f.write_str(&self.what),
        }
    }
}

/// The text of a note, or the broken promise.
pub type Verdict = Result<String, Broken>;

/// Returns an error unless the condition holds: `ensure!(condition, P7: "cost {cost}")`, or without
/// `P7:` for promises of the case itself.
macro_rules! ensure {
    ($holds:expr, $promise:ident: $($what:tt)+) => {
        let holds: bool = $holds;
        if !holds {
            return Err($crate::promise::Promise::$promise.broken(format!($($what)+)));
        }
    };
    ($holds:expr, $($what:tt)+) => {
        let holds: bool = $holds;
        if !holds {
            return Err($crate::promise::Broken::case(format!($($what)+)));
        }
    };
}
pub(crate) use ensure;
