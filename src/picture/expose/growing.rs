//! A film that grows with its light, for example while a flight is still in progress.
//!
//! A film is a sum of integers, for which the order of the records does not matter. When an image
//! has grown, only records that differ from the earlier ones are drawn. If a lamp's last segment
//! has become longer, its old records are drawn again and subtracted. The film has the same bits as
//! one that is exposed all at once.

use super::record::Record;
use super::tile::{ALL, count};
use super::{Film, Latent, Tint, cpu};
use noctograph_core::parallel;

/// The light that was drawn so far.
#[derive(Debug, Default)]
pub struct GrowingFilm {
    /// The last image, or `None` before the first one.
    drawn: Option<Latent>,
    /// The counts of the last image in the brightest channel, one plane for each tint.
    planes: Vec<Vec<u32>>,
    /// Number of records that were drawn or subtracted for the last image.
    n_drawn: usize,
}

impl GrowingFilm {
    /// Adds up the light of an image on the processor. Earlier counts are kept if the scale is the
    /// same as before. If the scale has changed, all light is drawn again.
    pub fn develop(&mut self, latent: Latent) -> Film {
        let mut before = self.drawn.take().filter(|drawn| drawn.counts_as(&latent));
        let kept = std::mem::take(&mut self.planes);
        let mut kept: Vec<_> =
            before.iter_mut().flat_map(|b| b.tints.drain(..)).zip(kept).collect();
        self.n_drawn = 0;
        let [width, height] = latent.size_px.map(|px| px as usize);
        let mut counts = vec![0; 3 * width * height];
        for tint in &latent.tints {
            let same = kept.iter().position(|(drawn, _)| drawn.fractions == tint.fractions);
            let kept = same.map(|index| kept.swap_remove(index));
            let plane = self.draw(kept, tint, &latent);
            let mut planes: Vec<&mut [u32]> = counts.chunks_exact_mut(width * height).collect();
            count(&plane, [width, 0], tint.fractions, &mut planes, [width, 0], [width, height]);
            self.planes.push(plane);
        }
        let film = latent.film(counts);
        self.drawn = Some(latent);
        film
    }

    /// Returns the number of records that were drawn or subtracted for the last image.
    pub fn n_drawn(&self) -> usize {
        self.n_drawn
    }

    /// Returns the counts of a tint in one plane, computed from its earlier counts if there are
    /// any.
    fn draw(&mut self, kept: Option<(Tint, Vec<u32>)>, tint: &Tint, latent: &Latent) -> Vec<u32> {
        let Some((before, mut plane)) = kept else {
            self.n_drawn += tint.records.len();
            return plane_of(tint.records.clone(), latent);
        };
        let [removed, added] = changes(&before, tint);
        // If more records have changed than the image contains, drawing all of them is faster.
        if removed.len() + added.len() > tint.records.len() {
            return self.draw(None, tint, latent);
        }
        self.n_drawn += removed.len() + added.len();
        if !removed.is_empty() {
            let light = plane_of(removed, latent);
            plane.iter_mut().zip(light).for_each(|(sum, count)| *sum -= count);
        }
        if !added.is_empty() {
            let light = plane_of(added, latent);
            plane.iter_mut().zip(light).for_each(|(sum, count)| *sum += count);
        }
        plane
    }
}

/// Returns the records that are only in `before`, and those that are only in `now`, after the
/// common start of each lamp's records.
fn changes(before: &Tint, now: &Tint) -> [Vec<Record>; 2] {
    let mut changes = [Vec::new(), Vec::new()];
    let (old, new) = (before.by_lamp(), now.by_lamp());
    for lamp in 0..old.len().max(new.len()) {
        let [old, new] = [&old, &new].map(|lamps| lamps.get(lamp).copied().unwrap_or_default());
        let n_common = old.iter().zip(new).take_while(|(a, b)| a == b).count();
        changes[0].extend_from_slice(&old[n_common..]);
        changes[1].extend_from_slice(&new[n_common..]);
    }
    changes
}

impl Tint {
    /// Returns the records of each lamp, in the order of the lamps.
    fn by_lamp(&self) -> Vec<&[Record]> {
        let starts = [0].into_iter().chain(self.lamp_ends.iter().copied());
        starts.zip(&self.lamp_ends).map(|(start, end)| &self.records[start..*end]).collect()
    }
}

/// Draws records into a single plane of counts, at the scale of an image.
fn plane_of(records: Vec<Record>, latent: &Latent) -> Vec<u32> {
    let tint = Tint { fractions: [ALL, 0, 0], records, lamp_ends: Vec::new() };
    let alone = Latent { tints: vec![tint], glow: None, ..*latent };
    let mut planes = cpu::splat(parallel::current_num_threads() as u64, &alone);
    planes.truncate(planes.len() / 3);
    planes
}

#[cfg(test)]
mod tests {
    use super::super::tests::scenes;
    use super::*;

    /// Returns the image of the first part of each lamp's records. The last record is fainter, like
    /// that of an incomplete segment.
    fn begun(latent: &Latent, part: usize) -> Latent {
        let mut begun = latent.clone();
        for (tint, whole) in begun.tints.iter_mut().zip(&latent.tints) {
            (tint.records, tint.lamp_ends) = (Vec::new(), Vec::new());
            for lamp in whole.by_lamp() {
                let n = (part * lamp.len()).div_ceil(4);
                tint.records.extend_from_slice(&lamp[..n]);
                if let Some(last) = tint.records.last_mut().filter(|_| part < 4) {
                    last.light_lx_s *= 0.5;
                }
                tint.lamp_ends.push(tint.records.len());
            }
        }
        begun
    }

    #[test]
    fn a_film_that_grows_has_the_bits_of_one_that_is_exposed_at_once() {
        let mut n_saved = 0;
        for (name, latent) in scenes() {
            let mut film = GrowingFilm::default();
            for part in 1..=4 {
                let begun = begun(&latent, part);
                let wanted = begun.develop_on_all();
                assert!(film.develop(begun.clone()) == wanted, "{name}: part {part}");
                n_saved += begun.n_segments().saturating_sub(film.n_drawn());
            }
            film.develop(latent.clone());
            assert_eq!(film.n_drawn(), 0, "{name}: nothing is new");
            let coarse = latent.clone().at_scale(latent.scale_log2() + 1).unwrap();
            assert!(film.develop(coarse.clone()) == coarse.develop_on_all(), "{name}: other scale");
            let dark = begun(&latent, 0);
            assert!(film.develop(dark.clone()) == dark.develop_on_all(), "{name}: another flight");
        }
        assert!(n_saved > 0, "only what is new is drawn");
    }
}
