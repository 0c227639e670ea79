//! Plans that several tests look at.

use nalgebra::Vector3;

use noctograph_letters::{LetterOptions, write};
use noctograph_plan::{Plan, PlanData, PlanOptions, Setpoint, plan};

/// The plan of a word in the reference team's letters.
pub(crate) fn written(word: &str, options: &PlanOptions) -> Plan {
    plan(&write(word, &LetterOptions::default()).unwrap(), options).unwrap()
}

/// The drone hangs at one place from the start, and writes with its headlights.
pub(crate) fn hover(position_m: [f64; 3], end_s: f64) -> Plan {
    let (position_m, letter) = (Vector3::from(position_m), Some(0));
    let setpoints =
        [0.0, end_s].map(|time_s| Setpoint { time_s, position_m, letter, ..Setpoint::default() });
    let lights = [("headlights".to_owned(), vec![1.0; 2])].into();
    Plan::made(PlanData { setpoints: setpoints.into(), lights, ..PlanData::default() })
}
