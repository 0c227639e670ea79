//! Conditions: random differences between the actual drone and its scene.
//!
//! A controller is designed for the scene, but the actual drone differs from the scene, by amounts
//! that depend on the seed and the drone. The differences are constant during a flight, except for
//! gusts and sensor noise. The same seed draws the same differences under every controller (common
//! random numbers). Each factor has its own random stream, so adding one does not change the
//! others.

use std::f64::consts::TAU;
use std::path::Path;

use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use noctograph_core::error::{Error, Result};
use noctograph_core::files::Limit;
use noctograph_core::random::stream;
use noctograph_core::settings::{Described, settings, suggestion};
use noctograph_pipeline::scene::Scene;
use noctograph_pipeline::shoot::Actual;
use noctograph_sim::SimOptions;
use noctograph_sim::sensors::LighthouseOptions;
use noctograph_sim::vehicle::{GustOptions, Gusts, VehicleOptions};

/// Drag of a Crazyflie 2.1 in N/(m/s) (crazyflow's `cf2x_L250`). Used for flights in gusts if the
/// scene specifies no drag.
const DRAG_N_S_M: [f64; 3] = [0.014_72, 0.014_72, 0.012_78];

/// Mean time between the starts of two radio outages.
pub(super) const OUTAGE_EVERY_S: f64 = 10.0;

/// Standard deviation of the gusts in a ventilated room.
pub(super) const ROOM_GUST_M_S: f64 = 0.08;

settings! {
    /// Conditions: widths of the differences between flights and their scene. A width of 0 keeps
    /// the scene's value. The default, `room`, is an ordinary room with a drone whose mass and trim
    /// are known. [`Self::any_drone`] is an arbitrary drone of the same model.
    ///
    /// The widths below were chosen on the reference flight, to which mass and trim were fitted. On
    /// each axis, the 90 % band of 40 replays under `room` contains that flight 87 to 97 % of the
    /// time (`tests/it/team_data.rs`), compared with 64 to 87 % if only noise and gusts vary. The
    /// band contains nine tenths of other flights under PID, and less in y under a controller
    /// without an integral term (`docs/model.md`).
    pub struct Conditions {
        /// Mass: standard deviation as a fraction of the scene's mass. The default, 0.5 g of 35 g,
        /// allows for tape or a different battery.
        mass_frac: f64 = 0.015, in 0.0..=1.0;
        /// Center of mass along body x and y: standard deviation, m. A 7 g battery can slide half a
        /// millimeter in its holder. Motors that differ by 3 % have the effect of 0.5 mm.
        center_of_mass_m: f64 = 0.1e-3, in 0.0..=0.1;
        /// Moments of inertia: standard deviation as a fraction of the scene's values. Published
        /// values for the same drone differ by a fifth.
        inertia_frac: f64 = 0.1, in 0.0..=2.0;
        /// Additional time constant of the rotors, uniform from 0 to this, s. The default covers
        /// the lower half of the published range (0.02 to 0.14 s), which the flown gains tolerate.
        motor_lag_s: f64 = 0.05, in 0.0..=5.0;
        /// Standard deviation, m, of a position error that varies smoothly over the room, in
        /// addition to the scene's. With `sensors.positioning` = `position` the error is a
        /// distortion. With Lighthouse it results from misplaced stations. The default is half of
        /// the 13 mm rms in Bitcraze's `positioning_dataset`.
        lighthouse_distortion_m: f64 = 0.007, in 0.0..=10.0;
        /// Standard deviation of the rotation of the Lighthouse's frame about each axis, rad, and
        /// of the error of its scale. When the geometry is estimated (cflib,
        /// `multi_bs_geometry_estimation.py`), the drone is placed by hand at the origin, one meter
        /// along the x-axis, and on the floor. The assumed error of each placement is 7.5 mm, the
        /// distortion in that data set, which gives 0.0075 √2 over one meter. The data set itself
        /// was aligned with its reference and does not contain this error.
        lighthouse_frame_frac: f64 = 0.01, in 0.0..=0.2;
        /// Additional aerodynamic moment per unit airspeed, uniform from 0 to this, N m/(m/s). The
        /// moment pitches the drone up against its motion. The default was identified from the log
        /// of the reference flight
        /// ([`noctograph_sim::vehicle::VehicleOptions::airspeed_moment_n_s`]). Other drones have
        /// not been measured.
        airspeed_moment_n_s: f64 = 4.7e-4, in 0.0..=10.0;
        /// Gusts: standard deviation, m/s (Ornstein–Uhlenbeck). The default is that of a ventilated
        /// room. Stronger gusts in the scene are kept. Uneven air rotates the drone in proportion
        /// to the gusts, based on a measurement at 0.08 m/s.
        gust_m_s: f64 = 0.08, in 0.0..=30.0;
        /// Additional delay of the light commands, uniform from 0 to this, s. The default is one
        /// repeated radio packet.
        led_delay_s: f64 = 0.05, in 0.0..=5.0;
        /// Charge already drawn from the battery, as a fraction, uniform from 0 to this.
        charge_used_frac: f64 = 0.33, in 0.0..=1.0;
        /// Mean duration of a radio outage, s, at an average of one outage every 10 s (`[radio]`).
        /// 0 means no outages. At the value in `evening`, the longest of six outages per minute
        /// lasts 0.73 s on average, as in the log of the reference flight.
        radio_outage_s: f64 = 0.0, in 0.0..=100.0;
        /// Heading drift of the gyroscope: standard deviation, rad/s. Only a magnetometer or a deck
        /// that measures directions could correct the drift. The value in `evening` is 0.015 °/s/K
        /// (data sheet of the BMI088) times 10 K from calibration to flight.
        yaw_drift_rad_s: f64 = 0.0, in 0.0..=1.0;
        /// Fraction of its thrust that one motor loses, uniform from 0 to this. The value in
        /// `evening` corresponds to a millimeter missing from one of two 23 mm blades, which costs
        /// `(1 − (22/23)³) / 2`, because a blade's lift grows with r². Small faults begin at 5 % of
        /// a blade's length (Baldini et al. 2026, doi 10.1007/s10846-026-02369-x).
        motor_loss_frac: f64 = 0.0, in 0.0..=1.0;
        /// Age of the battery, uniform from 0 to this. At age 1 the battery retains 80 % of its
        /// capacity, at which cells are retired (USABC, Electric Vehicle Battery Test Procedures
        /// Manual, 1996). Such a battery fails the firmware's test: its voltage sags by 0.70 V
        /// (`BAT_LOADING_SAG_THRESHOLD`, firmware pull request 1192) with the motors at 61 %
        /// (`HEALTH_BRUSHED_BAT_ON_PERIOD_PWM_RATIO`, 40000). At that load, which corresponds to
        /// hovering, the scene's resistance causes a sag of 0.57 V.
        battery_age: f64 = 0.0, in 0.0..=1e3;
    }
}

impl Conditions {
    /// Returns the conditions `drone`: an ordinary room, and an arbitrary drone of the scene's
    /// model. The standard deviation of the mass is 1 g of 35 g. That of the center of mass is 0.5
    /// mm, the effect of motors that differ by 3 %, which is half of the difference inferred from
    /// the reference flight's trim.
    pub fn any_drone() -> Self {
        Self { mass_frac: 0.03, center_of_mass_m: 0.5e-3, ..Self::default() }
    }

    /// Returns the conditions `evening`: an ordinary room with many people, and worn drones with
    /// faults in radio, heading, propellers and batteries.
    pub fn evening() -> Self {
        Self {
            radio_outage_s: 0.3,
            yaw_drift_rad_s: 2.6e-3,
            motor_loss_frac: 0.06,
            battery_age: 1.0,
            ..Self::default()
        }
    }

    /// Returns conditions by name (`room`, `drone`, `evening` or `still`), or reads a TOML file.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for an unknown name, and the errors of the file.
    pub fn find(named: &str) -> Result<Self> {
        type Constructor = fn() -> Conditions;
        let by_name: [(&str, Constructor); 4] = [
            ("room", Self::default),
            ("drone", Self::any_drone),
            ("evening", Self::evening),
            ("still", Self::still),
        ];
        if let Some((_, constructor)) = by_name.iter().find(|(name, _)| *name == named) {
            return Ok(constructor());
        }
        // A name in the table takes precedence over a file with the same name.
        if Path::new(named).exists() {
            let hint = "remove keys that are not conditions";
            let limit = Limit { bytes: 1 << 20, what: "conditions", hint };
            return Self::parse(&limit.read_text(named.as_ref())?, named);
        }
        let names = by_name.map(|(name, _)| name);
        let hint = suggestion(named, names, || "name a file that exists".into());
        Err(Error::input("conditions", named, names.join(", ") + ", or a TOML file", hint))
    }

    /// Returns conditions under which a flight differs from its scene only by noise.
    pub fn still() -> Self {
        let keys = Self::SHAPE.settings().iter();
        let zeros: toml::Table = keys.map(|setting| (setting.key.to_owned(), 0.0.into())).collect();
        zeros.try_into().expect("every key of conditions")
    }

    /// Checks that every value is in its range.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] that names the key with a value out of range.
    pub fn check(&self) -> Result<()> {
        Described::check(self, "", None)
    }

    /// Reads the text of a conditions file (TOML). `file` is the file name to show in messages.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] for an unknown key or a value out of range.
    pub fn parse(toml: &str, file: &str) -> Result<Self> {
        let hint = "set keys such as motor_lag_s = 0.05. A value of 0 disables a condition";
        let keys: Vec<&str> = Self::SHAPE.settings().iter().map(|setting| setting.key).collect();
        // Unknown keys are checked first, because serde would not suggest the nearest key.
        let table: toml::Table = toml.parse().unwrap_or_default();
        if let Some(unknown) = table.keys().find(|key| !keys.contains(&key.as_str())) {
            let listed = format!("the keys are {}", keys.join(", "));
            let nearest = suggestion(unknown, keys, || listed);
            let key = format!("the unknown key {unknown}");
            return Err(Error::input(file, key, "a key of conditions", nearest));
        }
        let conditions: Self = toml::from_str(toml).map_err(|error| {
            let problem = error.message().lines().next().unwrap_or_default().to_owned();
            Error::input(file, problem, "flight conditions in TOML", hint)
        })?;
        conditions.check()?;
        Ok(conditions)
    }

    /// Draws the actual drone and lamps for one flight, given a seed and the drone's index.
    pub fn draw(&self, scene: &Scene, seed: u64, drone: u64) -> Actual {
        let chance = FlightDraw { seed, drone };
        let (mut sim, mut light) = (scene.sim(), scene.light.clone());
        self.draw_body(&mut sim.vehicle, &chance);
        self.draw_lighthouse(&mut sim.sensors.lighthouse, &chance);
        self.draw_gusts(&mut sim);
        let used_frac = self.charge_used_frac * chance.factor("charge").uniform();
        sim.battery.charge_frac = (sim.battery.charge_frac - used_frac).max(0.0);
        let age = self.battery_age * chance.factor("battery age").uniform();
        // At age 1 the sag is 0.70 V instead of 0.57 V, and 80 % of the capacity is left. At any
        // age, at least 5 % is left.
        sim.battery.resistance_ohm *= 1.0 + (0.70 / 0.57 - 1.0) * age;
        sim.battery.capacity_ah *= (1.0 - 0.2 * age).max(0.05);
        let drift_rad_s = self.yaw_drift_rad_s * chance.factor("yaw drift").normal();
        sim.sensors.imu.gyro_bias_rad_s[2] += drift_rad_s;
        if self.radio_outage_s > 0.0 {
            let radio = &mut sim.radio;
            radio.drones = radio.drones.max(1);
            if radio.outage_every_s == 0.0 {
                (radio.outage_every_s, radio.outage_s) = (OUTAGE_EVERY_S, 0.0);
            }
            radio.outage_s += self.radio_outage_s;
        }
        light.radio_delay_s += self.led_delay_s * chance.factor("led delay").uniform();
        Actual { sim, light }
    }

    /// Draws mass, center of mass, inertia, rotor lag, aerodynamic moment, and the loss of thrust
    /// of one randomly chosen motor.
    fn draw_body(&self, body: &mut VehicleOptions, chance: &FlightDraw) {
        // The mass and each moment of inertia are at least a tenth of the scene's values.
        body.mass_kg *= (1.0 + self.mass_frac * chance.factor("mass").normal()).max(0.1);
        let mut center = chance.factor("center of mass");
        for center_m in &mut body.center_of_mass_m {
            *center_m += self.center_of_mass_m * center.normal();
        }
        let mut inertia = chance.factor("inertia");
        for inertia_kg_m2 in &mut body.inertia_kg_m2 {
            *inertia_kg_m2 *= (1.0 + self.inertia_frac * inertia.normal()).max(0.1);
        }
        let lag_s = self.motor_lag_s * chance.factor("motor lag").uniform();
        body.motor_rise_s += lag_s;
        body.motor_fall_s += lag_s;
        let moment_n_s = self.airspeed_moment_n_s * chance.factor("airspeed moment").uniform();
        body.airspeed_moment_n_s += moment_n_s;
        let mut propeller = chance.factor("propeller");
        let lost_frac = self.motor_loss_frac * propeller.uniform();
        #[expect(clippy::cast_possible_truncation, reason = "0 to 3")]
        let motor = (4.0 * propeller.uniform()) as usize;
        // The fraction of thrust that remains is the scene's times the drawn one.
        let loss_frac = &mut body.motor_loss_frac[motor];
        *loss_frac = 1.0 - (1.0 - *loss_frac) * (1.0 - lost_frac);
    }

    /// Adds the conditions' distortion of positions to that of the scene, as independent errors,
    /// and draws the errors of the frame's rotation (rad) and scale (a fraction).
    fn draw_lighthouse(&self, sensors: &mut LighthouseOptions, chance: &FlightDraw) {
        for error_m in [&mut sensors.distortion_m, &mut sensors.station_position_error_m] {
            *error_m = libm::hypot(*error_m, self.lighthouse_distortion_m);
        }
        // All drones in a room have a common frame, so it is drawn as for drone 0.
        let mut frame = FlightDraw { drone: 0, ..*chance }.factor("lighthouse frame");
        for turn_rad in &mut sensors.frame_turn_rad {
            *turn_rad += self.lighthouse_frame_frac * frame.normal();
        }
        sensors.frame_scale_error += self.lighthouse_frame_frac * frame.normal();
    }

    /// Raises the standard deviation of the scene's gusts to at least that of the conditions, in
    /// m/s. Adds body drag if the scene has none, because gusts act through the drag.
    fn draw_gusts(&self, sim: &mut SimOptions) {
        if self.gust_m_s <= 0.0 {
            return;
        }
        let mut gusts = match &sim.air.gusts {
            Gusts::OrnsteinUhlenbeck(gusts) => gusts.clone(),
            Gusts::None | Gusts::Dryden => {
                GustOptions { sigma_m_s: [0.0; 3], ..GustOptions::default() }
            }
        };
        gusts.sigma_m_s = gusts.sigma_m_s.map(|sigma_m_s| sigma_m_s.max(self.gust_m_s));
        sim.air.gusts = Gusts::OrnsteinUhlenbeck(gusts);
        if sim.vehicle.body_drag_n_s_m == [0.0; 3] {
            // The drag is scaled with the gusts, so that both vanish together.
            let fraction = (self.gust_m_s / ROOM_GUST_M_S).min(1.0);
            sim.vehicle.body_drag_n_s_m = DRAG_N_S_M.map(|drag| drag * fraction);
        }
    }
}

/// Key of the random streams of one flight of one drone.
struct FlightDraw {
    seed: u64,
    drone: u64,
}

impl FlightDraw {
    /// Returns the random stream of a factor, which depends on seed, drone and name.
    fn factor(&self, factor: &str) -> Stream {
        // In a fleet, the first drone draws the same numbers as without the other drones.
        let drone = if self.drone == 0 { String::new() } else { format!("{}:", self.drone) };
        Stream(stream(self.seed, format!("study:{drone}{factor}").bytes()))
    }
}

/// Random number generator of one factor in one flight.
struct Stream(ChaCha8Rng);

impl Stream {
    /// Draws a uniformly distributed number from `[0, 1)`.
    fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    /// Draws a normally distributed number with mean 0 and variance 1 (Box, Muller 1958).
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        radius * libm::cos(TAU * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::mean;
    use noctograph_pipeline::scene::Preset;

    fn drawn(conditions: &Conditions, seed: u64, drone: u64) -> SimOptions {
        conditions.draw(&Scene::preset(Preset::Ae4832022), seed, drone).sim
    }

    #[test]
    fn still_conditions_fly_the_scene_itself() {
        let scene = Scene::preset(Preset::Ae4832022);
        let actual = Conditions::still().draw(&scene, 7, 0);
        assert_eq!(actual, Actual { sim: scene.sim(), light: scene.light });
    }

    #[test]
    fn a_seed_draws_the_same_whatever_other_factors_do() {
        let all = Conditions::default();
        let [with_s, other_seed_s, other_drone_s] = [(3, 0), (4, 0), (3, 1)]
            .map(|(seed, drone)| drawn(&all, seed, drone).vehicle.motor_rise_s);
        assert!(with_s != other_seed_s && with_s != other_drone_s, "others differ");
        let lags_s = [1.0, 2.0].map(|times| {
            let lag = Conditions { motor_lag_s: times * all.motor_lag_s, ..Conditions::still() };
            drawn(&lag, 3, 0).vehicle.motor_rise_s
        });
        assert_eq!(lags_s, [with_s, 2.0 * with_s]);
    }

    #[test]
    fn an_evening_has_faults_of_its_own_and_a_room_has_none() {
        let scene = Scene::preset(Preset::Cf21);
        let [room, evening] = [Conditions::default(), Conditions::evening()];
        let sound = room.draw(&scene, 1, 0).sim;
        assert_eq!((&sound.radio, sound.vehicle.motor_loss_frac), (&scene.radio, [0.0; 4]));
        assert_eq!(sound.battery.resistance_ohm, scene.battery.resistance_ohm);
        let mut weak = [0; 4];
        for seed in 0..200 {
            let actual = evening.draw(&scene, seed, 0).sim;
            assert_eq!((actual.radio.drones, actual.radio.outage_s), (1, 0.3));
            let lost = actual.vehicle.motor_loss_frac;
            let motor = lost.iter().position(|lost| *lost > 0.0).unwrap();
            assert!(lost[motor] < 0.06 && lost.iter().sum::<f64>() == lost[motor], "{lost:?}");
            weak[motor] += 1;
            let older = actual.battery.resistance_ohm / scene.battery.resistance_ohm - 1.0;
            let smaller = 1.0 - actual.battery.capacity_ah / scene.battery.capacity_ah;
            assert!((0.0..0.2282).contains(&older) && (smaller * 1.1404 - older).abs() < 1e-4);
            let radio = Conditions { radio_outage_s: 0.3, ..Conditions::still() };
            assert_eq!(radio.draw(&scene, seed, 0).sim.radio, actual.radio);
        }
        assert!(weak.iter().all(|n| (30..75).contains(n)), "each motor in its turn: {weak:?}");
    }

    #[test]
    fn draws_have_the_stated_spread() {
        let (n, scene) = (4000_u32, Scene::preset(Preset::Ae4832022));
        let draws =
            (0..n).map(|seed| Conditions::default().draw(&scene, seed.into(), 0).sim.vehicle);
        let draws: Vec<_> =
            draws.map(|v| (v.mass_kg / scene.vehicle.mass_kg, v.motor_rise_s)).collect();
        let sigma = mean(draws.iter().map(|(mass, _)| (mass - 1.0) * (mass - 1.0))).sqrt();
        assert!((sigma / 0.015 - 1.0).abs() < 0.05, "{sigma}");
        assert!((mean(draws.iter().map(|(_, lag_s)| lag_s)) / 0.025 - 1.0).abs() < 0.05);
        assert!(draws.iter().all(|(_, lag_s)| (0.0..0.05).contains(lag_s)));
    }

    #[test]
    fn the_lighthouses_frame_and_the_moment_of_the_air_differ_from_flight_to_flight() {
        let all = Conditions::default();
        let [one, beside, other] = [(1, 0), (1, 1), (2, 0)]
            .map(|(seed, drone)| drawn(&all, seed, drone).sensors.lighthouse.frame_turn_rad);
        assert_eq!(one, beside, "drones of a room share it");
        assert_ne!(one, other);
        let flights: Vec<_> = (0..400).map(|seed| drawn(&all, seed, 0)).collect();
        let yaws = flights.iter().map(|sim| sim.sensors.lighthouse.frame_turn_rad[2]);
        let sigma_rad = (yaws.map(|yaw_rad| yaw_rad * yaw_rad).sum::<f64>() / 400.0).sqrt();
        assert!((sigma_rad / 0.01 - 1.0).abs() < 0.1, "{sigma_rad}");
        let moments = flights.iter().map(|sim| sim.vehicle.airspeed_moment_n_s);
        let moments: Vec<f64> = moments.collect();
        assert!(moments.iter().all(|moment| (0.0..4.7e-4).contains(moment)), "{moments:?}");
        assert_ne!(moments[1], moments[2]);
    }

    #[test]
    fn gusts_that_fade_leave_the_scene_as_it_is() {
        let [none, faint, room, strong] = [0.0, 1e-6, 1.0, 4.0].map(|times| {
            let gusts = Conditions { gust_m_s: times * ROOM_GUST_M_S, ..Conditions::still() };
            drawn(&gusts, 1, 0).vehicle.body_drag_n_s_m[0]
        });
        assert_eq!((none, room, strong), (0.0, DRAG_N_S_M[0], DRAG_N_S_M[0]));
        assert!(faint < 1e-6 * DRAG_N_S_M[0] * 1.001, "{faint}");
    }

    #[test]
    fn a_conditions_file_names_what_it_changes() {
        let read = Conditions::parse("gust_m_s = 0.3\n", "room.toml").unwrap();
        assert_eq!(read, Conditions { gust_m_s: 0.3, ..Conditions::default() });
        let [near, far] = ["gust_ms = 0.3\n", "wind = 0.3\n"]
            .map(|toml| Conditions::parse(toml, "room.toml").unwrap_err());
        let text = near.to_string();
        assert!(text.contains("room.toml") && text.contains("gust_ms"), "{text}");
        assert_eq!(near.hint(), "did you mean gust_m_s?");
        assert!(far.hint().contains("led_delay_s"), "the list where none is like it");
        assert!(Conditions::parse("mass_frac = -1.0\n", "room.toml").is_err());
    }
}
