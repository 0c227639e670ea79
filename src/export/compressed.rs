//! Compressed trajectory of the Crazyflie: Bézier curves of whole millimeters and milliseconds.
//!
//! Form (firmware `src/modules/src/pptraj_compressed.c`, little-endian): the start as four int16 (x,
//! y, z in mm, yaw in 0.1°); then a piece after another: a byte with two bits an axis (x, y, z, yaw
//! from the lowest: 0 constant, 1 linear, 2 cubic, 3 degree 7), the duration as uint16 in ms, and for
//! each axis in turn 0, 1, 3 or 7 further control points as int16; at the end three zero bytes. The
//! first control point of a piece is the last of the piece before.
//!
//! Values are rounded to the nearest, and durations are differences of rounded times, so that
//! neither positions nor times drift. (cflib's `CompressedSegment` truncates both: the same NOOR is
//! off by 6 mm and ends 16 ms early.)

use nalgebra::Vector3;

use super::pieces::{Stretch, longest};
use crate::error::{Error, Result};
use crate::plan::Plan;

/// Bytes of the trajectory memory (firmware `crtp_commander_high_level.h`,
/// `TRAJECTORY_MEMORY_SIZE`).
pub const MEMORY_BYTES: usize = 4096;
/// Longest piece: the largest uint16, in s.
const MAX_PIECE_S: f64 = 65.535;
/// Largest coordinate: the largest int16, in m.
const MAX_COORDINATE_M: f64 = 32.767;
/// Distance that an axis may be off when it is left constant, m.
const CONSTANT_M: f64 = 0.0005;
/// Distance that an axis may be off when it is flown linearly, m.
const LINEAR_M: f64 = 0.0008;
/// A piece that is cubic on three axes.
const MAX_PIECE_BYTES: usize = 3 + 3 * 6;
/// What ends a trajectory.
const END: [u8; 3] = [0; 3];

/// A trajectory as the drone stores it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compressed {
    /// First position, mm.
    start_mm: [i16; 3],
    pieces: Vec<Piece>,
}

/// One piece: the control points of each axis after the first one, mm.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Piece {
    duration_ms: u16,
    axes: [Axis; 3],
}

/// The further control points of an axis, mm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Axis {
    Constant,
    Linear(i16),
    Cubic([i16; 3]),
}

impl Axis {
    /// The last control point, where the first one is `start_mm`.
    fn end_mm(self, start_mm: i16) -> i16 {
        match self {
            Self::Constant => start_mm,
            Self::Linear(end_mm) | Self::Cubic([_, _, end_mm]) => end_mm,
        }
    }

    /// Its four control points as a cubic, mm.
    fn control_mm(self, start_mm: i16) -> [f64; 4] {
        let (a, d) = (f64::from(start_mm), f64::from(self.end_mm(start_mm)));
        match self {
            Self::Constant | Self::Linear(_) => [a, a + (d - a) / 3.0, d - (d - a) / 3.0, d],
            Self::Cubic([b, c, _]) => [a, f64::from(b), f64::from(c), d],
        }
    }

    /// Position at a share of the piece's duration, mm.
    fn at(self, start_mm: i16, share: f64) -> f64 {
        let ([a, b, c, d], rest) = (self.control_mm(start_mm), 1.0 - share);
        a * rest * rest * rest
            + 3.0 * b * rest * rest * share
            + 3.0 * c * rest * share * share
            + d * share * share * share
    }

    fn code(self) -> u8 {
        match self {
            Self::Constant => 0,
            Self::Linear(_) => 1,
            Self::Cubic(_) => 2,
        }
    }

    fn points_mm(&self) -> &[i16] {
        match self {
            Self::Constant => &[],
            Self::Linear(end_mm) => std::slice::from_ref(end_mm),
            Self::Cubic(points_mm) => points_mm,
        }
    }
}

impl Compressed {
    /// Encodes the letters of a plan within a distance of its design.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for a plan without letters; [`Error::Infeasible`] for one beyond ±32.767 m,
    /// with setpoints more than 65.535 s apart, or longer than the memory.
    pub fn encode(plan: &Plan, tolerance_m: f64) -> Result<Self> {
        let stretch = Stretch::new(plan)?;
        let trajectory = Self::of_any_length(&stretch, tolerance_m)?;
        let bytes = trajectory.to_bytes().len();
        if bytes <= MEMORY_BYTES {
            return Ok(trajectory);
        }
        // Bytes and time as the pieces end; a run-out of one more piece ends each part.
        let (mut used, mut until_s) = (8 + END.len() + MAX_PIECE_BYTES, 0.0);
        for piece in &trajectory.pieces {
            used += piece.n_bytes();
            if used > MEMORY_BYTES {
                break;
            }
            until_s += piece.duration_s();
        }
        let found = format!("{bytes} bytes compressed, the drone's memory holds {MEMORY_BYTES}");
        let hint = "share the word among more drones, accept a larger distance from the design, or \
                    send setpoints over the radio (script for cflib)";
        Err(stretch.too_long(until_s, &found, hint))
    }

    /// Bytes of a plan within a distance of its design, whether or not they fit the memory.
    ///
    /// # Errors
    ///
    /// As [`Self::encode`], but for the length.
    pub fn n_bytes(plan: &Plan, tolerance_m: f64) -> Result<usize> {
        Ok(Self::of_any_length(&Stretch::new(plan)?, tolerance_m)?.to_bytes().len())
    }

    /// The same, whether or not it fits the memory.
    pub(super) fn of_any_length(stretch: &Stretch, tolerance_m: f64) -> Result<Self> {
        check_range(stretch)?;
        let start_mm = millimeters(stretch.setpoint(0).position_m);
        let (mut pieces, mut at, mut here_mm) = (Vec::new(), 0, start_mm);
        while at < stretch.last() {
            let fits = |to| {
                stretch.time_s(to) - stretch.time_s(at) < MAX_PIECE_S
                    && error_m(stretch, at, to, here_mm) <= tolerance_m
            };
            let to = longest(at, stretch.last(), fits);
            let piece = piece(stretch, at, to, here_mm);
            here_mm = piece.end_mm(here_mm);
            pieces.push(piece);
            at = to;
        }
        Ok(Self { start_mm, pieces })
    }

    /// The bytes that the drone stores.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let [x, y, z] = self.start_mm;
        let mut bytes: Vec<u8> = [x, y, z, 0].into_iter().flat_map(i16::to_le_bytes).collect();
        for piece in &self.pieces {
            let [x, y, z] = piece.axes.map(Axis::code);
            bytes.push(x | y << 2 | z << 4);
            bytes.extend(piece.duration_ms.to_le_bytes());
            let points_mm = piece.axes.iter().flat_map(Axis::points_mm);
            bytes.extend(points_mm.flat_map(|point_mm| point_mm.to_le_bytes()));
        }
        bytes.extend(END);
        bytes
    }

    /// Reads the bytes that [`Self::to_bytes`] writes; yaw must be constant, and no axis of degree 7.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the byte at which they are broken.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let mut reader = Reader { bytes, at: 0 };
        let start_mm = [reader.int16()?, reader.int16()?, reader.int16()?];
        reader.int16()?;
        let mut pieces = Vec::new();
        loop {
            let header = reader.take::<1>()?[0];
            let duration_ms = u16::from_le_bytes(reader.take()?);
            if duration_ms == 0 {
                return Ok(Self { start_mm, pieces });
            }
            let mut axes = [Axis::Constant; 3];
            for (axis, shift) in axes.iter_mut().zip([0, 2, 4]) {
                *axis = match header >> shift & 3 {
                    0 => Axis::Constant,
                    1 => Axis::Linear(reader.int16()?),
                    2 => Axis::Cubic([reader.int16()?, reader.int16()?, reader.int16()?]),
                    _ => return Err(reader.broken("an axis of degree 7", "degree 3 at most")),
                };
            }
            if header >> 6 != 0 {
                return Err(reader.broken("a yaw that turns", "a constant yaw"));
            }
            pieces.push(Piece { duration_ms, axes });
        }
    }

    /// Number of pieces.
    #[must_use]
    pub fn n_pieces(&self) -> usize {
        self.pieces.len()
    }

    /// Duration as flown, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.pieces.iter().map(Piece::duration_s).sum()
    }

    /// Largest distance from the design of its plan, m.
    ///
    /// # Panics
    ///
    /// For another plan than its own, without letters.
    #[must_use]
    pub fn worst_m(&self, plan: &Plan) -> f64 {
        let stretch = Stretch::new(plan).expect("the plan of this trajectory");
        stretch.worst_m(|time_s| self.position_m(time_s))
    }

    /// Its pieces as Bézier curves: duration in s, and four control points in m.
    pub(super) fn curves(&self) -> Vec<(f64, [Vector3<f64>; 4])> {
        let mut start_mm = self.start_mm;
        let curve = |piece: &Piece| {
            let points: [[f64; 4]; 3] =
                std::array::from_fn(|axis| piece.axes[axis].control_mm(start_mm[axis]));
            start_mm = piece.end_mm(start_mm);
            let point = |k: usize| Vector3::from(points.map(|axis| axis[k])) / 1000.0;
            (piece.duration_s(), [0, 1, 2, 3].map(point))
        };
        self.pieces.iter().map(curve).collect()
    }

    /// Position that the firmware's evaluation gives at a time since the start, m; the end stays.
    #[must_use]
    pub fn position_m(&self, time_s: f64) -> Vector3<f64> {
        let (mut start_mm, mut left_s) = (self.start_mm, time_s.max(0.0));
        for piece in &self.pieces {
            if left_s < piece.duration_s() {
                return piece.position_m(start_mm, left_s / piece.duration_s());
            }
            left_s -= piece.duration_s();
            start_mm = piece.end_mm(start_mm);
        }
        Vector3::from(start_mm.map(f64::from)) / 1000.0
    }
}

impl Piece {
    fn n_bytes(&self) -> usize {
        3 + 2 * self.axes.iter().map(|axis| axis.points_mm().len()).sum::<usize>()
    }

    fn duration_s(&self) -> f64 {
        f64::from(self.duration_ms) / 1000.0
    }

    fn end_mm(&self, start_mm: [i16; 3]) -> [i16; 3] {
        std::array::from_fn(|axis| self.axes[axis].end_mm(start_mm[axis]))
    }

    fn position_m(&self, start_mm: [i16; 3], share: f64) -> Vector3<f64> {
        let mm = |axis: usize| self.axes[axis].at(start_mm[axis], share);
        Vector3::new(mm(0), mm(1), mm(2)) / 1000.0
    }
}

/// The piece between two setpoints: on each axis the simplest form that is near enough.
fn piece(stretch: &Stretch, from: usize, to: usize, start_mm: [i16; 3]) -> Piece {
    let times_ms = [from, to].map(|index| (stretch.time_s(index) * 1000.0).round());
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 65 535")]
    let duration_ms = ((times_ms[1] - times_ms[0]) as u16).max(1);
    let duration_s = f64::from(duration_ms) / 1000.0;
    let (here, there) = (stretch.setpoint(from), stretch.setpoint(to));
    let axis = |axis: usize| {
        let end_mm = round_mm(there.position_m[axis]);
        let forms = [(Axis::Constant, CONSTANT_M), (Axis::Linear(end_mm), LINEAR_M)];
        let near = |(form, tolerance_m): &(Axis, f64)| {
            stretch.check_times_s(from, to).all(|time_s| {
                let share = (time_s - stretch.time_s(from)) / duration_s;
                let off_m =
                    form.at(start_mm[axis], share) / 1000.0 - stretch.position_m(time_s)[axis];
                off_m.abs() < *tolerance_m
            })
        };
        let simple = forms.iter().find(|form| near(form)).map(|(form, _)| *form);
        let third_s = duration_s / 3.0;
        simple.unwrap_or(Axis::Cubic([
            round_mm(here.position_m[axis] + here.velocity_m_s[axis] * third_s),
            round_mm(there.position_m[axis] - there.velocity_m_s[axis] * third_s),
            end_mm,
        ]))
    };
    Piece { duration_ms, axes: std::array::from_fn(axis) }
}

/// Largest distance of the piece between two setpoints from the design, m.
fn error_m(stretch: &Stretch, from: usize, to: usize, start_mm: [i16; 3]) -> f64 {
    let piece = piece(stretch, from, to, start_mm);
    let off_m = |time_s: f64| {
        let share = (time_s - stretch.time_s(from)) / piece.duration_s();
        (piece.position_m(start_mm, share.min(1.0)) - stretch.position_m(time_s)).norm()
    };
    stretch.check_times_s(from, to).map(off_m).fold(0.0, f64::max)
}

fn check_range(stretch: &Stretch) -> Result<()> {
    for index in 0..=stretch.last() {
        let setpoint = stretch.setpoint(index);
        let step_s = stretch.time_s(index) - stretch.time_s(index.saturating_sub(1));
        if step_s > MAX_PIECE_S {
            return Err(Error::Infeasible {
                what: format!("a piece lasts {MAX_PIECE_S} s at most, not {step_s:.1} s"),
                hint: "plan setpoints at shorter intervals".into(),
            });
        }
        if let Some(far_m) = setpoint.position_m.iter().find(|x| x.abs() >= MAX_COORDINATE_M) {
            return Err(Error::Infeasible {
                what: format!(
                    "a compressed trajectory reaches to ±{MAX_COORDINATE_M} m, the plan to {far_m} m"
                ),
                hint: "write nearer to the origin, or smaller".into(),
            });
        }
    }
    Ok(())
}

fn millimeters(position_m: Vector3<f64>) -> [i16; 3] {
    [0, 1, 2].map(|axis| round_mm(position_m[axis]))
}

/// A coordinate in whole millimeters; control points beyond the range saturate.
fn round_mm(x_m: f64) -> i16 {
    #[expect(clippy::cast_possible_truncation, reason = "saturates")]
    let mm = (x_m * 1000.0).round() as i16;
    mm
}

struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N]> {
        let end = self.at + N;
        let taken = self.bytes.get(self.at..end).and_then(|bytes| bytes.try_into().ok());
        let taken = taken.ok_or_else(|| self.broken("the end", "three zero bytes at the end"))?;
        self.at = end;
        Ok(taken)
    }

    fn int16(&mut self) -> Result<i16> {
        Ok(i16::from_le_bytes(self.take()?))
    }

    fn broken(&self, found: &str, wanted: &str) -> Error {
        let hint = "use the bytes of a trajectory that was exported whole";
        Error::input(format!("trajectory, byte {}", self.at), found, wanted, hint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::letters::{LetterOptions, write};
    use crate::plan::{PlanOptions, Setpoint, plan};

    fn noor() -> Plan {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        plan(&strokes, &PlanOptions::even()).unwrap()
    }

    #[test]
    fn two_pieces_are_the_bytes_that_were_written_by_hand() {
        let setpoint = |time_s, x, vx, z| Setpoint {
            time_s,
            position_m: Vector3::new(x, 0.0, z),
            velocity_m_s: Vector3::new(vx, 0.0, 0.0),
            acceleration_m_s2: Vector3::zeros(),
            letter: Some(0),
        };
        // At rest, then 0.1 m to the right at 0.2 m/s; z rises by 3 mm in a jump at the end.
        let setpoints = vec![
            setpoint(1.0, 0.0, 0.2, 0.5),
            setpoint(1.5, 0.1, 0.0, 0.5),
            setpoint(2.0, 0.1, 0.0, 0.5),
        ];
        let plan = Plan { setpoints, ..Plan::default() };
        let trajectory = Compressed::encode(&plan, 0.0001).unwrap();
        let bytes = trajectory.to_bytes();
        let want: Vec<u8> = [
            &[0, 0, 0, 0, 0xF4, 1, 0, 0][..], // 0, 0, 500 mm, 0°
            &[1, 0xF4, 1, 100, 0],            // x linear, 500 ms, to 100 mm
            &[0, 0xF4, 1],                    // at rest, 500 ms
            &[0, 0, 0],
        ]
        .concat();
        assert_eq!(bytes, want);
        assert_eq!(Compressed::from_bytes(&bytes).unwrap(), trajectory);
        assert!((trajectory.position_m(0.25) - Vector3::new(0.05, 0.0, 0.5)).norm() < 1e-12);
        assert!((trajectory.duration_s() - 1.0).abs() < 1e-12);
    }

    #[test]
    fn noor_fits_the_memory_six_times_within_two_and_a_half_millimeters() {
        let plan = noor();
        let trajectory = Compressed::encode(&plan, 0.002).unwrap();
        let (bytes, worst_m) = (trajectory.to_bytes().len(), trajectory.worst_m(&plan));
        assert!(bytes <= 700 && worst_m <= 0.0025, "{bytes} bytes, {worst_m} m");
        assert_eq!(Compressed::from_bytes(&trajectory.to_bytes()).unwrap(), trajectory);
    }

    #[test]
    fn what_does_not_fit_the_form_is_refused() {
        let mut far = noor();
        far.setpoints.iter_mut().for_each(|s| s.position_m.x += 33.0);
        assert!(Compressed::encode(&far, 0.002).unwrap_err().to_string().contains("32.767"));
        let mut dark = noor();
        dark.setpoints.iter_mut().for_each(|s| s.letter = None);
        assert!(Compressed::encode(&dark, 0.002).unwrap_err().to_string().contains("no letter"));
        let bytes = Compressed::encode(&noor(), 0.002).unwrap().to_bytes();
        for end in [3, 9, bytes.len() - 1] {
            assert!(Compressed::from_bytes(&bytes[..end]).is_err(), "cut at {end}");
        }
    }
}
