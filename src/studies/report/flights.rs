//! Plots flights as seen from above and from the front, and their errors and loads over time.

use std::ops::Range;

use super::canvas::Pen;
use super::figure::{
    BLACK, BLUE, Curve, Figure, GRAY, Mark, PANEL_WIDTH_PX, Panel, VERMILION, range,
};
use noctograph_core::flight::{BATTERY_V, Flight, FlightSample};
use noctograph_plan::tracking::CORRIDOR_M;

/// A flight to draw.
#[derive(Clone, Debug)]
pub struct NamedFlight {
    /// Name of the flight in the legend.
    pub name: String,
    /// Samples to draw, in order of time. A design that is zero everywhere counts as missing.
    pub samples: Vec<FlightSample>,
}

/// Maximum time between two samples that are connected by a line.
const LONGEST_LINE_S: f64 = 0.2;
/// Minimum and maximum height of a panel with equal scales on both axes.
const VIEW_PX: [f64; 2] = [160.0, 720.0];
const DESIGN: Pen = Pen::new(GRAY, 5.0);
const CORRIDOR: Pen = Pen::new(BLACK, 1.5);

/// Returns an SVG of the flights as seen from above, with x to the right and y up, drawn over the
/// first trace's design. Black lines mark the edges of the safety corridor. Panics without traces
/// or samples.
pub fn top_view(traces: &[NamedFlight]) -> String {
    let mut view = View::new(traces, |p| (p.x, p.y));
    let [x, y] = view.ranges([-1.25 * CORRIDOR_M, 1.25 * CORRIDOR_M]);
    let edges = [-CORRIDOR_M, CORRIDOR_M].map(|y_m| vec![(x.start, y_m), (x.end, y_m)]);
    view.curves.push(Curve { pen: CORRIDOR, pieces: edges.into() });
    view.legend.push(("y = ±0.2 m".to_owned(), CORRIDOR));
    view.svg("Flight from above", "y (m)", [x, y])
}

/// Returns an SVG of the flights as seen from the front, with x to the right and z up, drawn over
/// the first trace's design. Panics without traces or samples.
pub fn front_view(traces: &[NamedFlight]) -> String {
    View::new(traces, |p| (p.x, p.z)).svg_from_front("Flight from the front")
}

/// Returns an SVG of the flown minus the designed position over time, with one panel per axis. Each
/// flight is compared with its own design. Panics without traces or samples.
pub fn error_over_time(traces: &[NamedFlight]) -> String {
    let start_s = traces.iter().map(|t| t.samples[0].time_s).fold(f64::INFINITY, f64::min);
    let ends_s = traces.iter().map(|t| t.samples[t.samples.len() - 1].time_s);
    let time_s = start_s..ends_s.fold(start_s + 0.1, f64::max);
    // Flights without a design are omitted, because their error is undefined.
    let designed: Vec<_> = pens(traces).filter(|(trace, _)| trace.has_design()).collect();
    let panels = error_panels(&time_s, 0.05, |axis| {
        let curves = designed.iter().rev().map(|(trace, pen)| {
            trace.curve(*pen, |s| (s.time_s, (s.position_m - s.design_m)[axis]))
        });
        curves.collect()
    });
    Figure {
        title: "Flown minus design".to_owned(),
        legend: designed.iter().map(|(trace, pen)| (trace.name.clone(), *pen)).collect(),
        x_name: "time (s)",
        panels,
    }
    .svg()
}

/// Returns one panel per axis with curves of errors over time. All panels have the same scale,
/// which is centered at zero and extends to at least `least_m`.
pub(super) fn error_panels(
    time_s: &Range<f64>,
    least_m: f64,
    curves: impl Fn(usize) -> Vec<Curve>,
) -> Vec<Panel> {
    let axes = [0, 1, 2].map(curves);
    let errors_m = axes.iter().flatten().flat_map(Curve::points).map(|(_, error_m)| error_m.abs());
    let most_m = 1.05 * errors_m.fold(least_m, f64::max);
    let zero = Curve::whole(Pen::new(BLACK, 1.0), [(time_s.start, 0.0), (time_s.end, 0.0)]);
    // The zero line is drawn first, so that the curves cover it.
    let names = ["x error (m)", "y error (m)", "z error (m)"];
    let panels = names.into_iter().zip(axes).map(|(y_name, curves)| {
        let curves = [vec![zero.clone()], curves].concat();
        Panel::new([time_s.clone(), -most_m..most_m], 150.0, y_name, curves)
    });
    panels.collect()
}

/// Number of samples per point in the load plot, which gives a point every 50 ms.
const LOAD_SAMPLES: usize = 12;
/// Motor command at full power.
const FULL_COMMAND: f64 = 65_535.0;

/// Returns an SVG of the load over time: each drone's largest motor command and battery voltage.
pub(super) fn load_over_time(flights: &[Flight]) -> String {
    let [power, volts]: [Vec<Curve>; 2] = [power_percent, battery_v].map(|value| {
        let curves = flights.iter().enumerate().map(|(index, flight)| {
            let samples = flight.samples.iter().enumerate().step_by(LOAD_SAMPLES);
            let points = samples.filter_map(|(row, s)| Some((s.time_s, value(flight, row)?)));
            Curve::whole(pen(index), points)
        });
        curves.collect()
    });
    let time_s = range(power.iter().flat_map(Curve::points).map(|(time_s, _)| time_s));
    let volts_v = range(volts.iter().flat_map(Curve::points).map(|(_, volts_v)| volts_v));
    let axes = [time_s.clone(), 0.0..105.0];
    let mut panels = vec![Panel::new(axes, 150.0, "strongest motor (%)", power)];
    // The range is empty if no flight has a battery.
    if volts_v.start <= volts_v.end {
        let axes = [time_s, volts_v.start - 0.05..volts_v.end + 0.05];
        panels.push(Panel::new(axes, 150.0, "battery (V)", volts));
    }
    let legend = (0..flights.len()).map(|index| (format!("drone {}", index + 1), pen(index)));
    Figure {
        title: "Load of motors and battery".to_owned(),
        legend: legend.collect(),
        x_name: "time (s)",
        panels,
    }
    .svg()
}

/// Returns the maximum motor command over [`LOAD_SAMPLES`] samples beginning at `row`, in percent
/// of full power. The result is always `Some`, so that the signature matches that of [`battery_v`].
fn power_percent(flight: &Flight, row: usize) -> Option<f64> {
    let samples = flight.samples[row..].iter().take(LOAD_SAMPLES);
    let most = samples.flat_map(|sample| sample.motors).fold(0.0, f64::max);
    Some(100.0 * most / FULL_COMMAND)
}

/// Returns the battery's voltage at a sample, or `None` without a battery.
fn battery_v(flight: &Flight, row: usize) -> Option<f64> {
    flight.extra.get(BATTERY_V)?.get(row).copied()
}

/// Returns the pen for the flight with the given index: blue for the first, vermilion for the
/// second, and so on.
fn pen(index: usize) -> Pen {
    Pen::new([BLUE, VERMILION][index % 2], 1.75)
}

/// Returns the traces, each with its pen.
fn pens(traces: &[NamedFlight]) -> impl DoubleEndedIterator<Item = (&NamedFlight, Pen)> {
    traces.iter().enumerate().map(|(index, trace)| (trace, pen(index)))
}

impl NamedFlight {
    /// Returns true if any sample's design is nonzero.
    fn has_design(&self) -> bool {
        self.samples.iter().any(|sample| sample.design_m.norm() > 0.0)
    }

    /// Returns the curve of a value over the samples, interrupted at gaps.
    fn curve(&self, pen: Pen, value: impl Fn(&FlightSample) -> (f64, f64)) -> Curve {
        let pieces = self.samples.chunk_by(|a, b| b.time_s - a.time_s <= LONGEST_LINE_S);
        let pieces = pieces.map(|piece| piece.iter().map(&value).collect());
        Curve { pen, pieces: pieces.collect() }
    }
}

/// A projection of flights onto a plane, with the same scale on both axes.
#[derive(Default)]
pub(super) struct View {
    pub(super) curves: Vec<Curve>,
    pub(super) marks: Vec<Mark>,
    pub(super) legend: Vec<(String, Pen)>,
}

impl View {
    /// Creates a view of all flights over the first design. The first flight is drawn on top.
    /// `project` maps a position in m to the axes of the view.
    fn new(traces: &[NamedFlight], project: impl Fn(nalgebra::Vector3<f64>) -> (f64, f64)) -> Self {
        let mut view = Self::default();
        if let Some(trace) = traces.iter().find(|trace| trace.has_design()) {
            view.curves.push(trace.curve(DESIGN, |sample| project(sample.design_m)));
            view.legend.push(("design".to_owned(), DESIGN));
        }
        let flown = pens(traces).rev().map(|(t, pen)| t.curve(pen, |s| project(s.position_m)));
        view.curves.extend(flown);
        view.legend.extend(pens(traces).map(|(trace, pen)| (trace.name.clone(), pen)));
        view
    }

    /// Returns the ranges of both axes with equal scales, including a margin and `heights_m`.
    fn ranges(&self, heights_m: impl IntoIterator<Item = f64>) -> [Range<f64>; 2] {
        let points = self.curves.iter().flat_map(Curve::points);
        let [x, y] =
            [range(points.clone().map(|(x, _)| x)), range(points.map(|(_, y)| y).chain(heights_m))]
                .map(|range| {
                    let margin = (0.04 * (range.end - range.start)).max(0.02);
                    range.start - margin..range.end + margin
                });
        let per_m = PANEL_WIDTH_PX / (x.end - x.start);
        let [low_px, high_px] = VIEW_PX;
        let y = widened(y, low_px / per_m);
        [widened(x, (y.end - y.start) * PANEL_WIDTH_PX / high_px), y]
    }

    /// Returns an SVG of the view from the front, with x to the right and z up.
    pub(super) fn svg_from_front(self, title: &str) -> String {
        let ranges = self.ranges([]);
        self.svg(title, "z (m)", ranges)
    }

    /// Returns an SVG of the view with the given ranges.
    fn svg(self, title: &str, y_name: &'static str, [x, y]: [Range<f64>; 2]) -> String {
        let height_px = (PANEL_WIDTH_PX * (y.end - y.start) / (x.end - x.start)).round();
        let panel = Panel::new([x, y], height_px, y_name, self.curves);
        let panels = vec![Panel { marks: self.marks, ..panel }];
        Figure { title: title.to_owned(), legend: self.legend, x_name: "x (m)", panels }.svg()
    }
}

/// Returns a range with the same center and a length of at least `least`, both in the unit of the
/// axis.
fn widened(range: Range<f64>, least: f64) -> Range<f64> {
    let (middle, length) = (0.5 * (range.start + range.end), range.end - range.start);
    let half = 0.5 * length.max(least);
    middle - half..middle + half
}
