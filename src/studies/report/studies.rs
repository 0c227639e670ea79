//! Plots the candidates of a search, with flight time against legibility.

use std::ops::Range;

use super::canvas::{Pen, Rgb};
use super::figure::{BLACK, BLUE, Curve, Figure, GRAY, Panel, VERMILION, range};

const ORANGE: Rgb = [230, 159, 0];

/// Colors of Okabe and Ito (2008), the strongest first.
pub(super) const COLORS: [Rgb; 7] =
    [BLUE, VERMILION, [0, 158, 115], ORANGE, [204, 121, 167], [86, 180, 233], BLACK];

/// Height of the panel.
const HEIGHT_PX: f64 = 360.0;

/// Returns an SVG of candidates by flight time (s) and P(read) (0 to 1). The chart shows the
/// candidates within the limits, the `others`, which were abandoned or exceeded a limit, the Pareto
/// front as a line, and the original scene.
pub fn pareto(
    within: &[(f64, f64)],
    others: &[(f64, f64)],
    front: &[(f64, f64)],
    start: Option<(f64, f64)>,
) -> String {
    let start = start.as_slice();
    let points = within.iter().chain(others).chain(front).chain(start);
    let x = around(points.clone().map(|point| point.0), 1.0);
    let y = around(points.map(|point| point.1), 0.02);
    // A cross of size 1 extends by about 5 px to each side.
    let unit = ((x.end - x.start) / 150.0, (y.end - y.start) / 75.0);
    let [gray, orange] = [Pen::new(GRAY, 1.5), Pen::new(ORANGE, 1.0)];
    let [blue, vermilion] = [Pen::new(BLUE, 2.0), Pen::new(VERMILION, 3.0)];
    // The most important curves are drawn last, so that they lie on top.
    let curves = vec![
        crosses(orange, others, unit, 0.4),
        crosses(gray, within, unit, 0.6),
        Curve::whole(blue, front.iter().copied()),
        crosses(blue, front, unit, 0.8),
        crosses(vermilion, start, unit, 1.0),
    ];
    let n = within.len() + others.len() + start.len();
    let legend = [
        ("within the limits", gray),
        ("abandoned or beyond a limit", orange),
        ("Pareto front", blue),
        ("the original scene", vermilion),
    ];
    Figure {
        title: format!("P(read) against flight time, {n} candidates"),
        legend: legend.map(|(name, pen)| (name.to_owned(), pen)).into(),
        x_name: "flight time (s)",
        panels: vec![Panel::new([x, y], HEIGHT_PX, "P(read)", curves)],
    }
    .svg()
}

/// Returns a cross at each point. Its half width is `size · x` and its half height `size · y`, in
/// the units of the axes.
fn crosses(pen: Pen, points: &[(f64, f64)], (x, y): (f64, f64), size: f64) -> Curve {
    let (dx, dy) = (x * size, y * size);
    let strokes = points.iter().flat_map(|&(s, p)| {
        [vec![(s - dx, p - dy), (s + dx, p + dy)], vec![(s - dx, p + dy), (s + dx, p - dy)]]
    });
    Curve { pen, pieces: strokes.collect() }
}

/// Returns an axis range that contains all values, with a margin of at least half of `least` on
/// each side. Returns 0 to 1 without values.
pub(super) fn around(values: impl Iterator<Item = f64>, least: f64) -> Range<f64> {
    let Range { start, end } = range(values);
    if start > end {
        return 0.0..1.0;
    }
    let margin = (0.05 * (end - start)).max(0.5 * least);
    start - margin..end + margin
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
        // Each candidate is drawn as two strokes.
        let [one, two] = [&[(45.0, 0.2)][..], &[(45.0, 0.2), (47.0, 0.1)]]
            .map(|others| pareto(&[], others, &[], None).matches("#e69f00").count());
        assert_eq!(two - one, 2, "candidates that were given up are shown");
    }
}
