//! Safety: limits of the checks before and during a flight. `check`, the exported scripts and
//! `docs/fly.md` use the same numbers.
//!
//! Firmware references are to `crazyflie-firmware`, release 2026.08, unless stated otherwise.

use serde::Serialize;

use noctograph_core::flight::{BATTERY_V, Flight};
use noctograph_sim::sensors::Positioning;
use noctograph_sim::vehicle::BatteryOptions;

/// Tolerance for objects outside the room, m. The size of a room is given to the decimeter, and a
/// station on the wall is measured to a few centimeters. A larger tolerance would accept an origin
/// at a wall of a small room.
pub const FRAME_M: f64 = 0.15;
/// Maximum distance of the drone from the plan's start before take-off, m. From farther away, its
/// path to the first letter would differ from the one that was checked.
pub const START_RADIUS_M: f64 = 0.2;
/// Minimum distance between people and any flight, m: an arm's length plus a step (an assumption).
pub const LEAST_PEOPLE_M: f64 = 1.0;
/// Maximum difference in heading from the plan before take-off, rad: 10°. The light of headlights
/// shifts sideways by the sine of this difference. A drone that points along another axis is off by
/// 90°.
pub const NOSE_RAD: f64 = 0.174_532_925_199_432_95;
/// Maximum roll and pitch before take-off, rad: 5°, exceeded by a drone on an edge or a cable.
pub const LEVEL_RAD: f64 = 0.087_266_462_599_716_47;
/// Maximum error of the drone's position at a corner of the canvas, m.
pub const CORNER_M: f64 = 0.02;
/// Distance of the script's fence from the volume in which `check` keeps the plan, m. It is half of
/// the distance between this volume and a room's walls.
pub const FENCE_M: f64 = 0.1;
/// Maximum distance of the estimated position from the setpoint, m. The PID cascade lags by 0.56 s,
/// which corresponds to 0.45 m at 0.8 m/s.
pub const MAX_POSITION_ERROR_M: f64 = 0.8;
/// Landing speed, m/s, slow enough that the ground effect does not push the drone back up.
pub const SINK_M_S: f64 = 0.3;
/// Time for which a limit must be exceeded in the air before the script lands, s, so that one bad
/// sample does not end a flight. After the same time without commands, the firmware levels out the
/// drone ([`noctograph_core::crazyflie::LEVEL_OUT_S`]).
pub const WRONG_S: f64 = 0.5;
/// Minimum voltage at rest if the scene's drone has no battery, V. It corresponds to a charge of
/// about 28 % in a Crazyflie's cell. The flight of a word should begin with more.
pub const REST_V: f64 = 3.8;
/// Ratio of a coordinate's variance to the settled one at which the position counts as lost.
pub const LOST_FACTOR: f64 = 10.0;
/// Voltage under load at which the script lands at once, V (`DEFAULT_BAT_CRITICAL_LOW_VOLTAGE` on
/// all platforms).
pub const CRITICAL_BATTERY_V: f64 = 3.0;
/// Time below the low voltage after which the firmware reports a low battery, s
/// (`DEFAULT_BAT_LOW_DURATION_TO_TRIGGER_SEC`, `platform_defaults_cf2.h`). Shorter sags are
/// ignored.
pub const LOW_BATTERY_S: f64 = 5.0;
/// Oldest cflib that supports everything the script uses: arming requests, and protocol 8.
pub const OLDEST_CFLIB: &str = "0.1.27";

/// Kind of drone, as named by its firmware, which determines the firmware's limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Platform {
    /// Crazyflie 2.0, 2.1 and 2.1+, with or without the thrust upgrade kit.
    Crazyflie2,
    /// Crazyflie 2.1 Brushless.
    Brushless,
}

impl Platform {
    /// Returns the firmware's possible names for itself (`platform_cf2.c`, `platform_cf21bl.c`).
    pub fn names(self) -> &'static [&'static str] {
        match self {
            Self::Crazyflie2 => &["Crazyflie 2.1", "Crazyflie 2.0"],
            Self::Brushless => &["Crazyflie 2.1 Brushless"],
        }
    }

    /// Returns the voltage under load at which the battery is low, V (`DEFAULT_BAT_LOW_VOLTAGE` in
    /// `platform_defaults_cf2.h` and `platform_defaults_cf21bl.h`).
    pub fn low_battery_v(self) -> f64 {
        match self {
            Self::Crazyflie2 => 3.2,
            Self::Brushless => 3.35,
        }
    }
}

/// Returns the maximum variance of an estimated coordinate that counts as settled, m².
///
/// For Lighthouse, the standard deviation is 3 cm, the limit in Bitcraze's examples (cflib,
/// `autonomous_sequence.py`). The filter settles at 1 mm. For ultra-wideband it is 10 cm, because
/// the filter would never settle within 3 cm. With 150 two-way ranges of σ = 0.25 m per second
/// (`lpsTwrTag.c`) and its process noise of 0.5 m/s² in a millisecond, the filter settles at 3.4 cm
/// inside the anchors, and at two to three times as much beside them.
pub fn variance_m2(positioning: Positioning) -> f64 {
    match positioning {
        Positioning::Position | Positioning::CrossingBeams | Positioning::Sweeps => 1e-3,
        Positioning::UwbTwr | Positioning::UwbTdoa | Positioning::Gnss => 1e-2,
    }
}

/// True if a voltage is never below `low_v` for [`LOW_BATTERY_S`] without interruption. `voltages`
/// contains pairs of time in s and voltage in V.
fn lasts(voltages: impl Iterator<Item = (f64, f64)>, low_v: f64) -> bool {
    let mut low_since_s = None;
    for (time_s, voltage_v) in voltages {
        if voltage_v >= low_v {
            low_since_s = None;
            continue;
        }
        if time_s - *low_since_s.get_or_insert(time_s) >= LOW_BATTERY_S {
            return false;
        }
    }
    true
}

/// Number of steps with which the minimum charge is resolved, each a hundredth of a percent.
const CHARGE_STEPS: u32 = 10_000;
/// Tolerance for rounded voltages, V.
const VOLTAGE_ROUNDING_V: f64 = 1e-9;

/// Battery voltages of a flight.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Battery {
    /// Voltage at rest with the scene's charge, V.
    pub rest_v: f64,
    /// Minimum voltage at rest for a flight that stays above the firmware's limit, V. `None` if
    /// even a full battery is insufficient.
    pub least_rest_v: Option<f64>,
    /// Maximum drop below the voltage at rest during the flight, V.
    pub sag_v: f64,
}

impl Battery {
    /// Returns the voltages of a simulated flight, or `None` if the scene's drone has no battery.
    ///
    /// The currents are computed from the flight's voltages, and determine the voltages of the same
    /// flight from any other charge.
    pub fn new(options: &BatteryOptions, flight: &Flight, low_v: f64) -> Option<Self> {
        if options.capacity_ah <= 0.0 || options.resistance_ohm <= 0.0 {
            return None;
        }
        let times = flight.samples.iter().map(|sample| sample.time_s);
        let voltages: Vec<(f64, f64)> =
            times.zip(flight.extra.get(BATTERY_V)?.iter().copied()).collect();
        if voltages.is_empty() {
            return None;
        }
        let least_frac = least_charge_frac(options, &loads(options, &voltages), low_v);
        // At rest, the battery supplies only the idle current.
        let idle_v = options.resistance_ohm * options.idle_current_a;
        let rest_v = options.open_circuit_v(options.charge_frac) - idle_v;
        let lowest_v = voltages.iter().map(|(_, v)| *v).fold(f64::INFINITY, f64::min);
        Some(Self {
            rest_v,
            least_rest_v: least_frac.map(|frac| options.open_circuit_v(frac) - idle_v),
            sag_v: rest_v - lowest_v,
        })
    }

    /// True if the battery lasts through the flight, starting with the scene's charge.
    pub fn lasts(&self) -> bool {
        self.least_rest_v.is_some_and(|least_v| self.rest_v >= least_v - VOLTAGE_ROUNDING_V)
    }
}

/// Load on the battery at one sample of a flight.
struct Load {
    time_s: f64,
    /// Charge used since the start, as a fraction of the capacity.
    used_frac: f64,
    /// Voltage drop across the internal resistance.
    drop_v: f64,
}

/// Number of seconds in an hour.
const S_PER_H: f64 = 3600.0;

/// Returns the loads implied by the times in s and voltages in V of a flight.
fn loads(options: &BatteryOptions, voltages: &[(f64, f64)]) -> Vec<Load> {
    let (mut used_frac, mut previous_s) = (0.0, voltages.first().map_or(0.0, |first| first.0));
    let loads = voltages.iter().map(|(time_s, voltage_v)| {
        let open_v = options.open_circuit_v((options.charge_frac - used_frac).max(0.0));
        let drop_v = open_v - voltage_v;
        // The current is I = U/R, and the charge is its integral over time.
        let current_a = drop_v / options.resistance_ohm;
        used_frac += current_a * (time_s - previous_s) / (S_PER_H * options.capacity_ah);
        previous_s = *time_s;
        Load { time_s: *time_s, used_frac, drop_v }
    });
    loads.collect()
}

/// Returns the minimum charge from which the battery stays above `low_v` under the loads, as a
/// fraction of the capacity. Returns `None` if a full battery does not last.
fn least_charge_frac(options: &BatteryOptions, loads: &[Load], low_v: f64) -> Option<f64> {
    // The minimum is found by bisection, because a battery with more charge lasts longer.
    let (mut least_frac, mut low, mut high) = (None, 0, CHARGE_STEPS + 1);
    while low < high {
        let middle = low.midpoint(high);
        let charge_frac = f64::from(middle) / f64::from(CHARGE_STEPS);
        let voltages = loads.iter().map(|Load { time_s, used_frac, drop_v }| {
            (*time_s, options.open_circuit_v((charge_frac - used_frac).max(0.0)) - drop_v)
        });
        if lasts(voltages, low_v) {
            (least_frac, high) = (Some(charge_frac), middle);
        } else {
            low = middle + 1;
        }
    }
    least_frac
}

/// Information about a flight's checks that exported files contain.
#[derive(Clone, Debug, PartialEq)]
pub struct Checks {
    /// Kind of drone. `None` if its firmware is not Bitcraze's.
    pub platform: Option<Platform>,
    /// Positioning system of the drones.
    pub positioning: Positioning,
    /// Minimum and maximum of x, y and z in the volume in which `check` keeps the plans. It is
    /// inside the room if there is one.
    pub volume_m: [[f64; 3]; 2],
    /// Width, depth and height of the room. `None` if the scene has no room.
    pub room_m: Option<[f64; 3]>,
    /// Battery voltages of each plan's flight. `None` if no flight with a battery was simulated.
    pub batteries: Vec<Option<Battery>>,
    /// SHA-256 of the printed scene.
    pub scene_sha256: String,
    /// Scene (TOML), which is copied to the log.
    pub scene_toml: String,
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::flight::FlightData;
    use noctograph_core::flight::FlightSample;
    use noctograph_letters::{LetterOptions, write};
    use noctograph_plan::{PlanOptions, plan};
    use noctograph_sim::{Drone, SimOptions, fly};

    /// Returns the battery for a flight of a short word, and true if it lasts by the table's rule.
    fn flown(charge_frac: f64) -> (Battery, bool) {
        let mut options = SimOptions::default();
        options.battery.capacity_ah = 0.25;
        options.battery.charge_frac = charge_frac;
        let strokes = write("NO", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::default()).unwrap();
        let flight = fly(&plan, &Drone::new(&options, 1), &mut |_| {}).unwrap();
        let low_v = Platform::Crazyflie2.low_battery_v();
        let times = flight.samples.iter().map(|sample| sample.time_s);
        let voltages = times.zip(flight.extra[BATTERY_V].iter().copied());
        (Battery::new(&options.battery, &flight, low_v).unwrap(), lasts(voltages, low_v))
    }

    #[test]
    fn the_least_voltage_at_rest_parts_the_charges_that_last_from_those_that_do_not() {
        let full = flown(1.0).0;
        let least_v = full.least_rest_v.unwrap();
        assert!((3.6..3.9).contains(&least_v), "{least_v} V");
        assert!((0.4..0.9).contains(&full.sag_v), "{} V", full.sag_v);
        for charge_frac in [0.05, 0.1, 0.15, 0.2, 0.3, 0.5] {
            let (battery, lasts) = flown(charge_frac);
            assert_eq!(battery.lasts(), lasts, "at {charge_frac}: {battery:?}");
            assert_eq!(battery.rest_v >= least_v, lasts, "as told by the full battery's flight");
        }
        assert!(!flown(0.1).1 && flown(0.5).1, "both happen");
    }

    #[test]
    fn the_least_voltage_is_that_of_the_charge_which_a_constant_current_leaves() {
        let options = BatteryOptions { capacity_ah: 0.25, charge_frac: 0.9, ..Default::default() };
        let (low_v, drop_v) = (3.2, 0.5);
        let current_a = drop_v / options.resistance_ohm;
        let sample = |k: u32| FlightSample { time_s: 0.1 * f64::from(k), ..Default::default() };
        let samples: Vec<FlightSample> = (0..=600).map(sample).collect();
        let spent_frac = |time_s: f64| current_a * time_s / (3600.0 * options.capacity_ah);
        let voltage_v = |sample: &FlightSample| {
            options.open_circuit_v(options.charge_frac - spent_frac(sample.time_s)) - drop_v
        };
        let extra = [(BATTERY_V.to_owned(), samples.iter().map(voltage_v).collect())].into();
        let flight = Flight::made(FlightData { samples, extra, ..FlightData::default() });
        let battery = Battery::new(&options, &flight, low_v).unwrap();
        // The voltage may be low from 55 s on, for 5 s: 3.7 V without load, on the curve's steep
        // part.
        let idle_v = options.resistance_ohm * options.idle_current_a;
        let least_frac = 0.1 * (low_v + drop_v - 3.0) / (3.78 - 3.0) + spent_frac(55.0);
        let least_v = options.open_circuit_v(least_frac) - idle_v;
        assert!((battery.least_rest_v.unwrap() - least_v).abs() < 1e-3, "{battery:?}, {least_v} V");
        assert!((battery.rest_v - (4.10 - idle_v)).abs() < 1e-9, "{battery:?}");
        let lowest_v = options.open_circuit_v(0.9 - spent_frac(60.0)) - drop_v;
        assert!((battery.sag_v - (battery.rest_v - lowest_v)).abs() < 1e-9, "{battery:?}");
        assert_eq!(battery.lasts(), battery.rest_v >= least_v);
        let none = BatteryOptions { capacity_ah: 0.0, ..options.clone() };
        assert_eq!(Battery::new(&none, &flight, low_v), None, "no battery");
        let stiff = BatteryOptions { resistance_ohm: 0.0, ..options };
        assert_eq!(Battery::new(&stiff, &flight, low_v), None, "no load can be told from it");
    }

    #[test]
    fn limits_of_platforms_and_positionings_are_the_firmwares() {
        let limits =
            [Platform::Crazyflie2, Platform::Brushless].map(|p| (p.names()[0], p.low_battery_v()));
        assert_eq!(limits, [("Crazyflie 2.1", 3.2), ("Crazyflie 2.1 Brushless", 3.35)]);
        let sigma_m = |positioning: &Positioning| libm::sqrt(variance_m2(*positioning));
        let sigmas_m: Vec<f64> = Positioning::ALL.iter().map(sigma_m).collect();
        for (sigma_m, want_m) in sigmas_m.iter().zip([0.0316, 0.0316, 0.0316, 0.1, 0.1, 0.1]) {
            assert!((sigma_m - want_m).abs() < 1e-4, "{sigmas_m:?}");
        }
        assert_eq!(sigmas_m.len(), 6, "a new kind is said here");
    }

    #[test]
    fn a_sag_of_less_than_five_seconds_empties_no_battery() {
        fn from(low_s: f64) -> impl Iterator<Item = (f64, f64)> {
            (0..200).map(move |k| {
                let time_s = 0.1 * f64::from(k);
                (time_s, if (1.0..1.0 + low_s).contains(&time_s) { 3.1 } else { 3.5 })
            })
        }
        assert!(lasts(from(4.9), 3.2));
        assert!(!lasts(from(5.3), 3.2));
        assert!(lasts(from(3.0).chain(from(3.0).map(|(time_s, v)| (20.0 + time_s, v))), 3.2));
        assert!(lasts(from(5.3), 3.05));
    }

    #[test]
    fn a_drone_without_a_battery_is_not_judged() {
        let flight = Flight::default();
        assert_eq!(Battery::new(&BatteryOptions::default(), &flight, 3.2), None);
    }
}
