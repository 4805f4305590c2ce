//! The numbers, and collections of numbers, that a range can check.

use crate::OutOfRange;
use std::collections::BTreeMap;
use std::fmt::Display;

/// A check of one number and its key.
pub type Visit<'a, N> = &'a mut dyn FnMut(&str, &N) -> Result<(), OutOfRange>;

/// A number that can be a parameter.
pub trait Number: PartialOrd + Display {
    /// Returns whether the number is neither infinite nor NaN. Infinity is accepted only if a range
    /// names it as its end.
    fn is_finite(&self) -> bool {
        true
    }
}

/// A number, or a collection of numbers that must all be in range.
pub trait Numbers {
    /// The type of the numbers.
    type Number: Number;
    /// Calls `visit` with every number and its key, below `key` in a collection, up to the first
    /// error.
    fn each(&self, key: &str, visit: Visit<Self::Number>) -> Result<(), OutOfRange>;
}

macro_rules! numbers {
    ($($number:ident $(by $is_finite:path)?,)*) => { $(
        impl Number for $number {
            $(fn is_finite(&self) -> bool { $is_finite(*self) })?
        }
        impl Numbers for $number {
            type Number = Self;
            fn each(&self, key: &str, visit: Visit<Self>) -> Result<(), OutOfRange> {
                visit(key, self)
            }
        }
    )* };
}

numbers!(u8, u16, u32, u64, usize, i32, i64, f32 by f32::is_finite, f64 by f64::is_finite,);

impl<V: Numbers> Numbers for Option<V> {
    type Number = V::Number;
    fn each(&self, key: &str, visit: Visit<V::Number>) -> Result<(), OutOfRange> {
        self.iter().try_for_each(|inner| inner.each(key, visit))
    }
}

impl<V: Numbers> Numbers for [V] {
    type Number = V::Number;
    fn each(&self, key: &str, visit: Visit<V::Number>) -> Result<(), OutOfRange> {
        let mut inner = self.iter().enumerate();
        inner.try_for_each(|(index, inner)| inner.each(&format!("{key}[{index}]"), visit))
    }
}

impl<V: Numbers, const N: usize> Numbers for [V; N] {
    type Number = V::Number;
    fn each(&self, key: &str, visit: Visit<V::Number>) -> Result<(), OutOfRange> {
        self.as_slice().each(key, visit)
    }
}

impl<V: Numbers> Numbers for Vec<V> {
    type Number = V::Number;
    fn each(&self, key: &str, visit: Visit<V::Number>) -> Result<(), OutOfRange> {
        self.as_slice().each(key, visit)
    }
}

impl<V: Numbers> Numbers for BTreeMap<String, V> {
    type Number = V::Number;
    fn each(&self, key: &str, visit: Visit<V::Number>) -> Result<(), OutOfRange> {
        self.iter().try_for_each(|(name, inner)| inner.each(&format!("{key}.{name}"), visit))
    }
}
