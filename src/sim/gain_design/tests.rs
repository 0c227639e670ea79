//! Tests of gains and margins against references.

use super::*;

fn default_design(motor_lag_s: f64) -> Design {
    design(&SimOptions::default(), motor_lag_s).unwrap()
}

/// The references have sixty digits, as in `control::lqr`. That for L was computed from (Aᵀ, Cᵀ).
#[test]
fn both_gains_are_those_of_sixty_digits() {
    let mut design = default_design(MOTOR_LAG_S);
    for (row, column, want) in [
        (0, 1, -0.003_981_881_847_969_638),
        (0, 5, 0.004_536_141_188_156_048_4),
        (1, 0, 0.004_876_789_371_788_077),
        (1, 4, 0.004_879_601_079_133_153),
        (1, 10, 0.000_567_568_635_100_512),
        (2, 3, 0.001_018_156_587_328_857_4),
        (3, 8, 0.165_290_114_583_781_13),
    ] {
        let entry = design.k.as_ref().unwrap()[(row, column)];
        assert!((entry / want - 1.0).abs() < 1e-11, "K[{row}, {column}] = {entry}");
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
        let entry = std::mem::take(&mut design.l[(row, column)]);
        assert!((entry / want - 1.0).abs() < 1e-11, "L[{row}, {column}] = {entry}");
    }
    assert!(design.l.norm() < 1e-9, "all others are zero: {}", design.l);
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
    // According to NumPy 2.4.6, `eigvals` of the 16 states, the largest real part is −2.2276 at
    // 0.072 s, −0.320 at 0.100 s, and +0.488 at 0.120 s.
    let design = default_design(0.1);
    let slowest = design.lagging_poles.unwrap()[0].re;
    assert!((slowest + 0.319_981).abs() < 1e-5, "{slowest}");
    assert!(design.lagging_margins.is_some() && design.warnings.is_empty());
    let longest_s = design.longest_lag_s.unwrap();
    assert!((0.1..0.12).contains(&longest_s), "{longest_s} s");
    let design = default_design(0.12);
    assert!(design.lagging_margins.is_none());
    assert_eq!(design.warnings[0].code, "lag-unstable");
    assert!(design.warnings[0].message.contains("stable without motor lag, but not with"));
}

#[test]
fn brysons_rule_is_the_motors_range() {
    let design = default_design(MOTOR_LAG_S);
    // Hover requires a command of 44 144.999 of 65 535, which leaves 21 390.
    let room = 65_535.0 - 0.0351 * 9.81 / 4.0 / 1.95e-6;
    let want = [4.0 * 0.035 * 1.95e-6, 4.0 * 0.035 * 1.95e-6, 4.0 * 7.47e-9, 4.0 * 1.95e-6];
    for ((largest, r), want) in design.largest_inputs.iter().zip(design.bryson_r).zip(want) {
        assert!((largest / (want * room) - 1.0).abs() < 1e-9, "{largest}");
        assert!((largest * largest * r - 1.0).abs() < 1e-12, "{r}");
    }
}

#[test]
fn a_gain_designed_for_its_rotors_tolerates_twice_their_lag() {
    // Without drag and with the rotors' lag, NumPy 2.4.6 gives phase margins of 42.1° for the pitch
    // and 46.8° for the yaw, an unlimited gain increase, a decrease to 0.32 for the pitch, a
    // slowest pole of −2.397, and stability up to 2.6 times the lag.
    let mut options = SimOptions::cf21();
    options.vehicle.body_drag_n_s_m = [0.0; 3];
    options.vehicle.rotor_drag_n_s2_m = 0.0;
    options.vehicle.airspeed_moment_n_s = 0.0;
    let design = design(&options, 0.121).unwrap();
    assert_eq!((design.k.unwrap().shape(), design.states.len()), ((4, 16), 16));
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
    let k = design.k.unwrap();
    assert_eq!((k.shape(), design.n_controller_states), ((4, 15), 3));
    assert_eq!(design.regulator_poles.unwrap().len(), 15);
    assert!(k[(1, 12)] > 0.0 && k[(0, 13)] < 0.0 && k[(3, 14)] > 0.0);
}

#[test]
fn the_model_slows_down_as_the_simulator_does() {
    let mut options = SimOptions::default();
    options.vehicle.body_drag_n_s_m = [0.015, 0.014, 0.013];
    options.vehicle.rotor_drag_n_s2_m = 3e-7;
    options.vehicle.airspeed_moment_n_s = 4e-7;
    options.air.gusts = crate::vehicle::Gusts::None;
    let plain = design(&SimOptions::default(), 0.072).unwrap();
    let dragged = design(&options, 0.072).unwrap();
    // Hover in a wind is equivalent to motion through still air. The test compares the changes of
    // the state within 2 ms per unit of wind speed.
    let (dt_s, wind_m_s) = (0.002, 0.1);
    let after = |wind: [f64; 3]| {
        let mut options = options.clone();
        options.air.wind_m_s = wind;
        let up = nalgebra::Vector3::z() * 2.0;
        let mut plant = crate::vehicle::Plant::new(options.plant(), dt_s, 1, 0, up);
        let hover = options.vehicle.mass_kg * GRAVITY_M_S2 / (4.0 * options.vehicle.k_f_n);
        plant.advance(&[hover; 4]);
        plant.body().state()
    };
    let change = |axis: usize| {
        let mut wind = [0.0; 3];
        wind[axis] = -wind_m_s;
        (after(wind) - after([0.0; 3])) / (dt_s * wind_m_s)
    };
    for axis in 0..3 {
        let state = change(axis);
        for row in 6..12 {
            let (model, real) = (dragged.a[(row, 6 + axis)], state[row]);
            assert!(
                (model - real).abs() < 2e-3 * (1.0 + real.abs()),
                "{row} {axis}: {model} {real}"
            );
        }
    }
    assert_eq!(dragged.k, plain.k, "the gain is designed without drag");
}
