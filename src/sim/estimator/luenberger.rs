//! Luenberger observer of the reference flight. Its output is the measured position, its inputs are
//! body rate and specific force, and the yaw is integrated.

use nalgebra::{DMatrix, SMatrix, SVector, Vector3, Vector4};

use super::Estimator;
use crate::control::{self, dynamic, linearize};
use crate::options::LuenbergerOptions;
use crate::sensors::Readings;
use crate::vehicle::{Motion, State, YAW, motion_derivative, state};
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::error::{Error, Result};
use noctograph_core::geometry::{Attitude, turned};

/// Observer `x̂̇ = A x̂ + B u − L (C x̂ − y)` with `x̂ = [o_x o_y o_z θ φ v_x v_y v_z]`, `u = [w_x
/// w_y w_z a_z − g]` and the last measured position `y`. The yaw is not observable from positions,
/// so the observer runs without it.
#[derive(Clone, Debug)]
pub(super) struct Observer {
    /// Matrix `A − L C`.
    a: SMatrix<f64, 8, 8>,
    b: SMatrix<f64, 8, 4>,
    l: SMatrix<f64, 8, 3>,
    measured_m: Vector3<f64>,
    /// Estimate in a frame rotated by the heading at the start.
    estimate: SVector<f64, 8>,
    /// Yaw in rad from the heading at the start, toward the left.
    yaw_rad: f64,
    heading_rad: f64,
    rate_rad_s: Vector3<f64>,
}

impl Observer {
    /// Creates an observer for a drone that starts level and at rest. `heading_rad` is its heading
    /// from world x toward y. Returns an error if the weights give no gain.
    pub(super) fn new(
        options: &LuenbergerOptions,
        position_m: Vector3<f64>,
        heading_rad: f64,
    ) -> Result<Self> {
        let (a, b) = hover_model(linearize);
        let l = observer_gain(options, &a)?;
        let measured_m = turned(&position_m, -heading_rad);
        let mut estimate = SVector::<f64, 8>::zeros();
        estimate.fixed_rows_mut::<3>(0).copy_from(&measured_m);
        Ok(Self {
            a: without_yaw(&a) - l * SMatrix::<f64, 3, 8>::identity(),
            b: b.remove_row(YAW),
            l,
            measured_m,
            estimate,
            yaw_rad: 0.0,
            heading_rad,
            rate_rad_s: Vector3::zeros(),
        })
    }
}

impl Estimator for Observer {
    /// Integrates the observer over a tick, and the yaw from the gyroscope. The yaw drifts with the
    /// gyroscope's bias, because positions do not observe it.
    fn update(&mut self, readings: &Readings<'_>, tick_s: f64) {
        let w = readings.rate_rad_s;
        if let Some(measured_m) = readings.position_m {
            self.measured_m = turned(&measured_m, -self.heading_rad);
        }
        // Euler's method integrates the estimate. The last position is held between two fixes.
        let u = w.push(readings.specific_force_m_s2.z - GRAVITY_M_S2);
        self.estimate += (self.a * self.estimate + self.b * u + self.l * self.measured_m) * tick_s;
        self.yaw_rad += w.z * tick_s;
        self.rate_rad_s = w;
    }

    /// Returns the estimate in the world frame. The body rate is the gyroscope's last reading.
    fn state(&self) -> State {
        let x = &self.estimate;
        let position_m = turned(&x.fixed_rows::<3>(0).into(), self.heading_rad);
        let yaw_rad = self.heading_rad + self.yaw_rad;
        let attitude = Attitude { yaw_rad, pitch_rad: x[3], roll_rad: x[4] };
        state(&position_m, attitude, &x.fixed_rows::<3>(5).into(), &self.rate_rad_s)
    }
}

/// Returns the gain `L` (8×3) of the observer for the `A` of [`hover_model`] without the yaw, from
/// the options' weights, which are inverse variances. Returns [`Error::Infeasible`] if they give no
/// gain.
pub(crate) fn observer_gain(
    options: &LuenbergerOptions,
    a: &SMatrix<f64, 9, 9>,
) -> Result<SMatrix<f64, 8, 3>> {
    let model = SMatrix::from_diagonal(&SVector::from(options.r).map(|weight| 1.0 / weight));
    let measurement = SMatrix::from_diagonal(&SVector::from(options.q).map(|weight| 1.0 / weight));
    let (a, c) = (dynamic(&without_yaw(a)), DMatrix::identity(3, 8));
    let gain = control::observer_gain(&a, &c, &dynamic(&model), &dynamic(&measurement));
    let gain = gain.map_err(|error| {
        Error::infeasible(
            format!("observer.luenberger.q and .r give no stabilizing gain: {error}"),
            error.hint(),
        )
    })?;
    Ok(SMatrix::from_column_slice(gain.as_slice()))
}

/// Returns the matrix `A` without the row and the column of the yaw.
pub(crate) fn without_yaw(a: &SMatrix<f64, 9, 9>) -> SMatrix<f64, 8, 8> {
    a.remove_row(YAW).remove_column(YAW)
}

type Linear = (SMatrix<f64, 9, 9>, SMatrix<f64, 9, 4>);
type Derivative = fn(&Motion, &Vector4<f64>) -> Motion;

/// Returns `A` and `B` of all nine rows of [`Motion`] at hover, by the given method of
/// linearization. The inputs are the body rate and the specific force along z.
pub(crate) fn hover_model(
    linearize: impl Fn(Derivative, &Motion, &Vector4<f64>) -> Linear,
) -> Linear {
    let hover_input = Vector4::new(0.0, 0.0, 0.0, GRAVITY_M_S2);
    linearize(|motion, u| motion_derivative(motion, &u.xyz(), u[3]), &Motion::zeros(), &hover_input)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::RigidBody;

    fn at_rest(
        truth: &RigidBody,
        position_m: Vector3<f64>,
        rate_rad_s: Vector3<f64>,
    ) -> Readings<'_> {
        let force_m_s2 = Vector3::z() * GRAVITY_M_S2;
        let position_m = Some(position_m);
        Readings { position_m, ..Readings::inertial(truth, rate_rad_s, force_m_s2) }
    }

    fn observer() -> Observer {
        Observer::new(&LuenbergerOptions::default(), Vector3::zeros(), 0.0).unwrap()
    }

    #[test]
    fn a_wrong_start_is_forgotten() {
        let truth = Vector3::new(0.3, -0.2, 0.5);
        let mut observer = observer();
        let start = RigidBody::resting_at(Vector3::zeros());
        let readings = at_rest(&start, truth, Vector3::zeros());
        for _ in 0..2000 {
            observer.update(&readings, 0.002);
        }
        let state = observer.state();
        assert!((state.fixed_rows::<3>(0) - truth).norm() < 1e-6, "{state}");
        assert!(state.fixed_rows::<9>(3).norm() < 1e-6, "{state}");
    }

    #[test]
    fn yaw_is_the_integral_of_the_gyro() {
        let mut observer = observer();
        let start = RigidBody::resting_at(Vector3::zeros());
        let readings = at_rest(&start, Vector3::zeros(), Vector3::z() * 0.5);
        for _ in 0..1000 {
            observer.update(&readings, 0.002);
        }
        assert!((observer.state()[YAW] - 1.0).abs() < 1e-12, "0.5 rad/s for 2 s");
    }
}
