//! Recording → Flight: one time axis, holes where the pose is unknown, all other columns kept.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::recording::{Channel, Clock, Recording, shortened};
use super::sources::{Told, VelocityFrame, body_from_world, told};
use super::{ImportOptions, PositionSource};
use crate::error::{Error, Result};
use crate::flight::csv::is_standard_column;
use crate::flight::table::on_grid;
use crate::flight::{Flight, FlightSample, Quantity};
use crate::geometry::Attitude;

/// Most samples of a flight: 11 hours at 100 Hz.
const MAX_SAMPLES: f64 = 4e6;

/// Most numbers in all further columns together: half a gigabyte.
const MAX_EXTRA_CELLS: usize = 64 << 20;

/// The firmware's slowest log block: its period has one byte, in units of 10 ms.
const SLOWEST_PERIOD_S: f64 = 2.55;

/// Makes the flight of a settled recording.
///
/// # Errors
///
/// [`Error::Input`] where nothing known is logged, the wanted position is not, the parts of the
/// pose have no time in common, or the flight would be too large.
pub(super) fn flight(recording: Recording, options: &ImportOptions) -> Result<Flight> {
    let told = told(&recording, options.position);
    let ranging = recording.names().any(|name| name.starts_with("ranging."));
    let unlogged = unlogged(&told);
    if unlogged.len() == Quantity::TABLE.len() && !ranging {
        return Err(nothing_known(&recording));
    }
    if told.position_m.is_none() && options.position != PositionSource::Best {
        return Err(Error::input(
            &recording.file,
            format!("no position from {:?}", options.position),
            "its three columns, not all zero",
            "choose another source of position, or the best",
        ));
    }
    let mut warnings = Vec::new();
    let axis = axis(&recording, &told, options, &mut warnings)?;
    if !unlogged.is_empty() {
        let names: Vec<&str> = unlogged.iter().map(|quantity| quantity.name()).collect();
        warnings.push(format!("not in the log: {}; zeros stand for it", names.join(", ")));
    }
    let writer = Writer { told: &told, options };
    let samples: Vec<FlightSample> =
        axis.stamps_s.iter().map(|&t| writer.sample(t, &axis)).collect();
    warnings.extend(writer.warn_of_held_values(&axis));
    warnings.extend(warn_of_size(&samples));
    let mut extra = extra(&recording, &told.used, &axis)?;
    let lights = lights(&mut extra);
    let mut all = recording.warnings;
    all.append(&mut warnings);
    let gaps = axis.gaps;
    Ok(Flight { samples, lights, extra, gaps, unlogged, warnings: all })
}

fn nothing_known(recording: &Recording) -> Error {
    let names: Vec<&str> = recording.names().collect();
    let found = if names.is_empty() {
        "no column with a sample".into()
    } else {
        format!("columns {}", shortened(&names))
    };
    Error::input(
        &recording.file,
        found,
        "a position (stateEstimate.x, ae483log.o_x, ae483log.p_x, mocap.x, lighthouse.x, x …), an \
         attitude, motors, or ranges (ranging.distance0 …)",
        "log stateEstimate.x/y/z and stateEstimate.yaw/pitch/roll, or name the columns of a CSV \
         file t, x, y, z, yaw, pitch, roll",
    )
}

fn unlogged(told: &Told) -> BTreeSet<Quantity> {
    let missing = [
        (Quantity::Position, told.position_m.is_none()),
        (Quantity::Attitude, told.attitude_rad.is_none()),
        (Quantity::Velocity, told.velocity.is_none()),
        (Quantity::Rate, told.rate_body_rad_s.is_none()),
        (Quantity::Estimate, told.estimate_m.is_none()),
        (Quantity::Design, told.design_m.is_none()),
        (Quantity::Motors, told.motors.is_none()),
    ];
    missing.into_iter().filter(|(_, missing)| *missing).map(|(quantity, _)| quantity).collect()
}

/// When the flight has samples.
struct Axis {
    /// On the clock of the recording.
    stamps_s: Vec<f64>,
    /// The stamp that becomes time zero.
    zero_s: f64,
    /// On the clock of the flight.
    gaps: Vec<[f64; 2]>,
}

impl Axis {
    fn time_s(&self, stamp_s: f64) -> f64 {
        on_grid(stamp_s - self.zero_s)
    }
}

/// A grid of `rate_hz` over the time in which position and attitude are both known, without the
/// holes. Without a pose there is nothing to interpolate: the stamps of the longest block stay.
fn axis(
    recording: &Recording,
    told: &Told,
    options: &ImportOptions,
    warnings: &mut Vec<String>,
) -> Result<Axis> {
    let pose: Vec<&Channel> = told.position_m.iter().chain(&told.attitude_rad).flatten().collect();
    if pose.is_empty() {
        let longest = recording.blocks.iter().max_by_key(|block| block.time_s.len());
        let stamps_s = longest.map_or(Vec::new(), |block| block.time_s.clone());
        let zero_s = stamps_s.first().copied().unwrap_or(0.0);
        return Ok(Axis { stamps_s, zero_s, gaps: Vec::new() });
    }
    // The motion capture may begin before the drone's log and outlast it.
    let drone = || recording.blocks.iter().filter(|block| block.clock == Clock::Drone);
    let first_s = drone().map(|block| block.time_s[0]).fold(f64::INFINITY, f64::min);
    let last_s = drone().map(|block| block.time_s[block.time_s.len() - 1]);
    let last_s = last_s.fold(f64::NEG_INFINITY, f64::max);
    let start_s = pose.iter().map(|channel| channel.start_s()).fold(first_s, f64::max);
    let end_s = pose.iter().map(|channel| channel.end_s()).fold(last_s, f64::min);
    let steps = ((end_s - start_s) * options.sample_rate_hz + 1e-6).floor();
    if steps.is_nan() || !(0.0..MAX_SAMPLES).contains(&steps) {
        let span = if steps < 0.0 {
            "position and attitude that were never logged at the same time".into()
        } else {
            format!("{:.0} s of log", end_s - start_s)
        };
        return Err(Error::input(
            &recording.file,
            span,
            format!("a flight of up to {MAX_SAMPLES:.0} samples"),
            "cut the log to one flight, or lower the sample rate",
        ));
    }
    let limits_s: Vec<f64> = pose.iter().map(|channel| gap_limit_s(channel, options)).collect();
    let known = |stamp_s: f64| {
        let mut channels = pose.iter().zip(&limits_s);
        channels.all(|(channel, limit_s)| channel.linear(stamp_s, *limit_s).is_some())
    };
    let mut axis = Axis { stamps_s: Vec::new(), zero_s: start_s, gaps: Vec::new() };
    let (mut last_s, mut step) = (None, 0.0);
    let mut skipped = false;
    while step <= steps {
        // The last step may lie beyond the end by rounding.
        let stamp_s = (start_s + step / options.sample_rate_hz).min(end_s);
        if known(stamp_s) {
            if let Some(last_s) = last_s.filter(|_| skipped) {
                axis.gaps.push([axis.time_s(last_s), axis.time_s(stamp_s)]);
            }
            axis.stamps_s.push(stamp_s);
            (last_s, skipped) = (Some(stamp_s), false);
        } else {
            skipped = true;
        }
        step += 1.0;
    }
    warnings.extend(warn_of_gaps(&axis));
    Ok(axis)
}

/// Samples further apart are not joined: the setting, or two and a half periods of a slower log.
fn gap_limit_s(channel: &Channel, options: &ImportOptions) -> f64 {
    options.max_gap_s.max(2.5 * channel.period_s.min(SLOWEST_PERIOD_S))
}

fn warn_of_gaps(axis: &Axis) -> Option<String> {
    let length_s = |gap: &[f64; 2]| gap[1] - gap[0];
    let longest = axis.gaps.iter().max_by(|a, b| length_s(a).total_cmp(&length_s(b)))?;
    let total_s: f64 = axis.gaps.iter().map(length_s).sum();
    let shown: Vec<String> =
        axis.gaps.iter().map(|gap| format!("{:.2}–{:.2} s", gap[0], gap[1])).collect();
    Some(format!(
        "{} gap(s) in the pose, {total_s:.2} s together, longest {:.2} s, left as holes: {}",
        axis.gaps.len(),
        length_s(longest),
        shortened(&shown),
    ))
}

/// No room is so large: positions farther out are probably in another unit.
const FARTHEST_M: f64 = 100.0;

fn warn_of_size(samples: &[FlightSample]) -> Option<String> {
    let farthest_m = samples.iter().map(|sample| sample.position_m.amax()).fold(0.0, f64::max);
    let text = format!(
        "the position reaches {farthest_m:.0} m: is it in metres? A column of millimetres is named \
         x_mm"
    );
    (farthest_m > FARTHEST_M).then_some(text)
}

/// Writes samples from channels.
struct Writer<'a> {
    told: &'a Told,
    options: &'a ImportOptions,
}

impl Writer<'_> {
    fn sample(&self, stamp_s: f64, axis: &Axis) -> FlightSample {
        let told = self.told;
        let vector = |channels: &Option<[Channel; 3]>| {
            channels.as_ref().map_or(Vector3::zeros(), |channels| self.measured(channels, stamp_s))
        };
        let held = |channel: &Channel| channel.held(stamp_s);
        let angles_rad = vector(&told.attitude_rad);
        let attitude = Attitude {
            yaw_rad: half_turn(angles_rad.x),
            pitch_rad: angles_rad.y,
            roll_rad: half_turn(angles_rad.z),
        };
        let velocity_body_m_s = match &told.velocity {
            None => Vector3::zeros(),
            Some((VelocityFrame::Body, channels)) => self.measured(channels, stamp_s),
            Some((VelocityFrame::World, channels)) => {
                body_from_world(self.measured(channels, stamp_s), attitude)
            }
        };
        let design_m = told.design_m.as_ref();
        let design_m = design_m.map_or(Vector3::zeros(), |c| Vector3::from(c.each_ref().map(held)));
        FlightSample {
            time_s: axis.time_s(stamp_s),
            position_m: vector(&told.position_m).map(on_grid),
            attitude: Attitude {
                yaw_rad: on_grid(attitude.yaw_rad),
                pitch_rad: on_grid(attitude.pitch_rad),
                roll_rad: on_grid(attitude.roll_rad),
            },
            velocity_body_m_s: velocity_body_m_s.map(on_grid),
            rate_body_rad_s: vector(&told.rate_body_rad_s).map(on_grid),
            estimate_m: vector(&told.estimate_m).map(on_grid),
            design_m: design_m.map(on_grid),
            motors: told.motors.as_ref().map_or([0.0; 4], |c| c.each_ref().map(held).map(on_grid)),
            letter: None,
        }
    }

    /// A measured vector: on the line between samples, held where they are too far apart.
    fn measured(&self, channels: &[Channel; 3], stamp_s: f64) -> Vector3<f64> {
        let value = |channel: &Channel| {
            let limit_s = gap_limit_s(channel, self.options);
            channel.linear(stamp_s, limit_s).unwrap_or_else(|| channel.held(stamp_s))
        };
        Vector3::from(channels.each_ref().map(value))
    }

    /// Says where a measured quantity other than the pose is held over gaps of its own.
    fn warn_of_held_values(&self, axis: &Axis) -> Vec<String> {
        let told = self.told;
        let velocity = told.velocity.as_ref().map(|(_, channels)| channels);
        let measured = [
            (Quantity::Velocity, velocity),
            (Quantity::Rate, told.rate_body_rad_s.as_ref()),
            (Quantity::Estimate, told.estimate_m.as_ref()),
        ];
        let held = |channels: &[Channel; 3]| {
            let unknown = |stamp_s: &&f64| {
                let mut channels = channels.iter();
                channels.any(|c| c.linear(**stamp_s, gap_limit_s(c, self.options)).is_none())
            };
            axis.stamps_s.iter().filter(unknown).count()
        };
        let counted = measured.into_iter().filter_map(|(q, c)| Some((q, held(c?))));
        let some = counted.filter(|(_, n)| *n > 0);
        let n_all = axis.stamps_s.len();
        some.map(|(quantity, n)| {
            format!(
                "{}: held in {n} of {n_all} samples, where its own log has gaps",
                quantity.name()
            )
        })
        .collect()
    }
}

/// The same angle within (−π, π].
fn half_turn(angle_rad: f64) -> f64 {
    let turns = (angle_rad / std::f64::consts::TAU - 0.5).ceil();
    angle_rad - turns * std::f64::consts::TAU
}

/// All columns that no quantity is made of, held.
fn extra(
    recording: &Recording,
    used: &BTreeSet<String>,
    axis: &Axis,
) -> Result<BTreeMap<String, Vec<f64>>> {
    let names: Vec<&str> = recording.names().filter(|name| !used.contains(*name)).collect();
    if names.len().saturating_mul(axis.stamps_s.len()) > MAX_EXTRA_CELLS {
        return Err(Error::input(
            &recording.file,
            format!("{} further columns over {} samples", names.len(), axis.stamps_s.len()),
            format!("at most {MAX_EXTRA_CELLS} numbers"),
            "cut the log to one flight, or lower the sample rate",
        ));
    }
    let mut extra = BTreeMap::new();
    for name in names {
        let Some(channel) = recording.channel(name) else { continue };
        let mut title = extra_name(name);
        while extra.contains_key(&title) {
            title.push('_');
        }
        let values = axis.stamps_s.iter().map(|&stamp_s| on_grid(channel.held(stamp_s)));
        extra.insert(title, values.collect());
    }
    Ok(extra)
}

/// Takes the columns `light.<channel>` with levels from 0 to 1 out of the further ones.
fn lights(extra: &mut BTreeMap<String, Vec<f64>>) -> BTreeMap<String, Vec<f64>> {
    let is_level = |level: &f64| (0.0..=1.0).contains(level);
    let channel = |name: &str| name.strip_prefix("log.light.").map(str::to_owned);
    let lights = extra.iter().filter(|(_, levels)| levels.iter().all(is_level));
    let lights: BTreeMap<_, _> =
        lights.filter_map(|(name, levels)| Some((channel(name)?, levels.clone()))).collect();
    extra.retain(|name, _| channel(name).is_none_or(|channel| !lights.contains_key(&channel)));
    lights
}

/// The name of a further column in a flight file: as logged, without the signs that a CSV header
/// cannot hold, and apart from the file's own columns.
fn extra_name(name: &str) -> String {
    let odd = |c: char| matches!(c, ',' | '"' | '#') || c.is_control() || c.is_whitespace();
    let plain: String = name.trim().chars().map(|c| if odd(c) { '_' } else { c }).collect();
    if is_standard_column(&plain) || plain.is_empty() { format!("log.{plain}") } else { plain }
}
