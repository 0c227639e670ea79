//! Local search among near neighbors by 2-opt (Croes 1958) and Or-opt (Or 1976), which may reverse
//! strokes. The search starts from the order that always continues with the nearest stroke.

use std::ops::Range;

use nalgebra::Vector2;

use super::{Tour, Visit};

/// Number of nearest strokes that are tried as neighbors of each stroke.
const NEIGHBORS: usize = 8;
/// Maximum number of rounds of improvement, which no drawing has reached.
const MAX_ROUNDS: usize = 30;
/// Relative tolerance for rounding errors of a lower bound.
const ROUNDING: f64 = 1e-9;
/// Minimum time in s that a change must save, which exceeds rounding errors.
const LEAST_SAVED_S: f64 = 1e-9;
/// Maximum number of strokes that Or-opt moves together.
const MAX_RUN: usize = 3;

impl Tour<'_> {
    /// Returns the tour that begins on the floor and always continues with the stroke that is
    /// nearest in time. Of equally near strokes, the first of the remaining ones is chosen.
    pub(super) fn nearest(&self) -> Vec<Visit> {
        // No stroke is entered or left faster than the drone's maximum speed, lit or dark.
        let speeds_m_s = self.ways.iter().flatten().map(|way| way.start_m_s.norm());
        let speed_m_s = speeds_m_s.fold(self.style.dark_speed_m_s, f64::max);
        let mut remaining: Vec<usize> = (0..self.ways.len()).collect();
        let mut order: Vec<Visit> = Vec::with_capacity(remaining.len());
        while !remaining.is_empty() {
            let last = order.last().copied();
            let end_m = last.map(|last| self.way(last).end_m);
            let (mut least_s, mut best) = (f64::INFINITY, (0, 0));
            for (index, stroke) in remaining.iter().enumerate() {
                for (way, start_m) in self.ways[*stroke].iter().map(|way| way.start_m).enumerate() {
                    // The distance on the longer axis at full speed gives a fast lower bound.
                    let axis_m = end_m.map_or(0.0, |end_m| (start_m - end_m).amax());
                    if axis_m > least_s * speed_m_s * (1.0 + ROUNDING) {
                        continue;
                    }
                    let dark_s = self.between_s(last, Some((*stroke, way)));
                    if dark_s < least_s {
                        (least_s, best) = (dark_s, (index, way));
                    }
                }
            }
            order.push((remaining.swap_remove(best.0), best.1));
        }
        order
    }

    /// Returns, for each stroke, the indices of the [`NEIGHBORS`] strokes with the nearest ends.
    fn neighbors(&self) -> Vec<Vec<usize>> {
        let ends: Vec<[Vector2<f64>; 2]> =
            self.ways.iter().map(|ways| [ways[0].start_m, ways[0].end_m]).collect();
        // The minimum over all four pairs of ends is used, because strokes may be drawn backward.
        let squared_distance = |a: usize, b: usize| {
            let pairs =
                ends[a].iter().flat_map(|p| ends[b].iter().map(move |q| (p - q).norm_squared()));
            pairs.fold(f64::INFINITY, f64::min)
        };
        let neighbors = (0..ends.len()).map(|stroke| {
            let others = (0..ends.len()).filter(|other| *other != stroke);
            let mut others: Vec<_> =
                others.map(|other| (squared_distance(stroke, other), other)).collect();
            if others.len() > NEIGHBORS {
                others.select_nth_unstable_by(NEIGHBORS, |a, b| a.partial_cmp(b).expect("finite"));
                others.truncate(NEIGHBORS);
            }
            others.into_iter().map(|(_, other)| other).collect()
        });
        neighbors.collect()
    }

    /// Improves a tour by 2-opt and Or-opt until neither saves [`LEAST_SAVED_S`] in a round, or for
    /// [`MAX_ROUNDS`] rounds.
    pub(super) fn improve(&self, visits: &mut Vec<Visit>) {
        let neighbors = self.neighbors();
        for _ in 0..MAX_ROUNDS {
            let before_s = self.total_s(visits);
            // The index of each stroke in the order is updated with every change.
            let mut index_of = vec![0; visits.len()];
            for (index, visit) in visits.iter().enumerate() {
                index_of[visit.0] = index;
            }
            for stroke in 0..self.ways.len() {
                for other in &neighbors[stroke] {
                    let (i, j) = (index_of[stroke], index_of[*other]);
                    let changed = self.two_opt(visits, i, j).or_else(|| self.or_opt(visits, i, j));
                    for index in changed.into_iter().flatten() {
                        index_of[visits[index].0] = index;
                    }
                }
            }
            if self.total_s(visits) > before_s - LEAST_SAVED_S {
                break;
            }
        }
    }

    /// Reverses a run that brings the strokes at `i` and `j` side by side if that saves time
    /// (2-opt). Returns the range of changed visits.
    fn two_opt(&self, visits: &mut [Visit], i: usize, j: usize) -> Option<Range<usize>> {
        let (low, high) = (i.min(j), i.max(j));
        // The candidates are the runs from after `low` to `high`, from `low` to before `high`, and
        // from `low` to `high`.
        let runs = [(low + 1, high), (low, high - 1), (low, high)];
        runs.into_iter().find_map(|(first, last)| {
            if first > last {
                return None;
            }
            // Reversal does not change the time within a run, so only its two ends are compared.
            let (before, after) = neighbors_of(visits, first..last + 1);
            let (head, tail) = (visits[first], visits[last]);
            let old_s = self.between_s(before, Some(head)) + self.between_s(Some(tail), after);
            let new_s = self.between_s(before, Some(reversed(tail)))
                + self.between_s(Some(reversed(head)), after);
            if new_s > old_s - LEAST_SAVED_S {
                return None;
            }
            visits[first..=last].reverse();
            visits[first..=last].iter_mut().for_each(|visit| *visit = reversed(*visit));
            Some(first..last + 1)
        })
    }

    /// Moves a short run that begins at `i` next to the stroke at `j`, forward or backward, if that
    /// saves time (Or-opt). Returns the range of changed visits.
    fn or_opt(&self, visits: &mut Vec<Visit>, i: usize, j: usize) -> Option<Range<usize>> {
        for length in 1..=MAX_RUN.min(visits.len() - i) {
            if (i..i + length).contains(&j) {
                break;
            }
            let forward: Vec<Visit> = visits[i..i + length].to_vec();
            let backward: Vec<Visit> = forward.iter().rev().map(|visit| reversed(*visit)).collect();
            let (before, after) = neighbors_of(visits, i..i + length);
            let saved_s = self.around_s(before, &forward, after) - self.between_s(before, after);
            // `gap` is an insertion index in the unchanged order.
            for gap in [j, j + 1] {
                if (i..=i + length).contains(&gap) {
                    continue;
                }
                let (left, right) = neighbors_of(visits, gap..gap);
                let opened_s = saved_s + self.between_s(left, right);
                for run in [&forward, &backward] {
                    if self.around_s(left, run, right) < opened_s - LEAST_SAVED_S {
                        visits.drain(i..i + length);
                        let gap = if gap > i { gap - length } else { gap };
                        visits.splice(gap..gap, run.iter().copied());
                        return Some(i.min(gap)..(i.max(gap) + length));
                    }
                }
            }
        }
        None
    }

    /// Returns the time in the dark before and after a run in s.
    fn around_s(&self, before: Option<Visit>, run: &[Visit], after: Option<Visit>) -> f64 {
        self.between_s(before, run.first().copied()) + self.between_s(run.last().copied(), after)
    }
}

/// Returns the visits before and after a range of visits.
fn neighbors_of(visits: &[Visit], range: Range<usize>) -> (Option<Visit>, Option<Visit>) {
    (range.start.checked_sub(1).map(|before| visits[before]), visits.get(range.end).copied())
}

/// Returns the visit of the same stroke in the opposite direction.
fn reversed((stroke, way): Visit) -> Visit {
    (stroke, way ^ 1)
}
