//! Assignment of a flight's samples to letters, and the tracking errors of each letter.

use std::collections::BTreeMap;

use super::{Part, Tracking, designed, measure};
use noctograph_core::error::Result;
use noctograph_core::flight::{Flight, FlightSample};
use noctograph_core::plan::Plan;

/// Returns the plan's time in s at which a flight's clock begins, from the first light of each.
/// Returns `None` if one of them contains no light.
pub fn on_plan_s(flight: &Flight, plan: &Plan) -> Option<f64> {
    let planned = first_lit(plan.lights.values());
    // A plan without lights begins to draw at its first setpoint within a letter.
    let planned = planned.or_else(|| plan.setpoints.iter().position(|s| s.letter.is_some()))?;
    let flown = first_lit(flight.lights.values())?;
    Some(plan.setpoints[planned].time_s - flight.samples[flown].time_s)
}

/// Returns the first row at which a channel is lit.
fn first_lit<'a>(channels: impl Iterator<Item = &'a Vec<f64>>) -> Option<usize> {
    channels.filter_map(|levels| levels.iter().position(|level| *level > 0.0)).min()
}

/// Adds the letters of the plan that a flight followed to a flight without letters. Does nothing if
/// the flight has letters, or if the first light of one of them is unknown.
pub fn letters_by_plan(flight: &mut Flight, plan: &Plan) {
    let Some(on_plan_s) = on_plan_s(flight, plan) else { return };
    if flight.samples.iter().any(|sample| sample.letter.is_some()) {
        return;
    }
    flight.edit(|flight| {
        for sample in &mut flight.samples {
            let time_s = sample.time_s + on_plan_s;
            let next = plan.setpoints.partition_point(|setpoint| setpoint.time_s <= time_s);
            let setpoint = next.checked_sub(1).map(|last| &plan.setpoints[last]);
            sample.letter = setpoint.and_then(|setpoint| setpoint.letter);
        }
    });
}

/// Measures the tracking errors of each letter of a flight, by its index.
///
/// # Errors
///
/// Returns the errors of [`super::track`] for [`Part::Letters`].
pub fn track_letters(flight: &Flight) -> Result<BTreeMap<usize, Tracking>> {
    let (samples, design) = designed(flight, Part::Letters)?;
    let mut letters: BTreeMap<usize, Vec<FlightSample>> = BTreeMap::new();
    for sample in samples {
        if let Some(letter) = sample.letter {
            letters.entry(letter).or_default().push(sample);
        }
    }
    let measured = letters
        .into_iter()
        .map(|(letter, samples)| (letter, measure(flight, Part::Letters, &samples, &design, 1)));
    Ok(measured.collect())
}

#[cfg(test)]
mod tests {
    use super::super::constructed::{flight, still};
    use super::*;
    use nalgebra::Vector3;
    use noctograph_core::plan::{PlanData, Setpoint};

    #[test]
    fn each_letter_has_its_lag_and_its_distance() {
        // The second letter lags by 0.2 s, and is flown 3 cm in front of the plane.
        let design = |time_s: f64| Vector3::new(0.1 * libm::sin(2.0 * time_s), 0.0, 1.0);
        let mut flown = flight(
            0.01,
            12.0,
            |time_s| {
                if time_s < 6.0 {
                    return design(time_s);
                }
                design(time_s - 0.2) + Vector3::new(0.0, -0.03, 0.0)
            },
            design,
        );
        let lit: Vec<f64> =
            flown.samples.iter().map(|s| f64::from(u8::from(s.time_s >= 1.0))).collect();
        flown.edit(|flight| {
            flight.samples.iter_mut().for_each(|sample| sample.letter = None);
            flight.lights.insert("headlights".to_owned(), lit);
        });
        // The plan's first light is 2 s later on its clock than the flight's.
        let setpoint = |time_s: f64| Setpoint {
            time_s,
            letter: (time_s >= 3.0).then_some(usize::from(time_s >= 8.0)),
            ..Setpoint::default()
        };
        let setpoints: Vec<Setpoint> = (0..1400).map(|k| setpoint(f64::from(k) * 0.01)).collect();
        let levels = setpoints.iter().map(|s| f64::from(u8::from(s.letter.is_some()))).collect();
        let lights = [("headlights".to_owned(), levels)].into();
        let plan = Plan::new(PlanData { setpoints, lights, ..PlanData::default() }).unwrap();
        letters_by_plan(&mut flown, &plan);
        let tracked = track_letters(&flown).unwrap();
        assert_eq!(Vec::from_iter(tracked.keys()), [&0, &1]);
        assert!(tracked[&0].lag_s.abs() < 1e-3 && tracked[&0].drift.min_y_m == 0.0, "{tracked:?}");
        assert!((tracked[&1].lag_s - 0.2).abs() < 1e-3, "{:?}", tracked[&1]);
        assert!((tracked[&1].drift.min_y_m + 0.03).abs() < 1e-12);
        assert!((tracked[&0].span_s[1] - 5.99).abs() < 1e-9, "{:?}", tracked[&0].span_s);
        let dark = flight(0.01, 1.0, still, still);
        assert_eq!(on_plan_s(&dark, &plan), None);
    }
}
