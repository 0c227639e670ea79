//! Linear-quadratic regulator about a held position, as the reference flight's.

use nalgebra::{SMatrix, SVector, Vector3};

use super::options::ControllerOptions;
use super::vehicle::{State, Vehicle, Wrench, at};
use crate::control::{linearise, lqr};
use crate::error::{Error, Result};

/// `u = i_hover − K (x̂ − x_des)`, where `x_des` is a position and nothing else: level, at rest.
#[derive(Clone, Debug)]
pub(super) struct Controller {
    k: SMatrix<f64, 4, 12>,
    hover: Wrench,
}

impl Controller {
    /// Gains for a vehicle, from its model at hover with the centre of mass in the middle.
    ///
    /// # Errors
    ///
    /// [`Error::Infeasible`] where the weights have no gain.
    pub(super) fn new(options: &ControllerOptions, vehicle: &Vehicle) -> Result<Self> {
        let hover = vehicle.hover();
        let (a, b) = linearise(|s, u| vehicle.derivative(s, u), &State::zeros(), &hover);
        let q = SMatrix::from_diagonal(&SVector::from(options.q));
        let r = SMatrix::from_diagonal(&SVector::from(options.r));
        let k = lqr(&a, &b, &q, &r).map_err(|error| Error::Infeasible {
            what: format!("controller.q and controller.r have no gain: {error}"),
            hint: error.hint().into(),
        })?;
        Ok(Self { k, hover })
    }

    /// What the motors should do to the body.
    pub(super) fn wrench(&self, estimate: &State, setpoint_m: Vector3<f64>) -> Wrench {
        self.hover - self.k * (estimate - at(setpoint_m, 0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::options::VehicleOptions;

    #[test]
    fn gain_is_the_published_one() {
        let want = [
            [(1, -0.003982), (5, 0.004536), (7, -0.001970), (9, 0.000557)],
            [(0, 0.004877), (4, 0.004880), (6, 0.002247), (10, 0.000568)],
            [(3, 0.001018), (11, 0.000306), (3, 0.001018), (11, 0.000306)],
            [(2, 0.364018), (8, 0.165290), (2, 0.364018), (8, 0.165290)],
        ];
        let vehicle = Vehicle::new(&VehicleOptions::default());
        let k = Controller::new(&ControllerOptions::default(), &vehicle).unwrap().k;
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
        let vehicle = Vehicle::new(&VehicleOptions::default());
        let controller = Controller::new(&ControllerOptions::default(), &vehicle).unwrap();
        let place = Vector3::new(0.3, 0.1, 0.8);
        assert_eq!(controller.wrench(&at(place, 0.0), place), vehicle.hover());
    }

    #[test]
    fn weights_without_a_gain_are_named() {
        let vehicle = Vehicle::new(&VehicleOptions::default());
        let options = ControllerOptions { q: [0.0; 12], ..Default::default() };
        let error = Controller::new(&options, &vehicle).unwrap_err().to_string();
        assert!(error.starts_with("controller.q"), "{error}");
    }
}
