//! Options of letters and their layout.

use super::font;
use noctograph_core::error::Result;
use noctograph_core::settings::{Described, settings};

settings! {
    /// Letters and their layout.
    ///
    /// The default is that of the reference flight: boxes of 0.30 m by 0.50 m with gaps of 0.1 m,
    /// starting 0.5 m above the floor.
    pub struct LetterOptions {
        /// Font: `ae483` (the reference team's 26 letters), `ae483-fixed` (the same, repaired),
        /// `simplex` (a single-line alphabet), or a file `*.strokes`, `*.ttf` or `*.otf`.
        font: String = "ae483".into();
        /// Fonts for letters that the font lacks, such as a typeface of another script. The first
        /// font that contains a letter is used.
        fallback: Vec<String> = Vec::new(), unless "letters.drawing";
        /// Lines that are drawn from a typeface or a picture.
        trace: Trace = Trace::CenterLine;
        /// File of a drawing that replaces the word: `*.svg`, a picture `*.png`, `*.jpg`, `*.webp`,
        /// `*.gif` or `*.bmp`, or handwriting `*.json`. Empty for none.
        drawing: String = String::new();
        /// SHA-256 that the drawing's file must have. An empty digest is not checked. Commands
        /// write the digest into the scenes that they write.
        drawing_sha256: String = String::new(), for "letters.drawing";
        /// Corners of the sheet of paper in a picture, to which the picture is cropped and
        /// rectified: x and y of the upper left, upper right, lower right and lower left corner, in
        /// the picture's pixels. By default the whole picture is drawn.
        corners_px: Option<[f64; 8]> = None, in -1e5..=1e5, for "letters.drawing";
        /// Detail of an SVG drawing or a picture. 1 draws every stroke. Below 1, strokes that
        /// continue each other are joined, short ones are dropped, and all are smoothed. 0 sketches
        /// only the longest strokes.
        detail: f64 = 1.0, in 0.0..=1.0, for "letters.drawing";
        /// Strokes to draw, as large as the canvas allows: colors, or numbers as in the plan's
        /// drawing, such as `red` or `2,5-7`. Empty for all strokes.
        ink: String = String::new(), for "letters.drawing";
        /// Strokes to leave out: colors or numbers. Empty for none.
        without: String = String::new(), for "letters.drawing";
        /// Speed along the strokes of handwriting whose points have times.
        pace: Pace = Pace::Even, for "plan.style" = "even";
        /// Height of a capital letter.
        cap_height_m: f64 = 0.5, in 0.01..=100.0;
        /// Width of a letter's box in fonts with boxes (`ae483`, `ae483-fixed`), by default 0.6 cap
        /// heights. Letters of other fonts keep their proportions.
        width_m: Option<f64> = None, in 0.01..=100.0,
            for "letters.font" = "ae483" | "ae483-fixed";
        /// Gap between the boxes of two letters, by default 0.2 cap heights.
        gap_m: Option<f64> = None, in 0.0..=100.0,
            for "letters.font" = "ae483" | "ae483-fixed";
        /// Extra space between two letters in fonts without boxes.
        spacing_m: f64 = 0.0, in -1.0..=100.0,
            unless "letters.drawing", unless "letters.font" = "ae483" | "ae483-fixed";
        /// Height of the lowest line's baseline above the floor.
        baseline_m: f64 = 0.5, in 0.0..=1000.0;
        /// Gap between a baseline and the capitals of the line below it, by default half a cap
        /// height.
        line_gap_m: Option<f64> = None, in 0.0..=100.0;
        /// Horizontal alignment of each line.
        align: Align = Align::Ae483;
        /// Maximum width and height. A larger text is broken at spaces if that keeps its letters
        /// larger, and is then scaled down. A drawing fills the canvas, or four cap heights by one
        /// if the canvas is left out.
        canvas_m: Option<[f64; 2]> = None, in 0.01..=1000.0;
        /// Size of the text on the canvas.
        fit: Fitting = Fitting::Shrink, for "letters.canvas_m", unless "letters.drawing";
        fixed {
            /// Maximum distance between straight strokes and a drawing's curves.
            tolerance_m: f64 = 0.001;
            /// Maximum distance by which smoothing moves handwriting. 0 means no smoothing.
            smoothing_m: f64 = 0.005;
        }
    }

    /// Size of a text on a canvas.
    pub enum Fitting {
        /// The text's own size, reduced to fit the canvas.
        "shrink" => Shrink,
        /// The largest size that fits the canvas.
        "fill" => Fill,
    }

    /// Lines that are drawn from a typeface or a picture.
    pub enum Trace {
        /// Center lines of the strokes, as a pen writes them. Patches of a picture that are too
        /// thick for a pen are outlined.
        "center-line" => CenterLine,
        /// The outlines themselves.
        "outline" => Outline,
    }

    /// Speed along the strokes of handwriting.
    pub enum Pace {
        /// A single speed, which is the plan's stroke speed.
        "even" => Even,
        /// The writer's pace: when the pen was slower than its mean speed, the drone slows down in
        /// proportion, but not below a quarter of the stroke speed, and its light is brighter.
        "written" => Written,
    }

    /// Horizontal alignment of a line.
    pub enum Align {
        /// Alignment of the reference flight: the line starts half the letters' widths to the left,
        /// not counting gaps, so that its center is shifted to the right by half of its gaps.
        "ae483" => Ae483,
        /// The line starts at x = 0.
        "left" => Left,
        /// The center of the line is at x = 0.
        "center" => Center,
        /// The line ends at x = 0.
        "right" => Right,
    }
}

impl LetterOptions {
    /// Checks the ranges and the names of fonts, without opening any file.
    ///
    /// # Errors
    ///
    /// Returns [`noctograph_core::error::Error::Input`] with the key that is out of range.
    pub fn check(&self) -> Result<()> {
        font::check_name("letters.font", &self.font)?;
        for name in &self.fallback {
            font::check_name("letters.fallback", name)?;
        }
        Described::check(self, "letters", None)
    }

    /// Returns the keys that name a file, each with its path: fonts that the program does not
    /// contain, and the drawing.
    pub fn files(&self) -> impl Iterator<Item = (&'static str, &str)> {
        let fallback = self.fallback.iter().map(|name| ("letters.fallback", &**name));
        let fonts = std::iter::once(("letters.font", &*self.font)).chain(fallback);
        let drawing = (!self.drawing.is_empty()).then_some(("letters.drawing", &*self.drawing));
        fonts.filter(|(_, name)| !font::is_shipped(name)).chain(drawing)
    }

    /// Returns the options for letters that are `scale` times as large, on the same baseline and
    /// canvas.
    pub fn scaled(&self, scale: f64) -> Self {
        Self {
            cap_height_m: self.cap_height_m * scale,
            width_m: self.width_m.map(|width_m| width_m * scale),
            gap_m: self.gap_m.map(|gap_m| gap_m * scale),
            spacing_m: self.spacing_m * scale,
            line_gap_m: self.line_gap_m.map(|gap_m| gap_m * scale),
            ..self.clone()
        }
    }

    /// Returns the width of a letter's box, by default 0.6 cap heights.
    pub(super) fn box_width_m(&self) -> f64 {
        self.width_m.unwrap_or(0.6 * self.cap_height_m)
    }

    /// Returns the gap between two boxes, by default 0.2 cap heights.
    pub(super) fn box_gap_m(&self) -> f64 {
        self.gap_m.unwrap_or(0.2 * self.cap_height_m)
    }
}
