//! Light: the lamps on the drone, and how a command becomes light.
//!
//! Product in: [`crate::flight::Flight`]. Product out: [`LightTrace`], lamps moving through the
//! world. Light knows no pixels and no camera.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Lamps moving through the world.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightTrace {
    /// One per emitter that ever shines.
    pub lamps: Vec<Lamp>,
}

/// One emitter and its way.
#[derive(Clone, Debug, PartialEq)]
pub struct Lamp {
    /// What it is.
    pub emitter: Emitter,
    /// Its way, in order of time. Position, axis and level run linearly from sample to sample;
    /// two samples at one time make a step.
    pub samples: Vec<LightSample>,
}

/// One instant of a lamp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Since the first setpoint.
    pub time_s: f64,
    /// The lamp itself, in the world.
    pub position_m: Vector3<f64>,
    /// Where its beam points, unit vector in the world.
    pub axis: Vector3<f64>,
    /// Share of the emitter's full intensity, 0 to 1.
    pub level: f64,
}

/// A lamp on the drone: one row of the emitter table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Emitter {
    /// Name in tables and messages.
    pub name: String,
    /// The light channel of the plan that drives it.
    pub channel: String,
    /// Place on the body: x forward, y left, z up.
    pub position_body_m: [f64; 3],
    /// Where its beam points, in the body frame.
    pub axis_body: [f64; 3],
    /// Luminous intensity along the axis at full level.
    pub intensity_cd: f64,
    /// Color as linear sRGB with luminance 1 (`0.2126 r + 0.7152 g + 0.0722 b = 1`).
    pub rgb: [f64; 3],
    /// Exponent m of the beam's shape: intensity falls as cosᵐ of the angle off axis and is 0
    /// behind; 1 is a Lambertian lamp, 0 a hemisphere of even light.
    pub beam_exponent: f64,
    /// Diameter of the shining disc.
    pub diameter_m: f64,
}
