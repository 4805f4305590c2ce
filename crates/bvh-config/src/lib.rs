//! Configurations: [`config!`](crate::config!) declares the name, type, default and accepted values
//! of each field once.
//!
//! ```
//! bvh_config::config! {
//!     /// The order of measurements.
//!     #[derive(Copy, Eq)]
//!     pub enum Order {
//!         /// By the time of arrival.
//!         FirstIn,
//!         /// By the measured value.
//!         Ascending,
//!     }
//! }
//! bvh_config::config! {
//!     /// The parameters of a measurement.
//!     pub struct Config {
//!         /// The order of measurements.
//!         order: Order = Order::FirstIn;
//!         /// Number of measurements.
//!         count: u32 = 3, in 1..=1000;
//!         /// Fraction of the measurements to discard, if any.
//!         outliers: Option<f64>, in 0.0..=1.0;
//!     }
//! }
//! use bvh_config::Check;
//! assert_eq!(Config::default().check(), Ok(()));
//! let rejected = Config { outliers: Some(2.0), ..Config::default() }.check().unwrap_err();
//! assert_eq!(rejected.to_string(), "outliers is 2; accepted: 0 to 1");
//! ```

#[cfg(feature = "toml")]
pub mod fault;
mod numbers;

pub use numbers::{Number, Numbers};

use std::fmt::Display;
use std::ops::Bound::{self, Excluded, Included, Unbounded};
use std::ops::{RangeBounds, RangeFrom, RangeInclusive, RangeToInclusive};

/// A parameter with a rejected value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}{}{message}", if key.is_empty() { "" } else { separator })]
pub struct OutOfRange {
    /// The parameter's name; dots separate the names of nested configurations, as in TOML. Empty for
    /// a whole text.
    pub key: String,
    /// What stands between the name and the message.
    separator: &'static str,
    /// The value found, and the accepted values, in words.
    message: String,
}

impl OutOfRange {
    /// Returns the rejection of the value `found` of `key`.
    pub fn new(key: impl Display, found: impl Display, accepted: impl Display) -> Self {
        let message = format!("{found}; accepted: {accepted}");
        Self { key: key.to_string(), separator: " is ", message }
    }

    /// Returns the same rejection, with a key relative to the configuration or list that contains
    /// this one under `key`.
    #[must_use]
    pub fn below(self, key: impl Display) -> Self {
        // An index follows its list without a dot: `methods[1].noise`.
        let dot = if self.key.is_empty() || self.key.starts_with('[') { "" } else { "." };
        Self { key: format!("{key}{dot}{}", self.key), ..self }
    }
}

/// A value that can check its parameters.
pub trait Check {
    /// Rejects the first parameter that is out of range.
    fn check(&self) -> Result<(), OutOfRange> {
        Ok(())
    }
}

impl<C: Check> Check for Option<C> {
    fn check(&self) -> Result<(), OutOfRange> {
        self.iter().try_for_each(C::check)
    }
}

impl<C: Check> Check for Vec<C> {
    fn check(&self) -> Result<(), OutOfRange> {
        let mut inner = self.iter().enumerate();
        inner.try_for_each(|(index, inner)| Nested.check(&format!("[{index}]"), inner))
    }
}

/// The right side of a field's `in`: the accepted values of type `V`.
///
/// Implemented by the ranges of the standard library for numbers and for collections of them, and
/// by [`Nested`].
pub trait Accepts<V: ?Sized> {
    /// Rejects a value `found` of the parameter `key` that is not accepted.
    fn check(&self, key: &str, found: &V) -> Result<(), OutOfRange>;
}

/// The fields of a configuration, as [`config!`](crate::config!) declares them.
pub trait Keys {
    /// The names of the fields, in order.
    const KEYS: &[&str];
}

/// Accepts the values that pass their [`Check`]: nested configurations.
#[derive(Clone, Copy, Debug)]
pub struct Nested;

impl<C: Check> Accepts<C> for Nested {
    fn check(&self, key: &str, found: &C) -> Result<(), OutOfRange> {
        found.check().map_err(|fault| fault.below(key))
    }
}

macro_rules! ranges {
    ($($range:ty,)*) => { $(
        impl<V: Numbers + ?Sized> Accepts<V> for $range {
            fn check(&self, key: &str, found: &V) -> Result<(), OutOfRange> {
                // `1.0..` contains infinity, which is accepted only if the range names it.
                let unlimited = matches!(self.end_bound(), Unbounded);
                for (key, number) in found.numbers(key) {
                    if !self.contains(&number) || unlimited && !number.is_finite() {
                        return Err(OutOfRange::new(key, number, in_words(self)));
                    }
                }
                Ok(())
            }
        }
    )* };
}

// One implementation per type of range: an implementation for all `R: RangeBounds` would overlap
// with `Nested`.
ranges! {
    RangeInclusive<V::Number>, RangeFrom<V::Number>, RangeToInclusive<V::Number>,
    (Bound<V::Number>, Bound<V::Number>),
}

/// Returns the range of all numbers above `low`, without `low`.
pub const fn above<N>(low: N) -> (Bound<N>, Bound<N>) {
    (Excluded(low), Unbounded)
}

fn in_words<N: Display>(range: &impl RangeBounds<N>) -> String {
    match (range.start_bound(), range.end_bound()) {
        (Included(low), Included(high)) => format!("{low} to {high}"),
        (Excluded(low), Included(high)) => format!("above {low}, up to {high}"),
        (Included(low), Excluded(high)) => format!("{low} or more, below {high}"),
        (Excluded(low), Excluded(high)) => format!("above {low} and below {high}"),
        (Included(low), Unbounded) => format!("{low} or more"),
        (Excluded(low), Unbounded) => format!("above {low}"),
        (Unbounded, Included(high)) => format!("at most {high}"),
        (Unbounded, Excluded(high)) => format!("below {high}"),
        (Unbounded, Unbounded) => "any finite number".into(),
    }
}

/// Declares a configuration: a struct with public fields, each
/// `name: type = default, in accepted;`.
///
/// The macro generates the struct with `Clone`, `Debug`, `PartialEq` and [`Default`], and
/// [`Check`](crate::Check). The documentation of every field ends with its default and its accepted
/// values. Under the feature `serde` of the calling crate, the macro derives serde's traits, which
/// reject unknown keys and replace missing ones by defaults. A crate that always depends on serde
/// writes `serde;` first.
///
/// Without `= default`, a field has the default of its type, and the documentation does not mention
/// it. Without `in`, every value is accepted. The right side of `in` is any value that
/// [`Accepts`](crate::Accepts) the field's type. A function after the struct may check combinations
/// of fields, each of which is in range, as in `check Self::check_temperatures;`.
///
/// An `enum` instead of the struct gets the same traits except [`Default`] and
/// [`Check`](crate::Check), and names in snake case.
#[macro_export]
macro_rules! config {
    ($(#[$meta:meta])* $visibility:vis enum $name:ident { $($variants:tt)* }) => {
        #[derive(Clone, Debug, PartialEq)]
        #[cfg_attr(
            feature = "serde",
            derive(::serde::Serialize, ::serde::Deserialize),
            serde(rename_all = "snake_case")
        )]
        $(#[$meta])*
        $visibility enum $name {
            $($variants)*
        }
    };
    (@default) => { ::core::default::Default::default() };
    (@default $default:expr) => { $default };
    (@doc [] []) => { "" };
    (@doc [] [$range:expr]) => { concat!("Accepted: `", stringify!($range), "`.") };
    (@doc [$default:expr] []) => { concat!("Default `", stringify!($default), "`.") };
    (@doc [$default:expr] [$range:expr]) => {
        concat!("Default `", stringify!($default), "`; accepted: `", stringify!($range), "`.")
    };
    (@struct { $(#[$serde:meta])* }
        $(#[$meta:meta])*
        $visibility:vis struct $name:ident {
            $($(#[$field_meta:meta])* $field:ident: $type:ty $(= $default:expr)? $(, in $range:expr)?;)*
        }
        $(check $together:expr;)?
    ) => {
        #[derive(Clone, Debug, PartialEq)]
        $(#[$serde])*
        $(#[$meta])*
        $visibility struct $name {
            $(
                $(#[$field_meta])*
                #[doc = $crate::config!(@doc [$($default)?] [$($range)?])]
                pub $field: $type,
            )*
        }

        impl $crate::Keys for $name {
            const KEYS: &[&str] = &[$(stringify!($field)),*];
        }

        impl ::core::default::Default for $name {
            fn default() -> Self {
                Self { $($field: $crate::config!(@default $($default)?)),* }
            }
        }

        impl $crate::Check for $name {
            fn check(&self) -> ::core::result::Result<(), $crate::OutOfRange> {
                $($($crate::Accepts::check(&($range), stringify!($field), &self.$field)?;)?)*
                $($together(self)?;)?
                Ok(())
            }
        }
    };
    (serde; $($tokens:tt)*) => {
        $crate::config! {
            @struct {
                #[derive(::serde::Serialize, ::serde::Deserialize)]
                #[serde(deny_unknown_fields, default)]
            }
            $($tokens)*
        }
    };
    ($($tokens:tt)*) => {
        $crate::config! {
            @struct {
                #[cfg_attr(
                    feature = "serde",
                    derive(::serde::Serialize, ::serde::Deserialize),
                    serde(deny_unknown_fields, default)
                )]
            }
            $($tokens)*
        }
    };
}

#[cfg(test)]
mod tests;
