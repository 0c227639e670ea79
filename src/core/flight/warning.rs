//! Warnings of a flight.

use std::collections::BTreeSet;
use std::fmt;

use super::Quantity;

/// A warning of a flight.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// A motor was at its limit while the drone wrote, for so many seconds.
    MotorAtLimit(f64),
    /// The battery could not give the thrust asked for, for so many seconds.
    BatteryWeak(f64),
    /// The battery was empty, and the motors stopped.
    BatteryEmpty,
    /// Fewer than two base stations saw the drone, for so many seconds.
    Unseen(f64),
    /// The host was silent for so long that the motors stopped, at so many seconds.
    HostSilent(f64),
    /// The drone never left the floor, though its plan does; its highest motor command.
    OnFloor(f64),
    /// Quantities that its file lacks, which are zeros in the samples.
    Unlogged(BTreeSet<Quantity>),
    /// Of its file: omitted data, assumed units and columns.
    File(String),
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MotorAtLimit(s) => {
                write!(f, "a motor was at its limit for {s:.2} s while writing")
            }
            Self::BatteryWeak(s) => {
                write!(f, "the battery could not give the thrust asked for during {s:.2} s")
            }
            Self::BatteryEmpty => f.write_str("the battery was empty and the motors stopped"),
            Self::Unseen(s) => write!(f, "fewer than two base stations saw the drone for {s:.2} s"),
            Self::HostSilent(s) => {
                write!(f, "no setpoint came for 2 s and the motors stopped at {s:.1} s")
            }
            Self::OnFloor(most) => write!(
                f,
                "the drone never left the floor: its motor commands reach {most:.1} of 65535"
            ),
            Self::Unlogged(quantities) => {
                let names: Vec<&str> = quantities.iter().map(|quantity| quantity.name()).collect();
                write!(f, "not in the log: {}", names.join(", "))
            }
            Self::File(text) => f.write_str(text),
        }
    }
}
