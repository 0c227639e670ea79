//! An evening's page: its flights, its drones over time, and the conditions that they make.

use super::Page;
use super::canvas::Pen;
use super::figure::{Curve, Figure, Panel};
use super::studies::{COLORS, around};
use crate::{Evening, EveningLog, LogFigures};

/// Height of a panel.
const HEIGHT_PX: f64 = 130.0;
/// A figure of a log.
type Of = fn(&LogFigures) -> Option<f64>;
/// Most drones with a curve.
const MOST_DRONES: usize = 7;

/// The page: what is `printed` of the evening, its drones over time, and the file of `conditions`.
pub fn evening_page(title: &str, evening: &Evening, printed: &str, conditions: &str) -> Page {
    let (n, sound) = (evening.logs.len(), evening.sound().count());
    let drones = evening.drones();
    let lead = format!("{n} logs of {} drone(s); {sound} sound.", drones.len());
    let mut page = Page::new(title, &lead).section("Flights").printed(printed).text(
        "Thrust per command and weight, of the scene's; trim: the center of mass that the motors \
         hold against; gusts: those that turn a drone as its air did. -: the log does not show it.",
    );
    let curves = |figure: Of| -> Vec<Curve> {
        let curves = drones.iter().zip(COLORS).map(|((_, logs), color)| {
            let value = |(index, log): (usize, &EveningLog)| {
                Some((index as f64 + 1.0, log.figures.as_ref().and_then(figure)?))
            };
            let sound = logs.iter().filter(|log| log.flaws.is_empty());
            let points: Vec<(f64, f64)> = sound.enumerate().filter_map(value).collect();
            // A short bar at each flight, so that one alone is seen.
            let bars = points.iter().map(|(x, y)| vec![(x - 0.1, *y), (x + 0.1, *y)]);
            let pieces = bars.chain([points.clone()]).filter(|piece| piece.len() > 1).collect();
            Curve { pen: Pen::new(color, 2.0), pieces }
        });
        curves.collect()
    };
    let most = drones.iter().map(|(_, logs)| logs.len()).max().unwrap_or(1);
    let panel = |(y_name, least, figure): (&'static str, f64, Of)| {
        let curves = curves(figure);
        let values = curves.iter().flat_map(Curve::points).map(|(_, value)| value);
        let x = 0.5..most as f64 + 0.5;
        let panel = Panel::new([x, around(values, least)], HEIGHT_PX, y_name, curves);
        Panel { counts: true, ..panel }
    };
    let panels: [(&str, f64, Of); 4] = [
        ("thrust (%)", 4.0, |f| Some(100.0 * f.thrust_frac)),
        ("trim x (mm)", 0.5, |f| Some(1e3 * f.trim_m[0])),
        ("trim y (mm)", 0.5, |f| Some(1e3 * f.trim_m[1])),
        ("rotor lag (ms)", 20.0, |f| f.lag_s.map(|lag_s| 1e3 * lag_s)),
    ];
    if sound > 0 {
        let pens = COLORS.map(|color| Pen::new(color, 2.0));
        let figure = Figure {
            title: "Thrust, trim and lag, flight by flight".to_owned(),
            legend: drones.iter().map(|(name, _)| (*name).to_owned()).zip(pens).collect(),
            x_name: "sound flight, in the order of the names",
            panels: panels.into_iter().map(panel).collect(),
        };
        page = page.section("Drones over time").drawings(&[figure.svg()]);
        if drones.len() > MOST_DRONES {
            page = page.text(&format!("The curves are those of the first {MOST_DRONES} drones."));
        }
    }
    page.section("Conditions").printed(conditions)
}
