//! A Python script that flies a plan with cflib, switches its lights and records the flight.
//!
//! The script is `cflib.py`; the plan enters as one JSON text in a string literal, so that no word
//! becomes code.

use serde_json::{Value, json};

use super::compressed::{Compressed, MEMORY_BYTES};
use super::lights::{LampColors, preparation, writes};
use super::pieces::Stretch;
use crate::error::{Error, Result};
use crate::plan::Plan;

/// The script, with `@DATA@` in place of the plan.
const SCRIPT: &str = include_str!("cflib.py");

/// What the script sends while writing, if its user asks for nothing else.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    /// Positions, as the plan sends them.
    #[default]
    Position,
    /// Position, velocity and acceleration of the design.
    FullState,
    /// A compressed trajectory on board.
    Trajectory,
}

/// The script for one drone. `word` names its log.
///
/// # Errors
///
/// [`Error::Input`] for a plan without letters or with a lamp that has no parameter,
/// [`Error::Infeasible`] where a trajectory was asked for and does not fit.
pub fn script(
    plan: &Plan,
    word: &str,
    colors: LampColors,
    mode: Mode,
    tolerance_m: f64,
) -> Result<String> {
    let data = data(plan, word, colors, mode, tolerance_m)?;
    // A JSON text as a JSON string is a Python string literal as well.
    let literal = serde_json::to_string(&data.to_string()).expect("text is serializable");
    Ok(SCRIPT.replace("@DATA@", &literal))
}

fn data(
    plan: &Plan,
    word: &str,
    colors: LampColors,
    mode: Mode,
    tolerance_m: f64,
) -> Result<Value> {
    let stretch = Stretch::new(plan)?;
    let trajectory = Compressed::encode(plan, tolerance_m)?;
    let bytes = trajectory.to_bytes();
    if mode == Mode::Trajectory && bytes.len() > MEMORY_BYTES {
        return Err(Error::Infeasible {
            what: format!(
                "the trajectory has {} bytes, the drone's memory {MEMORY_BYTES}",
                bytes.len()
            ),
            hint: "write fewer letters, allow a larger distance from the design, or send positions"
                .into(),
        });
    }
    let lights = writes(plan, colors)?;
    let setpoints = plan.setpoints.iter().enumerate().map(|(i, s)| {
        let [sent, p, v, a] = [plan.sent_m(i), s.position_m, s.velocity_m_s, s.acceleration_m_s2]
            .map(|vector| [vector.x, vector.y, vector.z]);
        json!([s.time_s, sent, p, v, a])
    });
    let first_m = stretch.setpoint(0).position_m;
    let start_m = plan.setpoints[0].position_m;
    let (from_s, to_s) = (stretch.start_s(), stretch.start_s() + stretch.duration_s());
    let stem: String = word.chars().filter(|c| c.is_ascii_alphanumeric()).collect();
    Ok(json!({
        "word": word,
        "mode": match mode {
            Mode::Position => "position",
            Mode::FullState => "full-state",
            Mode::Trajectory => "trajectory",
        },
        "clock": 1.0,
        "log": format!("{}_flight.json", if stem.is_empty() { "light" } else { &stem }),
        "start_m": [start_m.x, start_m.y, start_m.z],
        "first_m": [first_m.x, first_m.y, first_m.z],
        "write_from_s": from_s,
        "write_to_s": to_s,
        "parameters": parameters(plan),
        "controllers": { "position": 1, "full_state": 2, "trajectory": 2 },
        "dark": [["ring.headlightEnable", 0], ["ring.effect", 0]],
        "lights": lights.iter().map(|w| json!([w.time_s, w.parameter, w.value])).collect::<Vec<_>>(),
        "setpoints": setpoints.collect::<Vec<_>>(),
        "trajectory": {
            "start_s": from_s,
            "pieces": trajectory.n_pieces(),
            "hex": bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>(),
        },
    }))
}

/// Parameters that are set before the flight: estimator, high-level commander, dark lamps.
fn parameters(plan: &Plan) -> Vec<(&'static str, u32)> {
    let mut parameters = vec![("stabilizer.estimator", 2), ("commander.enHighLevel", 1)];
    parameters.extend(preparation(plan));
    parameters
}
