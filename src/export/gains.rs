//! Gains of a scene's controller for the firmware: parameters, or a table in C.
//!
//! - `geometric`: parameters `ctrlLee.*` (firmware `controller_lee.c`), whose attitude gains are
//!   torques (N m per rad) where the scene's are angular accelerations; and the position loop of
//!   `ctrlMel.*` (`controller_mellinger.c`), in N per m. Mellinger's attitude gains are in units of
//!   the motors and stay the firmware's.
//! - `pid`: none. The scene flies the firmware's own gains.
//! - `lqr` and its kin: the matrix as a C header, for a controller of one's own such as that of the
//!   AE483 course.

use std::fmt::Write;

use nalgebra::DMatrix;
use serde_json::{Map, json};

use super::File;
use crate::error::Result;
use crate::sim::design::{Design, INPUTS, MOTOR_LAG_S, design};
use crate::sim::{ControllerKind, SimOptions};

/// Firmware parameters of the scene's controller.
pub(super) fn parameters(sim: &SimOptions) -> Vec<(String, f64)> {
    if sim.controller.kind != ControllerKind::Geometric {
        return Vec::new();
    }
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

/// Position loop of Mellinger's controller with the same stiffness.
fn mellinger(sim: &SimOptions) -> Vec<(String, f64)> {
    let (k, mass_kg) = (&sim.controller.geometric, sim.vehicle.mass_kg);
    let axis = |axis: &str| {
        let gains = [("kp", k.k_position), ("kd", k.k_velocity), ("ki", k.k_position_integral)];
        gains.map(|(name, gain)| (format!("ctrlMel.{name}_{axis}"), mass_kg * gain))
    };
    let mass = ("ctrlMel.mass".to_owned(), mass_kg);
    [axis("xy"), axis("z")].concat().into_iter().chain([mass]).collect()
}

/// The gains as files: `gains.json` with firmware parameters, or `gains.h`.
///
/// # Errors
///
/// As [`design`].
pub(super) fn files(sim: &SimOptions) -> Result<Vec<File>> {
    let object = |parameters: Vec<(String, f64)>| -> Map<String, serde_json::Value> {
        parameters.into_iter().map(|(name, gain)| (name, json!(gain))).collect()
    };
    let json = match sim.controller.kind {
        ControllerKind::Geometric => json!({
            "lee": { "stabilizer.controller": 5, "parameters": object(parameters(sim)) },
            "mellinger": { "stabilizer.controller": 2, "parameters": object(mellinger(sim)) },
        }),
        ControllerKind::Pid => json!({
            "pid": { "stabilizer.controller": 1, "parameters": {} },
        }),
        ControllerKind::Lqr
        | ControllerKind::LqrFeedforward
        | ControllerKind::LqrIntegral
        | ControllerKind::Altitude => {
            return Ok(vec![File::new("gains.h", header(&design(sim, MOTOR_LAG_S)?, sim))]);
        }
    };
    Ok(vec![File::new("gains.json", format!("{json:#}\n"))])
}

/// The regulator and its observer in C.
fn header(design: &Design, sim: &SimOptions) -> String {
    let (rows, columns) = design.k.shape();
    let mut text = format!(
        "// Gains by noctograph. SI units: m, rad, m/s, rad/s, N m, N.\n\
         // u = u_hover - K (x - x_des), u = [{}], u_hover = [0, 0, 0, mass * 9.81]\n\
         // x = [{}]\n\
         #define VEHICLE_MASS {:.9e}f\n\
         static const float K[{rows}][{columns}] = {{\n",
        INPUTS.join(", "),
        design.states.join(", "),
        sim.vehicle.mass_kg,
    );
    text += &body(&design.k);
    let (rows, columns) = design.l.shape();
    let _ = write!(
        text,
        "}};\n\n// Observer: dx/dt = A x + B u - L (C x - y), x = [o_x, o_y, o_z, theta, phi, v_x, v_y, \
         v_z],\n// y = position\nstatic const float L[{rows}][{columns}] = {{\n"
    );
    text + &body(&design.l) + "};\n"
}

fn body(matrix: &DMatrix<f64>) -> String {
    let row = |row: nalgebra::DVector<f64>| {
        let entries = row.iter().map(|entry| format!("{entry:.9e}f")).collect::<Vec<_>>();
        format!("  {{{}}},\n", entries.join(", "))
    };
    matrix.row_iter().map(|r| row(r.transpose())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lees_attitude_gains_are_torques() {
        let mut sim = SimOptions::default();
        assert_eq!(parameters(&sim), [], "a regulator of one's own has no parameters");
        sim.controller.kind = ControllerKind::Geometric;
        let found = parameters(&sim);
        let gain = |name: &str| found.iter().find(|(n, _)| n == name).map(|(_, gain)| *gain);
        assert_eq!(gain("ctrlLee.Kpos_Pz"), Some(9.8));
        let torque = sim.vehicle.inertia_kg_m2[1] * 384.0;
        assert_eq!(gain("ctrlLee.KR_y"), Some(torque));
        assert!((mellinger(&sim)[0].1 - 9.8 * sim.vehicle.mass_kg).abs() < 1e-12, "N/m");
    }

    #[test]
    fn the_regulators_table_is_c() {
        let text = files(&SimOptions::default()).unwrap().swap_remove(0).text();
        assert!(text.contains("static const float K[4][12] = {\n  {"), "{text}");
        assert_eq!(text.matches("},\n").count(), 4 + 8, "rows of K and L: {text}");
    }
}
