//! The reader: how much what is seen in a window resembles each letter and digit.
//!
//! A hypothesis is the intended neighbours and one reference beside them; its similarity is the
//! normalised correlation with the picture in the window, less the cost of shift and stretch.
//! Shifts are tried at half resolution first, the best again at full resolution.

use super::bank::{Bank, CLASSES, shift_cost};
use super::raster::{Raster, dots};
use super::window::Level;

/// Similarity with each of [`CLASSES`].
pub(super) type Similarities = [f32; CLASSES.len()];

/// Classes that fall behind the best by more than this at half resolution are not looked at again:
/// with the reader's sharpness of 30 they are a hundred times less likely.
const CLOSE: f32 = 0.15;

/// One resolution of two pictures and of their neighbours.
struct Scene<'a> {
    level: &'a Level,
    /// Picture less its mean in the window, 0 beside it.
    pictures: [Vec<f32>; 2],
    norms: [f32; 2],
    /// The neighbours in the window, 0 beside it.
    neighbours: Vec<f32>,
    /// Products of the pictures with the neighbours.
    products: [f32; 2],
    /// Sum and sum of squares of the neighbours.
    sums: [f32; 2],
}

/// The best hypothesis for a class at half resolution.
#[derive(Clone, Copy)]
struct Candidate {
    similarity: f32,
    template: usize,
    shift: [isize; 2],
}

/// Compares two pictures of one cell, such as the photo and what was intended, with the bank.
pub(super) fn read(bank: &Bank, pictures: [&Raster; 2], neighbours: &Raster) -> [Similarities; 2] {
    let full = Scene::new(&bank.levels[0], pictures, neighbours);
    let [a, b] = pictures.map(Raster::half);
    let half = Scene::new(&bank.levels[1], [&a, &b], &neighbours.half());

    let none = Candidate { similarity: f32::NEG_INFINITY, template: 0, shift: [0, 0] };
    let mut candidates = [[none; CLASSES.len()]; 2];
    for (index, template) in bank.templates.iter().enumerate() {
        for (&shift, &sums) in bank.shifts.iter().zip(&template.sums) {
            let correlations = half.correlations(&template.pages[1], shift, sums);
            let shift = shift.map(|half_px| 2 * half_px);
            let cost = template.cost + shift_cost(shift);
            for (candidates, correlation) in candidates.iter_mut().zip(correlations) {
                let best = &mut candidates[template.class];
                if correlation - cost > best.similarity {
                    *best = Candidate { similarity: correlation - cost, template: index, shift };
                }
            }
        }
    }
    std::array::from_fn(|picture| {
        let candidates = &candidates[picture];
        let best = candidates.iter().map(|c| c.similarity).fold(f32::NEG_INFINITY, f32::max);
        candidates.map(|candidate| {
            if candidate.similarity < best - CLOSE {
                return candidate.similarity;
            }
            refine(bank, &full, picture, candidate)
        })
    })
}

/// Similarity at full resolution, a pixel to every side tried.
fn refine(bank: &Bank, full: &Scene<'_>, picture: usize, candidate: Candidate) -> f32 {
    let template = &bank.templates[candidate.template];
    let page = &template.pages[0];
    let mut best = f32::NEG_INFINITY;
    for down in candidate.shift[1] - 1..=candidate.shift[1] + 1 {
        for right in candidate.shift[0] - 1..=candidate.shift[0] + 1 {
            let shift = [right, down];
            if !Bank::reaches(shift) {
                continue;
            }
            let rows = full.level.rows(page, shift);
            let squares: Vec<f32> = rows.iter().map(|value| value * value).collect();
            let mask = [&full.level.mask[..]];
            let sums = [dots(mask, rows)[0], dots(mask, &squares)[0]];
            let correlation = full.correlations(page, shift, sums)[picture];
            best = best.max(correlation - template.cost - shift_cost(shift));
        }
    }
    best
}

impl<'a> Scene<'a> {
    fn new(level: &'a Level, pictures: [&Raster; 2], neighbours: &Raster) -> Self {
        let mask = &level.mask;
        let masked = |page: &Raster| -> Vec<f32> {
            level.rows(page, [0, 0]).iter().zip(mask).map(|(value, mask)| value * mask).collect()
        };
        let neighbours = masked(neighbours);
        let pictures = pictures.map(|page| {
            let mut picture = masked(page);
            let mean = picture.iter().sum::<f32>() / level.n_pixels;
            picture.iter_mut().zip(mask).for_each(|(value, mask)| *value -= mean * mask);
            picture
        });
        let norms = pictures.each_ref().map(|picture| dots([picture], picture)[0].sqrt());
        let products = dots([&pictures[0], &pictures[1]], &neighbours);
        let sums = dots([mask, &neighbours], &neighbours);
        Self { level, pictures, norms, neighbours, products, sums }
    }

    /// Normalised correlations of the pictures with a reference between the neighbours, from the
    /// reference's sum and sum of squares in the window; 0 where nothing varies.
    fn correlations(&self, page: &Raster, shift: [isize; 2], [sum, squares]: [f32; 2]) -> [f32; 2] {
        let rows = self.level.rows(page, shift);
        let [a, b, overlap] = dots([&self.pictures[0], &self.pictures[1], &self.neighbours], rows);
        let sum = self.sums[0] + sum;
        let squares = self.sums[1] + squares + 2.0 * overlap;
        let norm = (squares - sum * sum / self.level.n_pixels).max(0.0).sqrt();
        let correlation = |picture: usize, product: f32| {
            let norms = norm * self.norms[picture];
            if norms > 0.0 { (self.products[picture] + product) / norms } else { 0.0 }
        };
        [correlation(0, a), correlation(1, b)]
    }
}
