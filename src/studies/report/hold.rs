//! Figure of a flight at constant altitude: truth, estimates with their bands, innovations.

use super::canvas::Pen;
use super::figure::{BLACK, BLUE, Curve, Figure, GRAY, Panel, VERMILION};
use crate::{Hold, HoldSample};
use noctograph_sim::{AltitudeSensor, HeightReading};

/// Height of a panel.
const PANEL_PX: f64 = 150.0;
const TRUTH: Pen = Pen::new(BLACK, 1.0);
const ESTIMATE: Pen = Pen::new(BLUE, 1.5);
const SECOND: Pen = Pen::new(VERMILION, 1.5);
const THIRD: Pen = Pen::new([0, 158, 115], 1.0);
const SET: Pen = Pen::new([230, 159, 0], 1.0);
const THROWN: Pen = Pen::new([204, 121, 167], 2.0);
const BAND: Pen = Pen::new(GRAY, 1.0);

/// Innovations beyond this are drawn at the edge of their panel.
const EDGE_SIGMAS: f64 = 5.0;

/// Five panels over the time: altitude, vertical velocity, thrust map, biases, innovations in
/// standard deviations. Bands are two standard deviations; strokes at the edge of the last panel
/// are ranges that the filter threw away.
pub fn hold_figure(flight: &Hold, title: &str) -> String {
    let curve = |pen, value: &dyn Fn(&HoldSample) -> f64| {
        Curve::whole(pen, flight.samples.iter().map(|s| (s.time_s, value(s))))
    };
    let state = |index: usize, pen: Pen| {
        vec![
            curve(BAND, &|s| s.estimate[index] + 2.0 * s.sigma[index]),
            curve(BAND, &|s| s.estimate[index] - 2.0 * s.sigma[index]),
            curve(TRUTH, &|s| s.truth[index]),
            curve(pen, &|s| s.estimate[index]),
        ]
    };
    let innovations = vec![
        innovation(flight, AltitudeSensor::Gnss, ESTIMATE),
        innovation(flight, AltitudeSensor::TimeOfFlight, SECOND),
        innovation(flight, AltitudeSensor::Barometer, THIRD),
        curve(BAND, &|_| 2.0),
        curve(BAND, &|_| -2.0),
        thrown_away(flight),
    ];
    let thrust = vec![
        curve(TRUTH, &|s| s.hover_throttle()[0]),
        curve(ESTIMATE, &|s| s.hover_throttle()[1]),
        curve(SECOND, &|s| 0.01 * s.estimate[3]),
        curve(TRUTH, &|s| 0.01 * s.truth[3]),
    ];
    let altitude = [vec![curve(SET, &|_| flight.set_m)], state(0, ESTIMATE)].concat();
    let end_s = flight.samples.last().map_or(1.0, |last| last.time_s);
    let panel = |[low, high]: [f64; 2], y_name, curves| {
        Panel::new([0.0..end_s, low..high], PANEL_PX, y_name, curves)
    };
    Figure {
        title: format!("altitude hold: {title}"),
        legend: vec![
            ("truth".to_owned(), TRUTH),
            ("estimate; bias of barometer".to_owned(), ESTIMATE),
            ("α1/100; bias of ranger".to_owned(), SECOND),
            ("± 2 σ".to_owned(), BAND),
            ("set".to_owned(), SET),
            ("thrown away".to_owned(), THROWN),
        ],
        x_name: "time (s)",
        panels: vec![
            panel([flight.set_m - 0.3, flight.set_m + 0.3], "z (m)", altitude),
            panel([-0.5, 0.5], "v (m/s)", state(1, ESTIMATE)),
            panel([0.2, 0.5], "throttle", thrust),
            panel([-1.0, 1.6], "bias (m)", [state(4, SECOND), state(5, ESTIMATE)].concat()),
            panel([-EDGE_SIGMAS, EDGE_SIGMAS], "innovation (σ)", innovations),
        ],
    }
    .svg()
}

/// Curve of a sensor's accepted innovations, in standard deviations, interrupted at rejected ones.
fn innovation(flight: &Hold, sensor: AltitudeSensor, pen: Pen) -> Curve {
    fn sigmas(reading: &HeightReading) -> f64 {
        let sigmas = reading.innovation.value / reading.innovation.variance.sqrt();
        sigmas.clamp(-EDGE_SIGMAS, EDGE_SIGMAS)
    }
    let points = flight.samples.iter().map(|sample| {
        let reading = sample.readings.iter().find(|reading| reading.sensor == sensor)?;
        reading.taken.then(|| (sample.time_s, sigmas(reading)))
    });
    let points: Vec<Option<(f64, f64)>> = points.collect();
    let taken = points.split(Option::is_none).filter(|piece| piece.len() > 1);
    Curve { pen, pieces: taken.map(|piece| piece.iter().copied().flatten().collect()).collect() }
}

/// A stroke at the edge for each reading that was thrown away.
fn thrown_away(flight: &Hold) -> Curve {
    let all = flight.samples.iter().flat_map(|s| s.readings.iter().map(move |r| (s.time_s, r)));
    let thrown = all.filter(|(_, reading)| !reading.taken);
    fn stroke((time_s, reading): (f64, &HeightReading)) -> Vec<(f64, f64)> {
        let side = EDGE_SIGMAS.copysign(reading.innovation.value);
        vec![(time_s, 0.7 * side), (time_s, side)]
    }
    Curve { pen: THROWN, pieces: thrown.map(stroke).collect() }
}
