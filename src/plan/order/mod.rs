//! Order and direction of strokes with the least time in the dark.
//!
//! For a small word, every transit is planned to determine its duration. For other drawings, the
//! duration is estimated by a double integrator on the slower axis, from the velocity at one
//! stroke's end to that at the next stroke's start. The estimate is the same in both directions, so
//! reversing a run of strokes does not change the cost within it.
//!
//! For up to [`EXACT_STROKES`] strokes, the method is dynamic programming over subsets (Held and
//! Karp 1962, Bellman 1962). For more strokes, a nearest-neighbor tour is improved by local search
//! ([`search`]) and then receives the best directions.

use nalgebra::Vector2;
use noctograph_core::parallel::prelude::*;

use super::motion::State;
use super::pen::{PenStroke, Way, pen_strokes};
use super::transit::Transit;
use super::{EvenStyle, Order};
use noctograph_core::crazyflie::RING_TICK_S;
use noctograph_core::error::{Error, Result};
use noctograph_core::flight::table::{FLIGHT_LONG, MAX_DURATION_S};
use noctograph_core::strokes::{StrokeOrder, Strokes};

mod search;

/// Maximum number of strokes for which the optimal order is computed.
const EXACT_STROKES: usize = 10;
/// Maximum total number of ways to draw all strokes up to which transits are planned exactly.
const MAX_PLANNED_WAYS: usize = 24;
/// Maximum number of strokes in a drawing. The search for their order compares all pairs.
const MAX_STROKES: usize = 10_000;

/// Cost in s of a step to another letter in reading order. Because it exceeds any transit within a
/// word, the cheapest order goes from one end of the word to the other with one step per letter.
const LETTER_S: f64 = 1000.0;
/// Maximum extra flight time for drawing in reading order, as a fraction of the shortest flight's
/// duration.
const READING_EXCESS: f64 = 0.1;
/// Number of transits sampled to estimate the duration of many strokes, and the fraction of the
/// estimate that is a safe lower bound.
const SAMPLED_TRANSITS: usize = 500;
const CERTAIN_FRACTION: f64 = 0.85;
/// Hint for drawings that take too long.
pub(super) const TOO_LONG_HINT: &str = "raise plan.stroke_speed_m_s or plan.style.dark_speed_m_s, or draw \
                                  fewer or smaller strokes";

/// Index of a stroke, and index of the way to draw it.
type Visit = (usize, usize);

/// Returns the strokes of a drawing in the order and direction in which they are flown. Handwriting
/// keeps the writer's order and direction. Returns the errors of [`as_drawn`] and
/// [`check_duration`].
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

/// Returns [`Error::Infeasible`] early if many strokes certainly take longer than the longest
/// flight. The duration is estimated from a sample of transits, because planning all of them is
/// most of the work.
fn check_duration(flown: &[PenStroke], speed_m_s: f64, style: &EvenStyle) -> Result<()> {
    let n_strokes = flown.len();
    if n_strokes < 2 * SAMPLED_TRANSITS {
        return Ok(());
    }
    // The time of all transits is extrapolated from an even sample.
    let stride = n_strokes.div_ceil(SAMPLED_TRANSITS);
    let ways = ways_of(flown, speed_m_s);
    let tour = Tour { ways: &ways, style, is_planned: true, letters: &[] };
    let transits = (1..n_strokes).step_by(stride);
    let transit_s = transits.map(|to| tour.between_s(Some((to - 1, 0)), Some((to, 0))));
    let dark_s = stride as f64 * transit_s.filter(|dark_s| dark_s.is_finite()).sum::<f64>();
    let flight_s = all_lit_s(flown, speed_m_s) + dark_s;
    if CERTAIN_FRACTION * flight_s <= MAX_DURATION_S {
        return Ok(());
    }
    let problem = format!(
        "{n_strokes} strokes take about {flight_s:.0} s, but a flight may last at most \
         {MAX_DURATION_S} s"
    );
    Err(Error::infeasible(problem, TOO_LONG_HINT).coded(FLIGHT_LONG))
}

/// Returns the ways in which each stroke can be drawn.
fn ways_of(strokes: &[PenStroke], speed_m_s: f64) -> Vec<Vec<Way>> {
    strokes.iter().map(|stroke| stroke.ways(speed_m_s)).collect()
}

/// Returns the total time in s for which strokes are lit.
fn all_lit_s(strokes: &[PenStroke], speed_m_s: f64) -> f64 {
    strokes.iter().map(|stroke| stroke.lit_s(speed_m_s)).sum()
}

/// True if the strokes keep their order and direction.
pub(super) fn is_kept(strokes: &Strokes, style: &EvenStyle) -> bool {
    style.order == Order::Drawn || strokes.order == StrokeOrder::Kept
}

/// Returns the strokes in the order of the drawing. Returns an error if there are none or too many,
/// or if they are lit for longer than the longest flight.
pub(super) fn as_drawn(strokes: &Strokes, speed_m_s: f64) -> Result<Vec<PenStroke>> {
    let drawn = pen_strokes(strokes);
    if drawn.is_empty() {
        let hint = "write letters with strokes";
        return Err(Error::input("drawing", "no lit stroke", "at least one", hint));
    }
    // Both limits are checked before the search for the order, whose time grows with the square of
    // the number of strokes.
    let (n_strokes, lit_s) = (drawn.len(), all_lit_s(&drawn, speed_m_s));
    let (problem, hint) = if n_strokes > MAX_STROKES {
        (
            format!("{n_strokes} strokes, more than {MAX_STROKES}, are too many for a flight"),
            "draw fewer strokes, or lower letters.detail",
        )
    } else if lit_s > MAX_DURATION_S {
        (
            format!(
                "{n_strokes} strokes are lit for {lit_s:.0} s in total, but a flight may last at \
                 most {MAX_DURATION_S} s"
            ),
            "raise plan.stroke_speed_m_s, or draw fewer or smaller strokes",
        )
    } else {
        return Ok(drawn);
    };
    Err(Error::infeasible(problem, hint).coded(FLIGHT_LONG))
}

/// Returns the strokes in the order and direction with the least time in the dark.
pub(super) fn shortest(drawn: &[PenStroke], speed_m_s: f64, style: &EvenStyle) -> Vec<PenStroke> {
    along(drawn, shortest_tour(&ways_of(drawn, speed_m_s), style, &[]))
}

/// Returns the visited strokes in the order and direction of a tour.
fn along(drawn: &[PenStroke], visits: Vec<Visit>) -> Vec<PenStroke> {
    visits.into_iter().map(|(stroke, way)| drawn[stroke].along(way)).collect()
}

/// Returns the strokes letter by letter in reading order, or in the shortest order if that saves
/// more than [`READING_EXCESS`] of its duration.
fn as_read(drawn: &[PenStroke], speed_m_s: f64, style: &EvenStyle) -> Vec<PenStroke> {
    let ways = ways_of(drawn, speed_m_s);
    let letters: Vec<usize> = drawn.iter().map(|stroke| stroke.letter).collect();
    let tour = Tour { ways: &ways, style, is_planned: false, letters: &[] };
    let shortest = shortest_tour(&ways, style, &[]);
    let mut read = shortest_tour(&ways, style, &letters);
    // The cost is the same in both directions, so the tour may begin at the last letter.
    if letters[read[0].0] > letters[read[read.len() - 1].0] {
        read.reverse();
        read = tour.best_ways(&read);
    }
    let lit_s = all_lit_s(drawn, speed_m_s);
    let least_s = lit_s + tour.total_s(&shortest);
    let is_fast = lit_s + tour.total_s(&read) <= (1.0 + READING_EXCESS) * least_s;
    along(drawn, if is_fast { read } else { shortest })
}

/// Returns the tour with the least time in the dark, which is optimal for up to [`EXACT_STROKES`]
/// strokes. The tour goes letter by letter if `letters`, with the letter of each stroke, is not
/// empty.
fn shortest_tour(ways: &[Vec<Way>], style: &EvenStyle, letters: &[usize]) -> Vec<Visit> {
    if ways.len() <= EXACT_STROKES {
        let is_planned = ways.iter().map(Vec::len).sum::<usize>() <= MAX_PLANNED_WAYS;
        return Tour { ways, style, is_planned, letters }.exact();
    }
    let tour = Tour { ways, style, is_planned: false, letters };
    let mut visits = tour.nearest();
    tour.improve(&mut visits);
    tour.best_ways(&visits)
}

/// Strokes, and the rules for computing the time in the dark between them.
struct Tour<'a> {
    ways: &'a [Vec<Way>],
    style: &'a EvenStyle,
    /// True if transits are planned, false if they are estimated.
    is_planned: bool,
    /// Index of each stroke's letter if each letter is to be written before the next, or empty.
    letters: &'a [usize],
}

impl Tour<'_> {
    /// Returns how the stroke of a visit is entered and left.
    fn way(&self, visit: Visit) -> &Way {
        &self.ways[visit.0][visit.1]
    }

    /// Returns the duration in s of the transit between two strokes, or from or to the floor for
    /// `None`, plus the cost of changing letters.
    fn between_s(&self, from: Option<Visit>, to: Option<Visit>) -> f64 {
        let still = Vector2::zeros();
        match (from.map(|from| self.way(from)), to.map(|to| self.way(to))) {
            (Some(a), Some(b)) => {
                // A step to another letter costs the same in both directions.
                let letter = |visit: Option<Visit>| self.letters.get(visit?.0).copied();
                let n_letters_apart =
                    letter(from).zip(letter(to)).map_or(0, |(a, b)| a.abs_diff(b));
                let transit_s = self.transit_s(b.start_m - a.end_m, a.end_m_s, b.start_m_s);
                LETTER_S * n_letters_apart as f64 + transit_s
            }
            // Take-off and landing are vertical.
            (None, Some(b)) => self.transit_s(Vector2::new(0.0, b.start_m.y), still, b.start_m_s),
            (Some(a), None) => self.transit_s(Vector2::new(0.0, -a.end_m.y), a.end_m_s, still),
            (None, None) => 0.0,
        }
    }

    /// Returns the planned or estimated duration in s of a transit over a displacement in m from
    /// one velocity to another (m/s). The duration is infinite if no transit exists.
    fn transit_s(&self, path_m: Vector2<f64>, from: Vector2<f64>, to: Vector2<f64>) -> f64 {
        if self.is_planned {
            let moving =
                |position_m, velocity_m_s| State { position_m, velocity_m_s, ..State::default() };
            let (from, to) = (moving(Vector2::zeros(), from), moving(path_m, to));
            let transit = Transit::new(&from, &to, self.style, RING_TICK_S);
            return transit.map_or(f64::INFINITY, |transit| transit.duration_s());
        }
        // Each axis receives an equal part of the acceleration limit.
        let limit = self.style.acceleration_m_s2 * std::f64::consts::FRAC_1_SQRT_2;
        let axis = |i: usize| axis_s(path_m[i], from[i], to[i], self.style.dark_speed_m_s, limit);
        axis(0).max(axis(1))
    }

    /// Returns a tour's total time in s in the dark, including take-off and landing.
    fn total_s(&self, visits: &[Visit]) -> f64 {
        let inner = visits.windows(2).map(|pair| self.between_s(Some(pair[0]), Some(pair[1])));
        inner.sum::<f64>()
            + self.between_s(None, visits.first().copied())
            + self.between_s(visits.last().copied(), None)
    }

    /// Returns the optimal tour by dynamic programming over sets of strokes (Held and Karp 1962),
    /// whose time and memory double with each stroke.
    fn exact(&self) -> Vec<Visit> {
        let visits: Vec<Visit> = (0..self.ways.len())
            .flat_map(|stroke| (0..self.ways[stroke].len()).map(move |way| (stroke, way)))
            .collect();
        let (n, full) = (visits.len(), (1_usize << self.ways.len()) - 1);
        let best = self.best_ends(&visits);
        // The best last visit is chosen with the time of landing included.
        let total_s =
            |last: usize| best[full * n + last].0 + self.between_s(Some(visits[last]), None);
        let last = (0..n).min_by(|a, b| total_s(*a).total_cmp(&total_s(*b)));
        let (mut set, mut index) = (full, last.unwrap_or(usize::MAX));
        // The order is traced back through the previous visits.
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

    /// Returns a table with a row for each set of strokes (a bit per stroke) and a column for each
    /// last visit. Each entry contains the least time in s so far and the index of the previous
    /// visit (`usize::MAX` if there is none).
    fn best_ends(&self, visits: &[Visit]) -> Vec<(f64, usize)> {
        let (n, full) = (visits.len(), (1_usize << self.ways.len()) - 1);
        // Every transit is computed once. There is none between two ways of the same stroke.
        let between_s = |a: &Visit, b: &Visit| {
            if a.0 == b.0 { f64::INFINITY } else { self.between_s(Some(*a), Some(*b)) }
        };
        let between: Vec<Vec<f64>> =
            visits.par_iter().map(|a| visits.iter().map(|b| between_s(a, b)).collect()).collect();
        let mut best = vec![(f64::INFINITY, usize::MAX); (full + 1) * n];
        for (last, visit) in visits.iter().enumerate() {
            best[(1 << visit.0) * n + last] = (self.between_s(None, Some(*visit)), usize::MAX);
        }
        // Sets in ascending order come after all of their subsets.
        for set in 1..=full {
            for last in 0..n {
                let (so_far_s, _) = best[set * n + last];
                if so_far_s.is_infinite() {
                    continue;
                }
                for (next, visit) in visits.iter().enumerate().filter(|v| set & (1 << v.1.0) == 0) {
                    let time_s = so_far_s + between[last][next];
                    let entry = &mut best[(set | (1 << visit.0)) * n + next];
                    if time_s < entry.0 {
                        *entry = (time_s, last);
                    }
                }
            }
        }
        best
    }

    /// Returns the strokes of a tour in the same order with the best directions, found as a
    /// shortest path through layers of ways (Viterbi 1967).
    fn best_ways(&self, visits: &[Visit]) -> Vec<Visit> {
        // For each way of a stroke, a layer contains the least time so far and the previous way.
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
        // The ways are traced back from the best way of the last stroke, with landing included.
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

/// Returns the minimum time in s along an axis for a distance and two velocities, with limits of
/// speed and acceleration.
fn axis_s(path_m: f64, from_m_s: f64, to_m_s: f64, speed_m_s: f64, limit_m_s2: f64) -> f64 {
    // The axis is reversed if necessary, so that the drone first accelerates and then brakes.
    let direct_m = 0.5 * (from_m_s + to_m_s) * (to_m_s - from_m_s).abs() / limit_m_s2;
    let sign = if path_m >= direct_m { 1.0 } else { -1.0 };
    let (d, v, w) = (path_m * sign, from_m_s * sign, to_m_s * sign);
    // A triangular speed profile has the peak speed p with 2 a d = 2 p² − v² − w².
    let squares = 0.5 * (v * v + w * w);
    let peak = (limit_m_s2 * d + squares).max(0.0).sqrt();
    if peak <= speed_m_s {
        return ((2.0 * peak - v - w) / limit_m_s2).max(0.0);
    }
    // In a trapezoidal speed profile, the rest of the distance is flown at full speed.
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

    /// Finds the least time over all orders and ways by trying all of them.
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

    /// Three of the ten words have too many strokes for an exact order.
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
                let tour = Tour { ways: &ways, style: &style, is_planned: true, letters: &[] };
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
            let tour = Tour { ways: &ways, style: &style, is_planned: false, letters: &[] };
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
            let tour = Tour { ways: &ways, style: &style, is_planned: false, letters: &[] };
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

    /// Returns the order that always continues with the nearest stroke, found without a bound.
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
        // Between dashes on a square grid, many distances are equal.
        for ways in [drawing(300, 1), drawing(61, 2), square(12, 0.05), row.collect()] {
            let tour = Tour { ways: &ways, style: &style, is_planned: false, letters: &[] };
            assert_eq!(tour.nearest(), nearest_of_each(&tour));
        }
    }

    #[test]
    fn two_thousand_strokes_take_less_than_half_the_time_of_their_drawn_order() {
        let style = EvenStyle::default();
        let ways = drawing(2000, 7);
        let tour = Tour { ways: &ways, style: &style, is_planned: false, letters: &[] };
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
        assert!(error.contains("3000 strokes take about"), "{error}");
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
