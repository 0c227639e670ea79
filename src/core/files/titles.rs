//! Units in the titles of columns, such as `x [mm]`, `Time (msec)` or `yaw_deg`.

/// Size of a degree in radians.
pub const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Names of units in lower case, and their sizes in SI units.
const UNITS: [(&str, f64); 9] = [
    ("m meter meters metres m_s m_s2 m_s_2 s sec secs second seconds rad radians rad_s", 1.0),
    ("mm millimeter millimeters mm_s ms msec millis millisecond milliseconds mrad mrad_s", 1e-3),
    ("cm centimeter centimeters cm_s", 1e-2),
    ("us usec micros microsecond microseconds", 1e-6),
    ("ns nsec nanos nanosec nanosecond nanoseconds", 1e-9),
    ("deg degree degrees deg_s", DEGREE),
    ("in inch inches", 0.0254),
    ("ft feet foot ft_s", 0.3048),
    ("km", 1e3),
];

/// Names of units that apply only to times (`x_min` is not a time), and their sizes in s.
const UNITS_OF_TIME: [(&str, f64); 3] =
    [("min mins minute minutes", 60.0), ("h hr hrs hour hours", 3600.0), ("d day days", 86_400.0)];

/// Returns the size of a unit in SI units, or `None` for an unknown name. Minutes, hours and days
/// are recognized only if `is_time`, because `h` and `d` also name other quantities.
pub fn unit(name: &str, is_time: bool) -> Option<f64> {
    let units_of_time = if is_time { &UNITS_OF_TIME[..] } else { &[] };
    let mut units = UNITS.iter().chain(units_of_time);
    let unit = units.find(|(names, _)| names.split(' ').any(|unit_name| unit_name == name));
    unit.map(|(_, size)| *size)
}

/// Splits a title into its name and the unit in brackets at its end, if there is one.
pub fn bracketed(title: &str) -> (&str, Option<&str>) {
    let trimmed = title.trim();
    for [open, close] in [['[', ']'], ['(', ')'], ['{', '}'], ['<', '>']] {
        let inside = trimmed.strip_suffix(close).and_then(|text| text.rsplit_once(open));
        if let Some((before, unit)) = inside {
            return (before.trim(), Some(unit.trim()));
        }
    }
    (trimmed, None)
}

/// Returns a title in lower case, with underscores in place of blanks and symbols. For example,
/// `Yaw [°/s]` becomes `yaw_deg_s`.
pub fn simplified(title: &str) -> String {
    let lower = title.to_lowercase().replace("m/s²", "m_s2").replace("^-1", "");
    let lower = lower.replace('°', "deg").replace(['µ', 'μ'], "u").replace('²', "2");
    let lower = lower.replace(['[', '(', ' ', '/', '-', '^'], "_");
    let mut lower = lower.replace([']', ')', '%', '#'], "");
    while lower.contains("__") {
        lower = lower.replace("__", "_");
    }
    lower.trim_start_matches('_').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_title_names_its_unit() {
        assert_eq!(bracketed(" Time [msec] "), ("Time", Some("msec")));
        assert_eq!(bracketed("x"), ("x", None));
        assert_eq!(simplified("[°/s]"), "deg_s");
        let sizes = ["msec", "cm", "deg", "min"].map(|name| unit(name, false));
        assert_eq!(sizes, [Some(1e-3), Some(1e-2), Some(DEGREE), None]);
        for (names, size) in [("ft feet foot", 0.3048), ("in inch inches", 0.0254)] {
            assert!(names.split(' ').all(|name| unit(name, false) == Some(size)), "{names}");
        }
        assert_eq!(unit("millisecond", true), Some(1e-3));
        assert_eq!(unit("min", true), Some(60.0));
    }
}
