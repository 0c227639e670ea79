//! Strokes as drawn: each intended stroke is moved sideways onto its light, so that the stroke of a
//! drone off its path does not count as missing.
//!
//! Strokes move across their own direction only: along it, light may be missing.

use super::PX_PER_H;
use super::raster::whole;
use super::segment::{CORNER_RAD, Segment, normal, turn, walk};
use super::trace::LightLines;

/// Farthest that a stroke is moved: 0.25 H, as far as a letter may be shifted.
const REACH_PX: i32 = 8;

/// Light that is wider than this across a stroke is another stroke's, or a blot: 0.2 H.
const WIDEST_PX: i32 = 6;

/// Offsets are medians over so many points to either side: 0.2 H.
const AROUND: usize = 6;

/// Strokes of a letter where their light is.
#[derive(Clone, Debug)]
pub(super) struct Bent {
    /// Points of each run of the pen as intended, a pixel apart.
    pub(super) intended: Vec<Vec<[f64; 2]>>,
    /// The same where the light is.
    pub(super) found: Vec<Vec<[f64; 2]>>,
    /// Mean distance of the light from the intended strokes, where there is light.
    pub(super) off_px: f64,
    /// Where each run turns a corner: indices of its points.
    pub(super) corners: Vec<Vec<usize>>,
}

impl Bent {
    /// The found strokes as segments.
    pub(super) fn segments(&self) -> Vec<Segment> {
        let pairs = self.found.iter().flat_map(|points| points.windows(2));
        pairs.map(|pair| [pair[0], pair[1]]).collect()
    }
}

impl LightLines {
    /// Moves runs of the pen onto their light.
    pub(super) fn bend(&self, runs: &[Vec<Segment>]) -> Bent {
        let mut bent =
            Bent { intended: Vec::new(), found: Vec::new(), off_px: 0.0, corners: Vec::new() };
        let (mut sum_px, mut n_found) = (0.0, 0_u32);
        for run in runs {
            let (mut intended, mut found, mut corners) = (Vec::new(), Vec::new(), Vec::new());
            for stroke in run.chunk_by(|a, b| turn(*a, *b) < CORNER_RAD) {
                corners.push(found.len());
                let points: Vec<([f64; 2], [f64; 2])> =
                    stroke.iter().flat_map(|s| walk(*s).map(|point| (point, normal(*s)))).collect();
                let offs: Vec<Option<f64>> =
                    points.iter().map(|(point, across)| self.off(*point, *across)).collect();
                sum_px += offs.iter().flatten().map(|off| off.abs()).sum::<f64>();
                n_found += offs.iter().map(|off| u32::from(off.is_some())).sum::<u32>();
                for (index, (point, across)) in points.iter().enumerate() {
                    let off = smooth(&offs, index);
                    intended.push(*point);
                    found.push([0, 1].map(|axis| point[axis] + off * across[axis]));
                }
            }
            bent.intended.push(intended);
            bent.found.push(found);
            bent.corners.push(corners);
        }
        bent.off_px = sum_px / f64::from(n_found.max(1));
        bent
    }

    /// Offset of the nearest light across a stroke; `None` where there is none.
    fn off(&self, [x, y]: [f64; 2], across: [f64; 2]) -> Option<f64> {
        let at = |step: i32| {
            let off = f64::from(step);
            self.is_lit([x + off * across[0], y + off * across[1]])
        };
        let mut nearest: Option<f64> = None;
        let mut from = None;
        for step in -REACH_PX..=REACH_PX + 1 {
            let lit = step <= REACH_PX && at(step);
            match from {
                None if lit => from = Some(step),
                Some(first) if !lit => {
                    from = None;
                    let middle = 0.5 * f64::from(first + step - 1);
                    let nearer = nearest.is_none_or(|best| middle.abs() < best.abs());
                    if step - first <= WIDEST_PX && nearer {
                        nearest = Some(middle);
                    }
                }
                _ => {}
            }
        }
        nearest
    }

    fn is_lit(&self, [x, y]: [f64; 2]) -> bool {
        let height = self.lit.len() / self.width;
        let inside = x >= 0.0 && y >= 0.0 && x < self.width as f64 && y < height as f64;
        inside && self.lit[whole(y) * self.width + whole(x)]
    }
}

/// The median of the offsets around a point, over a wider range where none was found.
fn smooth(offs: &[Option<f64>], index: usize) -> f64 {
    let mut reach = AROUND;
    loop {
        let around = &offs[index.saturating_sub(reach)..(index + reach + 1).min(offs.len())];
        let mut found: Vec<f64> = around.iter().flatten().copied().collect();
        if !found.is_empty() {
            found.sort_by(f64::total_cmp);
            return found[found.len() / 2];
        }
        if reach > offs.len() {
            return 0.0;
        }
        reach += usize::from(PX_PER_H) / 8;
    }
}

#[cfg(test)]
mod tests {
    use super::super::raster::Raster;
    use super::*;

    #[test]
    fn a_stroke_is_found_where_it_was_drawn_and_its_gap_stays() {
        let mut page = Raster::dark(64, 32);
        for y in 12..15 {
            page.values[y * 64 + 10..y * 64 + 40].fill(1.0);
        }
        let trace = LightLines::new(&page);
        let bent = trace.bend(&[vec![[[10.0, 9.5], [60.0, 9.5]]]]);
        assert!(bent.found[0].iter().all(|[_, y]| (y - 13.5).abs() < 1.0), "{bent:?}");
        assert!((bent.off_px - 4.0).abs() < 1.0, "{}", bent.off_px);
        let (gaps, recall) = trace.gaps(&bent, |_| false);
        let [from, to] = gaps[0].along_px;
        assert!((from - 30.0).abs() <= 1.0 && to == 50.0, "{from} to {to}");
        assert!((recall - 0.66).abs() < 0.03, "{recall}");
    }
}
