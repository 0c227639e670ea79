//! A canvas: lines, cells and words over white or over a photo, as SVG text or as pixels.
//!
//! Pixels have y down, from the upper left corner. Text is left to the viewer's sans-serif typeface
//! in SVG, and written in single strokes as pixels.

use std::fmt::Write as _;

use base64::prelude::{BASE64_STANDARD, Engine};
use tiny_skia::{
    FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, PixmapMut, Stroke, StrokeDash, Transform,
};

use noctograph_letters::{Cell, Font, Trace};
use noctograph_picture::photo::{self, Photo};

/// Red, green, blue.
pub(super) type Rgb = [u8; 3];

/// Height of capitals by the size of a typeface.
const CAP_SHARE: f64 = 0.7;

/// Width of written strokes, and the space between characters, by the height of capitals.
const STROKE_SHARE: f64 = 0.12;
const SPACE_SHARE: f64 = 0.25;

/// What a line is drawn with.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pen {
    pub(super) color: Rgb,
    pub(super) width_px: f64,
    pub(super) dashed: bool,
}

/// The end of a text that stands at its place.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

enum Mark {
    /// What follows, up to the next one, belongs to this layer.
    Layer(&'static str),
    Line(Vec<[f64; 2]>, Pen),
    /// A filled rectangle without smoothed edges, so that neighbors meet: left, top, right, bottom.
    Cell([f64; 4], Rgb),
    /// A disk of a radius.
    Dot([f64; 2], f64, Rgb),
    Text {
        text: String,
        at: [f64; 2],
        anchor: Anchor,
        cap_px: f64,
        color: Rgb,
        /// Read from below to above.
        upward: bool,
    },
}

/// A picture to draw on.
pub(super) struct Canvas<'a> {
    size_px: [u32; 2],
    photo: Option<&'a Photo>,
    marks: Vec<Mark>,
}

impl Pen {
    /// A whole line.
    pub(super) const fn new(color: Rgb, width_px: f64) -> Self {
        Self { color, width_px, dashed: false }
    }
}

impl<'a> Canvas<'a> {
    /// A white canvas; its sides are rounded up to whole pixels.
    pub(super) fn white(size_px: [f64; 2]) -> Self {
        #[expect(clippy::cast_possible_truncation, reason = "thousands")]
        let size_px = size_px.map(|side| side.ceil() as u32);
        Self { size_px, photo: None, marks: Vec::new() }
    }

    /// A canvas over a photo.
    pub(super) fn over(photo: &'a Photo) -> Self {
        let size_px = [photo.width_px, photo.height_px];
        Self { size_px, photo: Some(photo), marks: Vec::new() }
    }

    /// Begins a layer, by its name.
    pub(super) fn layer(&mut self, name: &'static str) {
        self.marks.push(Mark::Layer(name));
    }

    pub(super) fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, pen: Pen) {
        self.marks.push(Mark::Line(points.into_iter().collect(), pen));
    }

    /// The rim of a rectangle: left, top, right, bottom.
    pub(super) fn frame(&mut self, [left, top, right, bottom]: [f64; 4], pen: Pen) {
        self.line([[left, top], [right, top], [right, bottom], [left, bottom], [left, top]], pen);
    }

    /// The rim of a disk.
    pub(super) fn ring(&mut self, [x, y]: [f64; 2], radius_px: f64, pen: Pen) {
        let corner = |i: u32| {
            let (sin, cos) = libm::sincos(f64::from(i) * std::f64::consts::TAU / 24.0);
            [x + radius_px * cos, y + radius_px * sin]
        };
        self.line((0..=24).map(corner), pen);
    }

    /// A rectangle whose neighbors meet it without a seam: left, top, right, bottom.
    pub(super) fn cell(&mut self, sides: [f64; 4], color: Rgb) {
        self.marks.push(Mark::Cell(sides, color));
    }

    pub(super) fn dot(&mut self, at: [f64; 2], radius_px: f64, color: Rgb) {
        self.marks.push(Mark::Dot(at, radius_px, color));
    }

    /// Writes a text whose capitals have a height; `at` is its lower left corner, or the middle or
    /// right end of its lower edge.
    pub(super) fn text(
        &mut self,
        text: impl Into<String>,
        at: [f64; 2],
        anchor: Anchor,
        cap_px: f64,
        color: Rgb,
    ) {
        let (text, upward) = (text.into(), false);
        self.marks.push(Mark::Text { text, at, anchor, cap_px, color, upward });
    }

    /// Writes a text from below to above, with its middle at the height of `at` and its lower edge
    /// left of it.
    pub(super) fn text_upward(
        &mut self,
        text: impl Into<String>,
        at: [f64; 2],
        cap_px: f64,
        color: Rgb,
    ) {
        let (text, anchor, upward) = (text.into(), Anchor::Middle, true);
        self.marks.push(Mark::Text { text, at, anchor, cap_px, color, upward });
    }

    /// An SVG file's text, with the photo inside.
    pub(super) fn svg(&self) -> String {
        let [width, height] = self.size_px;
        let ground = self.photo.map_or_else(
            || "<rect width=\"100%\" height=\"100%\" fill=\"#ffffff\"/>\n".to_owned(),
            |photo| {
                let mut png = Vec::new();
                photo::write_png(photo, &mut png, None, &[])
                    .expect("a photo fits into a PNG in memory");
                let data = BASE64_STANDARD.encode(&png);
                format!(
                    "<image width=\"{width}\" height=\"{height}\" \
                     href=\"data:image/png;base64,{data}\"/>\n"
                )
            },
        );
        self.svg_over(&ground)
    }

    /// An SVG file's text of what is drawn, over nothing.
    pub(super) fn svg_of_marks(&self) -> String {
        self.svg_over("")
    }

    fn svg_over(&self, ground: &str) -> String {
        let [width, height] = self.size_px;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"sans-serif\">\n{ground}"
        );
        svg += "<g fill=\"none\" stroke-linecap=\"round\" stroke-linejoin=\"round\">\n";
        for mark in &self.marks {
            let written = match mark {
                Mark::Layer(name) => writeln!(
                    svg,
                    "</g>\n<g id=\"{name}\" fill=\"none\" stroke-linecap=\"round\" \
                     stroke-linejoin=\"round\">"
                ),
                Mark::Line(points, Pen { color, width_px, dashed }) => {
                    let dash = if *dashed {
                        " stroke-dasharray=\"3 3\" stroke-linecap=\"butt\""
                    } else {
                        ""
                    };
                    writeln!(
                        svg,
                        "<polyline points=\"{}\" stroke=\"{}\" stroke-width=\"{width_px:.1}\"{dash}/>",
                        list(points),
                        hex(*color)
                    )
                }
                Mark::Cell([left, top, right, bottom], color) => writeln!(
                    svg,
                    "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" \
                     fill=\"{}\" shape-rendering=\"crispEdges\"/>",
                    right - left,
                    bottom - top,
                    hex(*color)
                ),
                Mark::Dot([x, y], radius_px, color) => writeln!(
                    svg,
                    "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius_px:.1}\" fill=\"{}\"/>",
                    hex(*color)
                ),
                Mark::Text { text, at: [x, y], anchor, cap_px, color, upward } => {
                    let turned = match upward {
                        true => format!(" transform=\"rotate(-90 {x:.1} {y:.1})\""),
                        false => String::new(),
                    };
                    let anchor = match anchor {
                        Anchor::Start => "start",
                        Anchor::Middle => "middle",
                        Anchor::End => "end",
                    };
                    writeln!(
                        svg,
                        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" \
                         font-size=\"{:.1}\" fill=\"{}\"{turned}>{}</text>",
                        cap_px / CAP_SHARE,
                        hex(*color),
                        escaped(text)
                    )
                }
            };
            written.expect("a string takes all");
        }
        svg + "</g>\n</svg>\n"
    }

    /// The pixels, as a photo.
    pub(super) fn pixels(&self) -> Photo {
        let [width_px, height_px] = self.size_px;
        let n_pixels = width_px as usize * height_px as usize;
        let mut rgba: Vec<u8> = match self.photo {
            None => vec![255; 4 * n_pixels],
            Some(photo) => {
                photo.rgb8.as_chunks::<3>().0.iter().flat_map(|&[r, g, b]| [r, g, b, 255]).collect()
            }
        };
        let mut page =
            PixmapMut::from_bytes(&mut rgba, width_px, height_px).expect("a canvas has pixels");
        let letters = writing();
        for mark in &self.marks {
            draw(&mut page, mark, &letters);
        }
        let rgb8 = rgba.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
        Photo { width_px, height_px, rgb8, scene_toml: None }
    }
}

fn draw(page: &mut PixmapMut<'_>, mark: &Mark, letters: &Font) {
    let mut fill = |path: Option<Path>, color: Rgb, smooth: bool| {
        if let Some(path) = path {
            let paint = Paint { anti_alias: smooth, ..paint(color) };
            page.fill_path(&path, &paint, FillRule::Winding, Transform::identity(), None);
        }
    };
    match mark {
        Mark::Layer(_) => {}
        Mark::Cell([left, top, right, bottom], color) => {
            let corners = [[*left, *top], [*right, *top], [*right, *bottom], [*left, *bottom]];
            fill(path(&corners, true), *color, false);
        }
        Mark::Dot(at, radius_px, color) => {
            let [x, y] = at.map(narrow);
            fill(PathBuilder::from_circle(x, y, narrow(*radius_px)), *color, true);
        }
        Mark::Line(points, pen) => stroke(page, points, *pen),
        Mark::Text { text, at: [x, y], anchor, cap_px, color, upward } => {
            let (_, right) = strokes_of(letters, text, [0.0, 0.0], *cap_px);
            let left = match anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => -0.5 * right,
                Anchor::End => -right,
            };
            let pen = Pen::new(*color, (STROKE_SHARE * cap_px).max(1.0));
            let (lines, _) = strokes_of(letters, text, [left, 0.0], *cap_px);
            let place = |[right, down]: [f64; 2]| match upward {
                true => [x + down, y - right],
                false => [x + right, y + down],
            };
            for line in lines {
                let line: Vec<[f64; 2]> = line.into_iter().map(place).collect();
                stroke(page, &line, pen);
            }
        }
    }
}

fn stroke(page: &mut PixmapMut<'_>, points: &[[f64; 2]], pen: Pen) {
    let Some(path) = path(points, false) else { return };
    let dash = pen.dashed.then(|| StrokeDash::new(vec![3.0, 3.0], 0.0)).flatten();
    let line_cap = if pen.dashed { LineCap::Butt } else { LineCap::Round };
    let (width, line_join) = (narrow(pen.width_px), LineJoin::Round);
    let stroke = Stroke { width, dash, line_cap, line_join, ..Stroke::default() };
    page.stroke_path(&path, &paint(pen.color), &stroke, Transform::identity(), None);
}

fn paint([r, g, b]: Rgb) -> Paint<'static> {
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, 255);
    paint
}

fn path(points: &[[f64; 2]], closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    for (index, point) in points.iter().enumerate() {
        let [x, y] = point.map(narrow);
        if index == 0 { builder.move_to(x, y) } else { builder.line_to(x, y) }
    }
    if closed {
        builder.close();
    }
    builder.finish()
}

/// The font that pixels are written with.
fn writing() -> Font {
    Font::open("simplex", Trace::CenterLine).expect("a font of ours")
}

/// Right end of a text that begins at `left`, as pixels have it.
pub(super) fn right_end(text: &str, left: f64, cap_px: f64) -> f64 {
    strokes_of(&writing(), text, [left, 0.0], cap_px).1
}

/// The lines of a text from its lower left corner on, and where it ends. Characters that the font
/// lacks are left out.
fn strokes_of(
    font: &Font,
    text: &str,
    [left, baseline]: [f64; 2],
    cap_px: f64,
) -> (Vec<Vec<[f64; 2]>>, f64) {
    let (mut lines, mut at) = (Vec::new(), left);
    for character in text.chars() {
        let Some(aspect) = font.aspect(character) else { continue };
        // Meters are pixels here, with the baseline at y = 0.
        let (width_m, cap_height_m) = (aspect * cap_px, cap_px);
        let cell = Cell { left_m: at, baseline_m: 0.0, width_m, cap_height_m };
        let moves = font.glyph(character, cell).map_or(Vec::new(), |glyph| glyph.moves);
        for run in moves.chunk_by(|a, b| a.lit == b.lit).filter(|run| run[0].lit) {
            let ends = std::iter::once(run[0].from_m).chain(run.iter().map(|step| step.to_m));
            lines.push(ends.map(|[x, y]| [x, baseline - y]).collect());
        }
        at += width_m + SPACE_SHARE * cap_px;
    }
    (lines, at - SPACE_SHARE * cap_px)
}

/// Text as it stands in SVG and HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

fn list(points: &[[f64; 2]]) -> String {
    let words: Vec<String> = points.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
    words.join(" ")
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

    #[test]
    fn both_backends_draw_the_same_picture() {
        let mut labeled = Canvas::white([100.0, 60.0]);
        labeled.layer("shapes");
        labeled.cell([10.0, 10.0, 30.0, 30.0], [255, 0, 0]);
        labeled.line([[40.0, 20.0], [60.0, 20.0]], Pen::new([0, 0, 255], 4.0));
        labeled.dot([80.0, 20.0], 5.0, [0, 255, 0]);
        labeled.text("I<&", [50.0, 50.0], Anchor::Middle, 14.0, [0, 0, 0]);
        let picture = labeled.pixels();
        let at = |x: usize, y: usize| &picture.rgb8[3 * (100 * y + x)..][..3];
        assert_eq!([at(10, 10), at(29, 29)], [[255, 0, 0]; 2], "a cell has whole pixels");
        assert_eq!([at(9, 10), at(30, 29)], [[255; 3]; 2], "and no edge beyond");
        assert_eq!([at(50, 20), at(80, 20)], [[0, 0, 255], [0, 255, 0]]);
        let black = (0..100).filter(|x| (36..51).any(|y| at(*x, y)[0] < 128));
        let [first, last] = [black.clone().min(), black.max()].map(Option::unwrap);
        assert!((45..=55).contains(&((first + last) / 2)), "in the middle: {first} to {last}");
        let mut canvas = Canvas::white([60.0, 100.0]);
        canvas.text_upward("II", [40.0, 50.0], 14.0, [0, 0, 0]);
        let picture = canvas.pixels();
        let at = |x: usize, y: usize| picture.rgb8[3 * (60 * y + x)];
        let dark: Vec<usize> = (0..100).filter(|y| (26..41).any(|x| at(x, *y) < 128)).collect();
        let around = [dark[0], dark[dark.len() - 1]];
        assert_eq!(around[0] + around[1], 99, "about the middle: {around:?}");
        assert!(around[1] - around[0] < 20, "two strokes beside each other: {around:?}");
        let svg = canvas.svg();
        assert!(svg.contains("rotate(-90 40.0 50.0)"), "{svg}");
        let svg = labeled.svg();
        assert!(svg.contains("<g id=\"shapes\"") && svg.contains("I&lt;&amp;</text>"), "{svg}");
        assert_eq!(svg.matches("<g").count(), svg.matches("</g>").count());
    }
}
