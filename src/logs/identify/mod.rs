//! Identifies a drone's parameters and its observer's weights from the log of a flight.
//!
//! The inputs are a [`Flight`] and the vehicle's mass, arm length and motor lag, which a log does
//! not determine. The output is [`Identified`]. The method is the reference team's (AE483, 2022).
//!
//! - Weights of the observer: Q and R are `1/σ²` of the measurement error `y − (C x̂ + D u)` and of
//!   the model error `ẋ − (A x + B u)` in the air, with ẋ computed by finite differences.
//! - Thrust per command is fitted to the accelerometer, with the assumed motor lag.
//! - The mean motor commands, which balance the weight's torque, give the center of mass.
//! - Moments of inertia are measured by a pendulum test ([`pendulum_inertia_kg_m2`], their equation
//!   12).
//!
//! Not done: moments of inertia and rotor reaction torque, which slow logs do not determine.

mod air;
mod lag;
mod rotors;

use std::ops::Range;

use nalgebra::{SVector, Vector3, Vector4};

pub use self::air::UnevenAir;
pub use self::lag::{RotorLag, T_95};
use self::rotors::thrust_per_command_n;
use noctograph_core::crazyflie::{GRAVITY_M_S2, MOTOR_SIGNS};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Error, Result, within};
use noctograph_core::flight::{Flight, FlightSample, Quantity, airborne};
use noctograph_sim::vehicle::VehicleOptions;

/// Names of the nine states in the model error.
pub const MODEL_STATES: [&str; 9] =
    ["o_x", "o_y", "o_z", "psi", "theta", "phi", "v_x", "v_y", "v_z"];

/// Names of logged raw Lighthouse positions, in order of preference.
const LIGHTHOUSE: [[&str; 3]; 2] = [
    ["ae483log.lh_x", "ae483log.lh_y", "ae483log.lh_z"],
    ["lighthouse.x", "lighthouse.y", "lighthouse.z"],
];
/// Names of logged vertical accelerations in order of preference, with their unit in m/s². All of
/// them include gravity. That of the AE483 firmware is in m/s², and the accelerometer is in g
/// (`stabilizer_types.h`), whether it is logged raw or by a controller.
const ACCELERATIONS: [(&str, f64); 4] = [
    ("ae483log.a_z", 1.0),
    ("acc.z", GRAVITY_M_S2),
    ("controller.accelz", GRAVITY_M_S2),
    ("ctrlMel.accelz", GRAVITY_M_S2),
];

/// Minimum number of samples for a standard deviation, which is ten seconds at 10 Hz.
const FEWEST_SAMPLES: usize = 100;

/// Properties of a drone, as estimated from a flight.
#[derive(Clone, Debug, PartialEq)]
pub struct Identified {
    /// Number of samples in the air.
    pub n_samples: usize,
    /// Mean motor commands m1…m4.
    pub mean_motors: [f64; 4],
    /// Thrust of a motor per unit of command, N, from the accelerometer or, without it, from
    /// hovering.
    pub k_f_n: f64,
    /// Mean torque of the motors about body x and y, N m. The opposite torque acts on the body.
    pub motor_torque_n_m: [f64; 2],
    /// Center of mass, along body x and y, that explains this torque.
    pub center_of_mass_m: [f64; 2],
    /// Half width of the 95 % confidence interval of the center of mass, from the torque of uneven
    /// air. `None` if the flight is too short.
    pub center_of_mass_half_width_m: Option<[f64; 2]>,
    /// Lag of the rotors. `None` if no body rates are logged.
    pub lag: Option<RotorLag>,
    /// Torque of uneven air. `None` if the flight is too short.
    pub air: Option<UnevenAir>,
    /// Standard deviation of the measured position from the estimate, along x, y and z. `None` if
    /// no raw position is logged.
    pub measurement_sigma_m: Option<[f64; 3]>,
    /// Standard deviation of the model error for [`MODEL_STATES`], in units of the state per
    /// second. `None` if attitude, velocity or body rates are not logged.
    pub model_sigma: Option<[f64; 9]>,
    /// Warnings about logged data that is not used.
    pub left_out: Vec<Diagnostic>,
}

impl Identified {
    /// Returns the observer's Q: `1/σ²` for the three measurements, 1/m².
    pub fn observer_q(&self) -> Option<[f64; 3]> {
        self.measurement_sigma_m.map(|sigma| sigma.map(weight))
    }

    /// Returns the observer's R: `1/σ²` for the eight model errors except ψ (unobservable).
    pub fn observer_r(&self) -> Option<[f64; 8]> {
        let [x, y, z, _psi, theta, phi, vx, vy, vz] = self.model_sigma?;
        Some([x, y, z, theta, phi, vx, vy, vz].map(weight))
    }
}

/// Returns the weight `1/σ²` for an error with standard deviation σ.
pub fn weight(sigma: f64) -> f64 {
    1.0 / (sigma * sigma)
}

/// Returns the moment of inertia from a pendulum test, `J = m (g r (T/2π)² − r²)`, for a body that
/// swings with period T about a pivot at distance r from its center of mass. The axis of J is that
/// of the swing, through the center of mass.
///
/// # Errors
///
/// Returns [`Error::Input`] if a value is out of range, or if the period is too short for any body.
pub fn pendulum_inertia_kg_m2(mass_kg: f64, pivot_m: f64, period_s: f64) -> Result<f64> {
    /// Least mass, distance and period. Smaller values are probably in another unit.
    const LEAST: f64 = 1e-3;
    within("vehicle.mass_kg", mass_kg, LEAST, 100.0)?;
    within("pendulum_pivot_m", pivot_m, LEAST, 10.0)?;
    within("pendulum_period_s", period_s, LEAST, 100.0)?;
    // The equation T = 2π √((J + m r²) / (m g r)) is solved for J.
    let per_turn_s = period_s / std::f64::consts::TAU;
    let inertia = mass_kg * (GRAVITY_M_S2 * pivot_m * per_turn_s * per_turn_s - pivot_m * pivot_m);
    if inertia > 0.0 {
        return Ok(inertia);
    }
    let shortest_s = std::f64::consts::TAU * (pivot_m / GRAVITY_M_S2).sqrt();
    let wanted = format!("more than {shortest_s:.4} s, the period of a point {pivot_m} m away");
    let hint = "time ten swings and divide by ten, and measure the pivot from the center of mass";
    Err(Error::input("pendulum_period_s", period_s, wanted, hint))
}

/// Identifies the parameters of a drone from a flight.
///
/// # Errors
///
/// Returns [`Error::Input`] if the flight lacks motor commands or is hardly in the air.
pub fn identify(flight: &Flight, assumed: &VehicleOptions) -> Result<Identified> {
    let airborne = checked_airborne(flight)?;
    let samples = &flight.samples[airborne.clone()];
    // Thrust and torque follow from the mean commands and, if plausible, the accelerometer.
    let mut left_out = Vec::new();
    let mean_motors = mean(samples.iter().map(|sample| Vector4::from(sample.motors)));
    let mut accelerations = accelerations(flight, &airborne, &mut left_out);
    let mut k_f_n = thrust_per_command_n(flight, samples, accelerations.as_deref(), assumed);
    if k_f_n.is_nan() || k_f_n <= 0.0 {
        let text = "the acceleration points down on average, so the drone is assumed to hover";
        left_out.push(Diagnostic::warning("acceleration-down", text));
        accelerations = None;
        k_f_n = thrust_per_command_n(flight, samples, None, assumed);
    }
    let torque = MOTOR_SIGNS * mean_motors * (k_f_n * assumed.arm_m);
    let thrust_n = k_f_n * mean_motors.sum();
    // The model error requires quantities that are logged and that change.
    let [turns, leans, moves] = [Quantity::Rate, Quantity::Attitude, Quantity::Velocity]
        .map(|quantity| changes(flight, samples, quantity, &mut left_out));
    let measurement_sigma_m = measurement_sigma_m(flight, &airborne, &mut left_out);
    let model_sigma = (turns && leans && moves)
        .then(|| model_sigma(flight, samples, accelerations.as_deref()))
        .filter(|sigma| are_figures(sigma));
    let air = air::uneven_air(flight, samples, k_f_n * assumed.arm_m)
        .filter(|air| are_finite(air.torque_sigma_n_m));
    Ok(Identified {
        n_samples: samples.len(),
        mean_motors: mean_motors.into(),
        k_f_n,
        motor_torque_n_m: [torque.x, torque.y],
        // The motors balance the torque of the weight about their center, m g (y, −x).
        center_of_mass_m: [-torque.y / thrust_n, torque.x / thrust_n],
        center_of_mass_half_width_m: air
            .map(|air| [1, 0].map(|axis: usize| T_95 * air.mean_sigma_n_m[axis] / thrust_n)),
        lag: lag::lag(flight, samples)
            .filter(|lag| turns && are_finite([lag.lag_s, lag.half_width_s, lag.explained])),
        air,
        measurement_sigma_m,
        model_sigma,
        left_out,
    })
}

/// Returns the indices of the samples in the air. Returns [`Error::Input`] if the flight lacks
/// motor commands, has fewer than [`FEWEST_SAMPLES`] in the air, or is frozen.
fn checked_airborne(flight: &Flight) -> Result<Range<usize>> {
    let hint = "import a log with motor.m1 to motor.m4, of a flight of ten seconds or more";
    if !flight.has(Quantity::Motors) {
        return Err(Error::input("flight", "no motor commands", "columns m1 to m4", hint));
    }
    let airborne = airborne(flight).unwrap_or_default();
    let n_samples = airborne.len();
    if n_samples < FEWEST_SAMPLES {
        let count = format_args!("{n_samples} samples in the air");
        return Err(Error::input("flight", count, format!("at least {FEWEST_SAMPLES}"), hint));
    }
    if is_frozen(&flight.samples[airborne.clone()]) {
        let commands = "motor commands that never rotate the drone, like those of one repeated row";
        return Err(Error::input("flight", commands, "those of a flight", hint));
    }
    Ok(airborne)
}

/// True if the body rate, pitch and roll, or velocity is logged and changes. One that is logged but
/// never changes is added to `left_out`.
fn changes(
    flight: &Flight,
    samples: &[FlightSample],
    quantity: Quantity,
    left_out: &mut Vec<Diagnostic>,
) -> bool {
    let vector = |s: &FlightSample| match quantity {
        Quantity::Rate => s.rate_body_rad_s,
        Quantity::Attitude => Vector3::new(s.attitude.pitch_rad, s.attitude.roll_rad, 0.0),
        _ => s.velocity_body_m_s,
    };
    let is_logged = flight.has(quantity);
    let changes = samples.iter().any(|s| vector(s) != vector(&samples[0]));
    if is_logged && !changes {
        left_out.push(frozen(quantity.name()));
    }
    is_logged && changes
}

/// True if the motors never change their roll and pitch torque, as when a logger repeats one row.
/// In a real flight at least one of them varies.
pub fn is_frozen(samples: &[FlightSample]) -> bool {
    /// Tolerance, which is finer than the numeric resolution of the files.
    const SAME: f64 = 1e-3;
    let mut turns =
        samples.iter().map(|sample| (MOTOR_SIGNS * Vector4::from(sample.motors)).xy()).peekable();
    let first = turns.peek().copied().unwrap_or_default();
    turns.all(|turn| (turn - first).amax() < SAME)
}

/// Returns a warning about a source that never changes.
fn frozen(names: &str) -> Diagnostic {
    Diagnostic::warning("source-frozen", format!("{names}: frozen, as if not logged"))
}

/// Returns the airborne values of an extra column.
fn column<'a>(flight: &'a Flight, air: &Range<usize>, name: &str) -> Option<&'a [f64]> {
    flight.extra.get(name).map(|column| &column[air.clone()])
}

/// True if no figure is NaN or infinite.
fn are_finite<const N: usize>(figures: [f64; N]) -> bool {
    figures.iter().all(|figure| figure.is_finite())
}

/// Returns true for finite, positive standard deviations. A constant would have infinite weight.
fn are_figures(sigma: &[f64]) -> bool {
    sigma.iter().all(|sigma| sigma.is_finite() && *sigma > 0.0)
}

/// Returns the vertical acceleration in m/s² from the first source that changes, for the samples
/// `air` in the air. Sources that do not change are added to `left_out`.
fn accelerations(
    flight: &Flight,
    air: &Range<usize>,
    left_out: &mut Vec<Diagnostic>,
) -> Option<Vec<f64>> {
    for (name, unit) in ACCELERATIONS {
        let Some(values) = column(flight, air, name) else { continue };
        if values.iter().any(|value| *value != values[0]) {
            return Some(values.iter().map(|value| value * unit).collect());
        }
        let text = format!("{name}: frozen at {}, as if not logged", values[0]);
        left_out.push(Diagnostic::warning("source-frozen", text));
    }
    None
}

/// Returns the standard deviation of the measured from the estimated position along x, y and z in
/// m, for the first raw position that changes. Sources that do not change are added to `left_out`.
fn measurement_sigma_m(
    flight: &Flight,
    air: &Range<usize>,
    left_out: &mut Vec<Diagnostic>,
) -> Option<[f64; 3]> {
    for names in LIGHTHOUSE {
        let columns = names.map(|name| column(flight, air, name));
        let [Some(x), Some(y), Some(z)] = columns else { continue };
        if [x, y, z].iter().all(|values| values.iter().all(|value| *value == values[0])) {
            left_out.push(frozen(&names.join(", ")));
            continue;
        }
        let places = flight.samples[air.clone()].iter().zip(x).zip(y).zip(z);
        let errors = places.map(|(((s, x), y), z)| Vector3::new(*x, *y, *z) - s.position_m);
        let sigma: [f64; 3] = standard_deviation(&errors.collect::<Vec<_>>()).into();
        // If the estimate is the raw position itself, the deviations are zero.
        return Some(sigma).filter(|sigma| are_figures(sigma));
    }
    None
}

/// Returns the standard deviation of `ẋ − (A x + B u)` with the model linearized at hover, over
/// pairs of consecutive samples without a gap between them. The result is per s for each of the
/// nine states, which are those of [`state`].
fn model_sigma(
    flight: &Flight,
    samples: &[FlightSample],
    accelerations: Option<&[f64]>,
) -> [f64; 9] {
    let pairs = samples.windows(2).enumerate().filter_map(|(index, pair)| {
        // The derivative ẋ is a forward difference.
        let dt_s = pair[1].time_s - pair[0].time_s;
        let acceleration = accelerations.map_or(GRAVITY_M_S2, |column| column[index]);
        let error = (state(&pair[1]) - state(&pair[0])) / dt_s - model(&pair[0], acceleration);
        (dt_s > 0.0 && !ends_at_gap(flight, pair[0].time_s)).then_some(error)
    });
    standard_deviation(&pairs.collect::<Vec<_>>()).into()
}

/// Splits samples into runs without gaps of the log.
fn runs<'a>(
    flight: &Flight,
    samples: &'a [FlightSample],
) -> impl Iterator<Item = &'a [FlightSample]> {
    samples.chunk_by(|a, b| a.time_s < b.time_s && !ends_at_gap(flight, a.time_s))
}

/// Returns the sum of the motors' values in their unit, each with its sign about an axis of the
/// body (0 to 2 for x to z).
fn signed_sum(axis: usize, motors: &[f64; 4]) -> f64 {
    (0..4).map(|motor| MOTOR_SIGNS[(axis, motor)] * motors[motor]).sum()
}

/// True if the sample at the given time is followed by a gap.
fn ends_at_gap(flight: &Flight, time_s: f64) -> bool {
    flight.gaps.iter().any(|gap| gap[0] <= time_s && time_s < gap[1])
}

/// Returns the nine states of a sample in the order of [`MODEL_STATES`].
fn state(sample: &FlightSample) -> SVector<f64, 9> {
    let (o, a, v) = (sample.position_m, sample.attitude, sample.velocity_body_m_s);
    SVector::from([o.x, o.y, o.z, a.yaw_rad, a.pitch_rad, a.roll_rad, v.x, v.y, v.z])
}

/// Returns `A x + B u` of the observer's model at hover, the time derivatives of position, yaw,
/// pitch, roll and velocity.
fn model(sample: &FlightSample, acceleration_z_m_s2: f64) -> SVector<f64, 9> {
    let (a, v, w) = (sample.attitude, sample.velocity_body_m_s, sample.rate_body_rad_s);
    let g = GRAVITY_M_S2;
    let lift = acceleration_z_m_s2 - g;
    SVector::from([v.x, v.y, v.z, w.z, w.y, w.x, g * a.pitch_rad, -g * a.roll_rad, lift])
}

/// Returns the mean of vectors, or NaN without any.
fn mean<const N: usize>(values: impl Iterator<Item = SVector<f64, N>>) -> SVector<f64, N> {
    let (mut sum, mut n) = (SVector::zeros(), 0.0);
    for value in values {
        sum += value;
        n += 1.0;
    }
    sum / n
}

/// Returns the standard deviation of each component of vectors, or NaN without any.
fn standard_deviation<const N: usize>(values: &[SVector<f64, N>]) -> SVector<f64, N> {
    let center = mean(values.iter().copied());
    let squares = values.iter().map(|value| (value - center).map(|x| x * x));
    mean(squares).map(f64::sqrt)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::flight::FlightData;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{PlanOptions, plan};
    use noctograph_sim::vehicle::{GustOptions, Gusts};
    use noctograph_sim::{ControllerKind, Drone, SimOptions, fly};

    #[test]
    fn spreads_of_the_team_give_the_weights_of_the_team() {
        let identified = Identified {
            n_samples: 1,
            mean_motors: [0.0; 4],
            k_f_n: 0.0,
            motor_torque_n_m: [0.0; 2],
            center_of_mass_m: [0.0; 2],
            center_of_mass_half_width_m: None,
            lag: None,
            air: None,
            measurement_sigma_m: Some([0.003, 0.004, 0.002]),
            model_sigma: Some([0.026, 0.026, 0.033, 0.018, 0.103, 0.203, 0.149, 0.115, 0.187]),
            left_out: Vec::new(),
        };
        // The paper prints Q as whole numbers and R to one digit.
        let (q, r) = (identified.observer_q().unwrap(), identified.observer_r().unwrap());
        assert_eq!(q.map(f64::round), [111_111.0, 62_500.0, 250_000.0]);
        let printed = [1479.3, 1479.3, 918.3, 94.3, 24.3, 45.0, 75.6, 28.6];
        for (ours, printed) in r.iter().zip(printed) {
            assert!((ours - printed).abs() < 0.06, "{ours} for {printed}");
        }
    }

    #[test]
    fn a_pendulum_test_gives_the_inertia() {
        // A rod of 1 kg and 1 m swings about its end: J = m l²/12 about its center, T = 2π √(2 l /
        // 3 g).
        let period_s = std::f64::consts::TAU * (2.0 / (3.0 * GRAVITY_M_S2)).sqrt();
        let inertia = pendulum_inertia_kg_m2(1.0, 0.5, period_s).unwrap();
        assert!((inertia - 1.0 / 12.0).abs() < 1e-12, "{inertia}");
        let error = pendulum_inertia_kg_m2(1.0, 0.5, 1.0).unwrap_err().to_string();
        assert!(error.contains("more than 1.41"), "{error}");
    }

    #[test]
    fn a_simulated_drone_is_identified() {
        let strokes = write("NO", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::default()).unwrap();
        let options = SimOptions::default();
        let flight = fly(&plan, &Drone::new(&options, 0), &mut |_| {}).unwrap();
        let identified = identify(&flight, &options.vehicle).unwrap();
        let error = |value: f64, true_: f64| (value / true_ - 1.0).abs();
        assert!(error(identified.k_f_n, options.vehicle.k_f_n) < 0.01, "k_F {}", identified.k_f_n);
        for axis in 0..2 {
            let (identified, true_) =
                (identified.center_of_mass_m, options.vehicle.center_of_mass_m);
            assert!(error(identified[axis], true_[axis]) < 0.05, "axis {axis}: {identified:?}");
        }
        assert_eq!(identified.measurement_sigma_m, None, "a simulated flight logs no raw position");
        assert!(identified.model_sigma.unwrap()[0] < 0.05, "{:?}", identified.model_sigma);
    }

    /// Returns flights of a word with the given rotor lag, under a controller in ordinary room air.
    fn flights_with_lag(
        kind: ControllerKind,
        lag_s: f64,
    ) -> impl Iterator<Item = (SimOptions, Flight)> {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::default()).unwrap();
        let mut options = SimOptions::default();
        options.controller.kind = kind;
        options.air.gusts = Gusts::OrnsteinUhlenbeck(GustOptions::default());
        (options.vehicle.motor_rise_s, options.vehicle.motor_fall_s) = (lag_s, lag_s);
        (0..2).map(move |seed| {
            let flight = fly(&plan, &Drone::new(&options, seed), &mut |_| {}).unwrap();
            (options.clone(), flight)
        })
    }

    #[test]
    fn the_interval_of_the_lag_holds_the_truth_and_thrust_is_unbiased() {
        // The plain fit overestimates the lag by 10 to 40 ms, with intervals of 5 to 15 ms.
        let (mut n, mut held) = (0, 0);
        for kind in [ControllerKind::Pid, ControllerKind::Lqr] {
            for lag_s in [0.06, 0.12, 0.18] {
                for (options, flight) in flights_with_lag(kind, lag_s) {
                    let identified = identify(&flight, &options.vehicle).unwrap();
                    let lag = identified.lag.unwrap();
                    (n, held) =
                        (n + 1, held + u32::from((lag.lag_s - lag_s).abs() <= lag.half_width_s));
                    assert!((lag.lag_s - lag_s).abs() < 0.05, "{kind:?} {lag_s} s: {lag:?}");
                    let error = identified.k_f_n / options.vehicle.k_f_n - 1.0;
                    assert!(error.abs() < 0.003, "{kind:?} {lag_s} s: k_F is off by {error}");
                }
            }
        }
        assert!(held + 1 >= n, "{held} of {n}");
    }

    #[test]
    fn the_interval_of_the_center_of_mass_holds_the_truth() {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::default()).unwrap();
        let mut options = SimOptions::default();
        options.air.gusts = Gusts::OrnsteinUhlenbeck(GustOptions::default());
        let (mut n, mut held, mut widths_m) = (0, 0, [0.0; 2]);
        for seed in 0..24_u32 {
            let truth_m = [1e-4 * f64::from(seed % 7), -1e-4 * f64::from(seed % 5)];
            options.vehicle.center_of_mass_m = [truth_m[0], truth_m[1]];
            options.vehicle.airspeed_moment_n_s = 1e-4 * f64::from(seed % 4);
            let flight = fly(&plan, &Drone::new(&options, seed.into()), &mut |_| {}).unwrap();
            let identified = identify(&flight, &options.vehicle).unwrap();
            let half_width_m = identified.center_of_mass_half_width_m.unwrap();
            for axis in 0..2 {
                let error_m = identified.center_of_mass_m[axis] - truth_m[axis];
                (n, held) = (n + 1, held + u32::from(error_m.abs() <= half_width_m[axis]));
                widths_m[axis] += half_width_m[axis] / 24.0;
            }
        }
        // With a correct 95 % interval, 42 or fewer of 48 occur with a probability of only 1 in 70.
        assert!(held >= 43, "{held} of {n}");
        assert!(widths_m.iter().all(|width_m| *width_m < 0.2e-3), "{widths_m:?}");
    }

    /// Returns a 20 s hover during which the motors respond to a slow sway.
    fn sway(acceleration: (&str, f64)) -> Flight {
        let wave = |i: u32, rate: f64| libm::sin(rate * f64::from(i));
        let sample = |i: u32| FlightSample {
            time_s: f64::from(i) * 0.01,
            position_m: Vector3::new(wave(i, 0.01), 0.0, 1.0),
            motors: [0.0, 1.0, 2.0, 3.0]
                .map(|motor| 40_000.0 + 100.0 * wave(i, 0.02 + 0.01 * motor)),
            ..FlightSample::default()
        };
        let (name, value) = acceleration;
        let column = (0..2000).map(|i| value * (1.0 + 1e-3 * wave(i, 0.5))).collect();
        let extra = [(name.to_owned(), column)].into();
        Flight::made(FlightData {
            samples: (0..2000).map(sample).collect(),
            extra,
            ..FlightData::default()
        })
    }

    #[test]
    fn a_figure_of_what_is_frozen_is_none_and_never_not_a_number() {
        let assumed = SimOptions::default().vehicle;
        let hover = assumed.mass_kg * GRAVITY_M_S2 / 160_000.0;
        for (name, value) in [("acc.z", 1.0), ("ae483log.a_z", GRAVITY_M_S2), ("other", 0.0)] {
            let identified = identify(&sway((name, value)), &assumed).unwrap();
            assert!((identified.k_f_n / hover - 1.0).abs() < 0.01, "{name}: {identified:?}");
        }
        for value in [0.0, -5.0] {
            let identified = identify(&sway(("ae483log.a_z", value)), &assumed).unwrap();
            assert!((identified.k_f_n / hover - 1.0).abs() < 0.01, "{value}: {identified:?}");
            let codes: Vec<&str> = identified.left_out.iter().map(|warning| warning.code).collect();
            let wanted = if value == 0.0 { "source-frozen" } else { "acceleration-down" };
            assert!(codes.contains(&wanted), "{value}: {codes:?}");
        }
        let mut flight = sway(("ae483log.a_z", 0.0));
        for axis in ["x", "y", "z"] {
            flight.edit(|flight| {
                flight.extra.insert(format!("ae483log.lh_{axis}"), vec![0.25; 2000])
            });
        }
        let identified = identify(&flight, &assumed).unwrap();
        // Attitude, velocity and rates are zero throughout.
        assert_eq!(
            (identified.measurement_sigma_m, identified.model_sigma, identified.lag),
            (None, None, None)
        );
        let said: String = identified.left_out.iter().map(ToString::to_string).collect();
        for name in ["ae483log.a_z", "ae483log.lh_x", "attitude", "velocity", "body rate"] {
            assert!(said.contains(name), "{name}: {said}");
        }
        assert!(!format!("{identified:?}").contains("NaN"), "{identified:?}");
        flight.edit(|flight| {
            flight.samples.iter_mut().for_each(|sample| sample.motors = [40_000.0; 4])
        });
        let error = identify(&flight, &assumed).unwrap_err().to_string();
        assert!(error.contains("never rotate the drone"), "as the evening's page says: {error}");
    }

    #[test]
    fn a_flight_without_motors_or_air_is_refused() {
        let assumed = SimOptions::default().vehicle;
        let grounded = identify(&Flight::default(), &assumed).unwrap_err().to_string();
        assert!(grounded.contains("0 samples in the air"), "{grounded}");
        let unlogged = [Quantity::Motors].into();
        let silent = Flight::made(FlightData { unlogged, ..FlightData::default() });
        let silent = identify(&silent, &assumed).unwrap_err();
        assert!(silent.to_string().contains("no motor commands"), "{silent}");
    }
}
