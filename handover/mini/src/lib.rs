#[path = "/work/wt/reader/src/error.rs"] pub mod error;
#[path = "/work/wt/reader/src/geometry/mod.rs"] pub mod geometry;
#[path = "/work/wt/reader/src/statistics.rs"] pub mod statistics;
#[path = "/work/wt/reader/src/camera/mod.rs"] pub mod camera;
#[path = "/work/wt/reader/src/letters/mod.rs"] pub mod letters;
#[path = "/work/wt/reader/src/score/mod.rs"] pub mod score;
pub mod settings;
pub mod photo;
