//! Cramér–Rao bound for the estimated positions of drones that use ultra-wideband ranges.
//!
//! The input is plans and a drone. The output is [`Bound`], the least standard deviation of each
//! drone's position over time that an unbiased estimator can reach. The bound is the covariance of
//! the filter with its Jacobians evaluated at the true state (the posterior bound: Tichavsky,
//! Muravchik, Nehorai, IEEE Trans. Signal Processing 46, 1998). The noise of the inertial sensors
//! increases this covariance, and each range and height that is due decreases it. Drones with the
//! estimator `cooperative` take turns, and receive each other's messages without loss. Only white
//! noise is included. Outliers and link biases, which dominate in many rooms, add to it.

use nalgebra::Vector3;

use super::cooperative::start_sigmas;
use super::ekf::START;
use crate::kalman::{Density, ERRORS, Measurement, Normal, Part, Span, toward, variance_rate};
use crate::options::{EstimatorKind, SimOptions};
use crate::sensors::{Clock, HeightSensor, SensorOptions, Turn, turns};
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::error::{Error, Result};
use noctograph_core::plan::Plan;

/// Number of steps per second, unless ranges come faster.
const RATE_HZ: f64 = 100.0;
/// Minimum noise of a range or a height in m. Without noise, the covariance would be singular.
const LEAST_SIGMA_M: f64 = 1e-4;
/// Margin in m of the box around anchors and word in which an additional anchor is tried.
const MARGIN_M: f64 = 0.2;
/// Minimum height of the additional anchor above the floor in m.
const LEAST_ANCHOR_HEIGHT_M: f64 = 0.1;
/// Numbers of candidate positions for an additional anchor along x, y and z.
const CANDIDATES: [u32; 3] = [5, 5, 3];

/// Bound along the flight of one drone.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Bound {
    /// Times in s in ascending order.
    pub time_s: Vec<f64>,
    /// Standard deviation in m of the position over all three axes at each time.
    pub sigma_m: Vec<f64>,
    /// Letter that is being written with light at each time.
    pub letter: Vec<Option<usize>>,
}

/// Returns the bound of each drone that flies its plan.
///
/// # Errors
///
/// Returns the errors of [`SimOptions::check`], and [`Error::Input`] for a positioning system
/// without ultra-wideband ranges.
pub fn bounds(plans: &[&Plan], options: &SimOptions) -> Result<Vec<Bound>> {
    options.check()?;
    if !options.sensors.positioning.is_by_ranges() {
        let name = options.sensors.positioning.name();
        let hint = "set sensors.positioning = \"uwb-twr\" or \"uwb-tdoa\"";
        return Err(Error::input("sensors.positioning", name, "ultra-wideband ranges", hint));
    }
    if options.observer.kind == EstimatorKind::Cooperative {
        return joint_bounds(plans, 0, options);
    }
    let separate = (0..).zip(plans).map(|(drone, plan)| joint_bounds(&[*plan], drone, options));
    Ok(separate.collect::<Result<Vec<_>>>()?.concat())
}

/// Returns the bounds of drones that cooperate. The index of the first drone is `first`. `plans`
/// that are shorter than the longest one end earlier.
fn joint_bounds(plans: &[&Plan], first: u64, options: &SimOptions) -> Result<Vec<Bound>> {
    let (sensors, uwb) = (&options.sensors, &options.sensors.uwb);
    let indices: Vec<u64> = (first..).take(plans.len()).collect();
    let turns = turns(sensors, &indices)?;
    let mut fleet = Fleet::new(plans.len(), options);
    let mut bounds = vec![Bound::default(); plans.len()];
    let lit: Vec<Vec<f64>> = plans.iter().map(|plan| plan.lit()).collect();
    let carried = HeightSensor::ALL.iter().filter(|sensor| sensors.heights.contains(sensor));
    let clocks = carried.map(|sensor| (*sensor, Clock::new(sensors.height_rate_hz(*sensor))));
    let mut heights: Vec<_> = clocks.collect();
    let end_s = plans.iter().map(|plan| plan.duration_s()).fold(0.0, f64::max);
    let step_s = 1.0 / RATE_HZ.max(uwb.rate_hz);
    let mut ranges = Clock::new(uwb.rate_hz);
    #[expect(clippy::cast_possible_truncation, reason = "an hour")]
    let steps = (end_s / step_s) as u32;
    for step in 0..=steps {
        let time_s = f64::from(step) * step_s;
        // The inertial noise increases the covariance, and each due measurement decreases it.
        fleet.carry(plans, time_s, step_s);
        while let Some(k) = ranges.due(time_s) {
            fleet.correct_by_range(turns[k % turns.len()]);
        }
        for (sensor, clock) in &mut heights {
            if clock.due(time_s).is_some() {
                fleet.correct_by_heights(*sensor);
            }
        }
        // A drone that has landed continues to measure ranges, but its bound ends.
        let flying = plans.iter().enumerate().filter(|(_, plan)| time_s <= plan.duration_s());
        for (drone, plan) in flying {
            let row = plan.row_at(time_s);
            let letter = plan.setpoints[row].letter.filter(|_| lit[drone][row] > 0.0);
            bounds[drone].push(time_s, fleet.sigma_m(drone), letter);
        }
    }
    Ok(bounds)
}

impl Bound {
    /// Adds a time with the bound's standard deviation and the letter that is lit at it.
    fn push(&mut self, time_s: f64, sigma_m: f64, letter: Option<usize>) {
        self.time_s.push(time_s);
        self.sigma_m.push(sigma_m);
        self.letter.push(letter);
    }
}

/// Drones on their planned paths, with their joint covariance.
struct Fleet<'a> {
    sensors: &'a SensorOptions,
    anchors_m: Vec<Vector3<f64>>,
    positions_m: Vec<Vector3<f64>>,
    normal: Normal,
}

impl<'a> Fleet<'a> {
    /// Creates drones that begin with the uncertainty of the selected estimator. Their positions
    /// are set by the first [`Self::carry`].
    fn new(n_drones: usize, options: &'a SimOptions) -> Self {
        let start = match options.observer.kind {
            EstimatorKind::Cooperative => start_sigmas(&options.observer.cooperative),
            EstimatorKind::Luenberger
            | EstimatorKind::Ekf
            | EstimatorKind::EkfImproved
            | EstimatorKind::Altitude
            | EstimatorKind::Truth => START,
        };
        Self {
            sensors: &options.sensors,
            anchors_m: options.sensors.uwb.anchors(),
            positions_m: Vec::new(),
            normal: Normal::of_drones(n_drones, start, &[]),
        }
    }

    /// Returns the standard deviation of a drone's position over all three axes in m.
    fn sigma_m(&self, drone: usize) -> f64 {
        let covariance_m2 = self.normal.block(ERRORS * drone, ERRORS * drone);
        covariance_m2.trace().max(0.0).sqrt()
    }

    /// Moves all drones along their plans to `time_s`, and propagates their covariance over
    /// `step_s` with the noise of the inertial sensors.
    fn carry(&mut self, plans: &[&Plan], time_s: f64, step_s: f64) {
        let imu = &self.sensors.imu;
        let density = Density {
            acceleration: [variance_rate(imu.accelerometer_noise_m_s2_sqrt_hz); 3],
            rate: variance_rate(imu.gyro_noise_rad_s_sqrt_hz),
        };
        for (drone, plan) in plans.iter().enumerate() {
            // The lever is R [f]× of the specific force of a level drone during the planned motion.
            let planned =
                plan.setpoint_at(time_s).map_or(Vector3::zeros(), |s| s.acceleration_m_s2);
            let lever = -(planned + Vector3::z() * GRAVITY_M_S2).cross_matrix();
            let span = Span { span_s: step_s, lever, turn_rad: Vector3::zeros() };
            self.normal.carry(drone, &span, &density);
        }
        self.positions_m = plans.iter().map(|plan| plan.design_m(time_s)).collect();
    }

    /// Corrects the covariance for one range or range difference.
    fn correct_by_range(&mut self, turn: Turn) {
        let variance = square(self.sensors.uwb.noise_m.max(LEAST_SIGMA_M));
        match turn {
            Turn::Anchor { drone, anchor, minus } => {
                let position_m = self.positions_m[drone];
                let unit = |anchor: usize| toward(&(position_m - self.anchors_m[anchor])).0;
                let direction = unit(anchor) - minus.map_or(Vector3::zeros(), unit);
                self.correct(&[Part::Three(ERRORS * drone, direction)], variance);
            }
            Turn::Drones(i, j) => {
                let (unit, _) = toward(&(self.positions_m[i] - self.positions_m[j]));
                let jacobian = [Part::Three(ERRORS * i, unit), Part::Three(ERRORS * j, -unit)];
                self.correct(&jacobian, variance);
            }
        }
    }

    /// Corrects the covariance for the height of every drone. The variance is that of the sensor at
    /// the planned height.
    fn correct_by_heights(&mut self, sensor: HeightSensor) {
        for drone in 0..self.positions_m.len() {
            let sigma_m = self.sensors.height_sigma_m(sensor, self.positions_m[drone].z);
            let variance = square(sigma_m.max(LEAST_SIGMA_M));
            self.correct(&[Part::One(ERRORS * drone + 2, 1.0)], variance);
        }
    }

    /// Corrects the covariance for a measurement. At the true state, every innovation is zero.
    fn correct(&mut self, jacobian: &[Part], variance: f64) {
        self.normal.correct(&Measurement { jacobian, value: 0.0, variance }, |_| true);
    }
}

fn square(x: f64) -> f64 {
    x * x
}

/// Returns the RMS in m of the bounds' standard deviations over the lit strokes of all letters, or
/// of one letter by its index. Returns `None` if none are lit.
pub fn writing_sigma_m(bounds: &[Bound], letter: Option<usize>) -> Option<f64> {
    let (mut sum, mut n) = (0.0, 0_u32);
    for (sigma_m, written) in bounds.iter().flat_map(|b| b.sigma_m.iter().zip(&b.letter)) {
        if written.is_some() && (letter.is_none() || *written == letter) {
            (sum, n) = (sum + sigma_m * sigma_m, n + 1);
        }
    }
    (n > 0).then(|| (sum / f64::from(n)).sqrt())
}

/// Returns the position in m of an additional anchor with which all drones have the lowest bound
/// over the strokes, and that bound in m. The candidates form a grid in the box around anchors and
/// word, without the positions of anchors, and lie at least 0.1 m above the floor. If no stroke is
/// lit, the position is the origin and the bound is infinite.
///
/// # Errors
///
/// Returns the errors of [`bounds`].
pub fn one_more_anchor(plans: &[&Plan], options: &SimOptions) -> Result<([f64; 3], f64)> {
    // The box around setpoints and anchors has the smallest and largest coordinates.
    let setpoints = plans.iter().flat_map(|plan| &plan.setpoints).map(|s| s.position_m);
    let points_m: Vec<Vector3<f64>> = setpoints.chain(options.sensors.uwb.anchors()).collect();
    let infinity = Vector3::repeat(f64::INFINITY);
    let low_m = points_m.iter().fold(infinity, |a, b| a.inf(b)).add_scalar(-MARGIN_M);
    let high_m = points_m.iter().fold(-infinity, |a, b| a.sup(b)).add_scalar(MARGIN_M);
    let mut best = ([0.0; 3], f64::INFINITY);
    let [n_x, n_y, n_z] = CANDIDATES;
    for i in 0..n_x * n_y * n_z {
        let k = [i % n_x, i / n_x % n_y, i / (n_x * n_y)];
        let mut position_m = std::array::from_fn(|axis| {
            let fraction = f64::from(k[axis]) / f64::from(CANDIDATES[axis] - 1);
            low_m[axis] + fraction * (high_m[axis] - low_m[axis])
        });
        position_m[2] = position_m[2].max(LEAST_ANCHOR_HEIGHT_M);
        let mut extended = options.clone();
        let uwb = &mut extended.sensors.uwb;
        if uwb.anchors_m.contains(&position_m) {
            continue;
        }
        let n = uwb.anchors_m.len();
        uwb.anchors_m.push(position_m);
        uwb.heard.iter_mut().for_each(|heard| heard.push(n));
        let sigma_m = writing_sigma_m(&bounds(plans, &extended)?, None).unwrap_or(f64::INFINITY);
        if sigma_m < best.1 {
            best = (position_m, sigma_m);
        }
    }
    Ok(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::Positioning;
    use crate::tests::hover;

    fn options(anchors_m: &[[f64; 3]]) -> SimOptions {
        let mut options = SimOptions { sensors: SensorOptions::ideal(), ..SimOptions::default() };
        options.sensors.positioning = Positioning::UwbTwr;
        options.sensors.uwb.anchors_m = anchors_m.to_vec();
        options.sensors.uwb.noise_m = 0.06;
        options.observer.kind = EstimatorKind::Cooperative;
        options
    }

    #[test]
    fn a_drone_that_is_known_to_rest_averages_its_ranges() {
        // Without motion noise or tilt, and with a start known to 10 m, the bound along the axis of
        // one anchor is 1/√(1/σ0² + n/σ²).
        let mut options = options(&[[3.0, 0.0, 1.0], [0.0, 3.0, 1.0], [0.0, 0.0, 4.0]]);
        options.observer.cooperative.start_sigma_m = 10.0;
        options.observer.cooperative.start_tilt_rad = 1e-5;
        let plan = hover([0.0, 0.0, 1.0], 1.0);
        let bound = bounds(&[&plan], &options).unwrap().remove(0);
        // The velocity is known to 1 cm/s, and 1 mm in 0.1 s is less than the ranges resolve.
        let row = bound.time_s.iter().position(|t| *t >= 0.1).unwrap();
        let n = ((bound.time_s[row] * 180.0).floor() + 1.0) / 3.0;
        let want_m = (3.0 * 0.06 * 0.06 / n).sqrt();
        let found_m = bound.sigma_m[row];
        assert!((found_m / want_m - 1.0).abs() < 0.05, "{found_m} m of {want_m} m");
    }

    #[test]
    fn two_anchors_leave_a_direction_open_and_the_best_third_closes_it() {
        let mut options = options(&[[3.0, 0.0, 1.0], [-3.0, 0.5, 1.0]]);
        options.sensors.imu.accelerometer_noise_m_s2_sqrt_hz = 0.02;
        let plan = hover([0.0, 0.0, 1.0], 20.0);
        let two_m = writing_sigma_m(&bounds(&[&plan], &options).unwrap(), Some(0)).unwrap();
        let (place_m, three_m) = one_more_anchor(&[&plan], &options).unwrap();
        assert!(three_m < 0.8 * two_m, "{three_m} m after {two_m} m, at {place_m:?}");
        options.sensors.positioning = Positioning::Gnss;
        options.observer.kind = EstimatorKind::Ekf;
        assert!(bounds(&[&plan], &options).unwrap_err().to_string().contains("gnss"));
    }
}
