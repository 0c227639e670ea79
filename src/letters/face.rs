//! Faces: what a font of strokes and a typeface have in common.

use std::sync::Arc;

use super::shape::{Fit, Shape};
use super::shaping::Unset;
use noctograph_core::error::Result;

/// Letters that touch, as one shape: the byte of its first character in the line, its left edge and
/// its strokes, in cap heights.
pub(super) type Joined = (usize, f64, Arc<Shape>);

/// Letters of a line, or why it cannot be set.
pub(super) type ShapedLine = std::result::Result<Vec<Joined>, Unset>;

/// The characters of a font: strokes as they are stored, or a typeface.
pub(super) trait Face {
    /// All characters that the font has, in the order of their codes.
    fn characters(&self) -> Box<dyn Iterator<Item = char> + '_>;

    /// The strokes of a character. `None` if the font lacks it.
    fn shape(&self, character: char) -> Option<Arc<Shape>>;

    /// True if the font has a character.
    fn has(&self, character: char) -> bool {
        self.shape(character).is_some()
    }

    /// How the characters are placed in their cells.
    fn fit(&self) -> Fit {
        Fit::Proportional
    }

    /// A letter with another combining mark. `None` if the font lacks it, or shapes marks itself.
    fn with_mark(&self, _base: &Shape, _mark: char) -> Option<Arc<Shape>> {
        None
    }

    /// The shaped letters of a text from left to right, with `space` as the advance of a space that
    /// the font lacks. `None` for a font that shapes none.
    fn shaped_line(&self, _text: &str, _space: f64) -> Option<ShapedLine> {
        None
    }

    /// Kerning of two characters, in cap heights.
    fn kern(&self, _pair: [char; 2]) -> f64 {
        0.0
    }

    /// Checks that all characters so far were drawn within the budget. The error names the limit.
    fn check_work(&self) -> Result<()> {
        Ok(())
    }
}
