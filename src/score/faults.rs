//! Faults of a letter: missing strokes, extra light and its kind, shift, glow. Each can be taken
//! out of the letter's picture, so that the letter is read without it.

use kurbo::{Point, Vec2};

use super::bend::{ExtraLine, Gap, distance};
use super::causes::{Cause, CauseKind, Known, LogGap, MissingRun};
use super::plane::{LetterPage, Placed, xy};
use super::raster::Raster;
use super::reader::Reader;
use super::sketch::Sketch;
use super::trace::{self, LightLines};
use super::{PEN_H, PX_PER_H};

/// A cap height in pixels.
const H_PX: f64 = PX_PER_H as f64;

/// Letters farther from their place than this are shifted: 0.06 H. Clean letters are within half.
const SHIFTED_PX: f64 = 0.06 * H_PX;

/// Extra light leads along a dark move if this fraction of it is within `NEAR_MOVE_PX`.
const ALONG_MOVE: f64 = 0.6;

/// How near: 0.15 H.
const NEAR_MOVE_PX: f64 = 0.15 * H_PX;

/// Light this far below or above the letters comes from the floor or goes there: 0.12 H.
const OUTSIDE_PX: f64 = 0.12 * H_PX;

/// Spots are shorter and thicker than this: 0.35 H, and four pens.
const SPOT_PX: [f64; 2] = [0.35 * H_PX, 4.0 * PEN_H * H_PX];

/// Lines wider than this glow: 0.16 H, more than twice the pen.
const GLOWING_PX: f64 = 0.16 * H_PX;

/// Mean distance of a letter's light from its strokes from which it is a fault: 0.05 H.
const OFF_PATH_PX: f64 = 0.05 * H_PX;

/// A part of a stroke is lost in a gap of the log if this fraction of it can have been flown then:
/// the lamps' own faults may lengthen it.
const LOST_IN_LOG: f64 = 0.5;

/// Light within this distance of extra light, or of a stroke, belongs to it: 0.12 H.
const BELONGS_PX: f64 = 0.12 * H_PX;

/// Extra light so close to a stroke stays: it is the stroke's own.
const OWN_PX: f64 = 0.06 * H_PX;

/// A fault, and how it is taken out of a picture, if it can be.
pub(super) type Fault = (Cause, Option<Mending>);

/// How a fault is taken out of a picture.
pub(super) enum Mending {
    /// The light at these points is taken away.
    Erase(Vec<Point>),
    /// Light is added at these points.
    Draw(Vec<Point>),
    /// The letter is moved back by this number of pixels, right and down.
    Move([isize; 2]),
    /// The light of the strokes is drawn at these points instead.
    Straighten(Vec<Point>),
    /// The lines are drawn thin, without glow.
    Redraw,
}

/// Takes a fault out of a picture.
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
            // Each pixel takes the light of the one that the shift has moved it to.
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

/// Draws with the pen at points.
fn draw(picture: &mut Raster, points: &[Point]) {
    let reach_px = 0.5 * PEN_H * H_PX + 0.2;
    paint(picture, 1.0, |pixel| {
        points.iter().any(|point| trace::distance(*point, pixel) <= reach_px)
    });
}

/// Lights, or darkens, the pixels whose middles fulfill a condition.
fn paint(picture: &mut Raster, light: f32, is_meant: impl Fn(Point) -> bool) {
    let width = picture.width;
    for (index, value) in picture.values.iter_mut().enumerate() {
        if is_meant(Point::new((index % width) as f64 + 0.5, (index / width) as f64 + 0.5)) {
            *value = light;
        }
    }
}

impl Reader {
    /// The faults of a letter.
    pub(super) fn faults(
        &self,
        index: usize,
        sketch: &Sketch,
        (gaps, extra): (Vec<Gap>, Vec<ExtraLine>),
        (placed, known): (&Placed, &Known),
    ) -> Vec<Fault> {
        let page = &self.pages[index];
        let mut faults: Vec<Fault> = Vec::new();
        // A part of a stroke without light is the log's fault, or the lamp's.
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
        // Light beside the strokes.
        faults.extend(extra.into_iter().map(|line| self.extra_light(index, line, sketch, known)));
        // A letter beside its place.
        let [right, down] = sketch.shift.map(|px| px as f64);
        let away_px = libm::hypot(right, down);
        if away_px >= SHIFTED_PX {
            faults.push(self.measured(
                index,
                CauseKind::Shifted,
                away_px,
                Mending::Move(sketch.shift),
            ));
        }
        // Light beside its strokes, apart from the shift.
        if sketch.bent.off_px > OFF_PATH_PX {
            let runs = sketch.bent.runs.iter();
            let pairs = runs.flat_map(|run| run.intended.iter().zip(&run.on_light));
            let lit = pairs.filter(|(_, on_light)| sketch.trace.is_drawn(**on_light));
            let straight = Mending::Straighten(lit.map(|(intended, _)| *intended).collect());
            faults.push(self.measured(index, CauseKind::OffPath, sketch.bent.off_px, straight));
        }
        if sketch.trace.thickness() > GLOWING_PX {
            faults.push(self.measured(
                index,
                CauseKind::Glow,
                sketch.trace.thickness(),
                Mending::Redraw,
            ));
        }
        faults
    }

    /// A fault of a length on the letter's page.
    fn measured(&self, index: usize, kind: CauseKind, length_px: f64, mending: Mending) -> Fault {
        let length_mm = Some(1000.0 * length_px * self.pages[index].grid.pitch_m);
        (Cause { length_mm, ..Cause::new(kind, Some(index)) }, Some(mending))
    }

    /// Light beside the strokes, with its kind.
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

    /// The kind of extra light, by its place and shape.
    fn kind_of(&self, index: usize, line: &ExtraLine, sketch: &Sketch) -> CauseKind {
        let [left, top, right, bottom] = self.pages[index].cell();
        let [is_first, is_last] = [index == 0, index + 1 == self.pages.len()];
        let n_points = line.points.len() as f64;
        // Points outside the word, along a dark move, and in a neighbor's cell.
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
        match () {
            () if outside / n_points > 0.5 => CauseKind::Streak,
            () if along_move / n_points >= ALONG_MOVE => CauseKind::LitTransit,
            () if n_points < SPOT_PX[0] && line.thick_px > SPOT_PX[1] => CauseKind::DwellBlob,
            () if beside / n_points > 0.5 => CauseKind::Overlap,
            () => CauseKind::OtherStray,
        }
    }
}

/// The first gap of the flight's log that may explain why most of some points lack light.
pub(super) fn lost_in<'a>(
    points: &[Point],
    page: &LetterPage,
    placed: &Placed,
    known: &'a Known,
) -> Option<&'a LogGap> {
    let points_m = points.iter().map(|point| placed.apply(page.grid.plane_from_page(*point)));
    known.gaps.iter().find(|gap| {
        let held = points_m.clone().filter(|point_m| gap.may_hold(xy(*point_m))).count();
        held as f64 >= LOST_IN_LOG * points.len() as f64
    })
}

/// The middle of points of a page, in the plane of the word, or `None` without points.
fn middle_m(page: &LetterPage, points: &[Point]) -> Option<[f64; 2]> {
    let n_points = points.len() as f64;
    let sum: Vec2 = points.iter().map(|point| point.to_vec2()).sum();
    let mean = Point::new(sum.x / n_points, sum.y / n_points);
    (!points.is_empty()).then(|| xy(page.grid.plane_from_page(mean)))
}
