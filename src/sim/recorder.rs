//! Records a flight while it is simulated.

use std::collections::BTreeMap;

use crate::vehicle::{State, attitude, position, rate, velocity};
use nalgebra::Matrix3;
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::flight::table::on_grid;
use noctograph_core::flight::{
    BATTERY_V, ENERGY_J, ESTIMATE_NEES, ESTIMATE_SIGMA_M, Flight, FlightData, FlightSample,
    SATURATED_S, rests_on_floor, warning,
};
use noctograph_core::plan::{Plan, Setpoint};

/// Further columns of a flight. Those without a value are left out.
const COLUMNS: [&str; 5] = [SATURATED_S, BATTERY_V, ENERGY_J, ESTIMATE_SIGMA_M, ESTIMATE_NEES];

/// Collects samples. Every figure is rounded to 1e-6 (µm, µrad, µs), so that a file with six
/// decimals gives back exactly the flight that was written.
#[derive(Debug)]
pub(super) struct Recorder {
    flight: FlightData,
    /// [`COLUMNS`].
    extra: [Vec<f64>; 5],
}

/// State and commands of the drone at one tick.
#[derive(Debug)]
pub(super) struct Snapshot {
    pub(super) time_s: f64,
    pub(super) state: State,
    pub(super) estimate: State,
    pub(super) motors: [f64; 4],
    /// Index of the setpoint in force.
    pub(super) setpoint: usize,
    /// Index of the setpoint whose light command has arrived.
    pub(super) heard: usize,
    /// Time so far with a motor at its limit.
    pub(super) saturated_s: f64,
    /// Voltage (V) and energy so far (J) of the battery, if there is one.
    pub(super) battery: Option<(f64, f64)>,
    /// Covariance of the estimated position, if the estimator logs it.
    pub(super) covariance_m2: Option<Matrix3<f64>>,
}

impl Recorder {
    /// A recorder for about `n` samples.
    pub(super) fn new(plan: &Plan, n: usize) -> Self {
        let lights: BTreeMap<_, _> =
            plan.lights.keys().map(|channel| (channel.clone(), Vec::with_capacity(n))).collect();
        Self {
            flight: FlightData { samples: Vec::with_capacity(n), lights, ..FlightData::default() },
            extra: Default::default(),
        }
    }

    pub(super) fn record(&mut self, plan: &Plan, snapshot: &Snapshot) {
        let setpoint = &plan.setpoints[snapshot.setpoint];
        self.flight.samples.push(sample(snapshot, setpoint));
        for (column, sent) in self.flight.lights.values_mut().zip(plan.lights.values()) {
            column.push(on_grid(sent[snapshot.heard]));
        }
        let [saturated_s, battery_v, energy_j, sigma_m, nees] = &mut self.extra;
        saturated_s.push(on_grid(snapshot.saturated_s));
        if let Some((volts, joules)) = snapshot.battery {
            battery_v.push(on_grid(volts));
            energy_j.push(on_grid(joules));
        }
        // NEES over three axes: eᵀ P⁻¹ e / 3, which is 1 on average for a consistent filter.
        if let Some(covariance_m2) = snapshot.covariance_m2 {
            let error_m = position(&snapshot.estimate) - position(&snapshot.state);
            let inverse = covariance_m2.try_inverse().unwrap_or_default();
            sigma_m.push(on_grid(covariance_m2.trace().sqrt()));
            nees.push(on_grid(error_m.dot(&(inverse * error_m)) / 3.0));
        }
    }

    pub(super) fn finish(self, mut warnings: Vec<Diagnostic>) -> Flight {
        warnings.extend(grounded(&self.flight.samples));
        let columns = COLUMNS.map(str::to_owned).into_iter().zip(self.extra);
        let extra = columns.filter(|(_, column)| !column.is_empty()).collect();
        Flight::made(FlightData { warnings, extra, ..self.flight })
    }
}

/// Least rise of a plan that takes off, m.
const TAKE_OFF_M: f64 = 0.2;

/// A warning about a drone that stays on the floor under a plan that rises, as after a mistaken
/// unit.
fn grounded(samples: &[FlightSample]) -> Option<Diagnostic> {
    let first = samples.first()?;
    let planned_m = samples.iter().map(|s| s.design_m.z).fold(f64::MIN, f64::max);
    let rises = planned_m - first.design_m.z > TAKE_OFF_M;
    let motors = samples.iter().flat_map(|sample| sample.motors).fold(0.0, f64::max);
    let rests = rises && rests_on_floor(samples, first.position_m.z);
    rests.then(|| warning::grounded(motors))
}

/// The flight's sample of a snapshot of the simulation.
fn sample(snapshot: &Snapshot, setpoint: &Setpoint) -> FlightSample {
    let state = snapshot.state.map(on_grid);
    FlightSample {
        time_s: on_grid(snapshot.time_s),
        position_m: position(&state),
        attitude: attitude(&state),
        velocity_body_m_s: velocity(&state),
        rate_body_rad_s: rate(&state),
        estimate_m: position(&snapshot.estimate).map(on_grid),
        design_m: setpoint.design_m(snapshot.time_s).map(on_grid),
        motors: snapshot.motors.map(on_grid),
        letter: setpoint.letter,
    }
}
