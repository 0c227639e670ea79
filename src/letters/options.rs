//! How a word is laid out.

use serde::{Deserialize, Serialize};

use super::font;
use crate::error::{Result, within};
use crate::settings::settings;

/// How a word is laid out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LetterOptions {
    /// The font: `ae483` is the reference team's own 26 letters, `ae483-fixed` those repaired,
    /// `simplex` a whole single-line alphabet; or a file: strokes or a typeface.
    pub font: String,
    /// What is followed of a typeface's outlines.
    pub trace: Trace,
    /// A drawing instead of a word: a file `*.svg`, `*.json` or `*.inkml`; empty: none.
    pub drawing: String,
    /// Farthest that straight strokes may lie from a drawing's curves.
    pub tolerance_m: f64,
    /// Farthest that smoothing moves handwriting; 0: it stays as it is.
    pub smoothing_m: f64,
    /// Height of a capital.
    pub cap_height_m: f64,
    /// Width of a letter's box, where the letters have boxes (`ae483`, `ae483-fixed`); others keep
    /// their proportions.
    pub width_m: f64,
    /// Gap between two such boxes.
    pub gap_m: f64,
    /// What is added between two letters of any other font.
    pub spacing_m: f64,
    /// Height of the baseline above the floor: that of the lowest line.
    pub baseline_m: f64,
    /// Gap between a line's baseline and the capitals of the line below it.
    pub line_gap_m: f64,
    /// Where each line stands.
    pub align: Align,
    /// Largest width and height; a text that is larger is made smaller, gaps and all. A drawing
    /// fills it, and where there is none, four cap heights by one.
    pub canvas_m: Option<[f64; 2]>,
}

settings! {
    /// Lines that are followed in the outlines of a typeface.
    pub enum Trace {
        /// The center lines of their strokes, as a pen would write them.
        "centre-line" => CentreLine,
        /// The outlines themselves.
        "outline" => Outline,
    }
}

/// Where a line stands beside x = 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Align {
    /// As the reference team put it: the first letter begins at half the letters' widths to the
    /// left, gaps not counted, so that the line hangs right of the middle by half its gaps.
    #[default]
    Ae483,
    /// It begins at x = 0.
    Left,
    /// Its middle is at x = 0.
    Centre,
    /// It ends at x = 0.
    Right,
}

impl Default for LetterOptions {
    /// The reference flight: boxes of 0.30 m by 0.50 m from 0.5 m above the floor, 0.1 m apart.
    fn default() -> Self {
        Self {
            font: "ae483".into(),
            trace: Trace::CentreLine,
            drawing: String::new(),
            tolerance_m: 0.001,
            smoothing_m: 0.005,
            cap_height_m: 0.5,
            width_m: 0.3,
            gap_m: 0.1,
            spacing_m: 0.0,
            baseline_m: 0.5,
            line_gap_m: 0.25,
            align: Align::Ae483,
            canvas_m: None,
        }
    }
}

impl LetterOptions {
    /// Checks the ranges. Opens no file.
    ///
    /// # Errors
    ///
    /// [`crate::error::Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        font::check_name(&self.font)?;
        within("letters.cap_height_m", self.cap_height_m, 0.01, 100.0)?;
        within("letters.tolerance_m", self.tolerance_m, 1e-4, 1.0)?;
        within("letters.smoothing_m", self.smoothing_m, 0.0, 1.0)?;
        within("letters.width_m", self.width_m, 0.01, 100.0)?;
        within("letters.gap_m", self.gap_m, 0.0, 100.0)?;
        within("letters.spacing_m", self.spacing_m, -1.0, 100.0)?;
        within("letters.baseline_m", self.baseline_m, 0.0, 1000.0)?;
        within("letters.line_gap_m", self.line_gap_m, 0.0, 100.0)?;
        for side_m in self.canvas_m.into_iter().flatten() {
            within("letters.canvas_m", side_m, 0.01, 1000.0)?;
        }
        Ok(())
    }

    /// The same in another size, on the same baseline.
    pub(super) fn scaled(&self, scale: f64) -> Self {
        Self {
            cap_height_m: self.cap_height_m * scale,
            width_m: self.width_m * scale,
            gap_m: self.gap_m * scale,
            spacing_m: self.spacing_m * scale,
            line_gap_m: self.line_gap_m * scale,
            ..self.clone()
        }
    }
}
