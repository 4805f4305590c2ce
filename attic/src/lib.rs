//! Empty: the instruments are the benchmarks.
