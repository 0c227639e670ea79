//! The part of a flight that a figure speaks of.

use crate::error::{Error, Result};
use crate::flight::{Flight, FlightSample, Quantity, airborne};
use crate::settings::settings;

settings! {
    /// Part of a flight.
    pub enum Part {
        /// From take-off to landing.
        ///
        /// As [`airborne`] finds them: the part of the reference flight's figures.
        "airborne" => Airborne,
        /// The samples that write letters.
        "letters" => Letters,
        /// Every sample, those on the floor included.
        "all" => All,
    }
}

impl Part {
    /// The part that says most about a flight: its letters, or its time in the air where it writes
    /// none.
    #[must_use]
    pub fn of(flight: &Flight) -> Self {
        let writes = flight.samples.iter().any(|sample| sample.letter.is_some());
        if writes { Self::Letters } else { Self::Airborne }
    }

    /// The samples of this part, in order of time.
    ///
    /// # Errors
    ///
    /// [`Error::Input`] where there are none, or no position in them.
    pub fn samples(self, flight: &Flight) -> Result<Vec<FlightSample>> {
        if flight.unlogged.contains(&Quantity::Position) {
            let hint = "import a log with positions (mocap, Lighthouse or an estimator)";
            return Err(Error::input("flight", "no position", "columns x_m, y_m, z_m", hint));
        }
        let all = flight.samples.iter().copied();
        let samples: Vec<FlightSample> = match self {
            Self::All => all.collect(),
            Self::Letters => all.filter(|sample| sample.letter.is_some()).collect(),
            Self::Airborne => {
                let air = airborne(flight);
                air.map_or(Vec::new(), |air| flight.samples[air].to_vec())
            }
        };
        if samples.is_empty() {
            let (found, hint) = match self {
                Self::All => ("no sample", "name a file that holds a flight"),
                Self::Letters => {
                    ("no sample that writes a letter", "take the time in the air: --part airborne")
                }
                Self::Airborne => ("no sample in the air", "take the whole flight: --part all"),
            };
            return Err(Error::input("flight", found, "at least one", hint));
        }
        Ok(samples)
    }
}
