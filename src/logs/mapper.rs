//! Converts a recording to a flight with one time axis. Gaps are listed, and unused columns kept.

use std::collections::{BTreeMap, BTreeSet};

use super::recording::{Channel, Clock, Recording, shortened};
use super::sources::{Quantities, quantities};
use super::{ImportOptions, OnClock, PositionSource, speed};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Place, Result};
use noctograph_core::files::Budget;
use noctograph_core::flight::csv::is_standard_column;
use noctograph_core::flight::table::{MAX_DURATION_S, MILLISECONDS_HINT, on_grid};
use noctograph_core::flight::timestamps::SLOWEST_PERIOD_S;
use noctograph_core::flight::{Flight, FlightData, FlightSample, Quantity, warning};
use noctograph_core::input_error;
use noctograph_core::lamps::HEADLIGHTS;
use noctograph_core::product::MAX_QUANTITY;

/// Work budget in steps for looking up a channel's value at one time.
const STEPS: usize = 50;

/// Converts a recording with repaired times to a flight. Returns [`Error::Input`] for a log without
/// a usable quantity, and for implausible numbers.
pub(super) fn flight(
    mut recording: Recording,
    options: &ImportOptions,
    budget: &Budget,
) -> Result<OnClock> {
    // Columns that no quantity uses are kept as extra columns.
    let quantities = quantities(&recording, options.position);
    let unlogged = Quantity::TABLE.iter().map(|(quantity, ..)| *quantity);
    let unlogged: BTreeSet<_> =
        unlogged.filter(|quantity| !quantities.channels.contains_key(quantity)).collect();
    let position = quantities.channels.get(&Quantity::Position).map_or(&[][..], Vec::as_slice);
    check_quantities(&recording, &quantities, options.position)?;
    let too_fast = speed::check(position, options, &recording.file)?;
    recording.warnings.extend(warn_of_unknown(&recording, &quantities));

    // Samples and extra columns are resampled on one time axis.
    let mapper = Mapper { recording: &recording, quantities: &quantities, options };
    let axis = mapper.axis(budget)?;
    let n_channels = quantities.channels.values().map(Vec::len).sum::<usize>();
    let n_extra = recording.names().filter(|name| !quantities.used.contains(*name)).count();
    let n_samples = axis.stamps_s.len();
    let sample_bytes = size_of::<FlightSample>() + size_of::<f64>() * n_extra;
    budget.bytes(n_samples.saturating_mul(sample_bytes))?;
    budget.steps((STEPS * n_samples).saturating_mul(n_channels + n_extra))?;
    let samples: Vec<FlightSample> =
        axis.stamps_s.iter().map(|&stamp_s| mapper.sample(stamp_s, axis.time_s(stamp_s))).collect();
    check_numbers(&recording.file, &samples)?;
    let mut extra = mapper.extra(&axis.stamps_s);

    let held = mapper.warn_of_held_values(&axis.stamps_s);
    let mut warnings = recording.warnings;
    warnings.extend(quantities.warnings);
    warnings.extend(too_fast);
    warnings.extend(warn_of_gaps(&axis.gaps));
    warnings.extend(held);
    warnings.extend(warn_of_size(&samples));
    warnings.extend(warn_of_incomplete(&extra));
    warnings.extend(warning::unlogged(&unlogged));
    let (lights, gaps) = (lights(&mut extra), axis.gaps);
    let flight = Flight::new(FlightData { samples, lights, extra, gaps, unlogged, warnings })?;
    let zero_stamp_s = recording.is_stamped.then_some(axis.zero_s);
    Ok(OnClock { flight, zero_stamp_s, firmware: recording.firmware })
}

/// Returns [`Error::Input`] for a log without any quantity, or without the requested position.
fn check_quantities(
    recording: &Recording,
    quantities: &Quantities,
    wanted: PositionSource,
) -> Result<()> {
    if quantities.channels.is_empty() && !recording.names().any(|name| name.starts_with("ranging."))
    {
        return Err(nothing_known(recording));
    }
    // Ranges are sufficient, unless a specific position source was requested.
    if quantities.channels.contains_key(&Quantity::Position) || wanted == PositionSource::Best {
        return Ok(());
    }
    Err(Error::input(
        Place::file(&recording.file),
        format_args!("no position from {}", wanted.name()),
        "its three columns, not all zero",
        "choose another position source, such as best",
    ))
}

/// Returns a warning that lists unknown columns that no quantity uses.
fn warn_of_unknown(recording: &Recording, quantities: &Quantities) -> Option<Diagnostic> {
    let columns = recording.blocks.iter().flat_map(|block| &block.columns);
    let unused = columns.filter(|column| !quantities.used.contains(&column.name));
    let names: Vec<&str> = unused.filter_map(|column| column.unknown.as_deref()).collect();
    let text = format!("unknown columns are kept unchanged: {}", names.join(", "));
    (!names.is_empty()).then(|| Diagnostic::warning("columns-unknown", text))
}

/// Returns the error for a log without a usable quantity, which lists the log's columns.
fn nothing_known(recording: &Recording) -> Error {
    let names: Vec<&str> = recording.names().collect();
    let columns = if names.is_empty() {
        let notes = recording.warnings.iter().map(|note| format!("; {note}"));
        format!("no column with a sample{}", notes.collect::<String>())
    } else {
        format!("columns {}", names.join(", "))
    };
    Error::input(
        Place::file(&recording.file),
        columns,
        "a position (stateEstimate.x, ae483log.o_x, ae483log.p_x, mocap.x, lighthouse.x, x …), an \
         attitude, motors, or ranges (ranging.distance0 …)",
        "log stateEstimate.x/y/z and stateEstimate.yaw/pitch/roll, or name the columns of a CSV \
         file t, x, y, z, yaw, pitch, roll",
    )
}

/// Time axis of a flight.
struct Axis {
    /// Times of the samples on the recording's clock.
    stamps_s: Vec<f64>,
    /// Recording time that becomes zero.
    zero_s: f64,
    gaps: Vec<[f64; 2]>,
}

impl Axis {
    /// Converts a recording time to a flight time.
    fn time_s(&self, stamp_s: f64) -> f64 {
        on_grid(stamp_s - self.zero_s)
    }
}

/// Inputs of the conversion to a flight.
struct Mapper<'a> {
    recording: &'a Recording,
    quantities: &'a Quantities,
    options: &'a ImportOptions,
}

impl Mapper<'_> {
    /// Returns a grid at the sample rate over the time covered by both position and attitude,
    /// without gaps. Without a pose, returns the times of the longest block. Returns
    /// [`Error::Input`] if position and attitude were never logged at once, or for more than an
    /// hour.
    fn axis(&self, budget: &Budget) -> Result<Axis> {
        let Self { recording, quantities, options } = self;
        let pose = [Quantity::Position, Quantity::Attitude].into_iter().flat_map(|quantity| {
            let channels = quantities.channels.get(&quantity).into_iter().flatten();
            channels.map(move |channel| (quantity, channel))
        });
        let pose: Vec<(Quantity, &Channel)> = pose.collect();
        if pose.is_empty() {
            let longest = recording.blocks.iter().max_by_key(|block| block.time_s.len());
            let stamps_s = longest.map_or(Vec::new(), |block| block.time_s.clone());
            let zero_s = stamps_s.first().copied().unwrap_or(0.0);
            check_span(recording, stamps_s.last().copied().unwrap_or(0.0) - zero_s)?;
            return Ok(Axis { stamps_s, zero_s, gaps: Vec::new() });
        }
        // The motion capture recording may start earlier and end later than the drone's log.
        let drone = recording.blocks.iter().filter(|block| block.clock == Clock::Drone);
        let first_s = drone.clone().map(|block| block.time_s[0]).fold(f64::INFINITY, f64::min);
        let last_s = drone.map(|block| block.time_s[block.time_s.len() - 1]);
        let last_s = last_s.fold(f64::NEG_INFINITY, f64::max);
        let start_s = pose.iter().map(|(_, channel)| channel.start_s()).fold(first_s, f64::max);
        let end_s = pose.iter().map(|(_, channel)| channel.end_s()).fold(last_s, f64::min);
        let span_s = end_s - start_s;
        check_span(recording, span_s)?;
        // A span that is whole up to rounding contains its last step.
        let last_step = (span_s * options.sample_rate_hz + 1e-6).floor();
        if last_step < 0.0 {
            let log = "position and attitude that were never logged at the same time";
            let hint = "cut the log to one flight that contains both";
            return Err(Error::input(Place::file(&recording.file), log, "both at once", hint));
        }
        #[expect(clippy::cast_possible_truncation, reason = "an hour at a kilohertz is below 4e6")]
        let last_step = last_step as u32;
        budget.steps(STEPS * last_step as usize * pose.len())?;
        // Grid times in gaps are dropped. Rounding may put the last one beyond the end.
        let steps = (0..=last_step)
            .map(|step| (step, (start_s + f64::from(step) / options.sample_rate_hz).min(end_s)))
            .filter(|(_, stamp_s)| {
                pose.iter().all(|pose| self.interpolated(*pose, *stamp_s).is_some())
            });
        let steps: Vec<(u32, f64)> = steps.collect();
        let stamps_s = steps.iter().map(|(_, stamp_s)| *stamp_s).collect();
        let mut axis = Axis { stamps_s, zero_s: start_s, gaps: Vec::new() };
        let gaps = steps.windows(2).filter(|pair| pair[1].0 - pair[0].0 > 1);
        axis.gaps = gaps.map(|pair| [0, 1].map(|end| axis.time_s(pair[end].1))).collect();
        Ok(axis)
    }

    /// Interpolates a measured value in the quantity's unit. Returns `None` in gaps that exceed
    /// both the setting and two and a half periods of a slower log.
    fn interpolated(&self, (quantity, channel): (Quantity, &Channel), stamp_s: f64) -> Option<f64> {
        /// Longest gap in periods, in which one sample is missing.
        const GAP_PERIODS: f64 = 2.5;
        let factor = if quantity == Quantity::Attitude { ATTITUDE_GAPS } else { 1.0 };
        let gap_s =
            self.options.max_gap_s.max(GAP_PERIODS * channel.period_s.min(SLOWEST_PERIOD_S));
        channel.linear(stamp_s, factor * gap_s)
    }

    /// Returns the sample at a time, given on both the recording's and the flight's clock. Numbers
    /// are rounded as in a file.
    fn sample(&self, stamp_s: f64, time_s: f64) -> FlightSample {
        let mut numbers = FlightSample::default().numbers();
        for (&quantity, channels) in &self.quantities.channels {
            // Setpoints and commands are held until the next value.
            let is_held = matches!(quantity, Quantity::Design | Quantity::Motors);
            for (cell, channel) in numbers[quantity.places()].iter_mut().zip(channels) {
                let interpolated =
                    (!is_held).then(|| self.interpolated((quantity, channel), stamp_s));
                *cell = interpolated.flatten().unwrap_or_else(|| channel.held(stamp_s));
            }
        }
        // Interpolated angles may be outside ±π.
        let mut sample = FlightSample::from_numbers(numbers);
        sample.attitude.yaw_rad = wrapped_angle(sample.attitude.yaw_rad);
        sample.attitude.roll_rad = wrapped_angle(sample.attitude.roll_rad);
        if self.quantities.has_world_velocity {
            let body_from_world = sample.attitude.world_from_body().transpose();
            sample.velocity_body_m_s = body_from_world * sample.velocity_body_m_s;
        }
        FlightSample { time_s, ..FlightSample::from_numbers(sample.numbers().map(on_grid)) }
    }

    /// Returns warnings about measured quantities, except the pose, that are held over gaps.
    fn warn_of_held_values(&self, stamps_s: &[f64]) -> Vec<Diagnostic> {
        let mut warnings = Vec::new();
        for quantity in [Quantity::Velocity, Quantity::Rate, Quantity::Estimate] {
            let channels = self.quantities.channels.get(&quantity).into_iter().flatten();
            let held = stamps_s.iter().filter(|stamp_s| {
                let mut channels = channels.clone();
                channels.any(|channel| self.interpolated((quantity, channel), **stamp_s).is_none())
            });
            let (n, n_all, name) = (held.count(), stamps_s.len(), quantity.name());
            if n > 0 {
                let text = format!(
                    "{name}: held in {n} of {n_all} samples, because its log block has \
                             gaps"
                );
                warnings.push(Diagnostic::warning("values-held", text));
            }
        }
        warnings
    }

    /// Returns all columns that belong to no quantity, with each value held until the next one.
    fn extra(&self, stamps_s: &[f64]) -> BTreeMap<String, Vec<f64>> {
        let mut extra = BTreeMap::new();
        let used = &self.quantities.used;
        for name in self.recording.names().filter(|name| !used.contains(*name)) {
            let Some(channel) = self.recording.channel(name) else { continue };
            // Replacing characters that a header cannot contain may make two names equal.
            let mut title = extra_name(name);
            while extra.contains_key(&title) {
                title.push('_');
            }
            let values = stamps_s.iter().map(|&stamp_s| on_grid(channel.held(stamp_s)));
            extra.insert(title, values.collect());
        }
        extra
    }
}

/// Returns [`Error::Input`] for a log longer than [`MAX_DURATION_S`].
fn check_span(recording: &Recording, span_s: f64) -> Result<()> {
    if span_s <= MAX_DURATION_S {
        return Ok(());
    }
    let wanted = format!("a flight of up to {MAX_DURATION_S} s");
    let place = Place::file(&recording.file);
    Err(input_error!(place, "{span_s:.0} s of log", "{wanted}", "{MILLISECONDS_HINT}"))
}

/// Returns [`Error::Input`] if a sample contains NaN or a number beyond [`MAX_QUANTITY`].
fn check_numbers(file: &str, samples: &[FlightSample]) -> Result<()> {
    for sample in samples {
        let numbers = sample.numbers();
        for (quantity, _, names) in Quantity::TABLE {
            for (name, value) in names.iter().zip(&numbers[quantity.places()]) {
                // The test for NaN also rejects missing numbers.
                if value.is_nan() || value.abs() > MAX_QUANTITY {
                    let error = input_error!(
                        format!("{name} at {:.3} s of the flight", sample.time_s),
                        "{value:e}",
                        "a number within ±{MAX_QUANTITY:e}",
                        "cut the broken part out of the log, or correct the column's unit",
                    );
                    return Err(error.in_file(file, None));
                }
            }
        }
    }
    Ok(())
}

/// Returns a warning that lists columns of a quantity whose other columns are missing.
fn warn_of_incomplete(extra: &BTreeMap<String, Vec<f64>>) -> Option<Diagnostic> {
    let kept = extra.keys().filter_map(|name| name.strip_prefix("log."));
    let incomplete =
        kept.filter(|name| Quantity::TABLE.iter().any(|(.., names)| names.contains(name)));
    let incomplete: Vec<&str> = incomplete.collect();
    let (first, names) = (incomplete.first()?, incomplete.join(", "));
    let text = format!("{names} without the other columns of the quantity: kept as log.{first}");
    Some(Diagnostic::warning("quantity-in-part", text))
}

/// Ratio of the maximum interpolated gap in attitude to that in position, which is 1 s by default.
/// A tilt of 0.1 rad displaces a lamp 5 cm from the body's center by only 5 mm.
const ATTITUDE_GAPS: f64 = 4.0;

/// Returns a warning that lists the gaps, if there are any.
fn warn_of_gaps(gaps: &[[f64; 2]]) -> Option<Diagnostic> {
    let lengths_s = gaps.iter().map(|[from_s, to_s]| to_s - from_s);
    let longest_s = lengths_s.clone().max_by(f64::total_cmp)?;
    let (n, total_s): (_, f64) = (gaps.len(), lengths_s.sum());
    let shown = gaps.iter().map(|[from_s, to_s]| format!("{from_s:.2}–{to_s:.2} s"));
    let shown = shortened(&shown.collect::<Vec<_>>());
    let text = format!(
        "{n} gap(s) in the pose left out, {total_s:.2} s in total, {longest_s:.2} s at most: {shown}"
    );
    Some(Diagnostic::warning("gaps", text))
}

/// Largest plausible coordinate. Beyond it, the unit is probably wrong.
const FARTHEST_M: f64 = 100.0;

/// Returns a warning if a position is beyond [`FARTHEST_M`].
pub(super) fn warn_of_size(samples: &[FlightSample]) -> Option<Diagnostic> {
    let farthest_m = samples.iter().map(|sample| sample.position_m.amax()).fold(0.0, f64::max);
    let text = format!(
        "the position reaches {farthest_m:.0} m: is it in meters? A column of millimeters is named \
         x_mm"
    );
    (farthest_m > FARTHEST_M).then(|| Diagnostic::warning("position-far", text))
}

/// Returns the equivalent angle in (−π, π].
fn wrapped_angle(angle_rad: f64) -> f64 {
    let turns = (angle_rad / std::f64::consts::TAU - 0.5).ceil();
    angle_rad - turns * std::f64::consts::TAU
}

/// Removes the columns `light.<channel>` with levels from 0 to 1 from the extra columns, and
/// returns them by channel. A column named `light` stands for the headlights.
fn lights(extra: &mut BTreeMap<String, Vec<f64>>) -> BTreeMap<String, Vec<f64>> {
    let mut lights = BTreeMap::new();
    let are_named = extra.contains_key("log.light.headlights");
    extra.retain(|name, levels| {
        let are_levels = levels.iter().all(|level| (0.0..=1.0).contains(level));
        let channel = match name.strip_prefix("log.light") {
            Some("") if !are_named => Some(HEADLIGHTS),
            rest => rest.and_then(|rest| rest.strip_prefix('.')),
        };
        let channel = channel.filter(|_| are_levels);
        lights.extend(channel.map(|channel| (channel.to_owned(), std::mem::take(levels))));
        channel.is_none()
    });
    lights
}

/// Returns the name of an extra column in a flight file: the logged name without characters that a
/// CSV header cannot contain, and distinct from standard columns.
fn extra_name(name: &str) -> String {
    let plain = name.trim().replace(
        |c: char| matches!(c, ',' | '"' | '#') || c.is_control() || c.is_whitespace(),
        "_",
    );
    if is_standard_column(&plain) || plain.is_empty() { format!("log.{plain}") } else { plain }
}
