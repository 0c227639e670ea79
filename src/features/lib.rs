//! No code: Cargo.toml selects features of packages, so that all builds have the same.
