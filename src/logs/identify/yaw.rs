//! The rotors' reaction torque from the yaw: `J_z Δw_z = k_M ∫ (−m1 + m2 − m3 + m4) dt + c Δt`.
//!
//! Body rates are differenced over spans that share no sample, so that the gyroscope's noise enters
//! each once; commands lag as the vehicle's motors do. The confidence comes from leaving out one
//! stretch of the flight after the other (jackknife over groups: Efron, Stein 1981), which gusts
//! that last from span to span do not deceive.

use super::{Assumed, mean, runs, signed_sum};
use noctograph_core::flight::{Flight, FlightSample};

/// Length of a span: short against a regulator's answer in yaw (0.1 to 0.3 s), long against the
/// 10 to 20 ms between two samples of a radio log.
const SPAN_S: f64 = 0.05;
/// Stretches of the flight that are left out in turn.
pub(super) const STRETCHES: usize = 20;
/// Fewest spans of a fit: ten to a stretch.
const FEWEST_SPANS: usize = 10 * STRETCHES;
/// Student's t of 95 % with nineteen degrees of freedom.
pub const T_95: f64 = 2.093;
/// Largest relative half width of the confidence interval of a usable result.
const LARGEST_DOUBT: f64 = 0.25;

/// A rotor's reaction torque, estimated from the yaw of a flight.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReactionTorque {
    /// Torque of one motor about its axis per unit of its command, N m.
    pub k_m_n_m: f64,
    /// Half the width of its confidence interval of 95 %, N m.
    pub half_width_n_m: f64,
    /// Correlation of the yaw's acceleration with the commanded yaw torque, −1 to 1.
    pub correlation: f64,
}

impl ReactionTorque {
    /// Whether the flight shows the figure to a quarter of its size. A flight that hardly turns
    /// does not, nor does a log that is too slow for its motor commands: with errors in the
    /// commands alone the figure is the true one times the square of the correlation (errors in
    /// variables: Fuller, Measurement Error Models, 1987, section 1.1).
    #[must_use]
    pub fn is_identifiable(&self) -> bool {
        let explained = self.correlation * self.correlation;
        self.half_width_n_m < LARGEST_DOUBT * self.k_m_n_m
            && explained * (1.0 + LARGEST_DOUBT) > 1.0
    }
}

/// Fits the reaction torque; `None` for a flight too short for a fit.
pub(super) fn reaction(
    flight: &Flight,
    samples: &[FlightSample],
    assumed: &Assumed,
) -> Option<ReactionTorque> {
    let spans = spans(flight, samples, assumed);
    if spans.len() < FEWEST_SPANS {
        return None;
    }
    let all = Fit::new(spans.iter().copied());
    let without = |stretch: usize| {
        let left = spans.iter().enumerate();
        let left = left.filter(|(i, _)| i * STRETCHES / spans.len() != stretch);
        Fit::new(left.map(|(_, span)| *span)).slope
    };
    let sigma = jackknife_sigma(&(0..STRETCHES).map(without).collect::<Vec<_>>());
    let j_z = assumed.inertia_z_kg_m2;
    Some(ReactionTorque {
        k_m_n_m: j_z * all.slope,
        half_width_n_m: j_z * T_95 * sigma,
        correlation: all.correlation,
    })
}

/// Standard deviation of an estimate, from those that leave out one stretch each.
pub(super) fn jackknife_sigma(estimates: &[f64]) -> f64 {
    let n = estimates.len() as f64;
    let middle = estimates.iter().sum::<f64>() / n;
    let square: f64 = estimates.iter().map(|x| (x - middle) * (x - middle)).sum();
    (square * (n - 1.0) / n).sqrt()
}

/// Mean of `−m1 + m2 − m3 + m4`, and yaw acceleration, over each span without a hole.
fn spans(flight: &Flight, samples: &[FlightSample], assumed: &Assumed) -> Vec<[f64; 2]> {
    let lag_s = assumed.motor_lag_s;
    let mut spans = Vec::new();
    for run in runs(flight, samples) {
        let (mut from, mut given, mut impulse) = (&run[0], signed_sum(2, &run[0].motors), 0.0);
        for pair in run.windows(2) {
            let dt_s = pair[1].time_s - pair[0].time_s;
            let stays = if lag_s > 0.0 { libm::exp(-dt_s / lag_s) } else { 0.0 };
            // A command acts from its sample on; its mean over the step while it is taken up.
            let wanted = signed_sum(2, &pair[0].motors);
            let taken = if lag_s > 0.0 { (1.0 - stays) * lag_s / dt_s } else { 0.0 };
            impulse += (wanted + (given - wanted) * taken) * dt_s;
            given = wanted + (given - wanted) * stays;
            let span_s = pair[1].time_s - from.time_s;
            if span_s >= SPAN_S - 1e-6 {
                let turned = pair[1].rate_body_rad_s.z - from.rate_body_rad_s.z;
                spans.push([impulse / span_s, turned / span_s]);
                (from, impulse) = (&pair[1], 0.0);
            }
        }
    }
    spans
}

/// A straight line through points.
struct Fit {
    slope: f64,
    correlation: f64,
}

impl Fit {
    fn new(points: impl Iterator<Item = [f64; 2]> + Clone) -> Self {
        let middle = mean(points.clone().map(nalgebra::Vector2::from));
        let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
        for [x, y] in points {
            let (x, y) = (x - middle.x, y - middle.y);
            (xx, xy, yy) = (xx + x * x, xy + x * y, yy + y * y);
        }
        // Without any change of the motors: slope 0, correlation 0.
        let part = |of: f64, by: f64| if by > 0.0 { of / by } else { 0.0 };
        Self { slope: part(xy, xx), correlation: part(xy, (xx * yy).sqrt()) }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::identify::identify;
    use crate::identify::tests::assumed_of;
    use noctograph_core::crazyflie::MOTOR_SIGNS;
    use noctograph_core::random::split_mix;
    use noctograph_sim::SimOptions;
    use noctograph_sim::vehicle::Plant;

    /// Half a minute of hovering while the yaw is pushed to and fro, logged at 100 Hz with a
    /// gyroscope's noise.
    fn pushed(options: &SimOptions, amplitude: f64) -> Flight {
        let vehicle = &options.vehicle;
        let hover = vehicle.mass_kg * 9.81 / (4.0 * vehicle.k_f_n);
        let mut plant = Plant::new(options.plant(), 0.001, 1, 0, Vector3::z() * 2.0);
        let mut key = 3;
        // The sum of twelve uniform numbers is nearly normal.
        let mut normal = || {
            let twelve = std::iter::repeat_with(|| {
                key = split_mix(key);
                f64::from(u32::try_from(key >> 32).unwrap()) / f64::from(u32::MAX)
            });
            twelve.take(12).sum::<f64>() - 6.0
        };
        let sample = |i: u32| {
            let push = if (i / 25).is_multiple_of(2) { amplitude } else { -amplitude };
            // As in every flight, roll is corrected all the time.
            let roll = if i.is_multiple_of(2) { 0.5 } else { -0.5 };
            let motors = [0, 1, 2, 3].map(|motor| {
                hover + push * MOTOR_SIGNS[(2, motor)] + roll * MOTOR_SIGNS[(0, motor)]
            });
            let body = plant.body();
            (0..10).for_each(|_| plant.advance(&motors));
            FlightSample {
                time_s: f64::from(i) * 0.01,
                position_m: body.position_m,
                rate_body_rad_s: body.rate_rad_s + Vector3::from_fn(|_, _| normal()) * 0.003,
                estimate_m: body.position_m,
                motors,
                ..FlightSample::default()
            }
        };
        Flight { samples: (0..3000).map(sample).collect(), ..Flight::default() }
    }

    fn balanced(mut options: SimOptions) -> SimOptions {
        options.vehicle.center_of_mass_m = [0.0, 0.0];
        options.battery.capacity_ah = 0.0;
        options
    }

    #[test]
    fn a_yaw_that_is_pushed_tells_the_reaction_torque_to_three_percent() {
        let mut lagging = balanced(SimOptions::default());
        (lagging.vehicle.motor_rise_s, lagging.vehicle.motor_fall_s) = (0.07, 0.07);
        for options in [balanced(SimOptions::default()), lagging] {
            let flight = pushed(&options, 500.0);
            let found = identify(&flight, &assumed_of(&options)).unwrap().reaction.unwrap();
            let want = options.vehicle.k_m_n_m;
            assert!((found.k_m_n_m / want - 1.0).abs() < 0.03, "{found:?} for {want}");
            assert!((found.k_m_n_m - want).abs() < found.half_width_n_m, "{found:?} for {want}");
            assert!(found.is_identifiable() && found.correlation > 0.9, "{found:?}");
        }
    }

    #[test]
    fn commands_that_a_log_misses_tell_nothing() {
        let options = balanced(SimOptions::default());
        let mut flight = pushed(&options, 500.0);
        for (n, sample) in flight.samples.iter_mut().enumerate() {
            let missed = if n % 10 < 5 { 800.0 } else { -800.0 };
            (0..4).for_each(|motor| sample.motors[motor] += missed * MOTOR_SIGNS[(2, motor)]);
        }
        let found = identify(&flight, &assumed_of(&options)).unwrap().reaction.unwrap();
        let share = found.k_m_n_m / options.vehicle.k_m_n_m;
        assert!(share < 0.7 && found.half_width_n_m < LARGEST_DOUBT * found.k_m_n_m, "{found:?}");
        assert!(!found.is_identifiable(), "{found:?}");
    }

    #[test]
    fn a_yaw_that_rests_tells_nothing() {
        let options = balanced(SimOptions::default());
        for amplitude in [0.0, 2.0] {
            let flight = pushed(&options, amplitude);
            let found = identify(&flight, &assumed_of(&options)).unwrap().reaction.unwrap();
            assert!(!found.is_identifiable(), "{amplitude}: {found:?}");
            assert!(found.correlation.abs() < 0.3, "{amplitude}: {found:?}");
        }
    }
}
