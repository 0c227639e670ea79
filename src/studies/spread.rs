//! Spread: how much flights of one plan vary, and how many of their photos are legible.
//!
//! Products in: a shoot and [`Conditions`]. Products out: photos and verdicts of flights, and two
//! [`Band`]s for each drone. The first band covers flights that differ in room and drone, the
//! second band covers flights of one drone in one room. [`Conditions`] are drawn once per flight:
//! mass, trim, rotors and charge of the drone, and the geometry of the base stations. Gusts and
//! sensor noise vary within a flight.

use nalgebra::Vector3;
use rayon::prelude::*;

use super::Conditions;
use super::experiment::counter;
use super::trial::{or_lost, reader, shrink};
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{Flight, FlightSample};
use noctograph_picture::expose::BackendChoice;
use noctograph_picture::photo::Photo;
use noctograph_pipeline::shoot::{Judging, Shoot};
use noctograph_score::{Verdict, is_judged};

/// Fraction of the flights that lie within a band at each time.
pub const BAND_FRAC: f64 = 0.9;
/// Minimum number of flights for a band of that fraction: their values form twenty intervals, of
/// which two are outside the band.
pub const LEAST_FLIGHTS: usize = 19;
/// Time step of a band.
const STEP_S: f64 = 0.1;
/// Cap height in the photos.
const CAP_HEIGHT_PX: f64 = 64.0;

/// Flights of one plan under varied conditions.
#[derive(Clone, Debug)]
pub struct Spread {
    /// Flights that differ in room and drones.
    pub flights: Vec<SpreadFlight>,
    /// Band of these flights, one for each drone.
    pub all: Vec<Band>,
    /// Band, one per drone, of as many flights with the drones and the room of the first seed.
    pub within: Vec<Band>,
}

/// One flight of a spread.
#[derive(Clone, Debug)]
pub struct SpreadFlight {
    /// Seed of the flight's noise and of its differences from the scene.
    pub seed: u64,
    /// Flights, photo and verdict, or the cause of the loss of a drone.
    pub shot: std::result::Result<SpreadShot, String>,
}

/// The products of a flight that was not lost.
#[derive(Clone, Debug)]
pub struct SpreadShot {
    /// Flights, one for each drone.
    pub flights: Vec<Flight>,
    /// Photo developed from a small film.
    pub photo: Photo,
    /// Verdict. `None` if the reader cannot judge the letters.
    pub verdict: Option<Verdict>,
}

/// The band that contains [`BAND_FRAC`] of the flights on each axis at each time. With fewer than
/// [`LEAST_FLIGHTS`] flights the band contains all of them ([`Band::holds_frac`]).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Band {
    /// Number of flights from which the band is computed.
    pub n_flights: usize,
    /// Times, 0.1 s apart.
    pub time_s: Vec<f64>,
    /// Lower end, median and upper end of the positions at each time step.
    pub ends_m: Vec<[Vector3<f64>; 3]>,
    /// Designed position at each time step.
    pub design_m: Vec<Vector3<f64>>,
    /// True at each time step during which a letter is being written.
    pub writes: Vec<bool>,
}

impl Band {
    /// Creates the band of `position_m` over flights of one plan, at a time step of 0.1 s.
    pub fn new(flights: &[&Flight], position_m: impl Fn(&FlightSample) -> Vector3<f64>) -> Self {
        let mut band = Self { n_flights: flights.len(), ..Self::default() };
        let Some(first) = flights.first() else { return band };
        let mut next_s = f64::NEG_INFINITY;
        for (index, sample) in first.samples.iter().enumerate() {
            // Samples are skipped until the next time step. The margin allows for rounding errors.
            if sample.time_s < next_s - 1e-9 {
                continue;
            }
            next_s = sample.time_s.max(next_s) + STEP_S;
            // Flights of one plan are sampled at the same times.
            let samples = flights.iter().filter_map(|flight| flight.samples.get(index));
            let positions_m: Vec<Vector3<f64>> = samples.map(&position_m).collect();
            let quantiles_m =
                [0, 1, 2].map(|axis| band_quantiles(positions_m.iter().map(|p| p[axis]).collect()));
            band.time_s.push(sample.time_s);
            let [x_m, y_m, z_m] = quantiles_m;
            band.ends_m.push([0, 1, 2].map(|end| Vector3::new(x_m[end], y_m[end], z_m[end])));
            band.design_m.push(sample.design_m);
            band.writes.push(sample.letter.is_some());
        }
        band
    }

    /// Returns the fraction of further flights that the band will contain. With n flights, fewer
    /// than [`LEAST_FLIGHTS`], it is the fraction between their extremes, `(n − 1) / (n + 1)`,
    /// otherwise [`BAND_FRAC`].
    pub fn holds_frac(&self) -> f64 {
        let n = self.n_flights as f64;
        BAND_FRAC.min((n - 1.0).max(0.0) / (n + 1.0))
    }

    /// Returns half the mean width of the band on each axis while letters are written, or over all
    /// times if no letter is written.
    pub fn half_width_m(&self) -> Vector3<f64> {
        let has_letters = self.writes.contains(&true);
        let ends_m = self.ends_m.iter().zip(&self.writes);
        let counted = ends_m.filter(|(_, writes)| **writes || !has_letters);
        let widths_m: Vec<Vector3<f64>> =
            counted.map(|([low, _, high], _)| 0.5 * (high - low)).collect();
        let n = widths_m.len().max(1) as f64;
        widths_m.iter().sum::<Vector3<f64>>() / n
    }
}

/// Returns the quantiles that define a band: its lower end, its median and its upper end, in the
/// unit of `values`. They are NaN without values.
fn band_quantiles(mut values: Vec<f64>) -> [f64; 3] {
    values.sort_by(f64::total_cmp);
    let tail = 0.5 * (1.0 - BAND_FRAC);
    [tail, 0.5, 1.0 - tail].map(|probability| quantile(&values, probability))
}

/// Returns the quantile of sorted values below which a further value lies with the given
/// probability from 0 to 1. It uses Weibull's plotting position, `k / (n + 1)`, and is limited to
/// the extremes. Without values the result is NaN.
fn quantile(sorted: &[f64], probability: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let rank = (probability * (last as f64 + 2.0) - 1.0).clamp(0.0, last as f64);
    #[expect(clippy::cast_possible_truncation, reason = "clamped")]
    let below = rank.floor() as usize;
    let above = (below + 1).min(last);
    sorted[below] + (sorted[above] - sorted[below]) * (rank - rank.floor())
}

/// Flies a shoot with `n` seeds, beginning with the scene's, each with different drones and a
/// different room. Then flies the same seeds with the drones and the room of the first seed. Calls
/// `done` with the number of finished flights.
///
/// # Errors
///
/// Returns the errors of the stages, except a lost drone. Returns [`Error::Infeasible`] if every
/// flight is lost.
pub fn spread(
    shoot: &Shoot,
    conditions: &Conditions,
    n: usize,
    done: &(dyn Fn(usize) + Sync),
) -> Result<Spread> {
    conditions.check()?;
    let (judging, backend) = (Judging::Scored, BackendChoice::Cpu);
    let mut base = Shoot { judging, backend, format: None, keeps_film: false, ..shoot.clone() };
    if let Some(strokes) = base.strokes.as_ref().filter(|strokes| is_judged(strokes)) {
        base.reader = Some(reader(strokes, &base.scene.score)?);
    }
    // Small films are sufficient for a contact sheet.
    shrink(&mut base, CAP_HEIGHT_PX)?;
    let first = shoot.scene.seed;
    let count = counter(done);
    let seeds: Vec<u64> = (first..).take(n).collect();
    // Each seed is flown with its own room and drones, photographed and read.
    let flights = seeds.par_iter().map(|seed| {
        let shot = or_lost(with_seeds(&base, conditions, *seed, *seed).take(&|_, _| {}));
        count();
        let shot =
            shot?.map(|s| SpreadShot { flights: s.flights, photo: s.photo, verdict: s.verdict });
        Ok(SpreadFlight { seed: *seed, shot })
    });
    let flights: Vec<SpreadFlight> = flights.collect::<Result<_>>()?;
    // The same seeds are flown with the drones and the room of the first seed, without a photo.
    let again = seeds.par_iter().map(|seed| {
        let flown = or_lost(with_seeds(&base, conditions, *seed, first).fly(&|_, _| {}));
        count();
        flown
    });
    let again: Vec<_> = again.collect::<Result<_>>()?;
    let flown: Vec<&Vec<Flight>> =
        flights.iter().filter_map(|flight| Some(&flight.shot.as_ref().ok()?.flights)).collect();
    let flown_again: Vec<&Vec<Flight>> = again.iter().flatten().collect();
    if flown.is_empty() || flown_again.is_empty() {
        let lost = flights.iter().find_map(|flight| flight.shot.as_ref().err());
        return Err(Error::infeasible(
            format!("every flight is lost: {}", lost.map_or("", String::as_str)),
            "fly the scene without varied conditions, or under milder conditions",
        ));
    }
    let [varied, within] = [flown, flown_again].map(|fleets| {
        let bands = (0..base.plans.len()).map(|drone| {
            let flights: Vec<&Flight> = fleets.iter().map(|flights| &flights[drone]).collect();
            Band::new(&flights, |sample| sample.position_m)
        });
        bands.collect()
    });
    Ok(Spread { all: varied, within, flights })
}

/// Returns a shoot with the noise of `seed`, and with the drones and the room of `room_seed`.
fn with_seeds(base: &Shoot, conditions: &Conditions, seed: u64, room_seed: u64) -> Shoot {
    let mut shoot = Shoot { room_seed: Some(room_seed), ..base.clone() };
    let actual = (0..).map(|drone| conditions.draw(&base.scene, room_seed, drone));
    shoot.actual = actual.take(base.plans.len()).collect();
    shoot.scene.seed = seed;
    shoot
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::flight::FlightData;
    use noctograph_pipeline::scene::{Preset, Scene};

    fn sample(time_s: f64, x_m: f64) -> FlightSample {
        let position_m = Vector3::new(x_m, 0.0, 1.0);
        FlightSample { time_s, position_m, letter: Some(0), ..FlightSample::default() }
    }

    fn flight(k: u32) -> Flight {
        let samples =
            (0..1000).map(|i| sample(0.1 * f64::from(i), f64::from((i * 7 + k * 53) % 199)));
        Flight::made(FlightData { samples: samples.collect(), ..FlightData::default() })
    }

    #[test]
    fn a_band_holds_nine_tenths_of_equal_flights() {
        let flights: Vec<Flight> = (0..199).map(flight).collect();
        let band = Band::new(&flights.iter().collect::<Vec<_>>(), |sample| sample.position_m);
        let one = flight(3);
        let inside = band
            .ends_m
            .iter()
            .zip(&one.samples)
            .filter(|([low, _, high], sample)| (low.x..=high.x).contains(&sample.position_m.x));
        let inside_frac = inside.count() as f64 / band.ends_m.len() as f64;
        assert!((inside_frac - 0.9).abs() < 0.02, "{inside_frac}");
        assert!((band.half_width_m().x - 90.0).abs() < 1.0, "{}", band.half_width_m());
        assert_eq!((band.n_flights, band.holds_frac()), (199, BAND_FRAC));
        let [two, few, enough] = [2, 18, LEAST_FLIGHTS]
            .map(|n_flights| Band { n_flights, ..Band::default() }.holds_frac());
        assert_eq!((two, few < BAND_FRAC, enough), (1.0 / 3.0, true, BAND_FRAC));
    }

    #[test]
    fn flights_of_one_room_and_drone_lie_closer_than_those_of_many() {
        let scene = Scene { word: "I".into(), ..Scene::preset(Preset::Ae4832022) };
        let shoot = Shoot::new(scene).unwrap();
        let bands = spread(&shoot, &Conditions::any_drone(), 19, &|_| {}).unwrap();
        let [all_m, within_m] = [&bands.all[0], &bands.within[0]].map(Band::half_width_m);
        assert!(within_m.x < 0.7 * all_m.x, "{within_m} of {all_m}");
        assert!(bands.flights.iter().all(|flight| flight.shot.is_ok()));
        let still = spread(&shoot, &Conditions::still(), 19, &|_| {}).unwrap();
        assert!(still.all[0].half_width_m().x < within_m.x, "noise alone");
    }
}
