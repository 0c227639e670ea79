//! Draws a flight at constant altitude: true values, estimates with their bands, and innovations.

use super::canvas::Pen;
use super::figure::{BLACK, BLUE, Curve, Figure, GRAY, Panel, VERMILION};
use crate::{Hold, HoldSample};
use noctograph_sim::AltitudeSensor;

/// Height of each panel.
const PANEL_PX: f64 = 150.0;
const TRUTH: Pen = Pen::new(BLACK, 1.0);
const ESTIMATE: Pen = Pen::new(BLUE, 1.5);
const SECOND: Pen = Pen::new(VERMILION, 1.5);
const THIRD: Pen = Pen::new([0, 158, 115], 1.0);
const SET: Pen = Pen::new([230, 159, 0], 1.0);
const REJECTED: Pen = Pen::new([204, 121, 167], 2.0);
const BAND: Pen = Pen::new(GRAY, 1.0);

/// Innovation at the edge of the panel, in standard deviations. Larger ones are drawn there.
const EDGE_SIGMAS: f64 = 5.0;

/// Returns an SVG with five panels over time: altitude, vertical velocity, thrust map, biases, and
/// innovations in standard deviations. The bands extend two standard deviations to each side. Short
/// strokes at the edge of the last panel mark readings that the filter rejected.
pub fn hold_figure(flight: &Hold, title: &str) -> String {
    let set = curve(flight, SET, |_| flight.set_m);
    let thrust = vec![
        curve(flight, TRUTH, |s| s.hover_throttle()[0]),
        curve(flight, ESTIMATE, |s| s.hover_throttle()[1]),
        curve(flight, SECOND, |s| 0.01 * s.estimate[3]),
        curve(flight, TRUTH, |s| 0.01 * s.truth[3]),
    ];
    let innovations = vec![
        innovation(flight, AltitudeSensor::Gnss, ESTIMATE),
        innovation(flight, AltitudeSensor::TimeOfFlight, SECOND),
        innovation(flight, AltitudeSensor::Barometer, THIRD),
        curve(flight, BAND, |_| 2.0),
        curve(flight, BAND, |_| -2.0),
        rejected(flight),
    ];
    let [altitude, velocity] = [0, 1].map(|index| state(flight, index, ESTIMATE));
    let biases = [state(flight, 4, SECOND), state(flight, 5, ESTIMATE)].concat();
    let end_s = flight.samples.last().map_or(1.0, |last| last.time_s);
    // The ranges are fixed, so that figures of different flights can be compared.
    let panels = [
        (flight.set_m - 0.3..flight.set_m + 0.3, "z (m)", [vec![set], altitude].concat()),
        (-0.5..0.5, "v (m/s)", velocity),
        (0.2..0.5, "throttle", thrust),
        (-1.0..1.6, "bias (m)", biases),
        (-EDGE_SIGMAS..EDGE_SIGMAS, "innovation (σ)", innovations),
    ]
    .map(|(range, name, curves)| Panel::new([0.0..end_s, range], PANEL_PX, name, curves));
    let legend = [
        ("truth", TRUTH),
        ("estimate, bias of barometer", ESTIMATE),
        ("α1/100, bias of ranger", SECOND),
        ("± 2 σ", BAND),
        ("set", SET),
        ("thrown away", REJECTED),
    ];
    Figure {
        title: format!("altitude hold: {title}"),
        legend: legend.map(|(name, pen)| (name.to_owned(), pen)).into(),
        x_name: "time (s)",
        panels: panels.into(),
    }
    .svg()
}

/// Returns the curve of a value over time in s.
fn curve(flight: &Hold, pen: Pen, value: impl Fn(&HoldSample) -> f64) -> Curve {
    Curve::whole(pen, flight.samples.iter().map(|s| (s.time_s, value(s))))
}

/// Returns the curves of a state over time in s: its band of two standard deviations, its true
/// value and its estimate. `index` is that of the state in a sample.
fn state(flight: &Hold, index: usize, pen: Pen) -> Vec<Curve> {
    vec![
        curve(flight, BAND, |s| s.estimate[index] + 2.0 * s.sigma[index]),
        curve(flight, BAND, |s| s.estimate[index] - 2.0 * s.sigma[index]),
        curve(flight, TRUTH, |s| s.truth[index]),
        curve(flight, pen, |s| s.estimate[index]),
    ]
}

/// Returns the curve of a sensor's accepted innovations, in standard deviations. The curve is
/// interrupted at rejected readings.
fn innovation(flight: &Hold, sensor: AltitudeSensor, pen: Pen) -> Curve {
    let points = flight.samples.iter().map(|sample| {
        let reading = sample.readings.iter().find(|reading| reading.sensor == sensor)?;
        let sigmas = reading.innovation.value / reading.innovation.variance.sqrt();
        reading.taken.then_some((sample.time_s, sigmas.clamp(-EDGE_SIGMAS, EDGE_SIGMAS)))
    });
    let points: Vec<Option<(f64, f64)>> = points.collect();
    let pieces = points.split(Option::is_none).filter(|piece| piece.len() > 1);
    Curve { pen, pieces: pieces.map(|piece| piece.iter().copied().flatten().collect()).collect() }
}

/// Returns short strokes at the edge of the panel, one for each rejected reading.
fn rejected(flight: &Hold) -> Curve {
    let readings = flight.samples.iter().flat_map(|s| s.readings.iter().map(|r| (s.time_s, r)));
    let strokes = readings.filter(|(_, reading)| !reading.taken).map(|(time_s, reading)| {
        let edge = EDGE_SIGMAS.copysign(reading.innovation.value);
        vec![(time_s, 0.7 * edge), (time_s, edge)]
    });
    Curve { pen: REJECTED, pieces: strokes.collect() }
}
