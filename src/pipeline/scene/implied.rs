//! Keys that imply others: if a scene sets one of them, some other keys take matching values in
//! place of the preset's, unless the scene sets those as well.

use toml::{Table, Value};

use super::Scene;
use noctograph_core::camera::Metering;
use noctograph_core::lamps::HEADLIGHTS;
use noctograph_picture::light::{Deck, RING, RingColor, RingEffect};
use noctograph_plan::PlanOptions;

/// Conditions on a scene's keys, and the values that they imply, as listed above a printed scene.
pub(super) const RULES: [(&str, &str); 4] = [
    ("plan.style", "every other key of [plan] is that style's default"),
    ("light.deck = \"color-led\"", "plan.lights = [\"color-led\"], because it has no headlights"),
    ("plan.lights = [\"ring\"] without light.ring", "light.ring = \"solid\""),
    ("camera.f_number or camera.iso, without camera.metering", "camera.metering = \"off\""),
];

/// Sets the values that the layers above a preset imply in its scene, by [`RULES`] in order. Layer
/// 0 is the file, from which the ring's effect is removed if it must not apply.
pub(super) fn apply(scene: &mut Scene, layers: &mut [Table]) {
    match last_name(layers, "plan.style") {
        Some("even") => scene.plan = PlanOptions::even(),
        Some(_) => scene.plan = PlanOptions::default(),
        None => {}
    }
    let deck = last_name(layers, "light.deck").and_then(|name| name.parse::<Deck>().ok());
    if let Some(channel) = deck.map(Deck::channel).filter(|channel| *channel != HEADLIGHTS) {
        scene.plan.lights = vec![channel.to_owned()];
    }
    if chooses_ring(layers) {
        scene.light.ring = RingEffect::Solid(RingColor::default());
        // A ring that is chosen for one run is switched on regardless of the effect in the file.
        if let Some(Value::Table(light)) = layers[0].get_mut("light") {
            light.remove("ring");
        }
    }
    let [sets_f_number, sets_iso, sets_metering] =
        ["camera.f_number", "camera.iso", "camera.metering"]
            .map(|key| layers.iter().any(|layer| value_at(layer, key).is_some()));
    if (sets_f_number || sets_iso) && !sets_metering {
        scene.camera.metering = Metering::Off;
    }
}

/// Returns true if `plan.lights` contains only the ring and no effect is set for it. Layer 0 is the
/// file. Its effect is ignored if a higher layer sets `plan.lights`.
fn chooses_ring(layers: &[Table]) -> bool {
    let layers_down = layers.iter().enumerate().rev();
    let mut choices =
        layers_down.filter_map(|(n, layer)| Some((n, value_at(layer, "plan.lights")?)));
    let Some((layer, lights)) = choices.next() else { return false };
    let names = lights.as_array().into_iter().flatten().map(Value::as_str);
    names.eq([Some(RING.name)])
        && last_name(&layers[usize::from(layer > 0)..], "light.ring").is_none()
}

/// Returns the value of a dotted key, or `None` if the table lacks it.
pub(super) fn value_at<'a>(layer: &'a Table, key: &str) -> Option<&'a Value> {
    let mut keys = key.split('.');
    let first = layer.get(keys.next()?);
    keys.fold(first, |value, key| value?.get(key))
}

/// Returns the name of a choice, which is a string or the `kind` of a table, from the highest layer
/// that has the key.
pub(super) fn last_name<'a>(layers: &'a [Table], key: &str) -> Option<&'a str> {
    layers.iter().rev().find_map(|layer| {
        let value = value_at(layer, key)?;
        value.as_str().or_else(|| value.get("kind")?.as_str())
    })
}
