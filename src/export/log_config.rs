//! What to log in a flight: the variables that [`crate::logs`] reads, for cfclient, for the µSD
//! card and for our own script.
//!
//! Formats: log configurations of cfclient (`cfclient/configs/log/*.json`), and `config.txt` of the
//! µSD deck (firmware documentation, "Micro SD card deck"). A radio block holds 26 bytes.

use serde_json::json;

use super::File;

/// Logged variables of a block: name and type.
type Block = (&'static str, &'static [(&'static str, &'static str)]);

/// Blocks of variables that any Crazyflie has.
pub(super) const BLOCKS: [Block; 5] = [
    (
        "position",
        &[
            ("stateEstimate.x", "float"),
            ("stateEstimate.y", "float"),
            ("stateEstimate.z", "float"),
            ("stateEstimate.vx", "float"),
            ("stateEstimate.vy", "float"),
            ("stateEstimate.vz", "float"),
        ],
    ),
    (
        "attitude",
        &[
            ("stateEstimate.yaw", "float"),
            ("stateEstimate.pitch", "float"),
            ("stateEstimate.roll", "float"),
        ],
    ),
    ("rate", &[("gyro.x", "float"), ("gyro.y", "float"), ("gyro.z", "float")]),
    ("target", &[("ctrltarget.x", "float"), ("ctrltarget.y", "float"), ("ctrltarget.z", "float")]),
    (
        "motors",
        &[
            ("motor.m1", "uint16_t"),
            ("motor.m2", "uint16_t"),
            ("motor.m3", "uint16_t"),
            ("motor.m4", "uint16_t"),
            ("pm.vbat", "float"),
        ],
    ),
];

/// Blocks of the AE483 course's observer.
pub(super) const OBSERVER_BLOCKS: [Block; 1] = [(
    "observer",
    &[
        ("ae483log.o_x", "float"),
        ("ae483log.o_y", "float"),
        ("ae483log.o_z", "float"),
        ("ae483log.psi", "float"),
        ("ae483log.theta", "float"),
        ("ae483log.phi", "float"),
    ],
)];

/// Blocks by which the exported script judges the drone on the ground and in the air.
pub(super) const WATCH_BLOCKS: [Block; 2] = [
    (
        "where",
        &[
            ("stateEstimate.x", "float"),
            ("stateEstimate.y", "float"),
            ("stateEstimate.z", "float"),
            ("kalman.varPX", "float"),
            ("kalman.varPY", "float"),
            ("kalman.varPZ", "float"),
        ],
    ),
    (
        "state",
        &[
            ("stateEstimate.yaw", "float"),
            ("stateEstimate.pitch", "float"),
            ("stateEstimate.roll", "float"),
            ("pm.vbat", "float"),
            ("supervisor.info", "uint16_t"),
        ],
    ),
];

/// Period of the radio's blocks, ms.
const PERIOD_MS: u32 = 20;
/// Rate of the µSD log, Hz.
const CARD_HZ: u32 = 250;

/// Blocks as a Python dictionary.
pub(super) fn python(blocks: &[Block]) -> String {
    let block = |(name, variables): &Block| {
        let variables = variables.iter().map(|(name, kind)| format!("{name:?}: {kind:?}"));
        format!("    {name:?}: {{{}}},\n", variables.collect::<Vec<_>>().join(", "))
    };
    format!("{{\n{}}}", blocks.iter().map(block).collect::<String>())
}

/// One configuration of cfclient for each block, and `config.txt` for the µSD card.
pub(super) fn files() -> Vec<File> {
    let radio = BLOCKS.iter().map(|(name, variables)| {
        let variables = variables.iter().map(|(name, kind)| {
            json!({ "name": name, "type": "TOC", "stored_as": kind, "fetch_as": kind })
        });
        let block = json!({
            "name": format!("noctograph-{name}"), "period": PERIOD_MS,
            "variables": variables.collect::<Vec<_>>(),
        });
        let text = format!("{:#}\n", json!({ "logconfig": { "logblock": block } }));
        File::new(format!("noctograph-{name}.json"), text)
    });
    let mut card = format!(
        "1     # version\n1024  # buffer size in bytes\nlog   # file name\n0     # enable on startup \
         (0/1): set usd.logging to 1 before take-off, and to 0 after landing\n\
         on:fixedFrequency\n{CARD_HZ}   # frequency in Hz\n1     # mode (0: disabled, 1: \
         synchronous stabilizer, 2: asynchronous)\n"
    );
    for (name, _) in BLOCKS.iter().flat_map(|(_, variables)| *variables) {
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
            let size = |kind: &str| if kind == "float" { 4 } else { 2 };
            let bytes: usize = variables.iter().map(|(_, kind)| size(kind)).sum();
            assert!(bytes <= 26, "{name}: {bytes} bytes");
        }
    }
}
