//! The numbers, and collections of numbers, that a range can check.

use std::collections::BTreeMap;
use std::fmt::Display;

/// A number that can be a parameter.
pub trait Number: Copy + PartialOrd + Display {
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
    /// Returns every number with its key, below `key` in a collection.
    fn numbers(&self, key: &str) -> Vec<(String, Self::Number)>;
}

macro_rules! numbers {
    ($($number:ident $(by $is_finite:path)?,)*) => { $(
        impl Number for $number {
            $(fn is_finite(&self) -> bool { $is_finite(*self) })?
        }
        impl Numbers for $number {
            type Number = Self;
            fn numbers(&self, key: &str) -> Vec<(String, Self)> {
                vec![(key.into(), *self)]
            }
        }
    )* };
}

numbers!(u8, u16, u32, u64, usize, i32, i64, f32 by f32::is_finite, f64 by f64::is_finite,);

impl<V: Numbers> Numbers for Option<V> {
    type Number = V::Number;
    fn numbers(&self, key: &str) -> Vec<(String, V::Number)> {
        self.iter().flat_map(|inner| inner.numbers(key)).collect()
    }
}

impl<V: Numbers> Numbers for [V] {
    type Number = V::Number;
    fn numbers(&self, key: &str) -> Vec<(String, V::Number)> {
        let inner = self.iter().enumerate();
        inner.flat_map(|(index, inner)| inner.numbers(&format!("{key}[{index}]"))).collect()
    }
}

impl<V: Numbers, const N: usize> Numbers for [V; N] {
    type Number = V::Number;
    fn numbers(&self, key: &str) -> Vec<(String, V::Number)> {
        self.as_slice().numbers(key)
    }
}

impl<V: Numbers> Numbers for Vec<V> {
    type Number = V::Number;
    fn numbers(&self, key: &str) -> Vec<(String, V::Number)> {
        self.as_slice().numbers(key)
    }
}

impl<V: Numbers> Numbers for BTreeMap<String, V> {
    type Number = V::Number;
    fn numbers(&self, key: &str) -> Vec<(String, V::Number)> {
        self.iter().flat_map(|(name, inner)| inner.numbers(&format!("{key}.{name}"))).collect()
    }
}
