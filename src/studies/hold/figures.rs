//! Flies altitude hold with many seeds, and compares each scenario's figures with limits.

use rayon::prelude::*;

use super::{Hold, HoldModel, HoldScenario, STATE_NAMES, hold};
use crate::statistics::{Estimate, bootstrap, mean};
use noctograph_core::error::{Result, within};
use noctograph_core::settings::settings;
use noctograph_sim::{AltitudeSensor, SimOptions};

/// Duration of a flight, s.
pub const DURATION_S: f64 = 60.0;
/// Time from which a flight is evaluated, s. By then the filter has settled.
const FROM_S: f64 = 5.0;
/// Time before and after an event in which innovations are ignored, s.
const EVENT_S: f64 = 0.5;
/// Maximum number of flights of a scenario.
const MAX_RUNS: f64 = 1e4;
/// Range of the mean ratio of squared error to variance if a state's σ is wrong by at most 20 %.
pub const CONSISTENT: [f64; 2] = [0.7, 1.4];

/// Figures of a scenario. Root mean squares are taken over time and over all flights.
#[derive(Clone, Debug, serde::Serialize)]
pub struct HoldFigures {
    /// Name of the scenario.
    pub scenario: &'static str,
    /// Name of the simulated model.
    pub model: &'static str,
    /// Number of flights.
    pub runs: u32,
    /// Root mean square error of the estimated altitude, with its 95 % interval, m.
    pub estimate_m: Estimate,
    /// Root mean square distance from the commanded altitude, with its 95 % interval, m.
    pub hold_m: Estimate,
    /// Fraction of the time during which the true altitude lies within the filter's 95 % band.
    pub inside: f64,
    /// Root mean square error of the estimated hover throttle.
    pub hover_throttle: f64,
    /// Mean ratio of squared error to variance for each state, away from events.
    pub states: Vec<Consistency>,
    /// Mean normalized innovation squared of satellites, ranger and barometer, away from events.
    pub nis: [Option<f64>; 3],
    /// Mean numbers of floor steps per flight that the filter detected and the ranger flew over.
    pub steps: [f64; 2],
    /// Limits of the figures. `None` for a scenario without limits.
    pub bounds: Option<Bounds>,
    /// Messages, one for each exceeded limit.
    pub missed: Vec<String>,
}

/// Consistency between the filter's variance of a state and the state's actual error.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub struct Consistency {
    /// Name of the state.
    pub state: &'static str,
    /// Mean ratio of squared error to variance, over time and flights, with its 95 % interval.
    pub error: Estimate,
    /// Class of the mean ratio.
    pub verdict: HoldVerdict,
}

settings! {
    /// Class of an estimated standard deviation by its ratio to the actual error ([`CONSISTENT`]).
    pub enum HoldVerdict {
        /// The estimated standard deviation is right.
        "consistent" => Consistent,
        /// The estimated standard deviation is too small.
        "overconfident" => Overconfident,
        /// The estimated standard deviation is too large.
        "conservative" => Conservative,
    }
}

impl HoldVerdict {
    /// Classifies a mean ratio of squared error to variance, which is 1 for a consistent filter. A
    /// smaller ratio is conservative, a larger one overconfident.
    fn from_ratio(mean_ratio: f64) -> Self {
        match mean_ratio {
            ratio if ratio < CONSISTENT[0] => Self::Conservative,
            ratio if ratio > CONSISTENT[1] => Self::Overconfident,
            _ => Self::Consistent,
        }
    }
}

/// Limits for the figures of a scenario.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Bounds {
    /// Maximum root mean square error of the estimated altitude, m.
    pub estimate_m: f64,
    /// Maximum root mean square distance from the commanded altitude, m.
    pub hold_m: f64,
    /// Minimum and maximum fraction of the time within the 95 % band.
    pub inside: [f64; 2],
    /// Maximum root mean square error of the estimated hover throttle.
    pub hover_throttle: f64,
    /// Minimum and maximum normalized innovation squared.
    pub nis: [f64; 2],
    /// Maximum difference between the numbers of detected and actual floor steps per flight.
    pub steps: f64,
}

impl Bounds {
    /// Returns the limits of a scenario: errors of the estimate and of the hold in m, the fraction
    /// within the band, the consistency of the innovations, the error of the hover throttle, and
    /// the error of the number of floor steps. Returns `None` for a floor step during a satellite
    /// outage, in which only the barometer measures the altitude.
    fn new(scenario: HoldScenario) -> Option<Self> {
        // The limits in m lie at least 12 % above the figures in docs/hold.md.
        let (estimate_m, hold_m) = match scenario {
            HoldScenario::Calm | HoldScenario::Drift => (0.027, 0.056),
            HoldScenario::Step => (0.028, 0.056),
            HoldScenario::Silent => (0.038, 0.070),
            HoldScenario::Drain => (0.027, 0.068),
            HoldScenario::StepSilent => return None,
        };
        let (inside, nis, hover_throttle) = ([0.94, 0.98], [0.8, 1.15], 0.006);
        Some(Self { estimate_m, hold_m, inside, hover_throttle, nis, steps: 0.1 })
    }
}

/// Flies a scenario `runs` times, with the seeds `seed`, `seed` + 1 …, and returns its figures.
///
/// # Errors
///
/// Returns the errors of [`hold`]. Returns [`noctograph_core::error::Error::Input`] if `runs` is 0
/// or over 10 000.
pub fn hold_figures(
    model: HoldModel,
    options: &SimOptions,
    scenario: HoldScenario,
    seed: u64,
    runs: u32,
) -> Result<HoldFigures> {
    within("runs", runs.into(), 1.0, MAX_RUNS)?;
    // Only the means of each flight are kept, so that ten thousand flights fit in memory.
    let flown = (0..runs).into_par_iter().map(|run| {
        Ok(FlightMeans::new(&hold(model, options, scenario, DURATION_S, seed + u64::from(run))?))
    });
    // All results are collected first, so that the first of several errors is returned.
    let results: Vec<Result<FlightMeans>> = flown.collect();
    let flights: Vec<FlightMeans> = results.into_iter().collect::<Result<_>>()?;
    let mean_of = |value: fn(&FlightMeans) -> f64| mean(flights.iter().map(value));
    let root_mean_square = |square: fn(&FlightMeans) -> f64| {
        bootstrap(&[flights.iter().map(square).collect()], |squares| mean(&*squares).sqrt())
    };
    let states = STATE_NAMES.iter().enumerate().map(|(index, state)| {
        let squares = flights.iter().map(|run| run.states[index]).collect();
        let error = bootstrap(&[squares], |squares| mean(&*squares));
        Consistency { state, error, verdict: HoldVerdict::from_ratio(error.value) }
    });
    let mut figures = HoldFigures {
        scenario: scenario.name(),
        model: model.name(),
        runs,
        estimate_m: root_mean_square(|run| run.estimate_m2),
        hold_m: root_mean_square(|run| run.hold_m2),
        inside: mean_of(|run| run.inside),
        hover_throttle: mean_of(|run| run.hover_throttle_sq).sqrt(),
        states: states.collect(),
        nis: AltitudeSensor::ALL.map(|sensor| {
            let sums = flights.iter().map(|run| run.nis[sensor as usize]);
            let (sum, n) = sums.fold((0.0, 0.0), |(sum, n), (s, m)| (sum + s, n + m));
            (n > 0.0).then(|| sum / n)
        }),
        steps: [mean_of(|run| run.steps[0]), mean_of(|run| run.steps[1])],
        bounds: Bounds::new(scenario),
        missed: Vec::new(),
    };
    figures.missed = figures.misses();
    Ok(figures)
}

/// Means over the samples of one flight.
#[derive(Debug)]
struct FlightMeans {
    estimate_m2: f64,
    hold_m2: f64,
    inside: f64,
    hover_throttle_sq: f64,
    /// Mean ratio of squared error to variance for each state.
    states: [f64; 6],
    /// Sum and number of the normalized innovations squared, for each sensor.
    nis: [(f64, f64); 3],
    /// Numbers of floor steps: detected by the filter, and flown over by the ranger.
    steps: [f64; 2],
}

impl FlightMeans {
    /// Computes the means of a flight from [`FROM_S`] on. The ratios of squared error to variance
    /// and the innovations are taken at least [`EVENT_S`] away from each event.
    fn new(flight: &Hold) -> Self {
        let events_s = flight.events_s();
        let samples: Vec<_> = flight.samples.iter().filter(|s| s.time_s >= FROM_S).collect();
        // The filter's model deliberately excludes events.
        let mut quiet = samples.clone();
        quiet.retain(|s| !events_s.iter().any(|event_s| (s.time_s - event_s).abs() <= EVENT_S));
        let errors_m: Vec<f64> = samples.iter().map(|s| s.estimate[0] - s.truth[0]).collect();
        // Sums and numbers are kept, so that flights with more readings are given more weight.
        let mut nis = [(0.0, 0.0); 3];
        for reading in quiet.iter().flat_map(|s| &s.readings).filter(|reading| reading.taken) {
            let (sum, n) = &mut nis[reading.sensor as usize];
            *sum += reading.innovation.nis();
            *n += 1.0;
        }
        Self {
            estimate_m2: mean(errors_m.iter().map(|error_m| error_m * error_m)),
            hold_m2: mean(samples.iter().map(|s| square(s.truth[0] - flight.set_m))),
            // A normally distributed error is within 1.96 standard deviations for 95 % of the time.
            inside: mean(
                samples.iter().zip(&errors_m).map(|(s, e)| f64::from(e.abs() < 1.96 * s.sigma[0])),
            ),
            hover_throttle_sq: mean(samples.iter().map(|sample| {
                let [truth, estimate] = sample.hover_throttle();
                square(estimate - truth)
            })),
            states: std::array::from_fn(|i| {
                mean(quiet.iter().map(|s| square((s.estimate[i] - s.truth[i]) / s.sigma[i])))
            }),
            nis,
            steps: [flight.steps.into(), events_s.len() as f64],
        }
    }
}

fn square(value: f64) -> f64 {
    value * value
}

impl HoldFigures {
    /// Returns a message for each limit that the figures exceed.
    fn misses(&self) -> Vec<String> {
        let Some(bounds) = self.bounds else { return Vec::new() };
        let Bounds { estimate_m, hold_m, inside: [low, high], hover_throttle, nis, steps } = bounds;
        let mut missed = Vec::new();
        for (name, error_m, limit_m) in
            [("estimate", self.estimate_m.value, estimate_m), ("hold", self.hold_m.value, hold_m)]
        {
            if error_m > limit_m {
                let [error_cm, limit_cm] = [error_m, limit_m].map(|m| 100.0 * m);
                missed.push(format!("{name} error of {error_cm:.1} cm exceeds {limit_cm:.1} cm"));
            }
        }
        if !(low..=high).contains(&self.inside) {
            missed.push(format!(
                "inside the 95 % band for a fraction of {:.3}, not {low} to \
                                 {high}",
                self.inside
            ));
        }
        if self.hover_throttle > hover_throttle {
            let throttle = self.hover_throttle;
            missed.push(format!("hover throttle error {throttle:.4} above {hover_throttle}"));
        }
        // Innovations have limits in both directions, states only against a σ that is too small.
        let [least, most] = nis;
        let beyond = self.nis.iter().flatten().filter(|nis| !(least..=most).contains(*nis));
        missed.extend(beyond.map(|nis| format!("the NIS is {nis:.2}, not {least} to {most}")));
        let overconfident = self.states.iter().filter(|s| s.verdict == HoldVerdict::Overconfident);
        missed.extend(overconfident.map(|Consistency { state, error, .. }| {
            format!("{state} is overconfident: squared error / variance {:.2}", error.value)
        }));
        let [detected, passed] = self.steps;
        if (detected - passed).abs() > steps {
            missed.push(format!("{detected:.2} of {passed:.2} steps were detected"));
        }
        missed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_pipeline::scene::{Preset, Scene};

    fn figures(model: HoldModel, scenario: HoldScenario, runs: u32) -> HoldFigures {
        hold_figures(model, &Scene::preset(Preset::Bzzz).sim(), scenario, 0, runs).unwrap()
    }

    #[test]
    fn every_scenario_keeps_to_its_limits_in_the_scalar_model() {
        for scenario in HoldScenario::ALL {
            let figures = figures(HoldModel::Scalar, *scenario, 80);
            assert_eq!(figures.missed, [""; 0], "{figures:?}");
            assert_consistent(&figures);
        }
    }

    /// Asserts that the variances of motion and thrust are at least as large as the errors imply.
    fn assert_consistent(figures: &HoldFigures) {
        let [least, most] = CONSISTENT;
        for (index, Consistency { state, error, .. }) in figures.states.iter().enumerate() {
            let what = format!("{}, {}, {state}: {error:?}", figures.model, figures.scenario);
            assert!(error.low <= most, "{what}");
            // The filter assumes an uneven floor and a drifting barometer, which are not simulated
            // here.
            assert!(index >= 4 || error.high >= least, "{what}");
        }
    }

    #[test]
    fn the_full_simulator_keeps_to_the_limits_too() {
        for scenario in HoldScenario::ALL {
            // With only eight flights, a single one with an unusual gain would decide the result.
            let figures = figures(HoldModel::Full, *scenario, 12);
            assert_consistent(&figures);
            let Some(bounds) = figures.bounds else { continue };
            // The limits were chosen for more flights, so they are relaxed by 15 % here.
            assert!(figures.estimate_m.value < 1.15 * bounds.estimate_m, "{figures:?}");
            assert!(figures.hold_m.value < 1.15 * bounds.hold_m, "{figures:?}");
            assert!((0.92..=0.99).contains(&figures.inside), "{figures:?}");
            assert!(
                figures.nis.iter().flatten().all(|nis| (0.7..=1.3).contains(nis)),
                "{figures:?}"
            );
            assert!((figures.steps[0] - figures.steps[1]).abs() <= bounds.steps, "{figures:?}");
            assert_eq!(scenario.has_step(), figures.steps[1] > 0.0, "{figures:?}");
        }
    }

    #[test]
    fn an_unknown_offset_beside_a_gain_that_walks_is_found_overconfident() {
        let [unknown, known] = [(1.4, 3.0), (0.1, 1.9)].map(|sigmas| {
            let mut options = Scene::preset(Preset::Bzzz).sim();
            let filter = &mut options.observer.altitude;
            filter.gain_walk_m_s2_sqrt_s = 0.8;
            (filter.offset_sigma_m_s2, filter.gain_sigma_m_s2) = sigmas;
            hold_figures(HoldModel::Scalar, &options, HoldScenario::Calm, 0, 80).unwrap()
        });
        let verdicts = [2, 3].map(|index| unknown.states[index].verdict);
        assert_eq!(verdicts, [HoldVerdict::Overconfident; 2], "{unknown:?}");
        for state in ["α⁰", "α¹"] {
            let start = format!("{state} is overconfident");
            assert!(unknown.missed.iter().any(|text| text.starts_with(&start)), "{unknown:?}");
        }
        // If gravity is known, the filter's random walk of the gain, which no battery causes, only
        // widens σ.
        assert_eq!(known.states[3].verdict, HoldVerdict::Conservative, "{known:?}");
    }

    #[test]
    fn a_missed_limit_is_named() {
        let mut figures = figures(HoldModel::Scalar, HoldScenario::Calm, 2);
        (figures.hold_m.value, figures.steps[0]) = (0.2, 1.0);
        let missed = figures.misses();
        assert_eq!(missed.len(), 2, "{missed:?}");
        assert!(missed[0].starts_with("hold error of 20.0 cm exceeds 5.6 cm"), "{missed:?}");
        let options = Scene::preset(Preset::Bzzz).sim();
        let none = hold_figures(HoldModel::Scalar, &options, HoldScenario::Calm, 0, 0);
        assert!(none.unwrap_err().to_string().starts_with("runs: found 0"));
    }
}
