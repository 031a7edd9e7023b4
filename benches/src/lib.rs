//! Harnesses shared by the benchmarks.
