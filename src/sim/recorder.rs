//! Records a flight while it is simulated.

use std::collections::BTreeMap;

use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::flight::table::on_grid;
use noctograph_core::flight::{
    BATTERY_V, ENERGY_J, ESTIMATE_NEES, ESTIMATE_SIGMA_M, Flight, FlightData, FlightSample,
    SATURATED_S, rests_on_floor, warning,
};
use noctograph_core::plan::Plan;

/// Further columns of a flight. Those without a value are left out.
const COLUMNS: [&str; 5] = [SATURATED_S, BATTERY_V, ENERGY_J, ESTIMATE_SIGMA_M, ESTIMATE_NEES];

/// Collects samples and columns.
#[derive(Debug)]
pub(super) struct Recorder {
    flight: FlightData,
    /// [`COLUMNS`].
    extra: [Vec<f64>; 5],
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

    /// Adds a sample with the levels of its lights and the values of [`COLUMNS`].
    pub(super) fn record(
        &mut self,
        sample: FlightSample,
        lights: impl Iterator<Item = f64>,
        extra: [Option<f64>; 5],
    ) {
        self.flight.samples.push(sample);
        for (column, level) in self.flight.lights.values_mut().zip(lights) {
            column.push(on_grid(level));
        }
        for (column, value) in self.extra.iter_mut().zip(extra) {
            column.extend(value.map(on_grid));
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

/// A warning about a drone that stays on the floor under a plan that rises.
fn grounded(samples: &[FlightSample]) -> Option<Diagnostic> {
    let first = samples.first()?;
    let planned_m = samples.iter().map(|s| s.design_m.z).fold(f64::MIN, f64::max);
    let rises = planned_m - first.design_m.z > TAKE_OFF_M;
    let motors = samples.iter().flat_map(|sample| sample.motors).fold(0.0, f64::max);
    let rests = rises && rests_on_floor(samples, first.position_m.z);
    rests.then(|| warning::grounded(motors))
}
