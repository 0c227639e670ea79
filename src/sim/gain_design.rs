//! Design of a drone's regulator and observer gains, with their stability margins.
//!
//! The input is [`SimOptions`] and a motor lag. The output is a [`Design`]. The model is linearized
//! at hover, both gains follow from their Riccati equations, and the closed loop's poles and
//! margins are computed for instantaneous and for lagging motors. The PID cascade and the geometric
//! controller have no such gain. For these, the controller's code is linearized at hover to obtain
//! poles and margins.
//!
//! The sources are the reference flight's design (AE483, 2022), and Bryson, Ho, "Applied Optimal
//! Control" (1975), for the weights. The gain is designed without the drone's drag. The printed
//! model and its poles and margins include the drag. The observer's effect on the margins and the
//! delay between ticks are not modeled.

use nalgebra::{Complex, DMatrix, Matrix4, SMatrix};
use serde::{Serialize, Serializer};

use super::controller::{Gain, LinearController, modeled_lag_s, with_integrals};
use super::estimator::{hover_model, observer_gain, without_yaw};
use super::options::{ControllerKind, Law, SimOptions};
use crate::control::{
    Margins, block_matrix, dynamic, is_hurwitz, linearize_finely, margins, observability_rank,
    poles, unobservable_states, with_input_lag,
};
use crate::vehicle::{Mixer, N_STATES, RATE, State, VELOCITY, VehicleOptions, Wrench};
use noctograph_core::crazyflie::{GRAVITY_M_S2, N_MOTORS};
use noctograph_core::diagnostic::Diagnostic;
use noctograph_core::error::{Result, within};

/// Lag of a Crazyflie's motors in s, for a vehicle that specifies none (Eschmann, Albani, Loianno,
/// "Data-driven system identification of quadrotors subject to motor delays", IROS 2024). Other
/// flights showed lags of 0.05 to 0.14 s.
pub const MOTOR_LAG_S: f64 = 0.072;
/// Smallest lag in s for which margins are computed.
const LEAST_LAG_S: f64 = 1e-6;
/// Maximum lag in s in the search for the longest stable lag.
const MAX_LAG_S: f64 = 1.0;
/// Number of bisections of the maximum lag, for a resolution of a microsecond.
const HALVINGS: u32 = 20;

/// Names of the states in the order of the columns of `K`. The first nine, except the yaw, are the
/// rows of `L`.
pub const STATES: [&str; 15] = [
    "o_x", "o_y", "o_z", "psi", "theta", "phi", "v_x", "v_y", "v_z", "w_x", "w_y", "w_z",
    "int o_x", "int o_y", "int o_z",
];
/// Names of the columns of `K` for lagging rotors, which are the modeled rotors' outputs.
const ROTOR_STATES: [&str; 4] = ["rotor tau_x", "rotor tau_y", "rotor tau_z", "rotor f_z"];
/// Names of the inputs in the order of the rows of `K`.
pub const INPUTS: [&str; 4] = ["tau_x", "tau_y", "tau_z", "f_z"];

/// Gains of a drone and their stability margins.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Design {
    /// Matrix A (12×12) of the drone at hover, `ẋ = A x + B u`, for the first twelve [`STATES`].
    #[serde(rename = "A", serialize_with = "rows")]
    pub a: DMatrix<f64>,
    /// Matrix B (12×4) of the drone at hover, for the [`INPUTS`].
    #[serde(rename = "B", serialize_with = "rows")]
    pub b: DMatrix<f64>,
    /// Gain of the regulator, 4×12, or 4×15 with integrals, in `u = u_hover − K (x̂ − x_des)`. The
    /// gain has four more columns if it is designed for lagging rotors. The gain is `None` for
    /// other controllers.
    #[serde(rename = "K", serialize_with = "rows")]
    pub k: Option<DMatrix<f64>>,
    /// Names of the columns of `K`, which are the first of [`STATES`] and those of the rotors.
    pub states: Vec<&'static str>,
    /// Number of controller states (integrals, last measurements, filters and modeled rotors).
    #[serde(rename = "controller_states")]
    pub n_controller_states: usize,
    /// Gain of the observer, 8×3, in `x̂̇ = A x̂ + B u − L (C x̂ − y)`, without the yaw.
    #[serde(rename = "L", serialize_with = "rows")]
    pub l: DMatrix<f64>,
    /// Number of the twelve states that the inputs can control.
    pub controllability_rank: usize,
    /// Number of the nine states of position, attitude and velocity that are observable from the
    /// measured position.
    pub observability_rank: usize,
    /// Names of the unobservable states.
    pub unobservable: Vec<&'static str>,
    /// Poles in 1/s of the loop with instantaneous motors, slowest first, or `None` if the
    /// iteration did not converge.
    pub regulator_poles: Option<Vec<Complex<f64>>>,
    /// Poles of the observer in 1/s.
    pub observer_poles: Option<Vec<Complex<f64>>>,
    /// Margins at each input with instantaneous motors, or `None` for an unstable loop.
    pub margins: Option<[Margins; 4]>,
    /// Lag of the motors in s for the lagging poles and margins.
    pub motor_lag_s: f64,
    /// Poles in 1/s of the loop with the motor lag.
    pub lagging_poles: Option<Vec<Complex<f64>>>,
    /// Margins at each input with the motor lag, or `None` for an unstable loop.
    pub lagging_margins: Option<[Margins; 4]>,
    /// Longest motor lag in s at which the loop is stable, or `None` if even a second is stable.
    pub longest_lag_s: Option<f64>,
    /// Largest deviation of each input from hover, in N m and N, within the motors' range.
    pub largest_inputs: [f64; 4],
    /// Weights by Bryson's rule for `controller.lqr.r`, which are 1 / deviation².
    pub bryson_r: [f64; 4],
    /// Warnings about the gains.
    #[serde(serialize_with = "messages")]
    pub warnings: Vec<Diagnostic>,
}

/// Serializes a matrix as an array of its rows, or `None` as null.
fn rows<'a, S: Serializer>(
    matrix: impl Into<Option<&'a DMatrix<f64>>>,
    to: S,
) -> std::result::Result<S::Ok, S::Error> {
    let rows = matrix.into().map(|matrix| {
        let entries = matrix.row_iter().map(|row| row.iter().copied().collect());
        entries.collect::<Vec<Vec<f64>>>()
    });
    rows.serialize(to)
}

/// Serializes warnings as an array of their messages.
fn messages<S: Serializer>(warnings: &[Diagnostic], to: S) -> std::result::Result<S::Ok, S::Error> {
    to.collect_seq(warnings.iter().map(ToString::to_string))
}

/// Plant `ẋ = A x + B u` with its feedback `u = −K x`.
struct Loop {
    a: DMatrix<f64>,
    b: DMatrix<f64>,
    k: DMatrix<f64>,
}

impl Loop {
    /// Returns the loop with inputs that follow their commands with a lag.
    fn lagging(&self, lag_s: f64) -> Self {
        let [a, b, k] = with_input_lag(&self.a, &self.b, &self.k, lag_s);
        Self { a, b, k }
    }

    /// Returns the matrix of the closed loop, `A − B K`.
    fn closed(&self) -> DMatrix<f64> {
        &self.a - &self.b * &self.k
    }

    /// Returns the margins at the four inputs. Returns `None` for a loop that is not stable.
    fn margins(&self) -> Option<[Margins; 4]> {
        margins(&self.a, &self.b, &self.k)?.try_into().ok()
    }
}

/// Designs the gains of the regulator and of the observer of a drone, and computes the loop's poles
/// and margins without and with a motor lag of `motor_lag_s`.
///
/// # Errors
///
/// Returns the errors of [`SimOptions::check`],
/// [`Error::Input`](noctograph_core::error::Error::Input) for a lag outside 1 µs to 1 s, and
/// [`Error::Infeasible`](noctograph_core::error::Error::Infeasible) if the weights give no gain.
pub fn design(options: &SimOptions, motor_lag_s: f64) -> Result<Design> {
    options.check()?;
    within("motor_lag_s", motor_lag_s, LEAST_LAG_S, MAX_LAG_S)?;
    // The model is linearized at hover. Gains are designed without drag, but evaluated with it.
    let vehicle = &options.vehicle;
    let (a, b) =
        linearize_finely(|s, u| vehicle.derivative(s, u), &State::zeros(), &vehicle.hover());
    let dragged_a = a + drag(vehicle);
    let (feedback, states) = feedback_loop(options, [&a, &dragged_a], &b)?;

    // Poles and margins are computed without and with lag. Bisection finds the longest lag.
    let lagging = feedback.lagging(motor_lag_s);
    let [regulator_poles, lagging_poles] = [&feedback, &lagging].map(|l| poles(&l.closed()));
    let lagging_margins = lagging.margins();
    let longest_lag_s = longest_lag_s(|lag_s| is_hurwitz(&feedback.lagging(lag_s).closed()));
    let warnings = warnings(
        options,
        motor_lag_s,
        [&regulator_poles, &lagging_poles],
        lagging_margins.is_some(),
        longest_lag_s,
    );

    // The observer has the nine states of `Motion`, with body rate and thrust as inputs. The yaw is
    // left out, because it is not observable from measured positions.
    let (motion_a, _) = hover_model(linearize_finely);
    let l = observer_gain(&options.observer.luenberger, &motion_a)?;
    let observer_a = without_yaw(&motion_a) - l * SMatrix::<f64, 3, 8>::identity();
    let (motion_a, position) = (dynamic(&motion_a), DMatrix::identity(3, 9));
    let unobservable = unobservable_states(&motion_a, &position);
    let largest_inputs = largest_inputs(vehicle);
    Ok(Design {
        a: dynamic(&dragged_a),
        b: dynamic(&b),
        n_controller_states: feedback.a.nrows() - a.nrows(),
        margins: feedback.margins(),
        k: (!states.is_empty()).then_some(feedback.k),
        states,
        controllability_rank: controllability_rank(&dragged_a, &b),
        observability_rank: observability_rank(&motion_a, &position),
        unobservable: unobservable.into_iter().map(|i| STATES[i]).collect(),
        regulator_poles,
        observer_poles: poles(&dynamic(&observer_a)),
        l: dynamic(&l),
        motor_lag_s,
        lagging_poles,
        warnings,
        lagging_margins,
        longest_lag_s,
        largest_inputs,
        bryson_r: largest_inputs.map(|largest| 1.0 / (largest * largest)),
    })
}

/// Returns the loop of the selected controller with the plant including drag, and the names of the
/// regulator's states, or none for other controllers. A regulator is designed for `A` without drag.
/// Returns an error if the weights give no gain.
fn feedback_loop(
    options: &SimOptions,
    [a, dragged_a]: [&SMatrix<f64, 12, 12>; 2],
    b: &SMatrix<f64, 12, 4>,
) -> Result<(Loop, Vec<&'static str>)> {
    Ok(match options.controller.kind.law() {
        Law::StateFeedback { .. } => {
            let gain = Gain::new(options, &with_integrals(options, a, b))?;
            regulator_loop(with_integrals(options, dragged_a, b), gain, modeled_lag_s(options))
        }
        Law::Cascade | Law::Geometric | Law::Own => {
            let controller = LinearController::new(options)?;
            (controller_loop(&dynamic(dragged_a), &dynamic(b), &controller), vec![])
        }
    })
}

/// Returns the number of controllable states of the drone, 0 to 12, by duality with observability.
fn controllability_rank(a: &SMatrix<f64, 12, 12>, b: &SMatrix<f64, 12, 4>) -> usize {
    // The scale of an input does not affect which states it can control.
    let unit_b = SMatrix::<f64, 12, 4>::from_fn(|i, j| b[(i, j)] / b.column(j).norm());
    observability_rank(&dynamic(&a.transpose()), &dynamic(&unit_b.transpose()))
}

/// Returns the loop of a regulator, opened at the motors, and the names of its states.
/// `modeled_lag_s` is the rotors' lag that the regulator models, whose four rotor states follow
/// those of the drone.
fn regulator_loop(
    [a, b]: [DMatrix<f64>; 2],
    gain: Gain,
    modeled_lag_s: Option<f64>,
) -> (Loop, Vec<&'static str>) {
    let n = a.nrows();
    let states = STATES[..n].iter().copied();
    let Some(modeled_lag_s) = modeled_lag_s else {
        return (Loop { a, b, k: gain.k }, states.collect());
    };
    // The modeled rotors follow the regulator's commands. They are therefore part of the regulator,
    // not of the loop opened at the motors. Their equation is τ dû/dt = u − û with u = −K x − K_u
    // û.
    let from_state = -&gain.k / modeled_lag_s;
    let decay = -(gain.k_rotor + Matrix4::identity()) / modeled_lag_s;
    let a = block_matrix(&a, &DMatrix::zeros(n, 4), &from_state, &dynamic(&decay));
    let mut k = gain.k.resize_horizontally(n + 4, 0.0);
    k.columns_mut(n, 4).copy_from(&gain.k_rotor);
    (Loop { a, b: b.resize_vertically(n + 4, 0.0), k }, states.chain(ROTOR_STATES).collect())
}

/// Returns the loop of a controller with a memory, opened at the motors. The states of the memory
/// follow the drone's twelve.
fn controller_loop(a: &DMatrix<f64>, b: &DMatrix<f64>, controller: &LinearController) -> Loop {
    let LinearController { k, h, f, g } = controller;
    let m = f.nrows();
    let a = block_matrix(a, &DMatrix::zeros(N_STATES, m), g, f);
    let mut k = (-k).resize_horizontally(N_STATES + m, 0.0);
    k.columns_mut(N_STATES, m).copy_from(&-h);
    Loop { a, b: b.clone().resize_vertically(N_STATES + m, 0.0), k }
}

/// Returns the largest deviation from hover of each input by itself (torques in N m, thrust in N),
/// at which no motor exceeds its limits.
fn largest_inputs(vehicle: &VehicleOptions) -> [f64; 4] {
    let mixer = Mixer::new(vehicle);
    let hover = mixer.motors(&vehicle.hover()).0;
    let headroom = hover.map(|motor| motor.min(vehicle.motor_max - motor));
    std::array::from_fn(|input| {
        let mut unit = Wrench::zeros();
        unit[input] = 1.0;
        headroom.component_div(&mixer.unbounded_motors(&unit).abs()).min()
    })
}

/// Returns warnings about a loop that is unstable with the lag, and about the altitude loop.
/// `poles` contains the poles without lag, and those with lag. `is_stable` refers to the loop with
/// the lag, and `longest_s` is its longest stable lag.
fn warnings(
    options: &SimOptions,
    lag_s: f64,
    poles: [&Option<Vec<Complex<f64>>>; 2],
    is_stable: bool,
    longest_s: Option<f64>,
) -> Vec<Diagnostic> {
    // The slowest pole, without and with lag, has the largest real part.
    let [without, with] = poles.map(|poles| {
        let real = poles.iter().flatten().map(|pole| pole.re);
        real.fold(f64::NEG_INFINITY, f64::max)
    });
    let mut warnings = Vec::new();
    if !is_stable && without <= 0.0 {
        let longest = longest_s.map_or(String::new(), |s| format!(" (only up to {s:.3} s)"));
        warnings.push(Diagnostic::warning(
            "lag-unstable",
            format!("the loop is stable without motor lag, but not with {lag_s} s{longest}"),
        ));
    } else if !is_stable {
        let message = format!(
            "the loop is unstable, with a pole at {without:+.2} 1/s without motor lag, and at \
             {with:+.2} 1/s with {lag_s} s. Is the gain meant for u = u_hover - K (x - x_des), \
             with its signs and units (rad, m)?"
        );
        warnings.push(Diagnostic::warning("loop-unstable", message));
    }
    if options.controller.kind == ControllerKind::Altitude {
        let message = "the results at f_z are those of lqr-feedforward, and `noctograph hold` \
                       shows the loop of the altitude controller";
        warnings.push(Diagnostic::warning("altitude-loop", message));
    }
    warnings
}

/// Returns the contribution of the air to `A` at hover. For a small velocity in the body frame,
/// this is the drag of body and rotors and the moment of the air across the rotors.
fn drag(vehicle: &VehicleOptions) -> SMatrix<f64, 12, 12> {
    // Each rotor's drag is proportional to its speed, and acts only across its axis.
    let hover_n = vehicle.mass_kg * GRAVITY_M_S2 / N_MOTORS;
    let hover_rad_s = (hover_n / vehicle.rotor_thrust_n_s2).sqrt();
    let rotors = N_MOTORS * vehicle.rotor_drag_n_s2_m * hover_rad_s;
    let mut drag = SMatrix::zeros();
    for (axis, rotors_n_s_m) in [rotors, rotors, 0.0].into_iter().enumerate() {
        let total_n_s_m = vehicle.body_drag_n_s_m[axis] + rotors_n_s_m;
        drag[(VELOCITY + axis, VELOCITY + axis)] = -(total_n_s_m / vehicle.mass_kg);
    }
    let [j_x, j_y, _] = vehicle.inertia_kg_m2;
    drag[(RATE, VELOCITY + 1)] = vehicle.airspeed_moment_n_s / j_x;
    drag[(RATE + 1, VELOCITY)] = -vehicle.airspeed_moment_n_s / j_y;
    drag
}

/// Returns the longest stable lag in s, by bisection, `None` if [`MAX_LAG_S`] is stable, or 0 if no
/// lag is stable. `is_stable` must not become true again beyond that lag.
fn longest_lag_s(is_stable: impl Fn(f64) -> bool) -> Option<f64> {
    if is_stable(MAX_LAG_S) {
        return None;
    }
    let (mut low, mut high) = (0.0, MAX_LAG_S);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if is_stable(middle) { low = middle } else { high = middle }
    }
    Some(low)
}

#[cfg(test)]
mod tests;
