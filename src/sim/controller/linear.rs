//! Linearization at hover of a controller with memory, by finite differences of its code.
//!
//! One call of [`Controller::command`] maps the estimate's deviation from hover and the memory
//! (integrals, last measurements, filters) to motor commands and to the next memory. Central
//! differences of this map give a discrete system. The inverse of Tustin's transform converts it to
//! a continuous system with the same integrals. That system's derivatives are accurate far below
//! the command rate.
//!
//! Saturation and the hold time of a command are not modeled. The cascade's position loop, which
//! runs at a fifth of the rate, is treated as running at the full rate.

use nalgebra::{DMatrix, DVector, Vector3};

use super::{Reference, controller};
use crate::options::SimOptions;
use crate::vehicle::{Mixer, N_INPUTS, N_STATES, State};
use noctograph_core::error::Result;

/// Step of the differences, which is 0.1 mm, 0.1 mm/s, 0.1 mrad, 0.1 mrad/s, and as much in the
/// units of the memory. At this step, no loop saturates, and rounding is below 1e-9 of a gain.
const STEP: f64 = 1e-4;

/// Linear system `u = K x + H m` and `dm/dt = F m + G x`, where u is the wrench's deviation from
/// hover, `x` the state's deviation, and `m` the memory.
#[derive(Clone, Debug)]
pub(crate) struct LinearController {
    pub(crate) k: DMatrix<f64>,
    pub(crate) h: DMatrix<f64>,
    pub(crate) f: DMatrix<f64>,
    pub(crate) g: DMatrix<f64>,
}

impl LinearController {
    /// Linearizes the controller of the options at hover. Returns an error if the options give no
    /// gain.
    pub(crate) fn new(options: &SimOptions) -> Result<Self> {
        // The position loop runs at the full rate, so that all calls are equivalent.
        let mut options = options.clone();
        options.rates.position_hz = options.rates.attitude_hz();
        let tick_s = 1.0 / f64::from(options.rates.attitude_hz());
        let n = controller(&options)?.memory().len();
        // Central differences are taken over the states and the memory, column by column.
        let mut jacobian = DMatrix::zeros(N_INPUTS + n, N_STATES + n);
        for i in 0..N_STATES + n {
            let [up, down] = [STEP, -STEP].map(|step| response(&options, n, i, step));
            jacobian.set_column(i, &((up? - down?) / (2.0 * STEP)));
        }
        let (x, u) = (N_STATES, N_INPUTS);
        let parts = [((0, 0), (u, x)), ((0, x), (u, n)), ((u, x), (n, n)), ((u, 0), (n, x))];
        let [k, h, f, g] = parts.map(|(first, size)| jacobian.view(first, size).into_owned());
        Ok(Self { k, h, f, g }.continuous(tick_s))
    }

    /// Returns the continuous system that Tustin's `s = 2 (z − 1) / (T (z + 1))` converts to this
    /// one. `tick_s` is T.
    fn continuous(self, tick_s: f64) -> Self {
        // With M = (1 + F)⁻¹: F_c = 2/T (F − 1) M, K_c = K − H M G, H_c = 4/T H M².
        let one = DMatrix::identity(self.f.nrows(), self.f.nrows());
        let inverse = (&one + &self.f).try_inverse().expect("no memory alternates for ever");
        Self {
            f: (self.f - one) * &inverse * (2.0 / tick_s),
            k: self.k - &self.h * &inverse * &self.g,
            h: self.h * &inverse * &inverse * (4.0 / tick_s),
            g: self.g,
        }
    }
}

/// Returns the wrench (N m, N) and the next memory of a controller at hover, one below the other,
/// after a deviation of one input. `index` counts the states, followed by the `n` values of the
/// memory. The unit of `deviation` is that of the value that deviates.
fn response(options: &SimOptions, n: usize, index: usize, deviation: f64) -> Result<DVector<f64>> {
    let mut deviations = vec![0.0; N_STATES + n];
    deviations[index] = deviation;
    let (state, of_memory) = deviations.split_at(N_STATES);
    let mut controller = controller(options)?;
    controller.rest(&State::zeros());
    controller.memory().into_iter().zip(of_memory).for_each(|(value, change)| *value += change);
    let state = State::from_column_slice(state);
    let motors = controller.command(&state, &Reference::holding(Vector3::zeros())).motors;
    let wrench = Mixer::new(&options.vehicle).wrench(&motors);
    let next = controller.memory().into_iter().map(|value| *value);
    Ok(DVector::from_iterator(N_INPUTS + n, wrench.iter().copied().chain(next)))
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use super::*;
    use crate::gain_design::design;
    use crate::options::{ControllerKind, Law, PidOptions};
    use noctograph_core::crazyflie::GRAVITY_M_S2;

    #[test]
    fn the_geometric_law_is_linearized_to_its_own_gains() {
        let mut options = SimOptions::default();
        options.controller.kind = ControllerKind::Geometric;
        let linear = LinearController::new(&options).unwrap();
        let (gains, vehicle) = (&options.controller.geometric, &options.vehicle);
        let [_, j_y, _] = vehicle.inertia_kg_m2;
        assert_eq!(linear.f.nrows(), 6);
        let (k, mass_kg) = (&linear.k, vehicle.mass_kg);
        let forward = -j_y * gains.k_attitude[1] * gains.k_position / GRAVITY_M_S2;
        // The integral of the position error acts with the gain k_position_integral.
        let integral = linear.h.row(3) * linear.g.column(2);
        for (slope, want, what) in [
            (k[(3, 2)], -mass_kg * gains.k_position, "thrust per height"),
            (k[(3, 8)], -mass_kg * gains.k_velocity, "thrust per climb"),
            (k[(1, 10)], -j_y * gains.k_rate[1], "torque per pitch rate"),
            (k[(1, 0)], forward, "torque per distance"),
            (integral[0], -mass_kg * gains.k_position_integral, "thrust per integral"),
        ] {
            assert!((slope / want - 1.0).abs() < 2e-3, "{what}: {slope} instead of {want}");
        }
        assert!(linear.f.diagonal().norm() < 1e-6, "integrals do not decay: {}", linear.f);
    }

    fn n_memory(options: &SimOptions) -> usize {
        LinearController::new(options).unwrap().f.nrows()
    }

    #[test]
    fn the_cascades_memory_is_what_its_gains_use() {
        let mut options = SimOptions::cf21();
        options.controller.kind = ControllerKind::Pid;
        assert_eq!(n_memory(&options), 13, "ten integrals, three derivatives");
        let pid = &mut options.controller.pid;
        (pid.roll_rate[1], pid.pitch_rate[1]) = (0.0, 0.0);
        assert_eq!(n_memory(&options), 11, "no integral of the roll and pitch rate");
        options.controller.pid = PidOptions::default();
        options.vehicle.motor_rise_s = 0.0;
        assert_eq!(n_memory(&options), 21, "immediate motors need filters");
    }

    /// True if a hovering drone with a small tilt comes to rest under a controller whose commands
    /// reach one input `late_ticks` later.
    fn comes_to_rest(options: &SimOptions, input: usize, late_ticks: usize) -> bool {
        let options = options.rehearsal();
        let (vehicle, mixer) = (&options.vehicle, Mixer::new(&options.vehicle));
        let mut controller = controller(&options).unwrap();
        let at_rest = Reference::holding(Vector3::zeros());
        let tick_s = 1.0 / f64::from(options.rates.attitude_hz());
        let lag_s = 0.5 * (options.vehicle.motor_rise_s + options.vehicle.motor_fall_s);
        let remaining = libm::exp(-0.1 * tick_s / lag_s);
        let (mut state, hover) = (State::zeros(), vehicle.hover());
        controller.rest(&state);
        // At rest, the cascade does not command the hover thrust, which its integral adds in
        // flight.
        let base = mixer.wrench(&controller.command(&state, &at_rest).motors);
        controller.rest(&state);
        let mut rotors = hover;
        let mut underway: VecDeque<f64> = vec![0.0; late_ticks].into();
        state.fixed_rows_mut::<9>(3).fill(2e-4);
        let mut sizes = Vec::new();
        for _ in 0..5000 {
            let mut wanted = mixer.wrench(&controller.command(&state, &at_rest).motors) - base;
            underway.push_back(wanted[input]);
            wanted[input] = underway.pop_front().unwrap();
            for _ in 0..10 {
                rotors = (hover + wanted) + (rotors - hover - wanted) * remaining;
                state = vehicle.step(&state, &rotors, 0.1 * tick_s);
            }
            sizes.push(state.fixed_rows::<9>(3).norm());
            if sizes[sizes.len() - 1] > 0.5 {
                return false;
            }
        }
        let [late, early] = [&sizes[4500..], &sizes[2000..2500]]
            .map(|sizes| sizes.iter().copied().fold(0.0, f64::max));
        late < early
    }

    #[test]
    fn the_delay_that_the_margins_allow_is_that_of_the_simulated_drone() {
        let kinds = ControllerKind::ALL.iter();
        for &kind in kinds.filter(|kind| !matches!(kind.law(), Law::StateFeedback { .. })) {
            let mut options = SimOptions::cf21();
            options.controller.kind = kind;
            // With the firmware's gains, the delay margin is 3 ms, little more than a tick.
            options.controller.geometric.k_attitude = [330.0; 3];
            let lag_s = 0.5 * (options.vehicle.motor_rise_s + options.vehicle.motor_fall_s);
            let design = design(&options, lag_s).unwrap();
            assert!(design.k.is_none() && design.n_controller_states >= 3);
            let margins = design.lagging_margins.expect("stable");
            for (input, name) in [(1, "tau_y"), (3, "f_z")] {
                let one = margins[input];
                let delay_s = one.phase_rad.unwrap() / one.crossover_rad_s.unwrap();
                println!("{kind:?} {name}: {delay_s:.4} s, {one:?}");
                // Commands are held for 2 ms, which is a delay of 1 ms.
                for (fraction, rests) in [(0.8, true), (1.25, false)] {
                    #[expect(clippy::cast_possible_truncation, reason = "0 to 1000")]
                    let ticks = (fraction * delay_s / 0.002 - 0.5_f64).max(0.0) as usize;
                    let what = format!("{kind:?} {name}: {fraction} of {delay_s} s");
                    assert_eq!(comes_to_rest(&options, input, ticks), rests, "{what}");
                }
            }
        }
    }
}
