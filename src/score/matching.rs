//! How much what is seen in a window resembles each character.
//!
//! A hypothesis is the intended neighbours and one reference beside them; its similarity is the
//! normalised correlation with the picture in the window, less the cost of shift and stretch. All
//! hypotheses are tried at quarter resolution, the best of each character again at half and at
//! full resolution.

use super::bank::{Bank, Shows, shift_cost};
use super::raster::{Raster, dots, moments};
use super::window::Level;

/// Characters that fall behind the best by more than this at quarter resolution are not looked at
/// again: with the reader's sharpness of 30 they are a hundred times less likely.
const CLOSE: f32 = 0.15;

/// References of a character that are looked at again, at their best shifts.
const N_CANDIDATES: usize = 3;

/// The best hypothesis for a character.
#[derive(Clone, Copy, Debug)]
pub(super) struct Match {
    pub(super) similarity: f32,
    /// Index of the reference.
    pub(super) template: usize,
    /// Right and down, in pixels of full resolution.
    pub(super) shift: [isize; 2],
}

/// What is known of a cell before a photo is seen.
pub(super) struct Surroundings {
    /// The class that should stand there, where that is known.
    own: Option<usize>,
    /// The references that may stand there.
    templates: Vec<usize>,
    /// The neighbours in the window at each resolution, 0 beside it.
    neighbours: [Vec<f32>; 3],
    /// Sum and sum of squares of the neighbours.
    sums: [[f32; 2]; 3],
    /// Of each reference at each of the bank's shifts between the neighbours, at quarter
    /// resolution: 1 over its norm.
    inverse_norms: Vec<f32>,
}

/// A picture in the window at one resolution, less its mean, 0 beside the window.
struct Seen {
    values: Vec<f32>,
    norm: f32,
    /// Product with the neighbours.
    product: f32,
}

impl Surroundings {
    /// A cell whose neighbours were drawn and blurred on the bank's page, and the class that should
    /// stand there, where that is known: it may have lost a stroke.
    pub(super) fn new(bank: &Bank, neighbours: &Raster, own: Option<usize>) -> Self {
        let pages = neighbours.clone().pyramid();
        let neighbours: [Vec<f32>; 3] =
            std::array::from_fn(|at| bank.levels[at].masked(&pages[at]));
        let sums = std::array::from_fn(|at| {
            let of = &neighbours[at];
            dots([&bank.levels[at].mask, of], of)
        });
        let level = &bank.levels[2];
        let norm = |page: &Raster, shift| {
            let rows = level.rows(page, shift);
            let [_, overlap, sum, squares] = moments(rows, &[], &neighbours[2], &level.mask);
            inverse_norm(level, sums[2], sum, squares, overlap)
        };
        let may_stand = |index: &usize| match bank.templates[*index].shows {
            Shows::Whole(_) => true,
            Shows::Part(class) => own == Some(class),
            Shows::Blot => own.is_some(),
        };
        let templates: Vec<usize> = (0..bank.templates.len()).filter(may_stand).collect();
        let inverse_norms = templates
            .iter()
            .flat_map(|index| {
                let page = &bank.templates[*index].pages[2];
                bank.shifts.iter().map(move |&shift| norm(page, shift))
            })
            .collect();
        Self { own, templates, neighbours, sums, inverse_norms }
    }

    /// Compares a picture of the cell with the bank: the best hypothesis for each class and,
    /// where it is known what should stand there, last the best for what is no character: the
    /// expected one less a stroke, or a blot.
    pub(super) fn compare(&self, bank: &Bank, picture: &Raster, n_classes: usize) -> Vec<Match> {
        let pages = picture.clone().pyramid();
        let seen = [0, 1, 2].map(|at| self.seen(bank, &pages[at], at));
        let candidates = self.candidates(bank, &seen[2], n_classes);
        let best = candidates.iter().map(|c| c[0].similarity).fold(f32::NEG_INFINITY, f32::max);
        let refined = candidates.iter().map(|candidates| {
            if candidates[0].similarity < best - CLOSE {
                return candidates[0];
            }
            let found = candidates.iter().filter(|candidate| candidate.similarity.is_finite());
            let halves = found.map(|candidate| self.refine(bank, &seen[1], 1, *candidate));
            let half = halves.reduce(|a, b| if b.similarity > a.similarity { b } else { a });
            self.refine(bank, &seen[0], 0, half.expect("the best is finite"))
        });
        refined.collect()
    }

    /// As [`Self::compare`], but to half resolution and a pixel: a tenth of the work.
    pub(super) fn glance(&self, bank: &Bank, picture: &Raster, n_classes: usize) -> Vec<Match> {
        let half = picture.half();
        let seen = self.seen(bank, &half.half(), 2);
        let candidates = self.candidates(bank, &seen, n_classes);
        let best = candidates.iter().map(|c| c[0].similarity).fold(f32::NEG_INFINITY, f32::max);
        let seen = self.seen(bank, &half, 1);
        let refined = candidates.iter().map(|[first, ..]| {
            if first.similarity < best - CLOSE {
                *first
            } else {
                self.refine(bank, &seen, 1, *first)
            }
        });
        refined.collect()
    }

    fn seen(&self, bank: &Bank, page: &Raster, at: usize) -> Seen {
        Seen::new(&bank.levels[at], page, &self.neighbours[at])
    }

    /// The best references of each class at quarter resolution, the best first.
    fn candidates(&self, bank: &Bank, seen: &Seen, n_classes: usize) -> Vec<[Match; N_CANDIDATES]> {
        let none = Match { similarity: f32::NEG_INFINITY, template: 0, shift: [0, 0] };
        let mut candidates =
            vec![[none; N_CANDIDATES]; n_classes + usize::from(self.own.is_some())];
        let norms = self.inverse_norms.chunks_exact(bank.shifts.len());
        for (&index, norms) in self.templates.iter().zip(norms) {
            let template = &bank.templates[index];
            let mut best = none;
            for (&shift, inverse_norm) in bank.shifts.iter().zip(norms) {
                let rows = bank.levels[2].rows(&template.pages[2], shift);
                let product = seen.product + dots([rows], &seen.values)[0];
                let shift = shift.map(|quarter_px| 4 * quarter_px);
                let cost = template.cost + shift_cost(shift);
                let similarity = product * inverse_norm * seen.norm - cost;
                if similarity > best.similarity {
                    best = Match { similarity, template: index, shift };
                }
            }
            let candidates = match template.shows {
                Shows::Whole(class) => &mut candidates[class],
                Shows::Part(_) | Shows::Blot => &mut candidates[n_classes],
            };
            if best.similarity > candidates[N_CANDIDATES - 1].similarity {
                candidates[N_CANDIDATES - 1] = best;
                candidates.sort_by(|a, b| b.similarity.total_cmp(&a.similarity));
            }
        }
        candidates
    }

    /// The best hypothesis at a resolution, a pixel to every side of a candidate tried.
    fn refine(&self, bank: &Bank, seen: &Seen, at: usize, candidate: Match) -> Match {
        let level = &bank.levels[at];
        let template = &bank.templates[candidate.template];
        let step = 1_isize << at;
        let mut best = Match { similarity: f32::NEG_INFINITY, ..candidate };
        for down in [-step, 0, step] {
            for right in [-step, 0, step] {
                let shift = [candidate.shift[0] + right, candidate.shift[1] + down];
                if !Bank::reaches(shift) {
                    continue;
                }
                let rows = level.rows(&template.pages[at], shift.map(|px| px / step));
                let [product, overlap, sum, squares] =
                    moments(rows, &seen.values, &self.neighbours[at], &level.mask);
                let inverse_norm = inverse_norm(level, self.sums[at], sum, squares, overlap);
                let correlation = (seen.product + product) * inverse_norm * seen.norm;
                let similarity = correlation - template.cost - shift_cost(shift);
                if similarity > best.similarity {
                    best = Match { similarity, shift, ..candidate };
                }
            }
        }
        best
    }
}

impl Seen {
    fn new(level: &Level, page: &Raster, neighbours: &[f32]) -> Self {
        let mut values = level.masked(page);
        let mean = values.iter().sum::<f32>() / level.n_pixels;
        values.iter_mut().zip(&level.mask).for_each(|(value, mask)| *value -= mean * mask);
        let [squares, product] = dots([&values, neighbours], &values);
        let norm = if squares > 0.0 { 1.0 / squares.sqrt() } else { 0.0 };
        Self { values, norm, product }
    }
}

/// 1 over the norm of a reference between its neighbours, less their mean; 0 where nothing varies.
fn inverse_norm(level: &Level, beside: [f32; 2], sum: f32, squares: f32, overlap: f32) -> f32 {
    let sum = beside[0] + sum;
    let squares = beside[1] + squares + 2.0 * overlap - sum * sum / level.n_pixels;
    if squares > 0.0 { 1.0 / squares.sqrt() } else { 0.0 }
}
