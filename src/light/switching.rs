//! From commands to light: radio delay, firmware tick, and the lamp's way while it is lit.

use nalgebra::Vector3;

use super::{Emitter, LightOptions, LightSample};
use crate::flight::{Flight, FlightSample};

/// A lamp changes its level.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Change {
    time_s: f64,
    level: f64,
}

/// The samples of an emitter over a flight; none where it is never lit.
///
/// While dark, a lamp leaves no samples: each lit run begins and ends with a step from and to
/// level 0. It is dark across the holes of a real log, where nobody knows where it was.
pub(super) fn shine(
    flight: &Flight,
    emitter: &Emitter,
    options: &LightOptions,
) -> Vec<LightSample> {
    let mut changes = changes(flight, emitter, options).into_iter().peekable();
    let (mut level, mut samples) = (0.0, Vec::new());
    let mut before: Option<LightSample> = None;
    let mut gaps = flight.gaps.iter().peekable();
    for sample in &flight.samples {
        let here = lamp(sample, emitter);
        if gaps.next_if(|gap| gap[1] <= here.time_s).is_some() {
            if level > 0.0 {
                samples.extend(before);
                samples.push(here);
            }
            // A change inside the hole takes effect where the lamp is seen again.
            before = None;
        }
        while let Some(change) = changes.next_if(|change| change.time_s <= here.time_s) {
            let at = before.map_or(here, |before| between(before, here, change.time_s));
            samples.push(LightSample { level, ..at });
            level = change.level;
            samples.push(LightSample { level, ..at });
        }
        if level > 0.0 {
            samples.push(LightSample { level, ..here });
        }
        before = Some(here);
    }
    samples
}

/// When the light changes: each change of the command, delayed by the radio and held until the
/// timer's next tick. Of several commands within a tick the last one counts.
fn changes(flight: &Flight, emitter: &Emitter, options: &LightOptions) -> Vec<Change> {
    let Some(levels) = flight.lights.get(&emitter.channel) else { return Vec::new() };
    let mut changes: Vec<Change> = Vec::new();
    let mut commanded = 0.0;
    for (sample, &level) in flight.samples.iter().zip(levels) {
        if level == commanded {
            continue;
        }
        commanded = level;
        let time_s = next_tick_s(sample.time_s + options.radio_delay_s, options);
        changes.pop_if(|last| last.time_s >= time_s);
        changes.push(Change { time_s, level });
    }
    changes
}

/// The timer's first tick at or after `time_s`; without a timer, `time_s` itself.
fn next_tick_s(time_s: f64, options: &LightOptions) -> f64 {
    if options.tick_s == 0.0 {
        return time_s;
    }
    // The slack keeps a command that arrives on a tick from missing it by rounding.
    let ticks = ((time_s - options.tick_phase_s) / options.tick_s - 1e-9).ceil();
    options.tick_phase_s + ticks * options.tick_s
}

fn lamp(sample: &FlightSample, emitter: &Emitter) -> LightSample {
    let world_from_body = sample.attitude.world_from_body();
    LightSample {
        time_s: sample.time_s,
        position_m: sample.position_m + world_from_body * Vector3::from(emitter.position_body_m),
        axis: (world_from_body * Vector3::from(emitter.axis_body)).normalize(),
        level: 0.0,
    }
}

fn between(a: LightSample, b: LightSample, time_s: f64) -> LightSample {
    let span_s = b.time_s - a.time_s;
    let part = if span_s > 0.0 { ((time_s - a.time_s) / span_s).clamp(0.0, 1.0) } else { 1.0 };
    LightSample {
        time_s: time_s.clamp(a.time_s, b.time_s),
        position_m: a.position_m.lerp(&b.position_m, part),
        axis: a.axis.lerp(&b.axis, part).normalize(),
        level: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Attitude;
    use crate::light::light;

    /// 1 m/s along x for 2 s at 100 Hz, with the headlights commanded on from 0.5 s to 1.0 s.
    fn flight(yaw_rad: f64) -> Flight {
        let sample = |i: i32| FlightSample {
            time_s: f64::from(i) * 0.01,
            position_m: Vector3::new(f64::from(i) * 0.01, 0.0, 1.0),
            attitude: Attitude { yaw_rad, ..Attitude::default() },
            velocity_body_m_s: Vector3::x(),
            rate_body_rad_s: Vector3::zeros(),
            estimate_m: Vector3::zeros(),
            design_m: Vector3::zeros(),
            motors: [0.0; 4],
            letter: Some(0),
        };
        let levels = (0..=200).map(|i| if (50..100).contains(&i) { 1.0 } else { 0.0 }).collect();
        Flight {
            samples: (0..=200).map(sample).collect(),
            lights: [("headlights".to_owned(), levels)].into(),
            ..Flight::default()
        }
    }

    #[test]
    fn light_changes_on_the_tick_after_the_radio() {
        let trace = light(&flight(0.0), &LightOptions::default()).unwrap();
        assert_eq!(trace.lamps.len(), 2, "two headlights");
        let samples = &trace.lamps[0].samples;
        let (first, last) = (samples[0], samples[samples.len() - 1]);
        // 0.5 s + 20 ms of radio, then the next multiple of 50 ms.
        assert!((first.time_s - 0.55).abs() < 1e-12, "on at {} s", first.time_s);
        assert!((last.time_s - 1.05).abs() < 1e-12, "off at {} s", last.time_s);
        assert_eq!((first.level, last.level), (0.0, 0.0), "a lit run begins and ends with a step");
        assert!((first.position_m.x - 0.55 - 0.016).abs() < 1e-12, "at the lamp, not the body");
    }

    #[test]
    fn without_delay_and_tick_light_follows_the_command() {
        let options = LightOptions { radio_delay_s: 0.0, tick_s: 0.0, ..Default::default() };
        let trace = light(&flight(0.0), &options).unwrap();
        assert_eq!(trace.lamps[0].samples[0].time_s, 0.5);
    }

    #[test]
    fn no_light_crosses_a_hole_of_the_log() {
        let mut flight = flight(0.0);
        let lit = |flight: &Flight| -> f64 {
            let samples = &light(flight, &LightOptions::default()).unwrap().lamps[0].samples;
            let mean = |p: &[LightSample]| 0.5 * (p[0].level + p[1].level);
            samples.windows(2).map(|p| mean(p) * (p[1].time_s - p[0].time_s)).sum()
        };
        let hole = |s: &FlightSample| s.time_s > 0.7 + 1e-9 && s.time_s < 0.9 - 1e-9;
        let whole_s = lit(&flight);
        let levels = flight.lights.get_mut("headlights").unwrap();
        let kept = flight.samples.iter().zip(&*levels).filter(|(s, _)| !hole(s));
        *levels = kept.map(|(_, level)| *level).collect();
        flight.samples.retain(|s| !hole(s));
        assert!((lit(&flight) - whole_s).abs() < 1e-9, "bridged where no gap is told");
        flight.gaps = vec![[0.7, 0.9]];
        assert!((lit(&flight) - (whole_s - 0.2)).abs() < 1e-9, "{} of {whole_s} s", lit(&flight));
    }

    #[test]
    fn lamps_turn_with_the_body() {
        let trace = light(&flight(std::f64::consts::FRAC_PI_2), &LightOptions::default()).unwrap();
        let sample = trace.lamps[0].samples[0];
        assert!((sample.axis - Vector3::y()).norm() < 1e-12, "forward is now world y");
        let offset = sample.position_m - Vector3::new(0.55, 0.0, 1.0);
        assert!((offset - Vector3::new(-0.01, 0.016, -0.01)).norm() < 1e-12, "{offset}");
    }

    #[test]
    fn a_flight_without_light_columns_is_refused() {
        let flight = Flight { lights: std::collections::BTreeMap::new(), ..flight(0.0) };
        let error = light(&flight, &LightOptions::default()).unwrap_err().to_string();
        assert!(error.contains("light.headlights"), "{error}");
    }

    #[test]
    fn a_beam_fades_off_axis_to_its_spill() {
        let emitter = &LightOptions::default().emitters[0];
        assert_eq!(emitter.intensity_cd(1.0), 1.8, "on the axis");
        assert!((emitter.intensity_cd(0.0) - 0.09).abs() < 1e-12, "from the side");
        assert!((emitter.intensity_cd(-1.0) - 0.09).abs() < 1e-12, "from behind");
    }
}
