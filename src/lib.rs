//! Noctograph shows the photograph of a drone's light painting before the flight, and says
//! whether it reads.
pub mod camera;
pub mod control;
pub mod error;
pub mod expose;
pub mod flight;
pub mod geometry;
pub mod letters;
pub mod light;
pub mod photo;
pub mod plan;
pub mod score;
pub mod sim;
