//! Benches of Noctograph: `cargo bench -p noctograph-benches`.
