//! Faults of a letter: missing strokes, kinds of extra light, shift, and glow. A fault can be
//! removed from the picture of the letter, so that the letter can be read as if it were faultless.

use kurbo::{Point, Vec2};

use super::bend::{ExtraLine, Gap, distance};
use super::causes::{Cause, CauseKind, Known, LogGap, MissingRun};
use super::plane::{LetterPage, Placed, xy};
use super::raster::Raster;
use super::reader::Reader;
use super::sketch::Sketch;
use super::trace::{self, LightLines};
use super::{PEN_H, PX_PER_H};

/// One cap height, in pixels.
const H_PX: f64 = PX_PER_H as f64;

/// Minimum shift of a letter that counts as a fault. Clean letters shift by less than half as much.
const SHIFTED_PX: f64 = 0.06 * H_PX;

/// Minimum fraction of a line of extra light near a dark move at which that move counts as lit.
const ALONG_MOVE: f64 = 0.6;

/// Maximum distance between a dark move and light that belongs to the move.
const NEAR_MOVE_PX: f64 = 0.15 * H_PX;

/// Distance below or above the letters beyond which extra light is a streak to the floor.
const OUTSIDE_PX: f64 = 0.12 * H_PX;

/// Maximum length of a spot, and its minimum thickness: four widths of the pen.
const MAX_SPOT_LENGTH_PX: f64 = 0.35 * H_PX;
const MIN_SPOT_THICKNESS_PX: f64 = 4.0 * PEN_H * H_PX;

/// Width above which a line counts as glowing: more than twice the width of the pen.
const GLOWING_PX: f64 = 0.16 * H_PX;

/// Mean distance between a letter's light and its strokes above which it counts as a fault.
const OFF_PATH_PX: f64 = 0.05 * H_PX;

/// Minimum fraction of a missing part that must lie in a gap of the log for the gap to be its
/// cause. The fraction is less than 1, because faults of the lamps may lengthen the missing part.
const LOST_IN_LOG: f64 = 0.5;

/// Maximum distance from a line of extra light, or from a stroke, to the light that belongs to it.
const BELONGS_PX: f64 = 0.12 * H_PX;

/// Distance from a stroke within which light is not erased. The stroke itself may emit this light.
const OWN_PX: f64 = 0.06 * H_PX;

/// A fault, and the mending that removes it from a picture, if there is one.
pub(super) type Fault = (Cause, Option<Mending>);

/// A change of a picture that removes a fault.
pub(super) enum Mending {
    /// Erases the light at these points.
    Erase(Vec<Point>),
    /// Adds light at these points.
    Draw(Vec<Point>),
    /// Moves the letter back by this many pixels right and down.
    Move([isize; 2]),
    /// Erases the light of the strokes, and draws light at these points instead.
    Straighten(Vec<Point>),
    /// Draws the lines thin and without glow.
    Redraw,
}

/// Removes a fault from the picture of a letter, as if its cause had been removed.
pub(super) fn mend(picture: &mut Raster, mending: &Mending, sketch: &Sketch) {
    match mending {
        Mending::Straighten(points) => {
            paint(picture, 0.0, |pixel| distance(pixel, &sketch.own) < BELONGS_PX);
            draw(picture, points);
        }
        Mending::Erase(points) => paint(picture, 0.0, |pixel| {
            points.iter().any(|point| trace::distance(*point, pixel) < BELONGS_PX)
                && distance(pixel, &sketch.own) > OWN_PX
        }),
        Mending::Draw(points) => draw(picture, points),
        Mending::Move([right, down]) => {
            // Each pixel is replaced by the pixel that is `right` and `down` of it.
            let (width, height) = (picture.width, picture.height);
            let mut moved = Raster::dark(width, height);
            for (index, value) in moved.values.iter_mut().enumerate() {
                let x = (index % width).checked_add_signed(*right).filter(|x| *x < width);
                let y = (index / width).checked_add_signed(*down).filter(|y| *y < height);
                if let (Some(x), Some(y)) = (x, y) {
                    *value = picture.values[y * width + x];
                }
            }
            *picture = moved;
        }
        Mending::Redraw => *picture = LightLines::new(picture).redrawn(picture),
    }
}

/// Lights all pixels within half a pen width of the points.
fn draw(picture: &mut Raster, points: &[Point]) {
    // The added 0.2 px close the gaps between points, which are up to a pixel apart.
    let reach_px = 0.5 * PEN_H * H_PX + 0.2;
    paint(picture, 1.0, |pixel| {
        points.iter().any(|point| trace::distance(*point, pixel) <= reach_px)
    });
}

/// Sets every pixel whose center satisfies `is_painted` to `light`, 0 to 1.
fn paint(picture: &mut Raster, light: f32, is_painted: impl Fn(Point) -> bool) {
    let width = picture.width;
    for (index, value) in picture.values.iter_mut().enumerate() {
        if is_painted(Point::new((index % width) as f64 + 0.5, (index / width) as f64 + 0.5)) {
            *value = light;
        }
    }
}

impl Reader {
    /// Returns the faults of the letter `index`, with changes that would mend them. `gaps` are the
    /// dark parts of its strokes, and `extra` are the lines of light beside them. `placed` is the
    /// place of the word in the photo, and `known` is what the flight reveals.
    pub(super) fn faults(
        &self,
        index: usize,
        sketch: &Sketch,
        (gaps, extra): (Vec<Gap>, Vec<ExtraLine>),
        (placed, known): (&Placed, &Known),
    ) -> Vec<Fault> {
        let page = &self.pages[index];
        let mut faults: Vec<Fault> = Vec::new();
        // Adds parts of strokes that are dark because of a gap in the log or because of the lamp.
        for gap in gaps {
            let log_gap_s = lost_in(&gap.points, page, placed, known).map(|log| log.span_s);
            let [from_mm, to_mm] = gap.along_px.map(|px| px * 1000.0 * page.grid.pitch_m);
            let cause = Cause {
                kind: if log_gap_s.is_some() { CauseKind::LogGap } else { CauseKind::MissingRun },
                letter: Some(index),
                log_gap_s,
                length_mm: Some(to_mm - from_mm),
                at_m: middle_m(page, &gap.points),
                missing: Some(MissingRun { stroke: gap.stroke, from_mm, to_mm }),
                ..Cause::default()
            };
            faults.push((cause, Some(Mending::Draw(gap.points))));
        }
        // Adds light away from the strokes.
        faults.extend(extra.into_iter().map(|line| self.extra_light(index, line, sketch, known)));
        // Adds a shift of the whole letter from its intended position.
        let [right, down] = sketch.shift.map(|px| px as f64);
        let shift_px = libm::hypot(right, down);
        if shift_px >= SHIFTED_PX {
            let mending = Mending::Move(sketch.shift);
            faults.push(self.measured(index, CauseKind::Shifted, shift_px, mending));
        }
        // Adds strokes away from the intended path, after removing the letter's shift.
        let offset_px = sketch.bent.mean_offset_px;
        if offset_px > OFF_PATH_PX {
            let runs = sketch.bent.runs.iter();
            let pairs = runs.flat_map(|run| run.intended.iter().zip(&run.on_light));
            let lit = pairs.filter(|(_, on_light)| sketch.trace.is_drawn(**on_light));
            let straight = Mending::Straighten(lit.map(|(intended, _)| *intended).collect());
            faults.push(self.measured(index, CauseKind::OffPath, offset_px, straight));
        }
        let width_px = sketch.trace.thickness();
        if width_px > GLOWING_PX {
            faults.push(self.measured(index, CauseKind::Glow, width_px, Mending::Redraw));
        }
        faults
    }

    /// Returns a fault of a given length, in pixels of the letter's page.
    fn measured(&self, index: usize, kind: CauseKind, length_px: f64, mending: Mending) -> Fault {
        let length_mm = Some(1000.0 * length_px * self.pages[index].grid.pitch_m);
        (Cause { length_mm, ..Cause::new(kind, Some(index)) }, Some(mending))
    }

    /// Returns the fault of a line of extra light near the letter `index`. If the drone's speed is
    /// known, the length of a lit transit gives the lamp's delay.
    fn extra_light(&self, index: usize, line: ExtraLine, sketch: &Sketch, known: &Known) -> Fault {
        let kind = self.kind_of(index, &line, sketch);
        let page = &self.pages[index];
        let length_m = line.points.len() as f64 * page.grid.pitch_m;
        let speed_m_s = known.speed_m_s.filter(|speed| *speed > 0.0);
        let cause = Cause {
            length_mm: Some(1000.0 * length_m),
            at_m: middle_m(page, &line.points),
            lamp_delay_s: speed_m_s.filter(|_| kind == CauseKind::LitTransit).map(|v| length_m / v),
            ..Cause::new(kind, Some(index))
        };
        (cause, Some(Mending::Erase(line.points)))
    }

    /// Classifies a line of extra light near the letter `index` by its position and shape.
    fn kind_of(&self, index: usize, line: &ExtraLine, sketch: &Sketch) -> CauseKind {
        let [left, top, right, bottom] = self.pages[index].cell();
        let [is_first, is_last] = [index == 0, index + 1 == self.pages.len()];
        let n_points = line.points.len() as f64;
        // Counts the points outside the word, along dark moves, and in neighboring cells.
        let [mut outside, mut along_move, mut beside] = [0.0; 3];
        for point in &line.points {
            let is_outside = point.y > bottom + OUTSIDE_PX
                || point.y < top - OUTSIDE_PX
                || (is_first && point.x < left - OUTSIDE_PX)
                || (is_last && point.x > right + OUTSIDE_PX);
            let is_beside = (!is_first && point.x < left) || (!is_last && point.x > right);
            let is_along = distance(*point, &sketch.dark_moves) <= NEAR_MOVE_PX;
            outside += f64::from(u8::from(is_outside));
            along_move += f64::from(u8::from(is_along));
            beside += f64::from(u8::from(is_beside));
        }
        let is_spot = n_points < MAX_SPOT_LENGTH_PX && line.thick_px > MIN_SPOT_THICKNESS_PX;
        let kinds = [
            (outside / n_points > 0.5, CauseKind::Streak),
            (along_move / n_points >= ALONG_MOVE, CauseKind::LitTransit),
            (is_spot, CauseKind::DwellBlob),
            (beside / n_points > 0.5, CauseKind::Overlap),
        ];
        let first = kinds.into_iter().find(|(applies, _)| *applies);
        first.map_or(CauseKind::OtherStray, |(_, kind)| kind)
    }
}

/// Returns the first log gap during which the lamps may have passed through most of these points,
/// or `None` if there is none. The points are in pixels of the page.
pub(super) fn lost_in<'a>(
    points: &[Point],
    page: &LetterPage,
    placed: &Placed,
    known: &'a Known,
) -> Option<&'a LogGap> {
    let points_m = points.iter().map(|point| placed.apply(page.grid.plane_from_page(*point)));
    known.gaps.iter().find(|gap| {
        let n_in_gap = points_m.clone().filter(|point_m| gap.may_hold(xy(*point_m))).count();
        n_in_gap as f64 >= LOST_IN_LOG * points.len() as f64
    })
}

/// Returns the mean of points on a page, in m in the plane of the word, or `None` if there are
/// none.
fn middle_m(page: &LetterPage, points: &[Point]) -> Option<[f64; 2]> {
    let n_points = points.len() as f64;
    let sum: Vec2 = points.iter().map(|point| point.to_vec2()).sum();
    let mean = Point::new(sum.x / n_points, sum.y / n_points);
    (!points.is_empty()).then(|| xy(page.grid.plane_from_page(mean)))
}
