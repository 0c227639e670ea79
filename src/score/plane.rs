//! Grids of square pixels in the plane of the word, and their light in the photo.

use kurbo::{Point, Vec2};
use tiny_skia::Transform;

use super::light::{Frame, Light, Rgb};
use super::raster::{narrow, whole};
use super::view::View;
use super::{PX_PER_H, cap_height_m};
use noctograph_core::geometry::bounds;
use noctograph_core::strokes::{Cell, Strokes};

/// Maximum shift that is searched, in cap heights: slightly more than the limit for legible words.
pub(super) const SEARCH_H: f64 = 0.75;

/// Maximum scale that is searched. The minimum scale is the inverse of this.
pub(super) const SEARCH_SCALE: f64 = 1.25;

/// Maximum shift of a letter that is searched, in pixels: a quarter of a cap height.
pub(super) const REACH_PX: usize = 8;

/// Horizontal and vertical margins around the cell, in pixels.
const MARGIN_PX: [f64; 2] = [5.0, 12.0];

/// Width of the pen including its blur, in pixels.
const PEN_PX: f64 = 3.0;

/// A grid of square pixels in the plane of the word.
#[derive(Clone, Debug)]
pub(super) struct Grid {
    /// Position of the upper left corner: x and height above the floor.
    pub(super) left_m: f64,
    pub(super) top_m: f64,
    /// Side of a pixel.
    pub(super) pitch_m: f64,
    pub(super) width: usize,
    pub(super) height: usize,
}

/// Placement of a word. A point of the intended word appears at `center + shift + scale ·
/// R(rotation) (point − center)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    pub(super) center_m: Point,
    pub(super) shift_m: Vec2,
    pub(super) scale: f64,
    /// Rotation, counterclockwise.
    pub(super) rotation_rad: f64,
}

impl Placed {
    /// Returns the placement at which the word is intended: without shift, scale or rotation.
    pub(super) fn home(strokes: &Strokes) -> Self {
        let [left, bottom, right, top] = strokes.bounds_m();
        let center_m = Point::new(0.5 * (left + right), 0.5 * (bottom + top));
        Self { center_m, shift_m: Vec2::ZERO, scale: 1.0, rotation_rad: 0.0 }
    }

    /// Returns the first column `[x, y]` of `scale · R(rotation)`. The second column is `[−y, x]`.
    fn column(&self) -> [f64; 2] {
        let (sin, cos) = libm::sincos(self.rotation_rad);
        [self.scale * cos, self.scale * sin]
    }

    /// Moves a point of the intended word, in m, to where it appears.
    pub(super) fn apply(&self, point_m: Point) -> Point {
        self.apply_column(self.column(), point_m)
    }

    /// Works as [`Self::apply`], given [`Self::column`].
    #[inline(always)]
    fn apply_column(&self, [a, b]: [f64; 2], point_m: Point) -> Point {
        let Vec2 { x, y } = point_m - self.center_m;
        self.center_m + self.shift_m + Vec2::new(a * x - b * y, b * x + a * y)
    }

    /// Returns the photo pixel of a point of the intended word, or `None` if it is not visible.
    pub(super) fn image_point(&self, view: &View, point_m: Point) -> Option<[f64; 2]> {
        view.image_from_plane(xy(self.apply(point_m)))
    }
}

/// Returns the coordinates of a point as an array.
pub(super) fn xy(point: Point) -> [f64; 2] {
    [point.x, point.y]
}

impl Grid {
    /// Returns a grid with room for all placements of the word that are searched.
    pub(super) fn around(strokes: &Strokes, home: &Placed) -> Self {
        let [left, bottom, right, top] = strokes.bounds_m();
        let pitch_m = cap_height_m(strokes) / f64::from(PX_PER_H);
        // The margin is the maximum shift plus half a cap height for window and blur.
        let margin_m = (SEARCH_H + 0.5) * cap_height_m(strokes);
        // The sides are multiples of 4, because the alignment halves them twice.
        let [width, height] = [right - left, top - bottom].map(|length_m| {
            whole(((length_m * SEARCH_SCALE + 2.0 * margin_m) / pitch_m).ceil()).next_multiple_of(4)
        });
        let left_m = home.center_m.x - 0.5 * width as f64 * pitch_m;
        let top_m = home.center_m.y + 0.5 * height as f64 * pitch_m;
        Self { left_m, top_m, pitch_m, width, height }
    }

    /// Returns the grid with `columns` more columns on each side.
    pub(super) fn widened(&self, columns: usize) -> Self {
        let left_m = self.left_m - columns as f64 * self.pitch_m;
        Self { left_m, width: self.width + 2 * columns, ..self.clone() }
    }

    /// Converts a point from the page (pixels, y down) to the plane of the word (meters, y up).
    pub(super) fn plane_from_page(&self, point: Point) -> Point {
        Point::new(self.left_m + point.x * self.pitch_m, self.top_m - point.y * self.pitch_m)
    }

    /// Converts a point from the plane of the word to the page.
    pub(super) fn page_from_plane(&self, point_m: Point) -> Point {
        let Point { x, y } = point_m;
        Point::new((x - self.left_m) / self.pitch_m, (self.top_m - y) / self.pitch_m)
    }

    /// Returns the transform that applies [`Placed::apply`] and then [`Self::page_from_plane`].
    pub(super) fn transform(&self, placed: &Placed) -> Transform {
        let [a, b] = placed.column().map(|part| part / self.pitch_m);
        let Point { x, y } = self.page_from_plane(placed.apply(Point::ZERO));
        let [a, b, x, y] = [a, b, x, y].map(narrow);
        Transform::from_row(a, -b, -b, -a, x, y)
    }

    /// Averages `measure` over the light in each pixel of the grid, which is placed like the word.
    /// Pixels behind the camera are dark.
    pub(super) fn resample(
        &self,
        light: &Light,
        view: &View,
        placed: &Placed,
        measure: impl Fn(Rgb) -> Rgb,
    ) -> Vec<Rgb> {
        // The lower corners of one row of pixels are reused as the upper corners of the next row.
        let column = placed.column();
        let corner = |x: usize, y: usize| {
            let point_m = self.plane_from_page(Point::new(x as f64, y as f64));
            view.image_from_plane(xy(placed.apply_column(column, point_m)))
        };
        let mut rows =
            (0..=self.height).map(|y| (0..=self.width).map(|x| corner(x, y)).collect::<Vec<_>>());
        let mut values = vec![[0.0; 3]; self.width * self.height];
        let mut upper = rows.next().expect("a grid has rows");
        for (values, lower) in values.chunks_exact_mut(self.width).zip(rows) {
            for (x, value) in values.iter_mut().enumerate() {
                let corners = (upper[x], upper[x + 1], lower[x], lower[x + 1]);
                // Pixels behind the camera stay dark.
                if let (Some(a), Some(b), Some(c), Some(d)) = corners {
                    *value = light.mean_of(bounds([a, b, c, d]), &measure);
                }
            }
            upper = lower;
        }
        values
    }

    /// Returns the rectangle of the photo that shows the grid, or `None` if the camera cannot show
    /// a corner.
    pub(super) fn frame(&self, view: &View, placed: &Placed) -> Option<Frame> {
        let (right, bottom) = (self.width, self.height);
        let [a, b, c, d] = [[0, 0], [right, 0], [0, bottom], [right, bottom]]
            .map(|corner| self.image_point(view, placed, corner));
        Some(bounds([a?, b?, c?, d?]))
    }

    /// Returns the side of the page's middle pixel in photo pixels, or `None` if it is not visible.
    pub(super) fn pixel_px(&self, view: &View, placed: &Placed) -> Option<f64> {
        let middle = [self.width / 2, self.height / 2];
        let [x, y] = self.image_point(view, placed, middle)?;
        let [right, below] = self.image_point(view, placed, [middle[0] + 1, middle[1] + 1])?;
        // The side is the geometric mean of width and height, because rotation is small.
        Some(((right - x).abs() * (below - y).abs()).sqrt())
    }

    /// Returns the photo pixel of the upper left corner of the grid pixel `x, y`.
    fn image_point(&self, view: &View, placed: &Placed, [x, y]: [usize; 2]) -> Option<[f64; 2]> {
        placed.image_point(view, self.plane_from_page(Point::new(x as f64, y as f64)))
    }
}

/// The page of a letter: a grid around its cell.
#[derive(Clone, Debug)]
pub(super) struct LetterPage {
    pub(super) grid: Grid,
    /// Width and height of the cell, which is centered on the page, in pixels.
    cell_px: [f64; 2],
}

impl LetterPage {
    /// Creates a page centered on a cell, with margins and room for shifts.
    pub(super) fn new(cell: &Cell) -> Self {
        let pitch_m = cell.cap_height_m / f64::from(PX_PER_H);
        let cell_px = [cell.width_m / pitch_m, f64::from(PX_PER_H)];
        let [width, height] = [0, 1]
            .map(|axis| 2 * (whole((0.5 * cell_px[axis] + MARGIN_PX[axis]).ceil()) + REACH_PX));
        let grid = Grid {
            left_m: cell.left_m + 0.5 * cell.width_m - 0.5 * width as f64 * pitch_m,
            top_m: cell.baseline_m + 0.5 * cell.cap_height_m + 0.5 * height as f64 * pitch_m,
            pitch_m,
            width,
            height,
        };
        Self { grid, cell_px }
    }

    /// Returns the left, top, right and bottom of the cell, in pixels of the page.
    pub(super) fn cell(&self) -> [f64; 4] {
        let [x, y] = [self.grid.width, self.grid.height].map(|side| 0.5 * side as f64);
        let [half_width, half_height] = self.cell_px.map(|side| 0.5 * side);
        [x - half_width, y - half_height, x + half_width, y + half_height]
    }

    /// Returns the columns of the page that show the cell, without brighter letters beside it.
    pub(super) fn columns_of_cell(&self) -> Grid {
        let [left, _, right, _] = self.cell();
        let [from, to] = [(left - PEN_PX).floor(), (right + PEN_PX).ceil()];
        let left_m = self.grid.left_m + from * self.grid.pitch_m;
        Grid { left_m, width: whole(to - from), ..self.grid.clone() }
    }

    /// True if a point is inside the cell or its margin.
    pub(super) fn holds(&self, point: Point) -> bool {
        let [left, top, right, bottom] = self.cell();
        (left - MARGIN_PX[0]..=right + MARGIN_PX[0]).contains(&point.x)
            && (top - MARGIN_PX[1]..=bottom + MARGIN_PX[1]).contains(&point.y)
    }

    /// True if part of a cell is on the page.
    pub(super) fn overlaps_page(&self, cell: &Cell) -> bool {
        let Cell { left_m, baseline_m, width_m, cap_height_m } = *cell;
        let lower_left = self.grid.page_from_plane(Point::new(left_m, baseline_m));
        let corner_m = Point::new(left_m + width_m, baseline_m + cap_height_m);
        let upper_right = self.grid.page_from_plane(corner_m);
        upper_right.x > 0.0
            && lower_left.x < self.grid.width as f64
            && lower_left.y > 0.0
            && upper_right.y < self.grid.height as f64
    }
}
