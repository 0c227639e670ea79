//! Gains of the linear-quadratic regulators.
//!
//! A regulator designed for instantaneous motors oscillates on a drone whose rotors take a tenth of
//! a second to respond. For lagging rotors, the model is augmented by the four lagging inputs, and
//! for integral action by the three integrals of the position (Anderson, Moore, "Optimal Control",
//! 1990, chapters 3 and 4).

use nalgebra::{DMatrix, DVector, Matrix4, SMatrix, Vector4};

use crate::control::{dynamic, lqr, with_input_lag};
use crate::options::{LqrOptions, MotorLag, SimOptions};
use crate::vehicle::N_INPUTS;
use noctograph_core::error::{Error, Result};

/// Feedback `u = u_ref − K (x̂ − x_ref) − K_u (û − u_ref)` with the modeled rotors' output û.
#[derive(Clone, Debug)]
pub(crate) struct Gain {
    /// Gain K, 4×12, or 4×15 with integral action.
    pub(crate) k: DMatrix<f64>,
    /// Gain `K_u`, which is zero for instantaneous rotors.
    pub(crate) k_rotor: Matrix4<f64>,
}

impl Gain {
    /// Returns the gain for the model `ẋ = A x + B u` of [`with_integrals`], which is either the
    /// gain of `controller.lqr.k` or computed from the weights. Returns [`Error::Infeasible`] if no
    /// gain stabilizes the model.
    pub(crate) fn new(options: &SimOptions, [a, b]: &[DMatrix<f64>; 2]) -> Result<Self> {
        let weights = &options.controller.lqr;
        let n = a.nrows();
        // A given gain is extended by zeros if it has no columns for the rotors.
        if let Some(rows) = &weights.k {
            let entries = rows.iter().flatten().copied();
            let given = DMatrix::from_row_iterator(N_INPUTS, rows[0].len(), entries);
            let extended = given.resize_horizontally(n + N_INPUTS, 0.0);
            let k_rotor = extended.fixed_view::<4, 4>(0, n).into_owned();
            return Ok(Self { k: extended.columns(0, n).into_owned(), k_rotor });
        }
        let costs = weights.q.iter().chain(&weights.q_integral).copied().take(n);
        let r = Vector4::from(weights.r);
        let Some(lag_s) = modeled_lag_s(options) else {
            let q = DMatrix::from_diagonal(&DVector::from_iterator(n, costs));
            let r = dynamic(&Matrix4::from_diagonal(&r));
            let k = lqr(a, b, &q, &r).map_err(without_gain)?;
            return Ok(Self { k, k_rotor: Matrix4::zeros() });
        };
        // The inputs are scaled so that their weights are 1, which makes newtons and millinewton
        // meters comparable. The gain is scaled back at the end.
        let unit = Matrix4::from_diagonal(&r.map(|weight| 1.0 / weight.sqrt()));
        let per_unit = Matrix4::from_diagonal(&r.map(f64::sqrt));
        let b = b * dynamic(&unit);
        let [a, b, _] = with_input_lag(a, &b, &DMatrix::zeros(4, n), lag_s);
        let q = DMatrix::from_diagonal(&DVector::from_iterator(n + 4, costs.chain([0.0; 4])));
        let scaled = lqr(&a, &b, &q, &DMatrix::identity(4, 4)).map_err(without_gain)?;
        let k_rotor = unit * scaled.fixed_view::<4, 4>(0, n) * per_unit;
        Ok(Self { k: dynamic(&unit) * scaled.columns(0, n), k_rotor })
    }
}

/// Returns the matrices `A` and `B` of the model at hover. If the controller has integral action,
/// the integrals of the position are the states 12 to 14.
pub(crate) fn with_integrals(
    options: &SimOptions,
    a: &SMatrix<f64, 12, 12>,
    b: &SMatrix<f64, 12, 4>,
) -> [DMatrix<f64>; 2] {
    if !options.controller.kind.integrates() {
        return [dynamic(a), dynamic(b)];
    }
    let mut augmented = a.fixed_resize::<15, 15>(0.0);
    augmented.fixed_view_mut::<3, 3>(12, 0).fill_with_identity();
    [dynamic(&augmented), dynamic(&b.fixed_resize::<15, 4>(0.0))]
}

/// Returns the lag in s that a regulator models, which is the mean of the motors' rise and fall.
/// Returns `None` for instantaneous motors, for an ignored lag, and for a given gain without
/// columns for rotors.
pub(crate) fn modeled_lag_s(options: &SimOptions) -> Option<f64> {
    let lag_s = 0.5 * (options.vehicle.motor_rise_s + options.vehicle.motor_fall_s);
    let LqrOptions { motor_lag, k, .. } = &options.controller.lqr;
    // A gain has 12 columns, plus 3 for integrals and 4 for rotors.
    let is_modeled =
        k.as_ref().map_or(*motor_lag == MotorLag::Modeled, |k| matches!(k[0].len(), 16 | 19));
    (lag_s > 0.0 && is_modeled).then_some(lag_s)
}

/// Adds the keys of the weights to the error for a missing gain.
fn without_gain(error: Error) -> Error {
    Error::infeasible(
        format!("controller.lqr.q and .r give no stabilizing gain: {error}"),
        error.hint(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::linearize;
    use crate::options::ControllerKind;
    use crate::vehicle::State;

    fn gain(options: &SimOptions) -> Gain {
        let vehicle = &options.vehicle;
        let (a, b) = linearize(|s, u| vehicle.derivative(s, u), &State::zeros(), &vehicle.hover());
        Gain::new(options, &with_integrals(options, &a, &b)).unwrap()
    }

    #[test]
    fn gain_is_the_published_one() {
        let want = [
            (0, [(1, -0.003982), (5, 0.004536), (7, -0.001970), (9, 0.000557)].as_slice()),
            (1, &[(0, 0.004877), (4, 0.004880), (6, 0.002247), (10, 0.000568)]),
            (2, &[(3, 0.001018), (11, 0.000306)]),
            (3, &[(2, 0.364018), (8, 0.165290)]),
        ];
        let mut k = gain(&SimOptions::default()).k;
        for (row, entries) in want {
            for &(column, value) in entries {
                let gain = std::mem::replace(&mut k[(row, column)], 0.0);
                assert!((gain - value).abs() < 5.1e-7, "K[{row}, {column}] is {gain}");
            }
        }
        assert!(k.norm() < 1e-9, "all others are zero: {k}");
    }

    #[test]
    fn gain_for_lagging_rotors_is_that_of_scipy() {
        // The reference is SciPy 1.17.1, `solve_continuous_are` on the scaled problem of sixteen
        // states, with a lag of 0.121 s and the team's weights.
        let team = SimOptions::default().controller;
        let gain = gain(&SimOptions { controller: team, ..SimOptions::cf21() });
        for (entry, want) in [
            (gain.k[(1, 0)], 0.004_876_789_371_787_908),
            (gain.k[(1, 4)], 0.006_612_203_428_033_52),
            (gain.k[(3, 2)], 0.364_017_628_587_216_3),
            (gain.k_rotor[(1, 1)], 2.885_381_350_569_77),
            (gain.k_rotor[(3, 3)], 0.568_869_269_857_286_6),
        ] {
            assert!((entry / want - 1.0).abs() < 1e-8, "{entry} against {want}");
        }
    }

    #[test]
    fn a_given_gain_is_flown_as_it_is() {
        let mut options = SimOptions::cf21();
        let rows = (0..4).map(|row| (0..12).map(|i| f64::from(12 * row + i)).collect());
        options.controller.lqr.k = Some(rows.collect());
        let gain = gain(&options);
        assert_eq!((gain.k[(1, 0)], gain.k[(3, 11)]), (12.0, 47.0));
        assert_eq!(gain.k_rotor, Matrix4::zeros());
        assert_eq!(modeled_lag_s(&options), None);
    }

    #[test]
    fn the_designed_gain_with_its_rotors_is_the_same_when_it_is_given() {
        for kind in [ControllerKind::Lqr, ControllerKind::LqrIntegral] {
            let mut options = SimOptions::cf21();
            options.controller.kind = kind;
            let (designed, lag_s) = (gain(&options), modeled_lag_s(&options));
            let n = designed.k.ncols();
            let mut printed = designed.k.clone().resize_horizontally(n + 4, 0.0);
            printed.columns_mut(n, 4).copy_from(&designed.k_rotor);
            let rows = printed.row_iter().map(|row| row.iter().copied().collect());
            options.controller.lqr.k = Some(rows.collect());
            options.check().unwrap();
            let given = gain(&options);
            assert_eq!((&given.k, given.k_rotor), (&designed.k, designed.k_rotor));
            assert!(given.k_rotor.norm() > 1.0);
            assert_eq!(modeled_lag_s(&options), lag_s, "the rotors are modeled");
            (options.vehicle.motor_rise_s, options.vehicle.motor_fall_s) = (0.0, 0.0);
            let refused = options.check().unwrap_err().to_string();
            assert!(refused.contains(&format!("wanted 4 rows of {n} numbers")), "{refused}");
        }
    }

    #[test]
    fn an_ignored_lag_leaves_the_plain_gain() {
        let mut options = SimOptions::cf21();
        options.controller.lqr.motor_lag = MotorLag::Ignored;
        let plain = gain(&options);
        assert_eq!(plain.k_rotor, Matrix4::zeros());
        assert!((gain(&SimOptions::cf21()).k - plain.k).norm() > 1e-3);
    }
}
