//! Fleets of several drones that write one word together without coming too close to each other.
//!
//! The word is divided from left to right into one part per drone, with lit strokes of about equal
//! length. Four routes through each part are tried, which are the shortest one, the one from left
//! to right, and both in reverse, because left-to-right routes keep simultaneous drones apart.
//! Routes are assigned to the drones in turn. Each drone receives the route and the wait on the
//! floor that end first without a conflict with the drones before it.

use std::collections::HashMap;

use nalgebra::Vector3;

use super::order::{as_drawn, is_kept, shortest};
use super::pen::PenStroke;
use super::{EvenStyle, Plan, PlanOptions, Setpoint, Style, adjusted, even};
use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::bounds;
use noctograph_core::statistics::sort_by_number;
use noctograph_core::strokes::Strokes;

/// Minimum horizontal distance in m between two drones, unless one is [`MIN_VERTICAL_M`] above the
/// other. Both distances are the radii in the firmware's collision avoidance
/// (`collision_avoidance.c`: 0.3, 0.3 and 0.9 m).
pub const MIN_HORIZONTAL_M: f64 = 0.3;
/// Distance in m that the downwash reaches below a drone.
pub const MIN_VERTICAL_M: f64 = 0.9;
/// Distance in m below which two drones are too close, which is the minimum less a rounding error.
const TOO_NEAR_M: f64 = MIN_HORIZONTAL_M - 1e-9;
/// Time in s between two checks of the distance, and step in s by which a drone's start is delayed.
const CHECK_STEP_S: f64 = 0.05;

/// Maximum number of strokes for several drones. Each stroke is part of eight routes.
const MAX_SHARED: usize = 2500;
/// Maximum number of comparisons of two positions in the search for starts (a few seconds).
const MAX_COMPARED: u64 = 1_000_000_000;

/// Moment at which two drones are closest to each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Time of the closest approach, s.
    pub time_s: f64,
    /// Horizontal distance between the drones in m.
    pub horizontal_m: f64,
    /// Difference in height in m, which is signed only in the result of [`downwash_approach`].
    pub vertical_m: f64,
}

impl Approach {
    /// Compares the horizontal distances of two approaches.
    pub fn compare(&self, other: &Self) -> std::cmp::Ordering {
        self.horizontal_m.total_cmp(&other.horizontal_m)
    }
}

/// Plans the drones that write a word together, at most one for each stroke.
///
/// # Errors
///
/// Returns the errors of [`super::plan()`]. Returns [`Error::Input`] for several drones in style
/// `team`, and [`Error::Infeasible`] if they cannot keep apart.
pub fn fleet(strokes: &Strokes, options: &PlanOptions) -> Result<Vec<Plan>> {
    if options.drones <= 1 {
        return Ok(vec![super::plan(strokes, options)?]);
    }
    options.check()?;
    let Style::Even(style) = &options.style else {
        let actual = format!("{} drones in style team", options.drones);
        let hint = "set plan.style = \"even\"";
        return Err(Error::input("plan.drones", actual, "one, or style even", hint));
    };
    // Strokes are divided anywhere or only between letters. The assignment that ends first is used.
    let mut assignments: Vec<Assignment> = Vec::new();
    for whole_letters in [false, true] {
        assignments.extend(Assignment::new(strokes, whole_letters, options, style)?);
    }
    let first = assignments.into_iter().min_by_key(|assignment| assignment.end);
    let assignment = first.ok_or_else(|| {
        Error::infeasible(
            "two drones come too close to each other for any delay, or no start was found in a \
             billion comparisons of positions",
            "divide the word among fewer drones, or write it larger",
        )
    })?;
    assignment.plans(options, style)
}

/// Possible and assigned routes of all drones.
struct Assignment {
    routes: Vec<Vec<Route>>,
    starts: Vec<Start>,
    /// Step at which the last drone lands.
    end: usize,
}

impl Assignment {
    /// Finds the assignment that ends first. `whole_letters` assigns all strokes of a letter to
    /// the same drone. Returns `None` if the drones cannot keep apart.
    fn new(
        strokes: &Strokes,
        whole_letters: bool,
        options: &PlanOptions,
        style: &EvenStyle,
    ) -> Result<Option<Self>> {
        let parts = parts(strokes, whole_letters, options, style)?;
        let n_strokes = parts.iter().map(Vec::len).sum::<usize>();
        if n_strokes > MAX_SHARED {
            return Err(Error::infeasible(
                format!(
                    "{n_strokes} strokes, more than {MAX_SHARED}, are too many to divide \
                         among drones"
                ),
                "draw fewer strokes, lower letters.detail, or fly one drone",
            ));
        }
        // All routes are planned before drones are assigned, and are compared step by step.
        let homes_m = homes_x_m(&parts);
        let mut routes: Vec<Vec<Route>> = Vec::new();
        for (part, home_m) in parts.into_iter().zip(homes_m) {
            let orders =
                if is_kept(strokes, style) { vec![part] } else { orders(&part, options, style) };
            let planned = orders.into_iter().map(|strokes| {
                let track = Track::new(&even::plan(&strokes, options, style, Some(home_m))?);
                Ok(Route { strokes, home_m, track })
            });
            routes.push(planned.collect::<Result<_>>()?);
        }
        let starts = starts(&routes);
        Ok(starts.map(|(end, starts)| Self { routes, starts, end }))
    }

    /// Returns the plans of all drones on their assigned routes.
    fn plans(&self, options: &PlanOptions, style: &EvenStyle) -> Result<Vec<Plan>> {
        let plans = self.routes.iter().zip(&self.starts).map(|(routes, start)| {
            // A delayed start becomes a longer wait on the floor.
            let floor_wait_s = options.floor_wait_s + start.delay as f64 * CHECK_STEP_S;
            let later = PlanOptions { floor_wait_s, ..options.clone() };
            let Route { strokes, home_m, .. } = &routes[start.route];
            Ok(adjusted(even::plan(strokes, &later, style, Some(*home_m))?, options))
        });
        plans.collect()
    }
}

/// Order of a drone's strokes, and the flight in that order.
struct Route {
    strokes: Vec<PenStroke>,
    home_m: f64,
    track: Track,
}

/// Index of a drone's route, and number of steps by which its start is delayed.
#[derive(Clone, Copy)]
struct Start {
    route: usize,
    delay: usize,
}

impl Start {
    /// Returns the step at which the drone has landed on its assigned route.
    fn end(self, routes: &[Route]) -> usize {
        self.delay + routes[self.route].track.places.len()
    }
}

/// Finds a route and a delay for each drone, with which no two drones come too close. Returns the
/// step of [`CHECK_STEP_S`] at which the last drone lands, and the routes and delays in the order
/// of the drones. Returns `None` if no order of assignment succeeds.
fn starts(routes: &[Vec<Route>]) -> Option<(usize, Vec<Start>)> {
    let mut order: Vec<usize> = (0..routes.len()).collect();
    let mut best: Option<(usize, Vec<Start>)> = None;
    let mut conflicts =
        Conflicts { routes, cache: HashMap::new(), n_comparisons_left: MAX_COMPARED };
    // The drone that landed last or found no route chooses first in the next round. The number of
    // rounds is limited, because the same orders may recur.
    for _round in 0..2 * routes.len() {
        let last = match assign(routes, &order, &mut conflicts) {
            Ok(starts) => {
                let ends = starts.iter().zip(routes).map(|(start, routes)| start.end(routes));
                let (end, last) = ends.zip(0..).max().expect("one drone at least");
                if best.as_ref().is_none_or(|(least, _)| end < *least) {
                    best = Some((end, starts));
                }
                last
            }
            Err(stuck) => stuck,
        };
        let turn = order.iter().position(|drone| *drone == last).expect("each drone has a turn");
        if turn == 0 {
            break;
        }
        order[..=turn].rotate_right(1);
    }
    best
}

/// Returns routes and delays for an order of assignment. Each drone gets the earliest end that does
/// not conflict with the drones before it. The error is the drone that has no route.
fn assign(
    routes: &[Vec<Route>],
    order: &[usize],
    conflicts: &mut Conflicts<'_>,
) -> std::result::Result<Vec<Start>, usize> {
    let mut chosen: Vec<(usize, Start)> = Vec::new();
    for &drone in order {
        // Once all other drones have landed, a longer delay makes no difference.
        let ends = chosen.iter().map(|(other, start)| start.end(&routes[*other]));
        let max_delay = ends.max().unwrap_or(0);
        let starts = (0..routes[drone].len()).filter_map(|route| {
            let mut delays = (0..=max_delay).map(|delay| Start { route, delay });
            delays.find(|start| !chosen.iter().any(|other| conflicts.has((drone, *start), *other)))
        });
        let first = starts.min_by_key(|start| start.end(&routes[drone]));
        chosen.push((drone, first.ok_or(drone)?));
    }
    chosen.sort_by_key(|(drone, _)| *drone);
    Ok(chosen.into_iter().map(|(_, start)| start).collect())
}

/// Cache of conflicts between two drones, shared by all orders of assignment.
struct Conflicts<'a> {
    routes: &'a [Vec<Route>],
    /// Cached results by the first drone and its route, the second drone and its route, and the
    /// delay between the starts.
    cache: HashMap<[usize; 5], bool>,
    /// Number of comparisons that may still be made. At 0, all drones count as in conflict.
    n_comparisons_left: u64,
}

impl Conflicts<'_> {
    /// True if the drones `a` and `b`, with these starts, come too close to each other. Results are
    /// cached.
    fn has(&mut self, (a, start_a): (usize, Start), (b, start_b): (usize, Start)) -> bool {
        let [track_a, track_b] = [(a, start_a), (b, start_b)]
            .map(|(drone, start)| &self.routes[drone][start.route].track);
        let n_steps = [track_a, track_b].map(|track| track.places.len());
        // Only the delay between the starts matters, up to the landing of the other drone.
        let offset = (start_a.delay + n_steps[0]).saturating_sub(start_b.delay);
        let offset = offset.min(n_steps[0] + n_steps[1]);
        let left = &mut self.n_comparisons_left;
        let meet = || track_a.meets(start_a.delay, track_b, start_b.delay, left);
        *self.cache.entry([a, start_a.route, b, start_b.route, offset]).or_insert_with(meet)
    }
}

/// Position of a drone, and whether it is on the floor with its motors off.
#[derive(Clone, Copy)]
struct Place {
    position_m: Vector3<f64>,
    is_parked: bool,
}

impl Place {
    /// Returns the horizontal distance and the height difference of two drones, both positive.
    /// Returns `None` if the height difference suffices ([`MIN_VERTICAL_M`], or
    /// [`MIN_HORIZONTAL_M`] if one is parked).
    fn apart_m(self, other: Self) -> Option<[f64; 2]> {
        let is_parked = self.is_parked || other.is_parked;
        let reach_m = if is_parked { MIN_HORIZONTAL_M } else { MIN_VERTICAL_M };
        let apart_m = self.position_m - other.position_m;
        (apart_m.z.abs() < reach_m).then(|| [apart_m.xy().norm(), apart_m.z.abs()])
    }
}

/// Positions of a drone at every step.
struct Track {
    places: Vec<Place>,
    /// Longest horizontal distance from one step to the next in m.
    step_m: f64,
}

impl Track {
    /// Samples a plan every [`CHECK_STEP_S`], up to and including its end. The longest horizontal
    /// step bounds how fast the drone can approach another.
    fn new(plan: &Plan) -> Self {
        let place = |time_s: f64| Place {
            position_m: plan.design_m(time_s),
            is_parked: plan.setpoint_at(time_s).is_some_and(Setpoint::on_floor),
        };
        let end_s = plan.duration_s();
        let times_s = (0..).map(|step| f64::from(step) * CHECK_STEP_S);
        let times_s = times_s.take_while(|time_s| *time_s < end_s).chain([end_s]);
        let places: Vec<_> = times_s.map(place).collect();
        let steps_m =
            places.windows(2).map(|ends| (ends[1].position_m - ends[0].position_m).xy().norm());
        Self { step_m: steps_m.fold(0.0, f64::max), places }
    }

    /// Returns the position at a step, which is the last one after the end of the plan.
    fn place(&self, step: usize) -> Place {
        self.places[step.min(self.places.len() - 1)]
    }

    /// True if two drones come too close, each of which starts after a delay in steps. Every
    /// comparison of positions decreases `left`, and without any left, the drones count as too
    /// close.
    fn meets(&self, delay: usize, other: &Self, other_delay: usize, left: &mut u64) -> bool {
        let end = (self.places.len() + delay).max(other.places.len() + other_delay);
        let mut step = 0;
        while step < end {
            let Some(rest) = left.checked_sub(1) else { return true };
            *left = rest;
            let a = self.place(step.saturating_sub(delay));
            let b = other.place(step.saturating_sub(other_delay));
            let aside_m = (a.position_m - b.position_m).xy().norm();
            if aside_m < TOO_NEAR_M && a.apart_m(b).is_some() {
                return true;
            }
            // Steps during which the drones are too far apart to meet are skipped.
            let n_safe = (aside_m - MIN_HORIZONTAL_M) / (self.step_m + other.step_m);
            #[expect(clippy::cast_possible_truncation, reason = "saturates")]
            let n_safe = n_safe.max(0.0) as usize;
            step = step.saturating_add(1).saturating_add(n_safe);
        }
        false
    }
}

/// Divides the strokes from left to right into parts of about equal length, one per drone. If
/// `whole_letters`, no letter is divided. Strokes that keep their order are not sorted.
fn parts(
    strokes: &Strokes,
    whole_letters: bool,
    options: &PlanOptions,
    style: &EvenStyle,
) -> Result<Vec<Vec<PenStroke>>> {
    let mut drawn = as_drawn(strokes, options.stroke_speed_m_s)?;
    if !is_kept(strokes, style) {
        sort_by_number(&mut drawn, |stroke| middle_x_m(std::slice::from_ref(stroke)));
    }
    let each_m = drawn.iter().map(PenStroke::length_m).sum::<f64>() / f64::from(options.drones);
    let mut parts: Vec<Vec<PenStroke>> = vec![Vec::new()];
    let mut drawn_m = 0.0;
    for stroke in drawn {
        let length_m = stroke.length_m();
        let parts_m = each_m * parts.len() as f64;
        let last = parts.last().and_then(|part| part.last());
        let may_divide = last.is_some_and(|last| !whole_letters || last.letter != stroke.letter);
        // A stroke belongs to the part that contains its middle.
        if drawn_m + 0.5 * length_m > parts_m && may_divide {
            parts.push(Vec::new());
        }
        drawn_m += length_m;
        parts.last_mut().expect("one at least").push(stroke);
    }
    Ok(parts)
}

/// Returns four orders for a part whose strokes are given from left to right, which are the
/// shortest order, the given one, and both in reverse.
fn orders(part: &[PenStroke], options: &PlanOptions, style: &EvenStyle) -> Vec<Vec<PenStroke>> {
    let backward = |order: &[PenStroke]| order.iter().rev().map(|stroke| stroke.along(1)).collect();
    let shortest = shortest(part, options.stroke_speed_m_s, style);
    let across: Vec<PenStroke> = Vec::from_iter(part.iter().map(|stroke| {
        let [begin, end] = [0, stroke.points_m.len() - 1].map(|index| stroke.points_m[index].x);
        if begin > end { stroke.along(1) } else { stroke.clone() }
    }));
    vec![backward(&shortest), shortest, backward(&across), across]
}

/// Returns the x in m of each drone's home, at least [`MIN_HORIZONTAL_M`] to the right of the
/// previous home, and on average below the middle of its part.
fn homes_x_m(parts: &[Vec<PenStroke>]) -> Vec<f64> {
    let middles_m: Vec<f64> = parts.iter().map(|part| middle_x_m(part)).collect();
    let mut homes_m = middles_m.clone();
    for index in 1..homes_m.len() {
        homes_m[index] = homes_m[index].max(homes_m[index - 1] + MIN_HORIZONTAL_M);
    }
    // Keeping the homes apart moved them to the right on average. This shift is removed here.
    let n = homes_m.len() as f64;
    let aside_m = (homes_m.iter().sum::<f64>() - middles_m.iter().sum::<f64>()) / n;
    homes_m.iter().map(|home_m| home_m - aside_m).collect()
}

/// Returns the middle in m between the smallest and largest x of strokes.
fn middle_x_m(strokes: &[PenStroke]) -> f64 {
    let points = strokes.iter().flat_map(|stroke| &stroke.points_m);
    let [left, _, right, _] = bounds(points.map(|point| (*point).into()));
    (left + right) / 2.0
}

/// Returns the moment of closest approach ([`closest`]) if two plans come within
/// [`MIN_HORIZONTAL_M`] of each other (`TOO_NEAR_M` allows for rounding), or `None` otherwise.
pub fn conflict(a: &Plan, b: &Plan) -> Option<Approach> {
    closest(a, b).filter(|closest| closest.horizontal_m < TOO_NEAR_M)
}

/// Returns the moment of least horizontal distance between two drones, among all at which neither
/// is far enough above the other. Returns `None` if one always is.
pub fn closest(a: &Plan, b: &Plan) -> Option<Approach> {
    let (a, b) = (Track::new(a), Track::new(b));
    let approach = |step: usize| {
        let [horizontal_m, vertical_m] = a.place(step).apart_m(b.place(step))?;
        Some(Approach { time_s: step as f64 * CHECK_STEP_S, horizontal_m, vertical_m })
    };
    (0..a.places.len().max(b.places.len())).filter_map(approach).min_by(Approach::compare)
}

/// Returns the moment of least difference in height between two drones while both fly and are less
/// than [`MIN_HORIZONTAL_M`] apart horizontally (`TOO_NEAR_M` allows for rounding), or `None` if
/// there is none. A positive `vertical_m` means that the first plan's drone is above.
pub fn downwash_approach(a: &Plan, b: &Plan) -> Option<Approach> {
    let end_s = a.duration_s().min(b.duration_s());
    let times_s = std::iter::successors(Some(0.0), |time_s| Some(time_s + CHECK_STEP_S));
    let approaches = times_s.take_while(|time_s| *time_s <= end_s).filter_map(|time_s| {
        let flies = |plan: &Plan| plan.setpoint_at(time_s).is_some_and(|s| !s.on_floor());
        let apart_m = a.design_m(time_s) - b.design_m(time_s);
        let (horizontal_m, vertical_m) = (apart_m.xy().norm(), apart_m.z);
        let is_near = horizontal_m < TOO_NEAR_M;
        (is_near && flies(a) && flies(b)).then_some(Approach { time_s, horizontal_m, vertical_m })
    });
    approaches.min_by(|one, other| one.vertical_m.abs().total_cmp(&other.vertical_m.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_letters::{LetterOptions, write};

    fn strokes(word: &str) -> Strokes {
        write(word, &LetterOptions { font: "simplex".into(), ..LetterOptions::default() }).unwrap()
    }

    #[test]
    fn more_drones_take_less_time_and_wait_for_each_other_briefly() {
        for word in ["PEACE", "WELCOME"] {
            let [one_s, two_s, four_s] = [1, 2, 4].map(|drones| {
                let options = PlanOptions { drones, ..PlanOptions::even() };
                let plans = fleet(&strokes(word), &options).unwrap();
                let pairs = (0..plans.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
                for (a, b) in pairs {
                    assert_eq!(conflict(&plans[a], &plans[b]), None, "{word}");
                }
                plans.iter().map(|plan| plan.duration_s()).fold(0.0, f64::max)
            });
            assert!(two_s < 0.65 * one_s && four_s < two_s, "{word}: {one_s}, {two_s}, {four_s} s");
        }
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        assert_eq!(
            fleet(&strokes("HI"), &options).unwrap().len(),
            2,
            "letters less than 0.3 m apart"
        );
    }

    #[test]
    fn two_drones_write_the_whole_word_apart_and_in_less_time() {
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let plans = fleet(&strokes("NOOR"), &options).unwrap();
        let alone = super::super::plan(&strokes("NOOR"), &options).unwrap();
        let together: f64 = plans.iter().map(|plan| plan.full_light_s()).sum();
        assert!((together - alone.full_light_s()).abs() < 0.2, "all of the word, once");
        let longest_s = plans.iter().map(|plan| plan.duration_s()).fold(0.0, f64::max);
        assert!(longest_s < 0.7 * alone.duration_s(), "{longest_s} s");
        // The letters are neighbors, and the second drone may not begin where the first one ends.
        for plans in [plans, fleet(&strokes("OO"), &options).unwrap()] {
            assert_eq!(plans.len(), 2);
            assert_eq!(conflict(&plans[0], &plans[1]), None);
            assert!(conflict(&plans[0], &plans[0]).is_some(), "two drones in one place");
        }
    }

    #[test]
    fn steps_are_skipped_only_where_nobody_can_meet() {
        let options = PlanOptions { drones: 2, ..PlanOptions::even() };
        let plans = fleet(&strokes("NOOR"), &options).unwrap();
        let [a, b] = [0, 1].map(|drone| Track::new(&plans[drone]));
        let mut counts = [0, 0];
        for delay in (0..a.places.len() + b.places.len()).step_by(3) {
            let near = |apart_m: [f64; 2]| apart_m[0] < MIN_HORIZONTAL_M - 1e-9;
            let meets = (0..delay + a.places.len() + b.places.len())
                .map(|step| a.place(step.saturating_sub(delay)).apart_m(b.place(step)))
                .any(|apart_m| apart_m.is_some_and(near));
            assert_eq!(a.meets(delay, &b, 0, &mut { u64::MAX }), meets, "{delay} steps later");
            counts[usize::from(meets)] += 1;
        }
        assert!(counts.iter().all(|n| *n > 10), "{counts:?}");
    }

    #[test]
    fn style_team_is_for_one_drone() {
        let options = PlanOptions { drones: 2, ..PlanOptions::default() };
        assert!(fleet(&strokes("NO"), &options).is_err());
    }
}
