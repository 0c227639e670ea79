//! Plots of studies: flight time against legibility, and what breaks a word.

use std::ops::Range;

use super::canvas::{Pen, Rgb};
use super::figure::{BLACK, BLUE, Curve, Figure, GRAY, Panel, VERMILION};

const ORANGE: Rgb = [230, 159, 0];

/// Okabe and Ito (2008), from the strongest on.
pub(super) const COLORS: [Rgb; 7] =
    [BLUE, VERMILION, [0, 158, 115], ORANGE, [204, 121, 167], [86, 180, 233], BLACK];

/// Height of the panel.
const HEIGHT_PX: f64 = 360.0;

/// Candidates as flight time (s) and P(read) (0 to 1): those within the limits, those that were
/// given up or broke a limit, the Pareto front as a line, and the start. SVG.
#[must_use]
pub fn pareto(
    within: &[(f64, f64)],
    others: &[(f64, f64)],
    front: &[(f64, f64)],
    start: Option<(f64, f64)>,
) -> String {
    let all = || within.iter().chain(others).chain(front).chain(&start);
    let x = around(all().map(|point| point.0), 1.0);
    let probabilities = all().map(|point| point.1);
    let y = around(probabilities, 0.02);
    let [wide, high] = [(x.end - x.start) / 150.0, (y.end - y.start) / 75.0];
    let cross = |&(s, p): &(f64, f64), size: f64| {
        let [dx, dy] = [wide * size, high * size];
        [vec![(s - dx, p - dy), (s + dx, p + dy)], vec![(s - dx, p + dy), (s + dx, p - dy)]]
    };
    let gray = Pen::new(GRAY, 1.5);
    let orange = Pen::new(ORANGE, 1.0);
    let blue = Pen::new(BLUE, 2.0);
    let vermilion = Pen::new(VERMILION, 3.0);
    let crosses = |points: &[(f64, f64)], size| -> Vec<_> {
        points.iter().flat_map(|point| cross(point, size)).collect()
    };
    let mut curves = vec![
        Curve { pen: orange, pieces: crosses(others, 0.4) },
        Curve { pen: gray, pieces: crosses(within, 0.6) },
        Curve { pen: blue, pieces: vec![front.to_vec()] },
        Curve { pen: blue, pieces: crosses(front, 0.8) },
    ];
    let start: Vec<_> = start.into_iter().collect();
    curves.push(Curve { pen: vermilion, pieces: crosses(&start, 1.0) });
    Figure {
        title: format!(
            "P(read) against flight time, {} candidates",
            within.len() + others.len() + start.len()
        ),
        legend: vec![
            ("within the limits".to_owned(), gray),
            ("given up or beyond a limit".to_owned(), orange),
            ("Pareto front".to_owned(), blue),
            ("the scene as it was".to_owned(), vermilion),
        ],
        x_name: "flight time (s)",
        panels: vec![Panel::new([x, y], HEIGHT_PX, "P(read)", curves)],
    }
    .svg()
}

/// Curves by name: share of legible photos over multiples of the usual disturbance. Two rows of
/// names fit. SVG.
#[must_use]
pub fn endurance(title: &str, curves: &[(String, Vec<(f64, f64)>)]) -> String {
    // More curves than colors are told apart by their width.
    let widths = [2.0, 4.0].into_iter().cycle();
    let pens = widths.flat_map(|width_px| COLORS.map(|color| Pen::new(color, width_px)));
    let named: Vec<_> = curves.iter().zip(pens).collect();
    let x = around(curves.iter().flat_map(|(_, points)| points.iter().map(|p| p.0)), 0.1);
    let curve = |((_, points), pen): &(&(String, Vec<_>), _)| Curve {
        pen: *pen,
        pieces: vec![points.clone()],
    };
    let curves = named.iter().map(curve).collect();
    Figure {
        title: title.to_owned(),
        legend: named.iter().map(|((name, _), pen)| (name.clone(), *pen)).collect(),
        x_name: "multiple of the usual disturbance",
        panels: vec![Panel::new([x, 0.0..1.0], HEIGHT_PX, "fraction legible", curves)],
    }
    .svg()
}

/// What holds all values, with a margin.
pub(super) fn around(values: impl Iterator<Item = f64>, least: f64) -> Range<f64> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    if low > high {
        return 0.0..1.0;
    }
    let margin = (0.05 * (high - low)).max(0.5 * least);
    low - margin..high + margin
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plots_hold_every_curve_and_accept_empty_input() {
        let svg =
            pareto(&[(40.0, 0.7)], &[(45.0, 0.2)], &[(40.0, 0.7), (60.0, 0.8)], Some((60.0, 0.8)));
        assert!(svg.starts_with("<svg") && svg.contains("Pareto front"), "{svg}");
        assert!(svg.contains("3 candidates"), "{svg}");
        let empty = pareto(&[], &[], &[], None);
        assert!(empty.starts_with("<svg"));
        // Two strokes a candidate.
        let lines = |svg: &str| svg.matches("#e69f00").count();
        let one = pareto(&[], &[(45.0, 0.2)], &[], None);
        let two = pareto(&[], &[(45.0, 0.2), (47.0, 0.1)], &[], None);
        assert_eq!(lines(&two) - lines(&one), 2, "what was given up is shown");
        let curve = |name: &str| (name.to_owned(), vec![(0.0, 0.9), (1.0, 0.5)]);
        let svg = endurance("team", &[curve("mass"), curve("gusts")]);
        assert!(
            svg.contains("mass")
                && svg.contains("gusts")
                && svg.contains("multiple of the usual disturbance")
                && svg.contains("fraction legible")
                && !svg.contains("P(read)")
        );
    }
}
