//! Settings of a simulated flight. The default is the preset `ae483-2022`: the values of the
//! student team whose flight is the reference.

mod altitude;
mod controller;
#[cfg(test)]
mod drones;
mod observer;
mod radio;

pub use self::altitude::AltitudeOptions;
pub use self::controller::{
    AltitudeHoldOptions, ControllerKind, ControllerOptions, GeometricOptions, LqrOptions, MotorLag,
    PidOptions, SetpointKind,
};
pub use self::observer::{
    CooperativeOptions, EkfOptions, EstimatorKind, FirmwareOptions, HorizontalForce,
    LuenbergerOptions, ObserverOptions, Share, SweepAttitude,
};
pub use self::radio::{RadioOptions, Setpoints};
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
        /// Ticks per second of the main loop: sensors and observer run at every one.
        ///
        /// The firmware's runs at 1000.
        control_hz: u32 = 500, in 50.0..=2000.0;
        /// Motor commands per second; divides `control_hz`, which also caps it. Motors hold their
        /// command in between.
        ///
        /// Regulators, and the attitude and rate loops of the cascade.
        attitude_hz: u32 = 500, in 50.0..=2000.0;
        /// Runs per second of the cascade's position and velocity loops; divides `attitude_hz`,
        /// which also caps it.
        position_hz: u32 = 100, in 10.0..=2000.0, for "controller.kind" = "pid";
        /// Samples per second of the flight's log; divides `control_hz`.
        log_hz: u32 = 250, in 1.0..=2000.0;
        /// Runge-Kutta steps per control tick.
        ///
        /// The error of 1 (2 ms) is less than a micrometer.
        steps_per_tick: u32 = 1, in 1.0..=100.0;
    }
}

impl SimOptions {
    /// Checks every range, that slower rates divide faster ones, that the motors can lift the
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
        self.controller.check_gain()?;
        self.observer.check_inputs(&self.sensors)?;
        self.rates.check_ratios()
    }
}

impl SimOptions {
    /// What the plant is made of.
    #[must_use]
    pub fn plant(&self) -> PlantOptions<'_> {
        let Self { vehicle, battery, air, floor, .. } = self;
        PlantOptions { vehicle, battery, air, floor }
    }

    /// Hover throttle that the altitude filter believes before the flight.
    #[must_use]
    pub fn believed_hover_throttle(&self) -> f64 {
        self.observer.altitude.hover_throttle.unwrap_or(self.vehicle.hover_throttle())
    }
}

impl RateOptions {
    /// Motor commands per second: `attitude_hz`, and no more than one a tick.
    #[must_use]
    pub fn attitude_hz(&self) -> u32 {
        self.attitude_hz.min(self.control_hz)
    }

    /// Runs per second of the position loop: `position_hz`, and no more than motor commands.
    #[must_use]
    pub fn position_hz(&self) -> u32 {
        self.position_hz.min(self.attitude_hz())
    }

    /// Checks that slower loops run at whole ticks of faster ones.
    fn check_ratios(&self) -> Result<()> {
        for (slow, slow_hz, fast, fast_hz) in [
            ("attitude_hz", self.attitude_hz, "control_hz", self.control_hz),
            ("position_hz", self.position_hz, "attitude_hz", self.attitude_hz()),
            ("log_hz", self.log_hz, "control_hz", self.control_hz),
        ] {
            // A loop that could run a whole number of times a tick runs once.
            let capped = slow != "log_hz" && slow_hz.is_multiple_of(fast_hz);
            if !capped && !fast_hz.is_multiple_of(slow_hz) {
                let wanted = format!("a divisor or a multiple of rates.{fast} = {fast_hz}");
                let hint = "the firmware runs its loops at 1000, 500 and 100 Hz";
                return Err(Error::input(format!("rates.{slow}"), slow_hz, wanted, hint));
            }
        }
        Ok(())
    }
}

impl SimOptions {
    /// The undisturbed drone: in still air, with its center of mass in the middle and ideal
    /// sensors.
    #[must_use]
    pub fn rehearsal(&self) -> Self {
        let mut options = self.clone();
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

    /// The same with the firmware's filter on ideal sweeps of its stations: what it makes of the
    /// drone's drag is the same in every flight. `None` where another estimator flies, or on other
    /// sensors.
    #[must_use]
    pub fn rehearsal_by_filter(&self) -> Option<Self> {
        let positioning = self.sensors.positioning;
        let by_light = matches!(positioning, Positioning::Sweeps | Positioning::CrossingBeams);
        (by_light && self.observer.kind == EstimatorKind::Ekf).then(|| {
            let mut options = self.rehearsal();
            options.observer.kind = EstimatorKind::Ekf;
            options.sensors.positioning = positioning;
            options.sensors.lighthouse.stations = self.sensors.lighthouse.stations.clone();
            options
        })
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
        let refused = |change: fn(&mut SimOptions)| {
            let mut options = SimOptions::default();
            change(&mut options);
            options.check().unwrap_err().to_string()
        };
        assert!(refused(|o| o.vehicle.mass_kg = f64::NAN).starts_with("vehicle.mass_kg"));
        assert!(refused(|o| o.controller.lqr.q[3] = -1.0).starts_with("controller.lqr.q[3]"));
        assert!(
            refused(|o| o.observer.luenberger.r[7] = 0.0).starts_with("observer.luenberger.r[7]")
        );
        assert!(refused(|o| o.rates.log_hz = 300).starts_with("rates.log_hz"));
        assert!(refused(|o| o.rates.attitude_hz = 300).starts_with("rates.attitude_hz"));
        assert!(refused(|o| o.rates.attitude_hz = 650).starts_with("rates.attitude_hz"));
        assert!(refused(|o| o.rates.position_hz = 99).starts_with("rates.position_hz"));
        assert!(
            refused(|o| o.controller.geometric.k_rate[2] = -1.0)
                .starts_with("controller.geometric.k_rate[2]")
        );
        assert!(
            refused(|o| o.controller.lqr.k = Some(vec![vec![0.0; 12]; 3]))
                .contains("3 rows of 12, 12")
        );
        assert!(
            refused(|o| o.controller.lqr.k = Some(vec![vec![0.0; 15]; 4]))
                .contains("12 numbers for lqr")
        );
        assert!(refused(|o| o.rates.log_hz = 0).starts_with("rates.log_hz"));
        assert!(refused(|o| o.vehicle.mass_kg = 0.06).contains("weighs 0.589 N"));
    }

    #[test]
    fn no_loop_runs_faster_than_the_one_that_calls_it() {
        let rates = RateOptions { control_hz: 250, ..Default::default() };
        assert_eq!((rates.attitude_hz(), rates.position_hz()), (250, 100));
        let slow = SimOptions { rates, ..Default::default() };
        assert!(slow.check().unwrap_err().to_string().starts_with("rates.position_hz"));
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
