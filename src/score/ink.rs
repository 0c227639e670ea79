//! Ink: strokes drawn with a round pen.
//!
//! The page is a raster whose pixel `x, y` has its center at +0.5 and y down; moves are given in
//! the plane of the word (meters, y up), with the transform that brings them onto the page.

use tiny_skia::{FillRule, LineCap, LineJoin, Mask, Path, PathBuilder, Stroke, Transform};

use super::raster::Raster;
use noctograph_core::strokes::Move;

/// A page that ink is put on: coverage from 0 to 1.
pub(super) struct Page(Mask);

impl Page {
    pub(super) fn blank(width: usize, height: usize) -> Self {
        let side = |pixels| u32::try_from(pixels).expect("pages are some hundred pixels wide");
        Self(Mask::new(side(width), side(height)).expect("a page has pixels"))
    }

    /// Draws the lit moves with a round pen.
    pub(super) fn stroke(&mut self, moves: &[Move], pen_px: f32, page_from_plane: Transform) {
        if let Some(path) = path_of(moves).and_then(|path| path.transform(page_from_plane)) {
            self.line(&path, pen_px, LineJoin::Round);
        }
    }

    // The path lies on the page already, so the pen stays round however it was stretched.
    fn line(&mut self, path: &Path, pen_px: f32, line_join: LineJoin) {
        let stroke =
            Stroke { width: pen_px, line_cap: LineCap::Round, line_join, ..Stroke::default() };
        if let Some(line) = path.stroke(&stroke, 1.0) {
            self.0.fill_path(&line, FillRule::Winding, true, Transform::identity());
        }
    }

    pub(super) fn dry(self) -> Raster {
        Raster {
            width: self.0.width() as usize,
            height: self.0.height() as usize,
            values: self.0.data().iter().map(|coverage| f32::from(*coverage) / 255.0).collect(),
        }
    }
}

/// The lit moves as a path; `None` where nothing is lit.
fn path_of(moves: &[Move]) -> Option<Path> {
    #[expect(clippy::cast_possible_truncation, reason = "a raster needs no more")]
    let narrow = |[x, y]: [f64; 2]| (x as f32, y as f32);
    let mut builder = PathBuilder::new();
    let mut pen_at = None;
    for step in moves.iter().filter(|step| step.lit) {
        if pen_at != Some(step.from_m) {
            let (x, y) = narrow(step.from_m);
            builder.move_to(x, y);
        }
        let (x, y) = narrow(step.to_m);
        builder.line_to(x, y);
        pen_at = Some(step.to_m);
    }
    builder.finish()
}
