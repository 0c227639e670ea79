//! Polynomials of degree 7: the Crazyflie's uncompressed trajectory, and the CSV of
//! `uav_trajectories` and Crazyswarm2.
//!
//! On-board format (firmware `pptraj.h`, `struct poly4d`): 33 float32 values per piece, namely 8
//! coefficients each for x, y, z and yaw, in ascending powers of the time in s, followed by the
//! duration in s. The CSV contains the same 33 numbers with the duration first (`uav_trajectory.py`
//! of Crazyswarm2 skips one header line).
//!
//! A piece is the quintic through the design's position, velocity and acceleration at both ends,
//! plus two terms, with `t³(T − t)³` and `t⁴(T − t)³`, that are fitted by least squares.

use nalgebra::{Matrix2, Vector2, Vector3};

use super::compressed::{Compressed, flies_heading};
use super::pieces::{Polynomial, Polynomials, Stretch, pieces};
use super::timeline::{Segment, Timeline};
use noctograph_core::crazyflie::{Release, TRAJECTORY_MEMORY_BYTES};
use noctograph_core::error::{Error, Result};
use noctograph_plan::Plan;

/// Number of bytes that a piece occupies on board.
const PIECE_BYTES: usize = 33 * 4;
/// Maximum number of pieces in the trajectory memory.
pub const MAX_PIECES: usize = TRAJECTORY_MEMORY_BYTES / PIECE_BYTES;
/// Minimum duration of a segment that becomes a piece, s. The first drone of a fleet has no hover.
const LEAST_SEGMENT_S: f64 = 1e-3;
/// Header line of the CSV.
const HEADER: &str = "Duration,x^0,x^1,x^2,x^3,x^4,x^5,x^6,x^7,y^0,y^1,y^2,y^3,y^4,y^5,y^6,y^7,\
                      z^0,z^1,z^2,z^3,z^4,z^5,z^6,z^7,yaw^0,yaw^1,yaw^2,yaw^3,yaw^4,yaw^5,yaw^6,yaw^7";

/// A trajectory of polynomial pieces.
#[derive(Clone, Debug, PartialEq)]
pub struct Poly4d {
    pub(super) pieces: Vec<Polynomials>,
    /// Constant heading.
    yaw_rad: f64,
}

impl Poly4d {
    /// Fits the letters of a plan to within `tolerance_m` of its design, in as many pieces as fit
    /// in the drone's memory. The error's hint depends on the release.
    ///
    /// # Errors
    ///
    /// Returns [`noctograph_core::error::Error::Input`] for a plan without letters, and
    /// [`noctograph_core::error::Error::Infeasible`] for a plan that requires more memory.
    pub fn fit(release: Release, plan: &Plan, tolerance_m: f64) -> Result<Self> {
        let stretch = Stretch::new(plan)?;
        let trajectory = Self::fit_any_length(plan, tolerance_m)?;
        let n = trajectory.pieces.len();
        if n <= MAX_PIECES {
            return Ok(trajectory);
        }
        // The error states the number of letters that fit, and the alternative formats.
        let fitting = &trajectory.pieces[..MAX_PIECES - 1];
        let until_s = fitting.iter().map(|piece| piece.duration_s).sum();
        let n_bytes = Compressed::of_any_length(&stretch, tolerance_m)?.to_bytes().len();
        let needs = format!(
            "the trajectory has {n} pieces of degree 7, but the drone's memory \
                             holds {MAX_PIECES}"
        );
        let other = if flies_heading(release, plan.yaw_rad) {
            format!(
                "export the trajectory compressed ({n_bytes} of {TRAJECTORY_MEMORY_BYTES} \
                     bytes)"
            )
        } else {
            "send setpoints over the radio (script for cflib)".to_owned()
        };
        let hint = format!("{other}, or accept a larger distance from the design");
        Err(stretch.too_long(until_s, &needs, &hint))
    }

    /// Fits the letters of a plan to within `tolerance_m` of its design, in any number of pieces.
    ///
    /// # Errors
    ///
    /// Returns [`noctograph_core::error::Error::Input`] for a plan without letters.
    pub fn fit_any_length(plan: &Plan, tolerance_m: f64) -> Result<Self> {
        let stretch = Stretch::new(plan)?;
        let next = |from, to, _: &[Polynomials], _| fit(&stretch, from, to);
        let pieces = pieces(&stretch, tolerance_m, f64::INFINITY, next, |piece| *piece);
        Ok(Self { pieces, yaw_rad: plan.yaw_rad })
    }

    /// Returns the flight from take-off to landing. The script lands `over_s` after the end of the
    /// trajectory. Returns [`noctograph_core::error::Error::Infeasible`] if the flight exceeds the
    /// memory.
    ///
    /// The firmware stops the motors after the flight: the last piece is NaN, so the onboard
    /// commander outputs no more setpoints (`crtp_commander_high_level.c`, "invalid eval"), and the
    /// watchdog ends the flight 2 s later.
    pub(super) fn flight(self, timeline: &Timeline, over_s: f64) -> Result<Self> {
        let no_goal = Polynomials { duration_s: 1.0, axes: [constant(f64::NAN); 3] };
        let before = segment_pieces(&timeline.segments_before());
        let after = segment_pieces(&timeline.segments_without_link(over_s));
        let pieces = [before, self.pieces, after, vec![no_goal]].concat();
        let n = pieces.len();
        if n > MAX_PIECES {
            let what = format!(
                "the trajectory has {n} pieces with take-off and landing, but the drone's memory \
                 holds {MAX_PIECES}"
            );
            let hint =
                "divide the word among more drones, or accept a larger distance from the design";
            return Err(Error::infeasible(what, hint));
        }
        Ok(Self { pieces, ..self })
    }

    /// Returns the first and the last position, m.
    pub(super) fn ends_m(&self) -> [Vector3<f64>; 2] {
        let (first, last) = (&self.pieces[0], &self.pieces[self.pieces.len() - 1]);
        [first.position_m(0.0), last.position_m(last.duration_s)]
    }

    /// Returns the bytes that the drone stores: 33 numbers of four bytes for each piece, which are
    /// eight coefficients each for x, y, z and yaw, and the duration in s.
    pub fn to_bytes(&self) -> Vec<u8> {
        let numbers = self.pieces.iter().flat_map(|piece| {
            let axes = piece.axes.into_iter().chain([constant(self.yaw_rad)]).flatten();
            axes.chain([piece.duration_s])
        });
        #[expect(clippy::cast_possible_truncation, reason = "the drone computes in f32")]
        numbers.flat_map(|number| (number as f32).to_le_bytes()).collect()
    }

    /// Returns the CSV of `uav_trajectories`, with as many digits as each number requires.
    pub fn to_csv(&self) -> String {
        let rows = self.pieces.iter().map(|piece| {
            let axes = piece.axes.into_iter().chain([constant(self.yaw_rad)]).flatten();
            let numbers = [piece.duration_s].into_iter().chain(axes);
            numbers.map(|number| format!("{number:?}")).collect::<Vec<_>>().join(",")
        });
        [HEADER.to_owned()].into_iter().chain(rows).map(|line| line + "\n").collect()
    }
}

/// Returns a piece for each segment from rest to rest.
fn segment_pieces(segments: &[Segment]) -> Vec<Polynomials> {
    let segments = segments.iter().filter(|segment| segment.duration_s > LEAST_SEGMENT_S);
    segments
        .map(|segment| Polynomials::from_rest_to_rest(segment.ends_m, segment.duration_s))
        .collect()
}

/// Returns a polynomial that is constant in time.
fn constant(value: f64) -> Polynomial {
    [value, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
}

/// Returns the piece between two setpoints: a quintic through the design's states at both, plus two
/// terms that fit the positions between them in the least-squares sense.
fn fit(stretch: &Stretch, from: usize, to: usize) -> Polynomials {
    // The initial piece is the quintic Hermite interpolation between both ends.
    let duration_s = stretch.time_s(to) - stretch.time_s(from);
    let (start, end) = (&stretch.setpoints[from], &stretch.setpoints[to]);
    let arrival_m_s2 = stretch.acceleration_before_m_s2(to);
    let quintics = [0, 1, 2].map(|axis| {
        let ends = [(start, &start.acceleration_m_s2), (end, &arrival_m_s2)];
        let ends = ends.map(|(s, a_m_s2)| [s.position_m[axis], s.velocity_m_s[axis], a_m_s2[axis]]);
        quintic(ends, duration_s)
    });
    let mut piece = Polynomials { duration_s, axes: quintics };
    // The residuals are fitted by normal equations, whose matrix is the same for all axes.
    let (mut normal_matrix, mut right_sides) = (Matrix2::zeros(), [Vector2::zeros(); 3]);
    for (time_s, design_m) in stretch.checks(from, to) {
        let t = time_s - stretch.time_s(from);
        // Both basis functions, scaled to about 1, and two derivatives vanish at both ends.
        let (s, rest) = (t / duration_s, 1.0 - t / duration_s);
        let bump = 64.0 * s * s * s * rest * rest * rest;
        let row = Vector2::new(bump, bump * (2.0 * s - 1.0));
        let residual_m = design_m - piece.position_m(t);
        normal_matrix += row * row.transpose();
        for axis in 0..3 {
            right_sides[axis] += row * residual_m[axis];
        }
    }
    // With too few times, the matrix is singular, and the quintic is kept.
    if let Some(inverse) = normal_matrix.try_inverse() {
        for (axis, right_side) in piece.axes.iter_mut().zip(right_sides) {
            add_bumps(axis, inverse * right_side, duration_s);
        }
    }
    piece
}

/// Returns the quintic Hermite polynomial with duration `t` in s, and with position, velocity and
/// acceleration `p, v, a` at the start and `q, w, b` at the end, in m and s.
fn quintic([[p, v, a], [q, w, b]]: [[f64; 3]; 2], t: f64) -> Polynomial {
    // A motion with constant acceleration would miss the end by the position d, the velocity e/t
    // and the acceleration f/t².
    let d = q - p - v * t - 0.5 * a * t * t;
    let e = (w - v - a * t) * t;
    let f = (b - a) * t * t;
    let (t3, t4, t5) = (t * t * t, t * t * t * t, t * t * t * t * t);
    [
        p,
        v,
        0.5 * a,
        (10.0 * d - 4.0 * e + 0.5 * f) / t3,
        (-15.0 * d + 7.0 * e - f) / t4,
        (6.0 * d - 3.0 * e + 0.5 * f) / t5,
        0.0,
        0.0,
    ]
}

/// Adds `64 s³(1−s)³ (c₀ + c₁(2s − 1))` with s = t/T to a polynomial in t. `c` is in m.
fn add_bumps(axis: &mut Polynomial, c: Vector2<f64>, duration_s: f64) {
    // The terms are s³(1−s)³ = s³ − 3s⁴ + 3s⁵ − s⁶, and 2s⁴(1−s)³ − s³(1−s)³ = −s³ + 5s⁴ − 9s⁵ +
    // 7s⁶ − 2s⁷.
    let even = [0.0, 0.0, 0.0, 1.0, -3.0, 3.0, -1.0, 0.0];
    let odd = [0.0, 0.0, 0.0, -1.0, 5.0, -9.0, 7.0, -2.0];
    // `scale` is the duration to the power of each coefficient.
    let mut scale = 1.0;
    for ((coefficient, even), odd) in axis.iter_mut().zip(even).zip(odd) {
        *coefficient += 64.0 * (c.x * even + c.y * odd) / scale;
        scale *= duration_s;
    }
}

#[cfg(test)]
mod tests {
    use super::super::pieces::motion;
    use super::super::tests::{Row, assert_same, checked_m, read, same_thousand, waves};
    use super::*;
    use noctograph_core::plan::PlanData;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{PlanOptions, plan};

    #[test]
    fn a_flight_rises_writes_waits_for_the_landing_and_comes_down_by_itself() {
        let plan = plan(&write("I", &LetterOptions::default()).unwrap(), &PlanOptions::even());
        let (plan, stretch) =
            (plan.as_ref().unwrap(), Stretch::new(plan.as_ref().unwrap()).unwrap());
        let one = Poly4d::fit(Release::MODELED, plan, 0.005).unwrap();
        // The drone starts 2 s after another drone in its fleet.
        let timeline = Timeline::new(plan, &stretch, stretch.start_s() - 2.0, one.ends_m());
        let all = one.clone().flight(&timeline, 0.5).unwrap();
        assert_eq!(all.pieces.len(), 3 + one.pieces.len() + 3);
        let durations_s: Vec<f64> = all.pieces.iter().map(|piece| piece.duration_s).collect();
        assert_eq!(durations_s[..2], [3.5; 2]);
        assert!((durations_s[2] - 2.0).abs() < 1e-9);
        let ([first_m, last_m], home_m) = (one.ends_m(), plan.setpoints[0].position_m);
        let place_m = |time_s: f64| motion(&all.pieces, time_s)[0];
        assert_eq!(place_m(0.0), Vector3::new(home_m.x, home_m.y, 0.0), "from the floor");
        for step in 0..=10 {
            let time_s = 0.35 * f64::from(step);
            assert!((place_m(time_s).xy() - home_m.xy()).norm() < 1e-9, "straight up");
            assert!((place_m(3.5 + time_s).z - first_m.z).abs() < 1e-9, "and level from there");
        }
        assert!((place_m(8.9) - first_m).norm() < 1e-9, "it waits for its turn");
        let end_s = 9.0 + stretch.duration_s();
        assert!((place_m(end_s + 3.4) - last_m).norm() < 1e-9, "and for the landing of the script");
        let sinks_s = f64::max((last_m.z + 0.1) / 0.3, 2.0);
        let mut before_m = last_m.z;
        for step in 0..100 {
            let time_s = end_s + 3.5 + sinks_s * f64::from(step) / 100.0;
            let [place_m, speed_m_s, _] = motion(&all.pieces, time_s);
            assert!(place_m.z <= before_m + 1e-9 && (place_m.xy() - last_m.xy()).norm() < 1e-9);
            assert!(speed_m_s.norm() < 0.7, "as fast as the firmware's own landing: {speed_m_s}");
            before_m = place_m.z;
        }
        assert!((-0.1..-0.09).contains(&before_m), "below the floor: {before_m} m");
        assert!(place_m(end_s + 3.6 + sinks_s).z.is_nan(), "and then no goal");
        assert!(all.to_csv().lines().last().unwrap().starts_with("1.0,NaN,"));
        let full = Poly4d { pieces: vec![one.pieces[0]; MAX_PIECES - 5], ..one };
        let error = full.flight(&timeline, 0.0).unwrap_err().to_string();
        assert!(error.contains("32 pieces with take-off and landing"), "{error}");
    }

    #[test]
    fn noor_fits_at_five_millimeters_and_not_at_one() {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::even()).unwrap();
        let trajectory = Poly4d::fit(Release::MODELED, &plan, 0.005).unwrap();
        let (n, stretch) = (trajectory.pieces.len(), Stretch::new(&plan).unwrap());
        let worst_m = checked_m(&stretch, &trajectory.pieces);
        assert!(n <= MAX_PIECES && worst_m <= 0.005 + 1e-9, "{n} pieces, {worst_m} m");
        assert_eq!(trajectory.to_bytes().len(), n * PIECE_BYTES);
        let [max_m_s, max_m_s2] = stretch.limits();
        for ms in 0..38_000 {
            let [_, v, a] = motion(&trajectory.pieces, f64::from(ms) / 1000.0);
            assert!(
                v.norm() <= 1.05 * max_m_s && a.norm() <= 1.05 * max_m_s2,
                "at {ms} ms: {v} {a}"
            );
        }
        let error = Poly4d::fit(Release::MODELED, &plan, 0.001).unwrap_err();
        assert!(error.to_string().contains("of 4 letters fit"), "{error}");
        assert!(error.hint().contains("compressed"), "{}", error.hint());
        let turned = Plan::made(PlanData { yaw_rad: 0.5, ..plan.into_data() });
        for (release, is_advised) in [(Release::R2026_04, false), (Release::R2026_08, true)] {
            let hint = Poly4d::fit(release, &turned, 0.001).unwrap_err().hint().to_owned();
            assert_eq!(hint.contains("compressed"), is_advised, "{release:?} flies it: {hint}");
        }
    }

    proptest::proptest! {
        #![proptest_config(same_thousand())]

        #[test]
        fn random_plans_are_fitted_within_tolerance_and_limits(
            plan in waves(),
            tolerance_m in 0.001..0.01_f64,
        ) {
            let trajectory = Poly4d::fit_any_length(&plan, tolerance_m).unwrap();
            let stretch = Stretch::new(&plan).unwrap();
            let worst_m = checked_m(&stretch, &trajectory.pieces);
            proptest::prop_assert!(worst_m <= tolerance_m + 1e-9, "{} m", worst_m);
            let [max_m_s, max_m_s2] = stretch.limits();
            for piece in &trajectory.pieces {
                for k in 0..=50 {
                    let [_, v, a] = piece.evaluate(piece.duration_s * f64::from(k) / 50.0);
                    let (v, a) = (v.norm(), a.norm());
                    proptest::prop_assert!(
                        v <= 1.05 * max_m_s && a <= 1.05 * max_m_s2,
                        "{} of {} m/s, {} of {} m/s²", v, max_m_s, a, max_m_s2
                    );
                }
            }
        }
    }

    /// Returns the bytes that were given to the firmware, its responses, and the trajectory.
    fn recorded_pieces() -> (Vec<u8>, Vec<Row>, Poly4d) {
        let (bytes, rows) = read(include_str!("recorded/poly4d.txt"));
        let number = |chunk: &[u8]| f64::from(f32::from_le_bytes(chunk.try_into().unwrap()));
        let pieces = bytes.chunks(PIECE_BYTES).map(|chunk| {
            let numbers: Vec<f64> = chunk.chunks(4).map(number).collect();
            let axes = [0, 8, 16].map(|k| numbers[k..k + 8].try_into().unwrap());
            Polynomials { duration_s: numbers[32], axes }
        });
        let pieces = pieces.collect();
        (bytes, rows, Poly4d { pieces, yaw_rad: 0.0 })
    }

    #[test]
    fn the_firmwares_own_evaluator_reads_these_bytes_the_same() {
        let (bytes, rows, trajectory) = recorded_pieces();
        assert_same(&rows, &trajectory.pieces);
        assert_eq!(trajectory.to_bytes(), bytes);
    }

    #[test]
    fn crazyswarms_own_reader_takes_this_csv_the_same() {
        let (_, _, trajectory) = recorded_pieces();
        let (csv, rows) = read(include_str!("recorded/uav_trajectory.txt"));
        assert_same(&rows, &trajectory.pieces);
        assert_eq!(trajectory.to_csv(), String::from_utf8(csv).unwrap());
    }
}
