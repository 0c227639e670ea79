//! Log variables that [`crate::logs`] reads, configured for cfclient, the µSD card and the script.
//!
//! Formats: cfclient log configurations (`cfclient/configs/log/*.json`), and `config.txt` for the
//! µSD deck (firmware documentation, "Micro SD card deck"). A radio block can contain 26 bytes.

use serde_json::json;

use super::File;

/// Block: its name, and its variables separated by blanks.
type Block = (&'static str, &'static str);

/// Blocks of variables that any Crazyflie has.
pub(super) const BLOCKS: [Block; 5] = [
    (
        "position",
        "stateEstimate.x stateEstimate.y stateEstimate.z \
         stateEstimate.vx stateEstimate.vy stateEstimate.vz",
    ),
    ("attitude", "stateEstimate.yaw stateEstimate.pitch stateEstimate.roll"),
    ("rate", "gyro.x gyro.y gyro.z"),
    ("target", "ctrltarget.x ctrltarget.y ctrltarget.z"),
    ("motors", "motor.m1 motor.m2 motor.m3 motor.m4 pm.vbat"),
];

/// Blocks of variables from the AE483 course's observer.
pub(super) const OBSERVER_BLOCKS: [Block; 1] = [(
    "observer",
    "ae483log.o_x ae483log.o_y ae483log.o_z ae483log.psi ae483log.theta ae483log.phi",
)];

/// Blocks of variables that the exported script monitors on the ground and in the air.
pub(super) const WATCH_BLOCKS: [Block; 2] = [
    (
        "where",
        "stateEstimate.x stateEstimate.y stateEstimate.z kalman.varPX kalman.varPY kalman.varPZ",
    ),
    ("state", "stateEstimate.yaw stateEstimate.pitch stateEstimate.roll pm.vbat supervisor.info"),
];

/// Returns the type in which a variable is logged.
fn kind(variable: &str) -> &'static str {
    let is_short = variable.starts_with("motor.") || variable == "supervisor.info";
    if is_short { "uint16_t" } else { "float" }
}

/// Period of the blocks sent by radio, ms.
const PERIOD_MS: u32 = 20;
/// Rate of the µSD log, Hz.
const CARD_HZ: u32 = 250;

/// Returns blocks as a Python dictionary literal: block, variable and type.
pub(super) fn python(blocks: &[Block]) -> String {
    let blocks = blocks.iter().map(|(name, variables)| {
        let variables = variables.split(' ').map(|name| format!("{name:?}: {:?}", kind(name)));
        format!("    {name:?}: {{{}}},\n", variables.collect::<Vec<_>>().join(", "))
    });
    format!("{{\n{}}}", blocks.collect::<String>())
}

/// Returns a cfclient log configuration for each block, and `config.txt` for the µSD card.
pub(super) fn files() -> Vec<File> {
    let radio = BLOCKS.iter().map(|(name, variables)| {
        let variables = variables.split(' ').map(|name| {
            json!({ "name": name, "type": "TOC", "stored_as": kind(name), "fetch_as": kind(name) })
        });
        let block = json!({
            "name": format!("noctograph-{name}"), "period": PERIOD_MS,
            "variables": variables.collect::<Vec<_>>(),
        });
        let text = format!("{:#}\n", json!({ "logconfig": { "logblock": block } }));
        File::new(format!("noctograph-{name}.json"), text)
    });
    // The card logs all variables at one rate, without blocks.
    let mut card = format!(
        "1     # version\n1024  # buffer size in bytes\nlog   # file name\n0     # enable on startup \
         (0/1): set usd.logging to 1 before take-off, and to 0 after landing\n\
         on:fixedFrequency\n{CARD_HZ}   # frequency in Hz\n1     # mode (0: disabled, 1: \
         synchronous stabilizer, 2: asynchronous)\n"
    );
    for name in BLOCKS.iter().flat_map(|(_, variables)| variables.split(' ')) {
        card += &format!("{name}\n");
    }
    radio.chain([File::new("config.txt", card)]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_fits_its_packet() {
        for (name, variables) in BLOCKS.iter().chain(&OBSERVER_BLOCKS).chain(&WATCH_BLOCKS) {
            let size = |variable: &str| if kind(variable) == "float" { 4 } else { 2 };
            let bytes: usize = variables.split(' ').map(size).sum();
            assert!(bytes <= 26, "{name}: {bytes} bytes");
        }
    }
}
