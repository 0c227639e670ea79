//! Sources of quantities: selects the logged variables from which a flight is made.
//!
//! Each quantity uses the first source, in order of preference ([`super::source_tables`]), that is
//! logged, plausible and live. A source is plausible if its numbers are possible for a drone, and
//! live if it changes while others do. A quantity that is frozen while the drone moves counts as
//! not logged. Warnings list everything that is ignored.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::Vector3;

use super::PositionSource::{self, Custom, Firmware};
use super::recording::{Channel, Recording, names, shortened};
use super::source_tables::{
    ANY, ATTITUDE, COMPRESSED_QUATERNION, DESIGN, MOTORS, POSITION, QUATERNIONS, RATE, Source,
    VELOCITY_BODY, VELOCITY_WORLD,
};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::flight::Quantity;
use noctograph_core::flight::table::on_grid;
use noctograph_core::geometry::Attitude;
use noctograph_core::product::MAX_QUANTITY;

/// Minimum time over which a live source changes, relative to the source that changes longest.
const ALIVE_FRACTION: f64 = 0.1;

/// Minimum range of a moving drone's positions, which exceeds the position noise at rest.
const MOVES_M: f64 = 0.1;

/// Codes of the warnings about a heading without an attitude, and about a diverged source.
const YAW_ONLY: &str = "yaw-only";
const DIVERGED: &str = "source-diverged";

/// Minimum speed and distance of a jump to (0, 0, 0) for zeros to count as a lost body.
const LOST_M_S: f64 = 5.0;
const LOST_M: f64 = 0.2;

/// Quantities in a log.
#[derive(Debug)]
pub(super) struct Quantities {
    /// Channels of each quantity, in the order of a flight file, with yaw and roll unwrapped.
    pub(super) channels: BTreeMap<Quantity, Vec<Channel>>,
    /// True if the velocity is in the world frame, false if it is in the body frame.
    pub(super) has_world_velocity: bool,
    /// Names of the variables that the channels are made of.
    pub(super) used: BTreeSet<String>,
    pub(super) warnings: Vec<Diagnostic>,
}

/// A search through the tables of sources.
struct Search<'a> {
    recording: &'a Recording,
    used: BTreeSet<String>,
    warnings: Vec<Diagnostic>,
}

/// Returns true for the first variable of a position source.
pub(super) fn is_position(name: &str) -> bool {
    POSITION.iter().any(|source| names(source.1).next().is_some_and(|first| first == name))
}

/// Returns the position from the requested source, if it was logged.
pub(super) fn position(recording: &Recording, wanted: PositionSource) -> Option<Vec<Channel>> {
    Search::new(recording).position(wanted.kinds())
}

/// Returns each quantity from its best source. `wanted` applies to position and attitude.
pub(super) fn quantities(recording: &Recording, wanted: PositionSource) -> Quantities {
    let mut search = Search::new(recording);
    let (any, truth) = (ANY, wanted.kinds());
    // The order of these quantities also determines the order of their warnings.
    let mut channels = BTreeMap::new();
    for (quantity, taken) in [
        (Quantity::Position, search.position(truth)),
        (Quantity::Rate, search.of_kinds(RATE, any)),
        (Quantity::Estimate, search.of_kinds(POSITION, &[Custom, Firmware])),
        (Quantity::Design, search.of_kinds(DESIGN, any)),
        (Quantity::Motors, search.of_kinds(MOTORS, any)),
    ] {
        channels.extend(taken.map(|taken| (quantity, taken)));
    }
    // The firmware's velocity in the world frame takes precedence over that in the body frame.
    let (first, last): (Vec<_>, Vec<_>) = VELOCITY_BODY.iter().partition(|s| s.0 != Firmware);
    let velocity = search.first(first.into_iter().chain(VELOCITY_WORLD).chain(last));
    let has_world_velocity =
        velocity.as_ref().is_some_and(|(source, _)| VELOCITY_WORLD.iter().any(|w| w.1 == source.1));
    channels.extend(velocity.map(|(_, taken)| (Quantity::Velocity, taken)));
    channels.extend(search.attitude(truth).map(|taken| (Quantity::Attitude, taken)));
    // A quantity that is frozen while the drone moves counts as not logged.
    let moving_s = moving_s(channels.get(&Quantity::Position));
    channels.retain(|quantity, channels| search.is_logged(*quantity, channels, moving_s));
    let Search { used, warnings, .. } = search;
    Quantities { channels, has_world_velocity, used, warnings }
}

/// Returns the time in s for which a drone moves, which is zero for a drone at rest.
fn moving_s(position: Option<&Vec<Channel>>) -> f64 {
    let moving = position.into_iter().flatten().filter(|channel| {
        let values = channel.values.iter().copied();
        let highest_m = values.clone().fold(f64::NEG_INFINITY, f64::max);
        highest_m - values.fold(f64::INFINITY, f64::min) >= MOVES_M
    });
    moving.map(active_s).fold(0.0, f64::max)
}

impl<'a> Search<'a> {
    /// Returns a search before its first quantity.
    fn new(recording: &'a Recording) -> Self {
        Self { recording, used: BTreeSet::new(), warnings: Vec::new() }
    }

    /// Returns the position, without the zeros that stand for a lost body.
    fn position(&mut self, kinds: &[PositionSource]) -> Option<Vec<Channel>> {
        let channels = self.of_kinds(POSITION, kinds)?;
        Some(self.without_zeros(channels))
    }

    /// Returns the channels of a table's best source of the given kinds.
    fn of_kinds(&mut self, table: &[Source], kinds: &[PositionSource]) -> Option<Vec<Channel>> {
        let sources = table.iter().filter(|source| kinds.contains(&source.0));
        Some(self.first(sources)?.1)
    }

    /// Returns the first plausible and live source in SI units, and adds it to the used variables.
    /// If no source changes, returns the first nonzero one, otherwise the first. Returns `None` if
    /// no source is logged completely, or if all diverged, except
    /// that a diverged position is returned.
    fn first<'s>(
        &mut self,
        sources: impl Iterator<Item = &'s Source>,
    ) -> Option<(&'s Source, Vec<Channel>)> {
        let logged = sources.filter_map(|source| {
            let mut channels = self.recording.channels(source.1)?;
            for (channel, factor) in channels.iter_mut().zip(source.2) {
                channel.values.iter_mut().for_each(|value| *value *= factor);
            }
            Some((source, channels))
        });
        // A source is plausible if its numbers are in range.
        let (mut logged, diverged): (Vec<_>, Vec<_>) = logged
            .partition(|(_, channels)| numbers(channels).all(|value| value.abs() <= MAX_QUANTITY));
        if let Some((source, _)) = diverged.first() {
            self.warn_of_diverged(source, !logged.is_empty());
        }
        // If the only position diverged, the log is rejected later, at the first number out of
        // range.
        if logged.is_empty() {
            logged = diverged;
            logged.retain(|(source, _)| POSITION.iter().any(|p| p.1 == source.1));
        }
        // A source is live if it changes for about as long as others do. An observer that did not
        // run logs a constant.
        let active_s =
            logged.iter().map(|(_, channels)| channels.iter().map(active_s).fold(0.0, f64::max));
        let most_s = active_s.clone().fold(0.0, f64::max);
        let mut alive = active_s.zip(&logged).map(|(active_s, (_, channels))| {
            if most_s > 0.0 {
                active_s >= ALIVE_FRACTION * most_s
            } else {
                numbers(channels).any(|value| *value != 0.0)
            }
        });
        let first = alive.position(|is_alive| is_alive).unwrap_or(0);
        let (source, channels) = logged.into_iter().nth(first)?;
        self.used.extend(names(source.1));
        Some((source, channels))
    }

    /// Adds a warning.
    fn warn(&mut self, code: &'static str, message: String) {
        self.warnings.push(Diagnostic::warning(code, message));
    }

    /// Warns of a source whose numbers are out of range, once for each source. `is_replaced` is
    /// true if another source has the same quantity.
    fn warn_of_diverged(&mut self, source: &Source, is_replaced: bool) {
        let names = shortened(&names(source.1).collect::<Vec<_>>());
        let instead =
            if is_replaced { "is replaced by another source" } else { "counts as not logged" };
        let text =
            format!("{names} exceeds ±{MAX_QUANTITY:e}, like a diverged observer, and {instead}");
        if !self.warnings.iter().any(|known| known.code == DIVERGED && known.detail() == names) {
            self.warnings.push(Diagnostic::warning(DIVERGED, text).detailed(names));
        }
    }

    /// True if a quantity counts as logged. The quantity must change while the drone moves, and so
    /// must each motor. A nonzero setpoint may be constant, and so may a heading if pitch and roll
    /// are zero. `moving_s` is the time for which the drone moves.
    fn is_logged(&mut self, quantity: Quantity, channels: &[Channel], moving_s: f64) -> bool {
        /// Angle up to which it is zero in a file, rad.
        const ZERO_RAD: f64 = 1e-6;
        let active = channels.iter().map(active_s);
        let active_s = match quantity {
            Quantity::Motors => active.fold(f64::INFINITY, f64::min),
            _ => active.fold(0.0, f64::max),
        };
        let may_stay = quantity == Quantity::Position
            || quantity == Quantity::Design && numbers(channels).any(|value| *value != 0.0);
        if may_stay || active_s >= ALIVE_FRACTION * moving_s {
            return true;
        }
        // The quantity is frozen. Only a heading with zero pitch and roll is kept.
        let last = channels.iter().map(|channel| channel.values[channel.values.len() - 1]);
        let last: Vec<f64> = last.collect();
        if let (Quantity::Attitude, [yaw, pitch, roll]) = (quantity, &last[..])
            && yaw.abs() > ZERO_RAD
            && [pitch, roll].iter().all(|angle| angle.abs() < ZERO_RAD)
        {
            if !self.warnings.iter().any(|known| known.code == YAW_ONLY) {
                let text = format!(
                    "pitch and roll are zero while the drone moves for {moving_s:.1} s: they were \
                     not logged; the yaw, {yaw:.3} rad throughout, is kept"
                );
                self.warn(YAW_ONLY, text);
            }
            return true;
        }
        let values = last.iter().map(|value| {
            let text = format!("{:.6}", on_grid(*value));
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        });
        let (name, values) = (quantity.name(), values.collect::<Vec<_>>().join(", "));
        let text = format!(
            "{name}: frozen at {values} while the drone moves for {moving_s:.1} s: treated as not \
             logged"
        );
        self.warn("source-frozen", text);
        false
    }

    /// Returns the attitude from the position's source or, in order of preference, from another
    /// source, from quaternions, or from the yaw only.
    fn attitude(&mut self, truth: &[PositionSource]) -> Option<Vec<Channel>> {
        let (preferred, others): (Vec<_>, Vec<_>) =
            ATTITUDE.iter().partition(|source| truth.contains(&source.0));
        let sources: Vec<&Source> = preferred.into_iter().chain(others).collect();
        let angles = self.first(sources.iter().copied()).map(|(_, channels)| channels);
        // Angles that are frozen while quaternions change come from an observer that did not run.
        let quaternions = if angles.as_deref().is_some_and(is_alive) {
            None
        } else {
            self.angles_from_quaternions()
        };
        let mut angles = quaternions
            .filter(|turned| angles.is_none() || is_alive(turned))
            .or(angles)
            .or_else(|| self.level(&sources))?;
        unwrap_angle(&mut angles[0]);
        unwrap_angle(&mut angles[2]);
        Some(angles)
    }

    /// Returns a level attitude with the logged yaw, rad. Returns `None` if no yaw is logged.
    fn level(&mut self, sources: &[&Source]) -> Option<Vec<Channel>> {
        let (name, factor, mut yaw) = sources.iter().find_map(|source| {
            let name = names(source.1).next()?;
            let yaw = self.recording.channel(&name)?;
            Some((name, source.2.first().copied().unwrap_or(1.0), yaw))
        })?;
        // The assumption of zero pitch and roll displaces the lamp by only millimeters.
        yaw.values.iter_mut().for_each(|value| *value *= factor);
        let text = "of the attitude, only the yaw is logged";
        self.warn(YAW_ONLY, format!("{text} ({name}): the drone is assumed to be level"));
        self.used.insert(name);
        let level = Channel::new(yaw.time_s.clone(), vec![0.0; yaw.values.len()]);
        Some(vec![yaw, level.clone(), level])
    }

    /// Returns the yaw, pitch and roll of logged quaternions in rad, or `None` if there are none.
    fn angles_from_quaternions(&mut self) -> Option<Vec<Channel>> {
        // Compressed quaternions come last, because their error is up to 0.1°.
        let quaternions: Vec<(f64, [f64; 4])> =
            if let Some((_, parts)) = self.first(QUATERNIONS.iter()) {
                let times_s = parts[0].time_s.iter().copied();
                times_s.map(|t| (t, [0, 1, 2, 3].map(|part| parts[part].held(t)))).collect()
            } else {
                let packed = self.recording.channel(COMPRESSED_QUATERNION)?;
                self.used.insert(COMPRESSED_QUATERNION.to_owned());
                packed.time_s.into_iter().zip(packed.values.into_iter().map(decompressed)).collect()
            };
        /// Squared length of a missing quaternion, whose parts are all zero. A valid one is near 1.
        const MISSING: f64 = 1e-6;
        let valid = quaternions
            .into_iter()
            .filter(|(_, q)| q.iter().map(|part| part * part).sum::<f64>() > MISSING);
        let (time_s, attitudes): (Vec<f64>, Vec<Attitude>) =
            valid.map(|(time_s, q)| (time_s, attitude_from_quaternion(q))).unzip();
        let angles: [fn(&Attitude) -> f64; 3] = [|a| a.yaw_rad, |a| a.pitch_rad, |a| a.roll_rad];
        (!time_s.is_empty()).then(|| {
            angles
                .map(|angle| Channel::new(time_s.clone(), attitudes.iter().map(angle).collect()))
                .into()
        })
    }

    /// Removes positions (0, 0, 0) to or from which the drone would jump, with a warning. Motion
    /// capture writes them for a lost body.
    fn without_zeros(&mut self, mut channels: Vec<Channel>) -> Vec<Channel> {
        let [x, y, z] = &channels[..] else { return channels };
        if x.time_s != y.time_s || x.time_s != z.time_s {
            return channels;
        }
        let positions_m: Vec<Vector3<f64>> = (0..x.values.len())
            .map(|i| Vector3::new(x.values[i], y.values[i], z.values[i]))
            .collect();
        // A jump is both long and fast.
        let jumps = positions_m.windows(2).zip(x.time_s.windows(2)).map(|(pair_m, time_s)| {
            let apart_m = (pair_m[1] - pair_m[0]).norm();
            apart_m > LOST_M && apart_m > LOST_M_S * (time_s[1] - time_s[0])
        });
        let jumps: Vec<bool> = jumps.collect();
        let (zero_m, n, mut lost) =
            (Vector3::zeros(), positions_m.len(), vec![false; positions_m.len()]);
        let mut end = 0;
        for run in positions_m.chunk_by(|a, b| (*a == zero_m) == (*b == zero_m)) {
            let start = end;
            end += run.len();
            let has_jump = start > 0 && jumps[start - 1] || end < n && jumps[end - 1];
            lost[start..end].fill(run[0] == zero_m && has_jump);
        }
        let count = lost.iter().filter(|lost| **lost).count();
        if count == 0 || count == n {
            return channels;
        }
        let first_s = x.time_s[lost.iter().position(|lost| *lost).unwrap_or(0)] - x.time_s[0];
        let text = format!(
            "{count} of {n} positions are 0, 0, 0, which the drone could only have reached by \
             jumping (first: {first_s:.2} s after the first sample): they are left out"
        );
        self.warn("position-lost", text);
        for channel in &mut channels {
            let samples = channel.time_s.iter().zip(&channel.values).zip(&lost);
            let kept =
                samples.filter(|(_, lost)| !**lost).map(|((time_s, value), _)| (*time_s, *value));
            let (time_s, values) = kept.unzip();
            *channel = Channel::new(time_s, values);
        }
        channels
    }
}

/// True if any angle changes for some time. The angles of a dead source are constant.
fn is_alive(angles: &[Channel]) -> bool {
    angles.iter().any(|angle| active_s(angle) > 0.0)
}

/// Returns the values of all channels.
fn numbers(channels: &[Channel]) -> impl Iterator<Item = &f64> {
    channels.iter().flat_map(|channel| &channel.values)
}

/// Returns the time in s from the first change of a channel to its last, or 0 if it never changes.
fn active_s(channel: &Channel) -> f64 {
    let first = channel.values.windows(2).position(|pair| pair[0] != pair[1]);
    let last = channel.values.windows(2).rposition(|pair| pair[0] != pair[1]);
    first.zip(last).map_or(0.0, |(first, last)| channel.time_s[last + 1] - channel.time_s[first])
}

/// Decompresses a quaternion from `quatcompress.h` to w x y z. The code is a whole number of 32
/// bits. Two bits contain the index (in x y z w) of the largest component, which is omitted. Each
/// of the others consists of a sign bit and nine bits, in units of 1/√2 divided by 511.
fn decompressed(code: f64) -> [f64; 4] {
    const MASK: u32 = (1 << 9) - 1;
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let mut code = code as u32;
    let largest = (code >> 30) as usize;
    let (mut q, mut sum_sq) = ([0.0; 4], 0.0);
    // The three components are stored in order, so the last one is extracted first.
    for i in (0..4).rev().filter(|&i| i != largest) {
        let sign = if code >> 9 & 1 == 1 { -1.0 } else { 1.0 };
        q[i] = sign * std::f64::consts::FRAC_1_SQRT_2 * f64::from(code & MASK) / f64::from(MASK);
        sum_sq += q[i] * q[i];
        code >>= 10;
    }
    q[largest] = (1.0 - sum_sq).max(0.0).sqrt();
    [q[3], q[0], q[1], q[2]]
}

/// Returns yaw, pitch and roll of a quaternion w x y z of any length.
fn attitude_from_quaternion(q: [f64; 4]) -> Attitude {
    let norm = q.iter().map(|part| part * part).sum::<f64>().sqrt();
    let [w, x, y, z] = q.map(|part| part / norm);
    Attitude {
        yaw_rad: libm::atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        pitch_rad: libm::asin((2.0 * (w * y - z * x)).clamp(-1.0, 1.0)),
        roll_rad: libm::atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
    }
}

/// Removes jumps of 2π from an angle in rad, so that it is interpolated the short way around.
fn unwrap_angle(channel: &mut Channel) {
    let turn = std::f64::consts::TAU;
    let (mut turns, mut last) = (0.0, channel.values[0]);
    for value in &mut channel.values {
        turns -= ((*value - last) / turn).round();
        last = *value;
        *value += turns * turn;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PositionSource::Best;
    use crate::recording::{Block, Column};

    fn recording(columns: &[(&str, f64)]) -> Recording {
        let columns =
            columns.iter().map(|(name, value)| Column::new((*name).into(), vec![*value])).collect();
        let block = Block { time_s: vec![0.0], columns, ..Block::default() };
        Recording { blocks: vec![block], ..Recording::default() }
    }

    fn values(log: &Recording, quantity: Quantity) -> Vec<f64> {
        quantities(log, Best).channels[&quantity].iter().map(|channel| channel.values[0]).collect()
    }

    #[test]
    fn an_observer_of_zeros_is_passed_over() {
        let mut columns = vec![("ae483log.o_x", 0.0), ("ae483log.o_y", 0.0), ("ae483log.o_z", 0.0)];
        assert_eq!(values(&recording(&columns), Quantity::Position), [0.0; 3], "better than none");
        columns.extend([("stateEstimateZ.x", 500.0), ("stateEstimateZ.y", 1.0)]);
        columns.push(("stateEstimateZ.z", -250.0));
        let log = recording(&columns);
        assert_eq!(values(&log, Quantity::Position), [0.5, 0.001, -0.25], "millimeters");
        let used = quantities(&log, Best).used;
        assert!(!used.contains("ae483log.o_x"), "the zeros are kept as columns");
    }

    /// Returns a log of 10 s in which each column is a constant plus a multiple of the time.
    fn moving(columns: &[(&str, f64, f64)]) -> Recording {
        let time_s: Vec<f64> = (0..100).map(|i| f64::from(i) * 0.1).collect();
        let values = |start: f64, speed: f64| time_s.iter().map(|t| start + speed * t).collect();
        let column = |&(name, start, speed): &(&str, f64, f64)| {
            Column::new(name.into(), values(start, speed))
        };
        let columns = columns.iter().map(column).collect();
        let block = Block { time_s: time_s.clone(), columns, ..Block::default() };
        Recording { blocks: vec![block], ..Recording::default() }
    }

    #[test]
    fn an_observer_frozen_at_a_value_is_passed_over_in_every_quantity() {
        let log = moving(&[
            ("ae483log.o_x", 0.3, 0.0),
            ("ae483log.o_y", -0.2, 0.0),
            ("ae483log.o_z", 0.1, 0.0),
            ("stateEstimate.x", 0.5, 0.1),
            ("stateEstimate.y", 0.0, 0.0),
            ("stateEstimate.z", 1.0, 0.0),
            ("ae483log.v_x", 0.7, 0.0),
            ("ae483log.v_y", 0.0, 0.0),
            ("ae483log.v_z", 0.0, 0.0),
            ("stateEstimate.vx", 0.0, 0.01),
            ("stateEstimate.vy", 0.0, 0.0),
            ("stateEstimate.vz", 0.0, 0.0),
        ]);
        assert_eq!(values(&log, Quantity::Position), [0.5, 0.0, 1.0]);
        assert_eq!(values(&log, Quantity::Estimate), [0.5, 0.0, 1.0]);
        assert_eq!(values(&log, Quantity::Velocity), [0.0; 3]);
        assert!(quantities(&log, Best).has_world_velocity);
        let log = moving(&[("ae483log.o_x", 0.3, 0.1), ("ae483log.o_y", 0.0, 0.0)]);
        assert!(!quantities(&log, Best).channels.contains_key(&Quantity::Position), "no z");
    }

    #[test]
    fn degrees_and_the_inverted_pitch_are_converted() {
        let names = ["stateEstimate.yaw", "stateEstimate.pitch", "stateEstimate.roll"];
        let log = recording(&[(names[0], 90.0), (names[1], 30.0), (names[2], -180.0)]);
        let pi = std::f64::consts::PI;
        let angles = values(&log, Quantity::Attitude);
        for (angle, wanted) in angles.into_iter().zip([pi / 2.0, -pi / 6.0, -pi]) {
            assert!((angle - wanted).abs() < 1e-15, "{angle} instead of {wanted}");
        }
        let rates =
            ["stateEstimateZ.rateRoll", "stateEstimateZ.ratePitch", "stateEstimateZ.rateYaw"];
        let log = recording(&[(rates[0], 1000.0), (rates[1], 2000.0), (rates[2], 3000.0)]);
        assert_eq!(values(&log, Quantity::Rate), [1.0, -2.0, 3.0]);
    }

    #[test]
    fn a_quaternion_gives_back_its_attitude() {
        let attitude = Attitude { yaw_rad: 2.5, pitch_rad: -0.4, roll_rad: 0.3 };
        let rotation = nalgebra::Rotation3::from_matrix_unchecked(attitude.world_from_body());
        let q = nalgebra::UnitQuaternion::from_rotation_matrix(&rotation);
        let back = attitude_from_quaternion([q.w, q.i, q.j, q.k].map(|part| part * 1.7));
        let error =
            (back.yaw_rad - 2.5).abs() + (back.pitch_rad + 0.4).abs() + (back.roll_rad - 0.3).abs();
        assert!(error < 1e-12, "{back:?}");
    }

    #[test]
    fn thirty_two_bits_hold_an_attitude() {
        // The quaternion (x, y, z, w) is (0.1, −0.2, 0.3, 0.927…), whose largest component is w.
        let pack = |part: f64| {
            #[expect(clippy::cast_possible_truncation, reason = "at most 511")]
            let size = (part.abs() / std::f64::consts::FRAC_1_SQRT_2 * 511.0 + 0.5) as u32;
            u32::from(part < 0.0) << 9 | size
        };
        let code = 3 << 30 | pack(0.1) << 20 | pack(-0.2) << 10 | pack(0.3);
        let q = decompressed(f64::from(code));
        let wanted = [0.86_f64.sqrt(), 0.1, -0.2, 0.3];
        for (part, wanted) in q.into_iter().zip(wanted) {
            assert!((part - wanted).abs() < 1e-3, "{q:?}");
        }
    }

    #[test]
    fn yaw_goes_the_short_way_over_the_edge() {
        let mut yaw = Channel::new(vec![0.0, 1.0, 2.0], vec![3.0, -3.0, 3.0]);
        unwrap_angle(&mut yaw);
        assert!((yaw.linear(0.5, 9.0).unwrap() - std::f64::consts::PI).abs() < 0.01, "{yaw:?}");
        assert!((yaw.values[2] - 3.0).abs() < 1e-12, "and back: {yaw:?}");
    }
}
