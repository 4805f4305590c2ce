//! The types of numbers in numpy arrays, and the error of an argument that has others.

use numpy::Element;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::fmt::Display;

pub fn invalid(message: impl Display) -> PyErr {
    PyValueError::new_err(message.to_string())
}

/// The kinds of elements that are accepted, by numpy's letters, and their name.
pub type Kinds = (&'static str, &'static str);

pub const REAL_NUMBERS: Kinds = ("biuf", "real numbers");
pub const INTEGERS: Kinds = ("iu", "integers");

/// A type of elements, with its name in numpy and the kinds that are converted to it.
pub trait Number: Element {
    const DTYPE: &str;
    const KINDS: Kinds;
}

impl Number for f32 {
    const DTYPE: &str = "float32";
    const KINDS: Kinds = REAL_NUMBERS;
}

impl Number for f64 {
    const DTYPE: &str = "float64";
    const KINDS: Kinds = REAL_NUMBERS;
}

impl Number for i64 {
    const DTYPE: &str = "int64";
    const KINDS: Kinds = INTEGERS;
}
