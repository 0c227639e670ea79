//! Order and direction of strokes with the least time in the dark.
//!
//! In a small word the duration of a transit is that of its plan. Otherwise it is estimated as the
//! slower axis of a double integrator, from the velocity at one stroke's end to that at the next
//! one's start. The estimate is the same backward, so that a reversed run of strokes costs the same
//! inside.
//!
//! Up to [`EXACT_STROKES`] strokes: dynamic programming over subsets (Held and Karp 1962, Bellman
//! 1962). Beyond: the nearest stroke next, then local search ([`search`]), then the best directions
//! for that order.

use nalgebra::Vector2;
use rayon::prelude::*;

use super::motion::State;
use super::pen::{PenStroke, Way, pen_strokes};
use super::transit::Transit;
use super::{EvenStyle, Order};
use noctograph_core::crazyflie::RING_TICK_S;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::table::{FLIGHT_LONG, MAX_DURATION_S};
use noctograph_core::strokes::{StrokeOrder, Strokes};

mod search;

/// Most strokes whose order is the optimum.
const EXACT_STROKES: usize = 10;
/// Greatest number of ways of all strokes for which exact transits are planned.
const MEASURED_WAYS: usize = 24;
/// Most strokes of a drawing: its order is sought among all pairs.
const MAX_STROKES: usize = 10_000;

/// Cost of a step to another letter in reading order, s: more than any transit within a word, so
/// that an order from one end to the other, with one step a letter, is the cheapest.
const LETTER_S: f64 = 1000.0;
/// How much longer the order of reading may take, as a fraction of the shortest flight.
const LONGER: f64 = 0.1;
/// Number of transits sampled to estimate the time of many strokes, and the guaranteed fraction of
/// the estimate.
const MEASURED_TRANSITS: usize = 500;
const GUARANTEED: f64 = 0.85;
/// Advice for drawings that take too long.
pub(super) const SHORTER: &str = "raise plan.stroke_speed_m_s or plan.style.dark_speed_m_s, or draw \
                                  fewer strokes, or smaller";

/// A stroke and the way it is drawn.
type Visit = (usize, usize);

/// The strokes of a drawing in the order and direction in which they are flown. Handwriting keeps
/// the writer's.
pub(super) fn in_order(
    strokes: &Strokes,
    speed_m_s: f64,
    style: &EvenStyle,
) -> Result<Vec<PenStroke>> {
    let drawn = as_drawn(strokes, speed_m_s)?;
    let flown = match style.order {
        _ if is_kept(strokes, style) => drawn,
        Order::Reading => as_read(&drawn, speed_m_s, style),
        Order::Shortest | Order::Drawn => shortest(&drawn, speed_m_s, style),
    };
    check_duration(&flown, speed_m_s, style)?;
    Ok(flown)
}

/// Refuses many strokes that take far too long, judged by a sample of their transits: to plan each
/// one is most of the work of a plan.
fn check_duration(flown: &[PenStroke], speed_m_s: f64, style: &EvenStyle) -> Result<()> {
    let n = flown.len();
    if n < 2 * MEASURED_TRANSITS {
        return Ok(());
    }
    // The time of all transits, from an even sample of them.
    let stride = n.div_ceil(MEASURED_TRANSITS);
    let ways = ways_of(flown, speed_m_s);
    let tour = Tour { ways: &ways, style, measured: true, letters: &[] };
    let transits = (1..n).step_by(stride);
    let transit_s = transits.map(|to| tour.between_s(Some((to - 1, 0)), Some((to, 0))));
    let dark_s = stride as f64 * transit_s.filter(|dark_s| dark_s.is_finite()).sum::<f64>();
    let flight_s = all_lit_s(flown, speed_m_s) + dark_s;
    if GUARANTEED * flight_s <= MAX_DURATION_S {
        return Ok(());
    }
    let problem =
        format!("{n} strokes take some {flight_s:.0} s, the longest flight is {MAX_DURATION_S} s");
    Err(Error::infeasible(problem, SHORTER).coded(FLIGHT_LONG))
}

fn ways_of(strokes: &[PenStroke], speed_m_s: f64) -> Vec<Vec<Way>> {
    strokes.iter().map(|stroke| stroke.ways(speed_m_s)).collect()
}

fn all_lit_s(strokes: &[PenStroke], speed_m_s: f64) -> f64 {
    strokes.iter().map(|stroke| stroke.lit_s(speed_m_s)).sum()
}

/// True if strokes keep their order and direction.
pub(super) fn is_kept(strokes: &Strokes, style: &EvenStyle) -> bool {
    style.order == Order::Drawn || strokes.order == StrokeOrder::Kept
}

/// The strokes as they were drawn.
pub(super) fn as_drawn(strokes: &Strokes, speed_m_s: f64) -> Result<Vec<PenStroke>> {
    let drawn = pen_strokes(strokes);
    if drawn.is_empty() {
        let hint = "write letters that leave light";
        return Err(Error::input("drawing", "no lit stroke", "at least one", hint));
    }
    // Both limits are checked before an order is sought, whose time grows with the square.
    let (n, lit_s) = (drawn.len(), all_lit_s(&drawn, speed_m_s));
    let (problem, hint) = if n > MAX_STROKES {
        (
            format!("{n} strokes, more than {MAX_STROKES}, are too many for a flight"),
            "draw fewer strokes, or lower letters.detail",
        )
    } else if lit_s > MAX_DURATION_S {
        (
            format!(
                "{n} strokes are lit for {lit_s:.0} s in all, the longest flight is {MAX_DURATION_S} s"
            ),
            "raise plan.stroke_speed_m_s, or draw less, or smaller",
        )
    } else {
        return Ok(drawn);
    };
    Err(Error::infeasible(problem, hint).coded(FLIGHT_LONG))
}

/// Strokes in the order and direction with the least time in the dark.
pub(super) fn shortest(drawn: &[PenStroke], speed_m_s: f64, style: &EvenStyle) -> Vec<PenStroke> {
    along(drawn, shortest_tour(&ways_of(drawn, speed_m_s), style, &[]))
}

fn along(drawn: &[PenStroke], visits: Vec<Visit>) -> Vec<PenStroke> {
    visits.into_iter().map(|(stroke, way)| drawn[stroke].along(way)).collect()
}

/// Strokes letter by letter from the first, if that takes little longer than the least time.
fn as_read(drawn: &[PenStroke], speed_m_s: f64, style: &EvenStyle) -> Vec<PenStroke> {
    let ways = ways_of(drawn, speed_m_s);
    let letters: Vec<usize> = drawn.iter().map(|stroke| stroke.letter).collect();
    let tour = Tour { ways: &ways, style, measured: false, letters: &[] };
    let shortest = shortest_tour(&ways, style, &[]);
    let mut read = shortest_tour(&ways, style, &letters);
    // From the last letter to the first costs as much.
    if letters[read[0].0] > letters[read[read.len() - 1].0] {
        read.reverse();
        read = tour.best_ways(&read);
    }
    let lit_s = all_lit_s(drawn, speed_m_s);
    let least_s = lit_s + tour.total_s(&shortest);
    let is_little = lit_s + tour.total_s(&read) <= (1.0 + LONGER) * least_s;
    along(drawn, if is_little { read } else { shortest })
}

fn shortest_tour(ways: &[Vec<Way>], style: &EvenStyle, letters: &[usize]) -> Vec<Visit> {
    if ways.len() <= EXACT_STROKES {
        let measured = ways.iter().map(Vec::len).sum::<usize>() <= MEASURED_WAYS;
        return Tour { ways, style, measured, letters }.exact();
    }
    let tour = Tour { ways, style, measured: false, letters };
    let mut visits = tour.nearest();
    tour.improve(&mut visits);
    tour.best_ways(&visits)
}

/// Strokes, and the time in the dark between them.
struct Tour<'a> {
    ways: &'a [Vec<Way>],
    style: &'a EvenStyle,
    /// True if transits are planned, not estimated.
    measured: bool,
    /// The letter of each stroke if each letter is to be written before the next, or none.
    letters: &'a [usize],
}

impl Tour<'_> {
    fn way(&self, visit: Visit) -> &Way {
        &self.ways[visit.0][visit.1]
    }

    /// Time of the transit between two strokes, or from or to the floor, with the cost of a step to
    /// another letter.
    fn between_s(&self, from: Option<Visit>, to: Option<Visit>) -> f64 {
        let still = Vector2::zeros();
        match (from.map(|from| self.way(from)), to.map(|to| self.way(to))) {
            (Some(a), Some(b)) => {
                // The same both ways: written from the last letter to the first it costs as much.
                let letter = |visit: Option<Visit>| self.letters.get(visit?.0).copied();
                let apart = letter(from).zip(letter(to)).map_or(0, |(a, b)| a.abs_diff(b));
                let transit_s = self.transit_s(b.start_m - a.end_m, a.end_m_s, b.start_m_s);
                LETTER_S * apart as f64 + transit_s
            }
            (None, Some(b)) => self.transit_s(Vector2::new(0.0, b.start_m.y), still, b.start_m_s),
            (Some(a), None) => self.transit_s(Vector2::new(0.0, -a.end_m.y), a.end_m_s, still),
            (None, None) => 0.0,
        }
    }

    fn transit_s(&self, path_m: Vector2<f64>, from: Vector2<f64>, to: Vector2<f64>) -> f64 {
        if self.measured {
            let moving =
                |position_m, velocity_m_s| State { position_m, velocity_m_s, ..State::default() };
            let (from, to) = (moving(Vector2::zeros(), from), moving(path_m, to));
            let transit = Transit::new(&from, &to, self.style, RING_TICK_S);
            return transit.map_or(f64::INFINITY, |transit| transit.duration_s());
        }
        let limit = self.style.acceleration_m_s2 * std::f64::consts::FRAC_1_SQRT_2;
        let axis = |i: usize| axis_s(path_m[i], from[i], to[i], self.style.dark_speed_m_s, limit);
        axis(0).max(axis(1))
    }

    fn total_s(&self, visits: &[Visit]) -> f64 {
        let inner = visits.windows(2).map(|pair| self.between_s(Some(pair[0]), Some(pair[1])));
        inner.sum::<f64>()
            + self.between_s(None, visits.first().copied())
            + self.between_s(visits.last().copied(), None)
    }

    /// Held–Karp: the best order of each set of strokes that ends with each way.
    fn exact(&self) -> Vec<Visit> {
        let visits: Vec<Visit> = (0..self.ways.len())
            .flat_map(|stroke| (0..self.ways[stroke].len()).map(move |way| (stroke, way)))
            .collect();
        let (n, full) = (visits.len(), (1_usize << self.ways.len()) - 1);
        // Every transit once. Between two ways of one stroke nobody flies.
        let between_s = |a: &Visit, b: &Visit| match a.0 == b.0 {
            true => f64::INFINITY,
            false => self.between_s(Some(*a), Some(*b)),
        };
        let between: Vec<Vec<f64>> =
            visits.par_iter().map(|a| visits.iter().map(|b| between_s(a, b)).collect()).collect();
        // For each set of strokes (a bit each) and last visit: the least time, the visit before.
        let mut best = vec![(f64::INFINITY, usize::MAX); (full + 1) * n];
        for (last, visit) in visits.iter().enumerate() {
            best[(1 << visit.0) * n + last] = (self.between_s(None, Some(*visit)), usize::MAX);
        }
        // Sets in rising order: each one comes after those it is made of.
        for set in 1..=full {
            for last in 0..n {
                let (so_far_s, _) = best[set * n + last];
                if so_far_s.is_infinite() {
                    continue;
                }
                for (next, visit) in visits.iter().enumerate().filter(|v| set & (1 << v.1.0) == 0) {
                    let with = so_far_s + between[last][next];
                    let entry = &mut best[(set | (1 << visit.0)) * n + next];
                    if with < entry.0 {
                        *entry = (with, last);
                    }
                }
            }
        }
        // The best last visit, landing included.
        let total_s =
            |last: usize| best[full * n + last].0 + self.between_s(Some(visits[last]), None);
        let last = (0..n).min_by(|a, b| total_s(*a).total_cmp(&total_s(*b)));
        let (mut set, mut index) = (full, last.unwrap_or(usize::MAX));
        // Back along the visits before.
        let mut order = Vec::new();
        while index != usize::MAX {
            order.push(visits[index]);
            let before = best[set * n + index].1;
            set &= !(1 << visits[index].0);
            index = before;
        }
        order.reverse();
        order
    }

    /// The best directions for an order: a shortest path through layers of ways (Viterbi 1967).
    fn best_ways(&self, visits: &[Visit]) -> Vec<Visit> {
        // For each stroke and way: the least time so far, and the way of the stroke before.
        let mut layers: Vec<Vec<(f64, usize)>> = Vec::with_capacity(visits.len());
        for (index, (stroke, _)) in visits.iter().enumerate() {
            let ways = 0..self.ways[*stroke].len();
            let layer = ways.map(|way| {
                let to = Some((*stroke, way));
                let Some(from) = index.checked_sub(1).map(|before| visits[before].0) else {
                    return (self.between_s(None, to), 0);
                };
                let through =
                    layers[index - 1].iter().enumerate().map(|(before, (so_far_s, _))| {
                        (so_far_s + self.between_s(Some((from, before)), to), before)
                    });
                through.min_by(|a, b| a.0.total_cmp(&b.0)).expect("every stroke has two ways")
            });
            layers.push(layer.collect());
        }
        // Back from the best way of the last stroke, landing included.
        let (last, layer) = (visits[visits.len() - 1].0, &layers[visits.len() - 1]);
        let total_s = |way: usize| layer[way].0 + self.between_s(Some((last, way)), None);
        let best = (0..layer.len()).min_by(|a, b| total_s(*a).total_cmp(&total_s(*b)));
        let mut way = best.expect("every stroke has two ways");
        let mut chosen = Vec::with_capacity(visits.len());
        for ((stroke, _), layer) in visits.iter().zip(&layers).rev() {
            chosen.push((*stroke, way));
            way = layer[way].1;
        }
        chosen.reverse();
        chosen
    }
}

/// Least time over a distance on one axis, from one speed to another, with bounded speed and
/// acceleration.
fn axis_s(path_m: f64, from_m_s: f64, to_m_s: f64, speed_m_s: f64, limit_m_s2: f64) -> f64 {
    // Turned so that the acceleration comes before the braking.
    let direct_m = 0.5 * (from_m_s + to_m_s) * (to_m_s - from_m_s).abs() / limit_m_s2;
    let sign = if path_m >= direct_m { 1.0 } else { -1.0 };
    let (d, v, w) = (path_m * sign, from_m_s * sign, to_m_s * sign);
    // The peak p of a triangle of speeds: 2 a d = 2 p² − v² − w².
    let squares = 0.5 * (v * v + w * w);
    let peak = (limit_m_s2 * d + squares).max(0.0).sqrt();
    if peak <= speed_m_s {
        return ((2.0 * peak - v - w) / limit_m_s2).max(0.0);
    }
    // A trapezoid: the rest of the distance is flown at full speed.
    let cruise_m = d - (speed_m_s * speed_m_s - squares) / limit_m_s2;
    (2.0 * speed_m_s - v - w) / limit_m_s2 + cruise_m.max(0.0) / speed_m_s
}

#[cfg(test)]
mod tests {
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    use super::*;

    fn drawing(n: usize, seed: u64) -> Vec<Vec<Way>> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut point = || {
            let x = rng.random_range(0.0..2.0);
            Vector2::new(x, rng.random_range(0.5..1.5))
        };
        let strokes = (0..n).map(|letter| PenStroke::even(letter, vec![point(), point()]));
        strokes.map(|stroke| stroke.ways(0.2)).collect()
    }

    /// The least time over all orders and ways, by trying each.
    fn brute(tour: &Tour<'_>, done: &mut Vec<Visit>, best: &mut f64) {
        if done.len() == tour.ways.len() {
            *best = best.min(tour.total_s(done));
            return;
        }
        for stroke in 0..tour.ways.len() {
            if done.iter().all(|visit| visit.0 != stroke) {
                for way in 0..tour.ways[stroke].len() {
                    done.push((stroke, way));
                    brute(tour, done, best);
                    done.pop();
                }
            }
        }
    }

    /// Ten words, three of them with too many strokes for an exact order.
    #[test]
    fn words_are_written_as_they_are_read_where_it_costs_a_tenth_at_most() {
        let mut n_read = 0;
        let words = "NOOR Kenji Amara HELLO Łukasz Zoë IIII Jazz 2027 Willkommen";
        let font = "simplex".to_owned();
        let options = noctograph_letters::LetterOptions { font, ..Default::default() };
        for word in words.split(' ') {
            let strokes = noctograph_letters::write(word, &options).unwrap();
            let flown = |order| {
                let style = EvenStyle { order, ..EvenStyle::default() };
                let flown = in_order(&strokes, 0.2, &style).unwrap();
                let ways: Vec<_> = flown.iter().map(|stroke| stroke.ways(0.2)).collect();
                let tour = Tour { ways: &ways, style: &style, measured: true, letters: &[] };
                let visits: Vec<Visit> = (0..ways.len()).map(|stroke| (stroke, 0)).collect();
                let lit_s = all_lit_s(&flown, 0.2);
                let letters: Vec<usize> = flown.iter().map(|stroke| stroke.letter).collect();
                (letters, lit_s + tour.total_s(&visits))
            };
            let ((_, least_s), (letters, read_s)) = (flown(Order::Shortest), flown(Order::Reading));
            assert!(read_s <= 1.12 * least_s, "{word}: {read_s} s, {least_s} s at least");
            n_read += usize::from(letters.is_sorted());
        }
        assert!(n_read >= 9, "{n_read} of ten words are written as they are read");
    }

    #[test]
    fn the_order_of_a_small_word_is_the_optimum() {
        let style = EvenStyle::default();
        for seed in 0..5 {
            let ways = drawing(5, seed);
            let tour = Tour { ways: &ways, style: &style, measured: false, letters: &[] };
            let mut best = f64::INFINITY;
            brute(&tour, &mut Vec::new(), &mut best);
            let actual = tour.total_s(&tour.exact());
            assert!((actual - best).abs() < 1e-9, "seed {seed}: {actual} instead of {best}");
        }
    }

    #[test]
    fn the_heuristic_comes_near_the_optimum_and_draws_each_stroke_once() {
        let style = EvenStyle::default();
        for seed in 0..8 {
            let ways = drawing(9, seed);
            let tour = Tour { ways: &ways, style: &style, measured: false, letters: &[] };
            let best = tour.total_s(&tour.exact());
            let mut visits = tour.nearest();
            tour.improve(&mut visits);
            let actual = tour.total_s(&tour.best_ways(&visits));
            assert!(actual < 1.1 * best && actual >= best - 1e-9, "{actual} against {best}");
            let mut seen: Vec<usize> = visits.iter().map(|visit| visit.0).collect();
            seen.sort_unstable();
            assert_eq!(seen, (0..9).collect::<Vec<_>>());
        }
    }

    /// The order that always takes the nearest stroke next, without a bound.
    fn nearest_of_each(tour: &Tour<'_>) -> Vec<Visit> {
        let mut left: Vec<usize> = (0..tour.ways.len()).collect();
        let mut order: Vec<Visit> = Vec::new();
        while !left.is_empty() {
            let mut best = (f64::INFINITY, 0, (0, 0));
            for (index, stroke) in left.iter().enumerate() {
                for way in 0..tour.ways[*stroke].len() {
                    let dark_s = tour.between_s(order.last().copied(), Some((*stroke, way)));
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

    #[test]
    fn no_stroke_that_the_bound_leaves_out_is_the_nearest() {
        let style = EvenStyle::default();
        let square = |n: i32, step: f64| {
            let point =
                |i: i32| Vector2::new(f64::from(i % n) * step, 0.5 + f64::from(i / n) * step);
            let dash = |i| PenStroke::even(0, vec![point(i), point(i) + Vector2::new(0.002, 0.0)]);
            (0..n * n).map(|i| dash(i).ways(0.2)).collect::<Vec<_>>()
        };
        let row = (0..40).map(f64::from).map(|x| Vector2::new(x, 1.0));
        let row = row
            .map(|point| PenStroke::even(0, vec![point, point + Vector2::new(0.5, 0.0)]).ways(0.2));
        // Dashes on a square grid are near in many equal ways.
        for ways in [drawing(300, 1), drawing(61, 2), square(12, 0.05), row.collect()] {
            let tour = Tour { ways: &ways, style: &style, measured: false, letters: &[] };
            assert_eq!(tour.nearest(), nearest_of_each(&tour));
        }
    }

    #[test]
    fn two_thousand_strokes_take_less_than_half_the_time_of_their_drawn_order() {
        let style = EvenStyle::default();
        let ways = drawing(2000, 7);
        let tour = Tour { ways: &ways, style: &style, measured: false, letters: &[] };
        let drawn: Vec<Visit> = (0..2000).map(|stroke| (stroke, 0)).collect();
        let actual = shortest_tour(&ways, &style, &[]);
        let (found_s, drawn_s) = (tour.total_s(&actual), tour.total_s(&drawn));
        assert!(found_s < 0.45 * drawn_s, "{found_s} s of {drawn_s} s");
    }

    #[test]
    fn many_strokes_are_refused_by_a_part_of_their_transits_and_dots_count() {
        let style = EvenStyle::default();
        fn row(n: u32, apart_m: f64) -> Vec<PenStroke> {
            let point = |k: u32| Vector2::new(apart_m * f64::from(k), 1.0);
            (0..n).map(|k| PenStroke::even(0, vec![point(k)])).collect()
        }
        check_duration(&row(3000, 0.01), 0.2, &style).unwrap();
        let error = check_duration(&row(3000, 1.0), 0.2, &style).unwrap_err().to_string();
        assert!(error.contains("3000 strokes take some"), "{error}");
        assert!((all_lit_s(&row(1, 0.0), 0.2) - 0.2).abs() < 1e-12, "a dot's light");
    }

    #[test]
    fn one_axis_takes_the_textbook_time() {
        assert!((axis_s(1.0, 0.0, 0.0, 9.0, 4.0) - 1.0).abs() < 1e-12, "2 sqrt(d/a)");
        assert!((axis_s(-1.0, 0.0, 0.0, 1.0, 4.0) - 1.25).abs() < 1e-12, "d/v + v/a");
        assert!((axis_s(0.5, 1.0, 0.0, 9.0, 1.0) - 1.0).abs() < 1e-12, "braking alone");
        assert!((axis_s(0.0, 1.0, -1.0, 9.0, 2.0) - 1.0).abs() < 1e-12, "turning back");
        let (there, back) = (axis_s(0.3, 0.2, -0.1, 1.0, 2.0), axis_s(-0.3, 0.1, -0.2, 1.0, 2.0));
        assert!((there - back).abs() < 1e-12, "the same backward: {there} {back}");
    }
}
