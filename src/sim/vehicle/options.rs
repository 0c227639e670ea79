//! Settings of the drone, its battery and the air around it.

use super::battery::SECONDS_PER_HOUR;
use nalgebra::Vector3;
use noctograph_core::crazyflie::{N_MOTORS, Release};
use noctograph_core::error::{Error, Result};
use noctograph_core::settings::settings;

pub(super) use noctograph_core::crazyflie::GRAVITY_M_S2;

/// Number of steps in the search for the charge at which a battery is empty.
const EMPTY_STEPS: u16 = 1000;

settings! {
    /// A quadrotor with its four motors at the corners of a square.
    ///
    /// The rigid body and the linear motors follow the reference team's model. By default, every
    /// effect from [`Self::rotor_thrust_n_s2`] on is disabled by a value of 0 or "none".
    ///
    /// The defaults are from the team's pendulum tests and fits. The center of mass explains the
    /// mean motor commands and the constant position error in their flight, with a torque of
    /// (−1.3e-4, −3.3e-4, 0) N m at hover. The rotor thrust is from Bitcraze's 2015 fit to a
    /// Crazyflie 2.0, 2.68e-10 N/rpm² per motor (firmware
    /// `docs/functional-areas/pwm-to-thrust.md`). The propellers have a radius of 23 mm and are 30
    /// mm above the floor (constants of the ground-effect module in
    /// `XinLong-Li/cf-frimware-2022-12`).
    pub struct VehicleOptions {
        /// Release of the Crazyflie's firmware, with or without the patch number.
        firmware: Release = Release::MODELED;
        /// Mass including battery and decks.
        mass_kg: f64 = 0.0351, in 1e-3..=100.0;
        /// Principal moments of inertia about body x, y, z.
        inertia_kg_m2: [f64; 3] = [1.24e-5, 1.27e-5, 3.32e-5], in 1e-8..=100.0;
        /// Thrust of one motor per unit of its command.
        k_f_n: f64 = 1.95e-6, in 1e-9..=1.0;
        /// Reaction torque of one motor about body z per unit of its command.
        k_m_n_m: f64 = 7.47e-9, in 1e-12..=1.0;
        /// Half the side of the square of motors, which is the lever arm of the thrust about body x
        /// and y.
        arm_m: f64 = 0.035, in 1e-3..=2.0;
        /// Position of the center of mass in body x and y, relative to the middle of the motors.
        ///
        /// The thrust exerts a torque about the center of mass. Without integral action in the
        /// controller, this causes a constant position error.
        center_of_mass_m: [f64; 2] = [-0.958e-3, 0.378e-3], in -1.0..=1.0;
        /// Thrust of one rotor per squared speed in N/(rad/s)², for lag, rotor drag and gyroscopic
        /// torque.
        rotor_thrust_n_s2: f64 = 2.444e-8, in 1e-12..=1.0;
        /// Time constant of an increasing rotor speed. A value of 0 means no lag.
        ///
        /// If the value is too large, a stiff attitude controller oscillates.
        motor_rise_s: f64 = 0.0, in 0.0..=10.0;
        /// Time constant of a decreasing rotor speed. A value of 0 means no lag.
        motor_fall_s: f64 = 0.0, in 0.0..=10.0;
        /// Drag of the body per airspeed along body x, y, z in N/(m/s).
        body_drag_n_s_m: [f64; 3] = [0.0; 3], in 0.0..=10.0;
        /// Drag of one rotor across its axis per airspeed and rotor speed in N/((m/s)(rad/s)).
        ///
        /// This is the H-force of blade element theory, linear as in `RotorS` (Furrer et al. 2016).
        rotor_drag_n_s2_m: f64 = 0.0, in 0.0..=1e-2;
        /// Moment of the air about body x and y per airspeed across the rotors' axes in N m/(m/s).
        ///
        /// The side of a rotor that moves into the air provides more lift than the other, and the
        /// rotor's drag acts above the center of mass. The drone therefore pitches up against its
        /// motion (speed stability: Pounds, Mahony, Corke, "Modelling and control of a large
        /// quadrotor robot", 2010). This moment increases the lag of a regulator without integral
        /// action. In the reference flight's log, a fit of the slow pitch torque to the speed in x
        /// gives 4.7e-4, and reduces the torque's σ from 0.8e-4 to 0.6e-4 N m.
        airspeed_moment_n_s: f64 = 0.0, in 0.0..=10.0;
        /// Moment of inertia of one rotor with the rotating part of its motor, about its axis.
        ///
        /// It determines the gyroscopic torque, and the yaw torque of a rotor that speeds up.
        rotor_inertia_kg_m2: f64 = 0.0, in 0.0..=1e-2;
        /// Fraction of the thrust that each motor m1…m4 lacks at every command, because of a
        /// damaged propeller or a worn motor.
        motor_loss_frac: [f64; 4] = [0.0; 4], in 0.0..=1.0;
        /// Model of the ground effect, which is the ratio of thrust near the floor to thrust far
        /// from the floor at the same rotor speed.
        ground_effect: GroundEffect = GroundEffect::None;
        /// Radius of a propeller, for the ground effect.
        rotor_radius_m: f64 = 0.023, in 1e-3..=1.0, unless "vehicle.ground_effect" = "none";
        /// Height of the propellers above the floor when the drone is on it.
        rotor_height_m: f64 = 0.03, in 0.0..=2.0, unless "vehicle.ground_effect" = "none";
        fixed {
            /// Maximum motor command. The minimum is 0.
            motor_max: f64 = 65_535.0;
        }
    }

    /// A model of the ground effect, the ratio of thrust near the floor to thrust far from it, at
    /// the same rotor speed.
    pub enum GroundEffect {
        /// No ground effect.
        "none" => None,
        /// One rotor and its mirror image, `1 / (1 − (R/4z)²)`.
        ///
        /// Source: Cheeseman, Bennett: The effect of the ground on a helicopter rotor in forward
        /// flight, ARC R&M 3021, 1955.
        "cheeseman-bennett" => CheesemanBennett,
        /// Four rotors and their mirror images.
        ///
        /// The denominator is that of `cheeseman-bennett` minus `R² z / (d² + 4z²)^1.5 + R² z /
        /// 2(2d² + 4z²)^1.5`, where d is the distance between neighbors. Sanchez-Cuevas, Heredia,
        /// Ollero: Characterization of the aerodynamic ground effect and its influence in
        /// multirotor control, Int. J. Aerospace Eng. 2017, 1823056, without the fountain effect on
        /// the body, whose coefficient they fitted to a far larger drone.
        "sanchez-cuevas" => SanchezCuevas,
    }

    /// A lithium-polymer battery. By default, it has no capacity, and the voltage never sags.
    ///
    /// The other defaults are those of the Crazyflie 2.1's 250 mAh battery, which is enabled by
    /// setting a capacity. The voltage curve is from the firmware's `pm_stm32f4.c` (0 to 90 %),
    /// with 4.20 V at full charge. The currents are from Bitcraze's 2015 table (firmware
    /// `docs/functional-areas/pwm-to-thrust.md`), 0.24 A at rest and 2.39 A at 32.8 g. The
    /// resistance is the ratio of the median voltage drop at take-off, 0.57 V in 98 flights of
    /// `NanoBench` (arXiv 2603.09908), to the change in current. The thrust is that of legacy
    /// propellers in the firmware's `platform_defaults_cf2.h`. The cut-off occurs after five
    /// seconds below the firmware's critical voltage (`pm.h`).
    pub struct BatteryOptions {
        /// Charge of a full battery in A h. A value of 0 means no battery and full thrust at all
        /// times.
        capacity_ah: f64 = 0.0, in 0.0..=1000.0;
        /// Charge at the start, as a fraction of full charge.
        charge_frac: f64 = 1.0, in 0.0..=1.0;
        /// Open-circuit voltage at 0 %, 10 % … 100 % of charge.
        open_circuit_v: [f64; 11] =
            [3.00, 3.78, 3.83, 3.87, 3.89, 3.92, 3.96, 4.00, 4.04, 4.10, 4.20], in 0.1..=1000.0;
        /// Combined resistance of battery, plug and wires.
        resistance_ohm: f64 = 0.265, in 0.0..=100.0;
        /// Current with the motors off, through electronics, decks and lamps.
        idle_current_a: f64 = 0.24, in 0.0..=1000.0;
        /// Total current of all motors per total thrust in A/N.
        current_a_per_n: f64 = 6.68, in 0.0..=1000.0;
        /// Coefficients of the maximum thrust of one motor at a voltage v, `t₀ + t₁v + t₂v² +
        /// t₃v³`, in N.
        thrust_from_v_n: [f64; 4] = [-0.014831, 0.047245, -0.018474, 0.005961], in -1e3..=1e3;
        /// Compensation by the firmware for a decreasing voltage.
        compensation: Compensation = Compensation::Firmware;
        /// Thrust in N below which the firmware's compensation stops a motor.
        least_thrust_n: f64 = 0.0, in 0.0..=1e3, for "battery.compensation" = "firmware";
        /// Minimum duty cycle of an armed motor in the air, as a fraction of full duty.
        idle_frac: f64 = 0.0, in 0.0..=1.0, for "battery.compensation" = "firmware";
        /// Voltage under load below which, after 5 s, the motors stop permanently. A value of 0
        /// means that they never stop.
        cut_off_v: f64 = 3.0, in 0.0..=1000.0;
    }

    /// Compensation by the firmware for a decreasing battery voltage.
    pub enum Compensation {
        /// A command stands for a thrust, so that the duty cycle increases as the voltage
        /// decreases. If the duty cycle of one motor is full, all four are lowered by the same
        /// amount, which gives attitude priority over thrust. The controllers `pid` and `geometric`
        /// may therefore command more than `vehicle.motor_max`, because a full battery can provide
        /// more thrust.
        ///
        /// Source: `motorsCompensateBatteryVoltage`, firmware `motors.c`, and
        /// `powerDistributionCap`, `power_distribution_quadrotor.c`.
        "firmware" => Firmware,
        /// A command stands for a fraction of the motor's thrust at the present voltage.
        "none" => None,
    }

    /// Wind and gusts. The default is still air.
    pub struct AirOptions {
        /// Steady wind in the world frame.
        wind_m_s: [f64; 3] = [0.0; 3], in -50.0..=50.0;
        /// Gusts in addition to the steady wind. Gusts act on the drone through its drag.
        gusts: Gusts = Gusts::None;
        /// Thrust loss of a drone that flies below another drone.
        downwash: Downwash = Downwash::Jet, unless "plan.drones" = "1";
    }

    /// A model of the stream of air below a drone.
    pub enum Downwash {
        /// No effect of drones on each other.
        "none" => None,
        /// A round jet that slows down and spreads. On its axis, a Crazyflie loses 7.6 g of thrust
        /// at 0.3 m, 4.2 g at 0.5 m and 2 g at 1 m.
        ///
        /// Source: Shi, Hönig, Yue, Chung: Neural-Swarm (arXiv 2003.02992), up to 0.5 m.
        "jet" => Jet,
    }

    /// A model of gusts.
    pub enum Gusts tagged {
        /// No gusts.
        "none" => None,
        /// Indoor gusts, which are an Ornstein-Uhlenbeck process for each axis.
        ///
        /// The density is `4σ²τ / (1 + ω²τ²)` per Hz (Uhlenbeck, Ornstein 1930).
        "ornstein-uhlenbeck" => OrnsteinUhlenbeck(GustOptions),
        /// Outdoor gusts with Dryden's spectra at low altitude. Without wind, there are no gusts.
        ///
        /// The spectra are those of MIL-F-8785C (1980) at 10 ft and below, for the horizontal part
        /// of the steady wind, which is taken as the wind at 20 ft and carries the gusts past the
        /// drone.
        "dryden" => Dryden,
    }

    /// Gusts in a room.
    ///
    /// The default wind follows Zhang et al., "Field measurements of boundary-layer flows in
    /// ventilated rooms" (ASHRAE Transactions). In weakly turbulent flow at mean speeds of 0.05 to
    /// 0.25 m/s, they found a turbulent energy k of up to 0.01 m²/s², that is, σ = √(2k/3) = 0.08
    /// m/s. Eddies of 0.2 m that drift at 0.2 m/s pass in 1 s.
    ///
    /// The default torque is the airborne motor torque in the reference flight below 1 Hz, computed
    /// with the team's `k_F`, `k_M` and arm of 35 mm. About x, y and z, its σ is 1.12, 1.01
    /// (without the part due to the speed in x) and 0.54e-4 N m, its mean 1.35, 3.4 and −0.49e-4 N
    /// m, and its autocorrelation after a second 0.5, 0 and 0.5. A tenth is added for the part
    /// above 1 Hz.
    pub struct GustOptions {
        /// Standard deviation of the wind speed along world x, y, z. The torque increases in
        /// proportion.
        sigma_m_s: [f64; 3] = [0.08; 3], in 0.0..=50.0;
        /// Correlation time, which is the size of an eddy divided by the speed at which it drifts
        /// past.
        time_s: f64 = 1.0, in 1e-2..=1e4;
        fixed {
            /// Standard deviation of the torque in N m about body x, y, z from uneven air and
            /// rotors, for a sigma_m_s of 0.08 along each axis.
            ///
            /// In a room, this torque moves a drone whose regulator has no integral action more
            /// than the wind does.
            torque_sigma_n_m: [f64; 3] = [1.2e-4, 1.1e-4, 5.5e-5];
        }
    }
}

impl GustOptions {
    /// Returns the strength of the gusts relative to those of the default room.
    pub(crate) fn relative_strength(&self) -> f64 {
        let room = Self::default();
        Vector3::from(self.sigma_m_s).norm() / Vector3::from(room.sigma_m_s).norm()
    }
}

impl VehicleOptions {
    /// Checks that the motors can lift the drone. Returns [`Error::Infeasible`] with both forces if
    /// they cannot.
    pub(crate) fn check_lift(&self) -> Result<()> {
        let (lift_n, weight_n) = (N_MOTORS * self.full_thrust_n(), self.mass_kg * GRAVITY_M_S2);
        if lift_n > weight_n {
            return Ok(());
        }
        Err(Error::infeasible(
            format!("the motors lift {lift_n:.3} N, but the drone weighs {weight_n:.3} N"),
            "lower vehicle.mass_kg, or raise vehicle.k_f_n",
        ))
    }

    /// Returns the fraction of the motors' maximum command at which the drone hovers.
    pub fn hover_throttle(&self) -> f64 {
        self.mass_kg * GRAVITY_M_S2 / (N_MOTORS * self.full_thrust_n())
    }

    /// Returns the thrust of one motor at its maximum command in N.
    pub(crate) fn full_thrust_n(&self) -> f64 {
        self.k_f_n * self.motor_max
    }
}

impl Gusts {
    /// Returns the gusts of a ventilated room.
    pub fn room() -> Self {
        Self::OrnsteinUhlenbeck(GustOptions::default())
    }
}

impl BatteryOptions {
    /// True if the firmware compensates for a decreasing battery voltage.
    pub(crate) fn is_compensated(&self) -> bool {
        self.capacity_ah > 0.0 && self.compensation == Compensation::Firmware
    }

    /// Returns the open-circuit voltage in V at a fraction of the charge, 0 to 1.
    #[inline(always)]
    pub fn open_circuit_v(&self, charge_frac: f64) -> f64 {
        // The voltage is interpolated linearly between the two nearest tenths.
        let tenths = charge_frac * 10.0;
        #[expect(clippy::cast_possible_truncation, reason = "0 to 10")]
        let below = (tenths as usize).min(9);
        let fraction = tenths - below as f64;
        let [low, high] = [self.open_circuit_v[below], self.open_circuit_v[below + 1]];
        low + (high - low) * fraction
    }

    /// Returns the time in s until the battery's voltage falls to the cut-off at a constant total
    /// thrust of all rotors. Returns `None` without a battery.
    pub fn lasts_s(&self, thrust_n: f64) -> Option<f64> {
        let current_a = self.idle_current_a + self.current_a_per_n * thrust_n;
        let least_v = self.cut_off_v + self.resistance_ohm * current_a;
        let mut fracs = (0..=EMPTY_STEPS).map(|step| f64::from(step) / f64::from(EMPTY_STEPS));
        let empty_frac = fracs.find(|frac| self.open_circuit_v(*frac) >= least_v).unwrap_or(1.0);
        let charged_frac = (self.charge_frac - empty_frac).max(0.0);
        let charge_a_s = SECONDS_PER_HOUR * self.capacity_ah * charged_frac;
        (self.capacity_ah > 0.0).then(|| charge_a_s / current_a)
    }

    /// Checks that the open-circuit voltage increases with the charge.
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
