//! Design: gains of regulator and observer for a drone, and their stability margins.
//!
//! In: [`SimOptions`] and a motor lag. Out: [`Design`]. Method: the model at hover is linearized,
//! both gains come from their Riccati equations, and poles and margins of the closed loop are
//! computed for immediate and for lagging motors.
//!
//! Sources: the reference flight's design (AE483, 2022); Bryson, Ho, "Applied Optimal Control"
//! (1975), for the weights. Not modeled: the observer's own part in the margins, drag,
//! the time between two ticks.

use nalgebra::{Complex, Const, DMatrix, DimMin, Matrix4, SMatrix, SVector, Vector4};

use super::controller::{Gain, modeled_lag_s, with_integrals};
use super::options::{ControllerKind, SimOptions};
use super::vehicle::{GRAVITY_M_S2, Mixer, Motion, State, Vehicle, Wrench, motion_derivative};
use crate::control::{
    Margins, is_hurwitz, linearize_finely, margins, observability_rank, observer_gain, poles,
    unobservable_states, with_input_lag,
};
use crate::error::{Error, Result, within};

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
pub const ROTOR_STATES: [&str; 4] = ["rotor tau_x", "rotor tau_y", "rotor tau_z", "rotor f_z"];
/// Inputs in the order of the rows of `K`.
pub const INPUTS: [&str; 4] = ["tau_x", "tau_y", "tau_z", "f_z"];

/// Gains of a drone and their stability margins.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// Gain of the regulator, 4×12, or 4×15 with integrals: `u = u_hover − K (x̂ − x_des)`; four
    /// columns more where it is designed for rotors that lag.
    pub k: DMatrix<f64>,
    /// Its columns: the first of [`STATES`], and [`ROTOR_STATES`].
    pub states: Vec<&'static str>,
    /// Gain of the observer, 8×3: `x̂̇ = A x̂ + B u − L (C x̂ − y)`, without the yaw.
    pub l: DMatrix<f64>,
    /// Number of the twelve states that the inputs reach.
    pub controllability_rank: usize,
    /// Number of the nine states of position, attitude and velocity that are observable from the
    /// measured position.
    pub observability_rank: usize,
    /// The others.
    pub unobservable: Vec<&'static str>,
    /// Poles of the regulator, 1/s, the slowest first; `None` where they were not found.
    pub regulator_poles: Option<Vec<Complex<f64>>>,
    /// Poles of the observer.
    pub observer_poles: Option<Vec<Complex<f64>>>,
    /// Margins at each input with immediate motors.
    pub margins: Option<[Margins; 4]>,
    /// Lag of the motors that the next two are for, s.
    pub motor_lag_s: f64,
    /// Poles of the regulator with that lag.
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
    let known_s = modeled_lag_s(options);
    let mut design = if options.controller.kind == ControllerKind::LqrIntegral {
        let (a, b) = with_integrals(&a, &b);
        let gain = Gain::<15>::new(options, &a, &b)?;
        Design::of_gain::<15, 19, 23>(&a, &b, &gain, known_s, motor_lag_s)
    } else {
        let gain = Gain::<12>::new(options, &a, &b)?;
        Design::of_gain::<12, 16, 20>(&a, &b, &gain, known_s, motor_lag_s)
    };
    // The scale of an input does not change the states that it reaches.
    let per_size = SMatrix::<f64, 12, 4>::from_fn(|i, j| b[(i, j)] / b.column(j).norm());
    design.controllability_rank = observability_rank(&a.transpose(), &per_size.transpose());
    design.observe(options)?;
    design.weigh(options, &vehicle);
    design.warn(options);
    Ok(design)
}

impl Design {
    /// The regulator's part, for lagging or immediate motors. `P` is `N + 4`, `Q` is `N + 8`.
    fn of_gain<const N: usize, const P: usize, const Q: usize>(
        a: &SMatrix<f64, N, N>,
        b: &SMatrix<f64, N, 4>,
        gain: &Gain<N>,
        known_lag_s: Option<f64>,
        motor_lag_s: f64,
    ) -> Self
    where
        Const<N>: DimMin<Const<N>, Output = Const<N>>,
        Const<P>: DimMin<Const<P>, Output = Const<P>>,
        Const<Q>: DimMin<Const<Q>, Output = Const<Q>>,
    {
        let Some(known_lag_s) = known_lag_s else {
            return Self::of_regulator::<N, P>(a, b, &gain.k, motor_lag_s);
        };
        // The modeled rotors run on the regulator's own commands: they are part of it, not of the
        // loop that is opened at the motors. τ dû/dt = u − û with u = −K x − K_u û.
        let mut whole = a.fixed_resize::<P, P>(0.0);
        whole.fixed_view_mut::<4, N>(N, 0).copy_from(&(-gain.k / known_lag_s));
        let back = -(gain.k_rotor + Matrix4::identity()) / known_lag_s;
        whole.fixed_view_mut::<4, 4>(N, N).copy_from(&back);
        let mut k = gain.k.fixed_resize::<4, P>(0.0);
        k.fixed_view_mut::<4, 4>(0, N).copy_from(&gain.k_rotor);
        Self {
            states: STATES[..N].iter().chain(&ROTOR_STATES).copied().collect(),
            ..Self::of_regulator::<P, Q>(&whole, &b.fixed_resize::<P, 4>(0.0), &k, motor_lag_s)
        }
    }

    /// The part of a regulator without a memory.
    fn of_regulator<const N: usize, const P: usize>(
        a: &SMatrix<f64, N, N>,
        b: &SMatrix<f64, N, 4>,
        k: &SMatrix<f64, 4, N>,
        motor_lag_s: f64,
    ) -> Self
    where
        Const<N>: DimMin<Const<N>, Output = Const<N>>,
        Const<P>: DimMin<Const<P>, Output = Const<P>>,
    {
        let (a_lag, b_lag, k_lag) = with_input_lag::<N, 4, P>(a, b, k, motor_lag_s);
        let stable = |lag_s: f64| {
            let (a, b, k) = with_input_lag::<N, 4, P>(a, b, k, lag_s);
            is_hurwitz(&(a - b * k))
        };
        Self {
            k: dynamic(k),
            states: STATES.iter().take(N).copied().collect(),
            l: DMatrix::zeros(8, 3),
            controllability_rank: 0,
            observability_rank: 0,
            unobservable: Vec::new(),
            regulator_poles: poles(&(a - b * k)),
            observer_poles: None,
            margins: margins(a, b, k),
            motor_lag_s,
            lagging_poles: poles(&(a_lag - b_lag * k_lag)),
            lagging_margins: margins(&a_lag, &b_lag, &k_lag),
            longest_lag_s: longest(stable),
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
        let position = SMatrix::<f64, 3, 9>::identity();
        self.observability_rank = observability_rank(&a, &position);
        self.unobservable =
            unobservable_states(&a, &position).iter().map(|&state| STATES[state]).collect();
        let a: SMatrix<f64, 8, 8> = a.remove_row(YAW).remove_column(YAW);
        let c = SMatrix::<f64, 3, 8>::identity();
        let variance = |trust: f64| 1.0 / trust;
        let model =
            SMatrix::from_diagonal(&SVector::from(options.observer.luenberger.r).map(variance));
        let measured =
            SMatrix::from_diagonal(&SVector::from(options.observer.luenberger.q).map(variance));
        let l = observer_gain(&a, &c, &model, &measured).map_err(|error| Error::Infeasible {
            what: format!("observer.luenberger.q and .r have no gain: {error}"),
            hint: error.hint().into(),
        })?;
        self.observer_poles = poles(&(a - l * c));
        self.l = dynamic(&l);
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
                "the gain is stable only without motor lag: with {lag_s} s it is not{}",
                self.longest_lag_s.map_or(String::new(), |s| format!(", the longest is {s:.3} s"))
            ));
        }
        if let ControllerKind::Pid | ControllerKind::Geometric = options.controller.kind {
            self.warnings.push("controller.kind names a controller that does not use K".into());
        }
    }
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

fn dynamic<const R: usize, const C: usize>(m: &SMatrix<f64, R, C>) -> DMatrix<f64> {
    DMatrix::from_column_slice(R, C, m.as_slice())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn default_design(motor_lag_s: f64) -> Design {
        design(&SimOptions::default(), motor_lag_s).unwrap()
    }

    /// References with sixty digits: see `control::lqr`; for L the same script on (Aᵀ, Cᵀ).
    #[test]
    fn both_gains_are_those_of_sixty_digits() {
        let design = default_design(MOTOR_LAG_S);
        for (row, column, want) in [
            (0, 1, -0.003_981_881_847_969_638),
            (0, 5, 0.004_536_141_188_156_048_4),
            (1, 0, 0.004_876_789_371_788_077),
            (1, 4, 0.004_879_601_079_133_153),
            (1, 10, 0.000_567_568_635_100_512),
            (2, 3, 0.001_018_156_587_328_857_4),
            (3, 8, 0.165_290_114_583_781_13),
        ] {
            let found = design.k[(row, column)];
            assert!((found / want - 1.0).abs() < 1e-11, "K[{row}, {column}] = {found}");
        }
        for (row, column, want) in [
            (0, 0, 17.758_102_840_564_2),
            (1, 1, 17.719_162_754_296_673),
            (2, 2, 21.429_689_326_981_26),
            (3, 0, 34.325_959_185_710_864),
            (4, 1, -50.715_051_620_848_71),
            (5, 0, 120.119_845_623_812_98),
            (6, 1, 135.859_508_005_650_4),
            (7, 2, 93.494_699_000_845_72),
        ] {
            let found = design.l[(row, column)];
            assert!((found / want - 1.0).abs() < 1e-11, "L[{row}, {column}] = {found}");
        }
    }

    #[test]
    fn yaw_alone_is_unobservable_and_every_state_is_controllable() {
        let design = default_design(MOTOR_LAG_S);
        assert_eq!((design.observability_rank, design.controllability_rank), (8, 12));
        assert_eq!(design.unobservable, ["psi"]);
    }

    #[test]
    fn a_regulator_has_a_phase_margin_of_sixty_degrees_and_half_the_gain() {
        let design = default_design(MOTOR_LAG_S);
        for (margins, input) in design.margins.unwrap().iter().zip(INPUTS) {
            assert!(margins.phase_rad.unwrap() > 60.0_f64.to_radians(), "{input}: {margins:?}");
            assert_eq!(margins.gain_up, None, "{input}");
            assert!(margins.gain_down.is_none_or(|down| down < 0.5), "{input}: {margins:?}");
        }
        let poles = design.regulator_poles.unwrap();
        assert_eq!(poles.len(), 12);
        assert!(poles.iter().all(|pole| pole.re < -1.0), "{poles:?}");
    }

    #[test]
    fn the_teams_gain_tolerates_a_lag_of_a_tenth_of_a_second() {
        // NumPy 2.4.6, `eigvals` of the 16 states: largest real part −2.2276 at 0.072 s, −0.320 at
        // 0.100 s, +0.488 at 0.120 s.
        let design = default_design(0.1);
        let slowest = design.lagging_poles.unwrap()[0].re;
        assert!((slowest + 0.319_981).abs() < 1e-5, "{slowest}");
        assert!(design.lagging_margins.is_some() && design.warnings.is_empty());
        let longest_s = design.longest_lag_s.unwrap();
        assert!((0.1..0.12).contains(&longest_s), "{longest_s} s");
        let design = default_design(0.12);
        assert!(design.lagging_margins.is_none());
        assert!(design.warnings[0].contains("stable only without motor lag"));
    }

    #[test]
    fn brysons_rule_is_the_motors_range() {
        let design = default_design(MOTOR_LAG_S);
        // Hover takes 44 144.999 of 65 535, which leaves 21 390.
        let room = 65_535.0 - 0.0351 * 9.81 / 4.0 / 1.95e-6;
        let want = [4.0 * 0.035 * 1.95e-6, 4.0 * 0.035 * 1.95e-6, 4.0 * 7.47e-9, 4.0 * 1.95e-6];
        for ((largest, r), want) in design.largest_inputs.iter().zip(design.bryson_r).zip(want) {
            assert!((largest / (want * room) - 1.0).abs() < 1e-9, "{largest}");
            assert!((largest * largest * r - 1.0).abs() < 1e-12, "{r}");
        }
    }

    #[test]
    fn a_gain_designed_for_its_rotors_tolerates_twice_their_lag() {
        // With the rotors' own lag, by NumPy 2.4.6: 42.1° at the pitch, 46.8° at the yaw, any rise
        // of the gain, a fall to 0.32 at the pitch; slowest pole −2.397; stable up to 2.6 times the
        // lag.
        let options = SimOptions::cf21();
        let design = design(&options, 0.121).unwrap();
        assert_eq!((design.k.shape(), design.states.len()), ((4, 16), 16));
        let slowest = design.lagging_poles.unwrap()[0].re;
        assert!((slowest + 2.397).abs() < 1e-3, "{slowest}");
        let margins = design.lagging_margins.unwrap();
        let degrees = |i: usize| margins[i].phase_rad.unwrap().to_degrees();
        assert!((degrees(1) - 42.1).abs() < 0.2 && (degrees(2) - 46.8).abs() < 0.2, "{margins:?}");
        assert!(margins.iter().all(|m| m.gain_up.is_none() && m.gain_down.is_none_or(|g| g < 0.5)));
        assert!(design.longest_lag_s.unwrap() > 2.6 * 0.121, "{:?}", design.longest_lag_s);
        assert!(design.warnings.is_empty(), "{:?}", design.warnings);
    }

    #[test]
    fn integrals_are_three_states_more() {
        let mut options = SimOptions::default();
        options.controller.kind = ControllerKind::LqrIntegral;
        let design = design(&options, MOTOR_LAG_S).unwrap();
        assert_eq!(design.k.shape(), (4, 15));
        assert_eq!(design.regulator_poles.unwrap().len(), 15);
        assert!(design.k[(1, 12)] > 0.0 && design.k[(0, 13)] < 0.0 && design.k[(3, 14)] > 0.0);
    }
}
