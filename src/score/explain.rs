//! Explanation of a verdict: the faults of each letter, and the gain from mending each fault.
//!
//! The photo is read again with each fault removed. The gain is the change from the first reading.

use kurbo::Point;

use super::alphabet::with_case_of;
use super::causes::{Advice, Cause, CauseKind, Known, sentence};
use super::faults::{Fault, Mending, lost_in, mend};
use super::judge::Judgment;
use super::lattice::Columns;
use super::reader::{Reader, Seen};
use super::sketch::Sketch;
use super::verdict::Verdict;
use super::view::View;
use super::{BLUR_H, PX_PER_H};
use noctograph_core::error::Result;
use noctograph_core::photo::Photo;
use noctograph_core::statistics::sort_by_number;

/// Cap height in the photo, in pixels, below which the letters have too few pixels.
const FEW_PX: f64 = 30.0;

/// Ratio of the fully lit level to the lowest visible level below which a photo counts as dim.
const DIM: f32 = 2.0;

/// Probability of a letter in its faultless drawing below which the font is at fault.
const STRANGE: f64 = 0.5;

/// Minimum probability of another letter in a faultless drawing at which the font is blamed if the
/// photo is read as that letter. The team's J, for example, which has a small hook, is read as T.
const AMBIGUOUS: f64 = 0.01;

/// Probability of a letter above which its faults are not mended.
const SURE: f64 = 0.97;

/// Minimum gain in readability that justifies a sentence of advice.
const LEAST_GAIN: f64 = 0.005;

/// Maximum number of letters whose faults are mended, the least probable first. Each mended fault
/// costs one more reading.
const MOST_MENDED: usize = 12;

/// Maximum number of letters in a word whose faults are mended. In longer words, causes do not
/// report gains.
const LONGEST_MENDED: usize = 32;

/// Maximum number of sentences of advice.
const MAX_ADVICE: usize = 3;

/// The faults of a verdict as polylines on the photo, in photo pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Marks {
    /// Intended strokes, moved onto the light of their letters.
    pub intended: Vec<Vec<[f64; 2]>>,
    /// Parts of the intended strokes that have no light.
    pub missing: Vec<Vec<[f64; 2]>>,
    /// Points at which there is light but no intended stroke.
    pub stray: Vec<Vec<[f64; 2]>>,
    /// Corners of each lit letter's cell, clockwise from the upper left.
    pub cells: Vec<Vec<[f64; 2]>>,
}

impl Reader {
    /// Reads a photo like [`Self::score`], and adds faithfulness, causes and advice.
    ///
    /// # Errors
    ///
    /// Returns the same errors as [`Self::score`].
    pub fn explain(&self, photo: &Photo, view: &View, known: &Known) -> Result<(Verdict, Marks)> {
        let (mut verdict, seen) = self.score_with_light(photo, view)?;
        let mut marks = Marks::default();
        let Some(seen) = &seen else { return Ok((verdict, marks)) };
        let sketches: Vec<Sketch> =
            (0..self.pages.len()).map(|index| self.sketch(index, seen, view)).collect();
        // Only letter faults have gains, because font or photo faults cannot be removed.
        let mut faults = self.compare(&sketches, (seen, view), known, &mut verdict, &mut marks);
        let in_place = self.gains(seen, &sketches, &mut faults);
        self.flaws_of_design(&verdict, &mut faults);
        if verdict.cap_height_px.is_some_and(|px| px < FEW_PX) {
            faults.push((Cause::new(CauseKind::FewPixels, None), None));
        }
        if seen.contrast < DIM {
            faults.push((Cause::new(CauseKind::Dim, None), None));
        }
        verdict.advice = self.advise((seen, &in_place), &verdict, &sketches, &faults, known);
        sort_by_number(&mut faults, |(cause, _)| -cause.gain.unwrap_or(0.0));
        verdict.causes = faults.into_iter().map(|(cause, _)| cause).collect();
        Ok((verdict, marks))
    }

    /// Sets the gain in probability of each fault by reading its letter again without the fault.
    /// Drops the mendings of letters that are not read again. Returns the judgment of the unmended
    /// photo.
    fn gains(&self, seen: &Seen, sketches: &[Sketch], faults: &mut [Fault]) -> Judgment {
        let columns = Columns::joined(seen.columns.iter().cloned());
        let in_place = self.expected.judge(&columns);
        let middles = self.expected.middles(&columns);
        let mut worst: Vec<usize> = (0..in_place.choices.len()).collect();
        sort_by_number(&mut worst, |index| in_place.choices[*index].p);
        worst.truncate(MOST_MENDED);
        let is_long = self.expected.indices.len() > LONGEST_MENDED;
        for (cause, mending) in faults {
            let (Some(index), false) = (cause.letter, is_long) else {
                *mending = None;
                continue;
            };
            let place = self.expected.indices.iter().position(|judged| *judged == index);
            // Punctuation is not judged, but is mended with the letters for advice.
            let Some(place) = place else { continue };
            if !worst.contains(&place) {
                *mending = None;
            }
            let Some(fault) = mending else { continue };
            let before = in_place.choices[place].p;
            cause.gain = Some(if before >= SURE {
                0.0
            } else {
                let mended = self.mended(seen, sketches, &[(index, fault)]);
                self.expected.choice_near(&mended, &middles, place).p - before
            });
        }
        in_place
    }

    /// Compares the light of each letter with its strokes, and returns the faults. Sets the
    /// letters' measures and the faithfulness in the verdict, and adds marks. `seen` is the word's
    /// light in the photo.
    fn compare(
        &self,
        sketches: &[Sketch],
        (seen, view): (&Seen, &View),
        known: &Known,
        verdict: &mut Verdict,
        marks: &mut Marks,
    ) -> Vec<Fault> {
        let placed = &seen.placed;
        let mut faults: Vec<Fault> = Vec::new();
        // Sums over all letters: number of stroke segments, and this number weighted by recall and
        // by precision.
        let [mut length, mut recalled, mut precise] = [0.0; 3];
        for (index, sketch) in sketches.iter().enumerate() {
            let page = &self.pages[index];
            let (gaps, recall) = sketch
                .trace
                .gaps(&sketch.bent, |points| lost_in(points, page, placed, known).is_some());
            let (mut extra, precision) = sketch.trace.extra_lines(&sketch.own, &sketch.beside);
            extra.retain(|line| line.points.iter().any(|point| page.holds(*point)));
            let n_segments = sketch.own.len() as f64;
            length += n_segments;
            recalled += recall * n_segments;
            precise += precision * n_segments;

            // Computes the measures of the letter in the word's plane, in millimeters and meters.
            let pitch_mm = 1000.0 * page.grid.pitch_m;
            let missing_px: f64 = gaps.iter().map(|gap| gap.along_px[1] - gap.along_px[0]).sum();
            let extra_px = extra.iter().map(|line| line.points.len()).sum::<usize>() as f64;
            let letter = &mut verdict.letters[index];
            (letter.recall, letter.precision) = (Some(recall), Some(precision));
            // `abs` turns -0, the sum of no gaps, into 0.
            letter.missing_mm = Some(missing_px.abs() * pitch_mm);
            letter.stray_mm = Some(extra_px * pitch_mm);
            let [right, down] = sketch.shift.map(|px| px as f64 * page.grid.pitch_m);
            letter.shift_m = Some([right, -down]);

            // Points that the camera cannot see are left out.
            let on_photo = |points: &[Point]| -> Vec<[f64; 2]> {
                let in_plane = points.iter().map(|point| page.grid.plane_from_page(*point));
                in_plane.filter_map(|point_m| placed.image_point(view, point_m)).collect()
            };
            marks.intended.extend(sketch.bent.runs.iter().map(|run| on_photo(&run.intended)));
            marks.missing.extend(gaps.iter().map(|gap| on_photo(&gap.points)));
            marks.stray.extend(extra.iter().map(|line| on_photo(&line.points)));
            let [left, top, right, bottom] = page.cell();
            let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
            marks.cells.push(on_photo(&corners.map(Point::from)));
            faults.extend(self.faults(index, sketch, (gaps, extra), (placed, known)));
        }
        // The faithfulness is F1, the harmonic mean of recall and precision.
        let [recall, precision] = [recalled, precise].map(|sum| sum / length.max(1e-9));
        verdict.faithfulness = Some(2.0 * recall * precision / (recall + precision).max(1e-9));
        faults
    }

    /// Returns one sentence for each kind of fault, sorted by gain in readability. Kinds of faults
    /// that cannot be mended come last, and are only listed if the word is not legible. `in_place`
    /// is the evidence for the intended word.
    fn advise(
        &self,
        (seen, in_place): (&Seen, &Judgment),
        verdict: &Verdict,
        sketches: &[Sketch],
        faults: &[Fault],
        known: &Known,
    ) -> Vec<Advice> {
        let letters: Vec<char> = self.strokes.glyphs.iter().map(|glyph| glyph.character).collect();
        let mut advice: Vec<Advice> = Vec::new();
        let mut kinds: Vec<CauseKind> = Vec::new();
        for (Cause { kind, .. }, _) in faults {
            if kinds.contains(kind) {
                continue;
            }
            kinds.push(*kind);
            // All faults of a kind are mended together, because one change removes them.
            let same_kind = faults.iter().filter(|(cause, _)| cause.kind == *kind);
            let (causes, mendings): (Vec<&Cause>, Vec<_>) = same_kind
                .map(|(cause, mending)| (cause, cause.letter.zip(mending.as_ref())))
                .unzip();
            let mendings: Vec<(usize, &Mending)> = mendings.into_iter().flatten().collect();
            let mut letters_p = mendings.iter().map(|(index, _)| verdict.letters[*index].p);
            let gain = if mendings.is_empty() {
                None
            } else if letters_p.all(|p| p.is_none_or(|p| p >= SURE)) {
                Some(0.0)
            } else {
                let columns = self.mended(seen, sketches, &mendings);
                Some(self.expected.judge(&columns).readability - in_place.readability)
            };
            if gain.map_or(!verdict.legible, |gain| gain >= LEAST_GAIN) {
                let text = sentence(*kind, &causes, &letters, known);
                advice.push(Advice { kind: *kind, text, gain });
            }
        }
        sort_by_number(&mut advice, |advice| -advice.gain.unwrap_or(0.0));
        advice.truncate(MAX_ADVICE);
        advice
    }

    /// Returns the word's columns after mending some faults. Each mending comes with the letter's
    /// index.
    fn mended(&self, seen: &Seen, sketches: &[Sketch], mendings: &[(usize, &Mending)]) -> Columns {
        let (mut strips, mut columns) = (seen.strips.clone(), seen.columns.clone());
        let mut changed = vec![Vec::new(); strips.len()];
        // Each letter is mended on its own page. The difference is then added to the strip.
        for letters in mendings.chunk_by(|a, b| a.0 == b.0) {
            let (index, line) = (letters[0].0, self.line_of[letters[0].0]);
            let (sketch, page) = (&sketches[index], &self.pages[index].grid);
            let mut mended = sketch.ink.clone();
            letters.iter().for_each(|(_, mending)| mend(&mut mended, mending, sketch));
            let [before, after] =
                [&sketch.ink, &mended].map(|raster| raster.blur(BLUR_H * f32::from(PX_PER_H)));
            changed[line].push(strips[line].change(&self.lines[line], page, &before, &after));
        }
        // The net rereads only the columns near a change.
        for (line, parts) in changed.into_iter().enumerate() {
            parts.into_iter().for_each(|part| columns[line].replace(&strips[line], part));
        }
        Columns::joined(columns)
    }

    /// Adds a fault for each letter that looks like another one even in a faultless drawing.
    fn flaws_of_design(&self, verdict: &Verdict, faults: &mut Vec<Fault>) {
        let choices = self.expected.choices(&self.drawn_columns());
        for (index, choice) in self.expected.indices.iter().zip(choices) {
            let letter = &verdict.letters[*index];
            let rival = choice.others.first();
            let rival_is_read = rival.is_some_and(|(rival, p)| {
                *p >= AMBIGUOUS && letter.best == Some(with_case_of(*rival, letter.expected))
            });
            let reads_as = rival.map(|(letter, _)| *letter);
            if choice.p < STRANGE || (rival_is_read && letter.best != Some(letter.expected)) {
                let flaw = Cause { reads_as, ..Cause::new(CauseKind::Design, Some(*index)) };
                faults.push((flaw, None));
            }
        }
    }
}
