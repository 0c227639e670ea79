//! QR codes of the page and of visitors' photos.

use qrcode::{Color, EcLevel, QrCode};

/// Width, in modules, of the white border around a code, which readers require.
const QUIET: usize = 4;

/// Returns the rows of a code's modules with the white border, in which `true` is dark. The list is
/// empty if the text is too long.
fn modules(text: &str) -> Vec<Vec<bool>> {
    // With level M, a code remains readable if 15 % of it is damaged. Addresses are far shorter
    // than the maximum of 2.3 kB.
    let Ok(code) = QrCode::with_error_correction_level(text, EcLevel::M) else { return Vec::new() };
    let n = code.width() + 2 * QUIET;
    let mut rows = vec![vec![false; n]; n];
    for y in 0..code.width() {
        for x in 0..code.width() {
            rows[y + QUIET][x + QUIET] = code[(x, y)] == Color::Dark;
        }
    }
    rows
}

/// Returns the QR code of a text as an SVG picture, dark on white. A text that is too long yields
/// an empty picture.
pub(crate) fn svg(text: &str) -> String {
    // A single path draws all dark modules over a white square.
    let rows = modules(text);
    let mut path = String::new();
    for (y, row) in rows.iter().enumerate() {
        for (x, _) in row.iter().enumerate().filter(|(_, dark)| **dark) {
            path += &format!("M{x} {y}h1v1h-1z");
        }
    }
    let n = rows.len();
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {n} {n}\" \
         shape-rendering=\"crispEdges\"><path fill=\"#fff\" d=\"M0 0h{n}v{n}h-{n}z\"/><path \
         d=\"{path}\"/></svg>"
    )
}

/// Returns the QR code of a text for a terminal with a black background, with two rows of modules
/// per line. The white modules are printed as characters. A text that is too long yields an empty
/// code.
pub fn printed(text: &str) -> String {
    let mut lines = String::new();
    // A character is twice as high as it is wide, so half blocks form square modules.
    for rows in modules(text).chunks(2) {
        for (x, dark) in rows[0].iter().enumerate() {
            lines.push(match (*dark, rows.get(1).is_some_and(|below| below[x])) {
                (false, false) => '█',
                (false, true) => '▀',
                (true, false) => '▄',
                (true, true) => ' ',
            });
        }
        lines.push('\n');
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_code_has_its_three_corners_within_a_quiet_zone() {
        let rows = modules("http://192.168.1.20:8080/k/0123456789abcdef0123456789abcdef/");
        let n = rows.len();
        assert!((21 + 8..=45 + 8).contains(&n), "{n}");
        assert!(rows[..QUIET].iter().flatten().all(|dark| !dark));
        for [x, y] in [[QUIET, QUIET], [n - QUIET - 7, QUIET], [QUIET, n - QUIET - 7]] {
            assert!((0..7).all(|k| rows[y][x + k] && rows[y + 6][x + k]), "a finder at {x}, {y}");
        }
        assert!(svg("x").starts_with("<svg") && printed("x").lines().count() == 15);
    }
}
