//! Linear-quadratic regulator, as the reference flight's, and with the design fed forward.

use nalgebra::{SMatrix, SVector};

use super::rotor_model::{Gain, RotorModel};
use super::{Command, Controller, Reference};
use crate::control::linearise;
use crate::error::{Error, Result};
use crate::sim::mixer::Mixer;
use crate::sim::options::SimOptions;
use crate::sim::vehicle::{State, Vehicle, Wrench, at};

/// What a regulator makes of a setpoint.
#[derive(Clone, Copy, Debug)]
pub(super) enum Follows {
    /// Its position, held as it was sent: level, at rest. The drone trails by half a second.
    Setpoint,
    /// The design as it moves on: position, velocity, and the attitude and the thrust that its
    /// acceleration needs.
    Design,
}

/// `u = u_ref − K (x̂ − x_ref) − K_u (û − u_ref)`; the last term where the rotors lag.
#[derive(Clone, Debug)]
pub(super) struct Lqr {
    gain: Gain<12>,
    rotors: RotorModel,
    hover: Wrench,
    mass_kg: f64,
    mixer: Mixer,
    follows: Follows,
}

impl Lqr {
    /// Gains for a vehicle, from its model at hover with the centre of mass in the middle.
    ///
    /// # Errors
    ///
    /// [`Error::Infeasible`] where the weights have no gain.
    pub(super) fn new(options: &SimOptions, follows: Follows) -> Result<Self> {
        let vehicle = Vehicle::new(&options.vehicle);
        let hover = vehicle.hover();
        let (a, b) = linearise(|s, u| vehicle.derivative(s, u), &State::zeros(), &hover);
        let gain = lqr_gain(options, &a, &b)?;
        let (mixer, rotors) = (Mixer::new(&options.vehicle), RotorModel::new(options, hover));
        Ok(Self { gain, rotors, hover, mass_kg: options.vehicle.mass_kg, mixer, follows })
    }

    /// What the motors should do to the body.
    fn wrench(&self, estimate: &State, reference: &Reference) -> Wrench {
        let (state, trim) = match self.follows {
            Follows::Setpoint => (at(reference.held_m, 0.0), self.hover),
            Follows::Design => {
                let (state, thrust_m_s2) = reference.trim();
                (state, Wrench::new(0.0, 0.0, 0.0, self.mass_kg * thrust_m_s2))
            }
        };
        let Gain { k, k_rotor } = &self.gain;
        trim - k * (estimate - state) - k_rotor * (self.rotors.wrench() - trim)
    }
}

impl Controller for Lqr {
    fn command(&mut self, estimate: &State, reference: &Reference) -> Command {
        let (motors, saturated) = self.mixer.motors(&self.wrench(estimate, reference));
        self.rotors.send(&self.mixer.wrench(&motors));
        Command { motors, saturated }
    }

    fn rest(&mut self, _: &State) {
        self.rotors.rest();
    }
}

/// The gain for the model `ẋ = A x + B u`.
///
/// # Errors
///
/// [`Error::Infeasible`] where the weights have no gain.
pub(in crate::sim) fn lqr_gain(
    options: &SimOptions,
    a: &SMatrix<f64, 12, 12>,
    b: &SMatrix<f64, 12, 4>,
) -> Result<Gain<12>> {
    Gain::new::<16>(options, a, b, &SVector::from(options.controller.q))
}

/// Names the weights that have no gain.
pub(super) fn without_gain(error: Error) -> Error {
    Error::Infeasible {
        what: format!("controller.q and controller.r have no gain: {error}"),
        hint: error.hint().into(),
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::sim::options::ControllerOptions;

    fn default_lqr() -> Lqr {
        Lqr::new(&SimOptions::default(), Follows::Setpoint).unwrap()
    }

    #[test]
    fn gain_is_the_published_one() {
        let want = [
            [(1, -0.003982), (5, 0.004536), (7, -0.001970), (9, 0.000557)],
            [(0, 0.004877), (4, 0.004880), (6, 0.002247), (10, 0.000568)],
            [(3, 0.001018), (11, 0.000306), (3, 0.001018), (11, 0.000306)],
            [(2, 0.364018), (8, 0.165290), (2, 0.364018), (8, 0.165290)],
        ];
        let k = default_lqr().gain.k;
        let mut rest = k;
        for (row, entries) in want.iter().enumerate() {
            for &(column, value) in entries {
                let found = k[(row, column)];
                assert!((found - value).abs() < 5.1e-7, "K[{row}, {column}] is {found}");
                rest[(row, column)] = 0.0;
            }
        }
        assert!(rest.norm() < 1e-9, "all others are zero: {rest}");
    }

    #[test]
    fn a_drone_in_place_is_asked_for_its_weight_alone() {
        let controller = default_lqr();
        let place = Vector3::new(0.3, 0.1, 0.8);
        let reference = Reference {
            held_m: place,
            position_m: Vector3::zeros(),
            velocity_m_s: Vector3::x(),
            acceleration_m_s2: Vector3::x(),
        };
        assert_eq!(controller.wrench(&at(place, 0.0), &reference), controller.hover);
    }

    #[test]
    fn a_drone_that_follows_its_design_is_asked_for_the_thrust_of_it_alone() {
        let controller = Lqr::new(&SimOptions::default(), Follows::Design).unwrap();
        let reference = Reference {
            held_m: Vector3::zeros(),
            position_m: Vector3::new(0.3, 0.1, 0.8),
            velocity_m_s: Vector3::new(0.2, 0.1, -0.1),
            acceleration_m_s2: Vector3::new(0.0, 0.0, 1.19),
        };
        let found = controller.wrench(&reference.trim().0, &reference);
        let want = Wrench::new(0.0, 0.0, 0.0, 0.0351 * 11.0);
        assert!((found - want).norm() < 1e-15, "{found}");
    }

    #[test]
    fn weights_without_a_gain_are_named() {
        let controller = ControllerOptions { q: [0.0; 12], ..Default::default() };
        let options = SimOptions { controller, ..Default::default() };
        let error = Lqr::new(&options, Follows::Setpoint).unwrap_err().to_string();
        assert!(error.starts_with("controller.q"), "{error}");
    }
}
