//! Recorder of a flight while it is simulated.

use std::collections::BTreeMap;

use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::flight::table::on_grid;
use noctograph_core::flight::{
    BATTERY_V, ENERGY_J, ESTIMATE_NEES, ESTIMATE_SIGMA_M, Flight, FlightData, FlightSample,
    SATURATED_S, rests_on_floor, warning,
};
use noctograph_core::plan::Plan;

/// Names of a flight's additional columns. Columns without a value are left out.
const COLUMNS: [&str; 5] = [SATURATED_S, BATTERY_V, ENERGY_J, ESTIMATE_SIGMA_M, ESTIMATE_NEES];

/// Collection of a flight's samples and columns.
#[derive(Debug)]
pub(super) struct Recorder {
    flight: FlightData,
    /// Values of the [`COLUMNS`].
    extra: [Vec<f64>; COLUMNS.len()],
}

impl Recorder {
    /// Creates an empty recorder with capacity for `n` samples, and with the plan's light channels.
    pub(super) fn new(plan: &Plan, n: usize) -> Self {
        let lights: BTreeMap<_, _> =
            plan.lights.keys().map(|channel| (channel.clone(), Vec::with_capacity(n))).collect();
        Self {
            flight: FlightData { samples: Vec::with_capacity(n), lights, ..FlightData::default() },
            extra: Default::default(),
        }
    }

    /// Adds a sample with the levels of its lights (0 to 1, in the order of the channels) and the
    /// values of the [`COLUMNS`]. A column whose value is `None` remains empty.
    pub(super) fn record(
        &mut self,
        sample: FlightSample,
        lights: impl Iterator<Item = f64>,
        extra: [Option<f64>; COLUMNS.len()],
    ) {
        self.flight.samples.push(sample);
        for (column, level) in self.flight.lights.values_mut().zip(lights) {
            column.push(on_grid(level));
        }
        for (column, value) in self.extra.iter_mut().zip(extra) {
            column.extend(value.map(on_grid));
        }
    }

    /// Returns the flight with its warnings, and another warning if the drone never took off.
    pub(super) fn finish(self, mut warnings: Vec<Diagnostic>) -> Flight {
        warnings.extend(grounded(&self.flight.samples));
        let columns = COLUMNS.map(str::to_owned).into_iter().zip(self.extra);
        let extra = columns.filter(|(_, column)| !column.is_empty()).collect();
        Flight::made(FlightData { warnings, extra, ..self.flight })
    }
}

/// Minimum height gain in m of a plan that takes off.
const TAKE_OFF_M: f64 = 0.2;

/// Returns a warning if the drone stays on the floor while its plan rises, and `None` otherwise.
pub(super) fn grounded(samples: &[FlightSample]) -> Option<Diagnostic> {
    let first = samples.first()?;
    let planned_m = samples.iter().map(|s| s.design_m.z).fold(f64::MIN, f64::max);
    let plan_rises = planned_m - first.design_m.z > TAKE_OFF_M;
    let largest_command = samples.iter().flat_map(|sample| sample.motors).fold(0.0, f64::max);
    let is_grounded = plan_rises && rests_on_floor(samples, first.position_m.z);
    is_grounded.then(|| warning::grounded(largest_command))
}
