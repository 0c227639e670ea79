//! Aligns a motion capture system's clock and frame with the drone's, by the path in both logs.
//!
//! The clocks of the computer and the drone have different zero times. The drone logs the positions
//! that the motion capture system sent (`ae483log.p_x_mocap` …) or its own estimates. The time
//! shift with the least misfit between the two paths is used.
//!
//! The frame of the motion capture system may be rotated about the vertical axis, shifted, or have
//! y up. It is registered to the drone's frame by the best rigid transform, provided that the
//! residual is at most a few centimeters. Otherwise the system's columns are dropped.

use nalgebra::{Rotation3, Vector3};

use super::PositionSource;
use super::recording::{Block, Channel, Clock, Recording};
use super::sources::position;
use noctograph_core::crazyflie::SLOW_CLOCK;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::geometry::turned;

/// Number of times at which the two paths are compared.
const N_STAMPS: u32 = 200;

/// Time step of the coarse search, in which the drone moves 1 cm at 0.2 m/s.
const COARSE_S: f64 = 0.05;

/// Maximum number of steps in the coarse search. For longer logs the step is increased.
const MAX_STEPS: f64 = 8000.0;

/// Maximum unexplained fraction of the path's variance, for the whole path and for each half of it,
/// which must fit better because the clock rate is derived from the halves.
const WORST_MISFIT: f64 = 0.2;
const WORST_HALF_MISFIT: f64 = 0.25 * WORST_MISFIT;
/// Maximum mean square distance with a rotation, as a fraction of that without. A nearly vertical
/// path, or one with a large error, does not determine a rotation.
const WORST_ROTATED: f64 = 0.25;
/// Maximum difference of the clock rates, as a fraction. Known ones differ by 1/85.
const MAX_RATE: f64 = 0.02;

/// Difference of the clock rates up to which it may be noise of the fit, as a fraction.
const RATE_NOISE: f64 = 0.003;
/// Difference up to which a clock rate is that of older firmware, as a fraction.
const SAME_RATE: f64 = 0.002;
/// Mean distance of the paths from which on a warning names it, m.
const LEAST_OFFSET_M: f64 = 0.05;
/// Least mean square of the path's distances from their mean, m². Its root is 2 cm.
const LEAST_SPREAD_M2: f64 = 4e-4;

/// Maximum gap in the motion capture over which it is interpolated.
const MAX_GAP_S: f64 = 0.25;

/// Converts the blocks of the motion capture system to the drone's clock and frame, or removes them
/// if that is impossible.
pub(super) fn aligned(mut log: Recording) -> Recording {
    if log.blocks.iter().all(|block| block.clock == Clock::Drone) {
        return log;
    }
    // The positions that the motion capture sent to the drone are on the same path. The drone's
    // estimates are close to it.
    let path = moving_channels(&log, "ae483log.p_{x y z}_mocap")
        .or_else(|| position(&log, PositionSource::Firmware))
        .or_else(|| position(&log, PositionSource::Custom));
    let shift = moving_channels(&log, "mocap.{x y z}").zip(path).and_then(|(mocap, path)| {
        // The assumptions, strictest first, are: the same frame, a rotated frame, and one with y
        // up.
        let mut search = Search { mocap, path, may_rotate: false };
        for may_rotate in [false, true] {
            search.may_rotate = may_rotate;
            if let Some(shift) = search.shift() {
                return Some((shift, false));
            }
        }
        search.mocap.swap(1, 2);
        search.mocap[1].values.iter_mut().for_each(|z| *z = -*z);
        Some((search.shift()?, true))
    });
    let is_registered = match &shift {
        None => {
            let text = "the motion capture's clock could not be aligned with the drone's (no \
                        common path): its columns are left out";
            log.warn("mocap-left-out", text);
            false
        }
        Some((shift, y_up)) => {
            log.warnings.extend(shift.warnings(*y_up));
            !shift.has_other_frame() || shift.transform_fit.residual_m <= MAX_RESIDUAL_M
        }
    };
    let Some((shift, y_up)) = shift.filter(|_| is_registered) else {
        log.blocks.retain(|block| block.clock == Clock::Drone);
        return log;
    };
    for block in log.blocks.iter_mut().filter(|block| block.clock == Clock::Mocap) {
        block.time_s.iter_mut().for_each(|time_s| *time_s = shift.drone_s(*time_s));
        if shift.has_other_frame() || y_up {
            shift.transform(block, y_up);
        }
    }
    log
}

/// Returns the channels of a pattern, or `None` if none of them varies.
fn moving_channels(recording: &Recording, pattern: &str) -> Option<Vec<Channel>> {
    let channels = recording.channels(pattern)?;
    let moves = channels.iter().any(|c| c.values.iter().any(|v| *v != c.values[0]));
    moves.then_some(channels)
}

/// Registration of the motion capture system to the drone's clock and frame.
#[derive(Debug)]
struct Shift {
    /// Fixed point of `drone = pivot_drone + ratio · (mocap − pivot_mocap)`, on both clocks.
    pivot_drone_s: f64,
    pivot_mocap_s: f64,
    ratio: f64,
    /// Mean of the drone's path minus that of the motion capture, on each axis.
    frame_offset_m: Vector3<f64>,
    /// Transform from the motion capture system's frame to the drone's.
    transform_fit: Fit,
}

/// Maximum difference within a common frame. It may be an estimator's error, or a marker that is
/// not at the center of the body.
const SAME_M: f64 = 0.15;
const SAME_RAD: f64 = 0.09;

/// Maximum residual after a transform between two logs of the same path.
const MAX_RESIDUAL_M: f64 = 0.1;

impl Shift {
    /// True if the frames of the motion capture system and the drone differ.
    fn has_other_frame(&self) -> bool {
        self.frame_offset_m.amax() > SAME_M || self.transform_fit.rotation_rad.abs() > SAME_RAD
    }

    /// Transforms the positions and the yaw of a block to the drone's frame. `y_up` is true if the
    /// capture has y up instead of z.
    fn transform(&self, block: &mut Block, y_up: bool) {
        let Fit { rotation_rad, translation_m, .. } = self.transform_fit;
        let columns = ["mocap.x", "mocap.y", "mocap.z"]
            .map(|name| block.columns.iter().position(|column| column.name == name));
        let [Some(x), Some(y), Some(z)] = columns else { return };
        for i in 0..block.time_s.len() {
            let [x_m, y_m, z_m] = [x, y, z].map(|column| block.columns[column].values[i]);
            // The axes are exchanged as in the search, and then the fitted transform is applied.
            let captured_m = if y_up { [x_m, -z_m, y_m] } else { [x_m, y_m, z_m] };
            let placed_m = turned(&captured_m.into(), rotation_rad) + translation_m;
            for (column, value) in [x, y, z].into_iter().zip(&placed_m) {
                block.columns[column].values[i] = *value;
            }
        }
        if let Some(yaw) = block.column_mut("mocap.yaw") {
            yaw.values.iter_mut().for_each(|value| *value += rotation_rad);
        }
    }

    /// Converts a time on the motion capture system's clock to the drone's clock.
    fn drone_s(&self, mocap_s: f64) -> f64 {
        self.pivot_drone_s + self.ratio * (mocap_s - self.pivot_mocap_s)
    }

    /// Returns warnings about a different clock rate, a different frame, or an offset. `y_up` is
    /// true if the capture has y up instead of z.
    fn warnings(&self, y_up: bool) -> Vec<Diagnostic> {
        [self.rate_warning(), self.frame_warning(y_up)].into_iter().flatten().collect()
    }

    /// Returns a warning if the clock rates differ.
    fn rate_warning(&self) -> Option<Diagnostic> {
        let is_slow = (self.ratio - SLOW_CLOCK).abs() < SAME_RATE;
        let (ratio, firmware) = if is_slow {
            let release = ", as in firmware up to and with release 2026.08";
            (format!("84/85 = {SLOW_CLOCK:.4}"), release)
        } else {
            (format!("{:.4}", self.ratio), "")
        };
        let text = format!(
            "the drone's clock counts {ratio} s per second of the motion capture's{firmware}"
        );
        ((self.ratio - 1.0).abs() > RATE_NOISE).then(|| Diagnostic::warning("clock-rate", text))
    }

    /// Returns a warning if the frames differ or are offset. `y_up` is true if the capture has y up
    /// instead of z.
    fn frame_warning(&self, y_up: bool) -> Option<Diagnostic> {
        // The frames are registered, not registered, or nearly the same.
        let [x, y, z] = self.frame_offset_m.into();
        let Fit { rotation_rad, translation_m, residual_m, .. } = self.transform_fit;
        let (degrees, residual_cm) = (rotation_rad.to_degrees(), 100.0 * residual_m);
        let axes = if y_up { "y up, " } else { "" };
        let [to_x, to_y, to_z] = translation_m.into();
        let (code, text) = if (self.has_other_frame() || y_up) && residual_m <= MAX_RESIDUAL_M {
            let text = format!(
                "the motion capture's world differs from the drone's: {axes}turned by \
                 {degrees:.1}° and shifted by ({to_x:.3}, {to_y:.3}, {to_z:.3}) m; after its \
                 transform to the drone's world, {residual_cm:.1} cm of difference are left"
            );
            ("mocap-turned", text)
        } else if self.has_other_frame() {
            let text = format!(
                "the motion capture's world differs from the drone's, and no rotation and shift \
                 makes the paths agree ({residual_cm:.0} cm of difference are left): its columns \
                 are left out"
            );
            ("mocap-left-out", text)
        } else if self.frame_offset_m.amax() > LEAST_OFFSET_M {
            let text = format!(
                "the drone's path lies ({x:.3}, {y:.3}, {z:.3}) m from the motion capture's on \
                 average: their frames may differ, and so may setpoints and positions"
            );
            ("mocap-offset", text)
        } else {
            return None;
        };
        Some(Diagnostic::warning(code, text))
    }
}

/// A search for the time shift between two paths.
#[derive(Clone)]
struct Search {
    mocap: Vec<Channel>,
    path: Vec<Channel>,
    /// True if the two frames may be rotated relative to each other.
    may_rotate: bool,
}

/// Best fit of the motion capture's path to the drone's at one time shift.
#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    /// Unexplained fraction of the variance of the drone's path.
    misfit: f64,
    /// Mean of the drone's path minus that of the motion capture.
    offset_m: Vector3<f64>,
    /// Transform between the paths: a rotation about z, followed by a translation.
    rotation_rad: f64,
    translation_m: Vector3<f64>,
    /// Root mean square distance of the transformed path from the drone's.
    residual_m: f64,
}

impl Search {
    /// Finds the time shift, the ratio of the clock rates, and the transform. Returns `None` if the
    /// paths do not match.
    fn shift(&self) -> Option<Shift> {
        let (mocap_start_s, mocap_end_s) = span(&self.mocap);
        let (start_s, end_s) = span(&self.path);
        let (stamps, lasts_s) = (stamps(start_s, end_s), end_s - start_s);
        let (low_s, high_s) = (start_s - mocap_end_s, end_s - mocap_start_s);
        let step_s = ((high_s - low_s) / MAX_STEPS).max(COARSE_S);
        // A grid search over all shifts is followed by a search around the best of them, with a
        // twentieth of the step, which is 2.5 ms.
        let coarse_s =
            self.best_shift(&stamps, 0.5 * (low_s + high_s), 0.5 * (high_s - low_s), step_s)?;
        let fine_s = self.best_shift(&stamps, coarse_s, step_s, step_s / 20.0)?;
        let fit =
            self.fit(&stamps, fine_s, self.may_rotate).filter(|fit| fit.misfit < WORST_MISFIT)?;
        let middle_s = 0.5 * (start_s + end_s);
        // Over the whole path, the shift changes by at most this time.
        let reach_s = MAX_RATE * lasts_s + COARSE_S;
        let slope = self.slope([start_s, middle_s, end_s], fine_s, reach_s);
        let mut shift = Shift {
            pivot_drone_s: middle_s,
            pivot_mocap_s: middle_s - fine_s,
            ratio: 1.0,
            frame_offset_m: fit.offset_m,
            transform_fit: Fit::default(),
        };
        let transform_fit = if slope.abs() > RATE_NOISE {
            // The search for the shift is repeated with the rescaled clock, in two passes with
            // steps of a hundredth and a two-thousandth of the reach.
            shift.ratio = 1.0 / (1.0 - slope);
            let mut rescaled = self.clone();
            for time_s in rescaled.mocap.iter_mut().flat_map(|channel| &mut channel.time_s) {
                *time_s = shift.drone_s(*time_s) - fine_s;
            }
            let near_s = rescaled.best_shift(&stamps, fine_s, reach_s, 0.01 * reach_s)?;
            let rescaled_s =
                rescaled.best_shift(&stamps, near_s, 0.01 * reach_s, 0.0005 * reach_s)?;
            shift.pivot_drone_s += rescaled_s - fine_s;
            shift.frame_offset_m = rescaled.fit(&stamps, rescaled_s, self.may_rotate)?.offset_m;
            rescaled.fit(&stamps, rescaled_s, true)
        } else {
            self.fit(&stamps, fine_s, true)
        };
        shift.transform_fit = transform_fit.unwrap_or_default();
        Some(shift)
    }

    /// Returns the change of the shift per second of the drone's clock, from the shifts of both
    /// halves of the path, or 0 if a half does not fit. `times_s` are the start, middle and end of
    /// the path. The shifts are within `reach_s` of `around_s`.
    fn slope(&self, times_s: [f64; 3], around_s: f64, reach_s: f64) -> f64 {
        let [start_s, middle_s, end_s] = times_s;
        let [first_s, second_s] = [(start_s, middle_s), (middle_s, end_s)].map(|(from_s, to_s)| {
            let stamps = stamps(from_s, to_s);
            let shift_s = self.best_shift(&stamps, around_s, reach_s, reach_s / 100.0)?;
            let misfit = self.fit(&stamps, shift_s, self.may_rotate)?.misfit;
            (misfit < WORST_HALF_MISFIT).then_some(shift_s)
        });
        let half_s = 0.5 * (end_s - start_s);
        first_s.zip(second_s).map_or(0.0, |(first_s, second_s)| (second_s - first_s) / half_s)
    }

    /// Returns the shift in s with the least misfit within `reach_s` of `around_s`, on a grid with
    /// a spacing of `step_s`. Returns `None` if no shift fits.
    fn best_shift(&self, stamps: &[f64], around_s: f64, reach_s: f64, step_s: f64) -> Option<f64> {
        if !(reach_s.is_finite() && around_s.is_finite() && step_s > 0.0) {
            return None;
        }
        let (mut best_shift, mut offset_s) = (None, -reach_s);
        // The search is exhaustive, because the misfit has many local minima.
        while offset_s <= reach_s {
            let shift_s = around_s + offset_s;
            if let Some(fit) = self.fit(stamps, shift_s, self.may_rotate)
                && best_shift.is_none_or(|(misfit, _)| fit.misfit < misfit)
            {
                best_shift = Some((fit.misfit, shift_s));
            }
            offset_s += step_s;
        }
        best_shift.map(|(_, shift_s)| shift_s)
    }

    /// Fits the motion capture, delayed by `shift_s`, to the drone's path by a translation and, if
    /// `may_rotate`, by a rotation about z (Horn 1987, in the plane). Returns `None` if less than
    /// half of the path was captured, or if nothing moves.
    fn fit(&self, stamps: &[f64], shift_s: f64, may_rotate: bool) -> Option<Fit> {
        let mut pairs = Vec::from_iter(stamps.iter().filter_map(|t| {
            let path_m = position_m(&self.path, *t, path_gap_s)?;
            Some((path_m, position_m(&self.mocap, t - shift_s, |_| MAX_GAP_S)?))
        }));
        if pairs.len() * 2 < stamps.len() {
            return None;
        }
        // The best translation equalizes the means. The best rotation angle follows from the sums
        // of the cross and dot products of the differences from the means.
        let n = pairs.len() as f64;
        let [to_m, from_m] = pairs
            .iter()
            .fold([Vector3::zeros(); 2], |[to, from], pair| [to + pair.0 / n, from + pair.1 / n]);
        let (mut sin, mut cos, mut spread) = (0.0, 0.0, 0.0);
        for (to, from) in &mut pairs {
            (*to, *from) = (*to - to_m, *from - from_m);
            sin += from.x * to.y - from.y * to.x;
            cos += from.x * to.x + from.y * to.y;
            spread += to.norm_squared() / n;
        }
        let best_rotation_rad = libm::atan2(sin, cos);
        let [rotated_m2, unrotated_m2] =
            [best_rotation_rad, 0.0].map(|turn| mean_square_m2(&pairs, turn));
        let is_rotated = may_rotate && rotated_m2 < WORST_ROTATED * unrotated_m2;
        let (rotation_rad, mean_square_m2) =
            if is_rotated { (best_rotation_rad, rotated_m2) } else { (0.0, unrotated_m2) };
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), rotation_rad);
        let (misfit, residual_m, offset_m) =
            (mean_square_m2 / spread, mean_square_m2.sqrt(), to_m - from_m);
        let translation_m = to_m - turn * from_m;
        (spread > LEAST_SPREAD_M2).then_some(Fit {
            misfit,
            offset_m,
            rotation_rad,
            translation_m,
            residual_m,
        })
    }
}

/// Interpolates a position at a time, in m. Returns `None` in gaps longer than `gap_s` returns for
/// a channel.
fn position_m(
    channels: &[Channel],
    time_s: f64,
    gap_s: fn(&Channel) -> f64,
) -> Option<Vector3<f64>> {
    let [x, y, z] = [0, 1, 2].map(|k| channels[k].linear(time_s, gap_s(&channels[k])));
    Some(Vector3::new(x?, y?, z?))
}

/// Returns the mean square distance in m² of pairs after the second point of each is rotated about
/// z.
fn mean_square_m2(pairs: &[(Vector3<f64>, Vector3<f64>)], rotation_rad: f64) -> f64 {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), rotation_rad);
    let n = pairs.len() as f64;
    pairs.iter().map(|(to, from)| (to - turn * from).norm_squared() / n).sum()
}

/// Returns the maximum gap in the drone's path in s over which the path is interpolated: 1 s, or
/// two missing samples of a slower log.
fn path_gap_s(path: &Channel) -> f64 {
    1.0_f64.max(3.0 * path.period_s)
}

/// Returns the first and last time that all channels cover.
fn span(channels: &[Channel]) -> (f64, f64) {
    let start_s = channels.iter().map(Channel::start_s).fold(f64::NEG_INFINITY, f64::max);
    (start_s, channels.iter().map(Channel::end_s).fold(f64::INFINITY, f64::min))
}

/// Returns [`N_STAMPS`] equally spaced times from the start to the end.
fn stamps(start_s: f64, end_s: f64) -> Vec<f64> {
    let fractions = (0..N_STAMPS).map(|i| f64::from(i) / f64::from(N_STAMPS - 1));
    fractions.map(|fraction| start_s + (end_s - start_s) * fraction).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path(n: u32, period_s: f64, clock: impl Fn(f64) -> f64, offset_m: f64) -> Vec<Channel> {
        let axis = |rate: f64| {
            let times = (0..n).map(|i| f64::from(i) * period_s);
            let value = |t: f64| libm::sin(rate * t) + 0.3 * libm::sin(0.03 * t * t) + offset_m;
            Channel::new(times.clone().map(&clock).collect(), times.map(value).collect())
        };
        vec![axis(0.5), axis(0.31), axis(0.77)]
    }

    #[test]
    fn the_shift_of_the_clocks_is_found_to_milliseconds() {
        let drone = path(1500, 0.02, |t| t + 223.0, 0.0);
        let mocap = path(3000, 0.01, |t| t + 4097.3, 0.2);
        let shift = Search { mocap, path: drone, may_rotate: false }.shift().unwrap();
        assert!((shift.drone_s(4110.0) - (4110.0 - 4097.3 + 223.0)).abs() < 0.004, "{shift:?}");
        assert!((shift.frame_offset_m[0] + 0.2).abs() < 0.01, "and the frames' offset: {shift:?}");
    }

    #[test]
    fn a_slow_clock_is_found() {
        let ratio = 84.0 / 85.0;
        let drone = path(3000, 0.02, |t| t * ratio + 50.0, 0.0);
        let mocap = path(6000, 0.01, |t| t + 9000.0, 0.0);
        let shift = Search { mocap, path: drone, may_rotate: false }.shift().unwrap();
        assert!((shift.ratio - ratio).abs() < 1e-3, "{shift:?}");
        assert!((shift.drone_s(9010.0) - (10.0 * ratio + 50.0)).abs() < 0.02, "{shift:?}");
    }

    #[test]
    fn a_world_that_is_turned_and_far_away_is_laid_onto_the_drones() {
        let drone = path(1500, 0.02, |t| t + 223.0, 0.0);
        let (sin, cos) = (libm::sin(0.7), libm::cos(0.7));
        let straight = path(3000, 0.01, |t| t + 4097.3, 0.0);
        let [x, y, z] = <[Channel; 3]>::try_from(straight).unwrap();
        let turned = |to: &dyn Fn(f64, f64) -> f64| {
            let values = x.values.iter().zip(&y.values).map(|(x, y)| to(*x, *y)).collect();
            Channel { values, ..x.clone() }
        };
        let mocap = vec![
            turned(&|x, y| cos * x + sin * y + 2.0),
            turned(&|x, y| -sin * x + cos * y - 1.0),
            z.clone(),
        ];
        let search = Search { mocap, path: drone, may_rotate: false };
        assert!(search.shift().is_none(), "as it is, it is another path");
        let shift = Search { may_rotate: true, ..search }.shift().unwrap();
        assert!(shift.has_other_frame() && shift.transform_fit.residual_m < 0.01, "{shift:?}");
        assert!((shift.transform_fit.rotation_rad - 0.7).abs() < 1e-3, "{shift:?}");
        assert!((shift.drone_s(4110.0) - (4110.0 - 4097.3 + 223.0)).abs() < 0.004, "{shift:?}");
        let said = shift.warnings(false)[0].to_string();
        assert!(said.contains("turned by 40.1°") && said.contains("are left"), "{said}");
    }

    #[test]
    fn other_paths_have_no_shift() {
        let drone = path(1000, 0.02, |t| t, 0.0);
        let still = vec![Channel::new(vec![0.0, 30.0], vec![1.0; 2]); 3];
        assert!(Search { mocap: still, path: drone, may_rotate: false }.shift().is_none());
    }
}
