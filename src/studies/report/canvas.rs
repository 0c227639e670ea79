//! Draws lines, cells and text on a white background or a photo, as SVG or as pixels.
//!
//! Pixel coordinates start at the upper left corner, with y down. Text uses the viewer's sans-serif
//! typeface in SVG, and a single-stroke font in pixels.

use base64::prelude::{BASE64_STANDARD, Engine};
use kurbo::{Point, Rect, Vec2};
use tiny_skia::{
    FillRule, IntSize, LineCap, LineJoin, Paint, PathBuilder, Pixmap, Stroke, Transform,
};

use noctograph_letters::{Cell, Font, Trace};
use noctograph_picture::photo::{self, Photo, PhotoData};

/// Red, green and blue levels of a color.
pub(super) type Rgb = [u8; 3];

/// Cap height relative to the font size.
pub(super) const CAP_RATIO: f64 = 0.7;

/// Stroke width of text, and space between characters, relative to the cap height.
const STROKE_RATIO: f64 = 0.12;
const SPACE_RATIO: f64 = 0.25;

/// Attributes of a group of shapes in an SVG file, including the end of the tag.
const GROUP: &str = "fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n";

/// Style of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pen {
    pub(super) color: Rgb,
    pub(super) width_px: f64,
    pub(super) dashed: bool,
    /// True if the enclosed area is shaded lightly.
    pub(super) filled: bool,
}

impl Pen {
    /// Returns the pen of a solid line.
    pub(super) const fn new(color: Rgb, width_px: f64) -> Self {
        Self { color, width_px, dashed: false, filled: false }
    }
}

/// Point on the lower edge of a text that is aligned with the given position.
#[derive(Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
    /// Middle of a text that is rotated to read upward.
    Upward,
}

/// A surface for lines, dots and text: an SVG file or a raster picture.
pub(super) trait Surface {
    /// Begins a named layer.
    fn layer(&mut self, name: &str);

    /// Draws a line through points.
    fn line(&mut self, points: impl IntoIterator<Item = Point>, pen: Pen);

    /// Draws a filled disk.
    fn dot(&mut self, center: Point, radius_px: f64, color: Rgb);

    /// Writes text with its lower left corner at `corner` and capitals `cap_px` high.
    fn write(&mut self, text: &str, corner: Point, cap_px: f64, color: Rgb);

    /// Draws the outline of a disk as a polygon with 24 corners.
    fn ring(&mut self, center: Point, radius_px: f64, pen: Pen) {
        let corners = (0..=24).map(|i| {
            let (sin, cos) = libm::sincos(f64::from(i) * std::f64::consts::TAU / 24.0);
            center + radius_px * Vec2::new(cos, sin)
        });
        self.line(corners, pen);
    }
}

/// Maps a plane of the world, m, to pixels, given a scale and both upper left corners.
pub(super) struct Window {
    pub(super) corner_px: Point,
    pub(super) corner_m: Point,
    pub(super) px_per_m: f64,
}

impl Window {
    /// Returns the pixel position of a point in the plane.
    pub(super) fn px(&self, point_m: Point) -> Point {
        let Vec2 { x, y } = point_m - self.corner_m;
        self.corner_px + self.px_per_m * Vec2::new(x, -y)
    }

    /// Returns the pixel rectangle of a rectangle in the plane.
    pub(super) fn rect_px(&self, rect_m: Rect) -> Rect {
        Rect::from_points(self.px(rect_m.origin()), self.px(Point::new(rect_m.x1, rect_m.y1)))
    }
}

/// Text of an SVG file, to which shapes are appended.
pub(super) struct Canvas(String);

impl Canvas {
    /// Creates a white canvas of a width and a height, which are rounded up to whole pixels.
    pub(super) fn white(size_px: [f64; 2]) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "thousands")]
        let size_px = size_px.map(|side| side.ceil() as u32);
        Self::new(size_px, "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n")
    }

    /// Creates a canvas over a photo that is embedded in the file.
    pub(super) fn over(photo: &Photo) -> Self {
        let PhotoData { width_px, height_px, .. } = &**photo;
        let image = format!(
            "<image width=\"{width_px}\" height=\"{height_px}\" \
             href=\"data:image/png;base64,{}\"/>\n",
            BASE64_STANDARD.encode(photo::encode_png(photo, None, &[]))
        );
        Self::new([*width_px, *height_px], &image)
    }

    /// Creates a canvas over a background that is given as SVG elements.
    pub(super) fn new([width, height]: [u32; 2], background: &str) -> Self {
        Self(format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\">\n{background}<g {GROUP}"
        ))
    }

    /// Draws the outline of a rectangle.
    pub(super) fn frame(&mut self, Rect { x0, y0, x1, y1 }: Rect, pen: Pen) {
        let corners = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)];
        self.line(corners.map(Point::from), pen);
    }

    /// Draws a filled rectangle, in pixels, without antialiasing, which would leave gaps between
    /// neighbors.
    pub(super) fn cell(&mut self, rect: Rect, color: Rgb) {
        let (Rect { x0, y0, .. }, width, height) = (rect, rect.width(), rect.height());
        self.0 += &format!(
            "<rect x=\"{x0:.1}\" y=\"{y0:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" \
             fill=\"{}\" shape-rendering=\"crispEdges\"/>\n",
            hex(color)
        );
    }

    /// Writes text with capitals `cap_px` high, anchored at a point.
    pub(super) fn text(
        &mut self,
        text: impl AsRef<str>,
        Point { x, y }: Point,
        anchor: Anchor,
        cap_px: f64,
        color: Rgb,
    ) {
        // Upward text is rotated about its anchor point.
        let (anchor, rotation) = match anchor {
            Anchor::Start => ("start", String::new()),
            Anchor::Middle => ("middle", String::new()),
            Anchor::End => ("end", String::new()),
            Anchor::Upward => ("middle", format!(" transform=\"rotate(-90 {x:.1} {y:.1})\"")),
        };
        let (size, color, text) = (cap_px / CAP_RATIO, hex(color), escaped(text.as_ref()));
        self.0 += &format!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" font-size=\"{size:.1}\" \
             fill=\"{color}\"{rotation}>{text}</text>\n"
        );
    }

    /// Returns the complete SVG document.
    pub(super) fn svg(self) -> String {
        self.0 + "</g>\n</svg>\n"
    }
}

impl Surface for Canvas {
    fn layer(&mut self, name: &str) {
        self.0 += &format!("</g>\n<g id=\"{name}\" {GROUP}");
    }

    fn line(&mut self, points: impl IntoIterator<Item = Point>, pen: Pen) {
        let points = points.into_iter().map(|Point { x, y }| format!("{x:.1},{y:.1}"));
        let points = points.collect::<Vec<_>>().join(" ");
        let Pen { width_px, dashed, filled, .. } = pen;
        let color = hex(pen.color);
        self.0 += &format!(
            "<polyline points=\"{points}\" stroke=\"{color}\" stroke-width=\"{width_px:.1}\""
        );
        if dashed {
            self.0 += " stroke-dasharray=\"3 3\" stroke-linecap=\"butt\"";
        }
        if filled {
            self.0 += &format!(" fill=\"{color}\" fill-opacity=\"0.15\"");
        }
        self.0 += "/>\n";
    }

    fn dot(&mut self, Point { x, y }: Point, radius_px: f64, color: Rgb) {
        let fill = hex(color);
        self.0 += &format!(
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius_px:.1}\" fill=\"{fill}\"/>\n"
        );
    }

    fn write(&mut self, text: &str, corner: Point, cap_px: f64, color: Rgb) {
        self.text(text, corner, Anchor::Start, cap_px, color);
    }
}

/// A copy of a photo that serves as a drawing surface.
pub(super) struct Pixels {
    pixels: Pixmap,
    font: Font,
}

impl Pixels {
    /// Creates the surface from a copy of a photo.
    pub(super) fn new(photo: &Photo) -> Self {
        let rgba = photo.rgb8.as_chunks::<3>().0.iter().flat_map(|&[r, g, b]| [r, g, b, 255]);
        let size = IntSize::from_wh(photo.width_px, photo.height_px);
        let pixels = size.and_then(|size| Pixmap::from_vec(rgba.collect(), size));
        Self {
            pixels: pixels.expect("a photo has pixels"),
            font: Font::open("simplex", Trace::CenterLine).expect("a font of ours"),
        }
    }

    /// Returns the photo with everything that was drawn on it.
    pub(super) fn photo(self) -> Photo {
        let [width_px, height_px] = [self.pixels.width(), self.pixels.height()];
        let rgba = self.pixels.take();
        let rgb8 = rgba.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
        Photo::made(PhotoData { width_px, height_px, rgb8, scene_toml: None })
    }

    /// Returns the lines of a text whose lower left corner is `corner`, and the x of its right end.
    /// Characters that the font lacks are omitted.
    pub(super) fn letters(&self, text: &str, corner: Point, cap_px: f64) -> (Vec<Vec<Point>>, f64) {
        let (mut lines, mut right) = (Vec::new(), 0.0);
        for character in text.chars() {
            let Some(aspect) = self.font.aspect(character) else { continue };
            // Here the cell is measured in pixels instead of meters, with the baseline at y = 0.
            let (width_m, cap_height_m) = (aspect * cap_px, cap_px);
            let cell = Cell { left_m: right, baseline_m: 0.0, width_m, cap_height_m };
            let moves = self.font.glyph(character, cell).map_or(Vec::new(), |glyph| glyph.moves);
            for run in moves.chunk_by(|a, b| a.lit == b.lit).filter(|run| run[0].lit) {
                let points = std::iter::once(run[0].from_m).chain(run.iter().map(|m| m.to_m));
                lines.push(points.map(|[x, y]| corner + Vec2::new(x, -y)).collect());
            }
            right += width_m + SPACE_RATIO * cap_px;
        }
        (lines, corner.x + right - SPACE_RATIO * cap_px)
    }
}

impl Surface for Pixels {
    fn layer(&mut self, _name: &str) {}

    fn line(&mut self, points: impl IntoIterator<Item = Point>, pen: Pen) {
        let mut path = PathBuilder::new();
        for Point { x, y } in points {
            let [x, y] = [x, y].map(narrow);
            if path.is_empty() { path.move_to(x, y) } else { path.line_to(x, y) }
        }
        let Some(path) = path.finish() else { return };
        let (width, line_cap, line_join) = (narrow(pen.width_px), LineCap::Round, LineJoin::Round);
        let stroke = Stroke { width, line_cap, line_join, ..Stroke::default() };
        self.pixels.stroke_path(&path, &paint(pen.color), &stroke, Transform::identity(), None);
    }

    fn dot(&mut self, center: Point, radius_px: f64, color: Rgb) {
        let [x, y, radius] = [center.x, center.y, radius_px].map(narrow);
        let Some(path) = PathBuilder::from_circle(x, y, radius) else { return };
        let (rule, transform) = (FillRule::Winding, Transform::identity());
        self.pixels.fill_path(&path, &paint(color), rule, transform, None);
    }

    fn write(&mut self, text: &str, corner: Point, cap_px: f64, color: Rgb) {
        let pen = Pen::new(color, (STROKE_RATIO * cap_px).max(1.0));
        for line in self.letters(text, corner, cap_px).0 {
            self.line(line, pen);
        }
    }
}

/// Returns an opaque paint of an sRGB color.
fn paint([r, g, b]: Rgb) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    paint
}

/// Returns a string with `&` and `<` escaped for SVG and HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

/// Returns a color as `#rrggbb`.
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
        surface.line([(40.0, 20.0), (60.0, 20.0)].map(Point::from), Pen::new([0, 0, 255], 4.0));
        surface.dot(Point::new(80.0, 20.0), 5.0, [0, 255, 0]);
        surface.write("I<&", Point::new(50.0, 50.0), 14.0, [0, 0, 0]);
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
        canvas.text("II", Point::new(40.0, 50.0), Anchor::Upward, 14.0, [0, 0, 0]);
        let svg = canvas.svg();
        assert!(svg.contains("<g id=\"shapes\"") && svg.contains("I&lt;&amp;</text>"), "{svg}");
        assert!(svg.contains("rotate(-90 40.0 50.0)"), "{svg}");
        assert_eq!(svg.matches("<g").count(), svg.matches("</g>").count());
    }
}
