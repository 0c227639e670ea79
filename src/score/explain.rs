//! Causes: what is missing in each letter, what is too much, and the gain of mending it.
//!
//! Every fault is taken out of the photo by itself and the word is read again: the difference is the
//! cost of the fault.

use super::align::Target;
use super::bend::Bent;
use super::calibration::readability;
use super::causes::{Advice, Cause, CauseKind, Known, MissingRun, sentence};
use super::gaps::{Gap, Stray};
use super::overlay::Marks;
use super::page::{LetterPage, REACH_PX};
use super::plane::Placed;
use super::raster::Raster;
use super::reader::{Reader, Seen, draw, pure_ink};
use super::segment::{Segment, distance};
use super::sequence::Choice;
use super::strip::{CAP_PX, Strip};
use super::trace::Trace;
use super::verdict::Verdict;
use super::view::View;
use super::{BLUR_H, PEN_H, PX_PER_H};
use crate::error::Result;
use crate::letters::Move;
use crate::photo::Photo;

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

/// Cap height in the photo below which letters have few pixels.
const FEW_PX: f64 = 30.0;

/// Full light by the least light that stands out, below which a photo is dim.
const DIM: f32 = 2.0;

/// Mean distance of a letter's light from its strokes from which it is worth a word: 0.05 H.
const OFF_PATH_PX: f64 = 0.05 * H_PX;

/// Share in the choice below which a faultless drawing is a flaw of its font.
const STRANGE: f64 = 0.5;

/// Share in the choice from which a letter is sure.
const SURE: f64 = 0.97;

/// How a fault is taken out of a picture.
enum Mending {
    Erase(Vec<[f64; 2]>),
    Draw(Vec<[f64; 2]>),
    Move([isize; 2]),
    /// Light goes back from where it is to where it should be.
    Straighten(Vec<[f64; 2]>),
    Redraw,
}

/// A letter on its page: its light, and its strokes in pixels.
struct Sketch {
    /// Its light in the color of the strokes.
    ink: Raster,
    trace: Trace,
    /// Offset from its place, right and down.
    shift: [isize; 2],
    /// The runs of the pen, as intended and where their light is.
    bent: Bent,
    /// The segments along which its light was drawn.
    own: Vec<Segment>,
    beside: Vec<Segment>,
    /// Where the light should be off.
    ways: Vec<Segment>,
}

/// A fault, and how it is taken out.
type Found = (Cause, Option<Mending>);

impl Reader {
    /// Reads a photo as [`Self::score`], and says why.
    ///
    /// # Errors
    ///
    /// As [`Self::score`].
    ///
    /// # Panics
    ///
    /// As [`Self::score`].
    pub fn explain(&self, photo: &Photo, view: &View, known: &Known) -> Result<(Verdict, Marks)> {
        let mut sight = self.sight(photo, view)?;
        let mut marks = Marks::default();
        let Some(seen) = &sight.seen else { return Ok((sight.verdict, marks)) };
        let verdict = &mut sight.verdict;
        let sketches: Vec<Sketch> =
            (0..self.pages.len()).map(|index| self.sketch(index, seen, view)).collect();
        let mut found: Vec<Found> = Vec::new();
        // Lengths of intended strokes and of lines of light, and the shares of them that agree.
        let (mut intended, mut lines) = ([0.0; 2], [0.0; 2]);
        for (index, sketch) in sketches.iter().enumerate() {
            let page = &self.pages[index];
            let (gaps, recall) = sketch.trace.gaps(&sketch.bent);
            let (mut strays, precision) = sketch.trace.strays(&sketch.own, &sketch.beside);
            strays.retain(|stray| stray.points.iter().any(|point| page.holds(*point)));
            let pitch_mm = 1000.0 * page.grid.pitch_m;
            let missing: f64 = gaps.iter().map(|gap| gap.along_px[1] - gap.along_px[0]).sum();
            let stray = strays.iter().map(|stray| stray.points.len()).sum::<usize>() as f64;
            let length = sketch.own.len() as f64;
            intended = [intended[0] + length, intended[1] + recall * length];
            lines = [lines[0] + length, lines[1] + precision * length];
            let letter = &mut verdict.letters[index];
            (letter.recall, letter.precision) = (Some(recall), Some(precision));
            // The sum of nothing is -0.
            letter.missing_mm = Some(missing.abs() * pitch_mm);
            letter.stray_mm = Some(stray * pitch_mm);
            let [right, down] = sketch.shift.map(|px| px as f64 * page.grid.pitch_m);
            letter.shift_m = Some([right, -down]);
            mark(page, &seen.placed, view, sketch, (&gaps, &strays), &mut marks);
            found.extend(gaps.into_iter().map(|gap| missing_run(index, page, gap)));
            let strays = strays.into_iter();
            found.extend(strays.map(|stray| self.stray(index, stray, sketch, known)));
            found.extend(displaced(index, page, sketch));
            found.extend(off_path(index, page, sketch));
            if sketch.trace.thickness() > GLOWING_PX {
                let length_mm = Some(sketch.trace.thickness() * pitch_mm);
                let glow = Cause { length_mm, ..cause(CauseKind::Glow, Some(index)) };
                found.push((glow, Some(Mending::Redraw)));
            }
        }
        let [recall, precision] = [intended, lines].map(|[all, right]| right / all.max(1e-9));
        verdict.faithfulness = Some(2.0 * recall * precision / (recall + precision).max(1e-9));
        for (cause, mending) in &mut found {
            let (Some(index), Some(mending)) = (cause.letter, mending) else { continue };
            let p = verdict.letters[index].p;
            // A letter that is sure gains nothing.
            cause.gain = Some(if p >= SURE {
                0.0
            } else {
                self.reread(&seen.strips, &sketches, &[(index, mending)])[index].p - p
            });
        }
        self.flaws_of_design(&mut found);
        if verdict.cap_height_px.is_some_and(|px| px < FEW_PX) {
            found.push((cause(CauseKind::FewPixels, None), None));
        }
        if seen.contrast < DIM {
            found.push((cause(CauseKind::Dim, None), None));
        }
        verdict.advice = self.advise(seen, verdict, &sketches, &found, known);
        let gain = |cause: &Cause| cause.gain.unwrap_or(0.0);
        found.sort_by(|a, b| gain(&b.0).total_cmp(&gain(&a.0)));
        verdict.causes = found.into_iter().map(|(cause, _)| cause).collect();
        Ok((sight.verdict, marks))
    }

    /// A sentence for each kind of fault, the most gainful first.
    fn advise(
        &self,
        seen: &Seen,
        verdict: &Verdict,
        sketches: &[Sketch],
        found: &[Found],
        known: &Known,
    ) -> Vec<Advice> {
        let mut kinds: Vec<CauseKind> = Vec::new();
        for (cause, _) in found {
            if !kinds.contains(&cause.kind) {
                kinds.push(cause.kind);
            }
        }
        let advice = kinds.into_iter().map(|kind| {
            let of_kind = || found.iter().filter(move |(cause, _)| cause.kind == kind);
            let mendings: Vec<(usize, &Mending)> = of_kind()
                .filter_map(|(cause, mending)| cause.letter.zip(mending.as_ref()))
                .collect();
            let causes: Vec<&Cause> = of_kind().map(|(cause, _)| cause).collect();
            let is_sure = |(index, _): &(usize, &Mending)| verdict.letters[*index].p >= SURE;
            let gain = (!mendings.is_empty()).then(|| {
                if mendings.iter().all(is_sure) {
                    return 0.0;
                }
                readability(&self.reread(&seen.strips, sketches, &mendings)) - verdict.readability
            });
            let letters: Vec<char> =
                self.strokes.glyphs.iter().map(|glyph| glyph.character).collect();
            Advice { kind, text: sentence(kind, &causes, &letters, known), gain }
        });
        let mut advice: Vec<Advice> = advice.collect();
        let gain = |advice: &Advice| advice.gain.unwrap_or(0.0);
        advice.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        advice
    }

    /// Reads the word again with faults taken out of letters.
    fn reread(
        &self,
        strips: &[Strip],
        sketches: &[Sketch],
        mendings: &[(usize, &Mending)],
    ) -> Vec<Choice> {
        let mut strips = strips.to_vec();
        for (index, sketch) in sketches.iter().enumerate() {
            let own = mendings.iter().filter(|(letter, _)| *letter == index);
            let mut mended = sketch.ink.clone();
            own.for_each(|(_, mending)| mend(&mut mended, mending, sketch));
            let glyph = &self.strokes.glyphs[index];
            if mendings.iter().any(|(letter, _)| *letter == index) {
                let blur = |raster: &Raster| raster.blur(BLUR_H * f32::from(PX_PER_H));
                let is_own = |grid: &&super::plane::Grid| {
                    let baseline_m =
                        grid.top_m - (super::strip::HEAD_ROW + CAP_PX) as f64 * grid.pitch_m;
                    (baseline_m - glyph.cell.baseline_m).abs() < 0.5 * glyph.cell.cap_height_m
                };
                let line = self
                    .lines
                    .iter()
                    .position(|grid| is_own(&grid))
                    .expect("a letter is in a line");
                let page = &self.pages[index].grid;
                strips[line].change(&self.lines[line], page, &blur(&sketch.ink), &blur(&mended));
            }
        }
        self.choices(&strips)
    }

    /// A letter's light and its strokes where that light is, and what is around.
    fn sketch(&self, index: usize, seen: &Seen, view: &View) -> Sketch {
        let (page, glyph) = (&self.pages[index], &self.strokes.glyphs[index]);
        let ink = pure_ink(page, self.ink_px[index], seen, view);
        let drawn = draw(&page.grid, &self.home, [glyph].into_iter(), f32::from(PX_PER_H));
        let target = Target::new(ink.blur(BLUR_H * f32::from(PX_PER_H)));
        let (_, shift) = target.seek(&drawn, [0, 0], REACH_PX.cast_signed());
        let found = |point: [f64; 2]| {
            let at = page.from_plane(point);
            [0, 1].map(|axis| at[axis] + shift[axis] as f64)
        };
        let lit = |step: &&Move| step.lit && step.from_m != step.to_m;
        let mut runs: Vec<Vec<Segment>> = Vec::new();
        let mut pen_at = None;
        for step in glyph.moves.iter().filter(lit) {
            let segment = [found(step.from_m), found(step.to_m)];
            match runs.last_mut().filter(|_| pen_at == Some(step.from_m)) {
                Some(run) => run.push(segment),
                None => runs.push(vec![segment]),
            }
            pen_at = Some(step.to_m);
        }
        let trace = Trace::new(&ink);
        let bent = trace.bend(&runs);
        let own = bent.segments();
        let (mut beside, mut ways) = (Vec::new(), Vec::new());
        let around = index.saturating_sub(1)..(index + 2).min(self.strokes.glyphs.len());
        let mut last: Option<[f64; 2]> = None;
        for at in around {
            let other = &self.strokes.glyphs[at];
            if let (Some(from), Some(step)) = (last, other.moves.first()) {
                ways.push([page.from_plane(from), page.from_plane(step.from_m)]);
            }
            last = other.moves.last().map(|step| step.to_m);
            for step in &other.moves {
                let segment = [page.from_plane(step.from_m), page.from_plane(step.to_m)];
                if !step.lit {
                    ways.push(segment);
                } else if at != index {
                    beside.push(segment);
                }
            }
        }
        Sketch { ink, trace, shift, bent, own, beside, ways }
    }

    fn stray(&self, index: usize, stray: Stray, sketch: &Sketch, known: &Known) -> Found {
        let kind = self.kind_of(index, &stray, sketch);
        let page = &self.pages[index];
        let length_m = stray.points.len() as f64 * page.grid.pitch_m;
        let speed_m_s = known.speed_m_s.filter(|speed| *speed > 0.0);
        let delay_s = speed_m_s.filter(|_| kind == CauseKind::LitTransit).map(|v| length_m / v);
        let cause = Cause {
            length_mm: Some(1000.0 * length_m),
            at_m: middle_m(page, &stray.points),
            lamp_delay_s: delay_s,
            ..cause(kind, Some(index))
        };
        (cause, Some(Mending::Erase(stray.points)))
    }

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

    /// Letters that look like other ones however well they are drawn.
    fn flaws_of_design(&self, found: &mut Vec<Found>) {
        let cap_px = CAP_PX as f32;
        let strips: Vec<Strip> = self
            .lines
            .iter()
            .map(|grid| {
                let light = draw(grid, &self.home, self.strokes.glyphs.iter(), cap_px).values;
                let light: Vec<f32> = light.iter().map(|value| (2.0 * value).min(1.0)).collect();
                Strip { width: grid.width, bright: light.clone(), pure: light }
            })
            .collect();
        for (index, choice) in self.choices(&strips).iter().enumerate() {
            if choice.p < STRANGE {
                let reads_as = choice.others.first().map(|(letter, _)| *letter);
                found.push((Cause { reads_as, ..cause(CauseKind::Design, Some(index)) }, None));
            }
        }
    }
}

/// A part of a stroke without light.
fn missing_run(index: usize, page: &LetterPage, gap: Gap) -> Found {
    let [from_mm, to_mm] = gap.along_px.map(|px| px * 1000.0 * page.grid.pitch_m);
    let cause = Cause {
        length_mm: Some(to_mm - from_mm),
        at_m: middle_m(page, &gap.points),
        missing: Some(MissingRun { stroke: gap.stroke, from_mm, to_mm }),
        ..cause(CauseKind::MissingRun, Some(index))
    };
    (cause, Some(Mending::Draw(gap.points)))
}

/// A letter that stands beside its place.
fn displaced(index: usize, page: &LetterPage, sketch: &Sketch) -> Option<Found> {
    let [right, down] = sketch.shift.map(|px| px as f64);
    let away_px = libm::hypot(right, down);
    let length_mm = Some(1000.0 * away_px * page.grid.pitch_m);
    (away_px >= SHIFTED_PX).then(|| {
        let cause = Cause { length_mm, ..cause(CauseKind::Shifted, Some(index)) };
        (cause, Some(Mending::Move(sketch.shift)))
    })
}

/// A letter whose light runs beside its strokes, wherever it stands.
fn off_path(index: usize, page: &LetterPage, sketch: &Sketch) -> Option<Found> {
    let Bent { intended, found, off_px, .. } = &sketch.bent;
    (*off_px > OFF_PATH_PX).then(|| {
        let length_mm = Some(1000.0 * off_px * page.grid.pitch_m);
        let pairs = intended.iter().flatten().zip(found.iter().flatten());
        let lit = pairs.filter(|(_, found)| sketch.trace.is_drawn(**found));
        let cause = Cause { length_mm, ..cause(CauseKind::OffPath, Some(index)) };
        (cause, Some(Mending::Straighten(lit.map(|(intended, _)| *intended).collect())))
    })
}

/// The middle of points of a page, in the plane of the word.
fn middle_m(page: &LetterPage, points: &[[f64; 2]]) -> Option<[f64; 2]> {
    let n_points = points.len() as f64;
    let mean = |axis: usize| points.iter().map(|point| point[axis]).sum::<f64>() / n_points;
    (!points.is_empty()).then(|| page.to_plane([mean(0), mean(1)]))
}

/// A fault of a kind; what is known of it comes later.
fn cause(kind: CauseKind, letter: Option<usize>) -> Cause {
    Cause {
        kind,
        letter,
        length_mm: None,
        at_m: None,
        missing: None,
        lamp_delay_s: None,
        reads_as: None,
        gain: None,
    }
}

/// Takes a fault out of a picture.
fn mend(picture: &mut Raster, mending: &Mending, sketch: &Sketch) {
    let width = picture.width;
    let near = |points: &[[f64; 2]], at: [f64; 2]| {
        points.iter().map(|p| libm::hypot(p[0] - at[0], p[1] - at[1])).fold(f64::INFINITY, f64::min)
    };
    let middle = |index: usize| [(index % width) as f64 + 0.5, (index / width) as f64 + 0.5];
    match mending {
        Mending::Straighten(points) => {
            for (index, value) in picture.values.iter_mut().enumerate() {
                if distance(middle(index), &sketch.own) < 0.12 * H_PX {
                    *value = 0.0;
                }
            }
            mend(picture, &Mending::Draw(points.clone()), sketch);
        }
        Mending::Erase(points) => {
            for (index, value) in picture.values.iter_mut().enumerate() {
                let at = middle(index);
                let is_stray = near(points, at) < 0.12 * H_PX;
                if is_stray && distance(at, &sketch.own) > 0.06 * H_PX {
                    *value = 0.0;
                }
            }
        }
        Mending::Draw(points) => {
            for (index, value) in picture.values.iter_mut().enumerate() {
                if near(points, middle(index)) <= 0.5 * PEN_H * H_PX + 0.2 {
                    *value = 1.0;
                }
            }
        }
        Mending::Move([right, down]) => {
            let mut moved = Raster::dark(picture.width, picture.height);
            for (index, value) in moved.values.iter_mut().enumerate() {
                let from = |at: usize, by: isize, end: usize| {
                    at.checked_add_signed(by).filter(|at| *at < end)
                };
                let x = from(index % width, *right, picture.width);
                let y = from(index / width, *down, picture.height);
                if let (Some(x), Some(y)) = (x, y) {
                    *value = picture.values[y * width + x];
                }
            }
            *picture = moved;
        }
        Mending::Redraw => *picture = Trace::new(picture).redrawn(picture),
    }
}

/// Puts the strokes and faults of a letter on the photo.
fn mark(
    page: &LetterPage,
    placed: &Placed,
    view: &View,
    sketch: &Sketch,
    (gaps, strays): (&[Gap], &[Stray]),
    marks: &mut Marks,
) {
    let in_photo = |point: &[f64; 2]| view.image_from_plane(placed.apply(page.to_plane(*point)));
    let line = |points: &[[f64; 2]]| points.iter().filter_map(in_photo).collect();
    marks.intended.extend(sketch.bent.intended.iter().map(|points| line(points)));
    marks.missing.extend(gaps.iter().map(|gap| line(&gap.points)));
    marks.stray.extend(strays.iter().map(|stray| line(&stray.points)));
    let [left, top, right, bottom] = page.cell();
    marks.cells.push(line(&[[left, top], [right, top], [right, bottom], [left, bottom]]));
}
