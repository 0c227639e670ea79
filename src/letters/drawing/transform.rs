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
        let lengths = || list.iter().map(|part| length(part)).collect::<Option<Vec<f64>>>();
        let numbers = || list.iter().map(|part| number(part)).collect::<Option<Vec<f64>>>();
        let one = |values: Vec<f64>| (values.len() == 1).then(|| values[0]);
        let (name, values) = match name.trim() {
            "translate" => ("translate", lengths()?),
            "translateX" => ("translate", vec![one(lengths()?)?, 0.0]),
            "translateY" => ("translate", vec![0.0, one(lengths()?)?]),
            "scale" => ("scale", numbers()?),
            "scaleX" => ("scale", vec![one(numbers()?)?, 1.0]),
            "scaleY" => ("scale", vec![1.0, one(numbers()?)?]),
            "rotate" | "rotateZ" => {
                let mut values = vec![degrees(list.first()?)?];
                for part in &list[1..] {
                    values.push(length(part)?);
                }
                ("rotate", values)
            }
            "skewX" => ("skewX", vec![degrees(list.first()?)?]),
            "skewY" => ("skewY", vec![degrees(list.first()?)?]),
            "skew" => {
                let y = list.get(1).map_or(Some(0.0), |part| degrees(part))?;
                let (x, y) = (degrees(list.first()?)?.to_radians(), y.to_radians());
                ("matrix", vec![1.0, libm::tan(y), libm::tan(x), 1.0, 0.0, 0.0])
            }
            "matrix" => ("matrix", lengths()?),
            _ => return None,
        };
        let counts: &[usize] = match name {
            "translate" | "scale" => &[1, 2],
            "rotate" => &[1, 3],
            "matrix" => &[6],
            _ => &[1],
        };
        if !counts.contains(&values.len()) || values.iter().any(|value| !value.is_finite()) {
            return None;
        }
        let values: Vec<String> = values.iter().map(f64::to_string).collect();
        let _ = write!(converted, "{name}({})", values.join(" "));
        rest = after.trim_start_matches(|c: char| c.is_whitespace() || c == ',');
    }
    Some(converted)
}

fn number(text: &str) -> Option<f64> {
    match text.strip_suffix('%') {
        Some(percent) => Some(0.01 * percent.parse::<f64>().ok()?),
        None => text.parse().ok(),
    }
}

/// User units.
fn length(text: &str) -> Option<f64> {
    let units = [
        ("px", 1.0),
        ("pt", 96.0 / 72.0),
        ("pc", 16.0),
        ("mm", 96.0 / 25.4),
        ("cm", 96.0 / 2.54),
        ("in", 96.0),
    ];
    let unit = units.iter().find_map(|(unit, size)| Some((text.strip_suffix(unit)?, *size)));
    let (number, size) = unit.unwrap_or((text, 1.0));
    Some(number.parse::<f64>().ok()? * size)
}

fn degrees(text: &str) -> Option<f64> {
    let units =
        [("deg", 1.0), ("grad", 0.9), ("rad", 180.0 / std::f64::consts::PI), ("turn", 360.0)];
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
