//! Marks: the findings of a verdict as lines on the photo.

/// Lines on a photo, in its pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marks {
    /// Intended strokes, moved to where their letters were found.
    pub intended: Vec<Vec<[f64; 2]>>,
    /// Parts of them that have no light.
    pub missing: Vec<Vec<[f64; 2]>>,
    /// Points of light where none was intended.
    pub stray: Vec<Vec<[f64; 2]>>,
    /// Corners of the letters' cells, clockwise from the upper left, in the order of the letters
    /// that have light.
    pub cells: Vec<Vec<[f64; 2]>>,
}
