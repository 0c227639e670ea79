//! Order: which stroke after which, and which way round, so that the least time is dark.
//!
//! The time of a dark way is that of its plan in a small word; else it is estimated as that of the slower axis of a double integrator, from the
//! velocity at one stroke's end to that at the next one's start, with take-off below the first
//! stroke and landing below the last. It is the same backward, so that a reversed run of strokes
//! costs the same inside.
//!
//! Up to [`EXACT_STROKES`] strokes: dynamic programming over subsets (Held, Karp 1962; Bellman
//! 1962). Beyond: the nearest stroke next, then 2-opt (Croes 1958) and Or-opt (Or 1976) with turned
//! strokes among near neighbours until nothing gets better, then the best ways for that order.

use nalgebra::Vector2;

use super::PlanOptions;
use super::even::TICK_S;
use super::motion::Moment;
use super::pen::Way;
use super::transit::Transit;

/// Strokes up to which the order is the best one of all.
pub(super) const EXACT_STROKES: usize = 10;
/// Ways of all strokes together up to which dark ways are planned to know their time.
const MEASURED_WAYS: usize = 24;
/// Strokes that are tried next to each.
const NEIGHBORS: usize = 8;
/// Rounds of improvement, a bound that no drawing has reached.
const MAX_ROUNDS: usize = 30;
/// Longest run of strokes that is put elsewhere.
const MAX_RUN: usize = 3;

/// A stroke and the way it is drawn.
pub(super) type Leg = (usize, usize);

/// The order of strokes, each with its ways, that takes the least time in the dark.
pub(super) fn shortest(ways: &[Vec<Way>], options: &PlanOptions) -> Vec<Leg> {
    if ways.len() <= EXACT_STROKES {
        let few = ways.iter().map(Vec::len).sum::<usize>() <= MEASURED_WAYS;
        let clock = if few { Clock::Measured } else { Clock::Estimated };
        return Dark { ways, options, clock }.exact();
    }
    let dark = Dark { ways, options, clock: Clock::Estimated };
    let mut legs = dark.nearest();
    dark.improve(&mut legs);
    dark.best_ways(&legs)
}

/// How the time of a dark way is told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Clock {
    /// By a double integrator.
    Estimated,
    /// By planning it.
    Measured,
}

/// Time in the dark.
struct Dark<'a> {
    ways: &'a [Vec<Way>],
    options: &'a PlanOptions,
    clock: Clock,
}

impl Dark<'_> {
    fn way(&self, leg: Leg) -> &Way {
        &self.ways[leg.0][leg.1]
    }

    /// Between two strokes; from or to the floor where there is none.
    fn between_s(&self, from: Option<Leg>, to: Option<Leg>) -> f64 {
        let still = Vector2::zeros();
        match (from.map(|leg| self.way(leg)), to.map(|leg| self.way(leg))) {
            (Some(a), Some(b)) => self.way_s(b.start_m - a.end_m, a.end_m_s, b.start_m_s),
            (None, Some(b)) => self.way_s(Vector2::new(0.0, b.start_m.y), still, b.start_m_s),
            (Some(a), None) => self.way_s(Vector2::new(0.0, -a.end_m.y), a.end_m_s, still),
            (None, None) => 0.0,
        }
    }

    fn way_s(&self, way_m: Vector2<f64>, from: Vector2<f64>, to: Vector2<f64>) -> f64 {
        if self.clock == Clock::Measured {
            let moment = |position_m: Vector2<f64>, velocity_m_s: Vector2<f64>| Moment {
                position_m,
                velocity_m_s,
                ..Moment::default()
            };
            let (from, to) = (moment(Vector2::zeros(), from), moment(way_m, to));
            let transit = Transit::new(&from, &to, self.options, TICK_S);
            return transit.map_or(f64::INFINITY, |transit| transit.duration_s());
        }
        let limit = self.options.even_style().acceleration_m_s2 * std::f64::consts::FRAC_1_SQRT_2;
        let axis = |i: usize| {
            axis_s(way_m[i], from[i], to[i], self.options.even_style().dark_speed_m_s, limit)
        };
        axis(0).max(axis(1))
    }

    fn total_s(&self, legs: &[Leg]) -> f64 {
        let ends = |leg: Option<&Leg>| leg.copied();
        let inner: f64 =
            legs.windows(2).map(|pair| self.between_s(Some(pair[0]), Some(pair[1]))).sum();
        inner + self.between_s(None, ends(legs.first())) + self.between_s(ends(legs.last()), None)
    }

    /// Held and Karp: the best way to have drawn each set of strokes, ending with each way.
    fn exact(&self) -> Vec<Leg> {
        let legs: Vec<Leg> = (0..self.ways.len())
            .flat_map(|stroke| (0..self.ways[stroke].len()).map(move |way| (stroke, way)))
            .collect();
        let (n, all) = (legs.len(), (1_usize << self.ways.len()) - 1);
        let mut best = vec![(f64::INFINITY, usize::MAX); (all + 1) * n];
        let between: Vec<f64> = legs
            .iter()
            .flat_map(|a| legs.iter().map(|b| self.between_s(Some(*a), Some(*b))))
            .collect();
        for (last, leg) in legs.iter().enumerate() {
            best[(1 << leg.0) * n + last] = (self.between_s(None, Some(*leg)), usize::MAX);
        }
        for set in 1..=all {
            for last in 0..n {
                let (so_far_s, _) = best[set * n + last];
                if so_far_s.is_infinite() {
                    continue;
                }
                for (next, leg) in legs.iter().enumerate() {
                    if set & (1 << leg.0) == 0 {
                        let with = so_far_s + between[last * n + next];
                        let entry = &mut best[(set | (1 << leg.0)) * n + next];
                        if with < entry.0 {
                            *entry = (with, last);
                        }
                    }
                }
            }
        }
        let whole = |last: usize| best[all * n + last].0 + self.between_s(Some(legs[last]), None);
        let last = (0..n).min_by(|a, b| whole(*a).total_cmp(&whole(*b)));
        let (mut set, mut at) = (all, last.unwrap_or(usize::MAX));
        let mut order = Vec::new();
        while at != usize::MAX {
            order.push(legs[at]);
            let before = best[set * n + at].1;
            set &= !(1 << legs[at].0);
            at = before;
        }
        order.reverse();
        order
    }

    /// From the floor always to what is nearest in time.
    fn nearest(&self) -> Vec<Leg> {
        let mut left: Vec<usize> = (0..self.ways.len()).collect();
        let mut order: Vec<Leg> = Vec::with_capacity(left.len());
        while !left.is_empty() {
            let last = order.last().copied();
            let mut best = (f64::INFINITY, 0, (0, 0));
            for (index, stroke) in left.iter().enumerate() {
                for way in 0..self.ways[*stroke].len() {
                    let dark_s = self.between_s(last, Some((*stroke, way)));
                    if dark_s < best.0 {
                        best = (dark_s, index, (*stroke, way));
                    }
                }
            }
            left.swap_remove(best.1);
            order.push(best.2);
        }
        order
    }

    /// For each stroke those whose ends lie nearest to its own.
    fn neighbors(&self) -> Vec<Vec<usize>> {
        let ends: Vec<[Vector2<f64>; 2]> =
            self.ways.iter().map(|ways| [ways[0].start_m, ways[0].end_m]).collect();
        let apart = |a: usize, b: usize| {
            let pairs =
                ends[a].iter().flat_map(|p| ends[b].iter().map(move |q| (p - q).norm_squared()));
            pairs.fold(f64::INFINITY, f64::min)
        };
        let of = |stroke: usize| {
            let others = (0..ends.len()).filter(|other| *other != stroke);
            let mut others: Vec<(f64, usize)> =
                others.map(|other| (apart(stroke, other), other)).collect();
            if others.len() > NEIGHBORS {
                others.select_nth_unstable_by(NEIGHBORS, |a, b| a.partial_cmp(b).expect("finite"));
                others.truncate(NEIGHBORS);
            }
            others.into_iter().map(|(_, other)| other).collect()
        };
        (0..ends.len()).map(of).collect()
    }

    fn improve(&self, legs: &mut Vec<Leg>) {
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

    /// 2-opt: turns round the run that brings the strokes at `i` and `j` side by side.
    fn reverse_between(
        &self,
        legs: &mut [Leg],
        i: usize,
        j: usize,
    ) -> Option<std::ops::Range<usize>> {
        let (low, high) = (i.min(j), i.max(j));
        // Behind the lower one or up to before the higher one, or either with both.
        let runs = [(low + 1, high), (low, high - 1), (low, high)];
        runs.into_iter().find_map(|(first, last)| {
            if first > last {
                return None;
            }
            let before = first.checked_sub(1).map(|k| legs[k]);
            let after = legs.get(last + 1).copied();
            let (head, tail) = (self.turned(legs[first])?, self.turned(legs[last])?);
            let old_s =
                self.between_s(before, Some(legs[first])) + self.between_s(Some(legs[last]), after);
            let new_s = self.between_s(before, Some(tail)) + self.between_s(Some(head), after);
            if new_s > old_s - 1e-9 {
                return None;
            }
            legs[first..=last].reverse();
            for leg in &mut legs[first..=last] {
                *leg = self.turned(*leg).expect("all have two ways or none");
            }
            Some(first..last + 1)
        })
    }

    /// Or-opt: puts a short run that begins at `i` behind or before the stroke at `j`, either way
    /// round.
    fn put_beside(
        &self,
        legs: &mut Vec<Leg>,
        i: usize,
        j: usize,
    ) -> Option<std::ops::Range<usize>> {
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
            // Gap after index `gap - 1`, in the order as it stands.
            for gap in [j, j + 1] {
                if (i..=i + length).contains(&gap) {
                    continue;
                }
                let left = gap.checked_sub(1).map(|k| legs[k]);
                let right = legs.get(gap).copied();
                let opened_s = saved_s + self.between_s(left, right);
                let turned: Option<Vec<Leg>> =
                    run.iter().rev().map(|leg| self.turned(*leg)).collect();
                for run in [Some(run.clone()), turned].into_iter().flatten() {
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

    /// The same stroke backward; `None` where it may not be turned.
    fn turned(&self, leg: Leg) -> Option<Leg> {
        (self.ways[leg.0].len() > 1).then_some((leg.0, leg.1 ^ 1))
    }

    /// The best ways for an order: a shortest path through the ways.
    fn best_ways(&self, legs: &[Leg]) -> Vec<Leg> {
        let mut layers: Vec<Vec<(f64, usize)>> = Vec::with_capacity(legs.len());
        for (index, leg) in legs.iter().enumerate() {
            let ways = 0..self.ways[leg.0].len();
            let layer = ways.map(|way| {
                let to = Some((leg.0, way));
                let Some(from) = index.checked_sub(1).map(|k| legs[k].0) else {
                    return (self.between_s(None, to), 0);
                };
                let through =
                    layers[index - 1].iter().enumerate().map(|(before, (so_far_s, _))| {
                        (so_far_s + self.between_s(Some((from, before)), to), before)
                    });
                through.min_by(|a, b| a.0.total_cmp(&b.0)).expect("every stroke has a way")
            });
            layers.push(layer.collect());
        }
        let mut chosen = Vec::with_capacity(legs.len());
        let mut next: Option<usize> = None;
        for (index, leg) in legs.iter().enumerate().rev() {
            let way = next.unwrap_or_else(|| {
                let end =
                    |way: &usize| layers[index][*way].0 + self.between_s(Some((leg.0, *way)), None);
                let ways = 0..layers[index].len();
                ways.min_by(|a, b| end(a).total_cmp(&end(b))).expect("every stroke has a way")
            });
            chosen.push((leg.0, way));
            next = Some(layers[index][way].1);
        }
        chosen.reverse();
        chosen
    }
}

/// Least time of a point on an axis that goes a way from one speed to another with bounded speed
/// and acceleration.
fn axis_s(way_m: f64, from_m_s: f64, to_m_s: f64, speed_m_s: f64, limit_m_s2: f64) -> f64 {
    let direct_m = 0.5 * (from_m_s + to_m_s) * (to_m_s - from_m_s).abs() / limit_m_s2;
    let sign = if way_m >= direct_m { 1.0 } else { -1.0 };
    let (d, v, w) = (way_m * sign, from_m_s * sign, to_m_s * sign);
    let squares = 0.5 * (v * v + w * w);
    let peak = (limit_m_s2 * d + squares).max(0.0).sqrt();
    if peak <= speed_m_s {
        return ((2.0 * peak - v - w) / limit_m_s2).max(0.0);
    }
    let cruise_m = d - (speed_m_s * speed_m_s - squares) / limit_m_s2;
    (2.0 * speed_m_s - v - w) / limit_m_s2 + cruise_m.max(0.0) / speed_m_s
}

#[cfg(test)]
mod tests {
    use crate::plan::EvenStyle;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::plan::Order;
    use crate::plan::pen::PenStroke;

    fn drawing(n: usize, seed: u64) -> Vec<Vec<Way>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut point = || {
            let x = rng.random_range(0.0..2.0);
            Vector2::new(x, rng.random_range(0.5..1.5))
        };
        let options = PlanOptions::even();
        let strokes = (0..n).map(|letter| PenStroke { letter, points_m: vec![point(), point()] });
        strokes.map(|stroke| stroke.ways(&options)).collect()
    }

    /// The least time over all orders and ways, by trying them all.
    fn brute(dark: &Dark<'_>, done: &mut Vec<Leg>, best: &mut f64) {
        if done.len() == dark.ways.len() {
            *best = best.min(dark.total_s(done));
            return;
        }
        for stroke in 0..dark.ways.len() {
            if done.iter().all(|leg| leg.0 != stroke) {
                for way in 0..dark.ways[stroke].len() {
                    done.push((stroke, way));
                    brute(dark, done, best);
                    done.pop();
                }
            }
        }
    }

    #[test]
    fn the_order_of_a_small_word_is_the_best_of_all() {
        let options = PlanOptions::even();
        for seed in 0..5 {
            let ways = drawing(5, seed);
            let dark = Dark { ways: &ways, options: &options, clock: Clock::Estimated };
            let mut best = f64::INFINITY;
            brute(&dark, &mut Vec::new(), &mut best);
            let found = dark.total_s(&dark.exact());
            assert!((found - best).abs() < 1e-9, "seed {seed}: {found} instead of {best}");
        }
    }

    #[test]
    fn the_heuristic_comes_near_the_best_and_draws_each_stroke_once() {
        let options = PlanOptions::even();
        for seed in 0..8 {
            let ways = drawing(9, seed);
            let dark = Dark { ways: &ways, options: &options, clock: Clock::Estimated };
            let best = dark.total_s(&dark.exact());
            let mut legs = dark.nearest();
            dark.improve(&mut legs);
            let found = dark.total_s(&dark.best_ways(&legs));
            assert!(found < 1.1 * best && found >= best - 1e-9, "{found} against {best}");
            let mut seen: Vec<usize> = legs.iter().map(|leg| leg.0).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..9).collect::<Vec<_>>());
        }
    }

    #[test]
    fn two_thousand_strokes_come_out_far_shorter_than_as_drawn() {
        let options = PlanOptions::even();
        let ways = drawing(2000, 7);
        let dark = Dark { ways: &ways, options: &options, clock: Clock::Estimated };
        let drawn: Vec<Leg> = (0..2000).map(|stroke| (stroke, 0)).collect();
        let found = shortest(&ways, &options);
        let (found_s, drawn_s) = (dark.total_s(&found), dark.total_s(&drawn));
        assert!(found_s < 0.45 * drawn_s, "{found_s} s of {drawn_s} s");
        let turned =
            PlanOptions::even_with(EvenStyle { order: Order::Drawn, ..EvenStyle::default() });
        assert_eq!(turned.even_style().order, Order::Drawn);
    }

    #[test]
    fn an_axis_takes_the_time_of_the_textbook() {
        assert!((axis_s(1.0, 0.0, 0.0, 9.0, 4.0) - 1.0).abs() < 1e-12, "2 sqrt(d/a)");
        assert!((axis_s(-1.0, 0.0, 0.0, 1.0, 4.0) - 1.25).abs() < 1e-12, "d/v + v/a");
        assert!((axis_s(0.5, 1.0, 0.0, 9.0, 1.0) - 1.0).abs() < 1e-12, "braking alone");
        assert!((axis_s(0.0, 1.0, -1.0, 9.0, 2.0) - 1.0).abs() < 1e-12, "turning back");
        let (there, back) = (axis_s(0.3, 0.2, -0.1, 1.0, 2.0), axis_s(-0.3, 0.1, -0.2, 1.0, 2.0));
        assert!((there - back).abs() < 1e-12, "the same backward: {there} {back}");
    }
}
