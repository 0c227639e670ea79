//! Plots of flights: from above, from the front, and their errors over time.

use std::ops::Range;

use super::canvas::Pen;
use super::figure::{BLACK, BLUE, Curve, Figure, GRAY, Mark, PANEL_WIDTH_PX, Panel, VERMILION};
use noctograph_core::flight::tracking::CORRIDOR_M;
use noctograph_core::flight::{BATTERY_V, Flight, FlightSample};

/// A flight to draw.
#[derive(Clone, Debug)]
pub struct NamedFlight {
    /// Its name in the legend.
    pub name: String,
    /// The samples to draw, in order of time. A design of zeros is none.
    pub samples: Vec<FlightSample>,
}

/// A line is interrupted where a flight has no sample for longer than this.
const LONGEST_LINE_S: f64 = 0.2;
/// Heights of a panel with equal scales on both axes; a flight wider or taller gets more air.
const VIEW_PX: [f64; 2] = [160.0, 720.0];
const DESIGN: Pen = Pen::new(GRAY, 5.0);
const CORRIDOR: Pen = Pen::new(BLACK, 1.5);

/// The flights from above, x to the right and y up, over the first trace's design, with black lines
/// where the safety corridor ends. SVG.
///
/// # Panics
///
/// If there is no trace, or one without samples.
#[must_use]
pub fn top_view(traces: &[NamedFlight]) -> String {
    let mut view = View::new(traces, |p| (p.x, p.y));
    view.include_y(-1.25 * CORRIDOR_M);
    view.include_y(1.25 * CORRIDOR_M);
    let [x, y] = view.ranges();
    let line = |y_m: f64| vec![(x.start, y_m), (x.end, y_m)];
    let edges = Curve { pen: CORRIDOR, pieces: vec![line(-CORRIDOR_M), line(CORRIDOR_M)] };
    view.curves.push(edges);
    view.legend.push(("y = ±0.2 m".to_owned(), CORRIDOR));
    view.svg("Flight from above", "y (m)", [x, y])
}

/// The flights from the front, x to the right and z up, over the first trace's design. SVG.
///
/// # Panics
///
/// If there is no trace, or one without samples.
#[must_use]
pub fn front_view(traces: &[NamedFlight]) -> String {
    let view = View::new(traces, |p| (p.x, p.z));
    let ranges = view.ranges();
    view.svg("Flight from the front", "z (m)", ranges)
}

/// Flown minus design over time, a panel an axis, each flight against its own design. SVG.
///
/// # Panics
///
/// If there is no trace, or one without samples.
#[must_use]
pub fn error_over_time(traces: &[NamedFlight]) -> String {
    let designed = || pens(traces).filter(|(trace, _)| trace.has_design());
    let start_s = traces.iter().map(|t| t.samples[0].time_s).fold(f64::INFINITY, f64::min);
    let ends_s = traces.iter().map(|t| t.samples[t.samples.len() - 1].time_s);
    let x = start_s..ends_s.fold(start_s + 0.1, f64::max);
    let error = |sample: &FlightSample| sample.position_m - sample.design_m;
    let curves = |axis: usize| -> Vec<Curve> {
        let value = |s: &FlightSample| (s.time_s, error(s)[axis]);
        let zero =
            Curve { pen: Pen::new(BLACK, 1.0), pieces: vec![vec![(x.start, 0.0), (x.end, 0.0)]] };
        [zero].into_iter().chain(designed().map(|(t, pen)| t.curve(pen, value))).collect()
    };
    let all = designed().flat_map(|(trace, _)| &trace.samples).map(error);
    let most_m = all.map(|e| e.amax()).fold(0.05, f64::max) * 1.05;
    let panels = ["x error (m)", "y error (m)", "z error (m)"].into_iter().enumerate();
    let panels = panels.map(|(axis, y_name)| {
        Panel::new([x.clone(), -most_m..most_m], 150.0, y_name, curves(axis))
    });
    Figure {
        title: "Flown minus design".to_owned(),
        legend: names(traces, NamedFlight::has_design),
        x_name: "time (s)",
        panels: panels.collect(),
    }
    .svg()
}

/// Samples of a simulated flight of which the strongest motor is drawn: 50 ms.
const LOAD_SAMPLES: usize = 12;
/// A motor's command at full power.
const FULL: f64 = 65_535.0;

/// The load of drones over time: the command of the strongest motor and, of drones with a battery,
/// its voltage. SVG.
pub(super) fn load_over_time(flights: &[Flight]) -> String {
    let name = |(index, _): (usize, &Flight)| (format!("drone {}", index + 1), pen(index));
    let power = load_curves(flights, |flight, window| {
        let time_s = flight.samples[window.start].time_s;
        let motors = flight.samples[window].iter().flat_map(|sample| sample.motors);
        Some((time_s, 100.0 * motors.fold(0.0, f64::max) / FULL))
    });
    let volts = load_curves(flights, |flight, window| {
        let at = window.start;
        Some((flight.samples[at].time_s, *flight.extra.get(BATTERY_V)?.get(at)?))
    });
    let places = |curves: &[Curve]| -> Vec<(f64, f64)> {
        curves.iter().flat_map(|curve| curve.pieces.iter().flatten().copied()).collect()
    };
    let x = range(places(&power).iter().map(|(time_s, _)| *time_s));
    let y = range(places(&volts).iter().map(|(_, volts)| *volts));
    let panel = |y_name, y, curves| Panel::new([x.clone(), y], 150.0, y_name, curves);
    let mut panels = vec![panel("strongest motor (%)", 0.0..105.0, power)];
    if y.start <= y.end {
        panels.push(panel("battery (V)", y.start - 0.05..y.end + 0.05, volts));
    }
    Figure {
        title: "Load of motors and battery".to_owned(),
        legend: flights.iter().enumerate().map(name).collect(),
        x_name: "time (s)",
        panels,
    }
    .svg()
}

/// A curve a drone, with a place for each window of its samples.
fn load_curves(
    flights: &[Flight],
    place: impl Fn(&Flight, Range<usize>) -> Option<(f64, f64)>,
) -> Vec<Curve> {
    let curve = |(index, flight): (usize, &Flight)| {
        let n = flight.samples.len();
        let firsts = (0..n).step_by(LOAD_SAMPLES);
        let piece = firsts.filter_map(|at| place(flight, at..n.min(at + LOAD_SAMPLES)));
        Curve { pen: pen(index), pieces: vec![piece.collect()] }
    };
    flights.iter().enumerate().map(curve).collect()
}

/// From the least to the largest value.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let nothing = f64::INFINITY..f64::NEG_INFINITY;
    values.fold(nothing, |range, value| range.start.min(value)..range.end.max(value))
}

fn pen(index: usize) -> Pen {
    Pen::new([BLUE, VERMILION][index % 2], 1.75)
}

/// The last trace first, so that the first lies on top.
fn pens(traces: &[NamedFlight]) -> impl Iterator<Item = (&NamedFlight, Pen)> {
    traces.iter().enumerate().map(|(index, trace)| (trace, pen(index))).rev()
}

/// The legend of the traces of one's choice, the first on top.
fn names(traces: &[NamedFlight], choice: impl Fn(&NamedFlight) -> bool) -> Vec<(String, Pen)> {
    let chosen = pens(traces).filter(|(trace, _)| choice(trace));
    let mut names: Vec<_> = chosen.map(|(trace, pen)| (trace.name.clone(), pen)).collect();
    names.reverse();
    names
}

impl NamedFlight {
    fn has_design(&self) -> bool {
        self.samples.iter().any(|sample| sample.design_m.norm() > 0.0)
    }

    fn curve(&self, pen: Pen, value: impl Fn(&FlightSample) -> (f64, f64)) -> Curve {
        let pieces = self.samples.chunk_by(|a, b| b.time_s - a.time_s <= LONGEST_LINE_S);
        let pieces = pieces.map(|piece| piece.iter().map(&value).collect());
        Curve { pen, pieces: pieces.collect() }
    }
}

/// A projection of flights, with the same scale on both axes.
pub(super) struct View {
    pub(super) curves: Vec<Curve>,
    pub(super) marks: Vec<Mark>,
    pub(super) legend: Vec<(String, Pen)>,
    x: Range<f64>,
    y: Range<f64>,
}

impl View {
    /// A view of curves that are there already.
    pub(super) fn of(curves: Vec<Curve>, legend: Vec<(String, Pen)>, marks: Vec<Mark>) -> Self {
        let nothing = f64::INFINITY..f64::NEG_INFINITY;
        let mut view = Self { curves: Vec::new(), marks, legend, x: nothing.clone(), y: nothing };
        for (x, y) in curves.iter().flat_map(|curve| curve.pieces.iter().flatten()) {
            view.x = view.x.start.min(*x)..view.x.end.max(*x);
            view.include_y(*y);
        }
        Self { curves, ..view }
    }

    fn new(traces: &[NamedFlight], project: impl Fn(nalgebra::Vector3<f64>) -> (f64, f64)) -> Self {
        let (mut curves, mut legend) = (Vec::new(), Vec::new());
        if let Some(trace) = traces.iter().find(|trace| trace.has_design()) {
            curves.push(trace.curve(DESIGN, |sample| project(sample.design_m)));
            legend.push(("design".to_owned(), DESIGN));
        }
        let flown = pens(traces).map(|(t, pen)| t.curve(pen, |s| project(s.position_m)));
        curves.extend(flown);
        legend.extend(names(traces, |_| true));
        Self::of(curves, legend, Vec::new())
    }

    fn include_y(&mut self, y: f64) {
        self.y = self.y.start.min(y)..self.y.end.max(y);
    }

    /// What both axes cover, with a margin, so that a meter is as long on either.
    pub(super) fn ranges(&self) -> [Range<f64>; 2] {
        let [x, y] = [&self.x, &self.y].map(|range| {
            let margin = (0.04 * (range.end - range.start)).max(0.02);
            range.start - margin..range.end + margin
        });
        let per_m = PANEL_WIDTH_PX / (x.end - x.start);
        let [low_px, high_px] = VIEW_PX;
        let y = widened(y, low_px / per_m);
        [widened(x, (y.end - y.start) * PANEL_WIDTH_PX / high_px), y]
    }

    pub(super) fn svg(self, title: &str, y_name: &'static str, [x, y]: [Range<f64>; 2]) -> String {
        let height_px = (PANEL_WIDTH_PX * (y.end - y.start) / (x.end - x.start)).round();
        let panel = Panel::new([x, y], height_px, y_name, self.curves);
        let panel = Panel { marks: self.marks, ..panel };
        Figure {
            title: title.to_owned(),
            legend: self.legend,
            x_name: "x (m)",
            panels: vec![panel],
        }
        .svg()
    }
}

/// The range, or one about the same middle that is at least this long.
fn widened(range: Range<f64>, least: f64) -> Range<f64> {
    let (middle, length) = (0.5 * (range.start + range.end), range.end - range.start);
    let half = 0.5 * length.max(least);
    middle - half..middle + half
}
