//! Light: computes the light that a drone's lamps emit from the commands that they receive.
//!
//! Input: [`Flight`]. Output: [`LightTrace`], with lamps that move through the world. This module
//! is independent of pixels and cameras.
//!
//! 1. Each row of the emitter table ([`Fixture`]) is driven by a channel of the plan, the power
//!    supply, a firmware sequence, or the LED ring's effect. Commands are delayed by the radio and
//!    wait for the timer of the firmware, which has a period of 50 ms.
//! 2. The dies of a row have levels over time. Each color that they produce together becomes a
//!    lamp.
//! 3. Together with the flight, the levels become samples of the lamps while they are lit. There
//!    are enough samples to keep the lamps within 10 µm of their path. Lamps shine across the short
//!    gaps of a real log. In long gaps, where their positions are unknown, they are dark.
//!
//! Sources: Bitcraze's firmware (`ledring12.c`, `ledseq.c`, `led.c`, `color_led_deck.c`) and data
//! sheets, see [`tables`]. The body hides a lamp outside a cone around the lamp's axis.
//!
//! The model omits light reflected by the body, ring effects that depend on sensors, falling
//! battery voltage, the firmware's clock error (1.2 % slow until 2026), and rare stalls of the
//! radio (up to 0.7 s in the team's log). A lamp dimmed by pulse width shines at its mean level.

use std::cell::LazyCell;

use nalgebra::Vector3;

use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{DroneIndex, Flight, Quantity};
use noctograph_core::product::{Rules, Valid};
use noctograph_core::srgb::{LUMINANCE, luminance, rgb_from_xyz, xyz};
use programs::Programs;
use radio::Change;

pub use noctograph_core::lamps::*;
pub use programs::{color_led_wrgb, ring_rgb};

pub mod csv;
pub mod gaps;
mod lit_path;
mod programs;
mod radio;
mod ring;
#[cfg(test)]
mod tests;

/// The lamps of one or several drones ([`LightTraceData::append`]), which move through the world.
pub type LightTrace = Valid<LightTraceData>;

/// Data of a [`LightTrace`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LightTraceData {
    /// One lamp for each color of each table row that is ever lit.
    pub lamps: Vec<Lamp>,
}

impl Rules for LightTraceData {
    fn check(&self) -> Result<()> {
        self.lamps.iter().try_for_each(check_lamp)
    }
}

/// Returns [`Error::Input`] for a lamp with numbers that are not finite or out of range, or with
/// samples that are not sorted by time.
fn check_lamp(lamp: &Lamp) -> Result<()> {
    check_emitter(&lamp.emitter)?;
    let (name, mut previous_s) = (&lamp.emitter.name, f64::NEG_INFINITY);
    for sample in &lamp.samples {
        let LightSample { time_s, position_m, axis, level } = sample;
        // A sum is finite only if all its terms are. The checks below name what is wrong.
        let sum = time_s + position_m.sum() + axis.sum();
        if sum.is_finite() && *time_s >= previous_s && (0.0..=MAX_LEVEL).contains(level) {
            previous_s = *time_s;
            continue;
        }
        let place = |what: &str| format!("lamp `{name}` at {time_s} s: {what}");
        let hint = "the flight or log from which this light comes is damaged at this time";
        if !time_s.is_finite() || *time_s < previous_s {
            return Err(Error::input(place("time"), time_s, "times that never decrease", hint));
        }
        previous_s = *time_s;
        for (what, v) in [("position", position_m), ("axis", axis)] {
            if !v.iter().all(|x| x.is_finite()) {
                let vector = format!("({}, {}, {})", v.x, v.y, v.z);
                return Err(Error::input(place(what), vector, "three finite numbers", hint));
            }
        }
        if !(0.0..=MAX_LEVEL).contains(level) {
            return Err(Error::input(place("level"), level, "a number from 0 to 1", hint));
        }
    }
    Ok(())
}

/// Maximum level of a sample. Levels above 1 are unusual, but a film can store them.
const MAX_LEVEL: f64 = 1e3;

/// Returns [`Error::Input`] for an emitter with a number out of range.
fn check_emitter(emitter: &Emitter) -> Result<()> {
    let Emitter {
        name,
        intensity_cd,
        rgb,
        beam_exponent,
        isotropic_fraction,
        visible_cos,
        diameter_m,
        depth_m,
    } = emitter;
    // Each number comes with its minimum and its maximum.
    let settings = [
        ("intensity_cd", *intensity_cd, 0.0, 1e9),
        ("rgb[0]", rgb[0], 0.0, 1e3),
        ("rgb[1]", rgb[1], 0.0, 1e3),
        ("rgb[2]", rgb[2], 0.0, 1e3),
        ("beam_exponent", *beam_exponent, 0.0, 1e6),
        ("spill", *isotropic_fraction, 0.0, 1.0),
        ("visible_cos", *visible_cos, -1.0, 1.0),
        ("diameter_m", *diameter_m, 0.0, 10.0),
        ("depth_m", depth_m.unwrap_or(0.0), 0.0, 10.0),
    ];
    for (key, value, min, max) in settings {
        if !(min..=max).contains(&value) {
            let place = format!("lamp `{name}`: {key}");
            let hint = "correct this emitter in the scene, and choose a color inside sRGB";
            return Err(Error::input(
                place,
                value,
                format!("a number from {min} to {max:e}"),
                hint,
            ));
        }
    }
    Ok(())
}

impl LightTraceData {
    /// Returns the time of the last sample, or 0 if there is none.
    pub fn end_s(&self) -> f64 {
        let last_samples = self.lamps.iter().filter_map(|lamp| lamp.samples.last());
        last_samples.map(|last| last.time_s).fold(0.0, f64::max)
    }

    /// Adds the lamps of another drone that was flown at the same time.
    pub fn append(&mut self, other: LightTrace) {
        self.lamps.append(&mut other.into_data().lamps);
    }
}

/// An emitter and its path.
#[derive(Clone, Debug, PartialEq)]
pub struct Lamp {
    /// The drone that carries the lamp. `None` if there is only one drone.
    pub drone: Option<DroneIndex>,
    /// The constant properties of the lamp.
    pub emitter: Emitter,
    /// The path, sorted by time. Position, axis and level are linear between samples. Two samples
    /// at the same time form a step.
    pub samples: Vec<LightSample>,
}

impl Lamp {
    /// Returns the lamp's name, preceded by the drone's number (from 1) if there are several.
    pub fn label(&self) -> String {
        let Self { drone, emitter: Emitter { name, .. }, .. } = self;
        drone.map_or_else(|| name.clone(), |drone| format!("{drone}: {name}"))
    }

    /// True if `disc` is a disc around this lamp that shines at the same times, such as the body
    /// that the lamp illuminates. A picture shows both as one trail.
    pub(crate) fn is_within(&self, disc: &Self) -> bool {
        self.emitter.diameter_m < disc.emitter.diameter_m
            && (self.drone, self.samples.len()) == (disc.drone, disc.samples.len())
            && self.samples.iter().zip(&disc.samples).all(|(a, b)| {
                (a.position_m - b.position_m).norm() < disc.emitter.diameter_m && a.level == b.level
            })
    }
}

/// Position and light of a lamp at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightSample {
    /// Time since the first setpoint.
    pub time_s: f64,
    /// Position of the lamp, in the world.
    pub position_m: Vector3<f64>,
    /// Axis of the lamp's beam, as a unit vector in the world.
    pub axis: Vector3<f64>,
    /// Level relative to the emitter's intensity, 0 to 1.
    pub level: f64,
}

impl LightSample {
    /// Interpolates linearly between this sample and the next one, at `time_s`.
    pub fn toward(&self, next: &Self, time_s: f64) -> Self {
        let fraction = (time_s - self.time_s) / (next.time_s - self.time_s);
        Self {
            time_s,
            position_m: self.position_m + (next.position_m - self.position_m) * fraction,
            axis: self.axis + (next.axis - self.axis) * fraction,
            level: self.level + (next.level - self.level) * fraction,
        }
    }
}

/// A light source with one color.
#[derive(Clone, Debug, PartialEq)]
pub struct Emitter {
    /// Name of the row in the table. A row whose color changes becomes several lamps with the same
    /// name.
    pub name: String,
    /// Luminous intensity along the axis at level 1.
    pub intensity_cd: f64,
    /// Color as linear sRGB with luminance 1 (`0.2126 r + 0.7152 g + 0.0722 b = 1`).
    pub rgb: [f64; 3],
    /// Exponent m of the beam shape cosᵐ.
    pub beam_exponent: f64,
    /// Isotropic fraction: the intensity in all directions relative to that on the axis, 0 to 1.
    pub isotropic_fraction: f64,
    /// Cosine of the angle to the axis beyond which the body hides the lamp.
    pub visible_cos: f64,
    /// Diameter of the luminous disc or cylinder.
    pub diameter_m: f64,
    /// Depth of the cylinder along the axis. `None` for a disc that faces the camera.
    pub depth_m: Option<f64>,
}

impl Emitter {
    /// Returns the luminous intensity in cd at level 1 in a direction, given by the cosine of its
    /// angle from the axis.
    pub fn intensity_cd(&self, cos_off_axis: f64) -> f64 {
        self.intensity_cd * self.relative_intensity(cos_off_axis)
    }

    /// Returns the intensity in a direction, given by the cosine of its angle from the axis,
    /// relative to that on the axis. The intensity is 0 if the body hides the lamp.
    pub fn relative_intensity(&self, cos_off_axis: f64) -> f64 {
        if cos_off_axis < self.visible_cos {
            return 0.0;
        }
        let beam = match cos_off_axis {
            behind if behind <= 0.0 => 0.0,
            cos if self.beam_exponent == 1.0 => cos.min(1.0),
            cos => libm::pow(cos.min(1.0), self.beam_exponent),
        };
        self.isotropic_fraction + (1.0 - self.isotropic_fraction) * beam
    }

    /// True if the intensity is the same in all directions.
    pub(crate) fn is_isotropic(&self) -> bool {
        self.isotropic_fraction >= 1.0 && self.visible_cos <= -1.0
    }
}

/// Computes the light of a flight's lamps.
///
/// `seed` and `drone` (its index from 0) determine all random numbers: the jitter of the radio and
/// the flicker of the link LEDs.
///
/// # Errors
///
/// Returns [`Error::Input`] for an option out of range, and for a flight without positions or
/// without any of the light columns that the lamps follow.
pub fn light(flight: &Flight, options: &LightOptions, seed: u64, drone: u64) -> Result<LightTrace> {
    options.check()?;
    if !flight.has(Quantity::Position) {
        let hint = "import a log with positions (mocap, Lighthouse or an estimator)";
        return Err(Error::input("flight", "no position", "columns x_m, y_m, z_m", hint));
    }
    let fixtures = options.fixtures();
    check_channels(flight, &fixtures)?;
    let programs = Programs::new(flight, options, seed, drone);
    let flown = gaps::stretches(flight);
    // A row of several colors has many short runs, so a coarser path suffices.
    let fine_m = options.path_tolerance_m;
    let fine = LazyCell::new(|| lit_path::stretches(&flown, fine_m));
    let coarse = LazyCell::new(|| lit_path::stretches(&flown, lit_path::COARSE_M));
    let mut trace = LightTraceData::default();
    for fixture in &fixtures {
        let sources = sources(fixture, &programs.changes(fixture));
        let is_coarse = sources.len() > 1 && fine_m < lit_path::COARSE_M;
        let stretches = if is_coarse { &*coarse } else { &*fine };
        for (emitter, changes) in sources {
            let samples = lit_path::shine(stretches, fixture, &changes);
            if !samples.is_empty() {
                trace.lamps.push(Lamp { drone: None, emitter, samples });
            }
        }
    }
    LightTrace::new(trace)
}

/// Returns [`Error::Input`] for a flight without lights: it has none of the channels that the lamps
/// follow, and none of a ring or the color LED deck, with which such lamps are merely dark.
fn check_channels(flight: &Flight, fixtures: &[Fixture]) -> Result<()> {
    let mut drives = fixtures.iter().map(|fixture| &fixture.drive);
    let commanded = drives.find(|drive| matches!(drive, Drive::Command(_)));
    let Some(first) = commanded.and_then(Drive::channel) else { return Ok(()) };
    // One channel of a lamp is enough, because the other channels may be dark throughout.
    if flight.lights.keys().any(|channel| {
        fixtures.iter().any(|fixture| fixture.drive.channel() == Some(channel))
            || ring::CHANNELS.contains(&channel.as_str())
            || channel == COLOR_LED.name
    }) {
        return Ok(());
    }
    let names: Vec<&str> = flight.lights.keys().map(String::as_str).collect();
    Err(Error::input(
        "lights of the flight",
        format!("columns [{}]", names.join(", ")),
        format!("a column light.{first} with levels from 0 to 1"),
        format!(
            "set plan.lights to [\"{first}\"] if the lamp writes, add the column (0 while the \
             lights are off), or change light.fixtures in the scene"
        ),
    )
    .coded("lights-missing"))
}

/// Maximum number of colors of a row that become lamps. A row with more colors, such as a fade,
/// becomes one lamp for each primary color.
const MAX_COLORS: usize = 8;

/// Returns the emitters of a row and the changes of their levels. There is one emitter per color
/// that the row ever has, or per primary color. `dies` contains the changes of each die's level.
fn sources(fixture: &Fixture, dies: &[Vec<Change>]) -> Vec<(Emitter, Vec<Change>)> {
    let states = states(dies);
    // Lists every color that the row ever has, as levels relative to the highest one.
    let mut colors: Vec<Vec<f64>> = Vec::new();
    for (_, levels) in &states {
        let color = relative_levels(levels);
        if color.iter().any(|level| *level > 0.0) && !colors.contains(&color) {
            colors.push(color);
            if colors.len() > MAX_COLORS {
                return by_primary(fixture, &states);
            }
        }
    }
    Vec::from_iter(colors.iter().map(|color| {
        let changes = states.iter().map(|(time_s, levels)| Change {
            time_s: *time_s,
            level: if relative_levels(levels) == *color { largest(levels) } else { 0.0 },
        });
        (emitter(fixture, color), changes.collect())
    }))
}

/// Returns an emitter for each primary color of sRGB, and the changes of its level. Mixtures are
/// converted to sRGB as a whole, because single dies are outside sRGB and would lose more
/// saturation.
fn by_primary(fixture: &Fixture, states: &[(f64, Vec<f64>)]) -> Vec<(Emitter, Vec<Change>)> {
    // Computes the luminous intensity of each primary color at each change.
    let intensities = states.iter().map(|(time_s, levels)| {
        let Emitter { intensity_cd, rgb, .. } = emitter(fixture, levels);
        (*time_s, std::array::from_fn(|k| intensity_cd * rgb[k] * LUMINANCE[k]))
    });
    let intensities: Vec<(f64, [f64; 3])> = intensities.collect();
    let primaries = [0, 1, 2].map(|k: usize| {
        let largest_cd = intensities.iter().map(|(_, rgb_cd)| rgb_cd[k]).fold(0.0, f64::max);
        let mut rgb = [0.0; 3];
        rgb[k] = 1.0 / LUMINANCE[k];
        let changes = intensities.iter().map(|(time_s, rgb_cd)| Change {
            time_s: *time_s,
            level: if largest_cd > 0.0 { rgb_cd[k] / largest_cd } else { 0.0 },
        });
        (Emitter { intensity_cd: largest_cd, rgb, ..emitter(fixture, &[]) }, changes.collect())
    });
    primaries.into()
}

/// Returns the times at which any die changes, each with the levels of all dies after the change.
fn states(dies: &[Vec<Change>]) -> Vec<(f64, Vec<f64>)> {
    let mut next = vec![0; dies.len()];
    let mut levels = vec![0.0; dies.len()];
    let mut states = Vec::new();
    // Merges the sorted changes of all dies.
    loop {
        let upcoming = dies.iter().zip(&next).filter_map(|(changes, next)| changes.get(*next));
        let Some(time_s) = upcoming.map(|change| change.time_s).min_by(f64::total_cmp) else {
            return states;
        };
        for (die, changes) in dies.iter().enumerate() {
            while let Some(change) = changes.get(next[die]).filter(|c| c.time_s <= time_s) {
                levels[die] = change.level;
                next[die] += 1;
            }
        }
        states.push((time_s, levels.clone()));
    }
}

/// Returns levels relative to the highest one. All levels are 0 if the lamp is dark.
fn relative_levels(levels: &[f64]) -> Vec<f64> {
    let largest = largest(levels);
    levels.iter().map(|level| if largest > 0.0 { level / largest } else { 0.0 }).collect()
}

/// Returns the largest level, or 0 if there is none.
fn largest(levels: &[f64]) -> f64 {
    levels.iter().copied().fold(0.0, f64::max)
}

/// Returns the emitter that the dies of a lamp form together at these levels, 0 to 1.
pub(crate) fn emitter(fixture: &Fixture, levels: &[f64]) -> Emitter {
    // In additive mixing, luminances and XYZ values add up.
    let (mut intensity_cd, mut mixture_xyz) = (0.0, [0.0; 3]);
    for (die, level) in fixture.dies.iter().zip(levels) {
        let die_cd = level * die.intensity_cd;
        intensity_cd += die_cd;
        for (sum, component) in mixture_xyz.iter_mut().zip(xyz(die.chromaticity)) {
            *sum += die_cd * component;
        }
    }
    Emitter {
        name: fixture.name.clone(),
        intensity_cd,
        rgb: if intensity_cd > 0.0 { rgb(mixture_xyz) } else { [1.0; 3] },
        beam_exponent: fixture.beam_exponent,
        isotropic_fraction: fixture.spill,
        visible_cos: fixture.visible_cos,
        diameter_m: fixture.diameter_m,
        depth_m: fixture.depth_m,
    }
}

/// Converts XYZ to linear sRGB with a luminance of 1. Narrow-band LEDs are outside sRGB, but a film
/// cannot store negative light. Clipping preserves luminance and, roughly, hue, but reduces
/// saturation.
fn rgb(xyz: [f64; 3]) -> [f64; 3] {
    let rgb = rgb_from_xyz(xyz).map(|channel| channel.max(0.0));
    rgb.map(|channel| channel / luminance(rgb))
}
