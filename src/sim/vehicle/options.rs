//! What a drone, its battery and the air about it are described with.

use serde::{Deserialize, Serialize};

use super::GRAVITY_M_S2;
use crate::error::{Error, Result, within};
use crate::sim::options::within_all;

/// A quadrotor with its four motors at the corners of a square.
///
/// The rigid body and the linear motors are the reference team's model; everything from
/// [`Self::rotor_thrust_n_s2`] on can be switched off by 0 or "none", as it is in the default.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct VehicleOptions {
    /// Mass with battery and decks.
    pub mass_kg: f64,
    /// Principal moments of inertia about body x, y, z.
    pub inertia_kg_m2: [f64; 3],
    /// Thrust of one motor per unit of its command.
    pub k_f_n: f64,
    /// Reaction torque of one motor about body z per unit of its command.
    pub k_m_n_m: f64,
    /// Half the side of the square of motors: lever of the thrust about body x and y.
    pub arm_m: f64,
    /// Largest motor command; the smallest is 0.
    pub motor_max: f64,
    /// Centre of mass in body x and y, from the middle of the motors. The thrust turns the drone
    /// about it, and a controller without integral action pays with a constant position error.
    pub center_of_mass_m: [f64; 2],
    /// Thrust of one rotor per square of its speed, N/(rad/s)². Matters only where the rotors'
    /// speed does: lag, rotor drag, gyroscopic torque.
    pub rotor_thrust_n_s2: f64,
    /// Time constant of a rotor's speed while it rises; 0: at once. Too much makes a firm attitude
    /// controller oscillate.
    pub motor_rise_s: f64,
    /// Time constant of a rotor's speed while it falls; 0: at once.
    pub motor_fall_s: f64,
    /// Drag of the body per airspeed along body x, y, z, N/(m/s).
    pub body_drag_n_s_m: [f64; 3],
    /// Drag of one rotor across its axis per airspeed and rotor speed, N/((m/s)(rad/s)): the
    /// H-force of blade element theory, linear as in `RotorS` (Furrer et al. 2016).
    pub rotor_drag_n_s2_m: f64,
    /// Moment of the air about body x and y per airspeed across the rotors' axes, N m/(m/s): the
    /// side of a rotor that moves into the air lifts more than the other, and its drag acts above
    /// the centre of mass, so that the drone rears up against its motion (speed stability: Pounds,
    /// Mahony, Corke, "Modelling and control of a large quadrotor robot", 2010). A regulator without
    /// integral action trails by so much the more. 4.7e-4 in the log of the reference flight, by
    /// the slow part of its pitch torque over its speed in x (σ 0.6 of 0.8e-4 N m is left).
    pub airspeed_moment_n_s: f64,
    /// Moment of inertia of one rotor with the turning part of its motor, about its axis: the
    /// gyroscopic torque, and the yaw that a rotor gives by speeding up.
    pub rotor_inertia_kg_m2: f64,
    /// How the floor lifts the drone.
    pub ground_effect: GroundEffect,
    /// Radius of a propeller.
    pub rotor_radius_m: f64,
    /// Height of the propellers above the floor when the drone stands on it.
    pub rotor_height_m: f64,
}

/// A model of the ground effect: thrust in it over thrust out of it, at the same rotor speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GroundEffect {
    /// The floor changes nothing.
    #[default]
    None,
    /// One rotor and its image: `1 / (1 − (R/4z)²)`. Cheeseman, Bennett: The effect of the ground
    /// on a helicopter rotor in forward flight, ARC R&M 3021, 1955.
    CheesemanBennett,
    /// Four rotors and their images: the denominator above less
    /// `R² z / (d² + 4z²)^1.5 + R² z / 2(2d² + 4z²)^1.5`, d the distance of neighbours.
    /// Sanchez-Cuevas, Heredia, Ollero: Characterization of the aerodynamic ground effect and its
    /// influence in multirotor control, Int. J. Aerospace Eng. 2017, 1823056; without the body's
    /// fountain, whose coefficient they fitted to a far larger drone.
    SanchezCuevas,
}

/// A lithium-polymer battery. The default has no capacity: a voltage that never sags.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BatteryOptions {
    /// Charge of a full battery, A h; 0: no battery, full thrust at all times.
    pub capacity_ah: f64,
    /// Share of the charge that is there at the start.
    pub charge_frac: f64,
    /// Open-circuit voltage at 0 %, 10 % … 100 % of charge.
    pub open_circuit_v: [f64; 11],
    /// Resistance of battery, plug and wires together.
    pub resistance_ohm: f64,
    /// Current with the motors off: electronics, decks, lamps.
    pub idle_current_a: f64,
    /// Current of all motors per thrust of all motors, A/N.
    pub current_a_per_n: f64,
    /// Thrust of one motor from its voltage v: `t₀ + t₁v + t₂v² + t₃v³`, N.
    pub thrust_from_v_n: [f64; 4],
    /// What the firmware does about a falling voltage.
    pub compensation: Compensation,
    /// Voltage under load below which the motors stop for good; 0: never.
    pub cut_off_v: f64,
}

/// What the firmware does about a falling battery voltage.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Compensation {
    /// Nothing: a command is a share of what the motor gives at the present voltage.
    None,
    /// A command is a thrust, and the duty cycle rises as the voltage falls, until it is full
    /// (Crazyflie: `motorsCompensateBatteryVoltage`, firmware `motors.c`).
    #[default]
    Firmware,
}

/// Wind and gusts. The default is still air.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct AirOptions {
    /// Steady wind, world frame.
    pub wind_m_s: [f64; 3],
    /// Gusts about it. They push the drone through its drag.
    pub gusts: Gusts,
    /// Standard deviation of the gusts along world x, y, z (Ornstein–Uhlenbeck).
    pub gust_sigma_m_s: [f64; 3],
    /// Time over which they are correlated (Ornstein–Uhlenbeck): the size of an eddy over the speed
    /// at which it drifts past.
    pub gust_time_s: f64,
    /// Standard deviation of the torque about body x, y, z (Ornstein–Uhlenbeck) with which uneven
    /// air and rotors that do not keep their thrust turn the drone. A regulator without integral
    /// action pays for it with its position: this, more than the push, moves it in a room.
    pub gust_torque_sigma_n_m: [f64; 3],
    /// Time over which that torque is correlated.
    pub gust_torque_time_s: f64,
}

/// A model of gusts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Gusts {
    /// None.
    #[default]
    None,
    /// Each axis an Ornstein–Uhlenbeck process (Uhlenbeck, Ornstein 1930) with the standard
    /// deviation and the time of [`AirOptions`]; density `4σ²τ / (1 + ω²τ²)` per Hz. For rooms.
    OrnsteinUhlenbeck,
    /// Dryden's spectra at low altitude after MIL-F-8785C (1980), at 10 ft and below, from the
    /// level part of the steady wind, which stands for the wind at 20 ft and carries the gusts past
    /// the drone. No wind, no gusts. For the open.
    Dryden,
}

impl Default for VehicleOptions {
    /// The team's pendulum tests and fits; the centre of mass explains the mean motor commands and
    /// the standing position error of their flight (at hover (−1.3e-4, −3.3e-4, 0) N m). They had
    /// no lag, drag or ground effect in their model. Rotors: Bitcraze's fit of 2015 to a
    /// Crazyflie 2.0, 2.68e-10 N/rpm² a motor (firmware `docs/functional-areas/pwm-to-thrust.md`);
    /// propellers of radius 23 mm, 30 mm above the floor (constants of the ground-effect module in
    /// `XinLong-Li/cf-frimware-2022-12`).
    fn default() -> Self {
        Self {
            mass_kg: 0.0351,
            inertia_kg_m2: [1.24e-5, 1.27e-5, 3.32e-5],
            k_f_n: 1.95e-6,
            k_m_n_m: 7.47e-9,
            arm_m: 0.035,
            motor_max: 65_535.0,
            center_of_mass_m: [-0.958e-3, 0.378e-3],
            rotor_thrust_n_s2: 2.444e-8,
            motor_rise_s: 0.0,
            motor_fall_s: 0.0,
            body_drag_n_s_m: [0.0; 3],
            rotor_drag_n_s2_m: 0.0,
            airspeed_moment_n_s: 0.0,
            rotor_inertia_kg_m2: 0.0,
            ground_effect: GroundEffect::None,
            rotor_radius_m: 0.023,
            rotor_height_m: 0.03,
        }
    }
}

impl Default for BatteryOptions {
    /// No capacity. The rest is the Crazyflie 2.1's 250 mAh battery, so that a capacity switches
    /// it on. Curve: firmware `pm_stm32f4.c` (0 to 90 %) and 4.20 V when full. Currents: Bitcraze's
    /// table of 2015 (firmware `docs/functional-areas/pwm-to-thrust.md`), 0.24 A at rest and 2.39 A
    /// at 32.8 g. Resistance: from the median drop of 0.57 V at take-off in 98 flights of `NanoBench`
    /// (arXiv 2603.09908) and the change of current. Thrust: firmware `platform_defaults_cf2.h`,
    /// legacy propellers. Cut-off: its critical voltage.
    fn default() -> Self {
        Self {
            capacity_ah: 0.0,
            charge_frac: 1.0,
            open_circuit_v: [3.00, 3.78, 3.83, 3.87, 3.89, 3.92, 3.96, 4.00, 4.04, 4.10, 4.20],
            resistance_ohm: 0.265,
            idle_current_a: 0.24,
            current_a_per_n: 6.68,
            thrust_from_v_n: [-0.014831, 0.047245, -0.018474, 0.005961],
            compensation: Compensation::Firmware,
            cut_off_v: 3.0,
        }
    }
}

impl Default for AirOptions {
    /// Still air. The size of the gusts, where they are switched on, is a room's: Zhang et al.,
    /// "Field measurements of boundary-layer flows in ventilated rooms" (ASHRAE Transactions),
    /// find a turbulent energy of up to 0.01 m²/s² in weakly turbulent flow, σ = √(2k/3) = 0.08 m/s,
    /// at mean speeds of 0.05 to 0.25 m/s; with eddies of 0.2 m that drift at 0.2 m/s, 1 s.
    ///
    /// The torque is what the motors of the reference flight paid for below 1 Hz, between take-off
    /// and landing, through the team's `k_F`, `k_M` and 35 mm: σ 1.12, 1.01 (less what goes with the
    /// speed in x) and 0.54e-4 N m about a mean of 1.35, 3.4 and −0.49e-4; its autocorrelation falls
    /// to 0.5, 0 and 0.5 after a second. A tenth is added for what lies above 1 Hz.
    fn default() -> Self {
        Self {
            wind_m_s: [0.0; 3],
            gusts: Gusts::None,
            gust_sigma_m_s: [0.08; 3],
            gust_time_s: 1.0,
            gust_torque_sigma_n_m: [1.2e-4, 1.1e-4, 5.5e-5],
            gust_torque_time_s: 1.5,
        }
    }
}

impl VehicleOptions {
    /// Checks every range, and that the motors can lift the drone.
    pub(in crate::sim) fn check(&self) -> Result<()> {
        within("vehicle.mass_kg", self.mass_kg, 1e-3, 100.0)?;
        within_all("vehicle.inertia_kg_m2", &self.inertia_kg_m2, 1e-8, 100.0)?;
        within("vehicle.k_f_n", self.k_f_n, 1e-9, 1.0)?;
        within("vehicle.k_m_n_m", self.k_m_n_m, 1e-12, 1.0)?;
        within("vehicle.arm_m", self.arm_m, 1e-3, 2.0)?;
        within("vehicle.motor_max", self.motor_max, 1.0, 65_535.0)?;
        within_all("vehicle.center_of_mass_m", &self.center_of_mass_m, -1.0, 1.0)?;
        within("vehicle.rotor_thrust_n_s2", self.rotor_thrust_n_s2, 1e-12, 1.0)?;
        within("vehicle.motor_rise_s", self.motor_rise_s, 0.0, 10.0)?;
        within("vehicle.motor_fall_s", self.motor_fall_s, 0.0, 10.0)?;
        within_all("vehicle.body_drag_n_s_m", &self.body_drag_n_s_m, 0.0, 10.0)?;
        within("vehicle.rotor_drag_n_s2_m", self.rotor_drag_n_s2_m, 0.0, 1e-2)?;
        within("vehicle.airspeed_moment_n_s", self.airspeed_moment_n_s, 0.0, 10.0)?;
        within("vehicle.rotor_inertia_kg_m2", self.rotor_inertia_kg_m2, 0.0, 1e-2)?;
        within("vehicle.rotor_radius_m", self.rotor_radius_m, 1e-3, 1.0)?;
        within("vehicle.rotor_height_m", self.rotor_height_m, 0.0, 2.0)?;
        let (lift_n, weight_n) = (4.0 * self.full_thrust_n(), self.mass_kg * GRAVITY_M_S2);
        if lift_n > weight_n {
            return Ok(());
        }
        Err(Error::Infeasible {
            what: format!("the motors lift {lift_n:.3} N, the drone weighs {weight_n:.3} N"),
            hint: "lower vehicle.mass_kg, or raise vehicle.k_f_n or vehicle.motor_max".into(),
        })
    }

    /// Thrust of one motor at its largest command.
    pub(super) fn full_thrust_n(&self) -> f64 {
        self.k_f_n * self.motor_max
    }
}

impl BatteryOptions {
    /// Open-circuit voltage at a share of the charge, 0 to 1.
    #[must_use]
    #[inline(always)]
    pub fn open_circuit_v(&self, charge_frac: f64) -> f64 {
        let tenths = charge_frac * 10.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 10")]
        let below = (tenths as usize).min(9);
        #[expect(clippy::cast_precision_loss, reason = "0 to 9")]
        let above = tenths - below as f64;
        let [low, high] = [self.open_circuit_v[below], self.open_circuit_v[below + 1]];
        low + (high - low) * above
    }

    /// Checks every range, and that more charge is more voltage.
    pub(in crate::sim) fn check(&self) -> Result<()> {
        within("battery.capacity_ah", self.capacity_ah, 0.0, 1000.0)?;
        within("battery.charge_frac", self.charge_frac, 0.0, 1.0)?;
        within_all("battery.open_circuit_v", &self.open_circuit_v, 0.1, 1000.0)?;
        within("battery.resistance_ohm", self.resistance_ohm, 0.0, 100.0)?;
        within("battery.idle_current_a", self.idle_current_a, 0.0, 1000.0)?;
        within("battery.current_a_per_n", self.current_a_per_n, 0.0, 1000.0)?;
        within_all("battery.thrust_from_v_n", &self.thrust_from_v_n, -1e3, 1e3)?;
        within("battery.cut_off_v", self.cut_off_v, 0.0, 1000.0)?;
        if self.open_circuit_v.is_sorted() {
            return Ok(());
        }
        Err(Error::input(
            "battery.open_circuit_v",
            format!("{:?}", self.open_circuit_v),
            "voltages that rise from 0 % to 100 % of charge",
            "write the voltage of the empty battery first",
        ))
    }
}

impl AirOptions {
    /// Checks every range.
    pub(in crate::sim) fn check(&self) -> Result<()> {
        within_all("air.wind_m_s", &self.wind_m_s, -50.0, 50.0)?;
        within_all("air.gust_sigma_m_s", &self.gust_sigma_m_s, 0.0, 50.0)?;
        within("air.gust_time_s", self.gust_time_s, 1e-2, 1e4)?;
        within_all("air.gust_torque_sigma_n_m", &self.gust_torque_sigma_n_m, 0.0, 10.0)?;
        within("air.gust_torque_time_s", self.gust_torque_time_s, 1e-2, 1e4)
    }
}
