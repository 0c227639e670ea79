//! Named parameter sets: whole drones, each number with its source.
//!
//! The figures of published models disagree by factors (motor lag 0.02 to 0.25 s, yaw moment 0.005
//! to 0.034 m); each set keeps to one source where it can. The regulator's weights are near the
//! reference team's, its gain is designed for the rotors' lag: without that, such weights make
//! every drone with a lagging motor oscillate.

use super::options::{
    BarometerOptions, BatteryOptions, Compensation, ControllerKind, ControllerOptions, EkfOptions,
    EstimatorKind, GeometricOptions, GnssOptions, GroundEffect, HeightSensor, LqrOptions,
    ObserverOptions, PidOptions, Positioning, SensorOptions, SimOptions, TimeOfFlightOptions,
    VehicleOptions,
};

/// Largest motor command of the Crazyflie's firmware.
const FULL: f64 = 65_535.0;

/// Gains of a Crazyflie whose rotors lag.
///
/// Regulators: the reference team's weights, with torque across and thrust at a quarter of their
/// price: it trails as the team's drone did, by 0.53 s, and no motor reaches its end; at an eighth,
/// one does. Geometric controller: the firmware's own gains over the inertia given with them
/// (`controller_lee.c`, commit 0640f1c); the default's are for motors that obey at once.
fn crazyflie_gains() -> ControllerOptions {
    let team = LqrOptions::default();
    let [x, y, z, f] = team.r;
    ControllerOptions {
        lqr: LqrOptions { r: [0.25 * x, 0.25 * y, z, 0.25 * f], ..team },
        geometric: GeometricOptions {
            k_position: 9.0,
            k_velocity: 7.0,
            k_position_integral: 5.0,
            k_attitude: [331.9, 330.2, 341.7],
            k_rate: [78.4, 78.1, 68.3],
            k_attitude_integral: [724.0, 1081.0, 513.0],
        },
        ..ControllerOptions::default()
    }
}

impl SimOptions {
    /// Crazyflie 2.1 with legacy propellers and the 250 mAh battery.
    ///
    /// Body, drag, rotors: crazyflow's `cf2x_L250` (`first_principles/params.toml`); its lag turned
    /// into time constants at hover, its thrust over speed taken at hover; rotor inertia that of
    /// `cf2x_P250`, since its own is marked "seems off". Largest thrust and yaw moment (7.35 mm):
    /// firmware `platform_defaults_cf2.h`, as for the thrust kit. Ground effect: propellers of
    /// 23 mm, 30 mm above the floor. Battery: see [`BatteryOptions`]; the hover voltage falls as in
    /// 98 real flights.
    #[must_use]
    pub fn cf21() -> Self {
        Self {
            vehicle: VehicleOptions {
                mass_kg: 0.0328,
                inertia_kg_m2: [16.8e-6, 16.8e-6, 29.8e-6],
                k_f_n: 0.12 / FULL,
                k_m_n_m: 0.007_35 * 0.12 / FULL,
                arm_m: 0.032_53,
                motor_max: FULL,
                center_of_mass_m: [0.0, 0.0],
                rotor_thrust_n_s2: 1.986e-8,
                motor_rise_s: 0.136,
                motor_fall_s: 0.106,
                body_drag_n_s_m: [0.014_72, 0.014_72, 0.012_78],
                rotor_drag_n_s2_m: 0.0,
                airspeed_moment_n_s: 0.0,
                rotor_inertia_kg_m2: 26.97e-9,
                ground_effect: GroundEffect::SanchezCuevas,
                rotor_radius_m: 0.023,
                rotor_height_m: 0.03,
            },
            battery: BatteryOptions { capacity_ah: 0.25, ..Default::default() },
            controller: crazyflie_gains(),
            ..Self::default()
        }
    }

    /// Crazyflie 2.1 with the thrust upgrade kit and a 350 mAh battery.
    ///
    /// Body, drag, rotors: crazyflow's `cf2x_T350` (its rotor inertia is that of `cf21B_500`).
    /// Thrust over voltage, largest thrust (0.18 N), yaw moment (5.16 mm): firmware
    /// `platform_defaults_cf2.h`, `CONFIG_CRAZYFLIE_THRUST_UPGRADE_KIT`, all three of one version:
    /// the one after pull requests 1526 and 1559 of crazyflie-firmware (December 2025), read in a
    /// copy that names no commit. Commit 0555cb1, before them, has 0.1625 N, 5.96 mm and another
    /// curve. Battery: that of [`Self::cf21`] with a resistance that falls as the capacity rises;
    /// current per thrust the same, for want of a measurement.
    #[must_use]
    pub fn cf21_thrust_kit() -> Self {
        let base = Self::cf21();
        Self {
            vehicle: VehicleOptions {
                mass_kg: 0.0379,
                inertia_kg_m2: [15.7e-6, 17.1e-6, 30.0e-6],
                k_f_n: 0.18 / FULL,
                k_m_n_m: 0.005_16 * 0.18 / FULL,
                rotor_thrust_n_s2: 2.338e-8,
                motor_rise_s: 0.088,
                motor_fall_s: 0.069,
                body_drag_n_s_m: [0.015_57, 0.015_57, 0.021_92],
                rotor_inertia_kg_m2: 38.93e-9,
                ..base.vehicle
            },
            battery: BatteryOptions {
                capacity_ah: 0.35,
                resistance_ohm: 0.265 * 0.25 / 0.35,
                thrust_from_v_n: [0.006_728, 0.010_116, 0.010_263, 0.002_836],
                ..base.battery
            },
            ..base
        }
    }

    /// Crazyflie 2.1 Brushless with a 500 mAh battery.
    ///
    /// Body, drag, rotors: crazyflow's `cf21B_500`. Thrust over voltage, largest thrust (0.2 N),
    /// yaw moment (5.69 mm), gains and base thrust of the PID cascade: firmware
    /// `platform_defaults_cf21bl.h` (commit 13e6794). Propellers of 55 mm. Current
    /// per thrust: from Bitcraze's 10 minutes with 350 mAh at 39.3 g. Resistance: as for the thrust
    /// kit.
    #[must_use]
    pub fn cf_brushless() -> Self {
        let base = Self::cf21();
        Self {
            vehicle: VehicleOptions {
                mass_kg: 0.0434,
                inertia_kg_m2: [25.0e-6, 28.0e-6, 49.0e-6],
                k_f_n: 0.2 / FULL,
                k_m_n_m: 0.005_69 * 0.2 / FULL,
                arm_m: 0.035_355,
                rotor_thrust_n_s2: 3.839e-8,
                motor_rise_s: 0.057,
                motor_fall_s: 0.062,
                body_drag_n_s_m: [0.021_49, 0.021_49, 0.023_60],
                rotor_inertia_kg_m2: 38.93e-9,
                rotor_radius_m: 0.0275,
                ..base.vehicle
            },
            battery: BatteryOptions {
                capacity_ah: 0.5,
                resistance_ohm: 0.265 * 0.25 / 0.5,
                current_a_per_n: 4.8,
                thrust_from_v_n: [-0.014_059, 0.042_653, 0.001_833, 0.002_058],
                ..base.battery
            },
            controller: ControllerOptions {
                pid: PidOptions { rate_pid: [200.0, 400.0, 2.5], thrust_base: 30_000.0 },
                ..base.controller
            },
            ..base
        }
    }

    /// bzzz: a quadcopter of 1.15 kg with 10-inch propellers, from a laboratory on altitude hold.
    ///
    /// Body, motor lag, propellers: `quadx88`, the model of the same laboratory (on `pypi.org`:
    /// mass of its example, thrust coefficient 0.112, power coefficient 0.044, 10 in, air 1.225
    /// kg/m³); half the side is its arm of 225 mm times √½. Largest thrust and current: a 920 KV
    /// motor with such a propeller, 960 g at 11.1 V and 15.2 A; thrust as the square of the
    /// voltage, so that lift is linear in the throttle and falls with the battery, for nothing
    /// compensates; `k_f_n` at 12 V, a full battery in hover. Battery: three of the cells of
    /// [`Self::cf21`], 5 Ah and 20 mΩ assumed. Rotor drag: `RotorS`, 8.06e-5. Rotor inertia: its
    /// propeller of 9 g as a rod. Body drag and height of the propellers assumed. Weights of the
    /// inputs: Bryson's rule (`noctograph gains --bryson`), times 30. Sensors: the lab sheet's, ten
    /// times a second, satellites 5 cm, ranger 6 cm, barometer 25 cm; its walk that of
    /// [`BarometerOptions`].
    #[must_use]
    pub fn bzzz() -> Self {
        let base = Self::default();
        let cell = BatteryOptions::default();
        let n_per_v_sq = 0.96 * 9.81 / (11.1 * 11.1);
        let full_n = n_per_v_sq * 12.0 * 12.0;
        Self {
            vehicle: VehicleOptions {
                mass_kg: 1.15,
                inertia_kg_m2: [0.017_88, 0.030_14, 0.046_14],
                k_f_n: full_n / FULL,
                k_m_n_m: 0.015_88 * full_n / FULL,
                arm_m: 0.159,
                motor_max: FULL,
                center_of_mass_m: [0.0, 0.0],
                rotor_thrust_n_s2: 1.4465e-5,
                motor_rise_s: 0.05,
                motor_fall_s: 0.05,
                body_drag_n_s_m: [0.1, 0.1, 0.2],
                rotor_drag_n_s2_m: 8.06e-5,
                airspeed_moment_n_s: 0.0,
                rotor_inertia_kg_m2: 4.8e-5,
                ground_effect: GroundEffect::SanchezCuevas,
                rotor_radius_m: 0.127,
                rotor_height_m: 0.2,
            },
            battery: BatteryOptions {
                capacity_ah: 5.0,
                open_circuit_v: cell.open_circuit_v.map(|v| 3.0 * v),
                resistance_ohm: 0.02,
                idle_current_a: 0.5,
                current_a_per_n: 15.2 / (0.96 * 9.81),
                thrust_from_v_n: [0.0, 0.0, n_per_v_sq, 0.0],
                compensation: Compensation::None,
                cut_off_v: 9.0,
                ..cell
            },
            sensors: SensorOptions {
                positioning: Positioning::Gnss,
                heights: vec![HeightSensor::TimeOfFlight, HeightSensor::Barometer],
                gnss: GnssOptions { noise_m: 0.05, rate_hz: 10.0, ..base.sensors.gnss },
                time_of_flight: TimeOfFlightOptions { noise_m: 0.06, rate_hz: 10.0 },
                barometer: BarometerOptions {
                    noise_m: 0.25,
                    rate_hz: 10.0,
                    ..base.sensors.barometer
                },
                ..base.sensors
            },
            observer: ObserverOptions {
                kind: EstimatorKind::Altitude,
                ekf: EkfOptions { position_sigma_m: 0.05, ..base.observer.ekf },
                ..base.observer
            },
            controller: ControllerOptions {
                kind: ControllerKind::Altitude,
                lqr: LqrOptions { r: [9.324, 9.324, 934.75, 0.2357], ..LqrOptions::default() },
                ..base.controller
            },
            ..base
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::flight::Flight;
    use crate::flight::tracking::{Part, track};
    use crate::letters::{LetterOptions, write};
    use crate::plan::{PlanOptions, plan};
    use crate::sim::{Drone, Gusts, MotorLag, fly};

    fn noor(options: &SimOptions) -> Flight {
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        fly(&plan(&strokes, &PlanOptions::default()).unwrap(), &Drone::new(options, 1), &mut |_| {})
            .unwrap()
    }

    #[test]
    fn every_set_passes_its_check_and_flies_noor_from_floor_to_floor() {
        // Bounds are a tenth above the errors found.
        let sets = [
            (SimOptions::cf21(), [0.073, 0.01, 0.081]),
            (SimOptions::cf21_thrust_kit(), [0.072, 0.01, 0.081]),
            (SimOptions::cf_brushless(), [0.074, 0.01, 0.082]),
            (SimOptions::bzzz(), [0.048, 0.033, 0.046]),
        ];
        for (options, bounds) in sets {
            options.check().unwrap();
            let flight = noor(&options);
            let rmse = track(&flight, Part::Letters).unwrap().rmse_m;
            for (found, bound) in rmse.iter().zip(bounds) {
                assert!(*found < bound, "{rmse} above {bounds:?}");
            }
            assert_eq!(flight.samples.last().unwrap().position_m.z, 0.0, "landed");
            assert!(flight.warnings.is_empty(), "{:?}", flight.warnings);
        }
    }

    #[test]
    fn every_crazyflie_bears_a_rooms_gusts_with_the_firmwares_controllers() {
        // A regulator without integral action does not: they move cf21 by 8 cm.
        for set in [SimOptions::cf21, SimOptions::cf21_thrust_kit, SimOptions::cf_brushless] {
            for (kind, bound_m) in [(ControllerKind::Pid, 0.12), (ControllerKind::Geometric, 0.05)]
            {
                let mut options = set();
                options.controller.kind = kind;
                options.air.gusts = Gusts::room();
                let rmse_m = track(&noor(&options), Part::Letters).unwrap().rmse_m.norm();
                assert!(rmse_m < bound_m, "{kind:?}: {rmse_m} m");
            }
        }
    }

    #[test]
    fn the_reference_teams_gains_do_not_bear_the_motor_lag() {
        let mut options = SimOptions::cf21();
        options.controller.lqr.motor_lag = MotorLag::Ignored;
        let strokes = write("NOOR", &LetterOptions::default()).unwrap();
        let plan = plan(&strokes, &PlanOptions::default()).unwrap();
        let error = fly(&plan, &Drone::new(&options, 1), &mut |_| {}).unwrap_err().to_string();
        assert!(error.starts_with("the drone "), "{error}");
    }

    #[test]
    fn half_the_step_moves_the_flight_little_though_battery_and_ground_effect_are_held() {
        let mut options = SimOptions { sensors: SensorOptions::ideal(), ..SimOptions::cf21() };
        let coarse = noor(&options);
        options.rates.steps_per_tick = 2;
        let fine = noor(&options);
        let apart_m = coarse.samples.iter().zip(&fine.samples).filter(|(a, _)| a.letter.is_some());
        let apart_m =
            apart_m.map(|(a, b)| (a.position_m - b.position_m).norm()).fold(0.0, f64::max);
        // The moment of lift-off is known to a step; most of the difference is from there.
        assert!(apart_m < 2e-5, "{apart_m} m apart");
    }
}
