//! Exports a scene's controller gains for the firmware, as parameters or as a table in C.
//!
//! - `geometric`: parameters for two controllers that are equivalent at small angles. `ctrlLee.*`
//!   (firmware `controller_lee.c`) uses torques (N m per rad) in place of the scene's angular
//!   accelerations. `ctrlMel.*` (`controller_mellinger.c`) uses forces (N per m) and, for the
//!   attitude, motor commands per twice the sine of the error. Mellinger's gain for the derivative
//!   of the body rate, which the scene lacks, is 0.
//! - `pid`: the gains of the firmware's cascade (`posCtlPid`, `velCtlPid`, `pid_attitude`,
//!   `pid_rate`), which the scene uses.
//! - `lqr` and its variants: the matrix as a C header for a custom controller, such as that of the
//!   AE483 course.

use nalgebra::DMatrix;
use serde_json::{Map, json};

use super::File;
use noctograph_core::error::{Error, Result};
use noctograph_sim::gain_design::{Design, INPUTS, MOTOR_LAG_S, design};
use noctograph_sim::{Law, SimOptions};

/// Names and values of firmware parameters.
type Parameters = Vec<(String, f64)>;

/// Returns the names and values of the firmware parameters for the scene's controller. The list is
/// empty if the firmware lacks the controller.
pub(super) fn parameters(sim: &SimOptions) -> Parameters {
    match sim.controller.kind.law() {
        Law::Geometric => lee(sim),
        Law::Cascade => pid(sim),
        Law::StateFeedback { .. } | Law::Own => Vec::new(),
    }
}

/// Returns the parameters of the firmware's geometric controller (`controller_lee.c`), in SI units.
fn lee(sim: &SimOptions) -> Parameters {
    let (k, vehicle) = (&sim.controller.geometric, &sim.vehicle);
    let mut parameters = Vec::new();
    for (axis, index) in ["x", "y", "z"].into_iter().zip(0..3) {
        let inertia = vehicle.inertia_kg_m2[index];
        let gains = [
            ("Kpos_P", k.k_position),
            ("Kpos_D", k.k_velocity),
            ("Kpos_I", k.k_position_integral),
            ("KR_", inertia * k.k_attitude[index]),
            ("Kw_", inertia * k.k_rate[index]),
            ("KI_", inertia * k.k_attitude_integral[index]),
            ("J_", inertia),
        ];
        parameters.extend(gains.map(|(name, gain)| (format!("ctrlLee.{name}{axis}"), gain)));
    }
    parameters.push(("ctrlLee.mass".to_owned(), vehicle.mass_kg));
    parameters
}

/// Returns the parameters of the firmware's Mellinger controller with the stiffness and damping of
/// the scene's geometric controller. Forces and torques are in the units of motor commands, 0 to
/// 65535.
fn mellinger(sim: &SimOptions) -> Parameters {
    let (k, vehicle) = (&sim.controller.geometric, &sim.vehicle);
    let mass_kg = vehicle.mass_kg;
    let mut gains = Vec::new();
    for axis in ["_xy", "_z"] {
        gains.push(("kp", axis, mass_kg * k.k_position));
        gains.push(("kd", axis, mass_kg * k.k_velocity));
        gains.push(("ki", axis, mass_kg * k.k_position_integral));
    }
    // `roll` and `yaw` are commands per unit torque. Each of the four motors, at its lever arm,
    // receives half of a roll command, or all of a yaw command (`power_distribution_quadrotor.c`).
    let command = vehicle.motor_max / 65_535.0;
    let roll = 1.0 / (2.0 * vehicle.arm_m * vehicle.k_f_n * command);
    let yaw = 1.0 / (4.0 * vehicle.k_m_n_m * command);
    // The attitude error is twice the sine of the angle.
    for (name, accelerations, factor) in
        [("kR", k.k_attitude, 0.5), ("kw", k.k_rate, 1.0), ("ki_m", k.k_attitude_integral, 0.5)]
    {
        let [x, y, z] = [0, 1, 2].map(|axis| vehicle.inertia_kg_m2[axis] * accelerations[axis]);
        gains.push((name, "_xy", factor * (roll * f64::midpoint(x, y))));
        gains.push((name, "_z", factor * (yaw * z)));
    }
    gains.push(("kd_omega_rp", "", 0.0));
    gains.push(("mass", "", mass_kg));
    // Each of the four motors receives the whole thrust command.
    gains.push(("massThrust", "", 1.0 / (4.0 * vehicle.k_f_n * command)));
    gains.into_iter().map(|(name, axis, gain)| (format!("ctrlMel.{name}{axis}"), gain)).collect()
}

/// Returns the gains of the firmware's PID cascade in the firmware's own units, and its thrust at
/// hover.
fn pid(sim: &SimOptions) -> Parameters {
    let names = [
        ("posCtlPid", ["xK", "yK", "zK"]),
        ("velCtlPid", ["vxK", "vyK", "vzK"]),
        ("pid_attitude", ["roll_k", "pitch_k", "yaw_k"]),
        ("pid_rate", ["roll_k", "pitch_k", "yaw_k"]),
    ];
    let mut parameters = Parameters::new();
    for ((group, loops), gains) in names.into_iter().zip(sim.controller.pid.gains()) {
        for (name, gains) in loops.into_iter().zip(gains) {
            let terms = ["p", "i", "d"].into_iter().zip(gains);
            parameters.extend(terms.map(|(term, gain)| (format!("{group}.{name}{term}"), gain)));
        }
    }
    parameters.push(("posCtlPid.thrustBase".to_owned(), sim.controller.pid.thrust_base));
    parameters
}

/// Returns parameters as a JSON object.
fn object(parameters: Parameters) -> Map<String, serde_json::Value> {
    parameters.into_iter().map(|(name, gain)| (name, json!(gain))).collect()
}

/// Returns `gains.json` with parameters, or `gains.h` for state feedback. Returns [`Error::Input`]
/// for controllers without gains.
pub(super) fn files(sim: &SimOptions) -> Result<Vec<File>> {
    let kind = sim.controller.kind;
    let json = match kind.law() {
        Law::Geometric => json!({
            // `stabilizer.controller` is a controller's number in the firmware (`controller.h`).
            "lee": { "stabilizer.controller": 5, "parameters": object(lee(sim)) },
            "mellinger": { "stabilizer.controller": 2, "parameters": object(mellinger(sim)) },
        }),
        Law::Cascade => json!({
            "pid": { "stabilizer.controller": 1, "parameters": object(pid(sim)) },
        }),
        Law::StateFeedback { by_thrust_map: false, .. } => {
            return Ok(vec![File::new("gains.h", header(&design(sim, MOTOR_LAG_S)?, sim))]);
        }
        Law::StateFeedback { by_thrust_map: true, .. } | Law::Own => {
            let wanted = "a controller with a gain matrix (lqr, lqr-feedforward, lqr-integral), or \
                          one of the firmware's (pid, geometric)";
            let hint = "no table of gains can describe this controller";
            return Err(Error::input("controller.kind", kind.name(), wanted, hint));
        }
    };
    Ok(vec![File::new("gains.json", format!("{json:#}\n"))])
}

/// Returns a C header with the gain matrices of the regulator and the observer, in SI units.
fn header(design: &Design, sim: &SimOptions) -> String {
    let k = design.k.as_ref().expect("a regulator has a gain");
    format!(
        "// Gains by noctograph. SI units: m, rad, m/s, rad/s, N m, N.\n\
         // u = u_hover - K (x - x_des), u = [{}], u_hover = [0, 0, 0, mass * 9.81]\n\
         // x = [{}]\n\
         #define VEHICLE_MASS {:.9e}f\n\
         {}\n// Observer: dx/dt = A x + B u - L (C x - y), x = [o_x, o_y, o_z, theta, phi, v_x, v_y, \
         v_z],\n// y = position\n{}",
        INPUTS.join(", "),
        design.states.join(", "),
        sim.vehicle.mass_kg,
        table("K", k),
        table("L", &design.l),
    )
}

/// Returns the C definition of a matrix as a constant array, with nine digits after the point.
fn table(name: &str, matrix: &DMatrix<f64>) -> String {
    let rows = matrix.row_iter().map(|row| {
        let entries: Vec<String> = row.iter().map(|entry| format!("{entry:.9e}f")).collect();
        format!("  {{{}}},\n", entries.join(", "))
    });
    let (n_rows, n_columns) = matrix.shape();
    let rows: String = rows.collect();
    format!("static const float {name}[{n_rows}][{n_columns}] = {{\n{rows}}};\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use noctograph_sim::ControllerKind;

    #[test]
    fn lees_attitude_gains_are_torques() {
        let mut sim = SimOptions::default();
        assert_eq!(parameters(&sim), [], "a regulator of one's own has no parameters");
        sim.controller.kind = ControllerKind::Geometric;
        let parameters = parameters(&sim);
        let gain = |name: &str| parameters.iter().find(|(n, _)| n == name).map(|(_, gain)| *gain);
        assert_eq!(gain("ctrlLee.Kpos_Pz"), Some(9.8));
        let torque = sim.vehicle.inertia_kg_m2[1] * 384.0;
        assert_eq!(gain("ctrlLee.KR_y"), Some(torque));
    }

    #[test]
    fn mellingers_gains_ask_for_the_same_thrust_and_torques_as_lees() {
        let mut sim = SimOptions::default();
        // A command of the firmware corresponds to two of the scene's.
        let command = 2.0;
        sim.vehicle.motor_max = command * 65_535.0;
        fn by_name(parameters: Parameters) -> std::collections::BTreeMap<String, f64> {
            parameters.into_iter().collect()
        }
        let (lee, mellinger) = (by_name(lee(&sim)), by_name(mellinger(&sim)));
        let vehicle = &sim.vehicle;
        let force = mellinger["ctrlMel.kp_z"] * 0.01;
        assert!((force - lee["ctrlLee.mass"] * lee["ctrlLee.Kpos_Pz"] * 0.01).abs() < 1e-12);
        // The expected value is the motor torque commanded for an error of 0.1 rad.
        let error = 2.0 * libm::sin(0.1);
        let roll = mellinger["ctrlMel.kR_xy"] * error;
        let torque = 4.0 * (command * roll / 2.0) * vehicle.k_f_n * vehicle.arm_m;
        let want = 0.5 * (lee["ctrlLee.KR_x"] + lee["ctrlLee.KR_y"]) * libm::sin(0.1);
        assert!((torque / want - 1.0).abs() < 1e-12, "{torque} N m instead of {want} N m");
        let torque = 4.0 * command * mellinger["ctrlMel.kw_z"] * vehicle.k_m_n_m;
        assert!((torque / lee["ctrlLee.Kw_z"] - 1.0).abs() < 1e-12, "{torque} N m s");
        // The gains are comparable to the firmware's default values 70 000, 20 000 and 132 000.
        assert!((10_000.0..100_000.0).contains(&(command * mellinger["ctrlMel.kR_xy"])));
        assert!((120_000.0..140_000.0).contains(&(command * mellinger["ctrlMel.massThrust"])));
    }

    #[test]
    fn pid_gains_have_the_names_of_the_firmware() {
        let parameters = pid(&SimOptions::default());
        assert_eq!(parameters.len(), 37);
        let gain = |name: &str| parameters.iter().find(|(n, _)| n == name).map(|(_, gain)| *gain);
        assert_eq!(gain("posCtlPid.zKi"), Some(0.5));
        assert_eq!(gain("velCtlPid.vxKp"), Some(25.0));
        assert_eq!(gain("pid_attitude.yaw_kd"), Some(0.35));
        let rate = SimOptions::default().controller.pid.roll_rate;
        assert_eq!(gain("pid_rate.roll_ki"), Some(rate[1]), "the scene's");
    }

    #[test]
    fn each_controller_is_written_as_what_it_is_and_one_without_a_table_is_refused() {
        for kind in ControllerKind::ALL {
            let mut sim = SimOptions::default();
            sim.controller.kind = *kind;
            let groups: std::collections::BTreeSet<String> = parameters(&sim)
                .into_iter()
                .map(|(name, _)| name.split_once('.').unwrap().0.to_owned())
                .collect();
            let groups: Vec<&str> = groups.iter().map(String::as_str).collect();
            let pid = ["pid_attitude", "pid_rate", "posCtlPid", "velCtlPid"];
            let (name, own): (_, &[&str]) = match kind.name() {
                "lqr" | "lqr-feedforward" | "lqr-integral" => (Ok("gains.h"), &[]),
                "pid" => (Ok("gains.json"), &pid),
                "geometric" => (Ok("gains.json"), &["ctrlLee"]),
                _without_a_table => (Err("controller.kind"), &[]),
            };
            assert_eq!(groups, own, "{}", kind.name());
            match (files(&sim), name) {
                (Ok(files), Ok(name)) => assert_eq!(files[0].name, name, "{}", kind.name()),
                (Err(error), Err(key)) => assert!(error.to_string().contains(key), "{error}"),
                (parameters, _) => panic!("{}: {parameters:?}", kind.name()),
            }
        }
    }

    #[test]
    fn the_regulators_table_is_c() {
        let file = files(&SimOptions::default()).unwrap().swap_remove(0);
        let text = String::from_utf8(file.bytes).unwrap();
        assert!(text.contains("static const float K[4][12] = {\n  {"), "{text}");
        assert_eq!(text.matches("},\n").count(), 4 + 8, "rows of K and L: {text}");
    }
}
