//! Light: the lamps on the drone, and how a command becomes light.
//!
//! Product in: [`crate::flight::Flight`]. Product out: [`LightTrace`], lamps moving through the
//! world. Light knows no pixels and no camera.
//!
//! The LED-ring deck changes its lamps only on a firmware timer of 50 ms
//! (`ledring12.c`), and a command reaches it one radio delay after it was sent. Not modelled yet:
//! jitter of the radio, ramps of the ring's effects, the ring itself and the status LEDs, decay of
//! the LED, pulse-width modulation, and the body that hides a lamp.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};
use crate::flight::Flight;

pub mod csv;
mod switching;

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
    /// Exponent m of the beam's shape: intensity falls as cosᵐ of the angle off axis; 1 is a
    /// Lambertian lamp.
    pub beam_exponent: f64,
    /// Share of the intensity on the axis that the lamp's package spills evenly in all
    /// directions, sideways and behind too, 0 to 1.
    pub spill: f64,
    /// Diameter of the shining disc.
    pub diameter_m: f64,
}

impl Emitter {
    /// Luminous intensity at full level towards a direction, given the cosine of its angle off
    /// the axis.
    #[must_use]
    pub fn intensity_cd(&self, cos_off_axis: f64) -> f64 {
        let beam = libm::pow(cos_off_axis.clamp(0.0, 1.0), self.beam_exponent);
        let beam = if cos_off_axis > 0.0 { beam } else { 0.0 };
        self.intensity_cd * (self.spill + (1.0 - self.spill) * beam)
    }
}

/// Which lamps the drone carries, and how they follow commands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LightOptions {
    /// From sending a command to its arrival in the firmware. One parameter write takes about
    /// 20 ms one way (crazyswarm issue 245); too little hides streaks at the ends of strokes.
    pub radio_delay_s: f64,
    /// Period of the firmware's lamp timer (`ledring12.c`); changes wait for its next tick.
    pub tick_s: f64,
    /// When the timer first ticks.
    pub tick_phase_s: f64,
    /// The lamps.
    pub emitters: Vec<Emitter>,
}

impl Default for LightOptions {
    /// A Crazyflie 2.x with the LED-ring deck below: its two headlights.
    fn default() -> Self {
        Self {
            radio_delay_s: 0.02,
            tick_s: 0.05,
            tick_phase_s: 0.0,
            emitters: vec![headlight("headlight left", 0.01), headlight("headlight right", -0.01)],
        }
    }
}

/// A headlight of the LED-ring deck: white, forward, "> 1800 mcd" (Bitcraze's data sheet of the
/// deck, 33 mm square, below the body).
///
/// The spill is an assumption: the team's camera looked at the drone from its side, at right
/// angles to the beam, and still recorded clipped white streaks; SMD packages of this kind give
/// some percent there. Too little and a drone seen from the side writes nothing.
fn headlight(name: &str, left_m: f64) -> Emitter {
    Emitter {
        name: name.into(),
        channel: "headlights".into(),
        position_body_m: [0.016, left_m, -0.01],
        axis_body: [1.0, 0.0, 0.0],
        intensity_cd: 1.8,
        rgb: [1.0, 1.0, 1.0],
        beam_exponent: 1.0,
        spill: 0.05,
        diameter_m: 0.003,
    }
}

impl LightOptions {
    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        within("light.radio_delay_s", self.radio_delay_s, 0.0, 10.0)?;
        within("light.tick_s", self.tick_s, 0.0, 10.0)?;
        within("light.tick_phase_s", self.tick_phase_s, 0.0, 10.0)?;
        for Emitter { position_body_m, axis_body, rgb, .. } in &self.emitters {
            for value in position_body_m {
                within("light.emitters.position_body_m", *value, -10.0, 10.0)?;
            }
            let squares: f64 = axis_body.iter().map(|value| value * value).sum();
            within("light.emitters.axis_body (length squared)", squares, 1e-6, 1e6)?;
            for value in rgb {
                within("light.emitters.rgb", *value, 0.0, 100.0)?;
            }
        }
        for emitter in &self.emitters {
            within("light.emitters.intensity_cd", emitter.intensity_cd, 0.0, 1e6)?;
            within("light.emitters.beam_exponent", emitter.beam_exponent, 0.0, 1000.0)?;
            within("light.emitters.spill", emitter.spill, 0.0, 1.0)?;
            within("light.emitters.diameter_m", emitter.diameter_m, 0.0, 1.0)?;
        }
        Ok(())
    }
}

/// Lights the lamps of a flight.
///
/// # Errors
///
/// [`Error::Input`] for an option out of range, or a flight that has a light column for none of
/// the emitters.
pub fn light(flight: &Flight, options: &LightOptions) -> Result<LightTrace> {
    options.check()?;
    let driven = |emitter: &&Emitter| flight.lights.contains_key(&emitter.channel);
    if !options.emitters.is_empty() && !options.emitters.iter().any(|e| driven(&e)) {
        let names: Vec<&str> = flight.lights.keys().map(String::as_str).collect();
        let first = &options.emitters[0].channel;
        return Err(Error::input(
            "flight",
            format!("light columns [{}]", names.join(", ")),
            format!("a column light.{first} with levels from 0 to 1"),
            "add the column (0 where the lights are off), or change light.emitters in the scene",
        ));
    }
    let lamps = options.emitters.iter().filter(driven).filter_map(|emitter| {
        let samples = switching::shine(flight, emitter, options);
        (!samples.is_empty()).then(|| Lamp { emitter: emitter.clone(), samples })
    });
    Ok(LightTrace { lamps: lamps.collect() })
}
