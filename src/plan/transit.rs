//! Transits: the fastest dark way between two states within limits of speed, acceleration and jerk.
//!
//! Time-optimal per axis and synchronized, by Ruckig (Berscheid, Kröger, RSS 2021). The axes lie
//! along the way and across it, and share the limits of speed and of acceleration by an angle each;
//! the fastest of a few angles is taken. The drone does not stop at the ends of strokes.

use nalgebra::{Rotation2, Vector2};
use rsruckig::prelude::{
    DataArrayOrVec, IgnoreErrorHandler, InputParameter, Ruckig, RuckigResult, Trajectory,
};

use super::EvenStyle;
use super::motion::{BEYOND, State};

/// Angles that split the limits between the two axes.
const SHARES_RAD: [f64; 3] = [0.25, 0.5, 0.785];

/// Shares of the limit of acceleration that are tried where both axes together exceed it.
const GENTLER: [f64; 5] = [1.0, 0.9, 0.8, 0.6, 0.4];

/// A way in the dark.
#[derive(Debug)]
pub(super) struct Transit {
    from_m: Vector2<f64>,
    world_from_way: Rotation2<f64>,
    trajectory: Trajectory<2>,
}

impl Transit {
    /// The fastest way between two states, lasting a multiple of `tick_s`; `None` where none was
    /// found, which has not happened for states within the limits.
    ///
    /// An axis is allowed the acceleration of either end, so that both together may exceed the
    /// limit: then the way is made by gentler limits.
    pub(super) fn new(from: &State, to: &State, style: &EvenStyle, tick_s: f64) -> Option<Self> {
        let ways = GENTLER.iter().map_while(|share| {
            let acceleration_m_s2 = share * style.acceleration_m_s2;
            let gentler = EvenStyle { acceleration_m_s2, ..style.clone() };
            Self::fastest(from, to, &gentler, tick_s)
        });
        let mut gentlest: Option<(f64, Self)> = None;
        for way in ways {
            let most_m_s2 = way.most(|state| state.acceleration_m_s2);
            if most_m_s2 <= BEYOND * style.acceleration_m_s2 {
                return Some(way);
            }
            gentlest = gentlest.filter(|(least, _)| *least <= most_m_s2).or(Some((most_m_s2, way)));
        }
        gentlest.map(|(_, way)| way)
    }

    /// The fastest of the transits whose axes split the limits by an angle.
    fn fastest(from: &State, to: &State, style: &EvenStyle, tick_s: f64) -> Option<Self> {
        let way = to.position_m - from.position_m;
        let angle_rad = if way.norm() > 1e-9 { libm::atan2(way.y, way.x) } else { 0.0 };
        let world_from_way = Rotation2::new(angle_rad);
        let shares = SHARES_RAD.iter().flat_map(|a| SHARES_RAD.iter().map(move |v| [*v, *a]));
        let shared = shares.filter_map(|shares_rad| {
            let mut input = input(from, to, &world_from_way, style, shares_rad);
            calculate(&mut input, tick_s)
        });
        let fastest_m_s = style.dark_speed_m_s.max(from.velocity_m_s.norm());
        let limit_m_s = 1.01 * fastest_m_s.max(to.velocity_m_s.norm());
        let ways =
            shared.map(|trajectory| Self { from_m: from.position_m, world_from_way, trajectory });
        let mut ways: Vec<Self> = ways.collect();
        ways.sort_by(|a, b| a.duration_s().total_cmp(&b.duration_s()));
        // Both axes together may exceed the limit; such a way is only the last resort.
        let slow = ways.iter().position(|way| way.most(|state| state.velocity_m_s) <= limit_m_s);
        ways.into_iter().nth(slow.unwrap_or(0))
    }

    /// Greatest norm of a vector on the way.
    fn most(&self, vector: impl Fn(&State) -> Vector2<f64>) -> f64 {
        let part = |k: u32| vector(&self.state_at(self.duration_s() * f64::from(k) / 32.0)).norm();
        (0..=32).map(part).fold(0.0, f64::max)
    }

    pub(super) fn duration_s(&self) -> f64 {
        self.trajectory.get_duration()
    }

    /// The state `time_s` after the beginning.
    pub(super) fn state_at(&self, time_s: f64) -> State {
        let zero = || DataArrayOrVec::<f64, 2>::new(None, 0.0);
        let (mut p, mut v, mut a) = (zero(), zero(), zero());
        let (p_out, v_out, a_out) = (&mut Some(&mut p), &mut Some(&mut v), &mut Some(&mut a));
        self.trajectory.at_time(time_s, p_out, v_out, a_out, &mut None, &mut None);
        let world = |x: &DataArrayOrVec<f64, 2>| self.world_from_way * Vector2::new(x[0], x[1]);
        State {
            position_m: self.from_m + world(&p),
            velocity_m_s: world(&v),
            acceleration_m_s2: world(&a),
        }
    }
}

fn input(
    from: &State,
    to: &State,
    world_from_way: &Rotation2<f64>,
    style: &EvenStyle,
    [speed_rad, force_rad]: [f64; 2],
) -> InputParameter<2> {
    let way = |v: Vector2<f64>| world_from_way.inverse() * v;
    let (across, along) = libm::sincos(speed_rad);
    let (sin, cos) = libm::sincos(force_rad);
    let mut input = InputParameter::<2>::new(None);
    let states = [way(from.velocity_m_s), way(to.velocity_m_s)];
    let accelerations = [way(from.acceleration_m_s2), way(to.acceleration_m_s2)];
    let target = way(to.position_m - from.position_m);
    // The limits are at least the values at either end.
    let most = |pair: &[Vector2<f64>; 2], axis: usize| pair[0][axis].abs().max(pair[1][axis].abs());
    for (axis, (speed, share)) in [(along, cos), (across, sin)].into_iter().enumerate() {
        let speed_m_s = (style.dark_speed_m_s * speed).max(most(&states, axis));
        input.current_velocity[axis] = states[0][axis];
        input.current_acceleration[axis] = accelerations[0][axis];
        input.target_position[axis] = target[axis];
        input.target_velocity[axis] = states[1][axis];
        input.target_acceleration[axis] = accelerations[1][axis];
        input.max_velocity[axis] = speed_m_s * (1.0 + 1e-9);
        let limit_m_s2 = style.acceleration_m_s2 * share;
        input.max_acceleration[axis] = limit_m_s2.max(most(&accelerations, axis)) * (1.0 + 1e-9);
        input.max_jerk[axis] = style.jerk_m_s3 * share;
    }
    input
}

fn calculate(input: &mut InputParameter<2>, tick_s: f64) -> Option<Trajectory<2>> {
    let mut ruckig = Ruckig::<2, IgnoreErrorHandler>::new(None, 0.01);
    for _ in 0..8 {
        let mut trajectory = Trajectory::<2>::new(None);
        let Ok(RuckigResult::Working | RuckigResult::Finished) =
            ruckig.calculate(input, &mut trajectory)
        else {
            return None;
        };
        let ticks = trajectory.get_duration() / tick_s;
        if ticks - ticks.round() < 1e-6 && ticks.round() - ticks < 1e-6 {
            return Some(trajectory);
        }
        input.minimum_duration = Some((ticks - 1e-6).ceil() * tick_s);
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
        // 0.97 of 1 m/s and 2 m/s²: v/a to rise and as long to fall, the rest at full speed.
        let (v, a) = (libm::cos(0.25), 2.0 * libm::cos(0.25));
        let found_s = transit.duration_s();
        assert!((found_s - (1.0 / v + v / a)).abs() < 2e-3, "{found_s} s");
    }
}
