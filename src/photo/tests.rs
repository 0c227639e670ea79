//! Tests of the chain from film to photo.
