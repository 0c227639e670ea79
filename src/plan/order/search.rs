//! Local search over orders: 2-opt (Croes 1958) and Or-opt (Or 1976) with turned strokes, among
//! near neighbors, from the order that always takes the nearest stroke next.

use std::ops::Range;

use nalgebra::Vector2;

use super::starts::Starts;
use super::{Leg, Tour};

/// Strokes that are tried next to each.
const NEIGHBORS: usize = 8;
/// Most rounds of improvement; no drawing has reached it.
const MAX_ROUNDS: usize = 30;
/// Longest run of strokes that Or-opt moves.
const MAX_RUN: usize = 3;

impl Tour<'_> {
    /// From the floor always to the stroke that is nearest in time.
    ///
    /// Of two equally near strokes the first of the remaining list: it begins in the order of the
    /// drawing, and `swap_remove` moves the last one.
    pub(super) fn nearest(&self) -> Vec<Leg> {
        let mut left: Vec<usize> = (0..self.ways.len()).collect();
        let mut place = left.clone();
        let mut starts = Starts::new(self.ways);
        // A stroke is entered and left no faster than the drone flies, lit or dark.
        let speeds_m_s = self.ways.iter().flatten().map(|way| way.start_m_s.norm());
        let speed_m_s = speeds_m_s.fold(self.style.dark_speed_m_s, f64::max);
        let mut order: Vec<Leg> = Vec::with_capacity(left.len());
        while !left.is_empty() {
            let last = order.last().copied();
            let mut best = (f64::INFINITY, 0, 0);
            let mut look = |legs: &[Leg]| {
                for leg in legs {
                    let candidate = (self.between_s(last, Some(*leg)), place[leg.0], leg.1);
                    if candidate < best {
                        best = candidate;
                    }
                }
                best.0 * speed_m_s
            };
            match last {
                Some(last) => starts.around(self.way(last).end_m, look),
                None => {
                    for (stroke, ways) in self.ways.iter().enumerate() {
                        (0..ways.len()).for_each(|way| _ = look(&[(stroke, way)]));
                    }
                }
            }
            let (_, index, way) = best;
            let stroke = left.swap_remove(index);
            if let Some(moved) = left.get(index) {
                place[*moved] = index;
            }
            starts.remove(stroke, &self.ways[stroke]);
            order.push((stroke, way));
        }
        order
    }

    /// For each stroke the ones whose ends lie nearest to its own.
    fn neighbors(&self) -> Vec<Vec<usize>> {
        let ends: Vec<[Vector2<f64>; 2]> =
            self.ways.iter().map(|ways| [ways[0].start_m, ways[0].end_m]).collect();
        let apart = |a: usize, b: usize| {
            let pairs =
                ends[a].iter().flat_map(|p| ends[b].iter().map(move |q| (p - q).norm_squared()));
            pairs.fold(f64::INFINITY, f64::min)
        };
        let mut others: Vec<(f64, usize)> = Vec::with_capacity(ends.len());
        let neighbors = (0..ends.len()).map(|stroke| {
            others.clear();
            let all = (0..ends.len()).filter(|other| *other != stroke);
            others.extend(all.map(|other| (apart(stroke, other), other)));
            if others.len() > NEIGHBORS {
                others.select_nth_unstable_by(NEIGHBORS, |a, b| a.partial_cmp(b).expect("finite"));
                others.truncate(NEIGHBORS);
            }
            others.iter().map(|(_, other)| *other).collect()
        });
        neighbors.collect()
    }

    /// 2-opt and Or-opt until neither saves time.
    pub(super) fn improve(&self, legs: &mut Vec<Leg>) {
        let neighbors = self.neighbors();
        for _ in 0..MAX_ROUNDS {
            let before_s = self.total_s(legs);
            let mut place = vec![0; legs.len()];
            for (index, leg) in legs.iter().enumerate() {
                place[leg.0] = index;
            }
            for stroke in 0..self.ways.len() {
                for other in &neighbors[stroke] {
                    let (i, j) = (place[stroke], place[*other]);
                    let changed =
                        self.reverse_between(legs, i, j).or_else(|| self.put_beside(legs, i, j));
                    if let Some(changed) = changed {
                        for index in changed {
                            place[legs[index].0] = index;
                        }
                    }
                }
            }
            if self.total_s(legs) > before_s - 1e-9 {
                break;
            }
        }
    }

    /// 2-opt: reverses the run that brings the strokes at `i` and `j` side by side.
    fn reverse_between(&self, legs: &mut [Leg], i: usize, j: usize) -> Option<Range<usize>> {
        let (low, high) = (i.min(j), i.max(j));
        // Candidate runs: after `low` through `high`; `low` to before `high`; both included.
        let runs = [(low + 1, high), (low, high - 1), (low, high)];
        runs.into_iter().find_map(|(first, last)| {
            if first > last {
                return None;
            }
            let before = first.checked_sub(1).map(|k| legs[k]);
            let after = legs.get(last + 1).copied();
            let (head, tail) = (turned(legs[first]), turned(legs[last]));
            let old_s =
                self.between_s(before, Some(legs[first])) + self.between_s(Some(legs[last]), after);
            let new_s = self.between_s(before, Some(tail)) + self.between_s(Some(head), after);
            if new_s > old_s - 1e-9 {
                return None;
            }
            legs[first..=last].reverse();
            legs[first..=last].iter_mut().for_each(|leg| *leg = turned(*leg));
            Some(first..last + 1)
        })
    }

    /// Or-opt: moves a short run that begins at `i` next to the stroke at `j`, forward or backward.
    fn put_beside(&self, legs: &mut Vec<Leg>, i: usize, j: usize) -> Option<Range<usize>> {
        for length in 1..=MAX_RUN.min(legs.len() - i) {
            if (i..i + length).contains(&j) {
                break;
            }
            let run: Vec<Leg> = legs[i..i + length].to_vec();
            let before = i.checked_sub(1).map(|k| legs[k]);
            let after = legs.get(i + length).copied();
            let (first, last) = (Some(run[0]), Some(run[length - 1]));
            let saved_s = self.between_s(before, first) + self.between_s(last, after)
                - self.between_s(before, after);
            // `gap` is an insertion index in the unchanged order.
            for gap in [j, j + 1] {
                if (i..=i + length).contains(&gap) {
                    continue;
                }
                let left = gap.checked_sub(1).map(|k| legs[k]);
                let right = legs.get(gap).copied();
                let opened_s = saved_s + self.between_s(left, right);
                let backward: Vec<Leg> = run.iter().rev().map(|leg| turned(*leg)).collect();
                for run in [run.clone(), backward] {
                    let (first, last) = (Some(run[0]), Some(run[length - 1]));
                    let cost_s = self.between_s(left, first) + self.between_s(last, right);
                    if cost_s < opened_s - 1e-9 {
                        legs.drain(i..i + length);
                        let gap = if gap > i { gap - length } else { gap };
                        legs.splice(gap..gap, run);
                        return Some(i.min(gap)..(i.max(gap) + length));
                    }
                }
            }
        }
        None
    }
}

/// The same stroke backward.
fn turned((stroke, way): Leg) -> Leg {
    (stroke, way ^ 1)
}
