//! Builds the page for an evening: its flights, the drones over time, and the conditions.

use super::Page;
use super::canvas::{Pen, Rgb};
use super::figure::{Curve, Figure, Panel};
use super::studies::{COLORS, around};
use crate::{Evening, EveningLog, LogFigures};

/// Height of a panel.
const HEIGHT_PX: f64 = 130.0;
/// Function that selects a figure of a log.
type Select = fn(&LogFigures) -> Option<f64>;
/// Maximum number of drones whose curves are drawn.
const MOST_DRONES: usize = 7;

/// Returns the page: the `printed` table of the evening, plots of its drones over time, and the
/// conditions file `conditions`.
pub fn evening_page(title: &str, evening: &Evening, printed: &str, conditions: &str) -> Page {
    let (n, sound) = (evening.logs.len(), evening.sound().count());
    let drones = evening.drones();
    let lead = format!("{n} logs of {} drone(s), of which {sound} are valid.", drones.len());
    let mut page = Page::new(title, &lead).section("Flights").printed(printed).text(
        "Thrust is the thrust per command and weight, relative to the scene. Trim is the center \
         of mass for which the motors compensate. Gusts are the gusts that would rotate the \
         drone as observed. A dash stands for a figure that does not follow from the log.",
    );
    // Each figure has a panel, with one curve per drone over its valid flights. The number is the
    // minimum range of the panel's axis.
    let most_logs = drones.iter().map(|(_, logs)| logs.len()).max().unwrap_or(1);
    let panels: [(&str, f64, Select); 4] = [
        ("thrust (%)", 4.0, |f| Some(100.0 * f.thrust_frac)),
        ("trim x (mm)", 0.5, |f| Some(1e3 * f.trim_m[0])),
        ("trim y (mm)", 0.5, |f| Some(1e3 * f.trim_m[1])),
        ("rotor lag (ms)", 20.0, |f| f.lag_s.map(|lag_s| 1e3 * lag_s)),
    ];
    if sound > 0 {
        let panels = panels.map(|(y_name, least, select)| {
            let logs = drones.iter().map(|(_, logs)| *logs);
            let curves: Vec<Curve> =
                logs.zip(COLORS).map(|(logs, color)| curve(logs, select, color)).collect();
            let values = curves.iter().flat_map(Curve::points).map(|(_, value)| value);
            let axes = [0.5..most_logs as f64 + 0.5, around(values, least)];
            Panel { counts: true, ..Panel::new(axes, HEIGHT_PX, y_name, curves) }
        });
        let pens = COLORS.map(|color| Pen::new(color, 2.0));
        let figure = Figure {
            title: "Thrust, trim and lag, flight by flight".to_owned(),
            legend: drones.iter().map(|(name, _)| (*name).to_owned()).zip(pens).collect(),
            x_name: "valid flights sorted by name",
            panels: panels.into(),
        };
        page = page.section("Drones over time").drawings(&[figure.svg()]);
        if drones.len() > MOST_DRONES {
            page = page.text(&format!("The curves show the first {MOST_DRONES} drones."));
        }
    }
    page.section("Conditions").printed(conditions)
}

/// Returns the curve of the selected figure over a drone's valid flights, numbered from 1.
fn curve(logs: &[EveningLog], select: Select, color: Rgb) -> Curve {
    let sound = logs.iter().filter(|log| log.flaws.is_empty()).enumerate();
    let points = sound.filter_map(|(index, log)| {
        Some((index as f64 + 1.0, log.figures.as_ref().and_then(select)?))
    });
    let points: Vec<(f64, f64)> = points.collect();
    // Each flight is drawn as a short bar, so that a single flight is visible.
    let bars = points.iter().map(|(x, y)| vec![(x - 0.1, *y), (x + 0.1, *y)]);
    let pieces = bars.chain([points.clone()]).filter(|piece| piece.len() > 1).collect();
    Curve { pen: Pen::new(color, 2.0), pieces }
}
