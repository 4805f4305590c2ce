#![doc = include_str!("../README.md")]

mod answers;
mod arrays;
mod elements;
mod improver;
mod pickle;
mod precision;
mod rays;
mod scalars;
mod scene;
mod search;
mod sky;
mod threads;
mod tracer;
mod tree;

/// Better bounding volume hierarchies by stochastic search: find, save, load and trace trees over
/// numpy arrays.
#[pyo3::pymodule(name = "_bvh_search")]
mod module {
    #[pymodule_export]
    use crate::{scene::corners, scene::rows, sky::sky, tracer::Tracer, tree::Tree};

    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "Python's name")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
