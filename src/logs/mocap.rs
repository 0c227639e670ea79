//! Alignment of the motion capture's clock with the drone's, by the path that both have logged.
//!
//! The clocks of the computer and of the drone have different zeros. The drone logs the positions
//! that the motion capture sent (`ae483log.p_x_mocap` …) or its estimates. The shift that explains
//! most of their variance is taken.
//!
//! Its world frame may differ from the drone's: turned about the vertical, shifted, with y up. It
//! is then registered to the drone's by the best rigid transform, if the residual is some
//! centimeters. Otherwise its columns are left out, since distances between two frames mean
//! nothing.

use nalgebra::{Rotation3, Vector3};

use super::PositionSource;
use super::recording::{Block, Channel, Clock, Recording};
use super::sources::position;
use noctograph_core::crazyflie::SLOW_CLOCK;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::geometry::turned;

/// Number of times at which the two paths are compared.
const N_STAMPS: u32 = 200;

/// Step of the first search: 1 cm of path at 0.2 m/s.
const COARSE_S: f64 = 0.05;

/// Most steps of the first search: longer logs are searched in longer steps.
const MAX_STEPS: f64 = 8000.0;

/// Largest fraction of the path's variance that may stay unexplained.
const WORST_MISFIT: f64 = 0.2;

/// Longest gap in the motion capture that is interpolated.
const MAX_GAP_S: f64 = 0.25;

/// The same with the blocks of the motion capture on the drone's clock and in its world, or without
/// them.
pub(super) fn aligned(mut log: Recording) -> Recording {
    if log.blocks.iter().all(|block| block.clock == Clock::Drone) {
        return log;
    }
    // The path that the motion capture sent is the same path. An estimate is nearly the same.
    let path = moving(&log, "ae483log.p_{x y z}_mocap")
        .or_else(|| position(&log, PositionSource::Firmware))
        .or_else(|| position(&log, PositionSource::Custom));
    let shift = moving(&log, "mocap.{x y z}").zip(path).and_then(|(mocap, path)| {
        // From the strictest assumption to the weakest: one world, a turned one, one with y up.
        let mut search = Search { mocap, path, free: false };
        for free in [false, true] {
            search.free = free;
            if let Some(shift) = search.shift() {
                return Some((shift, false));
            }
        }
        search.mocap.swap(1, 2);
        search.mocap[1].values.iter_mut().for_each(|z| *z = -*z);
        Some((search.shift()?, true))
    });
    let is_laid = match &shift {
        None => {
            let text = "the motion capture's clock could not be aligned with the drone's (no \
                        common path): its columns are left out";
            log.warn("mocap-left-out", text);
            false
        }
        Some((shift, y_up)) => {
            log.warnings.extend(shift.warnings(*y_up));
            !shift.is_elsewhere() || shift.placed.left_m <= MOST_LEFT_M
        }
    };
    let Some((shift, y_up)) = shift.filter(|_| is_laid) else {
        log.blocks.retain(|block| block.clock == Clock::Drone);
        return log;
    };
    for block in log.blocks.iter_mut().filter(|block| block.clock == Clock::Mocap) {
        block.time_s.iter_mut().for_each(|time_s| *time_s = shift.drone_s(*time_s));
        if shift.is_elsewhere() || y_up {
            shift.place(block, y_up);
        }
    }
    log
}

/// Channels of a pattern, if any of them changes.
fn moving(recording: &Recording, pattern: &str) -> Option<Vec<Channel>> {
    let channels = recording.channels(pattern)?;
    let moves = channels.iter().any(|c| c.values.iter().any(|v| *v != c.values[0]));
    moves.then_some(channels)
}

#[derive(Debug)]
struct Shift {
    /// `drone = pivot_drone + ratio · (mocap − pivot_mocap)`.
    pivot_drone_s: f64,
    pivot_mocap_s: f64,
    ratio: f64,
    /// Mean of drone's path − motion capture's path, per axis.
    frame_offset_m: Vector3<f64>,
    /// The transform from the motion capture's world to the drone's.
    placed: Fit,
}

/// Frames that differ by less are one: an estimator's error, a marker beside the middle of the
/// body.
const SAME_M: f64 = 0.15;
const SAME_RAD: f64 = 0.09;

/// Largest residual of a transform between two logs of one path.
const MOST_LEFT_M: f64 = 0.1;

impl Shift {
    /// True if the motion capture's world is another than the drone's.
    fn is_elsewhere(&self) -> bool {
        self.frame_offset_m.amax() > SAME_M || self.placed.turn_rad.abs() > SAME_RAD
    }

    /// Lays a block's positions and yaw onto the drone's world.
    fn place(&self, block: &mut Block, y_up: bool) {
        let Fit { turn_rad, move_m, .. } = self.placed;
        let places = ["mocap.x", "mocap.y", "mocap.z"]
            .map(|name| block.columns.iter().position(|column| column.name == name));
        let [Some(x), Some(y), Some(z)] = places else { return };
        for i in 0..block.time_s.len() {
            let [x_m, y_m, z_m] = [x, y, z].map(|place| block.columns[place].values[i]);
            // The same turn of the axes as in the search, then that of the fit.
            let captured_m = if y_up { [x_m, -z_m, y_m] } else { [x_m, y_m, z_m] };
            let placed_m = turned(&captured_m.into(), turn_rad) + move_m;
            for (place, value) in [x, y, z].into_iter().zip(&placed_m) {
                block.columns[place].values[i] = *value;
            }
        }
        if let Some(yaw) = block.column_mut("mocap.yaw") {
            yaw.values.iter_mut().for_each(|value| *value += turn_rad);
        }
    }

    fn drone_s(&self, mocap_s: f64) -> f64 {
        self.pivot_drone_s + self.ratio * (mocap_s - self.pivot_mocap_s)
    }

    fn warnings(&self, y_up: bool) -> Vec<Diagnostic> {
        let mut warnings = Vec::new();
        // A fit of the rate to 0.3 % is noise.
        if (self.ratio - 1.0).abs() > 0.003 {
            let is_slow = (self.ratio - SLOW_CLOCK).abs() < 0.002;
            let (ratio, firmware) = match is_slow {
                true => (
                    format!("84/85 = {SLOW_CLOCK:.4}"),
                    ", as in firmware up to and with release 2026.08",
                ),
                false => (format!("{:.4}", self.ratio), ""),
            };
            let text = format!(
                "the drone's clock counts {ratio} s per second of the motion capture's{firmware}"
            );
            warnings.push(Diagnostic::warning("clock-rate", text));
        }
        // Then the worlds: laid onto each other, left apart, or nearly one.
        let [x, y, z] = self.frame_offset_m.into();
        let Fit { turn_rad, move_m, left_m, .. } = self.placed;
        let (degrees, left_cm) = (turn_rad.to_degrees(), 100.0 * left_m);
        let axes = if y_up { "y up, " } else { "" };
        let [to_x, to_y, to_z] = move_m.into();
        let (code, text) = if (self.is_elsewhere() || y_up) && left_m <= MOST_LEFT_M {
            let text = format!(
                "the motion capture's world is another than the drone's: {axes}turned by {degrees:.1}° and \
                 shifted by ({to_x:.3}, {to_y:.3}, {to_z:.3}) m; it is laid onto the drone's, which leaves \
                 {left_cm:.1} cm"
            );
            ("mocap-turned", text)
        } else if self.is_elsewhere() {
            let text = format!(
                "the motion capture's world is another than the drone's, and no turn and shift lays one \
                 onto the other ({left_cm:.0} cm are left): its columns are left out"
            );
            ("mocap-left-out", text)
        } else if self.frame_offset_m.amax() > 0.05 {
            let text = format!(
                "the drone's path lies ({x:.3}, {y:.3}, {z:.3}) m from the motion capture's on \
                 average: their frames may differ, and so may setpoints and positions"
            );
            ("mocap-offset", text)
        } else {
            return warnings;
        };
        warnings.push(Diagnostic::warning(code, text));
        warnings
    }
}

#[derive(Clone)]
struct Search {
    mocap: Vec<Channel>,
    path: Vec<Channel>,
    /// True if the two worlds may be turned against each other.
    free: bool,
}

#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    misfit: f64,
    offset_m: Vector3<f64>,
    /// The transform between the paths: a turn about z, then a shift.
    turn_rad: f64,
    move_m: Vector3<f64>,
    left_m: f64,
}

impl Search {
    fn shift(&self) -> Option<Shift> {
        let (mocap_start_s, mocap_end_s) = span(&self.mocap);
        let (start_s, end_s) = span(&self.path);
        let (stamps, lasts_s) = (stamps(start_s, end_s), end_s - start_s);
        let (low_s, high_s) = (start_s - mocap_end_s, end_s - mocap_start_s);
        let step_s = ((high_s - low_s) / MAX_STEPS).max(COARSE_S);
        // Coarse to fine: a grid over all shifts, then one around the best of them.
        let coarse_s =
            self.best(&stamps, 0.5 * (low_s + high_s), 0.5 * (high_s - low_s), step_s)?;
        let fine_s = self.best(&stamps, coarse_s, step_s, step_s / 20.0)?;
        let fit = self.fit(&stamps, fine_s, self.free).filter(|fit| fit.misfit < WORST_MISFIT)?;
        let middle_s = 0.5 * (start_s + end_s);
        let reach_s = 0.02 * lasts_s + COARSE_S;
        // The difference of the halves' shifts is the difference of the clocks' rates.
        let [first_s, second_s] = [(start_s, middle_s), (middle_s, end_s)].map(|(from_s, to_s)| {
            let stamps = self::stamps(from_s, to_s);
            let shift_s = self.best(&stamps, fine_s, reach_s, reach_s / 100.0)?;
            let good = self.fit(&stamps, shift_s, self.free)?.misfit < 0.25 * WORST_MISFIT;
            good.then_some(shift_s)
        });
        let slope = first_s.zip(second_s).map_or(0.0, |(a_s, b_s)| (b_s - a_s) / (0.5 * lasts_s));
        let mut shift = Shift {
            pivot_drone_s: middle_s,
            pivot_mocap_s: middle_s - fine_s,
            ratio: 1.0,
            frame_offset_m: fit.offset_m,
            placed: Fit::default(),
        };
        // A slope below 0.3 % is noise of the fit.
        let placed = if slope.abs() > 0.003 {
            // On the paced clock, the shift is searched once more.
            shift.ratio = 1.0 / (1.0 - slope);
            let mut paced = self.clone();
            for time_s in paced.mocap.iter_mut().flat_map(|channel| &mut channel.time_s) {
                *time_s = shift.drone_s(*time_s) - fine_s;
            }
            let near_s = paced.best(&stamps, fine_s, reach_s, 0.01 * reach_s)?;
            let paced_s = paced.best(&stamps, near_s, 0.01 * reach_s, 0.0005 * reach_s)?;
            shift.pivot_drone_s += paced_s - fine_s;
            shift.frame_offset_m = paced.fit(&stamps, paced_s, self.free)?.offset_m;
            paced.fit(&stamps, paced_s, true)
        } else {
            self.fit(&stamps, fine_s, true)
        };
        shift.placed = placed.unwrap_or_default();
        Some(shift)
    }

    /// The best shift within `reach_s` of `around_s`, on a grid of `step_s`.
    fn best(&self, stamps: &[f64], around_s: f64, reach_s: f64, step_s: f64) -> Option<f64> {
        if !(reach_s.is_finite() && around_s.is_finite() && step_s > 0.0) {
            return None;
        }
        let (mut best, mut offset_s) = (None, -reach_s);
        // Exhaustive: the misfit has many local minima.
        while offset_s <= reach_s {
            let shift_s = around_s + offset_s;
            if let Some(fit) = self.fit(stamps, shift_s, self.free)
                && best.is_none_or(|(misfit, _)| fit.misfit < misfit)
            {
                best = Some((fit.misfit, shift_s));
            }
            offset_s += step_s;
        }
        best.map(|(_, shift_s)| shift_s)
    }

    /// Fits the motion capture, `shift_s` later, to the drone's path up to a shift in space, with
    /// `turns` also up to a turn about z (Horn 1987, in the plane). `None` if less than half of the
    /// path was captured, or nothing moves.
    fn fit(&self, stamps: &[f64], shift_s: f64, turns: bool) -> Option<Fit> {
        let mut pairs = Vec::from_iter(stamps.iter().filter_map(|t| {
            let path_m = place_m(&self.path, *t, path_gap_s)?;
            Some((path_m, place_m(&self.mocap, t - shift_s, |_| MAX_GAP_S)?))
        }));
        if pairs.len() * 2 < stamps.len() {
            return None;
        }
        // The best shift lays one mean onto the other. The best turn is the angle of the sums of
        // cross and dot products of what is left.
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
        let turned_rad = libm::atan2(sin, cos);
        let [turned_m2, level_m2] = [turned_rad, 0.0].map(|turn| left_m2(&pairs, turn));
        // A nearly vertical path, or one with a large error, does not show a turn.
        let turns = turns && turned_m2 < 0.25 * level_m2;
        let (turn_rad, left_m2) = if turns { (turned_rad, turned_m2) } else { (0.0, level_m2) };
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), turn_rad);
        let (misfit, left_m, offset_m) = (left_m2 / spread, left_m2.sqrt(), to_m - from_m);
        let move_m = to_m - turn * from_m;
        // A path of less than two centimeters shows nothing.
        (spread > 4e-4).then_some(Fit { misfit, offset_m, turn_rad, move_m, left_m })
    }
}

/// Place at a time. `None` in longer gaps.
fn place_m(channels: &[Channel], time_s: f64, gap_s: fn(&Channel) -> f64) -> Option<Vector3<f64>> {
    let [x, y, z] = [0, 1, 2].map(|k| channels[k].linear(time_s, gap_s(&channels[k])));
    Some(Vector3::new(x?, y?, z?))
}

/// Mean square distance between pairs after a turn about z of the second ones.
fn left_m2(pairs: &[(Vector3<f64>, Vector3<f64>)], turn_rad: f64) -> f64 {
    let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), turn_rad);
    let n = pairs.len() as f64;
    pairs.iter().map(|(to, from)| (to - turn * from).norm_squared() / n).sum()
}

/// Longest gap in the drone's path that is interpolated.
fn path_gap_s(path: &Channel) -> f64 {
    1.0_f64.max(3.0 * path.period_s)
}

fn span(channels: &[Channel]) -> (f64, f64) {
    let start_s = channels.iter().map(Channel::start_s).fold(f64::NEG_INFINITY, f64::max);
    (start_s, channels.iter().map(Channel::end_s).fold(f64::INFINITY, f64::min))
}

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
        let shift = Search { mocap, path: drone, free: false }.shift().unwrap();
        assert!((shift.drone_s(4110.0) - (4110.0 - 4097.3 + 223.0)).abs() < 0.004, "{shift:?}");
        assert!((shift.frame_offset_m[0] + 0.2).abs() < 0.01, "and the frames' offset: {shift:?}");
    }

    #[test]
    fn a_slow_clock_is_found() {
        let ratio = 84.0 / 85.0;
        let drone = path(3000, 0.02, |t| t * ratio + 50.0, 0.0);
        let mocap = path(6000, 0.01, |t| t + 9000.0, 0.0);
        let shift = Search { mocap, path: drone, free: false }.shift().unwrap();
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
        let search = Search { mocap, path: drone, free: false };
        assert!(search.shift().is_none(), "as it is, it is another path");
        let shift = Search { free: true, ..search }.shift().unwrap();
        assert!(shift.is_elsewhere() && shift.placed.left_m < 0.01, "{shift:?}");
        assert!((shift.placed.turn_rad - 0.7).abs() < 1e-3, "{shift:?}");
        assert!((shift.drone_s(4110.0) - (4110.0 - 4097.3 + 223.0)).abs() < 0.004, "{shift:?}");
        let said = shift.warnings(false)[0].to_string();
        assert!(said.contains("turned by 40.1°") && said.contains("leaves"), "{said}");
    }

    #[test]
    fn other_paths_have_no_shift() {
        let drone = path(1000, 0.02, |t| t, 0.0);
        let still = vec![Channel::new(vec![0.0, 30.0], vec![1.0; 2]); 3];
        assert!(Search { mocap: still, path: drone, free: false }.shift().is_none());
    }
}
