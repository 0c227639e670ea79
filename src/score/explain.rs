//! Why: what is missing in each letter, what is too much, and what mending it would gain.
//!
//! Every fault is taken out of the photo by itself and the letter is read again: the difference is
//! what the fault costs (a counterfactual, not a guess).

use super::bank::Bank;
use super::calibration::{ln_share, loss, probability};
use super::causes::{Advice, Cause, CauseKind, Known, MissingRun, sentence};
use super::overlay::Marks;
use super::raster::Raster;
use super::reader::{Look, Reader};
use super::trace::{Bent, Gap, Segment, Stray, Trace, distance};
use super::verdict::{Rival, Verdict};
use super::view::View;
use super::{BLUR_PX, PEN_PX, PX_PER_H, References};
use crate::error::Result;
use crate::letters::{self, Font, Glyph, Move};
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
const SPOT_PX: [f64; 2] = [0.35 * H_PX, 4.0 * PEN_PX as f64];

/// Lines wider than this glow: 0.16 H, more than twice the pen.
const GLOWING_PX: f64 = 0.16 * H_PX;

/// Cap height in the photo below which letters have few pixels (study).
const FEW_PX: f64 = 30.0;

/// Full light by the least light that stands out, below which a photo is dim.
const DIM: f32 = 2.0;

/// Mean distance of a letter's light from its strokes from which it is worth a word: 0.05 H.
const OFF_PATH_PX: f64 = 0.05 * H_PX;

/// The letters of the first font are repaired in the second one: who does not know the first reads
/// by the second, and by print.
const REPAIRED: [&str; 2] = ["ae483", "ae483-fixed"];

/// Share in the choice below which a faultless drawing is a flaw of its font. Of the team's letters
/// B, D, J, W and Y have less (measured here): all of them are among those that were repaired.
const STRANGE: f64 = 0.6;

/// Shares below this are left out of the row of confusions.
const LEAST_SHARE: f64 = 0.001;

/// How a fault is taken out of a picture.
enum Mending {
    Erase(Vec<[f64; 2]>),
    Draw(Vec<[f64; 2]>),
    Move([isize; 2]),
    /// Light goes back from where it is to where it should be.
    Straighten(Vec<[f64; 2]>),
    Redraw,
}

/// A letter's geometry on its page, in pixels.
struct Sketch {
    /// The runs of the pen, as intended and where their light is.
    bent: Bent,
    /// What its light was drawn along.
    own: Vec<Segment>,
    beside: Vec<Segment>,
    /// Where the light should be off.
    ways: Vec<Segment>,
}

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
        let mut found: Vec<(Cause, Option<Mending>)> = Vec::new();
        let mut sketches: Vec<Option<Sketch>> = Vec::new();
        for index in 0..sight.looks.len() {
            let look = &sight.looks[index];
            let Some(ink) = &look.ink else {
                sketches.push(None);
                continue;
            };
            let trace = Trace::of(ink);
            let sketch = self.sketch(index, look, &trace);
            let (gaps, recall) = trace.gaps(&sketch.bent);
            let (mut strays, precision) = trace.strays(&sketch.own, &sketch.beside);
            let layout = &self.banks[self.cells[index].bank].layout;
            strays.retain(|stray| stray.points.iter().any(|point| layout.holds(*point)));
            let pitch_mm = 1000.0 * self.cells[index].grid.pitch_m;
            let missing: f64 = gaps.iter().map(|gap| gap.along_px[1] - gap.along_px[0]).sum();
            // The sum of nothing is -0.
            let missing = missing.abs();
            let stray: usize = strays.iter().map(|stray| stray.points.len()).sum();
            let verdict = &mut sight.verdict.letters[index];
            (verdict.recall, verdict.precision) = (Some(recall), Some(precision));
            (verdict.missing_mm, verdict.stray_mm) =
                (Some(missing * pitch_mm), Some(stray as f64 * pitch_mm));
            verdict.confusion = self.confusion(index, look);
            if let Some(placed) = &sight.placed {
                self.mark(index, placed, view, &sketch, (&gaps, &strays), &mut marks);
            }
            found.extend(gaps.into_iter().map(|gap| self.missing(index, gap)));
            let strays = strays.into_iter();
            found.extend(strays.map(|stray| self.stray(index, stray, &sketch, known)));
            found.extend(self.displaced(index, look));
            found.extend(self.off_path(index, &sketch, &trace));
            if trace.thickness() > GLOWING_PX {
                let length_mm = Some(trace.thickness() * pitch_mm);
                let glow = Cause { length_mm, ..cause(CauseKind::Glow, Some(index)) };
                found.push((glow, Some(Mending::Redraw)));
            }
            sketches.push(Some(sketch));
        }
        for (cause, mending) in &mut found {
            let (Some(index), Some(mending)) = (cause.letter, mending) else { continue };
            let look = &sight.looks[index];
            let (_, p) = self.reread(index, look, sketches[index].as_ref(), &[mending]);
            cause.gain = Some(p - look.verdict.p);
        }
        self.flaws_of_design(&mut found);
        if sight.verdict.cap_height_px.is_some_and(|px| px < FEW_PX) {
            found.push((cause(CauseKind::FewPixels, None), None));
        }
        if sight.contrast.is_some_and(|contrast| contrast < DIM) {
            found.push((cause(CauseKind::Dim, None), None));
        }
        sight.verdict.advice = self.advise(&sight.looks, &sketches, &found, known);
        let gain = |cause: &Cause| cause.gain.unwrap_or(0.0);
        found.sort_by(|a, b| gain(&b.0).total_cmp(&gain(&a.0)));
        sight.verdict.causes = found.into_iter().map(|(cause, _)| cause).collect();
        Ok((sight.verdict, marks))
    }

    /// A sentence for each kind of fault, the most gainful first.
    fn advise(
        &self,
        looks: &[Look],
        sketches: &[Option<Sketch>],
        found: &[(Cause, Option<Mending>)],
        known: &Known,
    ) -> Vec<Advice> {
        let worst = |losses: &[f64]| losses.iter().copied().fold(0.0, f64::max);
        let losses: Vec<f64> = looks.iter().map(|look| look.loss).collect();
        let before = probability(worst(&losses));
        let mut kinds: Vec<CauseKind> = Vec::new();
        for (cause, _) in found {
            if !kinds.contains(&cause.kind) {
                kinds.push(cause.kind);
            }
        }
        let advice = kinds.into_iter().map(|kind| {
            let of_kind: Vec<_> = found.iter().filter(|(cause, _)| cause.kind == kind).collect();
            let mut mended = losses.clone();
            let mut mendable = false;
            for (index, look) in looks.iter().enumerate() {
                let mendings: Vec<&Mending> = of_kind
                    .iter()
                    .filter(|(cause, _)| cause.letter == Some(index))
                    .filter_map(|(_, mending)| mending.as_ref())
                    .collect();
                if !mendings.is_empty() {
                    let sketch = sketches[index].as_ref();
                    mended[index] = self.reread(index, look, sketch, &mendings).0;
                    mendable = true;
                }
            }
            let causes: Vec<&Cause> = of_kind.iter().map(|(cause, _)| cause).collect();
            let gain = mendable.then(|| probability(worst(&mended)) - before);
            Advice { kind, text: sentence(kind, &causes, &self.strokes.word, known), gain }
        });
        let mut advice: Vec<Advice> = advice.collect();
        let gain = |advice: &Advice| advice.gain.unwrap_or(0.0);
        advice.sort_by(|a, b| gain(b).total_cmp(&gain(a)));
        advice
    }

    /// Reads a letter again with faults taken out: its loss and its share.
    fn reread(
        &self,
        index: usize,
        look: &Look,
        sketch: Option<&Sketch>,
        mendings: &[&Mending],
    ) -> (f64, f64) {
        let (cell, Some(picture), Some(sketch)) = (&self.cells[index], &look.picture, sketch)
        else {
            return (look.loss, look.verdict.p);
        };
        let mut mended = picture.clone();
        for mending in mendings {
            mend(&mut mended, mending, sketch);
        }
        let bank = &self.banks[cell.bank];
        let picture = mended.blur(BLUR_PX);
        let matches = cell.surroundings.compare(bank, &picture, self.classes.len());
        let p = libm::exp(ln_share(&matches, cell.class));
        (loss(&matches, cell.class, cell.ln_faultless), p)
    }

    /// The letter's strokes where the reader found them, and what is around.
    fn sketch(&self, index: usize, look: &Look, trace: &Trace) -> Sketch {
        let (cell, glyph) = (&self.cells[index], &self.strokes.glyphs[index]);
        let layout = &self.banks[cell.bank].layout;
        let middle = layout.middle_px();
        let on_page = |[x, y]: [f64; 2]| {
            let grid = &cell.grid;
            [(x - grid.left_m) / grid.pitch_m, (grid.top_m - y) / grid.pitch_m]
        };
        let shift = look.shift.map(|px| px as f64);
        let found = |point: [f64; 2]| {
            let at = on_page(point);
            [0, 1].map(|axis| {
                middle[axis] + look.verdict.scale[axis] * (at[axis] - middle[axis]) + shift[axis]
            })
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
        let bent = trace.bend(&runs);
        let own = bent.segments();
        let (mut beside, mut ways) = (Vec::new(), Vec::new());
        let around = index.saturating_sub(1)..(index + 2).min(self.strokes.glyphs.len());
        let mut last: Option<[f64; 2]> = None;
        for at in around {
            let other = &self.strokes.glyphs[at];
            if let (Some(from), Some(step)) = (last, other.moves.first()) {
                ways.push([on_page(from), on_page(step.from_m)]);
            }
            last = other.moves.last().map(|step| step.to_m);
            for step in &other.moves {
                let segment = [on_page(step.from_m), on_page(step.to_m)];
                if !step.lit {
                    ways.push(segment);
                } else if at != index {
                    beside.push(segment);
                }
            }
        }
        Sketch { bent, own, beside, ways }
    }

    fn missing(&self, index: usize, gap: Gap) -> (Cause, Option<Mending>) {
        let pitch_mm = 1000.0 * self.cells[index].grid.pitch_m;
        let [from_mm, to_mm] = gap.along_px.map(|px| px * pitch_mm);
        let cause = Cause {
            length_mm: Some(to_mm - from_mm),
            at_m: self.middle_m(index, &gap.points),
            missing: Some(MissingRun { stroke: gap.stroke, from_mm, to_mm }),
            ..cause(CauseKind::MissingRun, Some(index))
        };
        (cause, Some(Mending::Draw(gap.points)))
    }

    fn stray(
        &self,
        index: usize,
        stray: Stray,
        sketch: &Sketch,
        known: &Known,
    ) -> (Cause, Option<Mending>) {
        let kind = self.kind_of(index, &stray, sketch);
        let length_m = stray.points.len() as f64 * self.cells[index].grid.pitch_m;
        let speed_m_s = known.speed_m_s.filter(|speed| *speed > 0.0);
        let delay_s = speed_m_s.filter(|_| kind == CauseKind::LitTransit).map(|v| length_m / v);
        let cause = Cause {
            length_mm: Some(1000.0 * length_m),
            at_m: self.middle_m(index, &stray.points),
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
        let layout = &self.banks[self.cells[index].bank].layout;
        let [left, top, right, bottom] = layout.cell_px();
        let [first, last] = [index == 0, index + 1 == self.cells.len()];
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

    /// A letter that stands beside its place.
    fn displaced(&self, index: usize, look: &Look) -> Option<(Cause, Option<Mending>)> {
        let [right, down] = look.shift.map(|px| px as f64);
        let away_px = libm::hypot(right, down);
        let length_mm = Some(1000.0 * away_px * self.cells[index].grid.pitch_m);
        (away_px >= SHIFTED_PX).then(|| {
            let cause = Cause { length_mm, ..cause(CauseKind::Shifted, Some(index)) };
            (cause, Some(Mending::Move(look.shift)))
        })
    }

    /// Letters that those who do not know the font would read otherwise, however well they are
    /// drawn: judged by the repaired letters of the same style, where there are some, and print.
    fn flaws_of_design(&self, found: &mut Vec<(Cause, Option<Mending>)>) {
        if self.strokes.font.as_ref().is_none_or(|font| font.name() != REPAIRED[0]) {
            return;
        }
        let font = Font::open(REPAIRED[1], letters::Trace::CenterLine).expect("a font of ours");
        let aspects = self.banks.iter().map(|bank| bank.layout.aspect);
        let fonts = [font];
        let draw = |aspect| Bank::draw(aspect, &self.classes, &fonts, References::Both, &[]);
        let banks: Vec<Bank> = aspects.map(draw).collect();
        for (index, glyph) in self.strokes.glyphs.iter().enumerate() {
            let cell = &self.cells[index];
            let bank = &banks[cell.bank];
            let (neighbours, faultless) = self.faultless(index, glyph);
            let surroundings = super::matching::Surroundings::new(bank, &neighbours, None);
            let matches = surroundings.compare(bank, &faultless, self.classes.len());
            if libm::exp(ln_share(&matches, cell.class)) < STRANGE {
                found.push((cause(CauseKind::Design, Some(index)), None));
            }
        }
    }

    /// A letter whose light runs beside its strokes, wherever it stands.
    fn off_path(
        &self,
        index: usize,
        sketch: &Sketch,
        trace: &Trace,
    ) -> Option<(Cause, Option<Mending>)> {
        let Bent { intended, found, off_px, .. } = &sketch.bent;
        (*off_px > OFF_PATH_PX).then(|| {
            let length_mm = Some(1000.0 * off_px * self.cells[index].grid.pitch_m);
            let pairs = intended.iter().flatten().zip(found.iter().flatten());
            let lit = pairs.filter(|(_, found)| trace.is_drawn(**found));
            let cause = Cause { length_mm, ..cause(CauseKind::OffPath, Some(index)) };
            (cause, Some(Mending::Straighten(lit.map(|(intended, _)| *intended).collect())))
        })
    }

    fn confusion(&self, index: usize, look: &Look) -> Vec<Rival> {
        let expected = self.strokes.glyphs[index].character;
        let n_classes = self.classes.len().min(look.matches.len());
        let mut row: Vec<Rival> = (0..n_classes)
            .map(|class| Rival {
                letter: self.classes.name(class, Some(expected)),
                p: libm::exp(ln_share(&look.matches, class)),
            })
            .filter(|rival| rival.p >= LEAST_SHARE)
            .collect();
        row.sort_by(|a, b| b.p.total_cmp(&a.p));
        row
    }

    /// The middle of points of a page, in the plane of the word.
    fn middle_m(&self, index: usize, points: &[[f64; 2]]) -> Option<[f64; 2]> {
        let grid = &self.cells[index].grid;
        let n_points = points.len() as f64;
        let mean = |axis: usize| points.iter().map(|point| point[axis]).sum::<f64>() / n_points;
        (!points.is_empty())
            .then(|| [grid.left_m + mean(0) * grid.pitch_m, grid.top_m - mean(1) * grid.pitch_m])
    }
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
                if near(points, middle(index)) <= 0.5 * f64::from(PEN_PX) + 0.2 {
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
        Mending::Redraw => *picture = Trace::of(picture).redrawn(picture),
    }
}

impl Reader {
    /// Puts what was found on the photo.
    fn mark(
        &self,
        index: usize,
        placed: &super::grid::Placed,
        view: &View,
        sketch: &Sketch,
        (gaps, strays): (&[Gap], &[Stray]),
        marks: &mut Marks,
    ) {
        let grid = &self.cells[index].grid;
        let in_photo = |[x, y]: [f64; 2]| {
            let plane = [grid.left_m + x * grid.pitch_m, grid.top_m - y * grid.pitch_m];
            view.image_from_plane(placed.apply(plane))
        };
        let line = |points: &[[f64; 2]]| points.iter().filter_map(|p| in_photo(*p)).collect();
        marks.intended.extend(sketch.bent.intended.iter().map(|points| line(points)));
        marks.missing.extend(gaps.iter().map(|gap| line(&gap.points)));
        marks.stray.extend(strays.iter().map(|stray| line(&stray.points)));
        let layout = &self.banks[self.cells[index].bank].layout;
        let [left, top, right, bottom] = layout.cell_px();
        let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
        marks.cells.push(line(&corners));
    }

    /// A letter's neighbours, and the letter between them, as they should be drawn.
    fn faultless(&self, index: usize, glyph: &Glyph) -> (Raster, Raster) {
        let grid = &self.cells[index].grid;
        let beside = [index.checked_sub(1), Some(index + 1)].into_iter().flatten();
        let beside = beside.filter_map(|at| self.strokes.glyphs.get(at));
        let neighbours = super::reader::draw(grid, &self.home, beside, PEN_PX);
        let own = super::reader::draw(grid, &self.home, [glyph].into_iter(), PEN_PX);
        let faultless = own.plus(&neighbours);
        (neighbours, faultless)
    }
}
