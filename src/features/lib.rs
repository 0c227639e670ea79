//! Features: none of the code, only features of packages; see Cargo.toml.
