//! Transits, which are the fastest dark paths within limits of speed, acceleration and jerk.
//!
//! Ruckig (Berscheid and Kröger, RSS 2021) computes paths that are time-optimal on each axis and
//! synchronized. One axis is along the path, the other across it. One angle divides the speed limit
//! between the axes, another the acceleration limit. The fastest path over a few angles is used.

use nalgebra::{Rotation2, Vector2};
use rsruckig::prelude::{
    DataArrayOrVec, IgnoreErrorHandler, InputParameter, Ruckig, RuckigResult, Trajectory,
};

use super::EvenStyle;
use super::motion::{MAX_EXCESS, State};
use noctograph_core::statistics::sort_by_number;

/// Angles in rad that divide the limits between the two axes.
const SPLITS_RAD: [f64; 3] = [0.25, 0.5, 0.785];

/// Fractions of the acceleration limit, tried in turn while both axes together exceed it.
const ACCELERATION_FRACTIONS: [f64; 5] = [1.0, 0.9, 0.8, 0.6, 0.4];

/// Factor by which a path may exceed the speed limit between the checked times, and factor on an
/// axis's limits that allows for rounding.
const SPEED_SLACK: f64 = 1.01;
const ROUNDING: f64 = 1.0 + 1e-9;
/// Ruckig's control cycle in s, which is unused in offline calculation.
const CONTROL_CYCLE_S: f64 = 0.01;
/// Tolerance of a whole number of ticks, and maximum number of durations tried to reach one.
const TICK_SLACK: f64 = 1e-6;
const MAX_TRIALS: usize = 8;
/// Number of equal spans at whose ends a transit's speed and acceleration are checked.
const N_SAMPLES: u32 = 32;
/// Distance in m below which a transit has no direction.
const LEAST_PATH_M: f64 = 1e-9;

/// Path that is flown in the dark.
#[derive(Debug)]
pub(super) struct Transit {
    from_m: Vector2<f64>,
    world_from_path: Rotation2<f64>,
    trajectory: Trajectory<2>,
}

impl Transit {
    /// Returns the fastest path between two states that satisfies the acceleration limit or, if
    /// none does, the path that exceeds it least. Its duration is a multiple of `tick_s`. Returns
    /// `None` if no path exists, which has not occurred for states within the limits.
    pub(super) fn new(from: &State, to: &State, style: &EvenStyle, tick_s: f64) -> Option<Self> {
        // Each axis may use the acceleration at either end, so both together may exceed the limit.
        let mut gentlest: Option<(f64, Self)> = None;
        for fraction in ACCELERATION_FRACTIONS {
            let acceleration_m_s2 = fraction * style.acceleration_m_s2;
            let gentler = EvenStyle { acceleration_m_s2, ..style.clone() };
            // If there is no path, there is none with a lower limit either.
            let Some(path) = Self::fastest(from, to, &gentler, tick_s) else { break };
            let most_m_s2 = path.max_norm(|state| state.acceleration_m_s2);
            if most_m_s2 <= MAX_EXCESS * style.acceleration_m_s2 {
                return Some(path);
            }
            if gentlest.as_ref().is_none_or(|(least, _)| *least > most_m_s2) {
                gentlest = Some((most_m_s2, path));
            }
        }
        gentlest.map(|(_, path)| path)
    }

    /// Returns the fastest transit over all pairs of angles that divide the limits between the
    /// axes, preferably one that satisfies the speed limit. Returns `None` if Ruckig finds none.
    /// The acceleration limit applies to each axis.
    fn fastest(from: &State, to: &State, style: &EvenStyle, tick_s: f64) -> Option<Self> {
        let path_m = to.position_m - from.position_m;
        // Without a distance, the path has no direction, and world x serves as its axis.
        let has_direction = path_m.norm() > LEAST_PATH_M;
        let angle_rad = if has_direction { libm::atan2(path_m.y, path_m.x) } else { 0.0 };
        let world_from_path = Rotation2::new(angle_rad);
        let splits = SPLITS_RAD.iter().flat_map(|a| SPLITS_RAD.iter().map(move |v| [*v, *a]));
        let paths = splits.filter_map(|splits_rad| {
            let mut input = input(from, to, &world_from_path, style, splits_rad);
            let trajectory = calculate(&mut input, tick_s)?;
            Some(Self { from_m: from.position_m, world_from_path, trajectory })
        });
        let mut paths: Vec<Self> = paths.collect();
        sort_by_number(&mut paths, Self::duration_s);
        // Both axes together may exceed the speed limit. Such a path is used only as a last resort.
        let fastest_m_s = style.dark_speed_m_s.max(from.velocity_m_s.norm());
        let limit_m_s = SPEED_SLACK * fastest_m_s.max(to.velocity_m_s.norm());
        let within_limit =
            paths.iter().position(|path| path.max_norm(|state| state.velocity_m_s) <= limit_m_s);
        paths.into_iter().nth(within_limit.unwrap_or(0))
    }

    /// Returns the greatest norm of a vector of the state at equally spaced times, in the unit of
    /// the vector.
    fn max_norm(&self, vector: impl Fn(&State) -> Vector2<f64>) -> f64 {
        let fractions = (0..=N_SAMPLES).map(|k| f64::from(k) / f64::from(N_SAMPLES));
        let times_s = fractions.map(|fraction| self.duration_s() * fraction);
        times_s.map(|time_s| vector(&self.state_at(time_s)).norm()).fold(0.0, f64::max)
    }

    /// Returns the duration in s.
    pub(super) fn duration_s(&self) -> f64 {
        self.trajectory.get_duration()
    }

    /// Returns the state at a time in s after the transit's beginning, in the plane of the word.
    pub(super) fn state_at(&self, time_s: f64) -> State {
        let zero = || DataArrayOrVec::<f64, 2>::new(None, 0.0);
        let (mut p, mut v, mut a) = (zero(), zero(), zero());
        let (p_out, v_out, a_out) = (&mut Some(&mut p), &mut Some(&mut v), &mut Some(&mut a));
        self.trajectory.at_time(time_s, p_out, v_out, a_out, &mut None, &mut None);
        let world = |x: &DataArrayOrVec<f64, 2>| self.world_from_path * Vector2::new(x[0], x[1]);
        State {
            position_m: self.from_m + world(&p),
            velocity_m_s: world(&v),
            acceleration_m_s2: world(&a),
        }
    }
}

/// Returns Ruckig's input, which contains states and limits along the path (axis 0) and across it
/// (axis 1). One angle in rad divides the speed limit between the axes, and another the
/// acceleration limit.
fn input(
    from: &State,
    to: &State,
    world_from_path: &Rotation2<f64>,
    style: &EvenStyle,
    [speed_rad, acceleration_rad]: [f64; 2],
) -> InputParameter<2> {
    let path_from_world = world_from_path.inverse();
    let [v, target_v] = [from, to].map(|state| path_from_world * state.velocity_m_s);
    let [a, target_a] = [from, to].map(|state| path_from_world * state.acceleration_m_s2);
    let target = path_from_world * (to.position_m - from.position_m);
    let (sin_v, cos_v) = libm::sincos(speed_rad);
    let (sin_a, cos_a) = libm::sincos(acceleration_rad);
    let mut input = InputParameter::<2>::new(None);
    for (axis, (fraction_v, fraction_a)) in [(cos_v, cos_a), (sin_v, sin_a)].into_iter().enumerate()
    {
        input.current_velocity[axis] = v[axis];
        input.current_acceleration[axis] = a[axis];
        input.target_position[axis] = target[axis];
        input.target_velocity[axis] = target_v[axis];
        input.target_acceleration[axis] = target_a[axis];
        // Each limit is at least as large as the values at both ends.
        let ends_v = v[axis].abs().max(target_v[axis].abs());
        let ends_a = a[axis].abs().max(target_a[axis].abs());
        input.max_velocity[axis] = (style.dark_speed_m_s * fraction_v).max(ends_v) * ROUNDING;
        input.max_acceleration[axis] =
            (style.acceleration_m_s2 * fraction_a).max(ends_a) * ROUNDING;
        input.max_jerk[axis] = style.jerk_m_s3 * fraction_a;
    }
    input
}

/// Calculates the fastest trajectory whose duration is a whole number of ticks. Returns `None` if
/// Ruckig finds none.
fn calculate(input: &mut InputParameter<2>, tick_s: f64) -> Option<Trajectory<2>> {
    let mut ruckig = Ruckig::<2, IgnoreErrorHandler>::new(None, CONTROL_CYCLE_S);
    for _trial in 0..MAX_TRIALS {
        let mut trajectory = Trajectory::<2>::new(None);
        let Ok(RuckigResult::Working | RuckigResult::Finished) =
            ruckig.calculate(input, &mut trajectory)
        else {
            return None;
        };
        let n_ticks = trajectory.get_duration() / tick_s;
        if (n_ticks - n_ticks.round()).abs() < TICK_SLACK {
            return Some(trajectory);
        }
        // A longer duration may be infeasible, and the next feasible one may again miss the tick.
        input.minimum_duration = Some((n_ticks - TICK_SLACK).ceil() * tick_s);
    }
    None
}

#[cfg(test)]
mod tests {
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    use super::*;

    #[test]
    fn a_transit_meets_both_ends_on_a_tick_within_the_limits() {
        let style = EvenStyle::default();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for case in 0..500 {
            let mut vector = |most: f64| {
                let x = rng.random_range(-most..most);
                Vector2::new(x, rng.random_range(-most..most))
            };
            let [from, to] = [(); 2].map(|()| State {
                position_m: vector(1.0),
                velocity_m_s: vector(0.14),
                acceleration_m_s2: Vector2::zeros(),
            });
            let transit = Transit::new(&from, &to, &style, 0.05).unwrap();
            let duration_s = transit.duration_s();
            assert!((duration_s / 0.05 - (duration_s / 0.05).round()).abs() < 1e-6, "case {case}");
            let end = transit.state_at(duration_s);
            assert!(
                (transit.state_at(0.0).position_m - from.position_m).norm() < 1e-9,
                "case {case}"
            );
            assert!((end.position_m - to.position_m).norm() < 1e-6, "case {case}");
            assert!((end.velocity_m_s - to.velocity_m_s).norm() < 1e-6, "case {case}");
            for k in 0..=200 {
                let State { velocity_m_s: v, acceleration_m_s2: a, .. } =
                    transit.state_at(duration_s * f64::from(k) / 200.0);
                assert!(v.norm() < 1.0 + 1e-6 && a.norm() < 2.0 + 1e-6, "case {case}: {v} {a}");
            }
        }
    }

    #[test]
    fn a_meter_from_rest_to_rest_takes_the_time_of_the_limits() {
        let rest = |x: f64| State { position_m: Vector2::new(x, 0.0), ..State::default() };
        let style = EvenStyle { jerk_m_s3: 1e4, ..EvenStyle::default() };
        let transit = Transit::new(&rest(0.0), &rest(1.0), &style, 1e-4).unwrap();
        // At 0.97 of 1 m/s and 2 m/s², accelerating and braking take v/a each, and the rest is
        // flown at full speed.
        let (v, a) = (libm::cos(0.25), 2.0 * libm::cos(0.25));
        let found_s = transit.duration_s();
        assert!((found_s - (1.0 / v + v / a)).abs() < 2e-3, "{found_s} s");
    }
}
