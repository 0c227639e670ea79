//! Bound of Cramér and Rao for the positions of drones that fly their plans on ultra-wideband
//! ranges.
//!
//! In: plans and a drone. Out: [`Bound`], the standard deviation of each drone's position over time
//! that no unbiased estimator beats. Method: the covariance of the filter with its slopes taken at
//! the truth (the posterior bound: Tichavsky, Muravchik, Nehorai, IEEE Trans. Signal Processing 46,
//! 1998), driven by the noise of the inertial sensors and corrected by each range and height when
//! it is due. Drones with the estimator `cooperative` share the air and hear each other without
//! loss. Noise is white here: biases of links, which decide in many rooms, and outliers come on
//! top.

use nalgebra::Vector3;

use super::ekf::START;
use crate::kalman::{Density, ERRORS, Measurement, Normal, Part, Span, toward, variance_rate};
use crate::options::{EstimatorKind, SimOptions};
use crate::sensors::{Clock, HeightSensor, SensorOptions, Turn, turns};
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::error::{Error, Result};
use noctograph_core::plan::Plan;

/// Steps a second, unless ranges come faster.
const RATE_HZ: f64 = 100.0;
/// Least noise of a range or a height.
const LEAST_SIGMA_M: f64 = 1e-4;
/// Margin of the box in which a further anchor is tried, around anchors and word.
const MARGIN_M: f64 = 0.2;
/// Places of a further anchor along x, y and z.
const TRIED: [u32; 3] = [5, 5, 3];

/// The bound along the flight of one drone.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize)]
pub struct Bound {
    /// Times, rising.
    pub time_s: Vec<f64>,
    /// Standard deviation of the position over all three axes, at each time.
    pub sigma_m: Vec<f64>,
    /// The letter that is being written with light, at each time.
    pub letter: Vec<Option<usize>>,
}

/// The bounds of drones that fly their plans.
///
/// # Errors
///
/// As [`SimOptions::check`], and [`Error::Input`] for a positioning without ultra-wideband ranges.
pub fn bounds(plans: &[&Plan], options: &SimOptions) -> Result<Vec<Bound>> {
    options.check()?;
    if !options.sensors.positioning.is_by_ranges() {
        let name = options.sensors.positioning.name();
        let hint = "set sensors.positioning = \"uwb-twr\" or \"uwb-tdoa\"";
        return Err(Error::input("sensors.positioning", name, "ultra-wideband ranges", hint));
    }
    if options.observer.kind == EstimatorKind::Cooperative {
        return along(plans, 0, options);
    }
    let alone = (0..).zip(plans).map(|(drone, plan)| along(&[*plan], drone, options));
    Ok(alone.collect::<Result<Vec<_>>>()?.concat())
}

/// The bounds of drones that share the air; the first has the index `first`.
fn along(plans: &[&Plan], first: u64, options: &SimOptions) -> Result<Vec<Bound>> {
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
        fleet.carry(plans, time_s, step_s);
        while let Some(k) = ranges.due(time_s) {
            fleet.correct_by_range(turns[k % turns.len()]);
        }
        for (sensor, clock) in &mut heights {
            if clock.due(time_s).is_some() {
                fleet.height(*sensor);
            }
        }
        for (drone, plan) in plans.iter().enumerate() {
            if time_s > plan.duration_s() {
                continue;
            }
            let row = plan.row_at(time_s);
            let bound = &mut bounds[drone];
            bound.time_s.push(time_s);
            let places_m2 = fleet.normal.block(ERRORS * drone, ERRORS * drone);
            bound.sigma_m.push(places_m2.trace().max(0.0).sqrt());
            bound.letter.push(plan.setpoints[row].letter.filter(|_| lit[drone][row] > 0.0));
        }
    }
    Ok(bounds)
}

/// Drones on their designs, and the covariance of all.
struct Fleet<'a> {
    sensors: &'a SensorOptions,
    anchors_m: Vec<Vector3<f64>>,
    places_m: Vec<Vector3<f64>>,
    normal: Normal,
}

impl<'a> Fleet<'a> {
    fn new(n_drones: usize, options: &'a SimOptions) -> Self {
        let start = match options.observer.kind {
            EstimatorKind::Cooperative => {
                let start = &options.observer.cooperative;
                [start.start_sigma_m, START[1], start.start_tilt_rad]
            }
            EstimatorKind::Luenberger
            | EstimatorKind::Ekf
            | EstimatorKind::EkfImproved
            | EstimatorKind::Altitude
            | EstimatorKind::Truth => START,
        };
        Self {
            sensors: &options.sensors,
            anchors_m: options.sensors.uwb.anchors(),
            places_m: Vec::new(),
            normal: Normal::of_drones(n_drones, start, &[]),
        }
    }

    /// Moves all drones along their plans.
    fn carry(&mut self, plans: &[&Plan], time_s: f64, step_s: f64) {
        let imu = &self.sensors.imu;
        let density = Density {
            acceleration: [variance_rate(imu.accelerometer_noise_m_s2_sqrt_hz); 3],
            rate: variance_rate(imu.gyro_noise_rad_s_sqrt_hz),
        };
        for (drone, plan) in plans.iter().enumerate() {
            let moving = plan.setpoint_at(time_s).map_or(Vector3::zeros(), |s| s.acceleration_m_s2);
            let lever = -(moving + Vector3::z() * GRAVITY_M_S2).cross_matrix();
            let span = Span { span_s: step_s, lever, turn_rad: Vector3::zeros() };
            self.normal.carry(drone, &span, &density);
        }
        self.places_m = plans.iter().map(|plan| plan.design_m(time_s)).collect();
    }

    /// Corrects the covariance by one range, or difference of ranges to two anchors.
    fn correct_by_range(&mut self, turn: Turn) {
        let variance = square(self.sensors.uwb.noise_m.max(LEAST_SIGMA_M));
        match turn {
            Turn::Anchor { drone, anchor, minus } => {
                let units = [Some(anchor), minus].map(|anchor| {
                    let away_m = anchor.map(|it| self.places_m[drone] - self.anchors_m[it]);
                    away_m.map_or(Vector3::zeros(), |away_m| toward(&away_m).0)
                });
                let slope = Part::Three(ERRORS * drone, units[0] - units[1]);
                self.correct(&[slope], variance);
            }
            Turn::Drones(i, j) => {
                let (unit, _) = toward(&(self.places_m[i] - self.places_m[j]));
                let slope = [Part::Three(ERRORS * i, unit), Part::Three(ERRORS * j, -unit)];
                self.correct(&slope, variance);
            }
        }
    }

    /// Measures the height of every drone.
    fn height(&mut self, sensor: HeightSensor) {
        for drone in 0..self.places_m.len() {
            let sigma_m = self.sensors.height_sigma_m(sensor, self.places_m[drone].z);
            let variance = square(sigma_m.max(LEAST_SIGMA_M));
            self.correct(&[Part::One(ERRORS * drone + 2, 1.0)], variance);
        }
    }

    /// At the truth, every measurement is what was expected.
    fn correct(&mut self, slope: &[Part], variance: f64) {
        self.normal.correct(&Measurement { slope, value: 0.0, variance }, |_| true);
    }
}

fn square(x: f64) -> f64 {
    x * x
}

/// Root mean square of bounds over the lit strokes, or over one letter.
pub fn writing_sigma_m(bounds: &[Bound], letter: Option<usize>) -> Option<f64> {
    let rows = bounds.iter().flat_map(|bound| bound.sigma_m.iter().zip(&bound.letter));
    let is_wanted =
        |written: &Option<usize>| written.is_some() && (letter.is_none() || *written == letter);
    let wanted = rows.filter(|(_, written)| is_wanted(written));
    let (sum, n) =
        wanted.fold((0.0, 0_u32), |(sum, n), (sigma_m, _)| (sum + sigma_m * sigma_m, n + 1));
    (n > 0).then(|| (sum / f64::from(n)).sqrt())
}

/// The place of one more anchor, heard by all drones, that lowers the bound of the strokes most,
/// and that bound. Tried are places in the box around anchors and word.
///
/// # Errors
///
/// As [`bounds`].
pub fn one_more_anchor(plans: &[&Plan], options: &SimOptions) -> Result<([f64; 3], f64)> {
    let setpoints = plans.iter().flat_map(|plan| &plan.setpoints).map(|s| s.position_m);
    let all: Vec<Vector3<f64>> = setpoints.chain(options.sensors.uwb.anchors()).collect();
    let [nowhere, anywhere] = [f64::NEG_INFINITY, f64::INFINITY].map(Vector3::repeat);
    let low_m = all.iter().fold(anywhere, |a, b| a.inf(b)).add_scalar(-MARGIN_M);
    let high_m = all.iter().fold(nowhere, |a, b| a.sup(b)).add_scalar(MARGIN_M);
    let mut best = ([0.0; 3], f64::INFINITY);
    for i in 0..TRIED.iter().product() {
        let k = [i % TRIED[0], i / TRIED[0] % TRIED[1], i / (TRIED[0] * TRIED[1])];
        let place_m = std::array::from_fn(|axis| {
            let share = f64::from(k[axis]) / f64::from(TRIED[axis] - 1);
            // Anchors stand on the floor at lowest.
            (low_m[axis] + share * (high_m[axis] - low_m[axis]))
                .max([f64::MIN, f64::MIN, 0.1][axis])
        });
        let mut with = options.clone();
        let uwb = &mut with.sensors.uwb;
        if uwb.anchors_m.contains(&place_m) {
            continue;
        }
        let n = uwb.anchors_m.len();
        uwb.anchors_m.push(place_m);
        uwb.heard.iter_mut().for_each(|heard| heard.push(n));
        let sigma_m = writing_sigma_m(&bounds(plans, &with)?, None).unwrap_or(f64::INFINITY);
        if sigma_m < best.1 {
            best = (place_m, sigma_m);
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
    fn a_drone_that_surely_stands_still_averages_its_ranges() {
        // Without motion noise and with a start known to 10 m and no tilt, the bound along the axis
        // of one anchor is 1/√(1/σ0² + n/σ²).
        let mut options = options(&[[3.0, 0.0, 1.0], [0.0, 3.0, 1.0], [0.0, 0.0, 4.0]]);
        options.observer.cooperative.start_sigma_m = 10.0;
        options.observer.cooperative.start_tilt_rad = 1e-5;
        let plan = hover([0.0, 0.0, 1.0], 1.0);
        let bound = bounds(&[&plan], &options).unwrap().remove(0);
        // Velocity is known to 1 cm/s: at 0.1 s it has moved by less than the ranges tell.
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
