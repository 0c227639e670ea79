//! Faults of a letter: missing strokes, stray light and its kind, shift, glow; and how each is
//! taken out of the letter's picture, so that the letter can be read without it.

use super::bend::{Bent, Gap, Stray, distance};
use super::causes::{Cause, CauseKind, Known, LogGap, MissingRun};
use super::plane::{LetterPage, Placed};
use super::raster::Raster;
use super::reader::Reader;
use super::sketch::Sketch;
use super::trace::LightLines;
use super::{PEN_H, PX_PER_H};
use noctograph_core::geometry;

/// A cap height in pixels.
const H_PX: f64 = PX_PER_H as f64;

/// Letters farther from their place than this are shifted: 0.06 H, two pixels of a page. Clean
/// letters are found within one.
const SHIFTED_PX: f64 = 0.06 * H_PX;

/// Stray light leads along a dark way where this share of it is within `NEAR_WAY_PX`.
const ALONG_WAY: f64 = 0.6;

/// How near: 0.15 H.
const NEAR_WAY_PX: f64 = 0.15 * H_PX;

/// Light this far below or above the letters comes from the floor or goes there: 0.12 H.
const OUTSIDE_PX: f64 = 0.12 * H_PX;

/// Spots are shorter and thicker than this: 0.35 H, and four pens.
const SPOT_PX: [f64; 2] = [0.35 * H_PX, 4.0 * PEN_H * H_PX];

/// Lines wider than this glow: 0.16 H, more than twice the pen.
const GLOWING_PX: f64 = 0.16 * H_PX;

/// Mean distance of a letter's light from its strokes from which it is a fault: 0.05 H.
const OFF_PATH_PX: f64 = 0.05 * H_PX;

/// A part of a stroke is lost in a gap of the log where this share of it can have been flown then:
/// the lamps' own faults may lengthen it.
const LOST_IN_LOG: f64 = 0.5;

/// Light within this distance of stray light, or of a stroke, belongs to it: 0.12 H.
const BELONGS_PX: f64 = 0.12 * H_PX;

/// Stray light so close to a stroke stays: it is the stroke's own.
const OWN_PX: f64 = 0.06 * H_PX;

/// A fault, and how it is taken out of a picture, where it can be.
pub(super) type Fault = (Cause, Option<Mending>);

/// How a fault is taken out of a picture.
pub(super) enum Mending {
    /// The light at these points is taken away.
    Erase(Vec<[f64; 2]>),
    /// Light is added at these points.
    Draw(Vec<[f64; 2]>),
    /// The letter is moved back by so many pixels, right and down.
    Move([isize; 2]),
    /// The light of the strokes is drawn at these points instead.
    Straighten(Vec<[f64; 2]>),
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
            is_near(pixel, points, |px| px < BELONGS_PX) && distance(pixel, &sketch.own) > OWN_PX
        }),
        Mending::Draw(points) => draw(picture, points),
        Mending::Move([right, down]) => {
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
fn draw(picture: &mut Raster, points: &[[f64; 2]]) {
    paint(picture, 1.0, |pixel| is_near(pixel, points, |px| px <= 0.5 * PEN_H * H_PX + 0.2));
}

/// Lights, or darkens, the pixels whose middles fulfill a condition.
fn paint(picture: &mut Raster, light: f32, is_meant: impl Fn([f64; 2]) -> bool) {
    let width = picture.width;
    for (index, value) in picture.values.iter_mut().enumerate() {
        if is_meant([(index % width) as f64 + 0.5, (index / width) as f64 + 0.5]) {
            *value = light;
        }
    }
}

/// Whether the nearest of some points is near enough.
fn is_near(pixel: [f64; 2], points: &[[f64; 2]], is_enough: impl Fn(f64) -> bool) -> bool {
    points.iter().any(|point| is_enough(geometry::distance(*point, pixel)))
}

impl Reader {
    /// The faults of a letter.
    pub(super) fn faults(
        &self,
        index: usize,
        sketch: &Sketch,
        (gaps, strays): (Vec<Gap>, Vec<Stray>),
        (placed, known): (&Placed, &Known),
    ) -> Vec<Fault> {
        let page = &self.pages[index];
        let missing = gaps.into_iter().map(|gap| missing_run(index, page, gap, (placed, known)));
        let mut faults: Vec<Fault> = missing.collect();
        faults.extend(strays.into_iter().map(|stray| self.stray(index, stray, sketch, known)));
        faults.extend(displaced(index, page, sketch));
        faults.extend(off_path(index, page, sketch));
        if sketch.trace.thickness() > GLOWING_PX {
            let length_mm = Some(1000.0 * sketch.trace.thickness() * page.grid.pitch_m);
            let glow = Cause { length_mm, ..Cause::new(CauseKind::Glow, Some(index)) };
            faults.push((glow, Some(Mending::Redraw)));
        }
        faults
    }

    /// Light beside the strokes, with its kind.
    fn stray(&self, index: usize, stray: Stray, sketch: &Sketch, known: &Known) -> Fault {
        let kind = self.kind_of(index, &stray, sketch);
        let page = &self.pages[index];
        let length_m = stray.points.len() as f64 * page.grid.pitch_m;
        let speed_m_s = known.speed_m_s.filter(|speed| *speed > 0.0);
        let delay_s = speed_m_s.filter(|_| kind == CauseKind::LitTransit).map(|v| length_m / v);
        let cause = Cause {
            length_mm: Some(1000.0 * length_m),
            at_m: middle_m(page, &stray.points),
            lamp_delay_s: delay_s,
            ..Cause::new(kind, Some(index))
        };
        (cause, Some(Mending::Erase(stray.points)))
    }

    /// The kind of stray light, by its place and shape.
    fn kind_of(&self, index: usize, stray: &Stray, sketch: &Sketch) -> CauseKind {
        let n_points = stray.points.len() as f64;
        let share = |holds: &dyn Fn(&[f64; 2]) -> bool| {
            stray.points.iter().filter(|point| holds(point)).count() as f64 / n_points
        };
        let [left, top, right, bottom] = self.pages[index].cell();
        let [first, last] = [index == 0, index + 1 == self.pages.len()];
        let outside = share(&|[x, y]| {
            *y > bottom + OUTSIDE_PX
                || *y < top - OUTSIDE_PX
                || (first && *x < left - OUTSIDE_PX)
                || (last && *x > right + OUTSIDE_PX)
        });
        match () {
            () if outside > 0.5 => CauseKind::Streak,
            () if share(&|point| distance(*point, &sketch.ways) <= NEAR_WAY_PX) >= ALONG_WAY => {
                CauseKind::LitTransit
            }
            () if n_points < SPOT_PX[0] && stray.thick_px > SPOT_PX[1] => CauseKind::DwellBlob,
            () if share(&|[x, _]| (!first && *x < left) || (!last && *x > right)) > 0.5 => {
                CauseKind::Overlap
            }
            () => CauseKind::OtherStray,
        }
    }
}

/// The first gap of the flight's log that may hold most of some points of a letter, which then lack
/// light because the log lacks rows.
pub(super) fn lost_in<'a>(
    points: &[[f64; 2]],
    page: &LetterPage,
    placed: &Placed,
    known: &'a Known,
) -> Option<&'a LogGap> {
    let points_m = points.iter().map(|point| placed.apply(page.plane_from_page(*point)));
    known.gaps.iter().find(|gap| {
        let held = points_m.clone().filter(|point_m| gap.may_hold(*point_m)).count();
        held as f64 >= LOST_IN_LOG * points.len() as f64
    })
}

/// A part of a stroke without light.
fn missing_run(
    index: usize,
    page: &LetterPage,
    gap: Gap,
    (placed, known): (&Placed, &Known),
) -> Fault {
    let log = lost_in(&gap.points, page, placed, known);
    let [from_mm, to_mm] = gap.along_px.map(|px| px * 1000.0 * page.grid.pitch_m);
    let kind = if log.is_some() { CauseKind::LogGap } else { CauseKind::MissingRun };
    let cause = Cause {
        log_gap_s: log.map(|log| log.span_s),
        length_mm: Some(to_mm - from_mm),
        at_m: middle_m(page, &gap.points),
        missing: Some(MissingRun { stroke: gap.stroke, from_mm, to_mm }),
        ..Cause::new(kind, Some(index))
    };
    (cause, Some(Mending::Draw(gap.points)))
}

/// A letter beside its place.
fn displaced(index: usize, page: &LetterPage, sketch: &Sketch) -> Option<Fault> {
    let [right, down] = sketch.shift.map(|px| px as f64);
    let away_px = libm::hypot(right, down);
    let length_mm = Some(1000.0 * away_px * page.grid.pitch_m);
    (away_px >= SHIFTED_PX).then(|| {
        let cause = Cause { length_mm, ..Cause::new(CauseKind::Shifted, Some(index)) };
        (cause, Some(Mending::Move(sketch.shift)))
    })
}

/// A letter with light beside its strokes, apart from its shift.
fn off_path(index: usize, page: &LetterPage, sketch: &Sketch) -> Option<Fault> {
    let Bent { intended, on_light, off_px, .. } = &sketch.bent;
    (*off_px > OFF_PATH_PX).then(|| {
        let length_mm = Some(1000.0 * off_px * page.grid.pitch_m);
        let pairs = intended.iter().flatten().zip(on_light.iter().flatten());
        let lit = pairs.filter(|(_, point)| sketch.trace.is_drawn(**point));
        let cause = Cause { length_mm, ..Cause::new(CauseKind::OffPath, Some(index)) };
        (cause, Some(Mending::Straighten(lit.map(|(intended, _)| *intended).collect())))
    })
}

/// The middle of points of a page, in the plane of the word.
fn middle_m(page: &LetterPage, points: &[[f64; 2]]) -> Option<[f64; 2]> {
    let n_points = points.len() as f64;
    let mean = [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / n_points);
    (!points.is_empty()).then(|| page.plane_from_page(mean))
}
