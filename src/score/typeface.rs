//! The typeface of the second bank of references: Roboto Thin, fitted to the cells of a word.

use ab_glyph::{Font, FontRef};
use kurbo::PathEl;
use tiny_skia::{Path, PathBuilder, Transform};

use crate::letters::glyph_outline;

/// Roboto Thin (Apache 2.0, see fonts/README.md).
const TTF: &[u8] = include_bytes!("../../fonts/Roboto-Thin.ttf");

/// Widest that a letter is stretched to fill its cell. Without stretching, the typeface's E is a
/// foreign body beside a flown E as wide as its box; with too much, I becomes a bar.
const MAX_STRETCH: f64 = 1.6;

/// A typeface, its capitals and its stem measured.
pub(super) struct Typeface {
    font: FontRef<'static>,
    /// Height of H.
    cap_height: f64,
    /// Thickness of I: the outline's own pen.
    stem: f64,
}

/// A character's outline in font units, y up.
pub(super) struct Outline {
    pub(super) path: Path,
    /// Brings the middle lines of its strokes into a box one wide and one high, y up, for the cell
    /// it was asked for.
    pub(super) box_from_outline: Transform,
}

impl Typeface {
    pub(super) fn load() -> Self {
        let font = FontRef::try_from_slice(TTF).expect("the font under fonts/ is read by a test");
        let extent = |character, vertical: bool| {
            let bounds = draw(&font, character)
                .and_then(|path| path.compute_tight_bounds())
                .expect("the font under fonts/ has A to Z and 0 to 9");
            f64::from(if vertical { bounds.height() } else { bounds.width() })
        };
        let (cap_height, stem) = (extent('H', true), extent('I', false));
        Self { font, cap_height, stem }
    }

    /// Thickness of a stem as a share of the cap height, both measured along middle lines.
    pub(super) fn stem(&self) -> f32 {
        #[expect(clippy::cast_possible_truncation, reason = "a raster needs no more")]
        let stem = (self.stem / (self.cap_height - self.stem)) as f32;
        stem
    }

    /// A character for a cell of the given aspect (width by cap height). It is as high as the cell,
    /// and as wide where stretching it by at most `MAX_STRETCH` or squeezing it does it; narrower
    /// ones keep their shape and stand in the middle.
    pub(super) fn outline(&self, character: char, aspect: f64) -> Option<Outline> {
        let path = draw(&self.font, character)?;
        let bounds = path.compute_tight_bounds()?;
        let units = self.cap_height - self.stem;
        let natural = (f64::from(bounds.width()) - self.stem) / units;
        let stretch = if natural * MAX_STRETCH < aspect { 1.0 } else { aspect / natural };
        let middle = 0.5 * f64::from(bounds.left() + bounds.right());

        #[expect(clippy::cast_possible_truncation, reason = "a raster needs no more")]
        let box_from_outline = Transform::from_row(
            (stretch / units / aspect) as f32,
            0.0,
            0.0,
            (1.0 / units) as f32,
            (0.5 - middle * stretch / units / aspect) as f32,
            (-0.5 * self.stem / units) as f32,
        );
        Some(Outline { path, box_from_outline })
    }
}

/// A character's curves.
#[expect(clippy::cast_possible_truncation, reason = "a face's coordinates are f32")]
fn draw(font: &FontRef<'_>, character: char) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for element in &glyph_outline(font, font.glyph_id(character))? {
        match element {
            PathEl::MoveTo(p) => builder.move_to(p.x as f32, p.y as f32),
            PathEl::LineTo(p) => builder.line_to(p.x as f32, p.y as f32),
            PathEl::QuadTo(c, p) => {
                builder.quad_to(c.x as f32, c.y as f32, p.x as f32, p.y as f32);
            }
            PathEl::CurveTo(c, d, p) => {
                let [(cx, cy), (dx, dy), (x, y)] = [c, d, p].map(|p| (p.x as f32, p.y as f32));
                builder.cubic_to(cx, cy, dx, dy, x, y);
            }
            PathEl::ClosePath => builder.close(),
        }
    }
    builder.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_reference_character_has_an_outline_as_high_as_its_cell() {
        let typeface = Typeface::load();
        for character in ('A'..='Z').chain('0'..='9') {
            let outline = typeface.outline(character, 0.6).unwrap();
            let bounds = outline.path.transform(outline.box_from_outline).unwrap();
            let bounds = bounds.compute_tight_bounds().unwrap();
            // Q hangs below the line; round letters overshoot it by a hundredth.
            assert!((bounds.bottom() - 1.02).abs() < 0.02, "{character}: {bounds:?}");
            assert!(bounds.top() > -0.22 && bounds.top() < -0.01, "{character}: {bounds:?}");
            assert!(bounds.left() > -0.05 && bounds.right() < 1.05, "{character}: {bounds:?}");
            let middle = 0.5 * (bounds.left() + bounds.right());
            assert!((middle - 0.5).abs() < 1e-3, "{character} stands in the middle");
        }
    }

    #[test]
    fn narrow_characters_keep_their_shape() {
        let typeface = Typeface::load();
        let width = |character| {
            let outline = typeface.outline(character, 0.6).unwrap();
            let path = outline.path.transform(outline.box_from_outline).unwrap();
            path.compute_tight_bounds().unwrap().width()
        };
        assert!(width('I') < 0.1 && width('1') < 0.6, "I and 1 are narrow");
        assert!(width('E') > 1.0 && width('W') < 1.1, "E is stretched, W is squeezed");
    }
}
