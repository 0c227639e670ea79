//! A canvas: lines, cells and words over white or over a photo, as SVG text or as pixels.
//!
//! Pixels have y down, from the upper left corner. Text is left to the viewer's sans-serif typeface
//! in SVG, and written in single strokes as pixels.

use base64::prelude::{BASE64_STANDARD, Engine};
use tiny_skia::{
    FillRule, IntSize, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke, Transform,
};

use noctograph_letters::{Cell, Font, Trace};
use noctograph_picture::photo::{self, Photo, PhotoData};

/// Red, green, blue.
pub(super) type Rgb = [u8; 3];

/// Height of capitals by the size of a typeface.
const CAP_SHARE: f64 = 0.7;

/// Width of written strokes, and the space between characters, by the height of capitals.
const STROKE_SHARE: f64 = 0.12;
const SPACE_SHARE: f64 = 0.25;

/// What a group of an SVG file gives its shapes.
const GROUP: &str = "fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n";

/// What a line is drawn with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pen {
    pub(super) color: Rgb,
    pub(super) width_px: f64,
    pub(super) dashed: bool,
    /// Whether what a line surrounds is filled, thinly.
    pub(super) filled: bool,
}

impl Pen {
    /// A whole line.
    pub(super) const fn new(color: Rgb, width_px: f64) -> Self {
        Self { color, width_px, dashed: false, filled: false }
    }
}

/// The point of a text's lower edge that stands at its place.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
    /// The middle of a text that is read from below to above.
    Upward,
}

/// What lines, dots and words are drawn on, whatever becomes of them.
pub(super) trait Surface {
    /// Begins a layer, by its name.
    fn layer(&mut self, name: &str);

    fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, pen: Pen);

    fn dot(&mut self, place_px: [f64; 2], radius_px: f64, color: Rgb);

    /// Writes a text whose capitals have a height, from its lower left corner on.
    fn write(&mut self, text: &str, place_px: [f64; 2], cap_px: f64, color: Rgb);

    /// The rim of a disk.
    fn ring(&mut self, [x, y]: [f64; 2], radius_px: f64, pen: Pen) {
        let corner = |i: u32| {
            let (sin, cos) = libm::sincos(f64::from(i) * std::f64::consts::TAU / 24.0);
            [x + radius_px * cos, y + radius_px * sin]
        };
        self.line((0..=24).map(corner), pen);
    }
}

/// A part of a plane of the world: its upper left corner in pixels and in meters, and its scale.
pub(super) struct Window {
    pub(super) corner_px: [f64; 2],
    pub(super) corner_m: [f64; 2],
    pub(super) px_per_m: f64,
}

impl Window {
    /// The pixel of a place, to the right and up.
    pub(super) fn px(&self, [across_m, up_m]: [f64; 2]) -> [f64; 2] {
        let (right_m, down_m) = (across_m - self.corner_m[0], self.corner_m[1] - up_m);
        [self.corner_px[0] + right_m * self.px_per_m, self.corner_px[1] + down_m * self.px_per_m]
    }
}

/// An SVG file's text that is drawn on.
pub(super) struct Canvas(String);

impl Canvas {
    /// A white canvas; its sides are rounded up to whole pixels.
    pub(super) fn white(size_px: [f64; 2]) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "thousands")]
        let size_px = size_px.map(|side| side.ceil() as u32);
        Self::new(size_px, "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n")
    }

    /// A canvas over a photo, which the file has inside.
    pub(super) fn over(photo: &Photo) -> Self {
        let PhotoData { width_px, height_px, .. } = &**photo;
        let image = format!(
            "<image width=\"{width_px}\" height=\"{height_px}\" \
             href=\"data:image/png;base64,{}\"/>\n",
            BASE64_STANDARD.encode(photo::encode_png(photo, None, &[]))
        );
        Self::new([*width_px, *height_px], &image)
    }

    /// A canvas over some SVG.
    pub(super) fn new([width, height]: [u32; 2], ground: &str) -> Self {
        Self(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\">\n{ground}<g {GROUP}"
        ))
    }

    /// The rim of a rectangle: left, top, right, bottom.
    pub(super) fn frame(&mut self, [left, top, right, bottom]: [f64; 4], pen: Pen) {
        self.line([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], pen);
    }

    /// A rectangle without smoothed edges, so that neighbors meet: left, top, right, bottom.
    pub(super) fn cell(&mut self, [left, top, right, bottom]: [f64; 4], color: Rgb) {
        self.0 += &format!(
            "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" \
             fill=\"{}\" shape-rendering=\"crispEdges\"/>\n",
            right - left,
            bottom - top,
            hex(color)
        );
    }

    /// Writes a text whose capitals have a height.
    pub(super) fn text(
        &mut self,
        text: impl AsRef<str>,
        [x, y]: [f64; 2],
        anchor: Anchor,
        cap_px: f64,
        color: Rgb,
    ) {
        let (anchor, turned) = match anchor {
            Anchor::Start => ("start", String::new()),
            Anchor::Middle => ("middle", String::new()),
            Anchor::End => ("end", String::new()),
            Anchor::Upward => ("middle", format!(" transform=\"rotate(-90 {x:.1} {y:.1})\"")),
        };
        self.0 += &format!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{:.1}\" \
             fill=\"{}\"{turned}>{}</text>\n",
            cap_px / CAP_SHARE,
            hex(color),
            escaped(text.as_ref())
        );
    }

    /// The file.
    pub(super) fn svg(self) -> String {
        self.0 + "</g>\n</svg>\n"
    }
}

impl Surface for Canvas {
    fn layer(&mut self, name: &str) {
        self.0 += &format!("</g>\n<g id=\"{name}\" {GROUP}");
    }

    fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, pen: Pen) {
        let dash = match pen.dashed {
            true => " stroke-dasharray=\"3 3\" stroke-linecap=\"butt\"",
            false => "",
        };
        let points = points.into_iter().map(|[x, y]| format!("{x:.1},{y:.1}"));
        let (points, color) = (points.collect::<Vec<_>>().join(" "), hex(pen.color));
        let fill = format!(" fill=\"{color}\" fill-opacity=\"0.15\"");
        let fill = if pen.filled { &*fill } else { "" };
        self.0 += &format!(
            "<polyline points=\"{points}\" stroke=\"{color}\" stroke-width=\"{:.1}\"{dash}{fill}/>\n",
            pen.width_px
        );
    }

    fn dot(&mut self, [x, y]: [f64; 2], radius_px: f64, color: Rgb) {
        let fill = hex(color);
        self.0 += &format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius_px:.1}\" fill=\"{fill}\"/>\n"
        );
    }

    fn write(&mut self, text: &str, place_px: [f64; 2], cap_px: f64, color: Rgb) {
        self.text(text, place_px, Anchor::Start, cap_px, color);
    }
}

/// Pixels that are drawn on.
pub(super) struct Pixels {
    pixels: Pixmap,
    letters: Font,
}

impl Pixels {
    /// Those of a photo.
    pub(super) fn new(photo: &Photo) -> Self {
        let rgba = photo.rgb8.as_chunks::<3>().0.iter().flat_map(|&[r, g, b]| [r, g, b, 255]);
        let size = IntSize::from_wh(photo.width_px, photo.height_px);
        let pixels = size.and_then(|size| Pixmap::from_vec(rgba.collect(), size));
        Self {
            pixels: pixels.expect("a photo has pixels"),
            letters: Font::open("simplex", Trace::CenterLine).expect("a font of ours"),
        }
    }

    pub(super) fn photo(self) -> Photo {
        let [width_px, height_px] = [self.pixels.width(), self.pixels.height()];
        let rgba = self.pixels.take();
        let rgb8 = rgba.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
        Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None })
    }

    /// The lines of a text from its lower left corner on, and its right end. Characters that the
    /// font lacks are left out.
    pub(super) fn letters(
        &self,
        text: &str,
        [left, baseline]: [f64; 2],
        cap_px: f64,
    ) -> (Vec<Vec<[f64; 2]>>, f64) {
        let (mut lines, mut right) = (Vec::new(), 0.0);
        for character in text.chars() {
            let Some(aspect) = self.letters.aspect(character) else { continue };
            // Meters are pixels here, with the baseline at y = 0.
            let (width_m, cap_height_m) = (aspect * cap_px, cap_px);
            let cell = Cell { left_m: right, baseline_m: 0.0, width_m, cap_height_m };
            let moves = self.letters.glyph(character, cell).map_or(Vec::new(), |glyph| glyph.moves);
            for run in moves.chunk_by(|a, b| a.lit == b.lit).filter(|run| run[0].lit) {
                let ends = std::iter::once(run[0].from_m).chain(run.iter().map(|step| step.to_m));
                lines.push(ends.map(|[x, y]| [left + x, baseline - y]).collect());
            }
            right += width_m + SPACE_SHARE * cap_px;
        }
        (lines, left + right - SPACE_SHARE * cap_px)
    }
}

impl Surface for Pixels {
    fn layer(&mut self, _name: &str) {}

    fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, pen: Pen) {
        let mut path = PathBuilder::new();
        for [x, y] in points.into_iter().map(|point| point.map(narrow)) {
            if path.is_empty() { path.move_to(x, y) } else { path.line_to(x, y) }
        }
        let Some(path) = path.finish() else { return };
        let (width, line_cap, line_join) = (narrow(pen.width_px), LineCap::Round, LineJoin::Round);
        let stroke = Stroke { width, line_cap, line_join, ..Stroke::default() };
        self.pixels.stroke_path(&path, &paint(pen.color), &stroke, Transform::identity(), None);
    }

    fn dot(&mut self, place_px: [f64; 2], radius_px: f64, color: Rgb) {
        let [x, y] = place_px.map(narrow);
        let Some(path) = PathBuilder::from_circle(x, y, narrow(radius_px)) else { return };
        let (rule, transform) = (FillRule::Winding, Transform::identity());
        self.pixels.fill_path(&path, &paint(color), rule, transform, None);
    }

    fn write(&mut self, text: &str, place_px: [f64; 2], cap_px: f64, color: Rgb) {
        let pen = Pen::new(color, (STROKE_SHARE * cap_px).max(1.0));
        for line in self.letters(text, place_px, cap_px).0 {
            self.line(line, pen);
        }
    }
}

fn paint([r, g, b]: Rgb) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    paint
}

/// Text as it stands in SVG and HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

fn hex([red, green, blue]: Rgb) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

#[expect(clippy::cast_possible_truncation, reason = "a picture needs no more")]
fn narrow(value: f64) -> f32 {
    value as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn draw(surface: &mut impl Surface) {
        surface.layer("shapes");
        surface.line([[40.0, 20.0], [60.0, 20.0]], Pen::new([0, 0, 255], 4.0));
        surface.dot([80.0, 20.0], 5.0, [0, 255, 0]);
        surface.write("I<&", [50.0, 50.0], 14.0, [0, 0, 0]);
    }

    #[test]
    fn pixels_show_what_the_file_says() {
        let (width_px, height_px, rgb8) = (100, 60, vec![255; 3 * 6000]);
        let mut pixels =
            Pixels::new(&Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None }));
        draw(&mut pixels);
        let picture = pixels.photo();
        let pixel = |x: usize, y: usize| &picture.rgb8[3 * (100 * y + x)..][..3];
        assert_eq!([pixel(50, 20), pixel(80, 20)], [[0, 0, 255], [0, 255, 0]]);
        let black: Vec<usize> =
            (0..100).filter(|x| (36..51).any(|y| pixel(*x, y)[0] < 128)).collect();
        let ends = [black[0], black[black.len() - 1]];
        assert!((49..54).contains(&ends[0]) && (65..100).contains(&ends[1]), "{ends:?}");
        let mut canvas = Canvas::white([100.0, 60.0]);
        draw(&mut canvas);
        canvas.text("II", [40.0, 50.0], Anchor::Upward, 14.0, [0, 0, 0]);
        let svg = canvas.svg();
        assert!(svg.contains("<g id=\"shapes\"") && svg.contains("I&lt;&amp;</text>"), "{svg}");
        assert!(svg.contains("rotate(-90 40.0 50.0)"), "{svg}");
        assert_eq!(svg.matches("<g").count(), svg.matches("</g>").count());
    }
}
