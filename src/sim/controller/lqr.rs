//! Linear-quadratic regulators, which are that of the reference flight, one with feedforward of the
//! reference, and one with integral action. Integral action removes the constant error that a
//! constant disturbance causes.

use nalgebra::{Matrix4, SMatrix, Vector3};

use super::gain::{Gain, modeled_lag_s, with_integrals};
use super::{Command, Controller, Reference};
use crate::control::linearize;
use crate::options::SimOptions;
use crate::vehicle::{Mixer, N_STATES, State, Wrench, at_rest, position};
use noctograph_core::error::Result;

/// Bound per axis, in m s, of the integral of the position error. The reference flight's center of
/// mass requires 0.16 m s. A larger integral would take seconds to decrease again.
const MAX_SUM: f64 = 1.0;

/// Control law `u = u_ref − K (x̂ − x_ref) − K_i ∫(ô − o_ref) dt − K_u (û − u_ref)`, in which the
/// last term is for lagging rotors.
///
/// The reference is either the held setpoint, at rest and level, which the drone trails by half a
/// second, or the moving reference with the attitude and the thrust that its acceleration requires.
/// With held setpoints, an integral would overshoot by as much as the drone trails. The regulator
/// with integrals therefore follows the moving reference.
#[derive(Clone, Debug)]
pub(super) struct Lqr {
    k: SMatrix<f64, 4, 12>,
    /// Gain of the integrals, which is zero without integral action.
    k_integral: SMatrix<f64, 4, 3>,
    k_rotor: Matrix4<f64>,
    follows_reference: bool,
    hover: Wrench,
    mass_kg: f64,
    mixer: Mixer,
    tick_s: f64,
    /// Output of the modeled rotors, which is not measured.
    rotors: Wrench,
    /// Fraction of the rotors' old output that remains at the next command, or 0 without lag.
    remaining: f64,
    /// Integral of the position error in m s.
    sum: Vector3<f64>,
}

impl Lqr {
    /// Creates the regulator that the options describe, from the hover model with a centered mass.
    /// Returns an error if the weights give no gain.
    pub(super) fn new(options: &SimOptions) -> Result<Self> {
        // The model is linearized at hover and augmented by integrals. The gain is split by
        // columns.
        let vehicle = &options.vehicle;
        let hover = vehicle.hover();
        let (a, b) = linearize(|s, u| vehicle.derivative(s, u), &State::zeros(), &hover);
        let kind = options.controller.kind;
        let Gain { k, k_rotor } = Gain::new(options, &with_integrals(options, &a, &b))?;
        let k_integral = kind.integrates().then(|| k.fixed_view::<4, 3>(0, N_STATES).into_owned());
        let tick_s = 1.0 / f64::from(options.rates.attitude_hz());
        Ok(Self {
            k: k.fixed_view::<4, N_STATES>(0, 0).into_owned(),
            k_integral: k_integral.unwrap_or_default(),
            k_rotor,
            follows_reference: kind.follows_reference(),
            hover,
            mass_kg: options.vehicle.mass_kg,
            mixer: Mixer::new(&options.vehicle),
            tick_s,
            rotors: hover,
            remaining: modeled_lag_s(options).map_or(0.0, |lag_s| libm::exp(-tick_s / lag_s)),
            sum: Vector3::zeros(),
        })
    }

    /// Returns the desired wrench, not limited to the motors' range, and the position error in m
    /// (estimate minus reference, world frame).
    fn wrench(&self, estimate: &State, reference: &Reference) -> (Wrench, Vector3<f64>) {
        let (state, trim) = if self.follows_reference {
            let (state, thrust_m_s2) = reference.trim();
            (state, Wrench::new(0.0, 0.0, 0.0, self.mass_kg * thrust_m_s2))
        } else {
            (at_rest(reference.held_m, 0.0), self.hover)
        };
        let (error, rotors) = (estimate - state, self.rotors - trim);
        let wrench = trim - self.k * error - self.k_integral * self.sum - self.k_rotor * rotors;
        (wrench, position(&error))
    }

    /// Adds a tick's error to the integral, within its bound. If the motors are saturated, the
    /// integral can only decrease (anti-windup by conditional integration).
    fn integrate(&mut self, error_m: &Vector3<f64>, saturated: bool) {
        for (sum, axis_m) in self.sum.iter_mut().zip(error_m) {
            if !saturated || *sum * axis_m < 0.0 {
                *sum = (*sum + axis_m * self.tick_s).clamp(-MAX_SUM, MAX_SUM);
            }
        }
    }

    /// Advances the modeled rotors, which follow a commanded wrench, to the next tick.
    fn advance_rotors(&mut self, wrench: &Wrench) {
        self.rotors = wrench + (self.rotors - wrench) * self.remaining;
    }

    /// Returns the command, with `thrust_n` as the collective thrust if it is given. Advances the
    /// modeled rotors and the integral by a tick.
    pub(super) fn command_with_thrust(
        &mut self,
        estimate: &State,
        reference: &Reference,
        thrust_n: Option<f64>,
    ) -> Command {
        // The modeled rotors follow the clamped motor commands, not the desired wrench.
        let (mut wrench, error_m) = self.wrench(estimate, reference);
        wrench[3] = thrust_n.unwrap_or(wrench[3]);
        let (motors, saturated) = self.mixer.motors(&wrench);
        self.advance_rotors(&self.mixer.wrench(&motors));
        self.integrate(&error_m, saturated);
        Command { motors, saturated }
    }
}

impl Controller for Lqr {
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command {
        self.command_with_thrust(estimate, reference, None)
    }

    fn rest(&mut self, _: &State) {
        self.sum = Vector3::zeros();
        self.rotors = Wrench::zeros();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::ControllerKind;

    fn regulator(kind: ControllerKind) -> Lqr {
        let mut options = SimOptions::default();
        options.controller.kind = kind;
        Lqr::new(&options).unwrap()
    }

    #[test]
    fn without_error_a_regulator_commands_its_trim() {
        let reference = Reference {
            held_m: Vector3::new(0.3, 0.1, 0.8),
            position_m: Vector3::new(0.3, 0.2, 0.8),
            velocity_m_s: Vector3::new(0.2, 0.1, -0.1),
            acceleration_m_s2: Vector3::new(0.0, 0.0, 1.19),
            jerk_m_s3: Vector3::zeros(),
        };
        let held = regulator(ControllerKind::Lqr);
        assert_eq!(held.wrench(&at_rest(reference.held_m, 0.0), &reference).0, held.hover);
        let design = regulator(ControllerKind::LqrFeedforward);
        let wrench = design.wrench(&reference.trim().0, &reference).0;
        let want = Wrench::new(0.0, 0.0, 0.0, 0.0351 * 11.0);
        assert!((wrench - want).norm() < 1e-15, "{wrench}");
    }

    #[test]
    fn a_saturated_command_stops_the_integral_from_growing_but_not_from_shrinking() {
        let mut controller = regulator(ControllerKind::LqrIntegral);
        let error = Vector3::new(0.5, -0.5, 0.5);
        controller.integrate(&error, true);
        assert_eq!(controller.sum, Vector3::zeros(), "held");
        (0..100_000).for_each(|_| controller.integrate(&error, false));
        assert_eq!(controller.sum, Vector3::new(1.0, -1.0, 1.0), "bounded");
        (0..500).for_each(|_| controller.integrate(&-error, true));
        assert!((controller.sum - error).norm() < 1e-9, "unwound: {}", controller.sum);
        controller.rest(&State::zeros());
        assert_eq!(controller.sum, Vector3::zeros(), "forgotten");
    }

    #[test]
    fn weights_without_a_gain_are_named() {
        fn refused(kind: ControllerKind, change: fn(&mut SimOptions)) -> String {
            let mut options = SimOptions::default();
            options.controller.kind = kind;
            change(&mut options);
            Lqr::new(&options).unwrap_err().to_string()
        }
        let without = refused(ControllerKind::Lqr, |o| o.controller.lqr.q = [0.0; 12]);
        assert!(without.starts_with("controller.lqr.q"), "{without}");
        let without =
            refused(ControllerKind::LqrIntegral, |o| o.controller.lqr.q_integral = [0.0; 3]);
        assert!(without.contains("no stabilizing gain"), "{without}");
    }

    #[test]
    fn modeled_rotors_follow_with_their_lag() {
        let mut options = SimOptions::cf21();
        (options.vehicle.motor_rise_s, options.vehicle.motor_fall_s) = (0.1, 0.1);
        let mut controller = Lqr::new(&options).unwrap();
        controller.rest(&State::zeros());
        (0..50).for_each(|_| controller.advance_rotors(&Wrench::w()));
        assert!((controller.rotors[3] - (1.0 - libm::exp(-1.0))).abs() < 1e-12);
        let mut immediate = regulator(ControllerKind::Lqr);
        immediate.advance_rotors(&Wrench::w());
        assert_eq!(immediate.rotors, Wrench::w());
    }
}
