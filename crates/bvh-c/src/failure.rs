//! How functions fail: by a status or by null, with a message for the thread that called; panics end here too.

use bvh_files::WriteError;
use bvh_files::tree_file::TreeFileError;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// What became of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvhStatus {
    /// It did what it says.
    Ok = 0,
    /// An argument, or what a file holds, is not accepted. Nothing was changed.
    Invalid = 1,
    /// A file could not be read or written.
    File = 2,
    /// A fault of the library, which you may report.
    Fault = 3,
}

/// Why a call did not do what it says.
#[derive(Debug)]
pub(crate) struct Failure {
    pub status: BvhStatus,
    pub message: String,
}

impl Failure {
    /// An argument that is not accepted.
    pub fn invalid(message: impl Display) -> Self {
        Self { status: BvhStatus::Invalid, message: message.to_string() }
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        Self { status: BvhStatus::File, message: error.to_string() }
    }
}

impl From<TreeFileError> for Failure {
    fn from(error: TreeFileError) -> Self {
        let status = match error {
            TreeFileError::Read(_) => BvhStatus::File,
            TreeFileError::Invalid { .. } => BvhStatus::Invalid,
        };
        Self { status, message: error.to_string() }
    }
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Why the last call of this thread that failed did so; empty if none has. Valid until another call of this thread fails.
#[unsafe(no_mangle)]
pub extern "C" fn bvh_last_error() -> *const c_char {
    LAST.with_borrow(|message| message.as_ptr())
}

/// Does it, and keeps the message if that fails.
fn attempt<T>(action: impl FnOnce() -> Result<T, Failure>) -> Result<T, BvhStatus> {
    // After a panic nothing is used that it left half done: trees are replaced whole.
    let result = catch_unwind(AssertUnwindSafe(action)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().copied();
        let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        let message = format!("a fault of the library: {}", text.unwrap_or("no message"));
        Err(Failure { status: BvhStatus::Fault, message })
    });
    result.map_err(|Failure { status, message }| {
        let message = CString::new(message.replace('\0', "")).unwrap_or_default();
        LAST.set(message);
        status
    })
}

/// For functions that return a status.
pub(crate) fn status(action: impl FnOnce() -> Result<(), Failure>) -> BvhStatus {
    attempt(action).err().unwrap_or(BvhStatus::Ok)
}

/// For functions that return what they made, or null.
pub(crate) fn made<T>(action: impl FnOnce() -> Result<T, Failure>) -> *mut T {
    attempt(action).map_or(std::ptr::null_mut(), |value| Box::into_raw(Box::new(value)))
}

/// For functions that return an array within what they are given, or null.
pub(crate) fn array<T>(action: impl FnOnce() -> Result<*const T, Failure>) -> *const T {
    attempt(action).unwrap_or(std::ptr::null())
}

/// The thing that a pointer points to.
///
/// # Safety
/// `pointer` is null, or points to a `T` that nobody changes while the result is in use.
pub(crate) unsafe fn given<'a, T>(name: &str, pointer: *const T) -> Result<&'a T, Failure> {
    // SAFETY: promised by the caller.
    unsafe { pointer.as_ref() }.ok_or_else(|| Failure::invalid(format!("{name} is null")))
}

/// The thing that a pointer points to, to be changed.
///
/// # Safety
/// `pointer` is null, or points to a `T` that nobody else uses while the result is in use.
pub(crate) unsafe fn given_mut<'a, T>(name: &str, pointer: *mut T) -> Result<&'a mut T, Failure> {
    // SAFETY: promised by the caller.
    unsafe { pointer.as_mut() }.ok_or_else(|| Failure::invalid(format!("{name} is null")))
}

/// Refuses arrays that cannot be: null or not aligned, unless they are empty, and larger than memory.
fn check<T>(name: &str, first: *const T, count: usize) -> Result<(), Failure> {
    if first.is_null() {
        return Err(Failure::invalid(format!("{name} is null; accepted: {count} elements")));
    }
    if !first.is_aligned() {
        return Err(Failure::invalid(format!(
            "{name} does not lie at a multiple of {}",
            align_of::<T>()
        )));
    }
    if count > isize::MAX as usize / size_of::<T>() {
        return Err(Failure::invalid(format!("{name} has {count} elements, more than memory can")));
    }
    Ok(())
}

/// An array that is given by its first element and its length. An empty one may be null.
///
/// # Safety
/// `first` points to `count` elements that nobody changes while the result is in use.
pub(crate) unsafe fn slice<'a, T>(
    name: &str,
    first: *const T,
    count: usize,
) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    check(name, first, count)?;
    // SAFETY: checked as far as possible, and promised by the caller.
    Ok(unsafe { std::slice::from_raw_parts(first, count) })
}

/// An array for results. An empty one may be null.
///
/// # Safety
/// `first` points to `count` elements that nobody else uses while the result is in use.
pub(crate) unsafe fn slice_mut<'a, T>(
    name: &str,
    first: *mut T,
    count: usize,
) -> Result<&'a mut [T], Failure> {
    if count == 0 {
        return Ok(&mut []);
    }
    check(name, first, count)?;
    // SAFETY: checked as far as possible, and promised by the caller. The elements are plain numbers.
    Ok(unsafe { std::slice::from_raw_parts_mut(first, count) })
}
