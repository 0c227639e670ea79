//! Linear-quadratic regulator with integral action: no standing error under a constant disturbance.

use nalgebra::{Matrix4, SMatrix, SVector, Vector3};

use super::rotor_model::{Gain, RotorModel};
use super::{Command, Controller, Reference};
use crate::control::linearise;
use crate::error::Result;
use crate::sim::mixer::Mixer;
use crate::sim::options::SimOptions;
use crate::sim::vehicle::{State, Vehicle, Wrench, position};

/// Bound of the integral of the position error, m s per axis. The reference flight's centre of mass
/// needs 0.16; more than the bound would take seconds to undo.
const MAX_SUM: f64 = 1.0;

/// `u = u_ref − K (x̂ − x_ref) − K_i ∫(ô − o_ref) dt − K_u (û − u_ref)`, about the design as it moves
/// on; the last term where the rotors lag.
///
/// `[K K_i]` is the regulator of the model to which the three integrals are added as states
/// (Anderson, Moore, "Optimal Control", 1990, chapter 4). About held setpoints an integral would
/// overshoot by as much as the drone trails, so that this controller follows the design.
#[derive(Clone, Debug)]
pub(super) struct IntegralLqr {
    k: SMatrix<f64, 4, 12>,
    k_integral: SMatrix<f64, 4, 3>,
    k_rotor: Matrix4<f64>,
    rotors: RotorModel,
    mass_kg: f64,
    mixer: Mixer,
    tick_s: f64,
    /// Integral of the position error, m s.
    sum: Vector3<f64>,
}

impl IntegralLqr {
    /// # Errors
    ///
    /// [`crate::error::Error::Infeasible`] where the weights have no gain.
    pub(super) fn new(options: &SimOptions) -> Result<Self> {
        let vehicle = Vehicle::new(&options.vehicle);
        let (a, b) = linearise(|s, u| vehicle.derivative(s, u), &State::zeros(), &vehicle.hover());
        let Gain { k, k_rotor } = augmented_gain(options, &a, &b)?;
        Ok(Self {
            k_rotor,
            rotors: RotorModel::new(options, vehicle.hover()),
            k: k.fixed_columns::<12>(0).into_owned(),
            k_integral: k.fixed_columns::<3>(12).into_owned(),
            mass_kg: options.vehicle.mass_kg,
            mixer: Mixer::new(&options.vehicle),
            tick_s: 1.0 / f64::from(options.rates.attitude_hz()),
            sum: Vector3::zeros(),
        })
    }

    /// Adds a tick's error to the integral, but not where it would grow while the motors cannot
    /// follow, nor beyond its bound.
    fn integrate(&mut self, error_m: &Vector3<f64>, saturated: bool) {
        for (sum, error_m) in self.sum.iter_mut().zip(error_m) {
            if !saturated || *sum * error_m < 0.0 {
                *sum = (*sum + error_m * self.tick_s).clamp(-MAX_SUM, MAX_SUM);
            }
        }
    }
}

impl Controller for IntegralLqr {
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command {
        let (state, thrust_m_s2) = reference.trim();
        let error = estimate - state;
        let trim = Wrench::new(0.0, 0.0, 0.0, self.mass_kg * thrust_m_s2);
        let rotors = self.rotors.wrench() - trim;
        let wrench = trim - self.k * error - self.k_integral * self.sum - self.k_rotor * rotors;
        let (motors, saturated) = self.mixer.motors(&wrench);
        self.rotors.send(&self.mixer.wrench(&motors));
        self.integrate(&position(&error), saturated);
        Command { motors, saturated }
    }

    fn rest(&mut self, _: &State) {
        self.sum = Vector3::zeros();
        self.rotors.rest();
    }
}

/// The gain with `[K K_i]`, 4×15, for the model `ẋ = A x + B u` with the integrals of its position as states 12
/// to 14.
///
/// # Errors
///
/// [`crate::error::Error::Infeasible`] where the weights have no gain.
pub(in crate::sim) fn augmented_gain(
    options: &SimOptions,
    a: &SMatrix<f64, 12, 12>,
    b: &SMatrix<f64, 12, 4>,
) -> Result<Gain<15>> {
    let (a, b) = augmented(a, b);
    let mut q = SVector::<f64, 15>::zeros();
    q.fixed_rows_mut::<12>(0).copy_from(&SVector::from(options.controller.q));
    q.fixed_rows_mut::<3>(12).copy_from(&SVector::from(options.controller.q_integral));
    Gain::new::<19>(options, &a, &b, &q)
}

/// The model with the integrals of its position as states 12 to 14.
pub(in crate::sim) fn augmented(
    a: &SMatrix<f64, 12, 12>,
    b: &SMatrix<f64, 12, 4>,
) -> (SMatrix<f64, 15, 15>, SMatrix<f64, 15, 4>) {
    let mut a = a.fixed_resize::<15, 15>(0.0);
    a.fixed_view_mut::<3, 3>(12, 0).fill_with_identity();
    (a, b.fixed_resize::<15, 4>(0.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_command_stops_the_integral_from_growing_but_not_from_shrinking() {
        let mut controller = IntegralLqr::new(&SimOptions::default()).unwrap();
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
    fn without_weight_on_the_integrals_there_is_no_gain() {
        let mut options = SimOptions::default();
        options.controller.q_integral = [0.0; 3];
        let error = IntegralLqr::new(&options).unwrap_err().to_string();
        assert!(error.contains("no gain"), "{error}");
    }
}
