//! Settings of a simulated flight. The default is the preset `ae483-2022`: the values of the
//! student team whose flight is the reference.

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
        /// Rates.
        rates: RateOptions = RateOptions::default();
        /// The drone.
        vehicle: VehicleOptions = VehicleOptions::default();
        /// Its battery.
        battery: BatteryOptions = BatteryOptions::default();
        /// The air around it.
        air: AirOptions = AirOptions::default();
        /// The floor below it.
        floor: FloorOptions = FloorOptions::default();
        /// The radio.
        radio: RadioOptions = RadioOptions::default();
        /// The controller: motor commands from the estimate.
        controller: ControllerOptions = ControllerOptions::default();
        /// The estimator: the estimate from the measurements.
        observer: ObserverOptions = ObserverOptions::default();
        /// The sensors.
        sensors: SensorOptions = SensorOptions::default();
    }

    /// Rates of a simulation.
    ///
    /// Default: the firmware's 500 Hz for the attitude and 100 Hz for the position
    /// (`stabilizer_types.h`, `ATTITUDE_RATE`, `POSITION_RATE`), the main loop at 500 Hz as the
    /// team's observer ran, and a log at half of it.
    pub struct RateOptions {
        /// Ticks per second of the main loop. Sensors and observer run at every tick.
        ///
        /// The firmware's runs at 1000.
        control_hz: u32 = 500, in 50.0..=2000.0;
        /// Motor commands per second. It divides `control_hz`, which also caps it. Motors hold
        /// their command in between.
        ///
        /// Regulators, and the attitude and rate loops of the cascade.
        attitude_hz: u32 = 500, in 50.0..=2000.0;
        /// Samples per second of the flight's log. It divides `control_hz`.
        log_hz: u32 = 250, in 1.0..=2000.0;
        fixed {
            /// Runs per second of the cascade's position and velocity loops. It divides
            /// `attitude_hz`, which also caps it.
            position_hz: u32 = 100;
            /// Runge-Kutta steps per control tick.
            ///
            /// The error of 1 (2 ms) is less than a micrometer.
            steps_per_tick: u32 = 1;
        }
    }

    /// The radio that carries setpoints and light commands. By default they arrive at once.
    ///
    /// A Crazyradio serves its drones in turn, each with its newest setpoint: 0.7 ms for a packet
    /// and its answer, and 2.5 ms to switch to another drone's address (`crazyradio2-firmware`
    /// issue 9). A packet without an answer is sent again in the next turn.
    ///
    /// Loss: 1 to 4 % with cflib (`crazyflie_ros` issue 73). Outages: when other senders fill the
    /// band. The log of the reference flight has gaps of up to 0.73 s in 59 s.
    pub struct RadioOptions {
        /// Drones that one radio serves. 0: every command arrives at once.
        drones: u32 = 0, in 0.0..=64.0;
        /// Fraction of packets that get no answer.
        loss_frac: f64 = 0.02, in 0.0..=1.0, for "radio.drones";
        /// Mean time from one outage to the next, exponential. 0: none.
        outage_every_s: f64 = 0.0, in 0.0..=1e5, for "radio.drones";
        /// Mean duration of an outage, exponential.
        outage_s: f64 = 0.1, in 0.0..=1e3, for "radio.outage_every_s";
        /// Source of the setpoints.
        setpoints: Setpoints = Setpoints::Streamed, for "radio.drones";
    }

    /// Source of setpoints.
    pub enum Setpoints {
        /// From the host, one after the other. Without them the firmware levels the drone out after
        /// 0.5 s and stops its motors after 2 s.
        "streamed" => Streamed,
        /// From a trajectory on board. Only light commands are late.
        "on-board" => OnBoard,
    }
}

impl SimOptions {
    /// Checks every range, that slower rates divide faster rates, that the motors can lift the
    /// drone, and that the sensors suit the estimator.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key as its place, [`Error::Infeasible`] for a drone too heavy for
    /// its motors.
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

    /// Options of the plant.
    pub fn plant(&self) -> PlantOptions<'_> {
        let Self { vehicle, battery, air, floor, .. } = self;
        PlantOptions { vehicle, battery, air, floor }
    }

    /// Largest command that the firmware gives a motor, or infinity with compensation of the
    /// battery, which then caps the thrust.
    pub(crate) fn most_command(&self) -> f64 {
        match self.battery.is_compensated() {
            true => f64::INFINITY,
            false => self.vehicle.motor_max,
        }
    }

    /// Hover throttle, 0 to 1, with which the altitude filter begins.
    pub fn believed_hover_throttle(&self) -> f64 {
        self.observer.altitude.hover_throttle.unwrap_or(self.vehicle.hover_throttle())
    }

    /// The options of an undisturbed flight: still air, centered mass, ideal sensors and radio.
    pub fn rehearsal(&self) -> Self {
        let mut options = self.clone();
        // The estimator of any other positioning need not take ideal positions.
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

    /// [`Self::rehearsal`] with the firmware's filter on ideal sweeps of its stations, since the
    /// filter's error by drag is the same in every flight. `None` for other estimators and sensors.
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
    /// Motor commands per second: `attitude_hz`, and no more than one a tick.
    pub fn attitude_hz(&self) -> u32 {
        self.attitude_hz.min(self.control_hz)
    }

    /// Runs per second of the position loop: `position_hz`, and no more than motor commands.
    pub fn position_hz(&self) -> u32 {
        self.position_hz.min(self.attitude_hz())
    }

    /// Checks that slower loops run at whole ticks of faster loops.
    fn check_ratios(&self) -> Result<()> {
        for (slow, slow_hz, fast, fast_hz) in [
            ("attitude_hz", self.attitude_hz, "control_hz", self.control_hz),
            ("attitude_hz", self.attitude_hz(), "position_hz", self.position_hz),
            ("log_hz", self.log_hz, "control_hz", self.control_hz),
        ] {
            // A loop that could run a whole number of times a tick runs once.
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

/// A simulated drone.
#[derive(Clone, Copy, Debug)]
pub struct Drone<'a> {
    /// The model that controller and estimator are designed for.
    pub believed: &'a SimOptions,
    /// The true body, motors, battery, air and sensors.
    pub actual: &'a SimOptions,
    /// Seed of all noise but the room's.
    pub seed: u64,
    /// Seed of the lasting errors of the room, in the poses of its stations and anchors. It is the
    /// same for all drones in one room.
    pub room_seed: u64,
    /// Index among the drones that fly together. Each index has different noise, in sensors and
    /// air.
    pub index: u64,
}

impl<'a> Drone<'a> {
    /// The drone of index 0, with a controller that is designed for it.
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
