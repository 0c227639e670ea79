//! Faces: the common interface of stroke fonts and typefaces.

use std::sync::Arc;

use super::shape::{Fit, Shape};
use super::shaping::Unset;
use noctograph_core::error::Result;

/// Touching letters as one shape.
#[derive(Debug)]
pub(super) struct Joined {
    /// Byte in the line at which the first character starts.
    pub(super) byte: usize,
    /// Position of the pen in the line, in cap heights.
    pub(super) pen: f64,
    /// Strokes relative to the pen, in cap heights.
    pub(super) shape: Arc<Shape>,
}

/// The letters of a line, or the reason why the line cannot be set.
pub(super) type ShapedLine = std::result::Result<Vec<Joined>, Unset>;

/// The characters of a font, from stored strokes or from a typeface.
pub(super) trait Face {
    /// Returns all characters of the font, sorted by code.
    fn characters(&self) -> Box<dyn Iterator<Item = char> + '_>;

    /// Returns the strokes of a character, or `None` if the font lacks it.
    fn shape(&self, character: char) -> Option<Arc<Shape>>;

    /// True if the font has a character.
    fn has(&self, character: char) -> bool {
        self.shape(character).is_some()
    }

    /// Returns how the characters are placed in their cells.
    fn fit(&self) -> Fit {
        Fit::Proportional
    }

    /// Returns a letter with one more combining mark, or `None` if the font lacks the mark or
    /// shapes marks itself.
    fn with_mark(&self, _base: &Shape, _mark: char) -> Option<Arc<Shape>> {
        None
    }

    /// Returns the shaped letters of a text from left to right, or `None` for a font that does no
    /// shaping. `space` is the advance of a space that the font lacks, in cap heights.
    fn shaped_line(&self, _text: &str, _space: f64) -> Option<ShapedLine> {
        None
    }

    /// Returns the kerning of two characters in cap heights.
    fn kern(&self, _pair: [char; 2]) -> f64 {
        0.0
    }

    /// Checks that all characters so far were drawn within the budget. The error names the limit.
    fn check_work(&self) -> Result<()> {
        Ok(())
    }
}
