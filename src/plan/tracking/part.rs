//! Parts of a flight, which are the letters, the time in the air, and the whole flight.

use noctograph_core::error::{Error, Result};
use noctograph_core::flight::{Flight, FlightSample, Quantity, airborne};
use noctograph_core::settings::settings;

settings! {
    /// A part of a flight.
    pub enum Part {
        /// From take-off to landing.
        ///
        /// [`airborne`] finds both, as for the reference flight's figures.
        "airborne" => Airborne,
        /// Samples in which the drone writes letters.
        "letters" => Letters,
        /// Every sample, including those on the floor.
        "all" => All,
    }
}

impl Part {
    /// Returns the letters of a flight, or its time in the air if it writes none.
    pub fn from_flight(flight: &Flight) -> Self {
        let writes = flight.samples.iter().any(|sample| sample.letter.is_some());
        if writes { Self::Letters } else { Self::Airborne }
    }

    /// Returns the samples of this part in chronological order.
    ///
    /// # Errors
    ///
    /// Returns [`Error::Input`] if there are none, or if they have no position.
    pub fn samples(self, flight: &Flight) -> Result<Vec<FlightSample>> {
        Ok(self.selected(flight)?.into_iter().copied().collect())
    }

    /// Returns references to the samples of [`Self::samples`], and its errors.
    pub(crate) fn selected(self, flight: &Flight) -> Result<Vec<&FlightSample>> {
        if !flight.has(Quantity::Position) {
            let hint = "import a log with positions (mocap, Lighthouse or an estimator)";
            return Err(Error::input("flight", "no position", "columns x_m, y_m, z_m", hint));
        }
        // Each part has its samples, and a problem and a remedy for the case that there are none.
        let samples = &flight.samples;
        let (samples, actual, hint): (Vec<_>, _, _) = match self {
            Self::All => {
                (samples.iter().collect(), "no sample", "name a file that contains a flight")
            }
            Self::Letters => (
                samples.iter().filter(|sample| sample.letter.is_some()).collect(),
                "no sample is part of a letter",
                "compare the airborne part instead",
            ),
            Self::Airborne => (
                samples[airborne(flight).unwrap_or_default()].iter().collect(),
                "no sample in the air",
                "compare all samples instead",
            ),
        };
        if samples.is_empty() {
            return Err(Error::input("flight", actual, "at least one", hint).coded("part-empty"));
        }
        Ok(samples)
    }
}
