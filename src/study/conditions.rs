//! Conditions: by how much a drone in the room differs from its scene, flight by flight.
//!
//! A controller is made for the scene; what flies is the scene with a [`Departure`], drawn anew for
//! each seed. The same seed draws the same departure under every controller (common random numbers),
//! and each factor has a stream of its own, so that one factor more changes no other.

use std::f64::consts::TAU;

use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::{Deserialize, Serialize};

use crate::error::{Error, Result, within};
use crate::light::LightOptions;
use crate::scene::Scene;
use crate::sim::{GustOptions, Gusts, SimOptions};

/// Drag of a Crazyflie 2.1 in N/(m/s) (crazyflow's `cf2x_L250`), through which gusts take hold of a
/// drone whose scene has none.
const DRAG_N_S_M: [f64; 3] = [0.014_72, 0.014_72, 0.012_78];

/// Gusts of a ventilated room, with which [`crate::sim::GustOptions::torque_sigma_n_m`] goes.
const ROOM_GUST_M_S: f64 = 0.08;

/// How widely flights differ from their scene. 0 leaves a factor as the scene has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Conditions {
    /// Mass, σ as a share of the scene's. Markers, tape and another battery make a gram of 35.
    pub mass_frac: f64,
    /// Centre of mass in body x and y, σ, m. The battery slides in its holder.
    pub center_of_mass_m: f64,
    /// Moments of inertia, σ as a share of the scene's.
    pub inertia_frac: f64,
    /// Time constant of the rotors on top of the scene's, evenly from 0 to this, s.
    pub motor_lag_s: f64,
    /// Position error that changes smoothly over the room, σ on top of the scene's, m: distortion
    /// where `sensors.positioning` is `position`, misplaced stations where it is Lighthouse.
    pub lighthouse_distortion_m: f64,
    /// Gusts, σ on top of the scene's, m/s (Ornstein–Uhlenbeck); uneven air turns the drone in
    /// proportion, as measured at 0.08.
    pub gust_m_s: f64,
    /// Delay of the light commands on top of the scene's, evenly from 0 to this, s.
    pub led_delay_s: f64,
    /// Charge that the battery lacks, evenly from 0 to this share, where the scene has a battery.
    pub charge_used_frac: f64,
}

impl Default for Conditions {
    /// An ordinary room and evening. Mass: a gram of 35. Centre of mass: half of what stood out in
    /// the reference flight. Inertia: published values for one drone differ by a fifth (simulation.md
    /// 4). Motor lag: the lower half of what was published (0.02 to 0.14 s), since gains that were
    /// flown stand it. Lighthouse: half of the 13 mm rms that `positioning_dataset` shows. Gusts: a
    /// ventilated room, see [`GustOptions`]. LED: one repeated radio packet. Battery: a
    /// third flown away.
    fn default() -> Self {
        Self {
            mass_frac: 0.03,
            center_of_mass_m: 0.5e-3,
            inertia_frac: 0.1,
            motor_lag_s: 0.05,
            lighthouse_distortion_m: 0.007,
            gust_m_s: 0.08,
            led_delay_s: 0.05,
            charge_used_frac: 0.33,
        }
    }
}

/// One thing that differs from flight to flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Factor {
    /// Mass and moments of inertia.
    Mass,
    /// Where the mass sits.
    CenterOfMass,
    /// How late the rotors follow.
    MotorLag,
    /// How far the positioning is off.
    Lighthouse,
    /// Gusts.
    Gusts,
    /// How late the lamps follow.
    LedDelay,
}

impl Factor {
    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::Mass,
        Self::CenterOfMass,
        Self::MotorLag,
        Self::Lighthouse,
        Self::Gusts,
        Self::LedDelay,
    ];

    /// Its name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Mass => "mass",
            Self::CenterOfMass => "centre of mass",
            Self::MotorLag => "motor lag",
            Self::Lighthouse => "Lighthouse",
            Self::Gusts => "gusts",
            Self::LedDelay => "LED delay",
        }
    }
}

impl Conditions {
    /// Every flight is as its scene says; only noise differs.
    #[must_use]
    pub fn still() -> Self {
        Self {
            mass_frac: 0.0,
            center_of_mass_m: 0.0,
            inertia_frac: 0.0,
            motor_lag_s: 0.0,
            lighthouse_distortion_m: 0.0,
            gust_m_s: 0.0,
            led_delay_s: 0.0,
            charge_used_frac: 0.0,
        }
    }

    /// These conditions, `times` as wide.
    #[must_use]
    pub fn times(&self, times: f64) -> Self {
        Self {
            mass_frac: self.mass_frac * times,
            center_of_mass_m: self.center_of_mass_m * times,
            inertia_frac: self.inertia_frac * times,
            motor_lag_s: self.motor_lag_s * times,
            lighthouse_distortion_m: self.lighthouse_distortion_m * times,
            gust_m_s: self.gust_m_s * times,
            led_delay_s: self.led_delay_s * times,
            charge_used_frac: (self.charge_used_frac * times).min(1.0),
        }
    }

    /// Of these conditions, one factor alone.
    #[must_use]
    pub fn only(&self, factor: Factor) -> Self {
        let (all, mut one) = (self, Self::still());
        match factor {
            Factor::Mass => {
                (one.mass_frac, one.inertia_frac) = (all.mass_frac, all.inertia_frac);
            }
            Factor::CenterOfMass => one.center_of_mass_m = all.center_of_mass_m,
            Factor::MotorLag => one.motor_lag_s = all.motor_lag_s,
            Factor::Lighthouse => one.lighthouse_distortion_m = all.lighthouse_distortion_m,
            Factor::Gusts => one.gust_m_s = all.gust_m_s,
            Factor::LedDelay => one.led_delay_s = all.led_delay_s,
        }
        one
    }

    /// Checks the ranges.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        within("mass_frac", self.mass_frac, 0.0, 1.0)?;
        within("center_of_mass_m", self.center_of_mass_m, 0.0, 0.1)?;
        within("inertia_frac", self.inertia_frac, 0.0, 2.0)?;
        within("motor_lag_s", self.motor_lag_s, 0.0, 5.0)?;
        within("lighthouse_distortion_m", self.lighthouse_distortion_m, 0.0, 10.0)?;
        within("gust_m_s", self.gust_m_s, 0.0, 30.0)?;
        within("led_delay_s", self.led_delay_s, 0.0, 5.0)?;
        within("charge_used_frac", self.charge_used_frac, 0.0, 1.0)
    }

    /// Reads the text of a conditions file (TOML); `file` is its name in messages.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] for an unknown key or a value out of range.
    pub fn parse(toml: &str, file: &str) -> Result<Self> {
        let hint = "name the keys of Conditions, such as motor_lag_s = 0.05; 0 switches one off";
        let conditions: Self = toml::from_str(toml).map_err(|error| {
            let found = error.message().lines().next().unwrap_or_default().to_owned();
            Error::input(file, found, "conditions of flights as TOML", hint)
        })?;
        conditions.check()?;
        Ok(conditions)
    }

    /// How the flight of one seed departs from its scene.
    #[must_use]
    pub fn draw(&self, seed: u64) -> Departure {
        let chance = |factor: &str| Chance::new(seed, factor);
        let mut mass = chance("mass");
        let mut center = chance("center of mass");
        let mut inertia = chance("inertia");
        Departure {
            mass_factor: (1.0 + self.mass_frac * mass.normal()).max(0.1),
            center_of_mass_m: [(); 2].map(|()| self.center_of_mass_m * center.normal()),
            inertia_factor: [(); 3].map(|()| (1.0 + self.inertia_frac * inertia.normal()).max(0.1)),
            motor_lag_s: self.motor_lag_s * chance("motor lag").uniform(),
            lighthouse_distortion_m: self.lighthouse_distortion_m,
            gust_m_s: self.gust_m_s,
            led_delay_s: self.led_delay_s * chance("led delay").uniform(),
            charge_used_frac: self.charge_used_frac * chance("charge").uniform(),
        }
    }
}

/// How one flight departs from its scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Departure {
    /// Mass by the scene's.
    pub mass_factor: f64,
    /// Added to the scene's.
    pub center_of_mass_m: [f64; 2],
    /// Moments of inertia by the scene's.
    pub inertia_factor: [f64; 3],
    /// Added to both time constants of the rotors.
    pub motor_lag_s: f64,
    /// Joins the scene's own by the sum of squares.
    pub lighthouse_distortion_m: f64,
    /// Joins the scene's own by the sum of squares.
    pub gust_m_s: f64,
    /// Added to the scene's.
    pub led_delay_s: f64,
    /// Taken off the battery's charge.
    pub charge_used_frac: f64,
}

impl Departure {
    /// The drone and the lamps that fly.
    #[must_use]
    pub fn apply(&self, scene: &Scene) -> (SimOptions, LightOptions) {
        let (mut sim, mut light) = (scene.sim(), scene.light.clone());
        let body = &mut sim.vehicle;
        body.mass_kg *= self.mass_factor;
        for (own, more) in body.center_of_mass_m.iter_mut().zip(self.center_of_mass_m) {
            *own += more;
        }
        for (own, factor) in body.inertia_kg_m2.iter_mut().zip(self.inertia_factor) {
            *own *= factor;
        }
        body.motor_rise_s += self.motor_lag_s;
        body.motor_fall_s += self.motor_lag_s;
        let sensors = &mut sim.sensors.lighthouse;
        for own in [&mut sensors.distortion_m, &mut sensors.station_position_error_m] {
            *own = libm::hypot(*own, self.lighthouse_distortion_m);
        }
        if self.gust_m_s > 0.0 {
            let still = || GustOptions { sigma_m_s: [0.0; 3], ..GustOptions::default() };
            let (mut gusts, had) = match sim.air.gusts {
                Gusts::OrnsteinUhlenbeck(own) => (own, 1.0),
                Gusts::None | Gusts::Dryden => (still(), 0.0),
            };
            for own in &mut gusts.sigma_m_s {
                *own = libm::hypot(*own, self.gust_m_s);
            }
            for own in &mut gusts.torque_sigma_n_m {
                *own *= libm::hypot(had, self.gust_m_s / ROOM_GUST_M_S);
            }
            sim.air.gusts = Gusts::OrnsteinUhlenbeck(gusts);
            if body.body_drag_n_s_m == [0.0; 3] {
                body.body_drag_n_s_m = DRAG_N_S_M;
            }
        }
        sim.battery.charge_frac = (sim.battery.charge_frac - self.charge_used_frac).max(0.0);
        light.radio_delay_s += self.led_delay_s;
        (sim, light)
    }
}

/// Chance of one factor in one flight: a function of the seed and the factor's name alone.
struct Chance(ChaCha8Rng);

impl Chance {
    fn new(seed: u64, factor: &str) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        rng.set_stream(super::fnv_1a(b"study:".iter().copied().chain(factor.bytes())));
        Self(rng)
    }

    /// Uniform in `[0, 1)`.
    fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    /// Normal with mean 0 and variance 1 (Box, Muller 1958).
    fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        radius * libm::cos(TAU * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn still_conditions_fly_the_scene_itself() {
        let scene = Scene::default();
        let (sim, light) = Conditions::still().draw(7).apply(&scene);
        assert_eq!((sim, light), (scene.sim(), scene.light.clone()));
    }

    #[test]
    fn a_seed_draws_the_same_whatever_other_factors_do() {
        let all = Conditions::default();
        let (with, alone) = (all.draw(3), all.only(Factor::MotorLag).draw(3));
        assert_eq!(with.motor_lag_s, alone.motor_lag_s);
        assert_ne!(with.motor_lag_s, all.draw(4).motor_lag_s);
        assert_eq!(all.times(2.0).draw(3).motor_lag_s, 2.0 * with.motor_lag_s);
    }

    #[test]
    fn draws_have_the_stated_spread() {
        let n = 4000_u32;
        let draws: Vec<Departure> =
            (0..n).map(|seed| Conditions::default().draw(seed.into())).collect();
        let mean =
            |value: &dyn Fn(&Departure) -> f64| draws.iter().map(value).sum::<f64>() / f64::from(n);
        let sigma = mean(&|d| (d.mass_factor - 1.0) * (d.mass_factor - 1.0)).sqrt();
        assert!((sigma / 0.03 - 1.0).abs() < 0.05, "{sigma}");
        assert!((mean(&|d| d.motor_lag_s) / 0.025 - 1.0).abs() < 0.05);
        assert!(draws.iter().all(|d| (0.0..0.05).contains(&d.motor_lag_s)));
    }

    #[test]
    fn a_conditions_file_names_what_it_changes() {
        let read = Conditions::parse("gust_m_s = 0.3\n", "room.toml").unwrap();
        assert_eq!(read, Conditions { gust_m_s: 0.3, ..Conditions::default() });
        let unknown = Conditions::parse("gusts = 0.3\n", "room.toml").unwrap_err().to_string();
        assert!(unknown.contains("room.toml") && unknown.contains("gusts"), "{unknown}");
        assert!(Conditions::parse("mass_frac = -1.0\n", "room.toml").is_err());
    }
}
