//! What a regulator knows of rotors that lag.
//!
//! A regulator that takes the motors for immediate oscillates on a drone whose rotors need a tenth of
//! a second. This one is designed on the model to which the four lagging inputs are added as states
//! (Anderson, Moore, "Optimal Control", 1990, chapter 3). Nothing measures them: the controller runs
//! the lag itself, on the commands that it sent.

use nalgebra::{Const, DimMin, Matrix4, SMatrix, SVector};

use super::lqr::without_gain;
use super::options::MotorLag;
use crate::control::{lqr, with_input_lag};
use crate::error::Result;
use crate::sim::options::SimOptions;
use crate::sim::vehicle::Wrench;

/// Feedback `u = u_ref − K (x̂ − x_ref) − K_u (û − u_ref)`, where û is what the rotors are believed
/// to give.
#[derive(Clone, Debug)]
pub(in crate::sim) struct Gain<const N: usize> {
    pub(in crate::sim) k: SMatrix<f64, 4, N>,
    /// Zero where the rotors are taken for immediate.
    pub(in crate::sim) k_rotor: Matrix4<f64>,
}

impl<const N: usize> Gain<N>
where
    Const<N>: DimMin<Const<N>, Output = Const<N>>,
{
    /// Gain for `ẋ = A x + B u` with the weights Q (diagonal) and those of the options for the
    /// inputs. `P` is `N + 4`.
    ///
    /// # Errors
    ///
    /// [`crate::error::Error::Infeasible`] where the weights have no gain.
    pub(in crate::sim) fn new<const P: usize>(
        options: &SimOptions,
        a: &SMatrix<f64, N, N>,
        b: &SMatrix<f64, N, 4>,
        q: &SVector<f64, N>,
    ) -> Result<Self>
    where
        Const<P>: DimMin<Const<P>, Output = Const<P>>,
    {
        let r = SVector::from(options.controller.r);
        let Some(lag_s) = known_lag_s(options) else {
            let (q, r) = (SMatrix::from_diagonal(q), SMatrix::from_diagonal(&r));
            let k = lqr(a, b, &q, &r).map_err(without_gain)?;
            return Ok(Self { k, k_rotor: Matrix4::zeros() });
        };
        // Inputs in units that cost 1, so that newtons and millinewton metres are of one size.
        let size = SMatrix::from_diagonal(&r.map(|r| 1.0 / r.sqrt()));
        let per_size = SMatrix::from_diagonal(&r.map(f64::sqrt));
        let (a, b, _) = with_input_lag::<N, 4, P>(a, &(b * size), &SMatrix::zeros(), lag_s);
        let q = SMatrix::from_diagonal(&q.fixed_resize::<P, 1>(0.0));
        let k = lqr(&a, &b, &q, &Matrix4::identity()).map_err(without_gain)?;
        Ok(Self {
            k: size * k.fixed_columns::<N>(0),
            k_rotor: size * k.fixed_columns::<4>(N) * per_size,
        })
    }
}

/// The lag that a regulator is designed for: the mean of rise and fall, `None` where the motors obey
/// at once or shall be taken to.
pub(in crate::sim) fn known_lag_s(options: &SimOptions) -> Option<f64> {
    let lag_s = 0.5 * (options.vehicle.motor_rise_s + options.vehicle.motor_fall_s);
    (lag_s > 0.0 && options.controller.motor_lag == MotorLag::Modelled).then_some(lag_s)
}

/// Rotors as a controller believes in them.
#[derive(Clone, Debug)]
pub(super) struct RotorModel {
    /// What is left of an old command when the next one is sent; 0 where rotors are immediate.
    stays: f64,
    wrench: Wrench,
}

impl RotorModel {
    /// Rotors that carry the drone in hover.
    pub(super) fn new(options: &SimOptions, hover: Wrench) -> Self {
        let tick_s = 1.0 / f64::from(options.rates.attitude_hz());
        let stays = known_lag_s(options).map_or(0.0, |lag_s| libm::exp(-tick_s / lag_s));
        Self { stays, wrench: hover }
    }

    /// What they give now.
    pub(super) fn wrench(&self) -> &Wrench {
        &self.wrench
    }

    /// A wrench was sent, and is held until the next is.
    pub(super) fn send(&mut self, wrench: &Wrench) {
        self.wrench = wrench + (self.wrench - wrench) * self.stays;
    }

    /// They stand still.
    pub(super) fn rest(&mut self) {
        self.wrench = Wrench::zeros();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::linearise;
    use crate::sim::vehicle::{State, Vehicle};

    fn gain(options: &SimOptions) -> Gain<12> {
        let vehicle = Vehicle::new(&options.vehicle);
        let (a, b) = linearise(|s, u| vehicle.derivative(s, u), &State::zeros(), &vehicle.hover());
        Gain::new::<16>(options, &a, &b, &SVector::from(options.controller.q)).unwrap()
    }

    #[test]
    fn gain_on_sixteen_states_is_that_of_scipy() {
        // SciPy 1.17.1, `solve_continuous_are` on the scaled problem, lag 0.121 s, the team's
        // weights.
        let team = SimOptions::default().controller;
        let found = gain(&SimOptions { controller: team, ..SimOptions::cf21() });
        for (found, want) in [
            (found.k[(1, 0)], 0.004_876_789_371_787_908),
            (found.k[(1, 4)], 0.006_612_203_428_033_52),
            (found.k[(3, 2)], 0.364_017_628_587_216_3),
            (found.k_rotor[(1, 1)], 2.885_381_350_569_77),
            (found.k_rotor[(3, 3)], 0.568_869_269_857_286_6),
        ] {
            assert!((found / want - 1.0).abs() < 1e-8, "{found} against {want}");
        }
    }

    #[test]
    fn rotors_taken_for_immediate_leave_the_plain_gain() {
        let mut options = SimOptions::cf21();
        options.controller.motor_lag = MotorLag::Ignored;
        let plain = gain(&options);
        assert_eq!(plain.k_rotor, Matrix4::zeros());
        assert!((gain(&SimOptions::cf21()).k - plain.k).norm() > 1e-3);
        let mut immediate = RotorModel::new(&options, Wrench::zeros());
        immediate.send(&Wrench::w());
        assert_eq!(*immediate.wrench(), Wrench::w());
    }

    #[test]
    fn believed_rotors_follow_as_the_lag_says() {
        let mut options = SimOptions::cf21();
        (options.vehicle.motor_rise_s, options.vehicle.motor_fall_s) = (0.1, 0.1);
        let mut rotors = RotorModel::new(&options, Wrench::zeros());
        (0..50).for_each(|_| rotors.send(&Wrench::w()));
        assert!((rotors.wrench()[3] - (1.0 - libm::exp(-1.0))).abs() < 1e-12);
        rotors.rest();
        assert_eq!(*rotors.wrench(), Wrench::zeros());
    }
}
