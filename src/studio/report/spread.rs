//! Plots of a spread: its flights from the front, and its bands over time.

use super::canvas::Pen;
use super::figure::{BLACK, BLUE, Curve, Figure, GRAY, Panel, VERMILION};
use super::flights::View;
use crate::study::{BAND_FRAC, Band, Spread};
use noctograph_core::flight::{Flight, FlightSample};

const DESIGN: Pen = Pen::new(GRAY, 5.0);
const FLIGHT: Pen = Pen::new(BLUE, 0.6);
const ALL: Pen = Pen::new(BLUE, 1.75);
const WITHIN: Pen = Pen::new(VERMILION, 1.75);
const ZERO: Pen = Pen::new(BLACK, 1.0);

/// The lit strokes of a spread's flights from the front, over their design. SVG.
///
/// # Panics
///
/// If every flight is lost.
#[must_use]
pub fn spread_front(spread: &Spread) -> String {
    let shots = spread.flights.iter().filter_map(|flight| flight.shot.as_ref().ok());
    let flights: Vec<_> = shots.flat_map(|shot| &shot.flights).collect();
    let n_drones = spread.all.len();
    let design = flights[..n_drones].iter();
    let design = design.flat_map(|flight| lit(flight, |s| (s.design_m.x, s.design_m.z)));
    let mut curves = vec![Curve { pen: DESIGN, pieces: design.collect() }];
    curves.extend(flights.iter().map(|flight| Curve {
        pen: FLIGHT,
        pieces: lit(flight, |s| (s.position_m.x, s.position_m.z)),
    }));
    let n = flights.len() / n_drones;
    let legend = vec![("design".to_owned(), DESIGN), (format!("{n} flights"), FLIGHT)];
    let view = View::of(curves, legend, Vec::new());
    let ranges = view.ranges();
    view.svg("Front view of the flights, their conditions varied", "z (m)", ranges)
}

/// The pieces of a flight on which a light is commanded.
fn lit(flight: &Flight, place: impl Fn(&FlightSample) -> (f64, f64)) -> Vec<Vec<(f64, f64)>> {
    let is_lit = |index: usize| flight.lights.values().any(|levels| levels[index] > 0.0);
    let rows: Vec<(bool, (f64, f64))> =
        flight.samples.iter().enumerate().map(|(i, s)| (is_lit(i), place(s))).collect();
    let parts = rows.chunk_by(|a, b| a.0 == b.0).filter(|part| part[0].0);
    parts.map(|part| part.iter().map(|(_, place)| *place).collect()).collect()
}

/// The ends of both bands of a drone over time, while it writes, less the design, a panel an axis.
/// SVG.
///
/// # Panics
///
/// If a band has no moments.
#[must_use]
pub fn spread_over_time(all: &Band, within: &Band) -> String {
    let first = all.writes.iter().position(|writes| *writes).unwrap_or(0);
    let last = all.writes.iter().rposition(|writes| *writes).unwrap_or(all.writes.len() - 1);
    let x = all.time_s[first]..all.time_s[last].max(all.time_s[first] + 0.1);
    let edge = |band: &Band, end: usize, axis: usize| -> Vec<(f64, f64)> {
        let off_m = band.ends_m.iter().zip(&band.design_m);
        let off_m = off_m.map(|(ends_m, design_m)| ends_m[end][axis] - design_m[axis]);
        let edge = band.time_s.iter().copied().zip(off_m);
        edge.skip(first).take(last + 1 - first).collect()
    };
    let most_m = [all, within].into_iter().flat_map(|band| {
        (0..3).flat_map(move |axis| [0, 2].into_iter().flat_map(move |end| edge(band, end, axis)))
    });
    let most_m = 1.05 * most_m.map(|(_, off_m)| off_m.abs()).fold(0.02, f64::max);
    let panel = |(axis, y_name): (usize, &'static str)| {
        let zero = Curve { pen: ZERO, pieces: vec![vec![(x.start, 0.0), (x.end, 0.0)]] };
        let band = |band: &Band, pen| {
            let pieces = [0, 2].map(|end| edge(band, end, axis)).to_vec();
            Curve { pen, pieces }
        };
        let curves = vec![zero, band(all, ALL), band(within, WITHIN)];
        Panel::new([x.clone(), -most_m..most_m], 150.0, y_name, curves)
    };
    let panels = ["x error (m)", "y error (m)", "z error (m)"].into_iter().enumerate().map(panel);
    let legend = vec![
        ("each its own room and drone".to_owned(), ALL),
        ("one drone in one room".to_owned(), WITHIN),
    ];
    let title = if all.holds_frac() < BAND_FRAC {
        format!("Band of all {} flights, relative to the design", all.n_flights)
    } else {
        format!("Band of {:.0} % of the flights, relative to the design", 100.0 * BAND_FRAC)
    };
    Figure { title, legend, x_name: "time (s)", panels: panels.collect() }.svg()
}
