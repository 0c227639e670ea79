//! Plots a spread: its flights as seen from the front, and its bands over time.

use super::canvas::Pen;
use super::figure::{BLUE, Curve, Figure, GRAY, VERMILION};
use super::flights::{View, error_panels};
use crate::{BAND_FRAC, Band, Spread};
use noctograph_core::flight::{Flight, FlightSample};

const DESIGN: Pen = Pen::new(GRAY, 5.0);
const FLIGHT: Pen = Pen::new(BLUE, 0.6);
const ALL: Pen = Pen { filled: true, ..Pen::new(BLUE, 1.75) };
const WITHIN: Pen = Pen { filled: true, ..Pen::new(VERMILION, 1.75) };

/// Returns an SVG of a spread's lit strokes over their design. Panics if every flight is lost.
pub fn spread_front(spread: &Spread) -> String {
    let shots = spread.flights.iter().filter_map(|flight| flight.shot.as_ref().ok());
    let flights: Vec<_> = shots.flat_map(|shot| &shot.flights).collect();
    let n_drones = spread.all.len();
    // All flights have the same designs, so only those of the first flight are drawn.
    let first = flights[..n_drones].iter();
    let design = first.flat_map(|flight| lit(flight, |s| (s.design_m.x, s.design_m.z)));
    let mut curves = vec![Curve { pen: DESIGN, pieces: design.collect() }];
    curves.extend(flights.iter().map(|flight| Curve {
        pen: FLIGHT,
        pieces: lit(flight, |s| (s.position_m.x, s.position_m.z)),
    }));
    let n = flights.len() / n_drones;
    let legend = vec![("design".to_owned(), DESIGN), (format!("{n} flights"), FLIGHT)];
    View { curves, legend, marks: Vec::new() }
        .svg_from_front("Front view of the flights under varied conditions")
}

/// Returns the pieces of a flight in which a light is commanded, each a list of points projected by
/// `place`.
fn lit(flight: &Flight, place: impl Fn(&FlightSample) -> (f64, f64)) -> Vec<Vec<(f64, f64)>> {
    let rows = flight.samples.iter().enumerate().map(|(index, sample)| {
        (flight.lights.values().any(|levels| levels[index] > 0.0), place(sample))
    });
    let rows: Vec<(bool, (f64, f64))> = rows.collect();
    let parts = rows.chunk_by(|a, b| a.0 == b.0).filter(|part| part[0].0);
    parts.map(|part| part.iter().map(|(_, place)| *place).collect()).collect()
}

/// Returns an SVG of both bands of a drone over time, relative to the design, from its first letter
/// to its last. `varied` is the band of different drones in different rooms, and `within` that of
/// one drone in one room. Each axis has a panel. Panics if a band is empty.
pub fn spread_over_time(varied: &Band, within: &Band) -> String {
    let first = varied.writes.iter().position(|writes| *writes).unwrap_or(0);
    let last = varied.writes.iter().rposition(|writes| *writes).unwrap_or(varied.writes.len() - 1);
    let time_s = varied.time_s[first]..varied.time_s[last].max(varied.time_s[first] + 0.1);
    let legend = vec![
        ("each with a different room and drone".to_owned(), ALL),
        ("one drone in one room".to_owned(), WITHIN),
    ];
    let title = if varied.holds_frac() < BAND_FRAC {
        format!("Band of all {} flights, relative to the design", varied.n_flights)
    } else {
        format!("Band of {:.0} % of the flights, relative to the design", 100.0 * BAND_FRAC)
    };
    let panels = error_panels(&time_s, 0.02, |axis| {
        let bands = [(varied, ALL), (within, WITHIN)].map(|(band, pen)| {
            let last = last.min(band.time_s.len() - 1);
            // The outline runs forward along the lower end, and back along the upper end.
            let (low, high) = ((first..=last).map(|i| (i, 0)), (first..=last).map(|i| (i, 2)));
            let around = low.chain(high.rev()).chain([(first, 0)]);
            let points = around
                .map(|(i, end)| (band.time_s[i], (band.ends_m[i][end] - band.design_m[i])[axis]));
            Curve::whole(pen, points)
        });
        bands.into()
    });
    Figure { title, legend, x_name: "time (s)", panels }.svg()
}
