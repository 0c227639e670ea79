//! Design: gains of regulator and observer for a drone, and their stability margins.
//!
//! In: [`SimOptions`] and a motor lag. Out: [`Design`]. Method: the model at hover is linearized,
//! both gains come from their Riccati equations, and poles and margins of the closed loop are
//! computed for immediate and for lagging motors. A cascade of PID loops and the geometric
//! controller have no such gain: their own code is linearized at hover, and poles and margins are
//! those of its loops.
//!
//! Sources: the reference flight's design (AE483, 2022); Bryson, Ho, "Applied Optimal Control"
//! (1975), for the weights. The gain is designed without the drone's drag; the model that is
//! printed, its poles and margins have it. Not modeled: the observer's own part in the margins,
//! the time between two ticks.

use nalgebra::{Complex, DMatrix, DVector, Matrix4, SMatrix, Vector4};
use serde::{Serialize, Serializer};

use super::controller::{Gain, LinearController, modeled_lag_s, with_integrals};
use super::options::{ControllerKind, SimOptions};
use crate::vehicle::{Mixer, Motion, State, Vehicle, VehicleOptions, Wrench, motion_derivative};
use noctograph_core::control::{
    Margins, dynamic, is_hurwitz, linearize_finely, margins, observability_rank, observer_gain,
    poles, unobservable_states, with_input_lag,
};
use noctograph_core::crazyflie::GRAVITY_M_S2;
use noctograph_core::error::{Error, Result, within};

/// Lag of a Crazyflie's motors, for a vehicle without one: Eschmann, Albani, Loianno, "Data-driven
/// system identification of quadrotors subject to motor delays" (IROS 2024), 0.072 s. Other flights
/// gave 0.05 to 0.14 s.
pub const MOTOR_LAG_S: f64 = 0.072;
/// Longest lag that is searched.
const MAX_LAG_S: f64 = 1.0;
/// Halvings of the span in which the longest lag lies: to a microsecond.
const HALVINGS: u32 = 20;

/// States in the order of the columns of `K`; the first nine but the yaw are the rows of `L`.
pub const STATES: [&str; 15] = [
    "o_x", "o_y", "o_z", "psi", "theta", "phi", "v_x", "v_y", "v_z", "w_x", "w_y", "w_z",
    "int o_x", "int o_y", "int o_z",
];
/// Further columns of `K` where the gain is designed for lagging rotors: the modeled rotors'
/// output.
const ROTOR_STATES: [&str; 4] = ["rotor tau_x", "rotor tau_y", "rotor tau_z", "rotor f_z"];
/// Inputs in the order of the rows of `K`.
pub const INPUTS: [&str; 4] = ["tau_x", "tau_y", "tau_z", "f_z"];

/// Gains of a drone and their stability margins.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Design {
    /// The drone at hover, `ẋ = A x + B u` for small deviations: A (12×12) by the first twelve
    /// [`STATES`].
    #[serde(rename = "A", serialize_with = "rows")]
    pub a: DMatrix<f64>,
    /// Its B (12×4), by [`INPUTS`].
    #[serde(rename = "B", serialize_with = "rows")]
    pub b: DMatrix<f64>,
    /// Gain of the regulator, 4×12, or 4×15 with integrals: `u = u_hover − K (x̂ − x_des)`; four
    /// columns more where it is designed for rotors that lag. `None` for a controller that is no
    /// regulator.
    #[serde(rename = "K", serialize_with = "rows")]
    pub k: Option<DMatrix<f64>>,
    /// Its columns: the first of [`STATES`], and those of the rotors.
    pub states: Vec<&'static str>,
    /// States that the controller has of its own, beside the twelve of the drone: integrals, last
    /// measurements, filters, modeled rotors.
    #[serde(rename = "controller_states")]
    pub n_controller_states: usize,
    /// Gain of the observer, 8×3: `x̂̇ = A x̂ + B u − L (C x̂ − y)`, without the yaw.
    #[serde(rename = "L", serialize_with = "rows")]
    pub l: DMatrix<f64>,
    /// Number of the twelve states that the inputs reach.
    pub controllability_rank: usize,
    /// Number of the nine states of position, attitude and velocity that are observable from the
    /// measured position.
    pub observability_rank: usize,
    /// The others.
    pub unobservable: Vec<&'static str>,
    /// Poles of the loop with immediate motors, 1/s, the slowest first; `None` where they were not
    /// found.
    pub regulator_poles: Option<Vec<Complex<f64>>>,
    /// Poles of the observer.
    pub observer_poles: Option<Vec<Complex<f64>>>,
    /// Margins at each input with immediate motors; `None`: not stable.
    pub margins: Option<[Margins; 4]>,
    /// Lag of the motors that the next two are for, s.
    pub motor_lag_s: f64,
    /// Poles of the loop with that lag.
    pub lagging_poles: Option<Vec<Complex<f64>>>,
    /// Margins with that lag; `None`: not stable.
    pub lagging_margins: Option<[Margins; 4]>,
    /// Longest motor lag with a stable loop, s; `None`: more than a second.
    pub longest_lag_s: Option<f64>,
    /// Largest deviation from hover of each input by itself with all motors in their range, N m
    /// and N.
    pub largest_inputs: [f64; 4],
    /// Bryson's rule for `controller.lqr.r`: 1 / deviation².
    pub bryson_r: [f64; 4],
    /// Warnings about the gains.
    pub warnings: Vec<String>,
}

/// A matrix, or `None`, as an array of its rows.
fn rows<'a, S: Serializer>(
    matrix: impl Into<Option<&'a DMatrix<f64>>>,
    to: S,
) -> std::result::Result<S::Ok, S::Error> {
    let rows = |m: &DMatrix<f64>| -> Vec<Vec<f64>> {
        m.row_iter().map(|row| row.iter().copied().collect()).collect()
    };
    matrix.into().map(rows).serialize(to)
}

/// Designs both gains of a drone and computes their margins with a motor lag of `motor_lag_s`.
///
/// # Errors
///
/// Those of [`SimOptions::check`], [`Error::Input`] for a lag outside 1 µs to 1 s,
/// [`Error::Infeasible`] for weights that have no gain.
pub fn design(options: &SimOptions, motor_lag_s: f64) -> Result<Design> {
    options.check()?;
    within("motor_lag_s", motor_lag_s, 1e-6, MAX_LAG_S)?;
    let vehicle = Vehicle::new(&options.vehicle);
    let (a, b) =
        linearize_finely(|s, u| vehicle.derivative(s, u), &State::zeros(), &vehicle.hover());
    let real = a + drag(&options.vehicle);
    let mut design = match options.controller.kind {
        ControllerKind::Pid | ControllerKind::Geometric => Design::of_loops(
            &dynamic(&real),
            &dynamic(&b),
            &LinearController::new(options),
            motor_lag_s,
        ),
        _ => {
            let model = with_integrals(options, &a, &b);
            let gain = Gain::new(options, &model)?;
            let model = with_integrals(options, &real, &b);
            Design::of_gain(&model, &gain, modeled_lag_s(options), motor_lag_s)
        }
    };
    // The scale of an input does not change the states that it reaches.
    let per_size = SMatrix::<f64, 12, 4>::from_fn(|i, j| b[(i, j)] / b.column(j).norm());
    (design.a, design.b) = (dynamic(&real), dynamic(&b));
    design.controllability_rank =
        observability_rank(&dynamic(&real.transpose()), &dynamic(&per_size.transpose()));
    design.observe(options)?;
    design.weigh(options, &vehicle);
    design.warn(options);
    Ok(design)
}

impl Design {
    /// The regulator's part, for lagging or immediate motors.
    fn of_gain(
        [a, b]: &[DMatrix<f64>; 2],
        gain: &Gain,
        known_lag_s: Option<f64>,
        motor_lag_s: f64,
    ) -> Self {
        let n = a.nrows();
        let states = STATES[..n].iter().copied();
        let Some(known_lag_s) = known_lag_s else {
            return Self {
                k: Some(gain.k.clone()),
                states: states.collect(),
                ..Self::of_feedback(a, b, &gain.k, motor_lag_s)
            };
        };
        // The modeled rotors run on the regulator's own commands: they are part of it, not of the
        // loop that is opened at the motors. τ dû/dt = u − û with u = −K x − K_u û.
        let mut whole = a.clone().resize(n + 4, n + 4, 0.0);
        whole.view_mut((n, 0), (4, n)).copy_from(&(-&gain.k / known_lag_s));
        let back = -(gain.k_rotor + Matrix4::identity()) / known_lag_s;
        whole.view_mut((n, n), (4, 4)).copy_from(&back);
        let mut k = gain.k.clone().resize_horizontally(n + 4, 0.0);
        k.columns_mut(n, 4).copy_from(&gain.k_rotor);
        let b = b.clone().resize_vertically(n + 4, 0.0);
        let feedback = Self::of_feedback(&whole, &b, &k, motor_lag_s);
        Self { k: Some(k), states: states.chain(ROTOR_STATES).collect(), ..feedback }
    }

    /// The loops of a controller with states of its own.
    fn of_loops(
        a: &DMatrix<f64>,
        b: &DMatrix<f64>,
        loops: &LinearController,
        motor_lag_s: f64,
    ) -> Self {
        let m = loops.f.nrows();
        let mut whole = a.clone().resize(12 + m, 12 + m, 0.0);
        whole.view_mut((12, 0), (m, 12)).copy_from(&loops.g);
        whole.view_mut((12, 12), (m, m)).copy_from(&loops.f);
        let mut k = (-&loops.k).resize_horizontally(12 + m, 0.0);
        k.columns_mut(12, m).copy_from(&-&loops.h);
        Self::of_feedback(&whole, &b.clone().resize_vertically(12 + m, 0.0), &k, motor_lag_s)
    }

    /// Poles and margins of the feedback `u = −K x`, for lagging and immediate motors; the
    /// controller's own states follow the drone's twelve.
    fn of_feedback(a: &DMatrix<f64>, b: &DMatrix<f64>, k: &DMatrix<f64>, motor_lag_s: f64) -> Self {
        let lagging = |lag_s: f64| {
            let [a, b, k] = with_input_lag(a, b, k, lag_s);
            let closed = &a - &b * &k;
            ([a, b, k], closed)
        };
        let of_inputs = |m: Vec<Margins>| [m[0], m[1], m[2], m[3]];
        let ([a_lag, b_lag, k_lag], closed_lag) = lagging(motor_lag_s);
        Self {
            a: DMatrix::zeros(12, 12),
            b: DMatrix::zeros(12, 4),
            k: None,
            states: Vec::new(),
            n_controller_states: a.nrows() - 12,
            l: DMatrix::zeros(8, 3),
            controllability_rank: 0,
            observability_rank: 0,
            unobservable: Vec::new(),
            regulator_poles: poles(&(a - b * k)),
            observer_poles: None,
            margins: margins(a, b, k).map(of_inputs),
            motor_lag_s,
            lagging_poles: poles(&closed_lag),
            lagging_margins: margins(&a_lag, &b_lag, &k_lag).map(of_inputs),
            longest_lag_s: longest(|lag_s| is_hurwitz(&lagging(lag_s).1)),
            largest_inputs: [0.0; 4],
            bryson_r: [0.0; 4],
            warnings: Vec::new(),
        }
    }

    /// The observer's part: the nine states of [`Motion`] with body rate and thrust as inputs, and
    /// the gain without the yaw.
    fn observe(&mut self, options: &SimOptions) -> Result<()> {
        let at_hover = Vector4::new(0.0, 0.0, 0.0, GRAVITY_M_S2);
        let (a, _) = linearize_finely(
            |motion: &Motion, u: &Vector4<f64>| motion_derivative(motion, &u.xyz(), u[3]),
            &Motion::zeros(),
            &at_hover,
        );
        let a = dynamic(&a);
        let position = DMatrix::identity(3, 9);
        self.observability_rank = observability_rank(&a, &position);
        self.unobservable =
            unobservable_states(&a, &position).iter().map(|&state| STATES[state]).collect();
        let a = a.remove_row(YAW).remove_column(YAW);
        let c = DMatrix::identity(3, 8);
        let variances = |trust: &[f64]| {
            DMatrix::from_diagonal(&DVector::from_column_slice(trust).map(f64::recip))
        };
        let model = variances(&options.observer.luenberger.r);
        let measured = variances(&options.observer.luenberger.q);
        let l = observer_gain(&a, &c, &model, &measured).map_err(|error| Error::Infeasible {
            what: format!("observer.luenberger.q and .r have no gain: {error}"),
            hint: error.hint().into(),
        })?;
        self.observer_poles = poles(&(a - &l * c));
        self.l = l;
        Ok(())
    }

    /// Bryson's rule: an input may deviate until the first motor reaches its limit.
    fn weigh(&mut self, options: &SimOptions, vehicle: &Vehicle) {
        let mixer = Mixer::new(&options.vehicle);
        let hover = mixer.motors(&vehicle.hover()).0;
        for (i, largest) in self.largest_inputs.iter_mut().enumerate() {
            let mut unit = Wrench::zeros();
            unit[i] = 1.0;
            let per_unit = mixer.unbounded_motors(&unit);
            let room = hover.map(|m| m.min(options.vehicle.motor_max - m));
            *largest = room.component_div(&per_unit.abs()).min();
        }
        self.bryson_r = self.largest_inputs.map(|largest| 1.0 / (largest * largest));
    }

    fn warn(&mut self, options: &SimOptions) {
        let lag_s = self.motor_lag_s;
        if self.lagging_margins.is_none() {
            self.warnings.push(format!(
                "the loop is stable only without motor lag: with {lag_s} s it is not{}",
                self.longest_lag_s.map_or(String::new(), |s| format!(", the longest is {s:.3} s"))
            ));
        }
        if options.controller.kind == ControllerKind::Altitude {
            let text = "the loop at f_z is that of lqr-feedforward: `noctograph hold` shows that of the \
                        altitude";
            self.warnings.push(text.into());
        }
    }
}

/// What the air adds to A at hover: drag of body and rotors, and the moment of the air across the
/// rotors, for a small velocity in the body frame.
fn drag(vehicle: &VehicleOptions) -> SMatrix<f64, 12, 12> {
    const VELOCITY: usize = 6;
    const RATE: usize = 9;
    let hover_n = 0.25 * vehicle.mass_kg * GRAVITY_M_S2;
    let rotors = 4.0 * vehicle.rotor_drag_n_s2_m * (hover_n / vehicle.rotor_thrust_n_s2).sqrt();
    let mut drag = SMatrix::zeros();
    for (axis, of_rotors) in [rotors, rotors, 0.0].into_iter().enumerate() {
        let slows = (vehicle.body_drag_n_s_m[axis] + of_rotors) / vehicle.mass_kg;
        drag[(VELOCITY + axis, VELOCITY + axis)] = -slows;
    }
    let [j_x, j_y, _] = vehicle.inertia_kg_m2;
    drag[(RATE, VELOCITY + 1)] = vehicle.airspeed_moment_n_s / j_x;
    drag[(RATE + 1, VELOCITY)] = -vehicle.airspeed_moment_n_s / j_y;
    drag
}

/// Row of the yaw, which the observer leaves out.
const YAW: usize = 3;

/// Longest stable lag; `None` where even [`MAX_LAG_S`] is stable.
fn longest(stable: impl Fn(f64) -> bool) -> Option<f64> {
    if stable(MAX_LAG_S) {
        return None;
    }
    let (mut low, mut high) = (0.0, MAX_LAG_S);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        if stable(middle) { low = middle } else { high = middle }
    }
    Some(low)
}

#[cfg(test)]
mod tests;
