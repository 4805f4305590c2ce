#![doc = include_str!("../README.md")]

mod arrays;
mod search;
mod tracer;
mod tree;

/// Better bounding volume hierarchies by stochastic search: find, save, load and trace trees over
/// numpy arrays.
#[pyo3::pymodule(name = "bvh_search")]
mod module {
    #[pymodule_export]
    use crate::{tracer::Tracer, tree::Tree};
}
