//! Faces: what a font of strokes and a typeface have in common.

use std::sync::Arc;

use super::shape::{Fit, Shape};
use super::shaping::Unset;
use noctograph_core::error::Result;

/// Letters that touch, as one shape: the byte of its first character in the line, its left edge and
/// its strokes, in cap heights.
pub(super) type Joined = (usize, f64, Arc<Shape>);

/// Letters of a line, or why it cannot be set.
pub(super) type Line = std::result::Result<Vec<Joined>, Unset>;

/// The characters of a font: strokes as they are stored, or a typeface.
pub(super) trait Face {
    /// Its characters, in the order of their codes.
    fn characters(&self) -> Box<dyn Iterator<Item = char> + '_>;

    /// A character's strokes, if the font has it.
    fn shape(&self, character: char) -> Option<Arc<Shape>>;

    fn has(&self, character: char) -> bool {
        self.shape(character).is_some()
    }

    fn fit(&self) -> Fit {
        Fit::Proportional
    }

    /// A letter with one more combining mark. `None` for a font without this mark, or one that
    /// shapes marks itself.
    fn marked(&self, _base: &Shape, _mark: char) -> Option<Arc<Shape>> {
        None
    }

    /// A line of letters that are shaped, from left to right. `None` for a font that shapes none.
    fn line(&self, _line: &str, _space: f64) -> Option<Line> {
        None
    }

    /// Kerning of two characters, in cap heights.
    fn kern(&self, _pair: [char; 2]) -> f64 {
        0.0
    }

    /// Checks that all characters so far were drawn within the budget.
    fn check_work(&self) -> Result<()> {
        Ok(())
    }
}
