//! Compares SVG drawings with reference pictures: every file `NAME.svg` of a folder with a
//! `NAME.png`, such as the tests of resvg (github.com/linebender/resvg,
//! `crates/resvg/tests/tests`).
//!
//! `NOCTOGRAPH_DRAWINGS=FOLDER cargo test --profile work -p noctograph-letters suite -- --ignored
//! --nocapture`. A stroke is wrong if it is neither on an edge of the picture nor inside ink like a
//! center line. A file counts as named if it is rejected or a warning names unsupported features.
//! Edges without a stroke near them are listed for inspection. Strokes of fills lie on edges,
//! center lines half the line's width from edges, and a thick or transparent border has two more
//! edges.

use std::path::{Path, PathBuf};

use super::super::{LetterOptions, Strokes};
use super::{Ink, draw};

/// Maximum distance in pixels between a stroke and its edge.
const NEAR_PX: f32 = 2.5;

/// Minimum difference between colors on either side of an edge, in any channel, out of 255.
const EDGE: i32 = 24;

/// Minimum color difference between ink and paper, in any channel, out of 255.
const INK: i32 = 12;

/// Maximum fractions of unmatched strokes and edges that corners of miters and caps explain.
const CORNERS: [f32; 2] = [0.02, 0.04];

/// Maximum number of unmatched pixels that noise explains.
const FEW_PX: f32 = 6.0;

/// A reference picture on paper.
struct Picture {
    size: [usize; 2],
    is_ink: Vec<bool>,
    is_edge: Vec<bool>,
    /// Distance from each pixel to the nearest edge.
    edge_px: Vec<f32>,
}

impl Picture {
    fn read(path: &Path) -> Self {
        let rgba = image::open(path).unwrap().into_rgba8();
        let size = [rgba.width(), rgba.height()].map(|side| side as usize);
        let on = |paper: i32| -> Vec<[i32; 3]> {
            let over = |[r, g, b, a]: [u8; 4]| {
                [r, g, b].map(|ink| paper + (i32::from(ink) - paper) * i32::from(a) / 255)
            };
            rgba.pixels().map(|pixel| over(pixel.0)).collect()
        };
        // If all ink is white, the paper is dark.
        let on_white = on(255);
        let is_blank = on_white.iter().all(|color| *color == [255; 3]);
        let paper = if is_blank { 0 } else { 255 };
        let rgb = if is_blank { on(paper) } else { on_white };
        let [width, height] = size;
        let edges = (0..rgb.len()).map(|index| {
            let (x, y) = (index % width, index / width);
            let right = (x + 1 < width).then_some(index + 1);
            let below = (y + 1 < height).then_some(index + width);
            let mut beside = [right, below].into_iter().flatten();
            beside.any(|other| difference(rgb[index], rgb[other]) >= EDGE)
        });
        let is_edge: Vec<bool> = edges.collect();
        let edge_px = distances(&is_edge, size);
        let is_ink = rgb.iter().map(|color| difference(*color, [paper; 3]) >= INK).collect();
        Self { size, is_ink, is_edge, edge_px }
    }

    fn index(&self, [x, y]: [f64; 2]) -> usize {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
        let [x, y] = [(x, self.size[0]), (y, self.size[1])]
            .map(|(x, side)| x.clamp(0.0, side as f64 - 1.0) as usize);
        y * self.size[0] + x
    }
}

fn difference(a: [i32; 3], b: [i32; 3]) -> i32 {
    (0..3).map(|i| (a[i] - b[i]).abs()).max().unwrap_or(0)
}

/// Returns the distance from each pixel to the nearest marked pixel, in steps of 1 and √2.
fn distances(marked: &[bool], [width, height]: [usize; 2]) -> Vec<f32> {
    let mut far: Vec<f32> = marked.iter().map(|mark| if *mark { 0.0 } else { 1e9 }).collect();
    let n = far.len();
    // Goes forward and then backward, because a pixel has neighbors before and after it.
    for (order, sign) in [((0..n).collect::<Vec<_>>(), -1), ((0..n).rev().collect(), 1)] {
        for index in order {
            for (dx, dy) in [(sign, 0), (sign, sign), (0, sign), (-sign, sign)] {
                let x = (index % width).checked_add_signed(dx).filter(|x| *x < width);
                let y = (index / width).checked_add_signed(dy).filter(|y| *y < height);
                let step = if dx != 0 && dy != 0 { std::f32::consts::SQRT_2 } else { 1.0 };
                if let (Some(x), Some(y)) = (x, y) {
                    far[index] = far[index].min(far[y * width + x] + step);
                }
            }
        }
    }
    far
}

/// Returns the lit lines of a drawing in the pixels of a picture, with one point per pixel.
fn points(strokes: &Strokes, px_per_unit: f64) -> Vec<[f64; 2]> {
    let mut points = Vec::new();
    for leg in strokes.source.strokes.iter().flat_map(|stroke| stroke.points.windows(2)) {
        let [a, b] = [leg[0], leg[1]].map(|place| place.map(|x| px_per_unit * x));
        let n = libm::hypot(b[0] - a[0], b[1] - a[1]).ceil().max(1.0);
        let share = |k: f64| [0, 1].map(|i| a[i] + (b[i] - a[i]) * (k + 0.5) / n);
        points.extend((0..).map(f64::from).take_while(|k| *k < n).map(share));
    }
    points
}

/// Returns two pairs of a number and its total: stroke points that are on neither edge nor ink, and
/// edge pixels without a stroke.
fn in_question(picture: &Picture, points: &[[f64; 2]]) -> [[f32; 2]; 2] {
    let mut bare = picture.is_edge.clone();
    let mut stray = 0.0;
    for place in points {
        let index = picture.index(*place);
        let edge_px = picture.edge_px[index];
        if edge_px > NEAR_PX && !picture.is_ink[index] {
            stray += 1.0;
            continue;
        }
        // The distance between a center line and its edges is half the width of the line.
        let reach = if edge_px > NEAR_PX { 1.5 * edge_px + NEAR_PX } else { NEAR_PX };
        cover(&mut bare, picture.size, *place, f64::from(reach));
    }
    let count = |marks: &[bool]| marks.iter().filter(|mark| **mark).count() as f32;
    [[stray, points.len() as f32], [count(&bare), count(&picture.is_edge)]]
}

/// Clears the marks around a position.
fn cover(marks: &mut [bool], [width, height]: [usize; 2], [x, y]: [f64; 2], reach: f64) {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped")]
    let range = |x: f64, side: usize| {
        let [from, to] = [x - reach, x + reach].map(|end| end.clamp(0.0, side as f64) as usize);
        from..(to + 1).min(side)
    };
    for row in range(y, height) {
        for column in range(x, width) {
            if libm::hypot(column as f64 + 0.5 - x, row as f64 + 0.5 - y) <= reach {
                marks[row * width + column] = false;
            }
        }
    }
}

/// Lists the SVG files below a folder that have a picture.
fn files(folder: &Path, paths: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, paths);
        } else if path.extension().is_some_and(|end| end == "svg")
            && path.with_extension("png").exists()
        {
            paths.push(path);
        }
    }
}

#[test]
#[ignore = "needs a folder of drawings with pictures, NOCTOGRAPH_DRAWINGS"]
fn suite_of_drawings_is_right_or_named() {
    let folder = std::env::var("NOCTOGRAPH_DRAWINGS").expect("a folder with drawings");
    let mut paths = Vec::new();
    files(Path::new(&folder), &mut paths);
    paths.sort();
    let [mut n_right, mut n_warned, mut n_refused] = [0; 3];
    let mut wrong = Vec::new();
    for path in &paths {
        let file = path.display();
        let strokes = match draw(path, &LetterOptions::default(), Ink::Alike) {
            Ok(strokes) => strokes,
            Err(error) => {
                println!("refused  {error}");
                n_refused += 1;
                continue;
            }
        };
        if !strokes.warnings.is_empty() {
            n_warned += 1;
            continue;
        }
        let text = std::fs::read(path).unwrap();
        let tree = usvg::Tree::from_data(&text, &usvg::Options::default()).unwrap();
        let picture = Picture::read(&path.with_extension("png"));
        let px_per_unit = picture.size[0] as f64 / f64::from(tree.size().width());
        let pairs = in_question(&picture, &points(&strokes, px_per_unit));
        let is_much = |[odd, all]: [f32; 2], share: f32| odd > FEW_PX.max(share * all);
        let [[stray, ink], [bare, edges]] = pairs;
        let figures = format!("{file}: {stray} of {ink} px stray, {bare} of {edges} px bare");
        if is_much(pairs[0], CORNERS[0]) {
            wrong.push(figures);
            continue;
        }
        n_right += 1;
        if is_much(pairs[1], CORNERS[1]) {
            println!("look at  {figures}");
        }
    }
    let n = paths.len();
    println!("{n} drawings: {n_right} right, {n_warned} warned of, {n_refused} refused");
    assert!(wrong.is_empty(), "{} wrong:\n{}", wrong.len(), wrong.join("\n"));
}
