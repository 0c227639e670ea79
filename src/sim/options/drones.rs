//! Drones of the presets for tests, created from the scene files that `pipeline` contains.

use super::{ControllerKind, EstimatorKind, SimOptions};
use crate::sensors::Positioning;

/// Tables of a scene that the simulator reads, without the table `air`, so that the air is still.
const TABLES: [&str; 8] =
    ["rates", "vehicle", "battery", "floor", "radio", "controller", "observer", "sensors"];

const CF21: &str = include_str!("../../pipeline/scene/presets/cf21.toml");
const CF_BRUSHLESS: &str = include_str!("../../pipeline/scene/presets/cf-brushless.toml");
const BZZZ: &str = include_str!("../../pipeline/scene/presets/bzzz.toml");

/// Returns the drone of a scene file whose keys override those of another drone. Both texts are
/// presets of this program, so an error in one is a defect.
fn preset(begin_toml: &str, scene_toml: &str) -> SimOptions {
    let [mut scene, keys] =
        [begin_toml, scene_toml].map(|toml| toml.parse::<toml::Table>().expect("TOML"));
    merge(&mut scene, keys);
    scene.retain(|key, _| TABLES.contains(&key));
    scene.try_into().expect("a preset's tables are settings")
}

/// Adds the keys of a table to another table, replaces existing values, and merges nested tables.
fn merge(into: &mut toml::Table, from: toml::Table) {
    for (key, value) in from {
        match (into.get_mut(&key), value) {
            (Some(toml::Value::Table(into)), toml::Value::Table(from)) => merge(into, from),
            (_, value) => drop(into.insert(key, value)),
        }
    }
}

/// Returns a preset's drone with the controller, estimator and positioning of the reference team.
/// The presets have still air.
fn with_regulator(begin_toml: &str, scene_toml: &str) -> SimOptions {
    let mut sim = preset(begin_toml, scene_toml);
    sim.controller.kind = ControllerKind::default();
    sim.observer.kind = EstimatorKind::default();
    sim.sensors.positioning = Positioning::default();
    sim
}

impl SimOptions {
    pub(crate) fn cf21() -> Self {
        with_regulator(CF21, "")
    }

    pub(crate) fn cf_brushless() -> Self {
        with_regulator(CF21, CF_BRUSHLESS)
    }

    pub(crate) fn bzzz() -> Self {
        preset(CF21, BZZZ)
    }
}
