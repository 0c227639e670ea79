//! Compressed trajectory of the Crazyflie: Bézier curves in whole millimeters and milliseconds.
//!
//! Values are rounded to the nearest integer, and durations are differences of rounded times, so
//! that neither positions nor times drift. (cflib's `CompressedSegment` truncates both, which
//! displaces the same NOOR by 6 mm and ends it 16 ms early.) A piece is the cubic through the
//! design's position and velocity at both ends.
//!
//! Format (firmware `src/modules/src/pptraj_compressed.c`, little-endian): the start as four int16
//! (x, y, z in mm, yaw in 0.1°), the pieces, and three zero bytes. A piece consists of a byte with
//! two bits per axis (x, y, z, yaw from the lowest: 0 constant, 1 linear, 2 cubic, 3 degree 7), the
//! duration as uint16 in ms, and for each axis in turn 0, 1, 3 or 7 further control points as
//! int16. The first control point of a piece is the last one of the previous piece.

use std::f64::consts::TAU;

use nalgebra::Vector3;

use super::pieces::{Polynomials, Rounding, Stretch, pieces};
use super::timeline::{Segment, Timeline};
use noctograph_core::crazyflie::{Feature, Release, TRAJECTORY_MEMORY_BYTES};
use noctograph_core::error::{Error, Result};
use noctograph_core::units::{MM_PER_M, MS_PER_S};
use noctograph_plan::Plan;

/// Maximum duration of a piece, s: the largest uint16 in ms.
const MAX_PIECE_S: f64 = 65.535;
/// Maximum coordinate, m: the largest int16 in mm.
const MAX_COORDINATE_M: f64 = 32.767;
/// Maximum error of an axis stored as a constant, m.
const CONSTANT_M: f64 = 0.0005;
/// Maximum error of an axis stored as a line, m.
const LINEAR_M: f64 = 0.0008;
/// Number of bytes at the start of a trajectory, for its position and heading.
const START_SIZE: usize = 8;
/// Number of bytes of a piece that is cubic on three axes.
const MAX_PIECE_BYTES: usize = 3 + 3 * 6;

/// Bytes at the end of a trajectory.
const END: [u8; 3] = [0; 3];

/// Bytes at the end of a flight without a goal: a line along z of zero duration, which makes
/// the firmware divide by zero. The commander then outputs no more setpoints
/// (`crtp_commander_high_level.c`, "invalid eval"), and the watchdog stops the motors 2 s later.
/// With [`END`] the drone would hover forever. This applies to releases since 2023.11.
const END_WITHOUT_GOAL: [u8; 5] = [1 << 4, 0, 0, 0, 0];

/// Offsets of the take-off position within a flight's bytes, for x and for y.
pub(super) const START_BYTES: [[usize; 4]; 2] = [[0, 28, 30, 32], [2, 42, 44, 46]];

/// Offsets of the heading within a flight's bytes.
pub(super) const YAW_BYTES: std::ops::Range<usize> = 6..8;

/// A trajectory of at least one piece, as the drone stores it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compressed {
    pub(super) pieces: Vec<Piece>,
    /// Constant heading in tenths of a degree.
    pub(super) yaw: i16,
}

/// A piece, as the drone stores it. A heading has no control points, because it is constant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    /// First control point, equal to the end of the previous piece, mm.
    pub(super) start_mm: [i16; 3],
    pub(super) duration_ms: u16,
    /// Control points of each axis after the first one, mm: none, one for a line, or three for a
    /// cubic.
    pub(super) axes: [Vec<i16>; 3],
}

impl Compressed {
    /// Encodes the letters of a plan for a release, to within `tolerance_m` of its design.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for a plan without letters, and for a heading that the release
    /// misreads. Returns [`Error::Infeasible`] for a plan that extends beyond ±32.767 m, has
    /// setpoints more than 65.535 s apart, or does not fit in the memory.
    pub fn encode(release: Release, plan: &Plan, tolerance_m: f64) -> Result<Self> {
        check_heading(release, plan.yaw_rad)?;
        let stretch = Stretch::new(plan)?;
        let trajectory = Self::of_any_length(&stretch, tolerance_m)?;
        let bytes = trajectory.to_bytes().len();
        if bytes <= TRAJECTORY_MEMORY_BYTES {
            return Ok(trajectory);
        }
        // The error states the number of letters that fit together with a piece for the run-out.
        let (mut used, mut until_s) = (START_SIZE + END.len() + MAX_PIECE_BYTES, 0.0);
        for piece in &trajectory.pieces {
            used += piece.n_bytes();
            if used > TRAJECTORY_MEMORY_BYTES {
                break;
            }
            until_s += piece.polynomials().duration_s;
        }
        let needs = format!(
            "the compressed trajectory has {bytes} bytes, but the drone's memory holds \
             {TRAJECTORY_MEMORY_BYTES}"
        );
        let hint = "divide the word among more drones, accept a larger distance from the design, \
                    or send setpoints over the radio (script for cflib)";
        Err(stretch.too_long(until_s, &needs, hint))
    }

    /// Encodes a stretch to within `tolerance_m` of its design, for a memory of any size. Returns
    /// [`Error::Infeasible`] for a stretch that exceeds the numeric range of the format.
    pub(super) fn of_any_length(stretch: &Stretch, tolerance_m: f64) -> Result<Self> {
        check_range(stretch)?;
        let start_mm = millimeters(&stretch.setpoints[0].position_m);
        let next = |from, to, previous: &[Piece], rounding| {
            piece(stretch, [from, to], previous.last().map_or(start_mm, Piece::end_mm), rounding)
        };
        let pieces = pieces(stretch, tolerance_m, MAX_PIECE_S, next, Piece::polynomials);
        Ok(Self { pieces, yaw: tenths_of_degrees(stretch.yaw_rad) })
    }

    /// Returns the bytes that the drone stores: the start, the pieces, and an empty piece at the
    /// end.
    pub fn to_bytes(&self) -> Vec<u8> {
        let start_mm = self.pieces.first().map_or([0; 3], |piece| piece.start_mm);
        let mut bytes = start_mm.map(i16::to_le_bytes).concat();
        bytes.extend(self.yaw.to_le_bytes());
        for piece in &self.pieces {
            // Each axis takes two bits: 0, 1 and 3 further control points have codes 0, 1 and 2,
            // respectively. There is no piece with 2.
            let [x, y, z] = piece.axes.each_ref().map(|points_mm| [0, 1, 1, 2][points_mm.len()]);
            bytes.push(x | y << 2 | z << 4);
            bytes.extend(piece.duration_ms.to_le_bytes());
            let points_mm = piece.axes.iter().flatten();
            bytes.extend(points_mm.flat_map(|point_mm| point_mm.to_le_bytes()));
        }
        bytes.extend(END);
        bytes
    }

    /// Returns the bytes of a flight from take-off to landing, after which the firmware stops the
    /// motors. The script lands `over_s` after the end of the trajectory. Returns
    /// [`Error::Infeasible`] for a flight that exceeds the memory.
    pub(super) fn flight(&self, timeline: &Timeline, over_s: f64) -> Result<Vec<u8>> {
        // The bytes are take-off and path, letters without start and end bytes, hover and landing.
        let mut bytes = millimeters(&timeline.before[0].position_m).map(i16::to_le_bytes).concat();
        bytes.extend(self.yaw.to_le_bytes());
        timeline.segments_before().iter().for_each(|segment| add_segment(&mut bytes, segment));
        let letters = self.to_bytes();
        bytes.extend(&letters[START_SIZE..letters.len() - END.len()]);
        let landing = timeline.segments_without_link(over_s);
        landing.iter().for_each(|segment| add_segment(&mut bytes, segment));
        bytes.extend(END_WITHOUT_GOAL);
        if bytes.len() > TRAJECTORY_MEMORY_BYTES {
            let what = format!(
                "the trajectory has {} bytes with take-off and landing, but the drone's memory \
                 holds {TRAJECTORY_MEMORY_BYTES}",
                bytes.len()
            );
            let hint = "divide the word among more drones, or send setpoints over the radio";
            return Err(Error::infeasible(what, hint));
        }
        Ok(bytes)
    }

    /// Returns the duration in s, which is a whole number of milliseconds.
    pub fn duration_s(&self) -> f64 {
        self.polynomials().iter().map(|piece| piece.duration_s).sum()
    }

    /// Returns the pieces as polynomials in time.
    pub(super) fn polynomials(&self) -> Vec<Polynomials> {
        self.pieces.iter().map(Piece::polynomials).collect()
    }

    /// Returns the first and the last position of the pieces, m.
    pub(super) fn ends_m(&self) -> [Vector3<f64>; 2] {
        let (first, last) = (&self.pieces[0], &self.pieces[self.pieces.len() - 1]);
        [first.start_mm, last.end_mm()].map(|mm| Vector3::from(mm.map(f64::from)) / MM_PER_M)
    }

    /// Returns the pieces as Bézier curves, each with its duration, s, and four control points, m.
    pub(super) fn curves(&self) -> Vec<(f64, [Vector3<f64>; 4])> {
        self.pieces.iter().map(|piece| (piece.polynomials().duration_s, piece.curve_m())).collect()
    }
}

/// Returns an axis's four control points as a cubic, mm. Those of a line are evenly spaced.
fn control_mm(start_mm: i16, points_mm: &[i16]) -> [f64; 4] {
    let [a, d] = [start_mm, *points_mm.last().unwrap_or(&start_mm)].map(f64::from);
    match points_mm {
        [b, c, _] => [a, f64::from(*b), f64::from(*c), d],
        _ => [a, a + (d - a) / 3.0, d - (d - a) / 3.0, d],
    }
}

/// Returns the eight coefficients of an axis in ascending powers of time, in m and s.
fn polynomial(start_mm: i16, points_mm: &[i16], duration_s: f64) -> [f64; 8] {
    // The Bernstein basis is converted to powers of t/T, and then to powers of t.
    let [a, b, c, d] = control_mm(start_mm, points_mm).map(|mm| mm / MM_PER_M);
    let unit = [a, 3.0 * (b - a), 3.0 * (a - 2.0 * b + c), d - 3.0 * c + 3.0 * b - a];
    let (t, t2) = (duration_s, duration_s * duration_s);
    [unit[0], unit[1] / t, unit[2] / t2, unit[3] / (t2 * t), 0.0, 0.0, 0.0, 0.0]
}

impl Piece {
    /// Returns the number of bytes that the piece occupies on board.
    fn n_bytes(&self) -> usize {
        3 + 2 * self.axes.iter().map(Vec::len).sum::<usize>()
    }

    /// Returns the last control point, mm.
    pub(super) fn end_mm(&self) -> [i16; 3] {
        [0, 1, 2].map(|k| *self.axes[k].last().unwrap_or(&self.start_mm[k]))
    }

    /// Returns the motion that the firmware computes from this piece, in m and s.
    fn polynomials(&self) -> Polynomials {
        let duration_s = f64::from(self.duration_ms) / MS_PER_S;
        let axes = [0, 1, 2].map(|k| polynomial(self.start_mm[k], &self.axes[k], duration_s));
        Polynomials { duration_s, axes }
    }

    /// Returns the four control points of the piece as a Bézier curve, m.
    fn curve_m(&self) -> [Vector3<f64>; 4] {
        let axes = [0, 1, 2].map(|axis| control_mm(self.start_mm[axis], &self.axes[axis]));
        [0, 1, 2, 3].map(|k| Vector3::from(axes.map(|axis| axis[k])) / MM_PER_M)
    }
}

/// Returns the piece between setpoints `from` and `to`, which begins where the previous one ended.
/// Each axis has the simplest form that is close enough to the design: a constant, a line or a
/// cubic.
fn piece(
    stretch: &Stretch,
    [from, to]: [usize; 2],
    start_mm: [i16; 3],
    rounding: Rounding,
) -> Piece {
    // Differences of rounded times do not drift.
    let times_ms = [from, to].map(|index| (stretch.time_s(index) * MS_PER_S).round());
    #[expect(clippy::cast_possible_truncation, reason = "below 65 535, see `check_range`")]
    let duration_ms = ((times_ms[1] - times_ms[0]) as u16).max(1);
    let duration_s = f64::from(duration_ms) / MS_PER_S;
    let (start, end) = (&stretch.setpoints[from], &stretch.setpoints[to]);
    let axes = [0, 1, 2].map(|axis| {
        // A constant or a line is used if it is close enough to the design.
        let end_mm = round_mm(end.position_m[axis]);
        let forms = [(Vec::new(), CONSTANT_M), (vec![end_mm], LINEAR_M)];
        let simple = forms.into_iter().find(|(points_mm, tolerance_m)| {
            let [start_m, speed_m_s, ..] = polynomial(start_mm[axis], points_mm, duration_s);
            stretch.checks(from, to).all(|(time_s, design_m)| {
                let line_m = start_m + speed_m_s * (time_s - stretch.time_s(from));
                (line_m - design_m[axis]).abs() < *tolerance_m
            })
        });
        // Otherwise the axis is cubic (Hermite), with inner control points v T/3 from its ends.
        let third_s = duration_s / 3.0;
        let [from_start_m, to_end_m] = [start, end].map(|s| s.velocity_m_s[axis] * third_s);
        let cubic_mm = [
            round_mm(f64::from(start_mm[axis]) / MM_PER_M + from_start_m),
            round_mm(f64::from(end_mm) / MM_PER_M - to_end_m),
            end_mm,
        ];
        match (simple, rounding) {
            (Some((points_mm, _)), _) => points_mm,
            (None, Rounding::Nearest) => cubic_mm.to_vec(),
            (None, Rounding::Gentlest) => gentlest(start_mm[axis], cubic_mm).to_vec(),
        }
    });
    Piece { start_mm, duration_ms, axes }
}

/// Moves the inner control points `b` and `c` of a cubic by at most a millimeter each, to minimize
/// the acceleration at its ends. Returns both points and the end.
fn gentlest(start_mm: i16, [b, c, end_mm]: [i16; 3]) -> [i16; 3] {
    let [near_b, near_c] = [b, c].map(|mm| [mm, mm.saturating_sub(1), mm.saturating_add(1)]);
    let cubics = near_b.into_iter().flat_map(|b| near_c.map(|c| [b, c, end_mm]));
    let gentlest = cubics.min_by_key(|points_mm| {
        // The acceleration at the ends is proportional to a - 2b + c and b - 2c + d.
        let [b, c, d] = points_mm.map(i32::from);
        (i32::from(start_mm) - 2 * b + c).abs().max((b - 2 * c + d).abs())
    });
    gentlest.expect("nine cubics")
}

/// Returns [`Error::Infeasible`] if setpoints are too far apart in time for the format, or if
/// coordinates are out of its range.
fn check_range(stretch: &Stretch) -> Result<()> {
    for (index, setpoint) in stretch.setpoints.iter().enumerate() {
        let step_s = stretch.time_s(index) - stretch.time_s(index.saturating_sub(1));
        if step_s > MAX_PIECE_S {
            return Err(Error::infeasible(
                format!("a piece may last at most {MAX_PIECE_S} s, not {step_s:.1} s"),
                "plan setpoints at shorter intervals",
            ));
        }
        if let Some(far_m) = setpoint.position_m.iter().find(|x| x.abs() >= MAX_COORDINATE_M) {
            return Err(Error::infeasible(
                format!(
                    "a compressed trajectory reaches ±{MAX_COORDINATE_M} m, but the plan reaches \
                     {far_m} m"
                ),
                "write the word closer to the origin, or smaller",
            ));
        }
    }
    Ok(())
}

/// Returns a heading in tenths of a degree, as the format stores it.
#[expect(clippy::cast_possible_truncation, reason = "a turn at most, and it saturates")]
fn tenths_of_degrees(yaw_rad: f64) -> i16 {
    (10.0 * yaw_rad.to_degrees()).round() as i16
}

/// True if a release flies a compressed trajectory's heading. Older releases only fly 0.
pub(super) fn flies_heading(release: Release, yaw_rad: f64) -> bool {
    release.has(&Feature::HEADING) || tenths_of_degrees(yaw_rad) == 0
}

/// Returns [`Error::Input`] for a heading that a release misreads ([`Feature::HEADING`]).
fn check_heading(release: Release, yaw_rad: f64) -> Result<()> {
    if flies_heading(release, yaw_rad) {
        return Ok(());
    }
    // Older releases interpret ten times the stored number as radians.
    let (stored, since) = (f64::from(tenths_of_degrees(yaw_rad)), Feature::HEADING.since.name());
    let flown_turns = 10.0 * stored / TAU;
    let actual = format!(
        "{}, which flies a compressed trajectory with a heading of {}° (plan.yaw_rad) at {:.0}°",
        release.name(),
        stored / 10.0,
        360.0 * (flown_turns - flown_turns.round()),
    );
    let hint = format!(
        "export poly4d, or the script for cflib with setpoints (--mode position or full-state); or \
         update the drone's firmware and set vehicle.firmware = \"{since}\"; or set plan.yaw_rad = 0"
    );
    let wanted = format!("{since} or newer, or a heading of 0");
    Err(Error::input("vehicle.firmware", actual, wanted, hint))
}

/// Appends the bytes of a segment from rest to rest. A moving axis has degree 7, with four control
/// points at its start and four at its end. A long hover is split into several pieces. A segment of
/// 0 ms is omitted, because a duration of 0 ends a trajectory.
fn add_segment(bytes: &mut Vec<u8>, segment: &Segment) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "it saturates")]
    let mut remaining_ms = (MS_PER_S * segment.duration_s).round() as u32;
    let ends_mm = segment.ends_m.each_ref().map(millimeters);
    while remaining_ms > 0 {
        let piece_ms = u16::try_from(remaining_ms).unwrap_or(u16::MAX);
        bytes.push(segment.axes.iter().map(|axis| 3 << (2 * axis)).sum());
        bytes.extend(piece_ms.to_le_bytes());
        for axis in segment.axes {
            let [from_mm, to_mm] = ends_mm.map(|end_mm| end_mm[*axis]);
            // The first control point is the end of the previous piece.
            let points_mm = [[from_mm; 3].as_slice(), &[to_mm; 4]].concat();
            bytes.extend(points_mm.into_iter().flat_map(i16::to_le_bytes));
        }
        remaining_ms = if segment.axes.is_empty() { remaining_ms - u32::from(piece_ms) } else { 0 };
    }
}

/// Returns a position rounded to whole millimeters.
fn millimeters(position_m: &Vector3<f64>) -> [i16; 3] {
    [0, 1, 2].map(|axis| round_mm(position_m[axis]))
}

/// Returns a coordinate in whole millimeters. Coordinates beyond ±32.767 m become the limit.
#[expect(clippy::cast_possible_truncation, reason = "saturates")]
fn round_mm(x_m: f64) -> i16 {
    (x_m * MM_PER_M).round() as i16
}

#[cfg(test)]
mod tests;
