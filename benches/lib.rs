//! Benchmarks of Noctograph, which `cargo bench -p noctograph-benches` runs.
