//! Motion along a lit stroke with rounded corners, as fast as the limits permit.
//!
//! A pen moves along the drawn line in pieces of constant acceleration ([`super::speed`]). Two
//! moving averages of its position give the motion ([`super::smoothing`]). The averages are
//! differences of the position's integrals, so position, velocity and acceleration are exact.

use nalgebra::Vector2;

use super::EvenStyle;
use super::pen::PenStroke;
use super::smoothing::Smoothing;
use super::speed::profile;

/// State of the design at one instant, in the plane of the word.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct State {
    pub(super) position_m: Vector2<f64>,
    pub(super) velocity_m_s: Vector2<f64>,
    pub(super) acceleration_m_s2: Vector2<f64>,
}

/// Piece of the pen's path with constant acceleration, and the first and second integral of the
/// position up to its start.
#[derive(Clone, Copy, Debug)]
struct Piece {
    start_s: f64,
    position_m: Vector2<f64>,
    velocity_m_s: Vector2<f64>,
    acceleration_m_s2: Vector2<f64>,
    integral_m_s: Vector2<f64>,
    second_integral_m_s2: Vector2<f64>,
}

/// Fraction of a tick by which a duration may exceed whole ticks due to rounding errors.
pub(super) const SLACK_TICKS: f64 = 1e-6;
/// Ratio of a stroke's acceleration to the limit above which the whole stroke is slowed.
pub(super) const MAX_EXCESS: f64 = 1.045;

/// Motion along a stroke.
#[derive(Clone, Debug)]
pub(super) struct Motion {
    smoothing: Smoothing,
    origin_m: Vector2<f64>,
    pieces: Vec<Piece>,
    /// Pen time per stroke time, chosen so that the stroke lasts a whole number of ticks.
    pace: f64,
    /// Time in s from the beginning of the stroke to the beginning of the motion.
    from_s: f64,
    duration_s: f64,
}

impl Motion {
    /// Creates the motion along a stroke at a speed. Its duration is a multiple of `tick_s`, and
    /// long enough to keep the style's acceleration limit.
    pub(super) fn new(stroke: &PenStroke, speed_m_s: f64, style: &EvenStyle, tick_s: f64) -> Self {
        let smoothing = Smoothing::new(speed_m_s, style);
        let origin_m = stroke.points_m[0];
        let nodes = profile(stroke, &smoothing, speed_m_s);
        let mut pen = Pen::default();
        // The pen starts before the stroke and stops after it, so that its ends are not corners.
        let reach_s = smoothing.reach_s();
        let (first, last) = (nodes[0], nodes[nodes.len() - 1]);
        let [first_m_s, last_m_s] =
            [(nodes[0], nodes[1], first), (nodes[nodes.len() - 2], last, last)]
                .map(|(a, b, end)| (b.position_m - a.position_m).normalize() * end.speed_m_s);
        let before_m = first.position_m - origin_m - first_m_s * reach_s;
        pen.draw(before_m, first_m_s, Vector2::zeros(), reach_s);
        for ends in nodes.windows(2) {
            let [from, to] = [ends[0], ends[1]];
            let step_m = to.position_m - from.position_m;
            let (length_m, along) = (step_m.norm(), step_m.normalize());
            let duration_s = 2.0 * length_m / (from.speed_m_s + to.speed_m_s);
            let acceleration = along * ((to.speed_m_s - from.speed_m_s) / duration_s);
            pen.draw(from.position_m - origin_m, along * from.speed_m_s, acceleration, duration_s);
        }
        let pen_s = pen.end_s - reach_s;
        pen.draw(last.position_m - origin_m, last_m_s, Vector2::zeros(), 2.0 * reach_s);
        // The pen is slowed so that the stroke's duration is a whole number of ticks.
        let duration_s = in_ticks(pen_s, tick_s);
        let (pieces, pace) = (pen.pieces, pen_s / duration_s);
        let mut motion = Self { smoothing, origin_m, pieces, pace, from_s: 0.0, duration_s };
        // If the pen turns and changes its speed at the same time, the two accelerations add up.
        let excess = motion.max_acceleration_m_s2(0.5 * tick_s) / style.acceleration_m_s2;
        if excess > MAX_EXCESS {
            motion.duration_s = in_ticks(duration_s * excess.sqrt(), tick_s);
            motion.pace = pen_s / motion.duration_s;
        }
        motion
    }

    /// Returns the greatest acceleration in m/s², sampled at intervals of `step_s`.
    fn max_acceleration_m_s2(&self, step_s: f64) -> f64 {
        let steps = std::iter::successors(Some(0.0), |time_s| Some(time_s + step_s));
        let steps = steps.take_while(|time_s| *time_s <= self.duration_s);
        steps.map(|time_s| self.state_at(time_s).acceleration_m_s2.norm()).fold(0.0, f64::max)
    }

    /// Returns the duration in s from the motion's beginning.
    pub(super) fn duration_s(&self) -> f64 {
        self.duration_s - self.from_s
    }

    /// Returns the remaining motion after a time.
    pub(super) fn after(self, time_s: f64) -> Self {
        Self { from_s: self.from_s + time_s, ..self }
    }

    /// Returns the state at a time in s after the beginning, which is the pen's averaged state.
    pub(super) fn state_at(&self, time_s: f64) -> State {
        let Smoothing { long_s, short_s, .. } = self.smoothing;
        // The averages are centered on this pen time.
        let middle_s = (self.from_s + time_s) * self.pace + self.smoothing.reach_s();
        // Two moving averages are a second difference of the pen's second integral P, P(t + outer)
        // − P(t + inner) − P(t − inner) + P(t − outer), divided by the product of their lengths.
        let (outer_s, inner_s) = (0.5 * (long_s + short_s), 0.5 * (long_s - short_s));
        let terms = [(outer_s, 1.0), (inner_s, -1.0), (-inner_s, -1.0), (-outer_s, 1.0)];
        let mut average = State::default();
        for (offset_s, sign) in terms {
            let pen_s = middle_s + offset_s;
            let [pen, integral, second_integral] = self.piece_at(pen_s).integrals_at(pen_s);
            average.position_m += second_integral * sign;
            average.velocity_m_s += integral * sign;
            average.acceleration_m_s2 += pen * sign;
        }
        let area_s2 = long_s * short_s;
        State {
            position_m: self.origin_m + average.position_m / area_s2,
            velocity_m_s: average.velocity_m_s * (self.pace / area_s2),
            acceleration_m_s2: average.acceleration_m_s2 * (self.pace * self.pace / area_s2),
        }
    }

    /// Returns the piece of the pen's path at a pen time.
    fn piece_at(&self, time_s: f64) -> &Piece {
        let next = self.pieces.partition_point(|piece| piece.start_s <= time_s);
        &self.pieces[next.max(1) - 1]
    }
}

/// Returns a duration in s rounded up to a whole number of ticks, but at least one. A duration that
/// exceeds a whole number by rounding errors is not rounded up.
fn in_ticks(duration_s: f64, tick_s: f64) -> f64 {
    (duration_s / tick_s - SLACK_TICKS).ceil().max(1.0) * tick_s
}

/// Path of the pen that is being built.
#[derive(Debug, Default)]
struct Pen {
    pieces: Vec<Piece>,
    end_s: f64,
}

impl Pen {
    /// Adds a piece of constant acceleration that begins at a position with a velocity.
    fn draw(
        &mut self,
        position_m: Vector2<f64>,
        velocity_m_s: Vector2<f64>,
        acceleration_m_s2: Vector2<f64>,
        duration_s: f64,
    ) {
        let zero = Vector2::zeros();
        // The piece's integrals continue those of the previous piece.
        let before = self.pieces.last().map(|last| last.integrals_at(self.end_s));
        let [_, integral_m_s, second_integral_m_s2] = before.unwrap_or([position_m, zero, zero]);
        self.pieces.push(Piece {
            start_s: self.end_s,
            position_m,
            velocity_m_s,
            acceleration_m_s2,
            integral_m_s,
            second_integral_m_s2,
        });
        self.end_s += duration_s;
    }
}

impl Piece {
    /// Returns the pen's position (m) at a time, and its first (m s) and second (m s²) integrals up
    /// to that time.
    fn integrals_at(&self, time_s: f64) -> [Vector2<f64>; 3] {
        // The integrals of p + v t + a t²/2 follow from those of the powers of t.
        let t = time_s - self.start_s;
        let (p, v, a) = (self.position_m, self.velocity_m_s, self.acceleration_m_s2);
        let pen = p + v * t + a * (t * t / 2.0);
        let integral = p * t + v * (t * t / 2.0) + a * (t * t * t / 6.0);
        let second_integral =
            p * (t * t / 2.0) + v * (t * t * t / 6.0) + a * (t * t * t * t / 24.0);
        let second_integral = self.second_integral_m_s2 + self.integral_m_s * t + second_integral;
        [pen, self.integral_m_s + integral, second_integral]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_core::geometry::segment_distance;

    fn motion(points: &[[f64; 2]], speed_m_s: f64, corner_error_m: f64) -> Motion {
        let style = EvenStyle { corner_error_m, ..EvenStyle::default() };
        let stroke = PenStroke::even(0, points.iter().map(|p| Vector2::from(*p)).collect());
        Motion::new(&stroke, speed_m_s, &style, 0.05)
    }

    /// Returns the largest distance from the motion to a polyline, and the largest speed,
    /// acceleration and jerk.
    fn extremes(motion: &Motion, points: &[[f64; 2]]) -> [f64; 4] {
        let mut most = [0.0_f64; 4];
        let mut before: Option<State> = None;
        let dt_s = 0.001;
        let mut time_s = 0.0;
        while time_s <= motion.duration_s() {
            let now = motion.state_at(time_s);
            let point = [now.position_m.x, now.position_m.y];
            let distances = points.windows(2).map(|leg| segment_distance(point, [leg[0], leg[1]]));
            let jerk =
                before.map_or(0.0, |b| (now.acceleration_m_s2 - b.acceleration_m_s2).norm() / dt_s);
            let actual = [
                distances.fold(f64::INFINITY, f64::min),
                now.velocity_m_s.norm(),
                now.acceleration_m_s2.norm(),
                jerk,
            ];
            for (most, actual) in most.iter_mut().zip(actual) {
                *most = most.max(actual);
            }
            before = Some(now);
            time_s += dt_s;
        }
        most
    }

    const N: [[f64; 2]; 4] = [[0.0, 0.5], [0.0, 1.0], [0.3, 0.5], [0.3, 1.0]];

    #[test]
    fn a_straight_stroke_is_flown_at_one_speed_from_end_to_end() {
        let line = motion(&[[0.1, 0.5], [0.1, 1.0]], 0.2, 0.01);
        assert!((line.duration_s() - 2.5).abs() < 1e-12, "0.5 m at 0.2 m/s");
        for k in 0..=50 {
            let actual = line.state_at(0.05 * f64::from(k));
            let want = Vector2::new(0.1, 0.5 + 0.01 * f64::from(k));
            assert!((actual.position_m - want).norm() < 1e-9, "{actual:?}");
            assert!((actual.velocity_m_s - Vector2::new(0.0, 0.2)).norm() < 1e-9, "{actual:?}");
            assert!(actual.acceleration_m_s2.norm() < 1e-7, "{actual:?}");
        }
    }

    #[test]
    fn corners_keep_within_error_and_limits_at_any_speed() {
        for (speed, error_m) in [(0.2, 0.01), (0.2, 0.002), (0.5, 0.01), (0.5, 0.0005), (1.0, 0.02)]
        {
            let [off_m, m_s, m_s2, m_s3] = extremes(&motion(&N, speed, error_m), &N);
            assert!(off_m < error_m * 1.02 + 1e-9, "{speed} m/s, {error_m} m: {off_m} m off");
            assert!(m_s < speed * (1.0 + 1e-6), "{speed} m/s: {m_s} m/s");
            assert!(m_s2 < 2.0 * 1.04, "{speed} m/s, {error_m} m: {m_s2} m/s²");
            assert!(m_s3 < 30.0 * 1.05, "{speed} m/s, {error_m} m: {m_s3} m/s³");
        }
    }

    #[test]
    fn corners_cost_no_time_at_the_reference_speed() {
        let n = motion(&N, 0.2, 0.01);
        let length_m = 1.0 + libm::hypot(0.3, 0.5);
        assert!(n.duration_s() - length_m / 0.2 < 0.05, "{} s", n.duration_s());
    }

    #[test]
    fn a_circle_of_many_corners_is_a_circle() {
        let points: Vec<[f64; 2]> = (0..=100)
            .map(|k| {
                let (sin, cos) = libm::sincos(f64::from(k) * std::f64::consts::TAU / 100.0);
                [0.05 * cos, 0.05 * sin]
            })
            .collect();
        let [off_m, m_s, m_s2, _] = extremes(&motion(&points, 0.2, 0.01), &points);
        assert!(off_m < 0.003 && m_s < 0.2001, "{off_m} m, {m_s} m/s");
        assert!(m_s2 < 2.0 * 0.2 * 0.2 / 0.05, "centripetal: {m_s2} m/s²");
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives() {
        let n = motion(&N, 0.5, 0.01);
        let h = 1e-5;
        for k in 1..100 {
            let t = n.duration_s() * f64::from(k) / 100.0;
            let [before, now, after] = [n.state_at(t - h), n.state_at(t), n.state_at(t + h)];
            let slope = (after.position_m - before.position_m) / (2.0 * h);
            assert!((slope - now.velocity_m_s).norm() < 1e-5, "at {t}");
            let slope = (after.velocity_m_s - before.velocity_m_s) / (2.0 * h);
            assert!((slope - now.acceleration_m_s2).norm() < 1e-3, "at {t}");
        }
    }
}
