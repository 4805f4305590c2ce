//! Converts and checks arguments that are one number or name. Errors name the argument, what was
//! found and what is accepted.

use crate::elements::invalid;
use pyo3::conversion::FromPyObjectOwned;
use pyo3::exceptions::{PyOverflowError, PyTypeError};
use pyo3::prelude::*;

const ALL_BITS: &str = "0 to 18446744073709551615";

pub const SECONDS: &str = "0 to 1e19";

pub fn seconds(argument: &Bound<PyAny>) -> PyResult<Option<f64>> {
    optional("seconds", argument, SECONDS)
}

pub fn references(argument: &Bound<PyAny>) -> PyResult<Option<f64>> {
    optional("references", argument, "1 to 16")
}

pub fn seed(argument: &Bound<PyAny>) -> PyResult<u64> {
    number("seed", argument, ALL_BITS)
}

pub fn work(argument: &Bound<PyAny>) -> PyResult<Option<u64>> {
    optional("work", argument, ALL_BITS)
}

/// Reads a number of directions.
pub fn count(name: &str, argument: &Bound<PyAny>) -> PyResult<u32> {
    const MOST: u32 = 1 << 24;
    let accepted = format!("1 to {MOST}");
    let count = number(name, argument, &accepted)?;
    if !(1..=MOST).contains(&count) {
        return Err(invalid(format!("{name} is {count}; accepted: {accepted}")));
    }
    Ok(count)
}

/// Returns the value with the name that an argument has.
pub fn named<T, const N: usize>(argument: &str, name: &str, values: [(&str, T); N]) -> PyResult<T> {
    let accepted = values.each_ref().map(|value| value.0).join(", ");
    let found = values.into_iter().find(|value| value.0 == name);
    let wrong = || invalid(format!("{argument} is {name:?}; accepted: {accepted}"));
    found.map(|value| value.1).ok_or_else(wrong)
}

fn optional<'py, T: FromPyObjectOwned<'py, Error = PyErr>>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    accepted: &str,
) -> PyResult<Option<T>> {
    if argument.is_none() {
        return Ok(None);
    }
    number(name, argument, accepted).map(Some)
}

/// Reads a number. The errors of the conversion itself do not name the argument.
fn number<'py, T: FromPyObjectOwned<'py, Error = PyErr>>(
    name: &str,
    argument: &Bound<'py, PyAny>,
    accepted: &str,
) -> PyResult<T> {
    argument.extract().map_err(|error: PyErr| {
        let py = argument.py();
        if error.is_instance_of::<PyTypeError>(py) {
            return PyTypeError::new_err(format!("{name}: {}", error.value(py)));
        }
        if !error.is_instance_of::<PyOverflowError>(py) {
            return error;
        }
        // Python refuses to print a number of thousands of digits.
        let found =
            argument.str().map_or_else(|_| "too long to print".to_owned(), |text| text.to_string());
        invalid(format!("{name} is {found}; accepted: {accepted}"))
    })
}
