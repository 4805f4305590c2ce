#![doc = include_str!("../README.md")]

/// Fails to compile unless one type may be used in place of the other.
macro_rules! same_layout {
    ($ours:ty, $theirs:ty, $($field:ident),*) => {
        const _: () = assert!(
            size_of::<$ours>() == size_of::<$theirs>()
                && align_of::<$ours>() == align_of::<$theirs>()
                $(&& std::mem::offset_of!($ours, $field) == std::mem::offset_of!($theirs, $field))*
        );
    };
}

mod double;
mod failure;
mod instances;
mod sky;
#[cfg(test)]
mod tests;
mod tracer;
mod tree;
