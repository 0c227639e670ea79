//! The form on board: pieces of whole millimeters and milliseconds, and their bytes.
//!
//! Form (firmware `src/modules/src/pptraj_compressed.c`, little-endian): the start as four int16
//! (x, y, z in mm, yaw in 0.1°); then a piece after another: a byte with two bits an axis (x, y, z,
//! yaw from the lowest: 0 constant, 1 linear, 2 cubic, 3 degree 7), the duration as uint16 in ms,
//! and for each axis in turn 0, 1, 3 or 7 further control points as int16; at the end three zero
//! bytes. The first control point of a piece is the last of the piece before.

use nalgebra::Vector3;

use super::super::pieces::Polynomials;
use super::Compressed;
use noctograph_core::error::{Error, Result};

/// What ends a trajectory.
pub(crate) const END: [u8; 3] = [0; 3];

/// One piece.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    /// The first control point, which is the end of the piece before, mm.
    pub(super) start_mm: [i16; 3],
    pub(super) duration_ms: u16,
    /// The control points of each axis after the first one.
    pub(super) axes: [Axis; 3],
}

/// The further control points of an axis, mm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    Constant,
    Linear(i16),
    Cubic([i16; 3]),
}

impl Axis {
    /// Its four control points as a cubic, mm.
    fn control_mm(self, start_mm: i16) -> [f64; 4] {
        let a = f64::from(start_mm);
        match self {
            Self::Constant => [a; 4],
            Self::Linear(end_mm) => {
                let d = f64::from(end_mm);
                [a, a + (d - a) / 3.0, d - (d - a) / 3.0, d]
            }
            Self::Cubic(points_mm) => {
                let [b, c, d] = points_mm.map(f64::from);
                [a, b, c, d]
            }
        }
    }

    /// Its coefficients in m and s.
    pub(super) fn polynomial(self, start_mm: i16, duration_s: f64) -> [f64; 8] {
        let [a, b, c, d] = self.control_mm(start_mm).map(|mm| mm / 1000.0);
        let share = [a, 3.0 * (b - a), 3.0 * (a - 2.0 * b + c), d - 3.0 * c + 3.0 * b - a];
        let (t, t2) = (duration_s, duration_s * duration_s);
        [share[0], share[1] / t, share[2] / t2, share[3] / (t2 * t), 0.0, 0.0, 0.0, 0.0]
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

impl Piece {
    /// Bytes on board.
    pub(super) fn n_bytes(&self) -> usize {
        3 + 2 * self.axes.iter().map(|axis| axis.points_mm().len()).sum::<usize>()
    }

    /// The last control point, mm.
    pub(super) fn end_mm(&self) -> [i16; 3] {
        let end_mm = |axis: usize| self.axes[axis].points_mm().last().copied();
        std::array::from_fn(|axis| end_mm(axis).unwrap_or(self.start_mm[axis]))
    }

    /// Its motion as the firmware computes it.
    pub(super) fn polynomials(&self) -> Polynomials {
        let duration_s = f64::from(self.duration_ms) / 1000.0;
        let axis = |axis: usize| self.axes[axis].polynomial(self.start_mm[axis], duration_s);
        Polynomials { duration_s, axes: [axis(0), axis(1), axis(2)] }
    }

    /// As a Bézier curve: its four control points, m.
    pub(super) fn curve_m(&self) -> [Vector3<f64>; 4] {
        let axes = [0, 1, 2].map(|axis| self.axes[axis].control_mm(self.start_mm[axis]));
        [0, 1, 2, 3].map(|k| Vector3::from(axes.map(|axis| axis[k])) / 1000.0)
    }
}

impl Compressed {
    /// The bytes that the drone stores.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let start_mm = self.pieces.first().map_or([0; 3], |piece| piece.start_mm);
        let mut bytes = start_mm.map(i16::to_le_bytes).concat();
        bytes.extend(self.yaw.to_le_bytes());
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

    /// Reads the bytes that [`Self::to_bytes`] writes; yaw must be constant, and no axis of degree
    /// 7.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the byte at which they are broken.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self> {
        let mut reader = Reader { bytes, at: 0 };
        let mut start_mm = [reader.int16()?, reader.int16()?, reader.int16()?];
        let yaw = reader.int16()?;
        let mut pieces = Vec::new();
        loop {
            let header = reader.take::<1>()?[0];
            let duration_ms = u16::from_le_bytes(reader.take()?);
            if duration_ms == 0 {
                return match pieces.is_empty() {
                    true => Err(reader.broken("no piece", "a piece at least")),
                    false => Ok(Self { pieces, yaw }),
                };
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
            let piece = Piece { start_mm, duration_ms, axes };
            start_mm = piece.end_mm();
            pieces.push(piece);
        }
    }
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
    use super::super::super::recorded;
    use super::*;

    #[test]
    fn the_firmwares_own_evaluator_reads_these_bytes_the_same() {
        let (bytes, rows) = recorded::read(include_str!("../recorded/compressed.txt"));
        let trajectory = Compressed::from_bytes(&bytes).unwrap();
        recorded::assert_same(&rows, &trajectory.polynomials());
        assert_eq!(trajectory.to_bytes(), bytes);
    }

    #[test]
    fn a_heading_is_the_firmwares_first_yaw_and_constant() {
        let (mut bytes, _) = recorded::read(include_str!("../recorded/compressed.txt"));
        bytes[6..8].copy_from_slice(&(-900_i16).to_le_bytes());
        let trajectory = Compressed::from_bytes(&bytes).unwrap();
        assert_eq!((trajectory.yaw, trajectory.to_bytes()), (-900, bytes));
    }

    #[test]
    fn bytes_that_are_cut_off_or_of_another_form_are_refused() {
        let (bytes, _) = recorded::read(include_str!("../recorded/compressed.txt"));
        for end in 0..bytes.len() {
            assert!(Compressed::from_bytes(&bytes[..end]).is_err(), "cut at {end}");
        }
        for (header, word) in [(3, "degree 7"), (1 << 6, "yaw")] {
            let bytes = [vec![0; 8], vec![header, 1, 0], vec![0; 64]].concat();
            assert!(Compressed::from_bytes(&bytes).unwrap_err().to_string().contains(word));
        }
        assert!(Compressed::from_bytes(&[0; 11]).is_err(), "no piece");
    }
}
