//! Settings of the drone, its battery and the air around it.

use nalgebra::Vector3;
use noctograph_core::crazyflie::Release;
use noctograph_core::error::{Error, Result};
use noctograph_core::settings::settings;

pub(super) use noctograph_core::crazyflie::GRAVITY_M_S2;

/// Steps of charge in which the time of a battery is measured.
const EMPTY_STEPS: u16 = 1000;

settings! {
    /// A quadrotor with its four motors at the corners of a square.
    ///
    /// The rigid body and the linear motors are the reference team's model. Everything from
    /// [`Self::rotor_thrust_n_s2`] on is switched off by 0 or "none", as it is in the default.
    ///
    /// Default: the team's pendulum tests and fits. The center of mass explains the mean motor
    /// commands and the steady position error of their flight: (−1.3e-4, −3.3e-4, 0) N m at hover.
    /// Rotors: Bitcraze's fit of 2015 to a Crazyflie 2.0, 2.68e-10 N/rpm² a motor (firmware
    /// `docs/functional-areas/pwm-to-thrust.md`). Propellers of radius 23 mm, 30 mm above the floor
    /// (constants of the ground-effect module in `XinLong-Li/cf-frimware-2022-12`).
    pub struct VehicleOptions {
        /// Release of the Crazyflie's firmware, with or without the number of a patch.
        firmware: Release = Release::MODELED;
        /// Mass with battery and decks.
        mass_kg: f64 = 0.0351, in 1e-3..=100.0;
        /// Principal moments of inertia about body x, y, z.
        inertia_kg_m2: [f64; 3] = [1.24e-5, 1.27e-5, 3.32e-5], in 1e-8..=100.0;
        /// Thrust of one motor per unit of its command.
        k_f_n: f64 = 1.95e-6, in 1e-9..=1.0;
        /// Reaction torque of one motor about body z per unit of its command.
        k_m_n_m: f64 = 7.47e-9, in 1e-12..=1.0;
        /// Half the side of the square of motors: lever of the thrust about body x and y.
        arm_m: f64 = 0.035, in 1e-3..=2.0;
        /// Center of mass in body x and y, from the middle of the motors.
        ///
        /// The thrust turns the drone about it, and a controller without integral action pays with
        /// a constant position error.
        center_of_mass_m: [f64; 2] = [-0.958e-3, 0.378e-3], in -1.0..=1.0;
        /// Thrust of one rotor per square of its speed, N/(rad/s)², for lag, rotor drag and
        /// gyroscopic torque.
        rotor_thrust_n_s2: f64 = 2.444e-8, in 1e-12..=1.0;
        /// Time constant of a rising rotor speed. 0: no lag.
        ///
        /// Too much makes a firm attitude controller oscillate.
        motor_rise_s: f64 = 0.0, in 0.0..=10.0;
        /// Time constant of a falling rotor speed. 0: no lag.
        motor_fall_s: f64 = 0.0, in 0.0..=10.0;
        /// Drag of the body per airspeed along body x, y, z, N/(m/s).
        body_drag_n_s_m: [f64; 3] = [0.0; 3], in 0.0..=10.0;
        /// Drag of one rotor across its axis per airspeed and rotor speed, N/((m/s)(rad/s)).
        ///
        /// The H-force of blade element theory, linear as in `RotorS` (Furrer et al. 2016).
        rotor_drag_n_s2_m: f64 = 0.0, in 0.0..=1e-2;
        /// Moment of the air about body x and y per airspeed across the rotors' axes, N m/(m/s).
        ///
        /// The side of a rotor that moves into the air lifts more than the other, and its drag acts
        /// above the center of mass, so that the drone pitches up against its motion (speed
        /// stability: Pounds, Mahony, Corke, "Modelling and control of a large quadrotor robot",
        /// 2010). A regulator without integral action trails by more. 4.7e-4 in the log of the
        /// reference flight, from the slow part of its pitch torque against its speed in x (of σ
        /// 0.8e-4 N m, 0.6e-4 remains).
        airspeed_moment_n_s: f64 = 0.0, in 0.0..=10.0;
        /// Moment of inertia of one rotor with the turning part of its motor, about its axis.
        ///
        /// Causes the gyroscopic torque, and the yaw torque of a rotor that speeds up.
        rotor_inertia_kg_m2: f64 = 0.0, in 0.0..=1e-2;
        /// Fraction of its thrust that each motor m1…m4 lacks at every command: a nicked propeller,
        /// a worn motor.
        motor_loss_frac: [f64; 4] = [0.0; 4], in 0.0..=1.0;
        /// Ground effect: thrust near the floor over thrust far from it, at the same rotor speed.
        ground_effect: GroundEffect = GroundEffect::None;
        /// Radius of a propeller, for the ground effect.
        rotor_radius_m: f64 = 0.023, in 1e-3..=1.0, unless "vehicle.ground_effect" = "none";
        /// Height of the propellers above the floor when the drone is on it.
        rotor_height_m: f64 = 0.03, in 0.0..=2.0, unless "vehicle.ground_effect" = "none";
        fixed {
            /// Largest motor command. The smallest is 0.
            motor_max: f64 = 65_535.0;
        }
    }

    /// A model of the ground effect: thrust near the floor over thrust far from it, at the same
    /// rotor speed.
    pub enum GroundEffect {
        /// No ground effect.
        "none" => None,
        /// One rotor and its image: `1 / (1 − (R/4z)²)`.
        ///
        /// Cheeseman, Bennett: The effect of the ground on a helicopter rotor in forward flight,
        /// ARC R&M 3021, 1955.
        "cheeseman-bennett" => CheesemanBennett,
        /// Four rotors and their images.
        ///
        /// The denominator above less `R² z / (d² + 4z²)^1.5 + R² z / 2(2d² + 4z²)^1.5`, d the
        /// distance of neighbors. Sanchez-Cuevas, Heredia, Ollero: Characterization of the
        /// aerodynamic ground effect and its influence in multirotor control, Int. J. Aerospace
        /// Eng. 2017, 1823056, without the body's fountain, whose coefficient they fitted to a far
        /// larger drone.
        "sanchez-cuevas" => SanchezCuevas,
    }

    /// A lithium-polymer battery. The default has no capacity: a voltage that never sags.
    ///
    /// The other defaults are the Crazyflie 2.1's 250 mAh battery, so that a capacity switches it
    /// on. Curve: firmware `pm_stm32f4.c` (0 to 90 %) and 4.20 V when full. Currents: Bitcraze's
    /// table of 2015 (firmware `docs/functional-areas/pwm-to-thrust.md`), 0.24 A at rest and 2.39 A
    /// at 32.8 g. Resistance: from the median drop of 0.57 V at take-off in 98 flights of
    /// `NanoBench` (arXiv 2603.09908) and the change of current. Thrust: firmware
    /// `platform_defaults_cf2.h`, legacy propellers. Cut-off: its critical voltage, and five
    /// seconds (`pm.h`).
    pub struct BatteryOptions {
        /// Charge of a full battery, A h. 0: no battery, full thrust at all times.
        capacity_ah: f64 = 0.0, in 0.0..=1000.0;
        /// Charge at the start, as a fraction of the full battery's.
        charge_frac: f64 = 1.0, in 0.0..=1.0;
        /// Open-circuit voltage at 0 %, 10 % … 100 % of charge.
        open_circuit_v: [f64; 11] =
            [3.00, 3.78, 3.83, 3.87, 3.89, 3.92, 3.96, 4.00, 4.04, 4.10, 4.20], in 0.1..=1000.0;
        /// Resistance of battery, plug and wires together.
        resistance_ohm: f64 = 0.265, in 0.0..=100.0;
        /// Current with the motors off: electronics, decks, lamps.
        idle_current_a: f64 = 0.24, in 0.0..=1000.0;
        /// Current of all motors per thrust of all motors, A/N.
        current_a_per_n: f64 = 6.68, in 0.0..=1000.0;
        /// Largest thrust of one motor at a voltage v: `t₀ + t₁v + t₂v² + t₃v³`, N.
        thrust_from_v_n: [f64; 4] = [-0.014831, 0.047245, -0.018474, 0.005961], in -1e3..=1e3;
        /// Compensation of a falling voltage by the firmware.
        compensation: Compensation = Compensation::Firmware;
        /// Thrust below which the firmware's compensation stops a motor, N.
        least_thrust_n: f64 = 0.0, in 0.0..=1e3, for "battery.compensation" = "firmware";
        /// Least duty cycle of an armed motor in the air, as a fraction of full duty.
        idle_frac: f64 = 0.0, in 0.0..=1.0, for "battery.compensation" = "firmware";
        /// Voltage under load below which, after 5 s, the motors stop for good. 0: never.
        cut_off_v: f64 = 3.0, in 0.0..=1000.0;
    }

    /// Compensation of a falling battery voltage by the firmware.
    pub enum Compensation {
        /// A command is a thrust: the duty cycle rises as the voltage falls. If one motor's is
        /// full, all four are lowered by the same amount: attitude has priority over thrust. The
        /// controllers `pid` and `geometric` may thus command more than `vehicle.motor_max`, which
        /// a full battery gives.
        ///
        /// Crazyflie: `motorsCompensateBatteryVoltage`, firmware `motors.c`, and
        /// `powerDistributionCap`, `power_distribution_quadrotor.c`.
        "firmware" => Firmware,
        /// A command is a fraction of the thrust that the motor gives at the present voltage.
        "none" => None,
    }

    /// Wind and gusts. The default is still air.
    pub struct AirOptions {
        /// Steady wind, world frame.
        wind_m_s: [f64; 3] = [0.0; 3], in -50.0..=50.0;
        /// Gusts on top of the wind. They push the drone through its drag.
        gusts: Gusts = Gusts::None;
        /// Thrust loss of a drone below another drone.
        downwash: Downwash = Downwash::Jet, unless "plan.drones" = "1";
    }

    /// A model of the stream of air below a drone.
    pub enum Downwash {
        /// No effect of drones on each other.
        "none" => None,
        /// A round jet that slows down and spreads. On its axis a Crazyflie loses 7.6 g of thrust
        /// at 0.3 m, 4.2 g at 0.5 m and 2 g at 1 m.
        ///
        /// Shi, Hönig, Yue, Chung: Neural-Swarm (arXiv 2003.02992), up to 0.5 m.
        "jet" => Jet,
    }

    /// A model of gusts.
    pub enum Gusts tagged {
        /// No gusts.
        "none" => None,
        /// Indoors: each axis an Ornstein-Uhlenbeck process.
        ///
        /// Density `4σ²τ / (1 + ω²τ²)` per Hz (Uhlenbeck, Ornstein 1930).
        "ornstein-uhlenbeck" => OrnsteinUhlenbeck(GustOptions),
        /// Outdoors: Dryden's spectra at low altitude. Without wind there are no gusts.
        ///
        /// MIL-F-8785C (1980), at 10 ft and below, from the level part of the steady wind, which
        /// counts as the wind at 20 ft and carries the gusts past the drone.
        "dryden" => Dryden,
    }

    /// Gusts of a room.
    ///
    /// Default push: Zhang et al., "Field measurements of boundary-layer flows in ventilated rooms"
    /// (ASHRAE Transactions), find a turbulent energy of up to 0.01 m²/s² in weakly turbulent flow,
    /// σ = √(2k/3) = 0.08 m/s, at mean speeds of 0.05 to 0.25 m/s. Eddies of 0.2 m that drift at
    /// 0.2 m/s pass in 1 s.
    ///
    /// Default torque: that of the motors of the reference flight below 1 Hz, between take-off and
    /// landing, through the team's `k_F`, `k_M` and 35 mm: σ 1.12, 1.01 (less the part that goes
    /// with the speed in x) and 0.54e-4 N m about a mean of 1.35, 3.4 and −0.49e-4. Its
    /// autocorrelation falls to 0.5, 0 and 0.5 after a second. A tenth is added for the part above
    /// 1 Hz.
    pub struct GustOptions {
        /// Standard deviation along world x, y, z. Their torque grows with it.
        sigma_m_s: [f64; 3] = [0.08; 3], in 0.0..=50.0;
        /// Correlation time: the size of an eddy over the speed at which it drifts past.
        time_s: f64 = 1.0, in 1e-2..=1e4;
        fixed {
            /// Standard deviation of the torque of uneven air and rotors about body x, y, z for a
            /// sigma_m_s of 0.08 along each axis.
            ///
            /// In a room it moves a regulator without integral action more than the push does.
            torque_sigma_n_m: [f64; 3] = [1.2e-4, 1.1e-4, 5.5e-5];
        }
    }
}

impl GustOptions {
    /// Strength relative to the gusts of a default room.
    pub(crate) fn relative_strength(&self) -> f64 {
        let room = Self::default();
        Vector3::from(self.sigma_m_s).norm() / Vector3::from(room.sigma_m_s).norm()
    }
}

impl VehicleOptions {
    /// Checks that the motors can lift the drone.
    pub(crate) fn check_lift(&self) -> Result<()> {
        let (lift_n, weight_n) = (4.0 * self.full_thrust_n(), self.mass_kg * GRAVITY_M_S2);
        if lift_n > weight_n {
            return Ok(());
        }
        Err(Error::infeasible(
            format!("the motors lift {lift_n:.3} N, the drone weighs {weight_n:.3} N"),
            "lower vehicle.mass_kg, or raise vehicle.k_f_n",
        ))
    }

    /// Fraction of the motors' largest command that carries the drone.
    pub fn hover_throttle(&self) -> f64 {
        self.mass_kg * GRAVITY_M_S2 / (4.0 * self.full_thrust_n())
    }

    /// Thrust of one motor at its largest command.
    pub(crate) fn full_thrust_n(&self) -> f64 {
        self.k_f_n * self.motor_max
    }
}

impl Gusts {
    /// Gusts of a ventilated room.
    pub fn room() -> Self {
        Self::OrnsteinUhlenbeck(GustOptions::default())
    }
}

impl BatteryOptions {
    /// True if the firmware compensates a falling battery voltage.
    pub(crate) fn is_compensated(&self) -> bool {
        self.capacity_ah > 0.0 && self.compensation == Compensation::Firmware
    }

    /// Open-circuit voltage at a fraction of the charge, 0 to 1.
    #[inline(always)]
    pub fn open_circuit_v(&self, charge_frac: f64) -> f64 {
        // Linear between the two tenths around it.
        let tenths = charge_frac * 10.0;
        #[expect(clippy::cast_possible_truncation, reason = "0 to 10")]
        let below = (tenths as usize).min(9);
        let fraction = tenths - below as f64;
        let [low, high] = [self.open_circuit_v[below], self.open_circuit_v[below + 1]];
        low + (high - low) * fraction
    }

    /// Time until the battery falls to its cut-off under a total thrust of all rotors. `None`
    /// without a battery.
    pub fn lasts_s(&self, thrust_n: f64) -> Option<f64> {
        let current_a = self.idle_current_a + self.current_a_per_n * thrust_n;
        let least_v = self.cut_off_v + self.resistance_ohm * current_a;
        let mut fracs = (0..=EMPTY_STEPS).map(|step| f64::from(step) / f64::from(EMPTY_STEPS));
        let empty_frac = fracs.find(|frac| self.open_circuit_v(*frac) >= least_v).unwrap_or(1.0);
        let charge_a_s = 3600.0 * self.capacity_ah * (self.charge_frac - empty_frac).max(0.0);
        (self.capacity_ah > 0.0).then(|| charge_a_s / current_a)
    }

    /// Checks that the open-circuit voltage rises with the charge.
    pub(crate) fn check_curve(&self) -> Result<()> {
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
