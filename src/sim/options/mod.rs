//! Settings of a simulated flight. The default is the preset `ae483-2022`, with the values of the
//! student team that flew the reference flight.

mod controller;
#[cfg(test)]
mod drones;
mod observer;

pub use self::controller::{
    AltitudeHoldOptions, ControllerKind, ControllerOptions, GeometricOptions, Law, LqrOptions,
    MotorLag, PidOptions, SetpointKind,
};
pub use self::observer::{
    AltitudeOptions, CooperativeOptions, EkfOptions, EstimatorKind, FirmwareOptions,
    HorizontalForce, LuenbergerOptions, ObserverOptions, Share, SweepAttitude,
};
use crate::sensors::{Positioning, SensorOptions};
use crate::vehicle::{
    AirOptions, BatteryOptions, FloorOptions, Gusts, PlantOptions, VehicleOptions,
};
use noctograph_core::error::{Error, Result};
use noctograph_core::settings::{Described, settings};

settings! {
    /// Settings of a simulated flight.
    pub struct SimOptions {
        /// Rates of the simulation's loops.
        rates: RateOptions = RateOptions::default();
        /// Drone that is simulated.
        vehicle: VehicleOptions = VehicleOptions::default();
        /// Battery of the drone.
        battery: BatteryOptions = BatteryOptions::default();
        /// Air around the drone.
        air: AirOptions = AirOptions::default();
        /// Floor below the drone.
        floor: FloorOptions = FloorOptions::default();
        /// Radio between host and drone.
        radio: RadioOptions = RadioOptions::default();
        /// Controller, which computes motor commands from the estimate.
        controller: ControllerOptions = ControllerOptions::default();
        /// Estimator, which computes the estimate from the measurements.
        observer: ObserverOptions = ObserverOptions::default();
        /// Sensors of the drone.
        sensors: SensorOptions = SensorOptions::default();
    }

    /// Rates of a simulation.
    ///
    /// The defaults are the firmware's 500 Hz for the attitude and 100 Hz for the position
    /// (`stabilizer_types.h`, `ATTITUDE_RATE`, `POSITION_RATE`), 500 Hz for the main loop as in the
    /// team's observer, and half of that for the log.
    pub struct RateOptions {
        /// Number of ticks per second of the main loop. Sensors and observer run at every tick.
        ///
        /// The firmware's main loop runs at 1000 Hz.
        control_hz: u32 = 500, in 50.0..=2000.0;
        /// Number of motor commands per second. This rate must divide `control_hz`, and is limited
        /// to it. Motors hold their command between two updates.
        ///
        /// Regulators and the cascade's attitude and rate loops run at this rate.
        attitude_hz: u32 = 500, in 50.0..=2000.0;
        /// Number of samples per second in the flight's log. This rate must divide `control_hz`.
        log_hz: u32 = 250, in 1.0..=2000.0;
        fixed {
            /// Number of runs per second of the cascade's position and velocity loops. This rate
            /// must divide `attitude_hz`, and is limited to it.
            position_hz: u32 = 100;
            /// Number of Runge-Kutta steps per control tick.
            ///
            /// A single step (2 ms) causes an error of less than a micrometer.
            steps_per_tick: u32 = 1;
        }
    }

    /// The radio that transmits setpoints and light commands. By default, packets arrive
    /// immediately.
    ///
    /// A Crazyradio sends each drone its newest setpoint in turn. A packet and its acknowledgment
    /// take 0.7 ms, and switching to another drone's address takes 2.5 ms (`crazyradio2-firmware`
    /// issue 9). A packet without an acknowledgment is sent again in the next turn.
    ///
    /// The loss is 1 to 4 % with cflib (`crazyflie_ros` issue 73). Outages occur when other
    /// transmitters occupy the band. The 59 s log of the reference flight has gaps of up to 0.73 s.
    pub struct RadioOptions {
        /// Number of drones that one radio serves. With 0, every command arrives immediately.
        drones: u32 = 0, in 0.0..=64.0;
        /// Fraction of packets that receive no answer.
        loss_frac: f64 = 0.02, in 0.0..=1.0, for "radio.drones";
        /// Mean of the exponentially distributed time between outages. With 0, there are no
        /// outages.
        outage_every_s: f64 = 0.0, in 0.0..=1e5, for "radio.drones";
        /// Mean of the exponentially distributed duration of an outage.
        outage_s: f64 = 0.1, in 0.0..=1e3, for "radio.outage_every_s";
        /// Source of the setpoints.
        setpoints: Setpoints = Setpoints::Streamed, for "radio.drones";
    }

    /// Source of setpoints.
    pub enum Setpoints {
        /// From the host, one after the other. Without setpoints, the firmware levels the drone
        /// after 0.5 s and stops its motors after 2 s.
        "streamed" => Streamed,
        /// From an onboard trajectory. With an onboard trajectory, only light commands are delayed.
        "on-board" => OnBoard,
    }
}

impl SimOptions {
    /// Checks that all settings are within their ranges, that slower rates divide faster rates,
    /// that the motors can lift the drone, and that the sensors suit the estimator.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] with the key as its place, or [`Error::Infeasible`] for a drone
    /// that is too heavy for its motors.
    pub fn check(&self) -> Result<()> {
        Described::check(self, "", None)?;
        self.vehicle.check_lift()?;
        self.battery.check_curve()?;
        self.floor.check_steps()?;
        self.sensors.check_counts()?;
        self.sensors.check_silences()?;
        self.controller.check_gain(self.vehicle.motor_rise_s + self.vehicle.motor_fall_s > 0.0)?;
        self.observer.check_inputs(&self.sensors)?;
        self.rates.check_ratios()
    }

    /// Returns the options of the plant.
    pub fn plant(&self) -> PlantOptions<'_> {
        let Self { vehicle, battery, air, floor, .. } = self;
        PlantOptions { vehicle, battery, air, floor }
    }

    /// Returns the firmware's maximum motor command (65535 is full power), or infinity with battery
    /// compensation, which then limits the thrust.
    pub(crate) fn most_command(&self) -> f64 {
        if self.battery.is_compensated() { f64::INFINITY } else { self.vehicle.motor_max }
    }

    /// Returns the hover throttle, 0 to 1, with which the altitude filter begins.
    pub fn believed_hover_throttle(&self) -> f64 {
        self.observer.altitude.hover_throttle.unwrap_or(self.vehicle.hover_throttle())
    }

    /// Returns the options of an undisturbed flight with still air, centered mass, and ideal
    /// sensors and radio.
    pub fn rehearsal(&self) -> Self {
        let mut options = self.clone();
        // The estimator for another positioning system may not accept ideal positions.
        if options.sensors.positioning != Positioning::Position {
            options.observer.kind = EstimatorKind::Truth;
        }
        options.sensors = SensorOptions::ideal();
        options.air.gusts = Gusts::None;
        options.air.wind_m_s = [0.0; 3];
        options.vehicle.center_of_mass_m = [0.0; 2];
        options.radio = RadioOptions::default();
        options
    }

    /// Returns [`Self::rehearsal`] with the firmware's filter and ideal sweeps from the stations,
    /// because the filter's error due to drag is the same in every flight. Returns `None` for other
    /// estimators and sensors.
    pub fn rehearsal_by_filter(&self) -> Option<Self> {
        let positioning = self.sensors.positioning;
        (positioning.is_by_light() && self.observer.kind == EstimatorKind::Ekf).then(|| {
            let mut options = self.rehearsal();
            options.observer.kind = EstimatorKind::Ekf;
            options.sensors.positioning = positioning;
            options.sensors.lighthouse.stations = self.sensors.lighthouse.stations.clone();
            options
        })
    }
}

impl RateOptions {
    /// Returns the number of motor commands per second, `attitude_hz`, but at most one per tick.
    pub fn attitude_hz(&self) -> u32 {
        self.attitude_hz.min(self.control_hz)
    }

    /// Returns the number of runs per second of the position loop, which is `position_hz`, but at
    /// most one per motor command.
    pub fn position_hz(&self) -> u32 {
        self.position_hz.min(self.attitude_hz())
    }

    /// Checks that slower loops run at whole ticks of faster loops. Returns [`Error::Input`] with
    /// the key of the slower one.
    fn check_ratios(&self) -> Result<()> {
        for (slow, slow_hz, fast, fast_hz) in [
            ("attitude_hz", self.attitude_hz, "control_hz", self.control_hz),
            ("attitude_hz", self.attitude_hz(), "position_hz", self.position_hz),
            ("log_hz", self.log_hz, "control_hz", self.control_hz),
        ] {
            // A loop whose rate is a multiple of the tick rate runs once per tick.
            let is_capped = slow != "log_hz" && slow_hz.is_multiple_of(fast_hz);
            if !is_capped && !fast_hz.is_multiple_of(slow_hz) {
                let wanted = format!("a divisor or a multiple of {fast} = {fast_hz}");
                let hint = "the firmware runs its loops at 1000, 500 and 100 Hz";
                return Err(Error::input(format!("rates.{slow}"), slow_hz, wanted, hint));
            }
        }
        Ok(())
    }
}

/// Drone that is simulated.
#[derive(Clone, Copy, Debug)]
pub struct Drone<'a> {
    /// Assumed drone, for which controller and estimator are designed.
    pub believed: &'a SimOptions,
    /// Actual drone, with its body, motors, battery, air and sensors.
    pub actual: &'a SimOptions,
    /// Seed of all noise except that of the room.
    pub seed: u64,
    /// Seed of the room's permanent errors, such as those in the poses of stations and anchors. All
    /// drones in one room have the same seed.
    pub room_seed: u64,
    /// Index among the drones that fly together. Sensor noise and gusts differ between indices.
    pub index: u64,
}

impl<'a> Drone<'a> {
    /// Creates the drone with index 0, with a controller that is designed for it.
    pub fn new(options: &'a SimOptions, seed: u64) -> Self {
        Self { believed: options, actual: options, seed, room_seed: seed, index: 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_preset_passes_its_own_check() {
        SimOptions::default().check().unwrap();
    }

    #[test]
    fn a_refused_setting_is_named() {
        type Change = fn(&mut SimOptions);
        let cases: [(Change, &str); 11] = [
            (|o| o.vehicle.mass_kg = f64::NAN, "vehicle.mass_kg: "),
            (|o| o.controller.lqr.q[3] = -1.0, "controller.lqr.q[3]: "),
            (|o| o.observer.luenberger.r[7] = 0.0, "observer.luenberger.r[7]: "),
            (|o| o.rates.log_hz = 300, "rates.log_hz: "),
            (|o| o.rates.attitude_hz = 300, "rates.attitude_hz: "),
            (|o| o.rates.attitude_hz = 650, "rates.attitude_hz: "),
            (|o| o.controller.geometric.k_rate[2] = -1.0, "controller.geometric.k_rate[2]: "),
            (|o| o.controller.lqr.k = Some(vec![vec![0.0; 12]; 3]), "3 rows of 12, 12"),
            (|o| o.controller.lqr.k = Some(vec![vec![0.0; 15]; 4]), "12 numbers for lqr"),
            (|o| o.rates.log_hz = 0, "rates.log_hz: "),
            (|o| o.vehicle.mass_kg = 0.06, "weighs 0.589 N"),
        ];
        for (change, said) in cases {
            let mut options = SimOptions::default();
            change(&mut options);
            let error = options.check().unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn no_loop_runs_faster_than_the_one_that_calls_it() {
        let rates = RateOptions { control_hz: 250, ..Default::default() };
        assert_eq!((rates.attitude_hz(), rates.position_hz()), (250, 100));
        let slow = SimOptions { rates, ..Default::default() };
        assert!(slow.check().unwrap_err().to_string().starts_with("rates.attitude_hz"));
    }

    #[test]
    fn options_survive_a_file_and_refuse_unknown_keys() {
        let rates = RateOptions { log_hz: 100, ..RateOptions::default() };
        let options = SimOptions { rates, ..Default::default() };
        let text = serde_json::to_string(&options).unwrap();
        assert_eq!(serde_json::from_str::<SimOptions>(&text).unwrap(), options);
        assert_eq!(serde_json::from_str::<SimOptions>("{}").unwrap(), SimOptions::default());
        assert!(serde_json::from_str::<SimOptions>(r#"{"vehicle": {"mass": 1}}"#).is_err());
    }
}
