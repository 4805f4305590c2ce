//! Pictures as measurements.
