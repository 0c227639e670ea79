//! Letters converts a word or a drawing to [`Strokes`] in the plane of the word.
//!
//! Input: a word, or a file with a drawing. Output: placed glyphs, each a list of pen moves, lit or
//! dark. In the plane of the word, x is to the viewer's right and y up from the floor, in meters.

#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "tests read what they wrote"))]
#![cfg_attr(target_family = "wasm", allow(dead_code, reason = "no typeface comes into a page"))]

mod arcs;
mod center_line;
mod curves;
mod drawing;
mod face;
#[cfg(test)]
mod face_tests;
mod font;
mod fonts;
#[cfg(not(target_family = "wasm"))]
mod glyph;
mod layout;
mod options;
mod outline;
mod shape;
mod shaping;
mod smooth;
mod stored;
mod stroke_font;
#[cfg(not(target_family = "wasm"))]
mod typeface;
mod vector;

#[cfg(not(target_family = "wasm"))]
pub use typeface::has_outline;

pub use drawing::{DRAWING, Ink, LIMIT as DRAWING_LIMIT, draw};
pub use font::Font;
pub use layout::{plain, write};
pub use noctograph_core::strokes::{Cell, Glyph, LeftOut, Move, StrokeOrder, Strokes, StrokesData};
pub use options::{Align, Fitting, LetterOptions, Pace, Trace};
