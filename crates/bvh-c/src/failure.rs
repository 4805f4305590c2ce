//! Failures: a function returns a status or null, and keeps a message for the calling thread.
//! Panics become failures as well.

use bvh_scenes::files::WriteError;
use bvh_scenes::tree_file::TreeFileError;
use std::cell::RefCell;
use std::ffi::{CString, c_char};
use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// The outcome of a call.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BvsStatus {
    /// The call succeeded.
    Ok = 0,
    /// An argument or the contents of a file are invalid. The call changed nothing.
    Invalid = 1,
    /// A file could not be read or written.
    File = 2,
    /// The library has a fault. Please report it.
    Fault = 3,
}

/// The reason why a call failed.
#[derive(Debug)]
pub(crate) struct Failure {
    pub status: BvsStatus,
    pub message: String,
}

impl Failure {
    /// Creates the failure of an invalid argument.
    pub fn invalid(message: impl Display) -> Self {
        Self { status: BvsStatus::Invalid, message: message.to_string() }
    }
}

impl From<WriteError> for Failure {
    fn from(error: WriteError) -> Self {
        Self { status: BvsStatus::File, message: error.to_string() }
    }
}

impl From<TreeFileError> for Failure {
    fn from(error: TreeFileError) -> Self {
        let status = match error {
            TreeFileError::Read(_) => BvsStatus::File,
            TreeFileError::Invalid { .. } => BvsStatus::Invalid,
        };
        Self { status, message: error.to_string() }
    }
}

/// Returns the version of the library, such as "1.2.3". The version of the header is
/// `BVS_VERSION_MAJOR`, `BVS_VERSION_MINOR` and `BVS_VERSION_PATCH`.
#[unsafe(no_mangle)]
pub extern "C" fn bvs_version() -> *const c_char {
    concat!(env!("CARGO_PKG_VERSION"), "\0").as_ptr().cast()
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

/// Returns the message of the last failed call of this thread, or an empty string if none has
/// failed. The string is valid until another call of this thread fails. Ask after the call that
/// failed, in another statement: `printf("%d %s", f(), bvs_last_error())` may ask before.
#[unsafe(no_mangle)]
pub extern "C" fn bvs_last_error() -> *const c_char {
    LAST.with_borrow(|message| message.as_ptr())
}

/// Runs the action, and keeps the message of a failure.
fn attempt<T>(action: impl FnOnce() -> Result<T, Failure>) -> Result<T, BvsStatus> {
    // The action is unwind safe: trees are replaced as a whole, so that a panic leaves the old
    // tree.
    let result = catch_unwind(AssertUnwindSafe(action)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<&str>().copied();
        let text = text.or_else(|| panic.downcast_ref::<String>().map(String::as_str));
        let message = format!("a fault of the library: {}", text.unwrap_or("no message"));
        Err(Failure { status: BvsStatus::Fault, message })
    });
    result.map_err(|Failure { status, message }| {
        let message = CString::new(message.replace('\0', "")).unwrap_or_default();
        LAST.set(message);
        status
    })
}

/// Runs the action of a function that returns a status.
pub(crate) fn status(action: impl FnOnce() -> Result<(), Failure>) -> BvsStatus {
    attempt(action).err().unwrap_or(BvsStatus::Ok)
}

/// Runs the action of a function that returns a new object or null.
pub(crate) fn made<T>(action: impl FnOnce() -> Result<T, Failure>) -> *mut T {
    attempt(action).map_or(std::ptr::null_mut(), |value| Box::into_raw(Box::new(value)))
}

/// Runs the action of a function that returns a pointer of its own making, or null.
pub(crate) fn try_made<T>(action: impl FnOnce() -> Result<*mut T, Failure>) -> *mut T {
    attempt(action).unwrap_or(std::ptr::null_mut())
}

/// Runs the action of a function that returns an array inside one of its arguments, or null.
pub(crate) fn array<T>(action: impl FnOnce() -> Result<*const T, Failure>) -> *const T {
    attempt(action).unwrap_or(std::ptr::null())
}

/// Converts a pointer into a reference, and rejects null and wrong alignment.
///
/// # Safety
/// `pointer` is null or not aligned, or points to a `T` that nobody changes while the result is in
/// use.
pub(crate) unsafe fn given<'a, T>(name: &str, pointer: *const T) -> Result<&'a T, Failure> {
    // SAFETY: what the caller promises for one element.
    unsafe { slice(name, pointer, 1) }.map(|one| &one[0])
}

/// Converts a pointer into a mutable reference, and rejects null and wrong alignment.
///
/// # Safety
/// `pointer` is null or not aligned, or points to a `T` that nobody else uses while the result is
/// in use.
pub(crate) unsafe fn given_mut<'a, T>(name: &str, pointer: *mut T) -> Result<&'a mut T, Failure> {
    // SAFETY: what the caller promises for one element.
    unsafe { slice_mut(name, pointer, 1) }.map(|one| &mut one[0])
}

/// Rejects arrays that cannot exist: null, not aligned, or larger than the address space.
fn check<T>(name: &str, first: *const T, count: usize, stride: usize) -> Result<(), Failure> {
    if first.is_null() {
        return Err(Failure::invalid(format!("{name} is null")));
    }
    if !first.is_aligned() {
        let multiple = align_of::<T>();
        return Err(Failure::invalid(format!("{name} is not aligned to a multiple of {multiple}")));
    }
    if count > isize::MAX as usize / stride {
        return Err(Failure::invalid(format!("{name} has {count} elements, more than memory has")));
    }
    Ok(())
}

/// Returns the array with this first element and length. An empty array may be null.
///
/// # Safety
/// `first` is null or not aligned, or points to `count` elements that nobody changes while the result
/// is in use.
pub(crate) unsafe fn slice<'a, T>(
    name: &str,
    first: *const T,
    count: usize,
) -> Result<&'a [T], Failure> {
    if count == 0 {
        return Ok(&[]);
    }
    check(name, first, count, size_of::<T>())?;
    // SAFETY: `first` is aligned and points to `count` elements that nobody changes meanwhile, and
    // their size fits into `isize`.
    Ok(unsafe { std::slice::from_raw_parts(first, count) })
}

/// Returns the array for results with this first element and length. An empty array may be null.
///
/// # Safety
/// `first` is null or not aligned, or points to `count` elements that nobody else uses while the
/// result is in use.
pub(crate) unsafe fn slice_mut<'a, T>(
    name: &str,
    first: *mut T,
    count: usize,
) -> Result<&'a mut [T], Failure> {
    if count == 0 {
        return Ok(&mut []);
    }
    check(name, first, count, size_of::<T>())?;
    // SAFETY: `first` is aligned and points to `count` elements that nobody else uses meanwhile,
    // and their size fits into `isize`. The elements are the library's own, or plain numbers, of
    // which any bytes are valid.
    Ok(unsafe { std::slice::from_raw_parts_mut(first, count) })
}

/// Returns what reads the elements of an array by their index, `None` behind the last one. Each
/// element begins `stride` bytes after the one before; 0 is right behind it. An empty array may be
/// null.
///
/// # Safety
/// `first` is null or not aligned, or points to `count` elements at these distances that nobody
/// changes while the result is in use.
pub(crate) unsafe fn strided<T: Copy>(
    name: &str,
    first: *const T,
    count: usize,
    stride: usize,
) -> Result<impl Fn(usize) -> Option<T>, Failure> {
    let stride = stride_of(name, first, count, stride)?;
    // SAFETY: `first` and strides are aligned, and there are `count` elements.
    Ok(move |index| (index < count).then(|| unsafe { first.byte_add(index * stride).read() }))
}

/// Returns what writes the elements of such an array by their index, and nothing behind the last
/// one.
///
/// # Safety
/// `first` is null or not aligned, or points to `count` elements at these distances that nobody
/// else uses while the result is in use.
pub(crate) unsafe fn strided_mut<T>(
    name: &str,
    first: *mut T,
    count: usize,
    stride: usize,
) -> Result<impl Fn(usize, T), Failure> {
    let stride = stride_of(name, first, count, stride)?;
    Ok(move |index, value| {
        if index < count {
            // SAFETY: `first` and strides are aligned, and there are `count` elements.
            unsafe { first.byte_add(index * stride).write(value) }
        }
    })
}

fn stride_of<T>(
    name: &str,
    first: *const T,
    count: usize,
    stride: usize,
) -> Result<usize, Failure> {
    let [size, multiple] = [size_of::<T>(), align_of::<T>()];
    let stride = if stride == 0 { size } else { stride };
    if stride < size || !stride.is_multiple_of(multiple) {
        let accepted = format!("accepted: multiples of {multiple} from {size} on");
        return Err(Failure::invalid(format!("{name} has a stride of {stride} bytes; {accepted}")));
    }
    if count > 0 {
        check(name, first, count, stride)?;
    }
    Ok(stride)
}
