//! Scenarios of altitude hold and their events, for the scalar model and the full simulator.

use noctograph_core::random::Noise;
use noctograph_core::settings::settings;
use noctograph_sim::SimOptions;
use noctograph_sim::vehicle::{BatteryOptions, Compensation, FloorStep, GustOptions, Gusts};

/// Standard deviation of the true lift per unit throttle, as a fraction of the vehicle's value.
pub(super) const GAIN_SPREAD: f64 = 0.05;
/// Standard deviation of the true α⁰ from gravity, m/s²: lift at zero throttle or a steady draft.
pub(super) const OFFSET_SPREAD_M_S2: f64 = 0.1;
/// Standard deviation, m/s², and correlation time, s, of the vertical acceleration caused by gusts.
pub(super) const GUST: [f64; 2] = [0.15, 2.0];

/// Height of the table, m, and the times between which it is below the drone, s.
const TABLE_M: f64 = 0.5;
const TABLE_S: [f64; 2] = [20.0, 40.0];
/// Start and end of the satellite outage, s.
const SILENT_S: [f64; 2] = [20.0, 30.0];
/// Fraction of its lift that the battery loses, and the duration of this loss, s.
const DRAIN_FRAC: f64 = 0.25;
const DRAIN_S: f64 = 60.0;
/// Apparent drift of the altitude due to air pressure, m/s.
const DRIFT_M_S: f64 = 0.02;
/// Speed at which the drone flies over the table in the full simulator, m/s.
pub(super) const SPEED_M_S: f64 = 0.2;
/// Half width of the table, m.
const TABLE_HALF_WIDTH_M: f64 = 50.0;
/// Number of bisections in the search for the drained battery's voltage.
const BISECTIONS: u32 = 60;

settings! {
    /// Events of a flight at constant altitude.
    pub enum HoldScenario {
        /// No events.
        "calm" => Calm,
        /// A table of 0.5 m is below the drone from 20 s to 40 s.
        "step" => Step,
        /// The satellites are lost from 20 s to 30 s.
        "silent" => Silent,
        /// The battery loses a quarter of its lift in 60 s.
        "drain" => Drain,
        /// The air pressure drifts by 2 cm/s of altitude.
        "drift" => Drift,
        /// The table appears while the satellites are lost, so only the barometer reveals it.
        "step-silent" => StepSilent,
    }
}

impl HoldScenario {
    /// Returns true if there is a table on the floor.
    pub fn has_step(self) -> bool {
        matches!(self, Self::Step | Self::StepSilent)
    }

    /// Returns the height of the floor below the drone at `time_s`, m.
    pub(super) fn floor_m(self, time_s: f64) -> f64 {
        let is_above_table = self.has_step() && (TABLE_S[0]..TABLE_S[1]).contains(&time_s);
        if is_above_table { TABLE_M } else { 0.0 }
    }

    /// Returns true if the drone receives satellite signals at `time_s`.
    pub(super) fn hears_gnss(self, time_s: f64) -> bool {
        !(self.is_silent() && (SILENT_S[0]..SILENT_S[1]).contains(&time_s))
    }

    /// Returns true if the scenario has a satellite outage.
    fn is_silent(self) -> bool {
        matches!(self, Self::Silent | Self::StepSilent)
    }

    /// Returns the fraction of its full lift that the battery provides at `time_s`. After
    /// [`DRAIN_S`] the fraction is constant, as with the empty battery of [`drain`].
    pub(super) fn lift_frac(self, time_s: f64) -> f64 {
        if self == Self::Drain { 1.0 - DRAIN_FRAC * (time_s / DRAIN_S).min(1.0) } else { 1.0 }
    }

    /// Returns the barometer's drift, m/s.
    pub(super) fn drift_m_s(self) -> f64 {
        if self == Self::Drift { DRIFT_M_S } else { 0.0 }
    }

    /// Returns the options of the drone that actually flies in the full simulator, with the
    /// scenario's events. `believed` are the options that the filter and the controller assume.
    pub(super) fn applied(self, believed: &SimOptions, seed: u64) -> SimOptions {
        let mut actual = believed.clone();
        // Numbers are drawn in the same order as in the scalar model.
        let mut drawn = Noise::new(seed, 0, DRONE);
        let lift = 1.0 + GAIN_SPREAD * drawn.normal();
        let offset_m_s2 = OFFSET_SPREAD_M_S2 * drawn.normal();
        actual.vehicle.k_f_n *= lift;
        actual.battery.thrust_from_v_n.iter_mut().for_each(|term| *term *= lift);
        actual.sensors.barometer.drift_m_s += self.drift_m_s();
        if self.has_step() {
            let (x_m, y_m) = (TABLE_S.map(|s| s * SPEED_M_S), TABLE_HALF_WIDTH_M);
            actual.floor.steps = vec![FloorStep { x_m, y_m: [-y_m, y_m], height_m: TABLE_M }];
        }
        if self.is_silent() {
            actual.sensors.gnss.silent_s = vec![SILENT_S];
        }
        if self == Self::Drain {
            drain(&mut actual);
        }
        // Gusts and the draft are modeled as wind that causes the same acceleration through the
        // drag. With little drag, the wind is limited to 50 m/s. Options with gusts keep their
        // wind.
        let [sigma_m_s2, time_s] = GUST;
        let drag_n_s_m = actual.vehicle.body_drag_n_s_m[2];
        if actual.air.gusts == Gusts::None && drag_n_s_m > 0.0 {
            let [sigma_m_s, draft_m_s] = [sigma_m_s2, offset_m_s2]
                .map(|a_m_s2| (a_m_s2 * actual.vehicle.mass_kg / drag_n_s_m).clamp(-50.0, 50.0));
            actual.air.wind_m_s[2] += draft_m_s;
            actual.air.gusts = Gusts::OrnsteinUhlenbeck(GustOptions {
                sigma_m_s: [0.0, 0.0, sigma_m_s],
                time_s,
                ..GustOptions::default()
            });
        }
        actual
    }
}

/// Name of the random stream that draws the true drone in both models.
pub(super) const DRONE: &str = "hold drone";

/// Replaces the battery so that the lift at hover falls by [`DRAIN_FRAC`] in [`DRAIN_S`]. The
/// charge lasts for that time, during which the open-circuit voltage falls linearly.
fn drain(options: &mut SimOptions) {
    let weight_n = options.vehicle.mass_kg * noctograph_core::crazyflie::GRAVITY_M_S2;
    let battery = &mut options.battery;
    let current_a = battery.idle_current_a + battery.current_a_per_n * weight_n;
    let full_v = battery.open_circuit_v(battery.charge_frac);
    let wanted_n = (1.0 - DRAIN_FRAC) * lift_n(battery, full_v, current_a);
    // The final voltage is found by bisection, so that the lift ends at the intended value.
    let (mut low_v, mut high_v) = (0.0, full_v);
    for _ in 0..BISECTIONS {
        let middle_v = 0.5 * (low_v + high_v);
        if lift_n(battery, middle_v, current_a) < wanted_n {
            low_v = middle_v
        } else {
            high_v = middle_v
        }
    }
    let tenth_v = (full_v - low_v) / 10.0;
    *battery = BatteryOptions {
        capacity_ah: current_a * DRAIN_S / 3600.0,
        charge_frac: 1.0,
        open_circuit_v: std::array::from_fn(|tenths| low_v + tenth_v * tenths as f64),
        compensation: Compensation::None,
        cut_off_v: 0.0,
        ..battery.clone()
    };
}

/// Returns the full thrust in N, given an open-circuit voltage and a current. The voltage at the
/// motors is lower by the drop across the battery's resistance.
fn lift_n(battery: &BatteryOptions, open_v: f64, current_a: f64) -> f64 {
    let [a, b, c, d] = battery.thrust_from_v_n;
    let v = open_v - battery.resistance_ohm * current_a;
    a + v * (b + v * (c + v * d))
}
