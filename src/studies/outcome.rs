//! The outcome of one trial.

use serde::{Deserialize, Serialize};

use super::statistics::mean;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{ENERGY_J, Flight, FlightSample, SATURATED_S};
use noctograph_plan::tracking::{Part, track_sparsely};
use noctograph_score::Verdict;
use noctograph_sim::SimOptions;

/// Limit of log-odds in both directions. Those of an illegible word would be infinite.
const MAX_LOG_ODDS: f64 = 10.0;

/// Number of samples for each one whose contour error is computed, 50 a second in a flight of ours.
/// The mean differs by less than 0.1 mm from that of all samples.
const CONTOUR_STRIDE: usize = 5;

/// Largest magnitude accepted for a figure. Even the energy of a large battery in J is far smaller.
const MAX_FIGURE: f64 = 1e12;

/// Outcome of one trial, stored as a line in a [`super::Store`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Letters that were read.
    pub read: String,
    /// True if every letter was read as intended.
    pub all_read: bool,
    /// True if the word counts as legible.
    pub legible: bool,
    /// Probability that a viewer reads the word, and no other word, at first sight, 0 to 1:
    /// [`Verdict::read_probability`].
    pub probability: f64,
    /// Log-odds of the probability, −10 to 10, which distinguish probabilities close to 0 or 1.
    pub log_odds: f64,
    /// Mean probability of the intended letters, 0 to 1, which varies even among illegible words.
    pub similarity: f64,
    /// Figures of the flight. `None` if a drone was lost.
    #[serde(flatten)]
    pub flown: Option<Flown>,
    /// Cause of the loss of a drone. `None` if no drone was lost.
    pub lost: Option<String>,
}

/// Declares [`Flown`] and the names of its figures.
macro_rules! figures {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        /// Figures of a flight, while letters are written unless stated otherwise. For several
        /// drones each figure is the mean, except that drift, tilt and duration are the maximum,
        /// and energy is the sum.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        pub struct Flown<T = f64> {
            $($(#[$doc])* pub $name: T,)*
        }

        impl<T> Flown<T> {
            /// Names of the figures in files.
            pub const NAMES: [&str; 10] = [$(stringify!($name)),*];

            /// Returns all figures in the order of [`Self::NAMES`].
            pub fn values(self) -> [T; 10] {
                [$(self.$name),*]
            }

            /// Creates the figures from values in the order of [`Self::NAMES`].
            pub(super) fn from_values([$($name),*]: [T; 10]) -> Self {
                Self { $($name),* }
            }
        }
    };
}

figures! {
    /// Mean distance from the path in the word's plane.
    contour_m,
    /// Time lag relative to the design.
    lag_s,
    /// Root mean square error against the design along x.
    rmse_x_m,
    /// Root mean square error against the design along y.
    rmse_y_m,
    /// Root mean square error against the design along z.
    rmse_z_m,
    /// Maximum distance from the word's plane.
    drift_y_m,
    /// Maximum tilt, which is the larger of roll and pitch.
    tilt_rad,
    /// Fraction of the time in which a motor is saturated.
    saturated_frac,
    /// Duration of the whole flight.
    duration_s,
    /// Energy of the whole flight: current for thrust and electronics, times open-circuit voltage.
    energy_j,
}

impl Outcome {
    /// Returns the objective of a search: the log-odds of the word plus the scaled mean similarity
    /// of its letters. The similarity still varies when the log-odds are at their limit. It is
    /// scaled to a similar range.
    pub fn merit(&self) -> f64 {
        self.log_odds + MAX_LOG_ODDS * self.similarity
    }

    /// Checks figures that were read from a file. `place` is the file's name and the line.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] that names the figure out of range.
    pub(super) fn check(&self, place: &str) -> Result<()> {
        // Rounding may yield a similarity slightly above 1.
        let scores = [
            ("probability", self.probability, 0.0..=1.0),
            ("log_odds", self.log_odds, -MAX_LOG_ODDS..=MAX_LOG_ODDS),
            ("similarity", self.similarity, -1.01..=1.01),
        ];
        let figures = self.flown.map(|flown| {
            let figures = Flown::<f64>::NAMES.into_iter().zip(flown.values());
            figures.map(|(name, value)| (name, value, -MAX_FIGURE..=MAX_FIGURE))
        });
        for (name, value, range) in scores.into_iter().chain(figures.into_iter().flatten()) {
            if !range.contains(&value) {
                let wanted = format!("a number from {} to {}", range.start(), range.end());
                let hint = "remove the line, or name another folder";
                return Err(Error::input(name, value, wanted, hint).in_file(place, None));
            }
        }
        Ok(())
    }

    /// Creates an outcome from a photo's verdict and the figures of its flights.
    pub(super) fn new(verdict: &Verdict, flown: Flown) -> Self {
        let (p, letters) = (verdict.read_probability(), &verdict.letters);
        Self {
            read: verdict.read.clone(),
            all_read: letters.iter().all(|letter| letter.best == Some(letter.expected)),
            legible: verdict.legible,
            probability: p,
            log_odds: libm::log(p / (1.0 - p)).clamp(-MAX_LOG_ODDS, MAX_LOG_ODDS),
            similarity: mean(letters.iter().filter_map(|letter| letter.p)),
            flown: Some(flown),
            lost: None,
        }
    }

    /// Returns the outcome of a flight that lost a drone, with the cause `how` and no photo.
    pub fn lost(word: &str, how: String) -> Self {
        Self {
            read: "?".repeat(word.chars().count()),
            all_read: false,
            legible: false,
            probability: 0.0,
            log_odds: -MAX_LOG_ODDS,
            similarity: 0.0,
            flown: None,
            lost: Some(how),
        }
    }
}

impl Flown {
    /// Computes the figures of a photo's flights. `believed` is the scene's drone and battery.
    pub(super) fn new(flights: &[Flight], believed: &SimOptions) -> Result<Self> {
        let drones = flights.iter().map(|flight| Ok(Self::from_flight(flight, believed)?.values()));
        let drones: Vec<[f64; 10]> = drones.collect::<Result<_>>()?;
        Ok(Self::from_values(std::array::from_fn(|index| {
            let values = drones.iter().map(|values| values[index]);
            match Self::NAMES[index] {
                "drift_y_m" | "tilt_rad" | "duration_s" => values.fold(0.0, f64::max),
                "energy_j" => values.sum(),
                _ => mean(values),
            }
        })))
    }

    /// Computes the figures of one flight: tracking, tilt, saturation, duration and energy.
    fn from_flight(flight: &Flight, believed: &SimOptions) -> Result<Self> {
        let tracking = track_sparsely(flight, Part::Letters, CONTOUR_STRIDE)?;
        let tilt_rad =
            tracking.attitude.map_or(0.0, |a| a.max.pitch_rad.abs().max(a.max.roll_rad.abs()));
        Ok(Self {
            contour_m: tracking.contour.mean_m,
            lag_s: tracking.lag_s,
            rmse_x_m: tracking.rmse_m.x,
            rmse_y_m: tracking.rmse_m.y,
            rmse_z_m: tracking.rmse_m.z,
            drift_y_m: tracking.drift.max_y_m.max(-tracking.drift.min_y_m),
            tilt_rad,
            saturated_frac: saturated_frac(flight),
            duration_s: flight.samples.last().map_or(0.0, |last| last.time_s),
            // Without a simulated battery, the energy is estimated from the motor commands.
            energy_j: flight
                .at_end(ENERGY_J)
                .unwrap_or_else(|| modeled_energy_j(&flight.samples, believed)),
        })
    }
}

/// Returns the fraction of the writing time during which a motor is saturated, or 0 if not logged.
fn saturated_frac(flight: &Flight) -> f64 {
    let Some(total_s) = flight.extra.get(SATURATED_S) else { return 0.0 };
    // The column accumulates saturated time, whose increments within letters are summed.
    let (mut written_s, mut saturated_s) = (0.0, 0.0);
    for (pair, total_s) in flight.samples.windows(2).zip(total_s.windows(2)) {
        if pair[0].letter.is_some() {
            written_s += pair[1].time_s - pair[0].time_s;
            saturated_s += total_s[1] - total_s[0];
        }
    }
    if written_s > 0.0 { saturated_s / written_s } else { 0.0 }
}

/// Returns the energy `∫ V (I_idle + I per N · thrust) dt`, with the open-circuit voltage V at the
/// battery's initial charge.
fn modeled_energy_j(samples: &[FlightSample], options: &SimOptions) -> f64 {
    let battery = &options.battery;
    let volts = battery.open_circuit_v(battery.charge_frac);
    let energies_j = samples.windows(2).map(|pair| {
        let thrust_n = options.vehicle.k_f_n * pair[0].motors.iter().sum::<f64>();
        let power_w = volts * (battery.idle_current_a + battery.current_a_per_n * thrust_n);
        power_w * (pair[1].time_s - pair[0].time_s)
    });
    energies_j.sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::{Preset, Scene};
    use noctograph_pipeline::shoot::Shoot;
    use noctograph_plan::PlanOptions;

    impl Outcome {
        /// Returns an outcome with made-up figures.
        pub(crate) fn example(probability: f64) -> Self {
            Self {
                read: "I".into(),
                all_read: probability > 0.5,
                legible: probability > 0.7,
                probability,
                log_odds: 0.0,
                similarity: 0.5,
                flown: None,
                lost: None,
            }
        }
    }

    fn flights(scene: Scene) -> Vec<Flight> {
        Shoot::new(scene).unwrap().fly(&|_, _| {}).unwrap()
    }

    #[test]
    fn energy_is_current_times_voltage_times_time() {
        let mut sample =
            flights(Scene { word: "I".into(), ..Scene::preset(Preset::Ae4832022) })[0].samples[0];
        sample.motors = [10_000.0; 4];
        let later = FlightSample { time_s: sample.time_s + 2.0, ..sample };
        // A command of 40 000 units at 1.95 µN per unit draws 6.68 A/N. A full battery has 4.2 V.
        let want_j = 2.0 * 4.2 * (0.24 + 6.68 * 0.078);
        let found_j = modeled_energy_j(&[sample, later], &SimOptions::default());
        assert!((found_j - want_j).abs() < 1e-9, "{found_j} for {want_j}");
    }

    #[test]
    fn figures_of_several_drones_are_means_largest_values_and_a_sum() {
        let mut scene = Scene {
            word: "ON".into(),
            plan: PlanOptions::even(),
            ..Scene::preset(Preset::Ae4832022)
        };
        scene.plan.drones = 2;
        let (flights, sim) = (flights(scene.clone()), scene.sim());
        let both = Flown::new(&flights, &sim).unwrap();
        let [a, b] = [0, 1].map(|drone| Flown::new(&flights[drone..=drone], &sim).unwrap());
        assert_eq!(both.contour_m, 0.5 * (a.contour_m + b.contour_m));
        assert_eq!(both.duration_s, a.duration_s.max(b.duration_s));
        assert_eq!(both.energy_j, a.energy_j + b.energy_j);
    }
}
