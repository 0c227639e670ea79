//! Transforms as CSS writes them, in the words of SVG: units of length and angle, and functions of
//! one axis.

use std::fmt::Write as _;

/// The transform list of SVG; `None` for a function or a unit that has no equal there.
pub(super) fn to_svg(text: &str) -> Option<String> {
    let mut converted = String::new();
    let mut rest = text.trim_matches(|c: char| c.is_whitespace() || c == ',');
    while !rest.is_empty() {
        let (name, after) = rest.split_once('(')?;
        let (arguments, after) = after.split_once(')')?;
        let list: Vec<&str> =
            arguments.split([',', ' ', '\t', '\n', '\r']).filter(|part| !part.is_empty()).collect();
        let all =
            |units| list.iter().map(|part| quantity(part, units)).collect::<Option<Vec<f64>>>();
        let name = name.trim();
        let values = match name {
            "translate" | "translateX" | "translateY" | "matrix" => all(LENGTHS)?,
            "scale" | "scaleX" | "scaleY" => all(SHARES)?,
            "skew" | "skewX" | "skewY" => all(ANGLES)?,
            // About a place.
            "rotate" | "rotateZ" => {
                let (angle, place) = list.split_first()?;
                let place = place.iter().map(|part| quantity(part, LENGTHS));
                std::iter::once(quantity(angle, ANGLES)).chain(place).collect::<Option<_>>()?
            }
            _ => return None,
        };
        let (name, values) = match (name, &values[..]) {
            ("translateX", [x]) => ("translate", vec![*x, 0.0]),
            ("translateY", [y]) => ("translate", vec![0.0, *y]),
            ("scaleX", [x]) => ("scale", vec![*x, 1.0]),
            ("scaleY", [y]) => ("scale", vec![1.0, *y]),
            ("rotateZ", [angle]) => ("rotate", vec![*angle]),
            ("skew", [x] | [x, _]) => {
                let y = values.get(1).copied().unwrap_or(0.0);
                let [x, y] = [*x, y].map(|angle| libm::tan(angle.to_radians()));
                ("matrix", vec![1.0, y, x, 1.0, 0.0, 0.0])
            }
            ("translate" | "scale", [_] | [_, _])
            | ("rotate", [_] | [_, _, _])
            | ("skewX" | "skewY", [_])
            | ("matrix", [_, _, _, _, _, _]) => (name, values),
            _ => return None,
        };
        if values.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let values: Vec<String> = values.iter().map(f64::to_string).collect();
        let _ = write!(converted, "{name}({})", values.join(" "));
        rest = after.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
    }
    Some(converted)
}

/// Units of length in user units, of angles in degrees, and of numbers.
const LENGTHS: &[(&str, f64)] = &[
    ("px", 1.0),
    ("pt", 96.0 / 72.0),
    ("pc", 16.0),
    ("mm", 96.0 / 25.4),
    ("cm", 96.0 / 2.54),
    ("in", 96.0),
];
const ANGLES: &[(&str, f64)] =
    &[("deg", 1.0), ("grad", 0.9), ("rad", 180.0 / std::f64::consts::PI), ("turn", 360.0)];
const SHARES: &[(&str, f64)] = &[("%", 0.01)];

fn quantity(text: &str, units: &[(&str, f64)]) -> Option<f64> {
    let unit = units.iter().find_map(|(unit, size)| Some((text.strip_suffix(unit)?, *size)));
    let (number, size) = unit.unwrap_or((text, 1.0));
    Some(number.parse::<f64>().ok()? * size)
}

#[cfg(test)]
mod tests {
    use super::to_svg;

    #[test]
    fn transforms_of_css_are_those_of_svg() {
        let same = |css: &str, svg: &str| assert_eq!(to_svg(css).as_deref(), Some(svg), "{css}");
        same("translate(100px, 80px)", "translate(100 80)");
        same("translateX(1in) scaleY(50%)", "translate(96 0)scale(1 0.5)");
        same("rotate(0.25turn)", "rotate(90)");
        same("rotate(90 10 20)", "rotate(90 10 20)");
        same("matrix(1,0,0,1,5,6), scale(2)", "matrix(1 0 0 1 5 6)scale(2)");
        for other in ["rotate3d(1,0,0,9deg)", "translate(10%)", "scale(1 2 3)", "scale(", "x"] {
            assert_eq!(to_svg(other), None, "{other}");
        }
    }
}
